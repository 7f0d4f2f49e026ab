"""`eaid compare`: what moved between sessions, or whether a recorded loop does what was promised."""

import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from eaid.cli import console
from eaid.cli.form import Common, argument, stamped, takes, tell_result, written
from eaid.declared import option, part
from eaid.errors import UsageError, on_command_line
from eaid.files import refuse_to_overwrite
from eaid.options import SESSIONS, Columns, CompareOptions, ReadOptions


@dataclass(frozen=True, kw_only=True)
class Arguments(Common, CompareOptions, Columns):
    """What `eaid compare` takes."""

    files: list[Path] = argument(
        "A B…", "fit.json of a session, A, and of those that it is held against, B, C …; or a fit.json (or replay.h5) "
        "and the log of a loop, its reference among the columns.",
    )  # fmt: skip
    gains: Path | None = option(None, "gains.json: must it be made anew? Or: what the loop ran with.", SESSIONS,
                                shown="FILE")  # fmt: skip
    output: Path = written("compare.json")


@takes(Arguments)
def command(args: Arguments) -> None:
    """What moved from the other sessions to the first, alike at all levels or not, and whether gains must be made anew.

    Every change is that of A against another. Of several sessions the probabilities are Holm's. With the log of a loop:
    whether its error and overshoot are what the replay promises.

    Example: eaid compare today.json last_week.json --gains gains.json
    """
    from eaid import api
    from eaid.report.results import read_result
    from eaid.report.tables.sessions import changes_table, shifts_table
    from eaid.results import codec
    from eaid.results.fit import Fit
    from eaid.results.gains import Gains
    from eaid.results.replay import Replay

    if len(args.files) < 2:
        raise UsageError(f"{args.files[0]} alone: give another session's fit.json, or the log of a loop, behind it")
    refuse_to_overwrite(args.output, args.force, [*args.files, *filter(None, [args.gains])])
    gains, warnings = codec.read(args.gains, Gains) if args.gains else (None, ())
    results: list[Any] = []
    for path in args.files:
        if path.suffix == ".json" or (path == args.files[0]):
            result, more = read_result(path)
            if not isinstance(result, Fit | Replay):
                raise UsageError(f"{path}: is neither a fit.json nor a replay.h5; gains go behind --gains")
            results.append(result)
            warnings = (*warnings, *more)
        else:
            results.append(path)
    reading = part(Columns, args)
    found = api.compare(
        results[0], *results[1:], gains=gains, names=list(map(str, args.files)), options=part(CompareOptions, args),
        reading=None if not reading.given() else ReadOptions(**reading.given()),
    )  # fmt: skip
    found = stamped(found, args, files=args.files, gains=args.gains)
    found.save(args.output, args.force)
    after = ["tune-rc", str(args.files[0])] if found.tune_anew else ["report", str(args.output)]
    lines = [*map(on_command_line, found.lines()), f"next    eaid {shlex.join(after)}"]
    tables = (shifts_table(found), changes_table(found)) if args.verbose else ()
    tell_result(args, found, [*lines, *tables], [*warnings, *found.findings])
    console.say(f"{args.output}: the comparison")
