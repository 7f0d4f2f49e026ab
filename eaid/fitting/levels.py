"""The friction curve of one level, Eq. (3), fitted in (T_s, ln τ1, ln τ2); with C free see `free_share`."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from eaid.arrays import Array
from eaid.fitting.data import Data
from eaid.fitting.descent import last_step, solved
from eaid.fitting.free_share import every_sample, free_problem, free_starts
from eaid.fitting.kernel import by_log, log_curvature, log_products, weighted_shares
from eaid.fitting.problem import ROUNDING, TINY, Problem
from eaid.fitting.solver import SETTLED
from eaid.fitting.starts import RECORDS, STEPS, starting_curves, tau_limits, theta_at, within
from eaid.fitting.verdict import judged, minimised
from eaid.models.parameters import TAU_FLOOR_S
from eaid.results.common import Solver
from eaid.results.friction import FrictionLevel

RECORDS_FREE = 100.0
"""τ2 is looked for up to this many record lengths where C is free: T_s then grows with τ2, all but straight."""
LEAST_LOG, MOST_LOG = np.log(1e-9), np.log(1e12)
CLEAR = 1e-3
"""A start this much above the best, after its steps, is another minimum and no rival."""
TRUST = 2.0
"""It may still come down by this many times what its next step predicts."""
SAME = 1e-6
"""Starts whose costs differ by less than this part have found the same minimum."""
SHARES = (0.3, 0.5, 0.7, 0.85, 0.95)
"""Where a free C starts from."""


def fit_level(data: Data, share: float | None, starts: Array | None = None) -> FrictionLevel:
    """The least-squares friction curve of one level; C held at `share`, or free where that is None.

    `starts` are θ = (T_s, τ1, τ2, C) to begin from, shape (4, n), instead of our own.
    """
    if share is None:
        limit = RECORDS_FREE * data.longest_s
        problem = free_problem(data, limit)
        begin = free_starts(data) if starts is None else [np.log(np.clip(x, TAU_FLOOR_S, limit)) for x in starts[1:3].T]
        end, solver, _ = minimised(problem, begin, lambda x: every_sample(x, data)[:2])
        fast, slow = every_sample(end.x, data)[3]
        theta = np.array([fast + slow, *np.exp(end.x), fast / (fast + slow) if fast + slow > 0 else 1.0])
    else:
        limit = RECORDS * data.longest_s
        problem = level_problem(data, share, limit)
        starts = starting_curves(data, share).theta if starts is None else starts
        begin = [_unknowns(theta, limit) for theta in starts.T]
        end, solver, _ = minimised(problem, begin, lambda x: _full(x, data, share))
        theta = _theta(end.x, share)
    return _row(float(data.u[0]), [float(value) for value in theta], end.cost, data.samples, solver)


def _row(level: float, theta: Sequence[float], sse: float, samples: int, solver: Solver) -> FrictionLevel:
    Ts, tau1, tau2, share = theta
    rmse = math.sqrt(sse / samples)
    return FrictionLevel(level, Ts, tau1, tau2, share, rmse=rmse, sse=sse, samples=samples, solver=solver)


def level_problem(data: Data, share: float, limit: float) -> Problem:
    """Eq. (3) for one level in x = (T_s, ln τ1, ln τ2) on the compressed points."""
    points = data.points
    shares = weighted_shares(np.array([share]), points)

    def normal(x: Array) -> tuple[float, Array, Array]:
        theta = _theta(x, share)[:, None]
        cost, gradient, curvature = by_log(theta, log_products(theta, shares, points))
        return float(cost[0]), gradient[:, 0], curvature[0]

    def exact(x: Array) -> Array:
        return np.asarray(log_curvature(_theta(x, share)[:, None], shares, points)[1][0])

    rows, least, names = tau_limits(limit)
    A = np.block([[np.eye(1, 3)], [np.zeros((len(rows), 1)), rows]])
    b, names = np.append(0.0, least), ("Ts-zero", *names)
    return Problem(normal, A, b, names.__getitem__, exact, ROUNDING * data.energy)


def _unknowns(theta: Array, limit: float) -> Array:
    tau1 = min(max(theta[1], TAU_FLOOR_S), limit)
    return np.array([max(theta[0], 0.0), np.log(tau1), np.log(min(max(theta[2], tau1), limit))])


def _theta(x: Array, share: float) -> Array:
    tau1, tau2 = np.exp(np.clip(x[1:3], LEAST_LOG, MOST_LOG))  # SLSQP may look far outside before it comes back
    return np.array([x[0], tau1, tau2, share])


def _full(x: Array, data: Data, share: float) -> tuple[float, Array]:
    theta = _theta(x, share)
    cost, gradient = data.sums(theta[:, None])
    return float(cost[0]), gradient[:3, 0] * np.array([1.0, *theta[1:3]])


def fit_levels(data: Data, share: float | None) -> list[FrictionLevel]:
    """`fit_level` for every level; the starts of all are found, and judged on the full data, together.

    Where the best start of a level is at its minimum already and no other comes near it, the solver has nothing to add.
    """
    if share is None:
        return [fit_level(data.one(i), None) for i in range(len(data.u))]
    starts = starting_curves(data, share)
    order = np.lexsort((starts.end.cost, starts.level))  # by level, and within a level the lowest first
    bounds = [*np.searchsorted(starts.level, np.arange(len(data.u))).tolist(), len(order)]
    theta, full, decreases = _last_step(starts.end.x[order[bounds[:-1]]], share, data)
    costs, least = starts.end.cost[order].tolist(), (starts.end.cost - TRUST * starts.end.predicted)[order].tolist()
    found = []
    for i, (decrease, sse, row) in enumerate(zip(decreases.tolist(), full.tolist(), theta.T.tolist(), strict=True)):
        ends = costs[bounds[i] : bounds[i + 1]]
        others = zip(ends, least[bounds[i] : bounds[i + 1]], strict=True)
        rival = any(end > (1 + SAME) * ends[0] and low < (1 + CLEAR) * ends[0] for end, low in others)
        if decrease > SETTLED or rival:
            found.append(fit_level(data.one(i), share, starts.theta[:, order[bounds[i] : bounds[i + 1]]]))
            continue
        solver = judged(decrease, len(ends) * STEPS, [end + (sse - ends[0]) for end in ends])
        found.append(_row(float(data.u[i]), row, sse, len(data.records[i].y), solver))
    return found


def _last_step(x: Array, share: float, data: Data) -> tuple[Array, Array, Array]:
    """θ two Newton steps on from x, (4, L), its cost over every sample, (L,), and what the last step predicts.

    That is relative to the cost, (L,), which it is too small to show; infinite at a limit or off a bowl, where no steps
    are taken either.
    """
    limit = RECORDS * data.longest_s
    theta = theta_at(x, share)
    slope, H = log_curvature(theta, weighted_shares(theta[3, :1], data.points), data.points)
    bowl = (theta[0] > 0) & _definite(H)
    H[~bowl] = np.eye(3)
    slope[~bowl] = 0.0
    x = within(limit)(x, solved(H, slope))
    theta = theta_at(x, share)
    cost, gradient = data.sums(theta)
    Ts, tau1, tau2, _ = theta
    bowl &= (tau1 > 1.001 * TAU_FLOOR_S) & (1.001 * tau1 < tau2) & (tau2 < 0.5 * limit) & (Ts > 0) & (cost > 0)
    slope = gradient[:3].T.copy()
    slope[:, 1:] *= theta[1:3].T
    step, predicted = last_step(cost, slope, H, bowl)
    return theta_at(within(limit)(x, step), share), cost, predicted


def _definite(H: Array) -> NDArray[np.bool_]:
    """Which of some symmetric matrices, (L, n, n), are positive definite in any units, (L,)."""
    scale = np.sqrt(np.maximum(np.einsum("lii->li", H), TINY))
    H = H / (scale[:, :, None] * scale[:, None, :])
    try:
        np.linalg.cholesky(H)
    except np.linalg.LinAlgError:
        return np.asarray(np.linalg.eigvalsh(H)[:, 0] > 0)
    return np.ones(len(H), dtype=bool)
