"""The friction curve of one level, Eq. (3), fitted in (T_s, ln τ1, ln τ2)."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eaid.arrays import Array
from eaid.estimate.basis import RECORDS, RECORDS_FREE
from eaid.estimate.data import Data
from eaid.estimate.points import Points, by_log, level_normal, log_curvature, log_products, weighted_shares
from eaid.estimate.solver import (
    ROUNDING,
    SETTLED,
    TINY,
    Descent,
    Problem,
    descend,
    judged,
    last_step,
    minimised,
    solved,
)
from eaid.estimate.starts import SHARES, Indices, bowls, table_of
from eaid.models.parameters import TAU_FLOOR_S
from eaid.results.common import Solver
from eaid.results.fit import FrictionLevel

GRID = 48
"""Time constants on the starting grid."""
BOWLS = 3
"""Minima over the grid that a level starts from, at most."""
STEPS = 8
"""Damped Newton steps from each start, at most."""
ENOUGH = 1e-7
"""They end where another predicts less than this part of the cost on the points."""


@dataclass(frozen=True, eq=False)
class Starts:
    """Curves that single levels may start from, N in all."""

    end: Descent
    """In (T_s, ln τ1, ln τ2)."""
    share: float
    """C of all."""
    level: Indices
    """Index of the level of each, (N,), rising."""

    @property
    def theta(self) -> Array:
        """(T_s, τ1, τ2, C) of each, (4, N)."""
        return theta_at(self.end.x, self.share)


def starting_curves(data: Data, share: float) -> Starts:
    """Every level from its best minima over a table of pairs of τ, then a few damped Newton steps."""
    points = data.points
    table = table_of(points, share, GRID)
    level, first, second = bowls(table.gain, BOWLS)
    if len(level) > len(points.y):
        points = points.rows(level)
    tau = np.maximum(table.grid[[first, second]], 1.01 * TAU_FLOOR_S)
    phi = 1 - share * np.exp(-points.t_s / tau[0, :, None]) - (1 - share) * np.exp(-points.t_s / tau[1, :, None])
    weighed = phi * points.w
    Ts = np.maximum((weighed * points.y).sum(axis=1), 0.0) / np.maximum((weighed * phi).sum(axis=1), 1e-300)
    theta = np.stack([Ts, *tau, np.full(len(level), share)])
    return Starts(refine(theta, points, RECORDS * data.longest_s), share, level)


def refine(theta: Array, points: Points, limit: float) -> Descent:
    """Damped steps in (T_s, ln τ1, ln τ2) on every row of points at once, from θ of shape (4, N) with one C.

    τ stays within 1 ms and `limit` [s]; ln τ moves by 2 at most.
    """
    share = theta[3, 0]
    shares = weighted_shares(theta[3, :1], points)

    def look(x: Array) -> tuple[Array, Array, Array]:
        theta = theta_at(x, share)
        cost, gradient, curvature = by_log(theta, log_products(theta, shares, points))
        return cost, gradient.T, curvature

    return descend(look, np.stack([theta[0], *np.log(theta[1:3])], axis=1), STEPS, ENOUGH, within(limit))


def theta_at(x: Array, share: Array | float) -> Array:
    """θ (4, N) at x = (T_s, ln τ1, ln τ2), (N, 3)."""
    theta = np.empty((4, len(x)))
    theta[0], theta[3] = x[:, 0], share
    np.exp(x[:, 1:].T, out=theta[1:3])
    return theta


def tau_limits(limit: float) -> tuple[Array, Array, tuple[str, ...]]:
    """A, b and the codes of A x ≥ b for x = (ln τ1, ln τ2): τ1 ≥ 1 ms, τ2 ≥ τ1, τ2 ≤ `limit` [s]."""
    A = np.array([[1.0, 0.0], [-1.0, 1.0], [0.0, -1.0]])
    return A, np.array([np.log(TAU_FLOOR_S), 0.0, -np.log(limit)]), ("tau1-floor", "tau2-meets-tau1", "tau2-endless")


def within(limit: float) -> Callable[[Array, Array], Array]:
    """x less a step in (T_s, ln τ1, ln τ2), (N, 3); T_s stays above 0, τ within 1 ms and `limit` [s], τ2 above τ1."""
    least, most = np.log(TAU_FLOOR_S), np.log(limit)

    def moved(x: Array, step: Array) -> Array:
        tried = x - step
        tried[:, 0] = np.maximum(tried[:, 0], 0.0)
        away = np.minimum(np.maximum(step[:, 1:], -2.0), 2.0)
        tried[:, 1:] = np.minimum(np.maximum(x[:, 1:] - away, least), most)
        tried[:, 2] = np.maximum(tried[:, 2], tried[:, 1])
        return tried

    return moved


LEAST_LOG, MOST_LOG = np.log(1e-9), np.log(1e12)
CLEAR = 1e-3
"""A start this much above the best, after its steps, is another minimum and no rival."""
TRUST = 2.0
"""It may still come down by this many times what its next step predicts."""
SAME = 1e-6
"""Starts whose costs differ by less than this part have found the same minimum."""


def fit_level(data: Data, share: float | None, starts: Array | None = None) -> FrictionLevel:
    """The least-squares friction curve of one level; C held at `share`, or free where that is None.

    `starts` are θ = (T_s, τ1, τ2, C) to begin from, shape (4, n), instead of our own.
    """
    limit = (RECORDS_FREE if share is None else RECORDS) * data.longest_s
    problem = level_problem(data, share, limit)
    if starts is None:
        shares = SHARES if share is None else (share,)
        starts = np.concatenate([starting_curves(data, c).theta for c in shares], axis=1)
    begin = [_unknowns(theta, limit)[: 4 if share is None else 3] for theta in starts.T]
    end, solver, _ = minimised(problem, begin)
    theta = _theta(end.x, share)
    return _row(float(data.u[0]), [float(value) for value in theta], end.cost, data.samples, solver)


def _row(level: float, theta: Sequence[float], sse: float, samples: int, solver: Solver) -> FrictionLevel:
    Ts, tau1, tau2, share = theta
    rmse = math.sqrt(sse / samples)
    return FrictionLevel(level, Ts, tau1, tau2, share, rmse=rmse, sse=sse, samples=samples, solver=solver)


def level_problem(data: Data, share: float | None, limit: float) -> Problem:
    """Eq. (3) for one level in x = (T_s, ln τ1, ln τ2), and C last where it is free, on the compressed points."""
    points = data.points
    rows, least, names = tau_limits(limit)
    A = np.block([[np.eye(1, 3)], [np.zeros((len(rows), 1)), rows]])
    b, names = np.append(0.0, least), ("Ts-zero", *names)
    floor = ROUNDING * data.energy
    if share is None:

        def free(x: Array) -> tuple[float, Array, Array]:
            theta = _theta(x, None)[:, None]
            cost, gradient, curvature = level_normal(theta, points)
            scale = np.array([1.0, theta[1, 0], theta[2, 0], 1.0])
            return float(cost[0]), gradient[:, 0] * scale, curvature[0] * np.outer(scale, scale)

        last = np.zeros((2, 4))
        last[:, 3] = 1.0, -1.0
        A, b = np.concatenate([np.pad(A, ((0, 0), (0, 1))), last]), np.append(b, [0.0, -1.0])
        return Problem(free, A, b, (*names, "C-zero", "C-one").__getitem__, None, floor)
    shares, held = weighted_shares(np.array([share]), points), share

    def normal(x: Array) -> tuple[float, Array, Array]:
        theta = _theta(x, held)[:, None]
        cost, gradient, curvature = by_log(theta, log_products(theta, shares, points))
        return float(cost[0]), gradient[:, 0], curvature[0]

    def exact(x: Array) -> Array:
        return np.asarray(log_curvature(_theta(x, held)[:, None], shares, points)[1][0])

    return Problem(normal, A, b, names.__getitem__, exact, floor)


def _unknowns(theta: Array, limit: float) -> Array:
    tau1 = min(max(theta[1], TAU_FLOOR_S), limit)
    return np.array([max(theta[0], 0.0), np.log(tau1), np.log(min(max(theta[2], tau1), limit)), theta[3]])


def _theta(x: Array, share: float | None) -> Array:
    tau1, tau2 = np.exp(np.clip(x[1:3], LEAST_LOG, MOST_LOG))  # SLSQP may look far outside before it comes back
    return np.array([x[0], tau1, tau2, np.clip(x[3], 0.0, 1.0) if share is None else share])


def fit_levels(data: Data, share: float | None) -> list[FrictionLevel]:
    """`fit_level` for every level; the starts of all are found, and judged, together.

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
        solver = judged(decrease, len(ends) * STEPS, ends)
        found.append(_row(float(data.u[i]), row, sse, len(data.records[i].y), solver))
    return found


def _last_step(x: Array, share: float, data: Data) -> tuple[Array, Array, Array]:
    """θ two Newton steps on from x, (4, L), its cost, (L,), and what the last step predicts.

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
    cost, gradient, _ = level_normal(theta, data.points)
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
