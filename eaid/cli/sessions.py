"""`eaid sessions`: fits of several mountings of one rig → what the next one may be."""

from pathlib import Path

from eaid.cli import console
from eaid.cli.form import Common, argument, stamped, takes, tell_result, written
from eaid.files import refuse_to_overwrite
from eaid.options import SessionsOptions
from eaid.shown import counted


@takes
def sessions(
    args: Common, how: SessionsOptions,
    fits: list[Path] = argument("FIT…", "fit.json of each session in order, or one table session,level,value,sd_log."),
    output: Path = written("rig.json"),
) -> None:  # fmt: skip
    """What the next session of a rig may be, by how its sessions differed, and what to record to know it better.

    Three sessions (mountings, days) and more of the same rig. `eaid today` takes what this writes.

    Example: eaid sessions mon.json tue.json wed.json thu.json fri.json -o rig.json
    """
    from eaid.report.tables.sessions import next_table, scatter_table
    from eaid.sessions.gather import read_sessions
    from eaid.sessions.rig import rig_of_fits, rig_of_table

    sessions, values, warnings = read_sessions(fits)
    refuse_to_overwrite(output, args.force, fits)
    rig = stamped(rig_of_table(values, how) if values else rig_of_fits(sessions, how), args, fits=fits)
    rig.save(output, args.force)
    shown = [*rig.lines(), next_table(rig), *([scatter_table(rig)] if args.verbose else ())]
    tell_result(args, rig, shown, [*warnings, *rig.findings])
    after = f"record a step at {rig.best_step}, then eaid today {output} STEP"
    steps_tell = not values and not rig.confounded
    console.done(output, counted(len(rig.sessions), "session"), after if steps_tell else ("report", output))
