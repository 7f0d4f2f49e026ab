"""The linear model, Eq. (8), pooled over all levels and for each level; B = 1/b0 under three conventions, SPEC §4.3.

Its step response is the friction curve with C = 1, τ1 = 1/a0 and T_s = (b0 u + c0)/a0, so the same sums serve.
The cost is linear in the gains for a given a0: the start is a search over a0 alone.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from eaid.arrays import Array
from eaid.fitting.data import Data
from eaid.fitting.kernel import decay, level_curvature, level_normal, level_sums
from eaid.fitting.levels import verdict
from eaid.fitting.result import Bounds, LinearLevel, Solver
from eaid.fitting.solver import PROMISE, ROUNDING, EndPoint, Problem, polish, slsqp
from eaid.models.parameters import Linear

A0_GRID = 40


@dataclass(frozen=True, eq=False)
class FirstOrder:
    """One time constant for all curves, and gains that are linear in the input: x = (ln τ, gain coefficients)."""

    tau: float
    gains: Array
    """Steady output of each level, shape (L,)."""
    coefficients: Array
    """Of the columns of the design."""
    cost: float
    solver: Solver


def fit_first_order(data: Data, design: Array) -> FirstOrder:
    """Least squares of gain_l (1 − e^(−t/τ)), gain = design @ coefficients, design of shape (L, k)."""
    points, weights = data.points, data.weights
    shortest = min(float(r.t_s[r.t_s > 0].min()) for r in data.records)
    low, high = 0.01 * shortest, 1e3 * data.longest_s

    def theta(x: Array) -> Array:
        one = np.ones(len(data.u))
        return np.stack([design @ x[1:], np.exp(x[0]) * one, one, one])

    def chain(gradient: Array, x: Array) -> Array:
        g = gradient * weights
        return np.concatenate([[np.exp(x[0]) * g[1].sum()], g[0] @ design])

    def value(x: Array) -> tuple[float, Array]:
        cost, gradient = level_sums(theta(x), points)
        return float(weights @ cost), chain(gradient, x)

    def second(x: Array, exact: bool) -> Array:
        own = level_curvature(theta(x), points) if exact else level_normal(theta(x), points)[2]
        H = own[:, :2, :2] * weights[:, None, None]
        tau = np.exp(x[0])
        cross = tau * (H[:, 0, 1] @ design)
        corner = tau**2 * H[:, 1, 1].sum()
        if exact:
            corner += tau * float(weights @ level_sums(theta(x), points)[1][1])
        return np.block([[np.array([[corner]]), cross[None]], [cross[:, None], design.T @ (H[:, 0, 0, None] * design)]])

    def full(x: Array) -> tuple[float, Array]:
        cost, gradient = data.sums(theta(x))
        return float(weights @ cost), chain(gradient, x)

    A = np.zeros((2, 1 + design.shape[1]))
    A[0, 0], A[1, 0] = 1.0, -1.0
    problem = Problem(
        value,
        lambda x: second(x, False),
        A,
        np.array([np.log(low), -np.log(high)]),
        (f"1/a0 at {low:g} s", f"1/a0 at {high:g} s (1000 record lengths)").__getitem__,
        lambda x: second(x, True),
        ROUNDING * data.energy,
    )
    starts = _best_of_grid(data, design, np.geomspace(max(0.3 * shortest, 2 * low), 3 * data.longest_s, A0_GRID))
    ends = [slsqp(problem, start) for start in starts]
    best = min(ends, key=lambda end: end.cost)
    end, promise, active = polish(problem, best, full)
    converged = promise <= PROMISE
    return FirstOrder(
        float(np.exp(end.x[0])),
        design @ end.x[1:],
        end.x[1:],
        end.cost,
        Solver(
            converged,
            verdict(converged, promise),
            sum(e.evaluations for e in ends) + end.evaluations - best.evaluations,
            tuple(e.cost + end.cost - best.cost for e in ends),
            tuple(problem.names(i) for i in active),
            promise,
        ),
    )


def _best_of_grid(data: Data, design: Array, grid: Array, most: int = 3) -> list[Array]:
    """Starts at the local minima over τ of the cost with the gains solved for, the best first."""
    points, weights = data.points, data.weights
    rise = -np.expm1(-points.t_s[:, None, :] / grid[:, None])  # (L or 1, K, P)
    weighted = rise * points.w[:, None, :]
    square = np.broadcast_to((weighted * rise).sum(axis=2), (len(data.u), len(grid))) * weights[:, None]
    along = (weighted @ points.y[:, :, None])[:, :, 0] * weights[:, None]
    solved = []
    for k in range(len(grid)):
        normal = design.T @ (square[:, k, None] * design)
        right = design.T @ along[:, k]
        gain = np.linalg.lstsq(normal, right, rcond=None)[0]
        solved.append((-float(right @ gain), gain))
    costs = np.array([cost for cost, _ in solved])
    inside = np.concatenate([[np.inf], costs, [np.inf]])
    minima = np.flatnonzero((inside[1:-1] <= inside[:-2]) & (inside[1:-1] <= inside[2:]))
    order = minima[np.argsort(costs[minima])][:most]
    return [np.concatenate([[np.log(grid[k])], solved[k][1]]) for k in order]


@dataclass(frozen=True, eq=False)
class LinearSolution:
    """The pooled fit of Eq. (8)."""

    parameters: Linear
    cost: float
    solver: Solver


def fit_linear(data: Data) -> LinearSolution:
    """Eq. (8) fitted to all levels at once; with a single level c0 is 0, for one step cannot tell it from b0."""
    half = 0.5 * float(np.ptp(data.u))
    middle = 0.5 * float(data.u.max() + data.u.min())
    if half > 0:
        found = fit_first_order(data, np.stack([np.ones_like(data.u), (data.u - middle) / half], axis=1))
        slope = found.coefficients[1] / half
        offset = found.coefficients[0] - slope * middle
    else:
        found = fit_first_order(data, data.u[:, None] / middle)
        slope, offset = found.coefficients[0] / middle, 0.0
    a0 = 1.0 / found.tau
    return LinearSolution(Linear(a0, float(a0 * slope), float(a0 * offset)), found.cost, found.solver)


def linear_residuals(p: Linear, data: Data) -> list[Array]:
    """f − y at every sample of every level, shapes (n_l,)."""
    return [
        (p.b0 * u + p.c0) / p.a0 * (1 - decay(r, 1 / p.a0)) - r.y for u, r in zip(data.u, data.records, strict=True)
    ]


def fit_own_levels(data: Data) -> list[FirstOrder]:
    """a0 and gain of each level on its own."""
    return [fit_first_order(data.one(i), np.ones((1, 1))) for i in range(len(data.u))]


def by_convention(data: Data, own: Sequence[FirstOrder], pooled: Linear, convention: str) -> list[LinearLevel]:
    """b0, c0 and B of each level under one convention, SPEC §4.3."""
    rows = []
    for i, (u, record) in enumerate(zip(data.u, data.records, strict=True)):
        fit = own[i]
        a0, gain, sse, solver = 1 / fit.tau, float(fit.gains[0]), fit.cost, fit.solver
        c0 = 0.0 if convention == "zero-offset" else pooled.c0
        if convention == "pooled-dynamics":
            a0 = pooled.a0
            rise = 1 - decay(record, 1 / a0)
            gain = float(rise @ record.y / (rise @ rise))
            left = record.y - gain * rise
            sse = float(left @ left)
            solver = Solver(True, "converged: a linear solve", 1, (sse,), (), 0.0)
        b0 = (a0 * gain - c0) / float(u) if u else 0.0
        B = 1 / b0 if b0 > 0 else None
        rows.append(LinearLevel(float(u), a0, gain, b0, c0, B, float(np.sqrt(sse / len(record.y))), sse, solver))
    return rows


def bounds_of(rows: Sequence[LinearLevel], convention: str, kept: Sequence[float] | None) -> Bounds:
    """Least and largest B over the kept levels (all where `kept` is None); levels without a positive b0 have none."""
    chosen = [row for row in rows if kept is None or row.level in kept]
    known = [row.B for row in chosen if row.B is not None]
    return Bounds(convention, tuple(row.level for row in chosen), min(known, default=None), max(known, default=None))


def as_end(solution: LinearSolution) -> EndPoint:
    """The pooled end point in (a0, b0, c0)."""
    p = solution.parameters
    return EndPoint(np.array([p.a0, p.b0, p.c0]), solution.cost, solution.solver.evaluations)
