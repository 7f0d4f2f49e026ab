"""Least squares of few unknowns between bounds: Levenberg–Marquardt, on the unknowns that no bound holds.

SciPy's bounded methods take three to four times as long on such problems, where half of all fits end at a bound.
"""

from collections.abc import Callable

import numpy as np

from eaid.arrays import Array

ROUNDING = 1e-30
"""Of one residual, squared, where they are of size 1."""
FIRST, LEAST = 1e-3, 1e-9
"""Damping at first, and at least, as a share of the curvature; below the first a step is Gauss and Newton's."""
FLAT = 1e-12
"""Curvature of an unknown that no residual tells, over that of the one that is told best."""
EVALUATIONS = 200


def least_squares_between(
    model: Callable[[Array], tuple[Array, Array]], start: Array, low: Array, high: Array, settled: float
) -> tuple[Array, float]:
    """The unknowns x, shape (k,), where Σ r² is least near `start`, low ≤ x ≤ high, and that sum.

    `model` gives the residuals r, shape (n,), of about size 1, and ∂r/∂x, shape (n, k). It ends where a step promises
    to lower the sum by less than the part `settled` of it, or where a kink lets no step do so.
    """
    x = np.clip(start, low, high)
    residual, slopes = model(x)
    cost, damping, size = float(residual @ residual), FIRST, np.zeros(len(x))
    gradient, curvature, failed = slopes.T @ residual, slopes.T @ slopes, False
    for _ in range(EVALUATIONS):
        size = np.maximum(size, np.diagonal(curvature))
        size = np.maximum(size, FLAT * size.max())
        step = _step(gradient, curvature + np.diag(damping * size), low - x, high - x)
        promised = -float(2 * gradient @ step + step @ curvature @ step)
        if promised <= settled * cost + ROUNDING * len(residual) and (failed or damping <= FIRST):
            break
        residual, slopes = model(x + step)
        reached = float(residual @ residual)
        failed = not reached < cost
        if failed:
            damping *= 4
            continue
        kept = (cost - reached) / promised
        x, cost = x + step, reached
        gradient, curvature = slopes.T @ residual, slopes.T @ slopes
        damping = max(LEAST, damping * max(1 / 8, min(2.0, 1 - (2 * kept - 1) ** 3)))
    return np.clip(x, low, high), cost


def _step(gradient: Array, curvature: Array, low: Array, high: Array) -> Array:
    """The least of gradient'd + d'curvature d/2 for low ≤ d ≤ high; an unknown that leaves is held at its end."""
    step, alone = np.zeros(len(gradient)), np.eye(len(gradient))
    free = ~(((low >= 0) & (gradient > 0)) | ((high <= 0) & (gradient < 0)))
    while free.any():
        rest = gradient + curvature @ np.where(free, 0.0, step)
        step = np.linalg.solve(np.where(free[:, np.newaxis] & free, curvature, alone), np.where(free, -rest, step))
        outside = (step < low) | (step > high)
        if not outside.any():
            break
        step = np.clip(step, low, high)
        free &= ~outside
    return step
