"""The slow time constant of a rise, and whether its window is long enough to tell it: costs on a grid of pairs."""

from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from eaid.arrays import Array
from eaid.steps.noise import BLOCKS, block_means

SLOW_CONSTANTS = 1.5
"""A window shorter than this many slow time constants cannot tell them."""


class _Pairs(NamedTuple):
    """Pairs of time constants on a grid, in windows, and the linear solves that belong to them."""

    tau: Array
    """The grid."""
    slow: NDArray[np.intp]
    """Place of each pair's τ2 on the grid."""
    both: Array
    """Block means of 1 − e^(−t/τ) on the grid, and below them those of its derivatives over ln τ: −(t/τ) e^(−t/τ)."""
    places: NDArray[np.intp]
    """Rows of `both` that a pair uses: (τ1, derivative at τ1, τ2)."""
    inverse: Array
    """Inverse of the 3 × 3 normal equations of each pair."""


@cache
def _pairs(count: int) -> _Pairs:
    """The grid for a window of `count` blocks: nothing in it depends on the record."""
    edges = np.linspace(0.0, 1.0, count + 1)
    tau = np.geomspace(1 / 300, 20.0, 64)
    decay = np.exp(-edges / tau[:, np.newaxis])
    mean_decay = -np.diff(decay, axis=1) * tau[:, np.newaxis] * count
    both = np.concatenate((1.0 - mean_decay, np.diff(edges * decay, axis=1) * count - mean_decay))
    gram = both @ both.T
    fast, slow = np.triu_indices(len(tau), 5)
    places = np.stack((fast, fast + len(tau), slow), axis=1)
    matrix = gram[places[:, :, np.newaxis], places[:, np.newaxis, :]]
    # a trace of the diagonal keeps nearly equal columns solvable
    ridge = 1e-12 * np.trace(matrix, axis1=1, axis2=2)[:, np.newaxis, np.newaxis] * np.eye(3)
    return _Pairs(tau, slow, both, places, np.linalg.inv(matrix + ridge))


def slow_constant(rise: Array, window_s: float) -> tuple[float, bool]:
    """Slow time constant [s] of a rise by two exponentials, and whether the window is surely too short for it.

    Costs of all pairs of a grid on block means; for each pair the amplitudes A1, A2 and, by the derivative over ln τ1,
    the fast constant between the grid's values, are a 3 × 3 linear solve. The window is too short where no pair with
    τ2 below window / 1.5 fits as well (F test, 5 standard errors).
    """
    means = block_means(rise, 4 * BLOCKS)
    count = len(means)
    grid = _pairs(count)
    right = grid.both @ means
    vector = right[grid.places]
    amplitudes = np.einsum("kij,kj->ki", grid.inverse, vector)
    fine = (amplitudes[:, 0] > 0) & (amplitudes[:, 2] > 0) & (np.abs(amplitudes[:, 1]) < 0.2 * amplitudes[:, 0])
    total = float(means @ means)
    one = grid.both[: len(grid.tau)]
    single = right[: len(grid.tau)] ** 2 / (one * one).sum(axis=1)
    tau = window_s * np.concatenate((grid.tau, grid.tau[grid.slow][fine]))
    cost = total - np.concatenate((single, (amplitudes * vector).sum(axis=1)[fine]))
    short = tau * SLOW_CONSTANTS > window_s
    best_short, best_long = float(cost[short].min()), float(cost[~short].min())
    noise = max(best_short, 1e-10 * total)
    return float(tau[cost.argmin()]), (best_long - best_short) / noise * (count - 4) > 25.0
