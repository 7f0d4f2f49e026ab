"""A saturated sensor behind noise: the highest levels stop at one value, each in the middle of its rise."""

from collections.abc import Sequence

import numpy as np

from eaid.arrays import Array
from eaid.findings import Finding, finding
from eaid.steps.noise import block_error
from eaid.steps.stepset import Level

ALIKE = 0.005
"""Share within which two levels end at one value."""
SHARP = 0.35
"""Slope just below the ceiling, relative to ceiling over rise time, from which a rise is cut off and not settling."""


def same_ceiling(levels: Sequence[Level], unit: str) -> list[Finding]:
    """A finding where two or more of the highest levels end at one value, and reach it at full slope."""
    if len(levels) < 3:
        return []
    ends = [float(level.mean[-max(1, len(level.mean) // 2) :].mean()) for level in levels]
    errors = [block_error(level.mean) for level in levels]
    top = ends[-1]
    capped = [len(levels) - 1]
    for i in range(len(levels) - 2, -1, -1):
        if abs(ends[i] - top) > max(ALIKE * abs(top), 3 * max(errors[i], errors[-1])):
            break
        capped.insert(0, i)
    sharp = [i for i in capped if sharpness(levels[i].mean, levels[i].time_s, top) > SHARP]
    if len(capped) < 2 or len(sharp) < 2 or top <= 0:
        return []
    return [finding("same-ceiling", "data", [levels[i].level for i in capped], ceiling=top, unit=unit)]


def sharpness(output: Array, time_s: Array, ceiling: float) -> float:
    """Slope of a rise as it comes within 5 % of a ceiling, times the time that took, over the ceiling.

    An exponential has 0.15 to 0.2 there, a straight rise that is cut off 0.95.
    """
    near = np.flatnonzero(output >= 0.95 * ceiling)
    if not len(near) or near[0] < 4:
        return 0.0
    at = int(near[0])
    few = max(2, at // 5)
    t = time_s[at - few : at + 1] - time_s[at - few : at + 1].mean()
    slope = float(t @ output[at - few : at + 1] / (t @ t))
    return slope * float(time_s[at]) / ceiling
