"""The slow time constant of a rise, and whether its window is long enough to tell it: costs on a grid of pairs."""

import numpy as np

from eaid.arrays import Array
from eaid.steps.noise import BLOCKS, block_means

SLOW_CONSTANTS = 1.5
"""A window shorter than this many slow time constants cannot tell them."""


def slow_constant(rise: Array, window_s: float) -> tuple[float, bool]:
    """Slow time constant [s] of a rise by two exponentials, and whether the window is surely too short for it.

    Costs of all pairs of a grid on block means; for each pair the amplitudes A1, A2 and, by the derivative over ln τ1,
    the fast constant between the grid's values, are a 3 × 3 linear solve. The window is too short where no pair with
    τ2 below window / 1.5 fits as well (F test, 5 standard errors).
    """
    means = block_means(rise, 4 * BLOCKS)
    count = len(means)
    tau = np.geomspace(1 / 300, 20.0, 64)  # in windows
    edges = np.linspace(0.0, 1.0, count + 1)
    decay = np.exp(-edges / tau[:, np.newaxis])
    # block means of 1 − e^(−t/τ), and of its derivative over ln τ: −(t/τ) e^(−t/τ)
    mean_decay = -np.diff(decay, axis=1) * tau[:, np.newaxis] * count
    curves = 1.0 - mean_decay
    both = np.concatenate((curves, np.diff(edges * decay, axis=1) * count - mean_decay))
    fast, slow = np.triu_indices(len(tau), 5)
    places = np.stack((fast, fast + len(tau), slow), axis=1)
    matrix = (both @ both.T)[places[:, :, np.newaxis], places[:, np.newaxis, :]]
    # a trace of the diagonal keeps nearly equal columns solvable
    matrix += 1e-12 * np.trace(matrix, axis1=1, axis2=2)[:, np.newaxis, np.newaxis] * np.eye(3)
    vector = (both @ means)[places]
    amplitudes = np.linalg.solve(matrix, vector[:, :, np.newaxis])[:, :, 0]
    fine = (amplitudes[:, 0] > 0) & (amplitudes[:, 2] > 0) & (np.abs(amplitudes[:, 1]) < 0.2 * amplitudes[:, 0])
    total = float(means @ means)
    single = (curves @ means) ** 2 / (curves * curves).sum(axis=1)
    tau2_s = window_s * np.concatenate((tau, tau[slow][fine]))
    cost = total - np.concatenate((single, (amplitudes * vector).sum(axis=1)[fine]))
    short = tau2_s * SLOW_CONSTANTS > window_s
    best_short, best_long = float(cost[short].min()), float(cost[~short].min())
    noise = max(best_short, 1e-10 * total)
    return float(tau2_s[cost.argmin()]), (best_long - best_short) / noise * (count - 4) > 25.0
