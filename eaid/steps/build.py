"""Runs → the step set that is fitted: cut, sorted by level, repeats averaged, with a table of what is doubtful."""

from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from eaid.apparatus import Apparatus
from eaid.arrays import read_only
from eaid.errors import DataError, UsageError
from eaid.logs.run import Kind, Run
from eaid.logs.spool import mean, release
from eaid.steps.average import common
from eaid.steps.clock import Clocks
from eaid.steps.cut import FEWEST, cut, has_input
from eaid.steps.doubts import Step, disagreement, doubts, left_pct, lost_pct
from eaid.steps.stepset import Level, RunRecord, StepSet

DISAGREE = 0.10
"""Repeats whose torque at the end differs by more than this share are told."""


@dataclass(frozen=True)
class StepOptions:
    """Settings of `build_stepset`."""

    kind: Kind | None = None
    levels: str | None = None
    """`30:100` or `30,40,90`: levels to keep."""
    keep_baseline: bool = False
    """Leave the idle output in; default: it is subtracted."""
    rest: float = 0.0
    """Input at rest, in the input's unit: levels are counted from it."""
    apparatus: Apparatus | None = None
    """The rig; None: as the dataset says, else the paper's."""


NOTHING_SAID = StepOptions()


def wanted_levels(text: str, levels: Sequence[float]) -> list[float]:
    """Those of `levels` that a `--levels` text keeps; raises DataError where it names one that is not there."""
    chosen: set[float] = set()
    for part in text.split(","):
        bounds = part.split(":")
        try:
            numbers = [float(bound) for bound in bounds]
        except ValueError:
            numbers = []
        if len(numbers) == 2 and numbers[0] <= numbers[1]:
            found = [level for level in levels if numbers[0] - 1e-9 <= level <= numbers[1] + 1e-9]
        elif len(numbers) == 1:
            found = [level for level in levels if same_level(level, numbers[0])]
        else:
            raise UsageError(f"--levels {text}: write 30:100 or 30,40,90")
        if not found:
            held = ", ".join(f"{level:g}" for level in levels)
            raise DataError(f"--levels {text}: no log holds {part.strip()}; levels found: {held}")
        chosen.update(found)
    return sorted(chosen)


def same_level(a: float, b: float) -> bool:
    """True where two inputs are one level: within 1 % of the larger."""
    return abs(a - b) <= max(1e-2 * max(abs(a), abs(b)), 1e-12)


def from_rest(run: Run, rest: float) -> Run:
    """A log whose input is counted from its value at rest; a run that is cut already stays as it is."""
    if rest == 0.0 or run.cut or not has_input(run):
        return run
    return replace(run, input=read_only(run.input - rest), notes=(*run.notes, f"levels counted from rest at {rest:g}"))


def cut_runs(runs: Sequence[Run], options: StepOptions) -> tuple[list[Run], list[str]]:
    """The steps of all logs, repeats counted, and the faults of those that have none."""
    steps: list[Run] = []
    faults: list[str] = []
    for run in runs:
        try:
            found = cut(from_rest(run, options.rest), options.keep_baseline)
            if not run.cut:
                found = _long_enough(found)
            else:
                _check_window(found[0])
            steps.extend(found)
            release(run.time_s, run.input, run.output)
        except DataError as fault:
            faults.extend(fault.sentences)
    return _counted(steps), faults


def _samples(run: Run) -> int:
    """Samples in the active window of a cut run: from its step to its end."""
    return len(run.time_s) - Step(run).start


def _check_window(run: Run) -> None:
    count = _samples(run)
    if count < FEWEST:
        raise DataError(f"{run.where}: {count} samples in its window, at least {FEWEST} are needed; record it longer")


def _long_enough(steps: list[Run]) -> list[Run]:
    """Steps with enough samples; a short one beside good ones is left out and told, one alone refuses the log."""
    good = []
    short = 0
    for step in steps:
        if _samples(step) >= FEWEST:
            good.append(step)
        else:
            short += 1
    if not any(step.edge == "rising" for step in good):
        for step in steps:
            if step.edge == "rising":
                _check_window(step)
    if short and good:
        some = f"{short} shorter piece" + ("s" if short > 1 else "")
        good[0] = replace(good[0], notes=(*good[0].notes, f"{some} of fewer than {FEWEST} samples left out"))
    return good


def _counted(steps: list[Run]) -> list[Run]:
    """Every step with a repeat number of its own level and edge, in the order given."""
    used: defaultdict[tuple[str, float], set[int]] = defaultdict(set)
    names: Counter[str] = Counter()
    counted = []
    for step in steps:
        key = (step.edge, round(abs(step.level or 0.0), 6))
        repeat = step.repeat
        if repeat is None or repeat in used[key]:
            repeat = next(n for n in range(1, len(steps) + 2) if n not in used[key])
        used[key].add(repeat)
        names[step.name] += 1
        name = step.name if names[step.name] == 1 else f"{step.name}-{names[step.name]}"
        counted.append(replace(step, repeat=repeat, name=name))
    return counted


def _signs(cut_steps: Sequence[Run]) -> dict[bool, float]:
    """Sign of the torque that positive and negative inputs make, from all their rising steps together.

    One sign for all, since a level that makes no torque has the sign of its noise.
    """
    totals = {False: 0.0, True: 0.0}
    for run in cut_steps:
        if run.edge == "rising":
            totals[(run.level or 0.0) < 0] += mean(run.output[Step(run).start :]) - (run.baseline or 0.0)
            release(run.time_s, run.output)
    return {negative: -1.0 if total < 0 else 1.0 for negative, total in totals.items()}


def _record(step: Step, warnings: tuple[str, ...]) -> RunRecord:
    run = step.run
    return RunRecord(
        name=run.name,
        source=run.source,
        sha256=run.sha256,
        level=abs(run.level or 0.0),
        repeat=run.repeat or 1,
        baseline_nm=run.baseline or 0.0,
        step_s=run.step_s or 0.0,
        samples=len(step.time_s),
        rate_hz=1.0 / step.clock.usual_s,
        edge=run.edge,
        warnings=warnings,
        lost_pct=lost_pct(step) if run.edge == "rising" else None,
        left_pct=left_pct(step) if run.edge == "falling" else None,
    )


def _one(values: set[str], what: str, remedy: str) -> str:
    if len(values) > 1:
        raise DataError(f"the logs have different {what} ({', '.join(sorted(v or 'none' for v in values))}); {remedy}")
    return next(iter(values))


def build_stepset(runs: Sequence[Run], options: StepOptions = NOTHING_SAID) -> StepSet:
    """Step set of runs, cut or not; raises DataError with a sentence for every log that cannot be used."""
    steps, faults = cut_runs(runs, options)
    if faults:
        raise DataError(*faults)
    return stepset_of(steps, options)


def stepset_of(cut_steps: Sequence[Run], options: StepOptions = NOTHING_SAID) -> StepSet:
    """Step set of runs that are cut already (`cut_runs`)."""
    if not cut_steps:
        raise DataError("no log holds a step; give logs with one")
    kinds = {run.kind for run in cut_steps if run.kind is not None}
    if options.kind is None and len(kinds) > 1:
        raise DataError(f"the logs are of different experiments ({', '.join(sorted(kinds))}); give one, or say --kind")
    told: Kind | None = options.kind or next(iter(kinds), None)
    kind: Kind = told or "clutch"
    input_unit = _one({run.input_unit for run in cut_steps}, "input units", "say one with --units input=UNIT")
    output_unit = _one({run.output_unit for run in cut_steps}, "output units", "say one with --units output=UNIT")
    rigs = {run.apparatus for run in cut_steps if run.apparatus is not None}
    if options.apparatus is None and len(rigs) > 1:
        raise DataError("the datasets are of different rigs; fit them apart")
    apparatus = options.apparatus or next(iter(rigs), Apparatus(surfaces=2 if kind == "clutch" else 1))

    groups: dict[str, list[tuple[float, list[Run]]]] = {"rising": [], "falling": []}
    warnings: dict[str, list[str]] = {}
    signs = _signs(cut_steps)
    clocks = Clocks()
    records: list[RunRecord] = []
    for run in sorted(cut_steps, key=lambda r: (abs(r.level or 0.0), r.repeat or 0, r.name)):
        notes = list(run.notes)
        if (run.level or 0.0) < 0:
            notes.append("the input is negative: its size is taken")
        if signs[(run.level or 0.0) < 0] < 0:
            notes.append("the output falls at the step: recorded inverted, its sign is turned")
        step = Step(run, signs[(run.level or 0.0) < 0], clocks)
        warnings[run.name] = [*notes, *doubts(step)]
        records.append(_record(step, ()))
        release(run.time_s, run.input, run.output)
        if run.from_level != 0:
            continue
        level = abs(run.level or 0.0)
        group = groups[run.edge]
        if group and same_level(group[-1][0], level):
            group[-1][1].append(run)
        else:
            group.append((level, [run]))
    if options.levels is not None:
        kept = wanted_levels(options.levels, sorted({level for level, _ in groups["rising"]}))
        groups = {
            edge: [pair for pair in group if any(same_level(pair[0], k) for k in kept)]
            for edge, group in groups.items()
        }
        records = [record for record in records if any(same_level(record.level, k) for k in kept)]

    sets: list[str] = []
    if input_unit == "%" and groups["rising"] and groups["rising"][-1][0] <= 1:
        sets.append("no level is above 1 %: if the duty is a fraction of 1, say --units input=fraction")
    rising = [_level(members, signs, clocks, warnings) for _, members in groups["rising"]]
    if not rising:
        held = {f"{run.from_level:.3g} to {run.level or 0:.3g}" for run in cut_steps if run.edge == "rising"}
        goes = f" (the input goes from {', '.join(sorted(held)[:3])} {input_unit})" if held else ""
        raise DataError(
            f"no log holds a step from rest{goes}; record one from zero, or give the input at rest with --rest"
        )
    counts = {len(level.names) for level in rising}
    if len(counts) > 1:
        few = min(counts)
        at = ", ".join(f"{level.level:g}" for level in rising if len(level.names) == few)
        sets.append(f"repeats differ in number: {at} {input_unit} only {few}, others up to {max(counts)}")
    stairs = sum(run.from_level != 0 for run in cut_steps)
    if stairs:
        sets.append(
            f"{stairs} of {len(cut_steps)} steps go from one level to another and are not fitted, as the models "
            "describe a step from rest: let the input go back to rest before each level; eaid simulate --log compares "
            "the whole log, stairs and all, with a fitted model"
        )
    releases = [_level(members, signs, clocks, None) for _, members in groups["falling"]]
    records = [replace(record, warnings=tuple(warnings[record.name])) for record in records]
    records.sort(key=lambda r: (r.level, r.repeat, r.edge != "rising", r.name))
    made = sorted({run.synthetic for run in cut_steps if run.synthetic})
    return StepSet(
        kind=kind,
        input_unit=input_unit,
        output_unit=output_unit,
        apparatus=apparatus,
        levels=tuple(rising),
        releases=tuple(releases),
        runs=tuple(records),
        warnings=tuple(sets),
        synthetic="; ".join(made) or None,
    )


def _level(runs: list[Run], signs: dict[bool, float], clocks: Clocks, warnings: dict[str, list[str]] | None) -> Level:
    """The repeats of one level, averaged on their common window; what disagrees is told in each of them."""
    inputs = [abs(run.level or 0.0) for run in runs]
    level = inputs[0] if len(set(inputs)) == 1 else float(np.mean(inputs))
    averaged = common(level, [Step(run, signs[(run.level or 0.0) < 0], clocks) for run in runs])
    for run in runs:
        release(run.time_s, run.output)
    if warnings is not None and len(runs) > 1:
        spread = disagreement(averaged.runs)
        release(averaged.runs)
        if spread > DISAGREE:
            for run in runs:
                warnings[run.name].append(f"repeats disagree: their torque at the end differs by {spread:.0%}")
    return averaged
