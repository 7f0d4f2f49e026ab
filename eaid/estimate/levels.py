"""The friction curve of one level, Eq. (3), fitted in (T_s, ln τ1, ln τ2)."""

import math

import numpy as np

from eaid.arrays import Array
from eaid.estimate.basis import RECORDS, RECORDS_FREE
from eaid.estimate.data import Data
from eaid.estimate.points import by_log, level_normal, log_curvature, log_products, weighted_shares
from eaid.estimate.solver import ROUNDING, Problem, minimised
from eaid.estimate.starts import SHARES, Indices, bowls, sizes, table_of
from eaid.models.parameters import TAU_FLOOR_S
from eaid.results.fit import FrictionLevel

GRID = 48
"""Time constants on the starting grid."""
BOWLS = 3
"""Minima over the grid that a level starts from, at most."""


def starting_curves(data: Data, share: float) -> tuple[Indices, Array]:
    """Level, (N,), and (T_s, τ1, τ2, C), (4, N), of each level's best minima over a table of pairs of τ."""
    points = data.points
    table = table_of(points, share, GRID)
    level, first, second = bowls(table.gain, BOWLS)
    tau1, tau2 = np.maximum(table.grid[[first, second]], 1.01 * TAU_FLOOR_S)
    Ts = np.maximum(sizes(points.rows(level), tau1, tau2, share)[0], 0.0)
    return level, np.stack([Ts, tau1, tau2, np.full(len(level), share)])


def tau_limits(limit: float) -> tuple[Array, Array, tuple[str, ...]]:
    """A, b and the codes of A x ≥ b for x = (ln τ1, ln τ2): τ1 ≥ 1 ms, τ2 ≥ τ1, τ2 ≤ `limit` [s]."""
    A = np.array([[1.0, 0.0], [-1.0, 1.0], [0.0, -1.0]])
    return A, np.array([np.log(TAU_FLOOR_S), 0.0, -np.log(limit)]), ("tau1-floor", "tau2-meets-tau1", "tau2-endless")


LEAST_LOG, MOST_LOG = np.log(1e-9), np.log(1e12)


def fit_level(data: Data, share: float | None, starts: Array | None = None) -> FrictionLevel:
    """The least-squares friction curve of one level; C held at `share`, or free where that is None.

    `starts` are θ = (T_s, τ1, τ2, C) to begin from, shape (4, n), instead of our own.
    """
    limit = (RECORDS_FREE if share is None else RECORDS) * data.longest_s
    problem = level_problem(data, share, limit)
    if starts is None:
        shares = SHARES if share is None else (share,)
        starts = np.concatenate([starting_curves(data, c)[1] for c in shares], axis=1)
    begin = [_unknowns(theta, limit)[: 4 if share is None else 3] for theta in starts.T]
    end, solver, _ = minimised(problem, begin)
    Ts, tau1, tau2, C = _theta(end.x, share).tolist()
    rmse, n = math.sqrt(end.cost / data.samples), data.samples
    return FrictionLevel(float(data.u[0]), Ts, tau1, tau2, C, rmse=rmse, sse=end.cost, samples=n, solver=solver)


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

        def bent(x: Array) -> Array:  # second derivatives, from the exact gradient
            steps = 1e-5 * np.diag([max(abs(x[0]), 1e-300), 1.0, 1.0, 1.0])
            rows = [(free(x + h)[1] - free(x - h)[1]) / (2 * h.sum()) for h in steps]
            return np.asarray(0.5 * (np.array(rows) + np.array(rows).T))

        last = np.zeros((2, 4))
        last[:, 3] = 1.0, -1.0
        A, b = np.concatenate([np.pad(A, ((0, 0), (0, 1))), last]), np.append(b, [0.0, -1.0])
        return Problem(free, A, b, (*names, "C-zero", "C-one").__getitem__, bent, floor)
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
    """`fit_level` for every level; the starts of all are found together."""
    if share is None:
        return [fit_level(data.one(i), None) for i in range(len(data.u))]
    level, starts = starting_curves(data, share)
    return [fit_level(data.one(i), share, starts[:, level == i]) for i in range(len(data.u))]
