"""`eaid couple`: how stiff a virtual wall each loop may render."""

from dataclasses import dataclass
from pathlib import Path

from eaid.cli import console
from eaid.cli.form import FitAndGains, stamped, takes, tell_result, written
from eaid.declared import part
from eaid.files import refuse_to_overwrite
from eaid.options import CoupleOptions


@dataclass(frozen=True, kw_only=True)
class Arguments(CoupleOptions, FitAndGains):
    """What `eaid couple` takes."""

    output: Path = written("couple.json")


@takes(Arguments)
def command(args: Arguments) -> None:
    """How stiff a virtual wall each loop may render on a limb: passive on any limb, stable on this one, replayed.

    Without gains only the open loop. Exit code 5: a loop is unstable without any wall.

    Example: eaid couple fit.json --gains gains.json --torque 1,2,3 --wall 3
    """
    from eaid import api
    from eaid.report.tables.gains import walls_table
    from eaid.results.summary import of_fit

    fitted, tuned, warnings = args.read()
    refuse_to_overwrite(args.output, args.force, filter(None, (args.fit, args.gains)))
    coupling = api.couple(fitted, tuned, part(CoupleOptions, args), progress=console.progress)
    coupling = stamped(coupling, args, fit=args.fit, gains=args.gains)
    coupling.save(args.output, args.force)
    tell_result(args, coupling, [*of_fit(fitted), walls_table(coupling)], [*warnings, *coupling.findings])
    console.done(args.output, f"{len(coupling.walls)} walls", ("report", args.fit, args.gains, args.output))
