"""A saturated sensor behind noise: a rise that stops at full slope, at one value for the highest levels.

One run alone may as well be a contact that slips: its loading stops as sharply. Where its noise then is less than half
of the idle's, the sensor has stopped.
"""

from collections.abc import Sequence

import numpy as np

from eaid.arrays import Array
from eaid.findings import Finding, finding
from eaid.steps.noise import block_error, block_means, block_noise, sample_noise
from eaid.steps.step import Step
from eaid.steps.stepset import Level

ALIKE = 0.005
"""Share within which two levels end at one value."""
SHARP = 0.35
"""Slope just below the ceiling, relative to ceiling over rise time, from which a rise is cut off and not settling."""


FLAT = 0.4
"""The same of one run alone."""
CREEP = 0.002
"""Share of its top by which a flat one may still creep over its last quarter."""
SMOOTH = 400
FEW = 100


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


def flat_top(step: Step) -> Finding | None:
    """A finding where one run stops at full slope and stays there, within its noise."""
    rise = step.rise
    if step.run.edge == "falling" or len(rise) < 200 or not step.swing > 0:
        return None
    half, quarter = len(rise) // 2, len(rise) // 4
    top = float(np.median(rise[half:]))
    creep = abs(float(rise[-quarter:].mean() - rise[half:-quarter].mean()))
    slack = max(CREEP * top, 3 * block_error(rise))
    if top <= 0 or creep > slack or block_means(rise).max() > top + 3 * slack or _rise_of(step, top) < FLAT:
        return None
    idle, held = sample_noise(step.idle) if len(step.idle) >= 20 else 0.0, sample_noise(rise[half:])
    code = "saturated-behind-noise" if 0 < held < 0.5 * idle else "flat-topped"
    return finding(code, step.run.name, (abs(step.run.level or 0.0),), limit=top, unit=step.unit)


def _rise_of(step: Step, top: float) -> float:
    """Sharpness of a rise, less its error, averaged to a hundred blocks or more; 0 of a few samples."""
    count = len(step.rise)
    while True:
        means = block_means(step.rise[:count], SMOOTH)
        near = np.flatnonzero(means >= 0.95 * top)
        wanted = int(count * 4 * int(near[0] + 1) / len(means)) if len(near) else count
        if wanted >= count or count <= SMOOTH:
            if not len(near) or near[0] < 5:
                return 0.0
            at, few = int(near[0]), max(2, int(near[0]) // 5)
            noise = max(sample_noise(step.rise) / np.sqrt(count / len(means)), block_noise(means[::3]))
            error = noise * at / top / np.sqrt(few * (few + 1) * (few + 2) / 12)
            return sharpness(means, block_means(step.time_s[:count], SMOOTH), top) - float(error)
        count = max(wanted, FEW)


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
