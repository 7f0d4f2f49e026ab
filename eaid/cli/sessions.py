"""`eaid sessions`, `today` and `compare`: what the next mounting of a rig may be, what it is today, what moved."""

import shlex
from pathlib import Path
from typing import Any

import msgspec

import eaid
from eaid.cli import console
from eaid.cli.form import Common, argument, exit_code_of, stamped, takes, tell_result, written
from eaid.declared import option
from eaid.errors import UsageError, on_command_line
from eaid.files import refuse_to_overwrite, sha256_of
from eaid.options import SESSIONS, Columns, CompareOptions, ReadOptions, SessionsOptions
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
    console.done(output, counted(len(rig.sessions), "session"), after if rig.gives_today else ("report", output))


@takes
def today(
    args: Common, reading: ReadOptions,
    rig: Path = argument("RIG", "rig.json of eaid sessions."),
    steps: list[Path] = argument("STEP…", "Logs of one or two steps from rest, recorded in this session."),
    output: Path = written("today.json"),
) -> int:  # fmt: skip
    """One or two reference steps of today → a fit with intervals that hold for today, by what is known of the rig.

    tune-rc, simulate, couple, export and report take it as any other fit. Logs are read as those of the sessions were.

    Example: eaid today rig.json step_60.csv -o today.json
    """
    from eaid.findings import say
    from eaid.logs.folders import files_read
    from eaid.reading import read_steps
    from eaid.results import codec
    from eaid.results.summary import answer, verdict_line
    from eaid.sessions.rig import Rig
    from eaid.sessions.today import reading_of, today

    known, warnings = codec.read_as(rig, Rig)
    refuse_to_overwrite(output, args.force, [rig, *files_read(steps)])
    data = read_steps(steps, reading_of(known, reading), console.progress, console.warn, console.speak)[1]
    fit = stamped(today(known, data), args)
    fit.save(output, args.force)
    said = [found for found in fit.findings if found.code in ("for-today", "step-foreseen", "step-outside")]
    again = any(found.code == "step-outside" for found in said)
    after = f"eaid {'tune-rc' if fit.linear is not None and fit.verdict.usable else 'report'} {output}"
    after = f"next    {'the step once more; as it is: ' * again}{after}"
    values = [line for line in answer(fit)[1:] if not line.startswith(("used", "logs"))]
    said.sort(key=lambda one: one.code != "for-today")
    lines = [f"{'step' if k else 'today':7} {say(one)}" for k, one in enumerate(said)]
    shown = [*map(on_command_line, verdict_line(fit)), *lines, *map(on_command_line, values), after]
    tell_result(args, fit, shown, [*warnings, *(found for found in fit.findings if found not in said)])
    console.speak(f"{output}: a fit for today")
    return exit_code_of(fit, output)


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
    from eaid.results.gains import of_another_fit

    if len(files) < 2:
        raise UsageError(f"{files[0]} alone: give another session's fit.json, or the log of a loop, behind it")
    refuse_to_overwrite(output, args.force, [*files, *filter(None, [gains])])
    tuned, warnings = codec.read_as(gains, eaid.Gains) if gains else (None, ())
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
    if found.promise is not None and isinstance(results[0], eaid.Fit):
        found = msgspec.structs.replace(found, findings=(*found.findings, *of_another_fit(tuned, sha256_of(files[0]))))
    found = stamped(found, args, files=files, gains=gains)
    found.save(output, args.force)
    after = ["tune-rc", found.in_question] if found.tune_anew else ["report", str(output)]
    lines = [*map(on_command_line, found.lines()), f"next    eaid {shlex.join(after)}"]
    tables = (shifts_table(found), changes_table(found)) if args.verbose else ()
    tell_result(args, found, [*lines, *tables], [*warnings, *found.findings])
    console.speak(f"{output}: the comparison")
