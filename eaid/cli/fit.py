"""`eaid fit`: logs or a dataset → fit.json, what it says in a few lines, and what is to be doubted of it."""

from dataclasses import dataclass
from pathlib import Path

from eaid.cli import console
from eaid.cli.form import OUTPUT, Common, Verbose, argument, takes, written
from eaid.declared import option, part
from eaid.findings import stops
from eaid.options import FitOptions, ReadOptions
from eaid.report.tables.fits import judging_tables, model_tables
from eaid.results.fit import Fit
from eaid.results.summary import answer, doubts, runs

NOT_TO_BE_USED = 4
"""Exit code of a fit that did not converge, or that a stop-finding speaks against; it is written, marked."""


@dataclass(frozen=True, kw_only=True)
class Arguments(Common, FitOptions, ReadOptions, Verbose):
    """What `eaid fit` takes."""

    data: list[Path] = argument("DATA…", "A data.h5, log files, or folders of them.")
    tables: bool = option(False, "Show all numbers as tables.", OUTPUT)
    output: Path = written("fit.json")


@takes(Arguments)
def command(args: Arguments) -> int:
    """Fit the models of the paper to recorded steps, and say how far they are to be trusted.

    Exit code 4: a fit did not converge, or explains little; the result is written, marked.

    Example: eaid fit bench/ --levels 20:100 --hold-out 60 -o fit.json
    """
    import msgspec

    from eaid import api
    from eaid.cli import inputs
    from eaid.files import refuse_to_overwrite
    from eaid.logs.folders import files_read
    from eaid.results import codec

    refuse_to_overwrite(args.output, args.force, files_read(args.data))
    with console.answer_first():
        stepset = inputs.runs_from(args.data, part(ReadOptions, args), console.say)[1]
        result = api.fit(stepset, part(FitOptions, args), progress=console.progress)
        result = msgspec.structs.replace(result, command=args.typed)
        codec.write(args.output, result, "fit", args.force)
        if args.json:
            console.print_json(result, "fit")
        else:
            show(result, args.output, args.tables or args.verbose, args.verbose)
    console.tell(result.findings, args.verbose)
    console.say(closing(result, args.output))
    if usable(result):
        return 0
    console.fail(f"{args.output}: is written and marked; do not use its numbers")
    return NOT_TO_BE_USED


PARTS = ("friction", "nonlinear", "linear", "release", "steps")


def usable(fit: Fit) -> bool:
    """Whether its numbers may be used: it converged, and no finding of severity stop stands."""
    return bool(fit.converged) and not stops(fit.findings)


def show(fit: Fit, file: Path, tables: bool, verbose: bool) -> None:
    """The answer, what is doubtful and what to do next; and all tables; with `verbose` those that judge it too."""
    after = "tune-rc" if fit.linear is not None and usable(fit) else "report"
    mind = "stop   " if stops(fit.findings) else "doubts "
    for line in (*answer(fit), mind + (", ".join(doubts(fit)) or "none"), f"next   eaid {after} {file}"):
        console.line(line)
    shown = model_tables(fit, asked=False) if tables else []
    for table in [*shown, *(judging_tables(fit) if tables and verbose else ())]:
        console.show(table)


def closing(fit: Fit, file: Path) -> str:
    """The last line: the file, what it holds, and of which data."""
    parts = ", ".join(name for name in PARTS if getattr(fit, name)) or "no model"
    return f"{file}: {parts} of {runs(fit, f'{fit.data.kind} run')}"
