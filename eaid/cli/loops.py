"""`eaid tune-rc`, `simulate`, `couple` and `export`: a fit → gains, replays, virtual walls, source for a rig."""

import shlex
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import eaid
from eaid.cli import console
from eaid.cli.form import Common, argument, stamped, takes, tell_result, written
from eaid.declared import any_text, option
from eaid.errors import DataError, UsageError
from eaid.files import refuse_to_overwrite, sha256_of
from eaid.options import (
    ROBUST,
    TRACKED,
    WHAT,
    Columns,
    CoupleOptions,
    ExportOptions,
    ReadOptions,
    SimulateOptions,
    TuneOptions,
)

if TYPE_CHECKING:
    from eaid.findings import Finding


@dataclass(frozen=True, kw_only=True)
class FitAndGains(Common):
    """Of commands that take a fit and, for closed loops, gains."""

    fit: Path = argument("FIT", "fit.json of eaid fit, with a nonlinear model.")
    gains_placed: Path | None = argument("GAINS", "The same as --gains.", None)
    gains: Path | None = option(None, "gains.json of eaid tune-rc; closed loops need it.", WHAT, shown="FILE")

    def read(self) -> "tuple[eaid.Fit, eaid.Gains | None, tuple[Finding, ...]]":
        """Both, and what is to be told of their files."""
        from eaid.results import codec
        from eaid.results.gains import of_another_fit

        fit, warnings = codec.read_as(self.fit, eaid.Fit)
        gains, more = codec.read_as(self.gains, eaid.Gains) if self.gains else (None, ())
        return fit, gains, (*warnings, *more, *of_another_fit(gains, sha256_of(self.fit)))


@takes
def tune_rc(
    args: Common, how: TuneOptions,
    fit: Path = argument("FIT", "fit.json of eaid fit; only its linear part is needed."),
    reference: str | None = option(
        None, "Q_M is taken from it, or judged by it.", ROBUST, words=TRACKED, read=any_text, shown="FILE|WORD"
    ),
    output: Path = written("gains.json"),
) -> None:  # fmt: skip
    """Gains of the robust controller and of a PI from a fit, with one verdict on the guarantee.

    Exit code 5: the fit or the wishes are not physical, out of reach, or unstable on the linear model.

    Example: eaid tune-rc fit.json --b-hat minimax --phi data -o gains.json
    """
    from eaid.report.tables import gains as tables
    from eaid.results import codec
    from eaid.results.summary import list_cautions

    file = Path(reference) if reference and reference not in TRACKED else None
    fitted, warnings = codec.read_as(fit, eaid.Fit)
    refuse_to_overwrite(output, args.force, filter(None, (fit, file)))
    gains = stamped(eaid.tune_rc(fitted, how, reference=reference), args, fit=fit, reference=file)
    gains.save(output, args.force)
    shown = tables.tables_of(gains)[: None if args.verbose else 1]
    tell_result(
        args, gains, [*list_cautions(fitted), *tables.guarantee_story(gains), *shown], [*gains.findings, *warnings]
    )
    console.done(output, f"gains of {' and '.join(gains.laws)}", ("simulate", fit, output))


@takes
def simulate(
    how: SimulateOptions, columns: Columns, args: FitAndGains,
    reference: Path | None = option(None, "A reference of your own: CSV time_s,reference_nm.", WHAT, shown="FILE"),
    log: list[Path] | None = option(None, "Recorded runs: their input through the plant.", WHAT, shown="FILE"),
    output: Path = written("replay.h5"),
) -> None:  # fmt: skip
    """Replay controllers on the fitted plant, from rest, and measure how well they track.

    Example: eaid simulate fit.json --gains gains.json --scenario sweep --noise-nm 0.01
    """
    from eaid.logs.folders import files_read
    from eaid.report.tables.replays import tables_of
    from eaid.results.replay_file import as_json, write_replay
    from eaid.results.summary import list_cautions

    if not log and columns.given():
        raise UsageError("--columns, --units, --repair and --variable belong to --log; leave them out")
    fitted, tuned, warnings = args.read()
    files = {"fit": args.fit, "gains": args.gains, "reference": reference}
    refuse_to_overwrite(output, args.force, [*filter(None, files.values()), *files_read(log or [])])
    reading = ReadOptions(**columns.given()) if log else None
    replay = eaid.simulate(
        fitted, tuned, options=how, reference=reference, log=log, reading=reading, progress=console.progress
    )
    replay = replace(replay, head=stamped(replay.head, args, **files, log=log))
    write_replay(output, replay, args.force)
    tell_result(args, as_json(replay), [*list_cautions(fitted), *tables_of(replay)], [*replay.findings, *warnings])
    summary = f"{replay.head.scenario} with {', '.join(sorted(replay.records)[:5])}"
    console.done(output, summary, ("report", args.fit, args.gains, output))


@takes
def couple(how: CoupleOptions, args: FitAndGains, output: Path = written("couple.json")) -> None:
    """How stiff a virtual wall each loop may render on a limb: passive on any limb, stable on this one, replayed.

    Without gains only the open loop. Exit code 5: a loop is unstable without any wall.

    Example: eaid couple fit.json --gains gains.json --torque 1,2,3 --wall 3
    """
    from eaid.report.tables.gains import walls_table
    from eaid.results.summary import list_cautions

    fitted, tuned, warnings = args.read()
    refuse_to_overwrite(output, args.force, filter(None, (args.fit, args.gains)))
    coupling = eaid.couple(fitted, tuned, how, progress=console.progress)
    coupling = stamped(coupling, args, fit=args.fit, gains=args.gains)
    coupling.save(output, args.force)
    tell_result(args, coupling, [*list_cautions(fitted), walls_table(coupling)], [*warnings, *coupling.findings])
    console.done(output, f"{len(coupling.walls)} walls", ("report", args.fit, args.gains, output))


@takes
def export(
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
    from eaid.results.summary import list_cautions

    gains, fit, paths = _read(files)
    inputs = tuple(Input.of(path) for path in paths)
    command = shlex.join(["eaid", *sys.argv[1:]]) if sys.argv[1:2] == ["export"] else ""
    made = exported(gains, fit, how, output, args.force, command, inputs)
    for line in list_cautions(fit) if fit is not None else ():
        console.speak(line)
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
    from eaid.results.gains import of_another_fit

    files: dict[str, Path] = {}
    for path in paths:
        kind = codec.kind_of_file(path) if path.is_file() else "gains"  # which is then told as missing
        if kind not in ("gains", "fit"):
            raise DataError(f"{path}: is neither gains.json nor fit.json; give what eaid tune-rc or eaid fit wrote")
        if kind in files:
            raise UsageError(f"{path}: a second {kind}.json; give one gains.json and one fit.json at most")
        files[kind] = path
    gains, warnings = codec.read_as(files["gains"], eaid.Gains) if "gains" in files else (None, ())
    if gains is not None and "fit" not in files and (beside := fit_beside(gains, files["gains"])) is not None:
        files["fit"] = beside
        console.speak(f"with {beside}, which the gains were made from")
    fit, more = codec.read_as(files["fit"], eaid.Fit) if "fit" in files else (None, ())
    if fit is not None and plant_of(fit) is None:
        raise DataError(f"{files['fit']}: holds no plant; fit clutch logs with a nonlinear model, or logs as recorded")
    others = of_another_fit(gains, sha256_of(files["fit"])) if fit is not None else ()
    console.tell((*warnings, *more, *others))
    return gains, fit, list(files.values())
