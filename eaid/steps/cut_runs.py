"""Logs → all their steps, repeats counted, and the faults of the logs that have none; steps from level to level.

A staircase, or steps about an operating point, hold more than steps from rest: Δy and Δu of each change, up and down
apart, are a gain Δy/Δu and a response to which a curve of `eaid.fitting.step_shapes` is fitted.
"""

from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import replace

from eaid.arrays import read_only
from eaid.errors import DataError
from eaid.findings import Finding, finding, stops
from eaid.logs.run import Run
from eaid.options import ReadOptions
from eaid.steps.baseline import baseline_rule
from eaid.steps.cut import cut
from eaid.steps.plateaus import FEWEST
from eaid.steps.step import Step
from eaid.steps.stepset import LevelStep

MOST_SETTLED = 60
"""Steps up to which a log that is fitted as it was recorded has each step fitted by itself, too."""

START_ASSUMED = ("step-at-first-sample", "no-rest-before-step")
"""Findings of steps whose start is that of their first samples."""


def from_rest(run: Run, rest: float) -> Run:
    """A log whose input is counted from its value at rest; a run that is cut already stays as it is."""
    if rest == 0.0 or run.cut or not run.has_input:
        return run
    said = finding("counted-from-rest", run.name, rest=rest)
    return replace(run, input=read_only(run.input - rest), findings=(*run.findings, said))


def cut_runs(runs: Sequence[Run], options: ReadOptions) -> tuple[list[Run], list[str]]:
    """The steps of all logs, repeats counted, and the faults of those that have none."""
    steps: list[Run] = []
    faults: list[str] = []
    for run in runs:
        try:
            of_log = cut(from_rest(run, options.rest), baseline_rule(options.baseline))
            if run.cut:
                _check_window(run)
            steps.extend(of_log if run.cut else _long_enough(of_log))
        except DataError as fault:
            faults.extend(fault.sentences)
    return _counted(steps), faults


def settled_steps(runs: Sequence[Run], options: ReadOptions) -> tuple[LevelStep, ...]:
    """The changes of input between settled holds in logs that are not cut otherwise; none of a log without steps."""
    steps: list[Run] = []
    for run in runs:
        try:
            steps += cut(from_rest(run, options.rest), baseline_rule(options.baseline))
        except DataError:
            continue
    settled = [step for step in steps if _samples(step) >= FEWEST and not stops(step.findings)]
    return level_steps(settled, {}) if len(settled) <= MOST_SETTLED else ()


def _samples(run: Run) -> int:
    """Samples in the active window of a cut run: from its step to its end."""
    return len(run.time_s) - Step(run).start


def _check_window(run: Run) -> None:
    count = _samples(run)
    if count < FEWEST:
        raise DataError(f"{run.where}: {count} samples in its window, at least {FEWEST} are needed; record it longer")


def _long_enough(steps: list[Run]) -> list[Run]:
    """Steps with enough samples; a short one beside good ones is left out and told, one alone refuses the log."""
    good = [step for step in steps if _samples(step) >= FEWEST]
    short = len(steps) - len(good)
    if not any(step.edge == "rising" for step in good):
        for step in steps:
            if step.edge == "rising":
                _check_window(step)
    if short and good:
        said = finding("short-pieces", good[0].name, pieces=short, fewest=FEWEST)
        good[0] = replace(good[0], findings=(*good[0].findings, said))
    return good


def _counted(steps: list[Run]) -> list[Run]:
    """Every step with a repeat number of its own level and edge, in the order given."""
    used: defaultdict[tuple[str, float, float], set[int]] = defaultdict(set)
    names: Counter[str] = Counter()
    counted = []
    for step in steps:
        key = (step.edge, round(abs(step.level or 0.0), 6), round(step.from_level, 6))
        repeat = step.repeat
        if repeat is None or repeat in used[key]:
            repeat = next(n for n in range(1, len(steps) + 2) if n not in used[key])
        used[key].add(repeat)
        names[step.name] += 1
        name = step.name if names[step.name] == 1 else f"{step.name}-{names[step.name]}"
        counted.append(replace(step, repeat=repeat, name=name))
    return counted


def _level_step(step: Step, findings: tuple[Finding, ...]) -> LevelStep:
    run = step.run
    level = run.level or 0.0
    before, after = (level, run.from_level) if run.edge == "falling" else (run.from_level, level)
    start = run.baseline or 0.0
    if run.edge == "falling" and run.from_level == 0.0 and run.held is not None:
        start = run.held
    return LevelStep(
        name=run.name,
        source=run.source,
        from_level=before,
        level=after,
        start=start,
        time_s=step.time_s,
        output=read_only(run.output[step.start :]),
        input=read_only(run.input[step.start :]),
        start_known=not any(one.code in START_ASSUMED for one in run.findings),
        rest_s=run.rest_s,
        rest_moved=run.rest_moved,
        findings=findings,
    )


def level_steps(runs: Sequence[Run], findings: Mapping[str, tuple[Finding, ...]]) -> tuple[LevelStep, ...]:
    """The changes of input of cut runs, with the findings of each name: upwards first, by the level they go to."""
    steps = [_level_step(Step(run), findings.get(run.name, ())) for run in runs if _samples(run)]
    return tuple(sorted(steps, key=lambda one: (one.edge != "up", one.level, one.from_level, one.name)))
