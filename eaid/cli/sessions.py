"""`eaid sessions`: fits of several mountings of one rig → what the next one may be."""

from dataclasses import dataclass
from pathlib import Path

from eaid.cli import console
from eaid.cli.form import Common, argument, stamped, takes, tell_result, written
from eaid.declared import part
from eaid.files import refuse_to_overwrite
from eaid.options import SessionsOptions
from eaid.shown import counted


@dataclass(frozen=True, kw_only=True)
class Arguments(Common, SessionsOptions):
    """What `eaid sessions` takes."""

    fits: list[Path] = argument("FIT…", "fit.json of each session in order, or one table session,level,value,sd_log.")
    output: Path = written("rig.json")


@takes(Arguments)
def command(args: Arguments) -> None:
    """What the next session of a rig may be, by how its sessions differed, and what to record to know it better.

    Three sessions (mountings, days) and more of the same rig. `eaid today` takes what this writes.

    Example: eaid sessions mon.json tue.json wed.json thu.json fri.json -o rig.json
    """
    from eaid.report.tables.sessions import next_table, scatter_table
    from eaid.sessions.gather import read_sessions
    from eaid.sessions.rig import rig_of_fits, rig_of_table

    fits, values, warnings = read_sessions(args.fits)
    refuse_to_overwrite(args.output, args.force, args.fits)
    how = part(SessionsOptions, args)
    rig = stamped(rig_of_table(values, how) if values else rig_of_fits(fits, how), args, fits=args.fits)
    rig.save(args.output, args.force)
    shown = [*rig.lines(), next_table(rig), *([scatter_table(rig)] if args.verbose else ())]
    tell_result(args, rig, shown, [*warnings, *rig.findings])
    after = f"record a step at {rig.main.best_level:.4g} {rig.input_unit}, then eaid today {args.output} STEP"
    console.done(args.output, counted(len(rig.sessions), "session"), after if fits else ("report", args.output))
