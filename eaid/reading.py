"""Logs → steps: what the user may say about logs, and the one way from files or tables to a `StepSet`."""

import contextlib
import shlex
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from eaid.arrays import keep_freed_memory, median, read_only
from eaid.declared import as_typed
from eaid.errors import DataError, UsageError
from eaid.files import sha256_of
from eaid.findings import finding, say
from eaid.logs.columns import columns_guessed
from eaid.logs.folders import logs_meant
from eaid.logs.formats import ForeignReader, format_of
from eaid.logs.names import agreeing, level_and_repeat, named_like, pattern_guessed, several_factors, unit_beside
from eaid.logs.read import columns_told, read_like, read_what_can_be
from eaid.logs.run import Run
from eaid.logs.to_run import without_switches
from eaid.logs.units import TIME_FACTORS, may_drive, split_name, unit_of
from eaid.options import ReadOptions, typed
from eaid.progress import Progress, no_progress
from eaid.steps.baseline import baseline_rule
from eaid.steps.build import stepset_of
from eaid.steps.checks import RecordedWindow, bridged, of_record, ramp
from eaid.steps.cut import active_low, cut_runs, refuse_percent, settled_steps
from eaid.steps.onset import let_go, onset
from eaid.steps.plateaus import AT_REST_BELOW, FEWEST_HELD, fitted_as, plateaus, switching
from eaid.steps.repeats import counted_once
from eaid.steps.step import Cut, usual_step
from eaid.steps.stepset import StepSet

MOSTLY_STILL = 0.9  # Part of a log that stands still where it is at rest throughout
ASKED = {"time-unclear", "time-unit-differs"}  # What is asked before anything else is done
RESTS_WITHIN = 0.02  # Of all inputs, within which logs rest at one
MANY_ROWS = 1_000_000  # From which on arrays of them take long to be given and taken back
ROWS_APART = 2.0  # Rows from one part of a log to the next that is joined to it, at most
TOGETHER = 0.02  # Share of the longest log within which outputs are let go at one time


def read_steps(
    paths: Sequence[Path], options: ReadOptions, progress: Progress = no_progress,
    warn: Callable[[str], None] = lambda _: None, columns: Callable[[str], None] = lambda _: None, command: str = "fit",
) -> tuple[list[Run], StepSet]:  # fmt: skip
    """The cut runs behind logs, datasets, folders or a manifest, and their step set; DataError tells all faults.

    `columns` hears which columns were taken and which were left, before anything else is done with them; `command` is
    the one that a refusal proposes.
    """
    baseline_rule(options.baseline)  # what is wrong in the options is told before anything is read
    files, options = logs_meant(paths, options, warn)
    files = agreeing(files, options.where)
    with progress("reading logs", len(files)) as advance:
        runs, faults = read_what_can_be(files, options, advance)
    runs = without_switches(runs, options)
    for sentence in columns_told(runs):
        columns(sentence)
    try:
        return steps_in(runs, options, faults, [path for path in paths if path.is_file()])
    except DataError as fault:
        more = _proposal(files, runs, options, fault.sentences)
        try_ = f"try: eaid {command} {shlex.join(map(str, paths))} {more}"
        raise DataError(*fault.sentences, *([try_] if more else [])) from None


def _proposal(files: Sequence[Path], runs: Sequence[Run], options: ReadOptions, faults: Sequence[str]) -> str:
    """The options with all that can be guessed of what the logs do not say; empty where that is nothing."""
    given = dict(options.stated())
    columns, units, more = dict(options.columns), dict(options.units), dict[str, str]()
    if not runs and any("no column is called" in fault or "columns have" in fault for fault in faults):
        columns |= _columns_of(files[0], options)
        if "time" not in columns and any("«rate_hz» HZ" in fault for fault in faults):
            return ""  # a rate that nobody but the user knows
        how = replace(options, columns=columns)
        runs, faults = read_what_can_be(files, how)
        if all("«repair»" in fault for fault in faults):
            runs = read_what_can_be(files, replace(how, repair=True))[0]
        if not runs:
            return ""  # something is missing that no guess fills
    unclear = [one for run in runs for one in run.findings if one.code == "time-unclear"]  # not where s are likelier
    likely, factor = Counter(str(one.values["likely"]) for one in unclear), 1.0
    if likely:
        units["time"] = likely.most_common(1)[0][0]
        factor = TIME_FACTORS[units["time"]]
    tops = {float(np.abs(run.input).max()) for run in runs if run.has_input and run.input_unit == "%"}
    if max(tops, default=0.0) == 255 and "input" not in units:
        units["input"] = "/255"
    blind = [run for run in runs if not run.has_input]
    pattern = pattern_guessed([run.name for run in blind]) if options.name_pattern is None and blind else ""
    levels = [level_and_repeat("", pattern, run.name)[0] for run in blind] if pattern else []
    named = bool(unit_beside(pattern)) or len(set(levels)) < len(levels)  # a level has a unit, or several runs
    if blind and not columns.keys() & {"input", "position"}:
        columns |= _input_left(blind, bool(pattern), named, files[0], options)
        pattern, blind = ("", []) if "input" in columns else (pattern, blind)
    if pattern:
        more["name_pattern"] = pattern
        if "input" not in units and (unit := unit_beside(pattern)):
            units["input"] = unit
    starts = [factor * float(run.time_s[at.row]) for run in blind if (at := onset(run.time_s, run.output)) and at.row]
    if options.step_at is None and len(starts) > 1 and np.ptp(np.quantile(starts, (0.2, 0.8))) < 0.05 * median(starts):
        more["step_at"] = _roundest(median(starts))
    if options.until is None and (end := let_go_of(blind)[1]) is not None:
        more["until"] = _roundest(factor * end)
    guessed = {"columns": columns, "units": units}
    more |= {name: as_typed(value) for name, value in guessed.items() if value != getattr(options, name)}
    repair = {"repair": True} if any("«repair»" in fault for fault in faults) else {}
    asked = "columns" in more or "/255" in units.values()
    if len(more) + len(repair) < 2 and not asked:  # the refusal says it already
        return ""
    proposed = given | repair | more
    return typed(proposed) if proposed != given else ""  # what was tried already


def _input_left(blind: Sequence[Run], pattern: bool, named: bool, first: Path, options: ReadOptions) -> dict[str, str]:
    """The input among the columns that logs without one have left: the one that moves and drives by its unit; where
    their names tell no level, the only one, or what is guessed of the first log."""
    driving = [one for one in dict.fromkeys(name for run in blind for name in run.left) if drives(blind, one)]
    left = {tuple(one for one in run.left if unit_of(split_name(one)[1]).quantity != "time") for run in blind}
    lone = [names for names in left if len(names) == 1]
    if len(driving) == 1 or (not named and len(lone) == 1):
        return {"input": driving[0] if len(driving) == 1 else lone[0][0]}
    guessed = {} if pattern else _columns_of(first, options)
    return guessed if guessed.keys() & {"input", "position"} else {}  # what is read already tells nothing more


def drives(runs: Sequence[Run], column: str) -> bool:
    """Whether a column that leaves its rest in most runs may be their input, by its unit."""
    moved = [run for run in runs if column in {name for name, _ in run.moves}]
    return may_drive(split_name(column)[1]) and 2 * len(moved) > len(runs)


def _columns_of(file: Path, options: ReadOptions) -> dict[str, str]:
    """Columns guessed of a log's first table; none where that cannot be had."""
    with contextlib.suppress(DataError), contextlib.closing(ForeignReader()) as foreign, file.open("rb") as opened:
        tables = foreign.tables(format_of(opened.read(4096)), file, str(file))
        return columns_guessed(tables[0], options)
    return {}


def let_go_of(runs: Sequence[Run]) -> tuple[dict[int, float], float | None]:
    """When the outputs of logs fall for good, by the log's id, if most of them do; and when on the logs' own clocks,
    if all fall at once and at one time."""
    ends = {id(run): end for run in runs if run.until_s is None and (end := let_go(run.time_s, run.output))}
    if 2 * len(ends) <= len(runs):
        return {}, None
    at = [run.start_s + ends[id(run)].at_s for run in runs if id(run) in ends]
    close = max(abs(one - median(at)) for one in at) <= TOGETHER * max(float(run.time_s[-1]) for run in runs)
    together = close and all(end.at_once for end in ends.values())
    return {key: end.at_s for key, end in ends.items()}, median(at) if together else None


def _roundest(value: float) -> str:
    """The shortest number within 2 % of a value."""
    rounded = (float(f"{value:.{k}g}") for k in range(1, 9))
    return next(f"{one:.8g}" for one in rounded if abs(one - value) <= 0.02 * abs(value))


def _asked(runs: Sequence[Run], how: str) -> Iterator[str]:
    """Questions that come before any step is looked for."""
    for run in (run for run in runs if not run.dataset):
        yield from (f"{run.where}: {say(one)}" for one in run.findings if one.code in ASKED)
        if how != "recorded" and not run.cut and run.has_input and (rows := switching(run.input)):
            yield f"{run.where}: {say(finding('input-switches', run.name, rows=rows))}"


def _ended(runs: Sequence[Run]) -> tuple[list[Run], list[str]]:
    """Logs without an input that are let go, each by itself, ended there; where all are let go at once and at one time,
    the question whether that is so."""
    runs = list(runs)
    blind = [run for run in runs if not (run.dataset or run.cut or run.has_input) and run.kind in (None, "clutch")]
    if any(one.code in ASKED for run in blind for one in run.findings):
        return runs, []  # nobody knows yet when that is
    falls, end = let_go_of(blind)
    if end is None:
        for k, run in enumerate(runs):
            if until_s := falls.get(id(run)):
                told = finding("let-go-from-output", run.name, at_s=until_s)
                runs[k] = replace(run, until_s=until_s, findings=(*run.findings, told))
        return runs, []
    n, at = f"in {len(falls)} of {len(blind)} logs " * (len(blind) > 1), _roundest(end)
    return runs, [
        f"{blind[0].where}: the output falls at {at} s {n}and stays low: a release, which no column tells; end the "
        f"window there with «until» {at}, or say where it ends"
    ]


def two_sided(steps: Sequence[Run]) -> bool:
    """Whether steps from rest go to inputs of both signs: a gain on each side is the plant's, no scatter."""
    signs = {
        float(np.sign(run.level or 0.0)) for run in steps
        if run.edge == "rising" and run.from_level == 0 and run.has_input and run.position is None
        and (run.kind or "clutch") == "clutch"
    }  # fmt: skip
    return signs >= {-1.0, 1.0}


def blank(run: Run, top: float) -> bool:
    """Whether a log is at rest throughout, by its input beside the largest of all, or by its name."""
    if run.cut or len(run.time_s) < FEWEST_HELD or run.position is not None or run.kind not in (None, "clutch"):
        return False
    if not run.has_input:
        return run.level == 0
    holds = plateaus(run.input)
    still = len(holds) == 1 and holds[0].count >= MOSTLY_STILL * len(run.input)  # a slow sine stands nowhere else
    return still and abs(holds[0].level) <= AT_REST_BELOW * top


def refuse_far_rest(runs: Sequence[Run], rest: float) -> None:
    """Refuse a rest farther off 0 and all inputs than these go: they are in the unit that they are read in."""
    inputs = [run for run in runs if run.has_input]
    if not rest or not inputs:
        return
    low, high = min(float(run.input.min()) for run in inputs), max(float(run.input.max()) for run in inputs)
    span = max(high, 0.0) - min(low, 0.0)
    if not min(low, 0.0) - span <= rest <= max(high, 0.0) + span:
        unit = f" {inputs[0].input_unit}".rstrip()
        raise UsageError(
            f"«rest» {rest:g}{unit}: the inputs lie between {low:.4g} and {high:.4g}{unit}, in which they are read; "
            f"give it in{unit or ' their unit'}"
        )


def unnamed_rest(runs: Sequence[Run]) -> float | None:
    """The input, not 0, from which logs go and to which they come back, where none goes beyond it on that side."""
    if not runs or not all(run.has_input and not run.cut and (run.input[0] * run.input > 0).all() for run in runs):
        return None
    holds = [plateaus(run.input) for run in runs]
    if not all(len(held) > 2 for held in holds):
        return None
    rest, every = holds[0][0].level, np.array([one.level for held in holds for one in held])
    near = RESTS_WITHIN * float(np.ptp(every))
    back = all(abs(held[k].level - rest) <= near for held in holds for k in (0, 2))
    one_side = (every >= rest - near).all() or (every <= rest + near).all()
    return rest if back and one_side and len(np.unique(np.round((every - rest) / max(near, 1e-300)))) > 2 else None


def mostly_ramps(steps: Sequence[Run]) -> bool:
    """Whether most steps' inputs are on their way while the output makes much of its change: logs are fitted whole."""
    rises = [Cut(run) for run in steps if run.edge == "rising" and run.has_input and run.kind in (None, "clutch")]
    ramps = [step for step in rises if (told := ramp(step)) is not None and told.code == "input-ramps-on"]
    return 2 * len(ramps) > len(rises)


def only_falls(steps: Sequence[Run]) -> bool:
    """Whether no step rises, of inputs that are known: what their falls begin from tells the plant, as logs do."""
    return bool(steps) and all(
        run.edge == "falling" and run.has_input and run.position is None and run.kind in (None, "clutch")
        for run in steps
    )


def as_logs(runs: Sequence[Run], steps: Sequence[Run], rest: float) -> list[Run]:
    """Runs as logs of any input: as they were read where that is known, else the `steps` that were cut out of them,
    with their level from the step on, or up to it, each joined to what it goes on from."""
    found = [run for run in runs if run.has_input and not run.cut]
    known = {run.source for run in found}
    parts: list[Run] = []
    for step in (one for one in steps if one.source not in known):
        before, after = sorted((step.from_level, step.level or 0.0), reverse=step.edge == "falling")
        held = step.input if step.has_input else np.where(step.time_s >= (step.step_s or 0.0), after, before)
        log = replace(step, input=read_only(rest + held), level=None, step_s=None, until_s=None, cut=False)
        last = parts[-1] if parts else None
        if (
            last is None
            or last.source != log.source
            or not 0 < log.time_s[0] - last.time_s[-1] < ROWS_APART * usual_step(last.time_s)
        ):
            parts.append(log)
            continue
        pairs = (last.time_s, log.time_s), (last.input, log.input), (last.output, log.output)
        time_s, both, output = (read_only(np.concatenate(pair)) for pair in pairs)
        parts[-1] = replace(last, time_s=time_s, input=both, output=output)
    return [*found, *(log for log in parts if (log.input != rest).any())]


def read_whole(logs: Any, options: ReadOptions, before: Mapping[str, Any]) -> list[Run]:
    """Whole logs of files or tables, read as those of a fit were `before` where nothing else is said."""
    runs = read_like(logs, options, before)
    return [bridged(RecordedWindow(run)) for run in runs] if options.repair or before.get("repair") else runs


def to_be_recorded(runs: Sequence[Run], options: ReadOptions) -> list[Run]:
    """Logs that are fitted as they were recorded, with what is to be said of each."""
    found = [bridged(RecordedWindow(run)) if options.repair else run for run in runs]
    for k, run in enumerate(found):
        if run.has_input:
            refuse_percent(run, (np.abs(run.input) > 110, "beyond 100 by more than noise"))
            told = (*run.findings, *active_low(run, plateaus(run.input)), *of_record(run))
            found[k] = replace(run, findings=told)
    return counted_once(found)


def steps_in(
    runs: Sequence[Run], options: ReadOptions, faults: Sequence[str] = (), paths: Sequence[Path] = ()
) -> tuple[list[Run], StepSet]:
    """The same from runs that are read already; `faults` of reading are raised with those of finding steps."""
    if sum(len(run.time_s) for run in runs) >= MANY_ROWS:
        keep_freed_memory()
    how, runs = options.logs_as, named_like(runs, options.where)
    asked, (runs, more) = list(_asked(runs, how)), _ended(runs)
    if asked or more:
        raise DataError(*faults, *asked, *more)
    refuse_far_rest(runs, options.rest)
    top = max((float(np.abs(run.input).max()) for run in runs if run.has_input), default=0.0)
    blanks = [run for run in runs if how != "recorded" and blank(run, top)]
    blanks = blanks if len(blanks) < len(runs) else []
    names = tuple(run.name for run in blanks)
    out = (finding("runs-left-out", "data", runs=names, of=len(runs), why="at rest throughout"),) if blanks else ()
    runs = [run for run in runs if not any(run is one for one in blanks)]
    fitted = ["recorded" if how == "recorded" else fitted_as(run, options.rest) for run in runs]
    runs = [replace(run, swept=True) if as_ == "sweep" else run for run, as_ in zip(runs, fitted, strict=True)]
    uncut = [run for run, as_ in zip(runs, fitted, strict=True) if as_ == "recorded" and how != "steps"]
    whole = [run for run in runs if not any(run is one for one in uncut)]
    if options.levels is not None and uncut and not whole:
        raise UsageError(
            "«levels» keeps steps from rest, and these logs are fitted as recorded: say their range by «duty»"
        )
    steps, more = cut_runs(whole, options)
    if faults or more:
        raise DataError(*faults, *more)
    beside = bool(uncut) and not any(run.position is not None or run.kind not in (None, "clutch") for run in whole)
    if how == "auto" and (beside or two_sided(steps) or mostly_ramps(steps) or only_falls(steps)):
        uncut, whole, steps = [*uncut, *as_logs(whole, steps, options.rest)], [], []
    steps = counted_once([bridged(Cut(run)) for run in steps] if options.repair else steps)
    rises = Counter(run.source for run in steps if run.edge == "rising" and run.from_level == 0)
    several = max(rises.values(), default=0) > 2 and not any(run.cut for run in whole)
    swept = to_be_recorded(whole, options) if how == "auto" and several else []
    uncut = to_be_recorded(uncut, options)
    stepset = stepset_of(steps, options, uncut)
    each = (*stepset.level_steps, *settled_steps(uncut, options))
    at_rest = None if options.rest else unnamed_rest(runs)
    named = () if at_rest is None else (finding("rest-unnamed", "data", rest=at_rest, unit=stepset.input_unit),)
    about = (*out, *named, *stepset.findings, *several_factors([*steps, *uncut]))
    if options.levels is not None:
        kept = {run.name for run in stepset.runs}
        steps = [step for step in steps if step.name in kept]
    inputs = tuple((str(path), sha256_of(path)) for path in paths)
    return steps, replace(
        stepset, recorded=tuple(uncut), level_steps=each, findings=about, inputs=inputs, reading=options.stated(),
        logs=tuple(bridged(RecordedWindow(run)) if options.repair and run.has_input else run for run in whole),
        steps=tuple(steps), swept=tuple(swept),
    )  # fmt: skip
