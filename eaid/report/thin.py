"""Long recordings → few points that draw alike: the least and the greatest sample of each stretch are kept."""

import numpy as np

from eaid.arrays import Array


def thinned(time_s: Array, values: Array, points: int) -> tuple[Array, Array]:
    """At most about `points` samples of a curve, shape (≤ points + 2,): extremes of equal stretches, in order of time.

    A spike of one sample survives, which taking every k-th sample would lose.
    """
    keep = thinned_at(values, points)
    return time_s[keep], values[keep]


def thinned_at(values: Array, points: int) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
    """Which samples `thinned` keeps, rising; the first and the last are always among them."""
    n = len(values)
    if n <= points:
        return np.arange(n)
    stretches = max(points // 2, 1)
    width = -(-n // stretches)
    padded = np.full(-(-n // width) * width, np.nan)
    padded[:n] = np.nan_to_num(values)
    blocks = padded.reshape(-1, width)
    start = np.arange(len(blocks)) * width
    low = start + np.argmin(np.where(np.isnan(blocks), np.inf, blocks), axis=1)
    high = start + np.argmax(np.where(np.isnan(blocks), -np.inf, blocks), axis=1)
    return np.unique(np.concatenate([[0], low, high, [n - 1]]))
