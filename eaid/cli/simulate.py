"""`eaid simulate`: controllers replayed on the fitted plant."""

from dataclasses import replace
from pathlib import Path

import eaid
from eaid.cli import console
from eaid.cli.form import FitAndGains, stamped, takes, tell_result, written
from eaid.declared import option
from eaid.errors import UsageError
from eaid.files import refuse_to_overwrite
from eaid.options import WHAT, Columns, ReadOptions, SimulateOptions


@takes
def command(
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
    from eaid.results.summary import of_fit

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
    tell_result(args, as_json(replay), [*of_fit(fitted), *tables_of(replay)], [*replay.findings, *warnings])
    summary = f"{replay.head.scenario} with {', '.join(sorted(replay.records)[:5])}"
    console.done(output, summary, ("report", args.fit, args.gains, output))
