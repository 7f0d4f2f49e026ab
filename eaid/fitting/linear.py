"""The linear model, Eq. (8), pooled and for each level; B = 1/b0 under three conventions, specification 4.3.

Its step response is the friction curve with C = 1, τ1 = 1/a0 and T_s = (b0 u + c0)/a0, so the same sums serve.
The cost is linear in the gains for a given a0: the start is a search over a0 alone.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eaid.arrays import Array
from eaid.fitting.compress import Points
from eaid.fitting.data import Data
from eaid.fitting.kernel import decay, level_curvature, level_normal, level_sums
from eaid.fitting.levels import LEAST_LOG, MOST_LOG
from eaid.fitting.metrics import quality
from eaid.fitting.options import CONVENTIONS
from eaid.fitting.problem import ROUNDING, Problem
from eaid.fitting.solver import SETTLED, approach, concluded, ended, judged
from eaid.models.parameters import Linear
from eaid.results.common import Solver
from eaid.results.fit import Bounds, LinearLevel

A0_GRID = 40
CLOSE = 1e-9
"""Determinant of a curvature, over the product of its diagonal, below which gain and τ are one."""


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
    low, high, first = _limits(data)

    def tau_of(x: Array) -> float:
        return float(np.exp(np.clip(x[0], LEAST_LOG, MOST_LOG)))  # SLSQP may look far outside before it comes back

    def theta(x: Array) -> Array:
        one = np.ones(len(data.u))
        return np.stack([design @ x[1:], tau_of(x) * one, one, one])

    def chain(gradient: Array, x: Array) -> Array:
        g = gradient * weights
        return np.concatenate([[tau_of(x) * g[1].sum()], g[0] @ design])

    def value(x: Array) -> tuple[float, Array]:
        cost, gradient = level_sums(theta(x), points)
        return float(weights @ cost), chain(gradient, x)

    def chained(own: Array, x: Array, bent: float = 0.0) -> Array:
        H = own[:, :2, :2] * weights[:, None, None]
        tau = tau_of(x)
        chained = np.empty((len(x), len(x)))
        chained[0, 0] = tau**2 * H[:, 1, 1].sum() + tau * bent  # d²/d(ln τ)² = τ² d²/dτ² + τ d/dτ
        chained[0, 1:] = chained[1:, 0] = tau * (H[:, 0, 1] @ design)
        chained[1:, 1:] = design.T @ (H[:, 0, 0, None] * design)
        return chained

    def together(x: Array) -> tuple[float, Array, Array]:
        cost, gradient, curvature = level_normal(theta(x), points)
        return float(weights @ cost), chain(gradient, x), chained(curvature, x)

    def exact(x: Array) -> Array:
        bent = float(weights @ level_sums(theta(x), points)[1][1])
        return chained(level_curvature(theta(x), points), x, bent)

    def full(x: Array) -> tuple[float, Array]:
        cost, gradient = data.sums(theta(x))
        return float(weights @ cost), chain(gradient, x)

    A = np.zeros((2, 1 + design.shape[1]))
    A[0, 0], A[1, 0] = 1.0, -1.0
    problem = Problem(
        value,
        lambda x: together(x)[2],
        A,
        np.array([np.log(low), -np.log(high)]),
        ("a0-fastest", "a0-slowest").__getitem__,
        exact,
        together,
        floor=ROUNDING * data.energy,
    )
    starts = _best_of_grid(data, design, np.geomspace(first, 3 * data.longest_s, A0_GRID))
    ends = ended([approach(problem, start) for start in starts], problem)
    end, solver, _ = concluded(problem, ends, full)
    return FirstOrder(float(np.exp(end.x[0])), design @ end.x[1:], end.x[1:], end.cost, solver)


def _limits(data: Data) -> tuple[float, float, float]:
    """Least and greatest τ that are looked for, and the least on the grid of starts [s]."""
    shortest = min(float(r.t_s[r.t_s > 0].min()) for r in data.records)
    return 0.01 * shortest, 1e3 * data.longest_s, 0.3 * shortest


def _best_of_grid(data: Data, design: Array, grid: Array, most: int = 3) -> list[Array]:
    """Starts at the local minima over τ of the cost with the gains solved for, the best first."""
    square, along = _by_tau(data, grid)
    normal = design.T @ ((data.weights[:, None] * square).T[:, :, None] * design)  # (K, k, k)
    right = (data.weights[:, None] * along).T @ design
    ridge = 1e-14 * np.trace(normal, axis1=1, axis2=2)[:, None, None] * np.eye(design.shape[1])
    gains = np.linalg.solve(normal + ridge, right[:, :, None])
    costs = -(right * gains[:, :, 0]).sum(axis=1)
    minima = np.flatnonzero(_is_minimum(costs[None])[0])
    order = minima[np.argsort(costs[minima])][:most]
    return [np.concatenate([[np.log(grid[k])], gains[k, :, 0]]) for k in order]


def _by_tau(data: Data, grid: Array) -> tuple[Array, Array]:
    """φ'φ and φ'y of every level for φ = 1 − e^(−t/τ), shapes (L, K)."""
    points = data.points
    rise = -np.expm1(-points.t_s[:, None, :] / grid[:, None])  # (L or 1, K, P)
    weighted = rise * points.w[:, None, :]
    square = np.broadcast_to((weighted * rise).sum(axis=2), (len(data.u), len(grid)))
    return square, (weighted @ points.y[:, :, None])[:, :, 0]


def _is_minimum(costs: Array) -> NDArray[np.bool_]:
    """Where a row has a value that no neighbour undercuts, (N, K)."""
    inside = np.pad(costs, ((0, 0), (1, 1)), constant_values=np.inf)
    return (costs <= inside[:, :-2]) & (costs <= inside[:, 2:])


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
    """a0 and gain of each level on its own: all together, and judged on the full data together.

    A level that has several minima over τ, or has not settled, is fitted alone.
    """
    low, high, first = _limits(data)
    grid = np.geomspace(first, 3 * data.longest_s, A0_GRID)
    square, along = _by_tau(data, grid)
    costs = -(along**2) / square
    best = costs.argmin(axis=1)
    every, one = np.arange(len(best)), np.ones(len(best))
    start = np.stack([along[every, best] / square[every, best], grid[best], one, one])
    theta = _refined(start, data.points, low, high)
    cost, gradient = data.sums(theta)
    H, tau = level_curvature(theta, data.points)[:, :2, :2], theta[1]
    slope = np.stack([gradient[0], gradient[1] * tau], axis=1)
    H *= _by_log(tau)
    H[:, 1, 1] += slope[:, 1]  # d²/d(ln τ)² = τ² d²/dτ² + τ d/dτ
    whole = (_is_minimum(costs).sum(axis=1) == 1) & (tau > 1.001 * low) & (tau < 0.999 * high) & (cost > 0)
    whole &= np.linalg.det(H) > CLOSE * H[:, 0, 0] * np.abs(H[:, 1, 1])
    H[~whole] = np.eye(2)
    step = np.linalg.solve(H, slope[:, :, None])[:, :, 0]
    predicted = np.where(whole, 0.5 * (slope * step).sum(axis=1) / np.where(whole, cost, 1.0), np.inf)
    found = []
    for i, decrease in enumerate(predicted.tolist()):
        if decrease > SETTLED:
            found.append(fit_first_order(data.one(i), np.ones((1, 1))))
            continue
        gain, sse = theta[0, i : i + 1], float(cost[i])
        solver = judged(decrease, A0_GRID, (sse,))
        found.append(FirstOrder(float(tau[i]), gain, gain, sse, solver))
    return found


def _refined(theta: Array, points: Points, low: float, high: float, steps: int = 12) -> Array:
    """Damped Gauss–Newton in (gain, ln τ) at every level, (4, L), until a step gains nothing worth telling."""
    cost, gradient, H = level_normal(theta, points)
    damping = np.full(len(cost), 1e-6)
    for _ in range(steps):
        tau = theta[1]
        normal = H[:, :2, :2] * _by_log(tau) * (1.0 + damping[:, None, None] * np.eye(2))
        slope = np.stack([gradient[0], gradient[1] * tau], axis=1)
        step = np.linalg.solve(normal + 1e-300 * np.eye(2), slope[:, :, None])[:, :, 0]
        tried = theta.copy()
        tried[0] -= step[:, 0]
        tried[1] = np.clip(tau * np.exp(np.clip(-step[:, 1], -2.0, 2.0)), low, high)
        found, slope, bent = level_normal(tried, points)
        better = found < cost
        gained = np.max((cost - found)[better] / cost[better], initial=0.0)
        theta, gradient = np.where(better, tried, theta), np.where(better, slope, gradient)
        cost, H = np.where(better, found, cost), np.where(better[:, None, None], bent, H)
        damping = np.where(better, damping / 10, np.maximum(damping, 1e-6) * 100)
        if gained < 1e-9 and better.any():
            break
    return theta


def _by_log(tau: Array) -> Array:
    """What takes second derivatives by (gain, τ) to those by (gain, ln τ), (L, 2, 2)."""
    scale = np.stack([np.ones_like(tau), tau], axis=1)
    return np.asarray(scale[:, :, None] * scale[:, None, :])


def by_convention(data: Data, own: Sequence[FirstOrder], pooled: Linear, convention: str) -> tuple[LinearLevel, ...]:
    """b0, c0 and B of each level under one convention, specification 4.3."""
    rows = []
    for fit, u, record in zip(own, data.u.tolist(), data.records, strict=True):
        a0, gain, sse, converged = 1 / fit.tau, float(fit.gains[0]), fit.cost, fit.solver.converged
        c0 = 0.0 if convention == "zero-offset" else pooled.c0
        if convention == "pooled-dynamics":
            a0 = pooled.a0
            rise = 1 - decay(record, 1 / a0)
            gain = float(rise @ record.y / (rise @ rise))
            left = record.y - gain * rise
            sse, converged = float(left @ left), True  # a linear solve
        b0 = (a0 * gain - c0) / u if u else 0.0
        B = 1 / b0 if b0 > 0 else None
        fit_pct, R2 = quality(sse, [record.y])
        rmse = float(np.sqrt(sse / len(record.y)))
        rows.append(LinearLevel(u, a0, gain, b0, c0, B, rmse, sse, fit_pct, R2, converged))
    return tuple(rows)


def bounds_of(rows: Sequence[LinearLevel], convention: str, kept: Sequence[float] | None) -> Bounds:
    """Least and largest B over the kept levels (all where `kept` is None); levels without a positive b0 have none."""
    chosen = [row for row in rows if kept is None or row.level in kept]
    known = [row.B for row in chosen if row.B is not None]
    return Bounds(
        convention,
        CONVENTIONS[convention],
        tuple(row.level for row in chosen),
        min(known, default=None),
        max(known, default=None),
    )
