"""Repeats recorded as sweeps: what all levels of one sweep have in common, for example a gain of that day.

Levels of one sweep then move together, and Σ(R − 1) over the levels counts far too many independent runs. A two-way
analysis of variance of the runs' influences (levels × repeats) finds it: F = L Σ m_r²/(R − 1) against what is left,
m_r the mean over levels. The common part is known from R sweeps only, so it has R − 1 degrees of freedom.
"""

from collections.abc import Sequence

import numpy as np
from scipy.special import fdtrc

from eaid.arrays import Array
from eaid.uncertainty.run_statistics import RunStatistics

CHANCE = 0.01
"""Probability at which repeats that are independent would be taken for sweeps."""
LEAST_LEVELS = 3


def common_shifts(levels: Sequence[RunStatistics], k: int) -> Array | None:
    """m_r, what every level's run r has in common in parameter k, shape (R,); None where repeats are independent.

    Runs are matched by their place: the first run of each level was one sweep, and so on.
    """
    counts = {level.repeats for level in levels}
    if len(levels) < LEAST_LEVELS or len(counts) != 1 or counts == {1}:
        return None
    d = np.array([level.influence[:, k] for level in levels])
    if not np.isfinite(d).all():
        return None
    count, repeats = d.shape
    mean = d.mean(axis=0)
    together = count * float(mean @ mean) / (repeats - 1)
    apart = float(((d - mean) ** 2).sum()) / ((count - 1) * (repeats - 1))
    if apart == 0:
        return None
    chance = fdtrc(repeats - 1, (count - 1) * (repeats - 1), together / apart)
    return mean if chance < CHANCE else None
