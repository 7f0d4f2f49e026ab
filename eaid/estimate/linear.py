"""The linear model, Eq. (8), pooled and for each level; B = 1/b0, specification 4.3.

Its step response is one exponential with τ = 1/a0 and the gain (b0 u + c0)/a0.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from eaid.arrays import Array
from eaid.estimate import data as metrics
from eaid.estimate.data import Data, linear_findings, missed
from eaid.estimate.huber import huber_findings, minimise
from eaid.estimate.levels import LEAST_LOG, MOST_LOG
from eaid.estimate.points import Points, Record, by_log, decay, log_curvature, log_products, weighted_shares
from eaid.estimate.solver import ROUNDING, Problem, minimised, slsqp
from eaid.findings import Finding
from eaid.models import linear as model
from eaid.models.parameters import Linear as LinearModel
from eaid.options import FitOptions
from eaid.results.common import Huber, Solver
from eaid.results.fit import Bounds, Linear, LinearLevel, Pooled
from eaid.steps.levels import wanted_levels
from eaid.steps.stepset import Level

A0_GRID = 40
"""Time constants on the starting grid."""
MOST = 3
"""Starts from it."""


@dataclass(frozen=True, eq=False)
class FirstOrder:
    """One time constant for all curves, and gains that are linear in the input: x = (ln τ, gain coefficients)."""

    tau: float
    coefficients: Array
    """Of the columns of the design; the gain itself of a single level."""
    cost: float
    solver: Solver


def first_order_problem(data: Data, design: Array) -> Problem:
    """Squares of gain_l (1 − e^(−t/τ)), gain = design @ coefficients, in (ln τ, coefficients), design (L, k)."""
    sums = Sums(data.points)
    low, high, _ = _limits(data)

    def at(x: Array) -> Array:
        """(gain, ln τ) of each level; SLSQP may look far outside before it comes back."""
        return np.stack([design @ x[1:], np.full(len(design), np.clip(x[0], LEAST_LOG, MOST_LOG))], axis=1)

    def chain(gradient: Array) -> Array:
        return np.concatenate([[gradient[:, 1].sum()], gradient[:, 0] @ design])

    def chained(per_level: Array) -> Array:
        cross = per_level[:, 0, 1] @ design
        by_gain = design.T @ (per_level[:, 0, 0, None] * design)
        return np.block([[per_level[:, 1, 1].sum(), cross], [cross[:, None], by_gain]])

    def normal(x: Array) -> tuple[float, Array, Array]:
        cost, gradient, curvature = sums.normal(at(x))
        return float(cost.sum()), chain(gradient), chained(curvature)

    A = np.zeros((2, 1 + design.shape[1]))
    A[:, 0] = 1.0, -1.0
    b, names = np.array([np.log(low), -np.log(high)]), ("a0-fastest", "a0-slowest")
    return Problem(normal, A, b, names.__getitem__, lambda x: chained(sums.exact(at(x))), ROUNDING * data.energy)


def fit_first_order(data: Data, design: Array) -> FirstOrder:
    """Least squares of gain_l (1 − e^(−t/τ)), gain = design @ coefficients, design of shape (L, k)."""
    problem = first_order_problem(data, design)
    starts = _best_of_grid(data, design, np.geomspace(_limits(data)[2], 3 * data.longest_s, A0_GRID))
    end, solver, _ = minimised(problem, starts)
    tau = float(np.exp(end.x[0]))
    gains = (design @ end.x[1:]).tolist()
    left = [first_order_residual(tau, gain, r) for gain, r in zip(gains, data.records, strict=True)]
    return FirstOrder(tau, end.x[1:], sum(float(r @ r) for r in left), solver)


def first_order_residual(tau: float, gain: float, record: Record) -> Array:
    """gain (1 − e^(−t/τ)) − y at every sample."""
    return np.asarray(gain * (1 - decay(record, tau)) - record.y)


@dataclass(frozen=True, eq=False)
class Sums:
    """Sums over the points at (gain, ln τ) of each level, (L, 2)."""

    points: Points

    def normal(self, x: Array) -> tuple[Array, Array, Array]:
        """Cost (L,), gradient (L, 2), Gauss–Newton curvature (L, 2, 2)."""
        theta = _theta(x)
        cost, gradient, curvature = by_log(theta, log_products(theta, self._shares, self.points))
        return cost, gradient[:2].T, curvature[:, :2, :2]

    def exact(self, x: Array) -> Array:
        """Second derivatives, (L, 2, 2)."""
        return log_curvature(_theta(x), self._shares, self.points)[1][:, :2, :2]

    @cached_property
    def _shares(self) -> Array:
        return weighted_shares(np.ones(1), self.points)


def _theta(x: Array) -> Array:
    one = np.ones(len(x))
    return np.stack([x[:, 0], np.exp(x[:, 1]), one, one])


def _limits(data: Data) -> tuple[float, float, float]:
    """Least and greatest τ that are looked for, and the least on the grid of starts [s]."""
    shortest = min(float(r.t_s[r.t_s > 0].min()) for r in data.records)
    return 0.01 * shortest, 1e3 * data.longest_s, 0.3 * shortest


def _best_of_grid(data: Data, design: Array, grid: Array) -> list[Array]:
    """Starts at the local minima over τ of the cost with the gains solved for, the best first."""
    square, along = _by_tau(data, grid)
    normal = design.T @ (square.T[:, :, None] * design)  # (K, k, k)
    right = along.T @ design
    ridge = 1e-14 * np.trace(normal, axis1=1, axis2=2)[:, None, None] * np.eye(design.shape[1])
    gains = np.linalg.solve(normal + ridge, right[:, :, None])
    costs = -(right * gains[:, :, 0]).sum(axis=1)
    minima = np.flatnonzero(_is_minimum(costs[None])[0])
    order = minima[np.argsort(costs[minima])][:MOST]
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


def fit_each_level(data: Data) -> list[FirstOrder]:
    """τ and gain of each level on its own."""
    return [fit_first_order(data.one(i), np.ones((1, 1))) for i in range(len(data.u))]


@dataclass(frozen=True, eq=False)
class LinearSolution:
    """The pooled fit of Eq. (8)."""

    parameters: LinearModel
    cost: float
    solver: Solver


def fit_linear(data: Data) -> LinearSolution:
    """Eq. (8) fitted to all levels at once; with a single level c0 is 0, for one step cannot tell it from b0."""
    found = fit_first_order(data, _design(data.u))
    return LinearSolution(_linear(1.0 / found.tau, found.coefficients, data.u), found.cost, found.solver)


def refit_linear(data: Data, near: LinearModel) -> LinearModel:
    """The minimum next to an earlier one, on points that differ little."""
    design = _design(data.u)
    gains = (near.b0 * data.u + near.c0) / near.a0
    start = np.append(-np.log(near.a0), np.linalg.lstsq(design, gains, rcond=None)[0])
    x = slsqp(first_order_problem(data, design), start).x
    return _linear(float(np.exp(-x[0])), x[1:], data.u)


def _design(u: Array) -> Array:
    """Gains of the levels by their coefficients: at the middle input and up to either end, shape (L, 2)."""
    half, middle = 0.5 * float(np.ptp(u)), 0.5 * float(u.max() + u.min())
    return np.stack([np.ones_like(u), (u - middle) / half], axis=1) if half > 0 else u[:, None] / middle


def _linear(a0: float, coefficients: Array, u: Array) -> LinearModel:
    half, middle = 0.5 * float(np.ptp(u)), 0.5 * float(u.max() + u.min())
    slope = coefficients[-1] / (half or middle)
    offset = coefficients[0] - slope * middle if half > 0 else 0.0
    return LinearModel(a0, float(a0 * slope), float(a0 * offset))


def linear_residuals(solved: LinearSolution, data: Data) -> list[Array]:
    """f − y at every sample of every level, shapes (n_l,)."""
    p = solved.parameters
    rows = zip(data.u.tolist(), data.records, strict=True)
    return [first_order_residual(1 / p.a0, (p.b0 * u + p.c0) / p.a0, record) for u, record in rows]


def single_levels(data: Data) -> tuple[LinearLevel, ...]:
    """a0, gain, b0 and B of each level by itself, c0 = 0, specification 4.3."""
    rows = []
    for fit, u, record in zip(fit_each_level(data), data.u.tolist(), data.records, strict=True):
        a0, gain, sse = 1 / fit.tau, float(fit.coefficients[0]), fit.cost
        b0 = a0 * gain / u if u else 0.0
        B = 1 / b0 if b0 > 0 else None
        fit_pct, R2 = metrics.quality(sse, [record.y])
        rmse = float(np.sqrt(sse / len(record.y)))
        converged = fit.solver.converged
        rows.append(LinearLevel(u, a0, gain, b0, 0.0, B, converged, rmse=rmse, sse=sse, fit_pct=fit_pct, R2=R2))
    return tuple(rows)


def bounds_of(rows: Sequence[LinearLevel], kept: Sequence[float] | None = None) -> Bounds:
    """Least and largest B over the kept levels (all where `kept` is None); levels without a positive b0 have none."""
    chosen = [row for row in rows if kept is None or row.level in kept]
    known = [row.B for row in chosen if row.B is not None]
    levels = tuple(row.level for row in chosen)
    return Bounds(levels=levels, B_m=min(known, default=None), B_M=max(known, default=None))


def linear_fit(data: Data, options: FitOptions, held_out: Sequence[Level] = ()) -> tuple[Linear, list[Finding]]:
    """The linear model, pooled and per level, with the bounds of B."""
    one, left, huber = pooled_linear(data, options)
    p = one.parameters
    rows = single_levels(data)
    wanted = options.bounds_levels
    kept = None if wanted is None else wanted_levels(wanted, [row.level for row in rows], "bounds_levels")
    bounds = bounds_of(rows, kept)
    found = linear_findings(data, p, one.solver, rows, bounds)
    found += huber_findings("linear", huber)
    found += missed("linear", data, left, one)
    linear = Linear.of(
        one,
        per_level=rows,
        bounds=bounds,
        robust=huber,
        hold_out=metrics.hold_out(
            held_out, lambda level: model.step_response(p, level.time_s, level.level), one.rmse or 0.0
        ),
    )
    return linear, found


def pooled_linear(data: Data, options: FitOptions) -> tuple[Pooled, list[Array], Huber | None]:
    """Eq. (8) on all levels at once, under the loss that was asked for, with its residuals."""
    solved, huber = minimise(data, options.loss, fit_linear, lambda d, _: fit_linear(d), linear_residuals)
    p, left = solved.parameters, linear_residuals(solved, data)
    total = metrics.errors([record.y for record in data.records], left)
    pooled = Pooled(
        p.a0,
        p.b0,
        p.c0,
        rmse=total.rmse,
        sse=total.sse,
        fit_pct=total.fit_pct,
        R2=total.R2,
        solver=solved.solver,
    )
    return pooled, left, huber
