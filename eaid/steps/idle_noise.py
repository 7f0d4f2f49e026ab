"""How noisy the sensor is while the rig idles, in a form that does not depend on the sample rate.

The density S of slow noise is b var(block means), blocks of b = 0.25 s: white noise of standard deviation σ at a rate f
has S = σ²/f. A drift of the idle output is taken out first as a straight line.
"""

import numpy as np

from eaid.arrays import Array

BLOCK_S = 0.25
LEAST_BLOCKS = 8


def idle_density(time_s: Array, idle: Array) -> float | None:
    """S of an idle record [output²·s]; None where it is too short to tell."""
    if len(idle) < 2 * LEAST_BLOCKS or time_s[-1] - time_s[0] < LEAST_BLOCKS * BLOCK_S:
        return None
    block = np.floor((time_s - time_s[0]) / BLOCK_S).astype(np.int64)
    count = np.bincount(block)
    full = count >= 0.5 * np.median(count[count > 0])
    means = (np.bincount(block, idle) / np.maximum(count, 1))[full]
    at = np.flatnonzero(full)
    if len(means) < LEAST_BLOCKS:
        return None
    left = means - np.polyval(np.polyfit(at, means, 1), at)
    return float(BLOCK_S * (left @ left) / (len(means) - 2))
