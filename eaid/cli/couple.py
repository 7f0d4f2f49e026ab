"""`eaid couple`: how stiff a virtual wall each loop may render."""

from dataclasses import dataclass
from pathlib import Path

from eaid.cli import console
from eaid.cli.form import Common, Verbose, argument, stamped, takes, written
from eaid.declared import option, part
from eaid.options import LOOP, CoupleOptions


@dataclass(frozen=True, kw_only=True)
class Arguments(Common, CoupleOptions, Verbose):
    """What `eaid couple` takes."""

    fit: Path = argument("FIT", "fit.json with a nonlinear model.")
    gains_placed: Path | None = argument("GAINS", "The same as --gains.", None)
    gains: Path | None = option(None, "gains.json; without it only the open loop.", LOOP, shown="FILE")
    output: Path = written("couple.json")


@takes(Arguments)
def command(args: Arguments) -> None:
    """How stiff a virtual wall each loop may render on a limb: passive on any limb, stable on this one, replayed.

    Exit code 5: a loop is unstable without any wall.

    Example: eaid couple fit.json --gains gains.json --torque 1,2,3 --wall 3
    """
    from eaid import api
    from eaid.files import refuse_to_overwrite
    from eaid.report.tables.gains import walls_table
    from eaid.results import codec
    from eaid.results.fit import Fit
    from eaid.results.gains import Gains

    refuse_to_overwrite(args.output, args.force, [args.fit, *([args.gains] if args.gains else [])])
    options = part(CoupleOptions, args)
    fitted, warnings = codec.read(args.fit, Fit)
    tuned, more = codec.read(args.gains, Gains) if args.gains else (None, ())
    coupling = api.couple(fitted, tuned, options, progress=console.progress)
    coupling = stamped(coupling, args, fit=args.fit, gains=args.gains)
    coupling.save(args.output, args.force)
    if args.json:
        console.print_json(coupling)
    else:
        console.show(walls_table(coupling))
    console.tell([*warnings, *more, *coupling.findings], args.verbose)
    console.done(
        args.output,
        f"{len(coupling.walls)} walls",
        ("report", args.fit, *([args.gains] if args.gains else []), args.output),
    )
