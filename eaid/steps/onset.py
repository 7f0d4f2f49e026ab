"""Where an output by itself shows its step: the first sample after its last visit to the idle band."""

import numpy as np

from eaid.arrays import Array, median
from eaid.steps.noise import sample_noise, sampled
from eaid.steps.plateaus import FEWEST


def rises_at_once(output: Array, start: float = 0.0) -> bool:
    """True where the output begins at `start` and leaves it from its first sample on, without an idle stretch before.

    At a quarter of the time to half of its end value a step response has long risen; an idle output has not.
    """
    count = len(output)
    if count < 2 * FEWEST:
        return False
    rise = output - start
    end = median(sampled(rise[-(count // 10) :]))
    noise = sample_noise(output)
    if abs(end) <= 8 * noise or abs(float(rise[:3].mean())) > 0.2 * abs(end):
        return False
    above = np.flatnonzero(np.sign(end) * rise >= 0.5 * abs(end))
    high = int(above[0]) if len(above) else count - 1
    quarter = np.sign(end) * rise[high // 4 : high // 4 + high // 8 + 1]
    return bool(quarter.mean() >= 0.05 * abs(end) + 4 * noise / np.sqrt(len(quarter)))


def onset(output: Array) -> int | None:
    """First sample after the output's last visit to its idle band before it is half-way up; None where none stands out.

    The idle band is the median of the first samples ± 4 standard deviations (from the median deviation), at least 1 %
    of the rise; the first samples are refined once by those before the onset found.
    """
    count = len(output)
    head = max(FEWEST, count // 50)
    if count < 2 * FEWEST:
        return None
    start = None
    for _ in range(3):
        idle = median(output[:head])
        noise = 1.4826 * median(np.abs(output[:head] - idle))
        away = np.abs(output - idle)
        rise = float(np.quantile(away, 0.9))
        if rise <= 8 * noise or rise == 0:
            return None
        half = np.flatnonzero(away >= 0.5 * rise)
        inside = np.flatnonzero(away[: half[0]] <= max(4 * noise, 0.01 * rise))
        if not len(inside):
            return None
        found = int(inside[-1]) + 1
        if found == start:
            break
        start, head = found, max(FEWEST, found * 9 // 10)
    return start
