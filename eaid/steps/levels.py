"""Which steps are of one level: by their inputs, as closely as the input column tells them apart."""

import math
from collections.abc import Sequence

import numpy as np

from eaid.errors import DataError, UsageError
from eaid.logs.run import Run
from eaid.steps.noise import sample_noise

CLOSE = 1e-3
"""Share within which commanded inputs are one level: rounding of what was written."""
WITHIN = 1e-2
"""Share within which measured inputs may be one level, where their noise does not tell them apart."""
TOLD_APART = 10.0
"""Standard deviations of the input's noise beyond which two holds are two levels."""


def same_level(a: float, b: float, noise: float = math.inf) -> bool:
    """True where two inputs are one level: within 1 % of the larger, and closer than their noise tells apart."""
    size = max(abs(a), abs(b))
    return abs(a - b) <= max(min(WITHIN * size, TOLD_APART * noise), CLOSE * size, 1e-12)


def hold_noise(run: Run) -> float:
    """Noise of the input under a step's hold; 0 where it is commanded, or said by the file name."""
    start = int(np.searchsorted(run.time_s, (run.step_s or 0.0) - 1e-9 * max(1.0, abs(run.step_s or 0.0))))
    held = run.input[start:]
    return 0.0 if not len(held) or bool(np.isnan(held[0])) else sample_noise(held)


def grouped(runs: Sequence[Run]) -> list[tuple[float, list[Run]]]:
    """Steps by level, rising: the first input of each level and its runs, in the order given."""
    groups: list[tuple[float, float, list[Run]]] = []
    for run in sorted(runs, key=lambda one: abs(one.level or 0.0)):
        level, noise = abs(run.level or 0.0), hold_noise(run)
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
            found = [level for level in levels if numbers[0] - 1e-9 <= level <= numbers[1] + 1e-9]
        elif len(numbers) == 1:
            near = sorted(
                (level for level in levels if same_level(level, numbers[0])), key=lambda u: abs(u - numbers[0])
            )
            found = [level for level in near if same_level(level, near[0], 0.0)]
        else:
            raise UsageError(f"«{option}» {text}: write 30:100 or 30,40,90")
        if not found:
            held = ", ".join(f"{level:g}" for level in levels)
            raise DataError(f"«{option}» {text}: no log holds {part.strip()}; levels found: {held}")
        chosen.update(found)
    return sorted(chosen)
