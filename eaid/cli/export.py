"""`eaid export`: gains and fit → source for a rig."""

import shlex
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from eaid.cli import console
from eaid.cli.form import Common, Verbose, argument, option, taken, takes, written
from eaid.errors import UsageError

if TYPE_CHECKING:
    from eaid.results.fit import Fit
    from eaid.results.gains import Gains

WHAT, RIG, ADVANCED = "What is exported", "Rig", "Advanced"


@dataclass(frozen=True, kw_only=True)
class Arguments(Common, Verbose):
    """What `eaid export` is told."""

    files: list[Path] = argument("GAINS [FIT]", "gains.json, and fit.json for inverse and plant.")
    target: str = option("c", "Language or format.", WHAT, "--as", words="c|arduino|matlab|fmu|yaml|python")
    laws: tuple[str, ...] | None = option(
        None, "By itself all that the files hold.", WHAT, "--law", words="pi|rc|inverse|plant", several=True
    )
    precision: str = option("double", "Of the numbers.", WHAT, words="double|single")
    rate_hz: float | None = option(None, "Control rate, baked in [Hz]; by itself the gains'.", RIG)
    duty_on_fault: float = option(0.0, "Duty while an input is no number.", RIG)
    stuck_s: float = option(0.5, "The status tells of a reading unchanged for so long [s].", RIG)
    rate_filter_hz: float | None = option(
        None, "Corner of the reference's filtered derivative [Hz]; by itself 25.", ADVANCED
    )
    anyway: bool = option(False, "Export what would be refused; its files are marked.", ADVANCED)
    output: Path = written("export", "Folder that is written.")


@takes(Arguments)
def command(args: Arguments) -> None:
    """Controllers and plant as source for a rig: a folder with test vectors, a check program and a page how to begin.

    Exit code 5: a loop is unstable at the rate, or a result marked stop is behind it; --anyway exports it, marked.

    Example: eaid export gains.json fit.json --as arduino --precision single --rate-hz 500
    """
    from eaid import api
    from eaid.export.options import ExportOptions
    from eaid.results.common import Input

    gains, fit, paths = _read(args.files)
    options = taken(
        ExportOptions, args, folder=args.output, inputs=tuple(Input.of(path) for path in paths),
        command=shlex.join(["eaid", *sys.argv[1:]]) if sys.argv[1:2] == ["export"] else "",
    )  # fmt: skip
    made = api.export(gains, fit=fit, options=options)
    console.tell(made.findings, args.verbose)
    if args.json:
        console.print_json(made)
    said = f"{', '.join(made.laws)} as {made.target}, {len(made.files)} files"
    console.done(made.path, said, f"read {made.path / 'README.md'}")


def _read(paths: list[Path]) -> "tuple[Gains | None, Fit | None, list[Path]]":
    """Gains, a fit, or both; the fit that the gains name is taken where it lies beside them, unchanged."""
    from eaid.export.read import fit_beside, kind_of, read_fit
    from eaid.results import codec
    from eaid.results.gains import Gains

    kinds = [kind_of(path) for path in paths]
    if len(set(kinds)) < len(kinds):
        raise UsageError(f"{paths[-1]}: a second {kinds[-1]}.json; give one gains.json and one fit.json at most")
    found = dict(zip(kinds, paths, strict=True))
    gains, doubts = codec.read(found["gains"], "gains", Gains) if "gains" in found else (None, ())
    if gains is not None and "fit" not in found:
        beside = fit_beside(gains, found["gains"])
        if beside is not None:
            found["fit"] = beside
            console.say(f"with {beside}, which the gains were made from")
    fit, more = read_fit(found["fit"]) if "fit" in found else (None, ())
    console.tell((*doubts, *more))
    return gains, fit, list(found.values())
