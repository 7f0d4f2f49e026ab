"""The friction curve of one level with C free: both amplitudes are solved for, SLSQP sees ln τ1 and ln τ2 alone.

T(t) = A1 (1 − e^(−t/τ1)) + A2 (1 − e^(−t/τ2)) with A1, A2 ≥ 0; T_s = A1 + A2 and C = A1/T_s. Where a record is too
short to tell the slow part, C, T_s and τ2 lie in a long valley: in these two unknowns it is a short one.
"""

import numpy as np

from eaid.arrays import Array
from eaid.fitting.compress import Points
from eaid.fitting.data import Data
from eaid.fitting.problem import ROUNDING, Problem
from eaid.fitting.starts import start_grid, tau_limits

GRID = 24
"""Time constants on the starting grid."""
BANDS = ((1, 4), (4, 7), (7, GRID))
"""How many grid steps the starting τ1 and τ2 lie apart, one start each; at none apart they would stay together."""
CLOSE = 1e-9
"""Part of the product of two squared lengths below which two curves are one."""


def free_problem(data: Data, limit: float) -> Problem:
    """Eq. (3) for one level in x = (ln τ1, ln τ2) on the compressed points."""
    A, b, names = tau_limits(limit)
    floor = ROUNDING * data.energy
    return Problem(lambda x: projected(x, data.points)[:3], A, b, names.__getitem__, floor=floor)


def every_sample(x: Array, data: Data) -> tuple[float, Array, Array, Array]:
    """`projected` of every sample of one level."""
    record = data.records[0]
    return projected(x, Points(record.t_s[None], record.y[None], np.ones((1, len(record.y)))))


def free_starts(data: Data) -> list[Array]:
    """(ln τ1, ln τ2) of least cost on a log grid, one for each of `BANDS` that a short record leaves room for."""
    points = data.points
    grid = start_grid(points.t_s[points.w > 0], GRID)
    found = []
    for a, b in BANDS:
        pairs = [np.log([grid[i], grid[j]]) for i in range(len(grid)) for j in range(i + a, min(i + b, len(grid)))]
        if pairs:
            found.append(min(pairs, key=lambda x: projected(x, points)[0]))
    return found


def projected(x: Array, points: Points) -> tuple[float, Array, Array, Array]:
    """Cost with A1, A2 ≥ 0 solved for, its gradient by (ln τ1, ln τ2), Gauss–Newton curvature, and (A1, A2)."""
    tau = np.exp(np.clip(x, -15.0, 30.0))[:, None]  # SLSQP may look far outside before it comes back
    t, y, w = points.t_s[0], points.y[0], points.w[0]
    e = np.exp(-t / tau)
    shapes = -np.expm1(-t / tau)
    gram, along = (shapes * w) @ shapes.T, (shapes * w) @ y
    amplitudes = non_negative(gram, along)
    r = amplitudes @ shapes - y
    slopes = -amplitudes[:, None] * e * t / tau
    gradient = 2 * slopes @ (w * r)
    used = shapes[amplitudes > 0]
    inside = slopes
    if len(used):
        inner = (used * w) @ used.T
        inside = slopes - np.linalg.lstsq(inner, (used * w) @ slopes.T, rcond=1e-12)[0].T @ used
    return float(w @ (r * r)), gradient, 2 * (inside * w) @ inside.T, amplitudes


def non_negative(gram: Array, along: Array) -> Array:
    """The two amplitudes ≥ 0 of least squares, from G (2, 2) and Φ'y (2,)."""
    determinant = gram[0, 0] * gram[1, 1] - gram[0, 1] ** 2
    if determinant > CLOSE * gram[0, 0] * gram[1, 1]:
        both = np.array([gram[1, 1] * along[0] - gram[0, 1] * along[1], gram[0, 0] * along[1] - gram[0, 1] * along[0]])
        if both.min() >= 0:
            return np.asarray(both / determinant)
    alone = np.maximum(along, 0.0) / np.diagonal(gram)
    best = int(np.argmax(alone * along))
    return np.where(np.arange(2) == best, alone, 0.0)
