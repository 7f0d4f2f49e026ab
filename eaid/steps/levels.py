"""Which steps are of one level, as closely as the input column tells them apart; their average; and which are one run.

Repeats are averaged sample by sample where they share a time axis, else interpolated to the finest. Runs are one run
where their values agree to their digits, or closer than noise allows, whatever their clocks, decimals, rates, offsets
and lengths are.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from eaid.arrays import Array, median, read_only
from eaid.errors import DataError, UsageError
from eaid.findings import finding
from eaid.logs.run import Run
from eaid.steps.noise import block_noise, sample_noise
from eaid.steps.step import Step, uniform_step, usual_step
from eaid.steps.stepset import Level

COMMANDS_CLOSE = 1e-3  # Share within which commanded inputs are one level: rounding of what was written
WITHIN = 1e-2  # Share within which measured inputs may be one level, where their noise does not tell them apart
TOLD_APART = 10.0  # Standard deviations of the input's noise beyond which two holds are two levels


def same_level(a: float, b: float, noise: float = math.inf) -> bool:
    """True where two inputs are one level: within 1 % of the larger, and closer than their noise tells apart."""
    size = max(abs(a), abs(b))
    return abs(a - b) <= max(min(WITHIN * size, TOLD_APART * noise), COMMANDS_CLOSE * size, 1e-12)


def grouped(runs: Sequence[Run]) -> list[tuple[float, list[Run]]]:
    """Steps by level, rising: the first input of each level and its runs, in the order given."""
    groups: list[tuple[float, float, list[Run]]] = []
    for run in sorted(runs, key=lambda one: abs(one.level or 0.0)):
        level, hold = abs(run.level or 0.0), run.input[Step(run).start :]
        noise = sample_noise(hold) if len(hold) and not np.isnan(hold[0]) else 0.0  # of one that is commanded: 0
        if groups and same_level(groups[-1][0], level, max(noise, groups[-1][1])):
            groups[-1][2].append(run)
        else:
            groups.append((level, noise, [run]))
    return [(level, members) for level, _, members in groups]


def wanted_levels(text: str, levels: Sequence[float], option: str = "levels") -> list[float]:
    """Those of `levels` that a text as `30:100` or `30,40` keeps; raises DataError where it names one not there."""
    chosen: set[float] = set()
    for part in text.split(","):
        bounds = part.split(":")
        try:
            numbers = [float(bound) for bound in bounds]
        except ValueError:
            numbers = []
        if len(numbers) == 2 and numbers[0] <= numbers[1]:
            meant = [level for level in levels if numbers[0] - 1e-9 <= level <= numbers[1] + 1e-9]
        elif len(numbers) == 1:
            near = [level for level in levels if same_level(level, numbers[0])]
            nearest = min(near, key=lambda u: abs(u - numbers[0]), default=0.0)
            meant = [level for level in near if same_level(level, nearest, 0.0)]
        else:
            raise UsageError(f"«{option}» {text}: write 30:100 or 30,40,90")
        if not meant:
            known = ", ".join(f"{level:g}" for level in levels)
            raise DataError(f"«{option}» {text}: no log holds {part.strip()}; levels found: {known}")
        chosen.update(meant)
    return sorted(chosen)


def common(members: Sequence[Step]) -> Level:
    """The repeats of one level, on their common window, the shortest; its level is their mean where inputs differ."""
    inputs = [member.levels[0] for member in members]
    level = inputs[0] if len(set(inputs)) == 1 else float(np.mean(inputs))
    times = [member.time_s for member in members]
    outputs = [member.rise for member in members]
    steps = [uniform_step(time) for time in times]
    known = [step for step in steps if step is not None]
    shortest = min(len(time) for time in times)
    # the shortest sample time, not that of the first run: the order of the logs decides nothing
    if len(known) == len(steps) and max(known) - min(known) <= 1e-6 * min(known):
        axis = np.arange(shortest) * min(known)
    elif len(members) == 1 or all(np.array_equal(time[:shortest], times[0][:shortest]) for time in times):
        axis = times[0][:shortest]
    else:
        dt = min(usual_step(time) if step is None else step for step, time in zip(steps, times, strict=True))
        end = min(float(time[-1]) for time in times)
        axis = np.arange(np.floor(end / dt * (1 + 1e-12)) + 1) * dt
        outputs = [np.interp(axis, time, output) for time, output in zip(times, outputs, strict=True)]
    runs = np.stack([output[: len(axis)] for output in outputs])
    return Level(level, read_only(axis), read_only(runs), tuple(member.run.name for member in members))


NEIGHBOURS_COMPARED = 60  # Runs of a level that each is compared with: those next to it by their means
# Samples before and behind a step that are compared: long logs take no more time and memory than that
BEFORE, BEHIND = 2_000, 20_000
LEAST_COMMON = 20  # Samples in common below which nothing is compared
SINGLE = 1e-6  # Rounding of a single-precision float
COPIES_ALIKE = 0.5  # Standard deviations of the noise within which no two recordings agree in all of their samples


class _Output(NamedTuple):
    """A run's output around its step."""

    run: Run
    values: Array
    at: int  # Sample at which its input steps
    usual_s: float  # Median sample time [s]
    slack: float  # What a copy may be off: half the unit of the last digit, or a part of the noise


def _output(run: Run) -> _Output:
    if run.step_s is not None:
        at = int(np.searchsorted(run.time_s, run.step_s - 1e-9))
    else:
        at = int((np.abs(run.input - run.input[:1]) > 0.1 * np.ptp(run.input)).argmax()) if len(run.input) else 0
    begin = max(0, at - BEFORE)
    values = run.output[begin : at + BEHIND]
    gaps = np.diff(np.unique(values))
    digit = float(gaps.min()) if len(gaps) else 0.0  # the least by which two of its values differ
    rounding = 0.505 * digit + SINGLE * float(np.abs(values).max(initial=0.0))
    usual_s = usual_step(run.time_s) if len(run.time_s) > 1 else 1.0
    return _Output(run, values, at - begin, usual_s, max(rounding, COPIES_ALIKE * block_noise(values)))


def counted_once(runs: Sequence[Run]) -> list[Run]:
    """Runs without copies of a run of another log, their steps laid on each other; the longer one stays and says so."""
    kept = {id(run): run for run in runs}
    groups: dict[tuple[str, str, str, str], list[Run]] = {}
    for run in runs:
        groups.setdefault((run.edge, run.kind or "", run.input_unit, run.output_unit), []).append(run)
    for _, members in (level for group in groups.values() for level in grouped(group)):
        alone: list[_Output] = []
        for one in sorted(map(_output, members), key=lambda one: float(one.values.mean())):
            for k, other in list(enumerate(alone))[-NEIGHBOURS_COMPARED:]:
                same_log = (one.run.dataset, one.run.source) == (other.run.dataset, other.run.source)
                if same_log or not _copied(one, other):
                    continue
                longer, shorter = (one, other) if len(one.run.output) > len(other.run.output) else (other, one)
                told = kept[id(longer.run)]
                note = finding("run-given-twice", told.name, (told.level or 0.0,), other=shorter.run.where)
                kept[id(longer.run)] = replace(told, findings=(*told.findings, note))
                del kept[id(shorter.run)]
                alone[k] = longer
                break
            else:
                alone.append(one)
    return list(kept.values())


def _copied(one: _Output, other: _Output) -> bool:
    """Whether one run's values are those of another, or every so many of them, but for rounding and an offset."""
    fine, coarse = (one, other) if one.usual_s <= other.usual_s else (other, one)
    slower = round(coarse.usual_s / fine.usual_s)
    for stride in {1, slower if slower * LEAST_COMMON < len(fine.values) else 1}:
        for shift in range(-stride, stride + 1):
            at, first = divmod(fine.at + shift, stride)
            of_fine = fine.values[first::stride]
            before, behind = min(at, coarse.at), min(len(of_fine) - at, len(coarse.values) - coarse.at)
            if before < 0 or before + behind < LEAST_COMMON:
                continue
            a = of_fine[at - before : at + behind]
            off = a - coarse.values[coarse.at - before : coarse.at + behind]
            slack = max(one.slack, other.slack)
            if np.ptp(off) <= 2 * slack and np.ptp(a) > 0 and np.abs(off - median(off)).max() <= slack:
                return True
    return False
