"""`eaid compare`: what moved between sessions, or whether a recorded loop does what was promised."""

import shlex
from pathlib import Path
from typing import Any

import eaid
from eaid.cli import console
from eaid.cli.form import Common, argument, stamped, takes, tell_result, written
from eaid.declared import option
from eaid.errors import UsageError, on_command_line
from eaid.files import refuse_to_overwrite
from eaid.options import SESSIONS, Columns, CompareOptions, ReadOptions


@takes
def compare(
    args: Common, how: CompareOptions, reading: Columns,
    files: list[Path] = argument(
        "A B…", "fit.json of a session, A, and of those that it is held against, B, C …; or a fit.json (or replay.h5) "
        "and the log of a loop, its reference among the columns.",
    ),
    gains: Path | None = option(None, "gains.json: must it be made anew? Or: what the loop ran with.", SESSIONS,
                                shown="FILE"),
    output: Path = written("compare.json"),
) -> None:  # fmt: skip
    """What moved from the other sessions to the first, alike at all levels or not, and whether gains must be made anew.

    Every change is that of A against another. Of several sessions the probabilities are Holm's. With the log of a loop:
    whether its error and overshoot are what the replay promises.

    Example: eaid compare today.json last_week.json --gains gains.json
    """
    from eaid.report.results import read_result
    from eaid.report.tables.sessions import changes_table, shifts_table
    from eaid.results import codec

    if len(files) < 2:
        raise UsageError(f"{files[0]} alone: give another session's fit.json, or the log of a loop, behind it")
    refuse_to_overwrite(output, args.force, [*files, *filter(None, [gains])])
    tuned, warnings = codec.read(gains, eaid.Gains) if gains else (None, ())
    results: list[Any] = []
    for path in files:
        if path.suffix == ".json" or path == files[0]:
            result, more = read_result(path)
            if not isinstance(result, eaid.Fit | eaid.Replay):
                raise UsageError(f"{path}: is neither a fit.json nor a replay.h5; gains go behind --gains")
            results.append(result)
            warnings = (*warnings, *more)
        else:
            results.append(path)
    as_said = ReadOptions(**reading.given()) if reading.given() else None
    found = eaid.compare(*results, gains=tuned, names=list(map(str, files)), options=how, reading=as_said)
    found = stamped(found, args, files=files, gains=gains)
    found.save(output, args.force)
    after = ["tune-rc", str(files[0])] if found.tune_anew else ["report", str(output)]
    lines = [*map(on_command_line, found.lines()), f"next    eaid {shlex.join(after)}"]
    tables = (shifts_table(found), changes_table(found)) if args.verbose else ()
    tell_result(args, found, [*lines, *tables], [*warnings, *found.findings])
    console.say(f"{output}: the comparison")
