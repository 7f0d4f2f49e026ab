"""`eaid export`: gains and fit → source for a rig."""

import shlex
import sys
from pathlib import Path

import eaid
from eaid.cli import console
from eaid.cli.form import Common, argument, takes, written
from eaid.errors import DataError, UsageError
from eaid.options import ExportOptions


@takes
def command(
    args: Common, how: ExportOptions,
    files: list[Path] = argument("GAINS [FIT]", "gains.json, and fit.json for inverse and plant."),
    output: Path = written("export", "Folder that is written."),
) -> None:  # fmt: skip
    """Controllers and plant as source for a rig: a folder with test vectors, a check program and a page how to begin.

    Exit code 5: a loop is unstable at the rate, or a result marked stop is behind it; --anyway exports it, marked.

    Example: eaid export gains.json fit.json --as arduino --precision single --rate-hz 500
    """
    from eaid.export.export import export as exported
    from eaid.results.common import Input
    from eaid.results.summary import of_fit

    gains, fit, paths = _read(files)
    inputs = tuple(Input.of(path) for path in paths)
    command = shlex.join(["eaid", *sys.argv[1:]]) if sys.argv[1:2] == ["export"] else ""
    made = exported(gains, fit, how, output, args.force, command, inputs)
    for line in of_fit(fit) if fit is not None else ():
        console.say(line)
    console.tell(made.findings, args.verbose)
    if args.json:
        console.print_json(made)
    summary = f"{', '.join(made.laws)} as {made.target}, {len(made.files)} files"
    console.done(made.path, summary, f"read {made.path / 'README.md'}")


def _read(paths: list[Path]) -> "tuple[eaid.Gains | None, eaid.Fit | None, list[Path]]":
    """Gains, a fit, or both; the fit that the gains name is taken where it lies beside them, unchanged."""
    from eaid.control.gains import plant_of
    from eaid.export.export import fit_beside
    from eaid.results import codec

    files: dict[str, Path] = {}
    for path in paths:
        kind = codec.kind_of(path) if path.is_file() else "gains"  # which is then told as missing
        if kind not in ("gains", "fit"):
            raise DataError(f"{path}: is neither gains.json nor fit.json; give what eaid tune-rc or eaid fit wrote")
        if kind in files:
            raise UsageError(f"{path}: a second {kind}.json; give one gains.json and one fit.json at most")
        files[kind] = path
    gains, warnings = codec.read(files["gains"], eaid.Gains) if "gains" in files else (None, ())
    if gains is not None and "fit" not in files and (beside := fit_beside(gains, files["gains"])) is not None:
        files["fit"] = beside
        console.say(f"with {beside}, which the gains were made from")
    fit, more = codec.read(files["fit"], eaid.Fit) if "fit" in files else (None, ())
    if fit is not None and plant_of(fit) is None:
        raise DataError(f"{files['fit']}: holds no plant; fit clutch logs with a nonlinear model, or logs as recorded")
    console.tell((*warnings, *more))
    return gains, fit, list(files.values())
