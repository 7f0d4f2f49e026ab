"""Which steps are of one level, as closely as the input column tells them apart, and their average.

Repeats are averaged sample by sample where they share a time axis, else interpolated to the finest.
"""

import math
from collections.abc import Sequence

import numpy as np

from eaid.arrays import read_only
from eaid.errors import DataError, UsageError
from eaid.logs.run import Run
from eaid.steps.noise import sample_noise
from eaid.steps.step import Cut, uniform_step, usual_step
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
        level, hold = abs(run.level or 0.0), run.input[Cut(run).start :]
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


def common(members: Sequence[Cut]) -> Level:
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
