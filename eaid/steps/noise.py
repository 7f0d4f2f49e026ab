"""How noisy a record is: block means, their standard error, the noise of single samples, isolated spikes.

Noise is taken from differences between neighbours, so that slow changes do not count as noise. Long records are judged
by some stretches of them, evenly spread.
"""

import numpy as np
from numpy.typing import NDArray

from eaid.arrays import Array, median

BLOCKS = 20
"""A window is judged by the means of this many equal parts."""
LONG = 1 << 22
"""Samples from which medians are taken from stretches of a record only."""
SPIKE = 25.0
"""Standard deviations of the noise beyond which a single sample is a spike."""


def block_means(values: Array, blocks: int = BLOCKS) -> Array:
    """Means of equal parts, shape (blocks,), fewer where there are fewer samples."""
    blocks = max(1, min(blocks, len(values)))
    edges = np.linspace(0, len(values), blocks + 1).astype(np.intp)
    return np.asarray(np.add.reduceat(values, edges[:-1]) / np.diff(edges))


def block_error(values: Array, blocks: int = BLOCKS) -> float:
    """Standard error of the mean of one of `blocks` parts, from how far neighbouring means of a fine division differ.

    0 of fewer than 8 samples.
    """
    means = block_means(values, 4 * blocks)
    return block_noise(means) * float(np.sqrt(blocks / len(means))) if len(means) >= 8 else 0.0


def block_noise(means: Array) -> float:
    """Standard deviation of the noise of single values, from their second differences; 0 of fewer than three."""
    if len(means) < 3:
        return 0.0
    bends = means[2:] - 2 * means[1:-1] + means[:-2]
    return float(1.4826 * median(np.abs(bends)) / np.sqrt(6))


def sampled(values: Array) -> Array:
    """Values, or of a long record some stretches of it, evenly spread: what medians and quantiles are taken from."""
    if len(values) < LONG:
        return values
    return np.concatenate([values[start : start + (1 << 14)] for start in _stretches(values)])


def sample_steps(values: Array) -> Array:
    """Differences of neighbours, or of a long record those of some stretches of it."""
    if len(values) < LONG:
        return np.diff(values)
    return np.concatenate([np.diff(values[start : start + (1 << 14)]) for start in _stretches(values)])


def _stretches(values: Array) -> list[int]:
    return np.linspace(0, len(values) - (1 << 14), 32).astype(np.int64).tolist()  # type: ignore[no-any-return]


def sample_noise(values: Array) -> float:
    """Standard deviation of the noise of single samples, from the median difference of neighbours; 0 of one sample."""
    steps = sample_steps(values)
    return float(1.4826 * median(np.abs(steps)) / np.sqrt(2)) if len(steps) else 0.0


def spikes(values: Array, least: float) -> NDArray[np.intp]:
    """Samples that stand out of both neighbours, in one direction, by `SPIKE` of the noise and by `least`."""
    if len(values) < 8:
        return np.empty(0, dtype=np.intp)
    steps = np.diff(values)
    limit = max(SPIKE * sample_noise(values), least)
    before, after = steps[:-1], steps[1:]
    return np.flatnonzero((np.abs(before) > limit) & (np.abs(after) > limit) & (before * after < 0)) + 1
