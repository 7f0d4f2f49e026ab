"""`eaid tune-rc`: a fit → gains of both controllers, and what may be expected of them."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from eaid.cli import console
from eaid.cli.form import Common, Tables, argument, stamped, takes, written
from eaid.declared import option, part
from eaid.errors import UsageError
from eaid.options import ROBUST, TRACKED, TuneOptions, any_text
from eaid.shown import listed

if TYPE_CHECKING:
    from eaid.results.fit import Fit
    from eaid.steps.stepset import StepSet


@dataclass(frozen=True, kw_only=True)
class Arguments(Common, TuneOptions, Tables):
    """What `eaid tune-rc` takes."""

    fit: Path = argument("FIT", "fit.json of eaid fit; only its linear part is needed.")
    reference: str | None = option(
        None, "Q_M is taken from it, or judged by it.", ROBUST, words=TRACKED, read=any_text, shown="FILE|WORD"
    )
    data: list[Path] | None = option(None, "Logs for --phi data; by itself the fit's own.", ROBUST)
    output: Path = written("gains.json")


@takes(Arguments)
def command(args: Arguments) -> None:
    """Gains of the robust controller and of a PI from a fit, with one verdict on the guarantee.

    Exit code 5: the fit or the wishes are not physical, out of reach, or unstable on the linear model.

    Example: eaid tune-rc fit.json --b-hat minimax --phi data -o gains.json
    """
    from eaid import api
    from eaid.files import refuse_to_overwrite
    from eaid.logs.manifest import files_read
    from eaid.report.tables import gains as tables
    from eaid.results import codec
    from eaid.results.fit import Fit

    file = Path(args.reference) if args.reference and args.reference not in TRACKED else None
    read = [args.fit, *([file] if file else []), *files_read(args.data or [])]
    refuse_to_overwrite(args.output, args.force, read)
    options = part(TuneOptions, args)
    if args.data and options.phi != "data":
        raise UsageError("--data: does nothing without --phi data; leave it out")
    fitted, warnings = codec.read(args.fit, Fit)
    logs = logs_of(fitted, args) if options.phi == "data" else None
    gains = api.tune_rc(fitted, options, reference=args.reference, logs=logs)
    gains = stamped(gains, args, fit=args.fit, reference=file)
    gains.save(args.output, args.force)
    if args.json:
        console.print_json(gains)
    else:
        console.line(tables.guarantee_story(gains))
        shown = [*tables.tables_of(gains, asked=False), tables.margins_table(gains)]
        for table in shown if args.tables or args.verbose else [tables.controllers_table(gains)]:
            console.show(table)
    console.tell([*gains.findings, *warnings], args.verbose)
    console.done(args.output, "gains of rc and pi", ("simulate", args.fit, args.output))


def logs_of(fit: "Fit", args: Arguments) -> "StepSet | None":
    """The logs given, else those that the fit names, where they are still there and unchanged."""
    from eaid.files import sha256_of
    from eaid.options import ReadOptions
    from eaid.reading import read_steps

    if args.data:
        return read_steps(args.data, ReadOptions(logs_as="steps"), console.progress, console.warn)[1]
    named = {one.path: one.sha256 for one in fit.data.inputs or fit.data.sources}  # of a folder each log is named
    paths = []
    for name, sha256 in named.items():
        beside = (path for path in (Path(name), args.fit.parent / Path(name).name) if path.is_file())
        paths += [path for path in beside if sha256_of(path) == sha256][:1]
    if not paths or len(paths) < len(named):
        what = f"{listed(list(named), 3)}: is gone or has changed" if named else f"{args.fit}: names no logs"
        console.warn(f"{what}, so φ cannot be read off them; give the logs with --data")
        return None
    reading = ReadOptions(**{**fit.options.reading, "logs_as": "steps"})  # type: ignore[arg-type]
    return read_steps(paths, reading, console.progress, console.warn)[1]
