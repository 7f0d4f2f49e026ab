"""`eaid couple`: how stiff a virtual wall each loop may render."""

from pathlib import Path

import eaid
from eaid.cli import console
from eaid.cli.form import FitAndGains, stamped, takes, tell_result, written
from eaid.files import refuse_to_overwrite
from eaid.options import CoupleOptions


@takes
def command(how: CoupleOptions, args: FitAndGains, output: Path = written("couple.json")) -> None:
    """How stiff a virtual wall each loop may render on a limb: passive on any limb, stable on this one, replayed.

    Without gains only the open loop. Exit code 5: a loop is unstable without any wall.

    Example: eaid couple fit.json --gains gains.json --torque 1,2,3 --wall 3
    """
    from eaid.report.tables.gains import walls_table
    from eaid.results.summary import of_fit

    fitted, tuned, warnings = args.read()
    refuse_to_overwrite(output, args.force, filter(None, (args.fit, args.gains)))
    coupling = eaid.couple(fitted, tuned, how, progress=console.progress)
    coupling = stamped(coupling, args, fit=args.fit, gains=args.gains)
    coupling.save(output, args.force)
    tell_result(args, coupling, [*of_fit(fitted), walls_table(coupling)], [*warnings, *coupling.findings])
    console.done(output, f"{len(coupling.walls)} walls", ("report", args.fit, args.gains, output))
