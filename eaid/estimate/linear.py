"""The linear model, Eq. (8), pooled and for each level, with intervals; B = 1/b0, specification 4.3.

Its step response is one exponential with τ = 1/a0 and the gain (b0 u + c0)/a0. Every number here answers linearly to
small changes of the levels' means, δq = Σ_l g_l δȳ_l. With repeats the runs themselves say how the means scatter; with
one run a level the scatter of (T_s, τ1, τ2) is carried through the curve.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import msgspec
import numpy as np
from numpy.typing import NDArray

from eaid.arrays import Array, scaled_inverse
from eaid.estimate import data as metrics
from eaid.estimate.data import Data, missed
from eaid.estimate.huber import huber_findings, minimise
from eaid.estimate.points import Points, Record, by_log, decay, log_curvature, log_products, weighted_shares
from eaid.estimate.scatter import Scatter
from eaid.estimate.solver import ROUNDING, Problem, minimised
from eaid.estimate.spread import Influence, interval_of, log_interval_of, textbook
from eaid.findings import Finding, finding
from eaid.models import linear as model
from eaid.models.parameters import Linear as LinearModel
from eaid.options import FitOptions
from eaid.results.common import Solver
from eaid.results.fit import (
    NOT_IDENTIFIABLE,
    Bounds,
    BoundsIntervals,
    Linear,
    LinearLevel,
    LinearLevelIntervals,
    Pooled,
    PooledIntervals,
)
from eaid.steps.levels import wanted_levels
from eaid.steps.stepset import Level

LEAST_LOG, MOST_LOG = np.log(1e-9), np.log(1e12)
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


TO_LOG_B = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, -1.0]])
"""(log a0, log gain) → (log a0, log gain, log B) less log u."""


UNSEEN = 1e-10
"""Directions that the data do not see, b0 and c0 of a single level, have this part of the information at most."""


def _rise(a0: float, t_s: Array) -> tuple[Array, Array, Array]:
    """r = (1 − e^(−a0 t))/a0 and its first two derivatives by a0, shape (n,) each."""
    rise = -np.expm1(-a0 * t_s)
    decay, r = 1.0 - rise, rise / a0
    first = (t_s * decay - r) / a0
    return r, first, (-(t_s**2) * decay - 2 * first) / a0


Gain: TypeAlias = tuple[Array, Array]
"""How a change of a level's mean moves m numbers, shape (m, n), as a product of (m, k) and (k, n)."""


def pooled_gain(levels: Sequence[Level], p: LinearModel) -> list[Gain]:
    """How a change of each level's mean moves the pooled (a0, b0, c0): H⁻¹ J' of each level, J' = (3, 2) of (r', r)."""
    hessian = np.zeros((3, 3))
    parts = []
    time_s, second, both, square = np.empty(0), np.empty(0), np.empty((2, 0)), np.empty((2, 2))
    for level in levels:
        if not np.array_equal(level.time_s, time_s):  # most levels have the same times
            time_s = level.time_s
            r, first, second = _rise(p.a0, time_s)
            both = np.stack([first, r])
            square = both @ both.T
        size = p.b0 * level.level + p.c0
        take = np.array([[size, 0.0], [0.0, level.level], [0.0, 1.0]])
        left = level.mean - size * both[1]
        curved = np.zeros((3, 3))
        curved[0, 0] = size * (left @ second)
        curved[0, 1] = curved[1, 0] = level.level * (left @ both[0])
        curved[0, 2] = curved[2, 0] = left @ both[0]
        hessian += take @ square @ take.T - curved
        parts.append((take, both))
    inverse = scaled_inverse(hessian, UNSEEN)
    return [(inverse @ take, both) for take, both in parts]


def level_gain(level: Level, a0: float, gain: float) -> Array:
    """How a change of a level's mean moves its own (log a0, log gain, log B), B = u/(a0 gain), shape (3, n)."""
    jacobian, hessian = level_terms(level, a0, gain)
    return np.asarray(TO_LOG_B @ scaled_inverse(hessian, UNSEEN) @ jacobian.T)


def level_terms(level: Level, a0: float, gain: float) -> tuple[Array, Array]:
    """∂f/∂(log a0, log gain) of gain · (1 − e^(−a0 t)), shape (n, 2), and the full Hessian of half the cost (2, 2)."""
    rise = -np.expm1(-a0 * level.time_s)
    decay = 1.0 - rise
    slope = gain * a0 * level.time_s * decay
    jacobian = np.stack([slope, gain * rise], axis=1)
    left = level.mean - gain * rise
    curved = np.array([[left @ (slope * (1 - a0 * level.time_s)), left @ slope], [left @ slope, left @ (gain * rise)]])
    return jacobian, np.asarray(jacobian.T @ jacobian - curved)


def of_levels(gains: Sequence[Gain], seen: Scatter) -> Influence:
    """How m numbers q with δq = Σ_l g_l δȳ_l, g_l of shape (m, n_l), answer to the levels' own T_s, τ1, τ2."""
    gain = np.array([(take @ (along @ J)).T for (take, along), J in zip(gains, seen.jacobians, strict=True)])
    return Influence(gain, seen.of_levels, np.zeros((0, gain.shape[2])), 0.0)


def pooled_intervals(fit: Pooled, seen: Scatter) -> PooledIntervals:
    """95 % intervals of the pooled a0, b0, c0; one level leaves c0 to b0."""
    variance, degrees = of_levels(pooled_gain(seen.levels, fit.parameters), seen).variance()
    found = list(zip(variance.tolist(), degrees.tolist(), strict=True))
    return _pooled(fit, found if len(seen.levels) > 1 else found[:2])


def _pooled(fit: Pooled, found: Sequence[tuple[float, float]]) -> PooledIntervals:
    """From the variance and degrees of freedom of a0, b0 and, with several levels, c0."""
    pairs = list(zip((fit.a0, fit.b0, fit.c0), found, strict=False))
    dof = dict(zip(("a0", "b0", "c0"), (degrees for _, degrees in found), strict=False))
    return PooledIntervals(*(interval_of(value, variance, degrees) for value, (variance, degrees) in pairs), dof=dof)


def level_intervals(rows: Sequence[LinearLevel], seen: Scatter) -> list[LinearLevelIntervals]:
    """95 % intervals of a0, gain and B of every level."""
    found = []
    for i, (level, row, J) in enumerate(zip(seen.levels, rows, seen.jacobians, strict=True)):
        gain = (level_gain(level, row.a0, row.gain) @ J).T[None]
        one = Influence(gain, seen.of_levels.alone(i), np.zeros((0, 3)), 0.0)
        variance, degrees = (each.tolist() for each in one.variance())
        ends = zip((row.a0, row.gain, row.B), variance, degrees, strict=True)
        dof = dict(zip(("a0", "gain", "B"), degrees, strict=True))
        found.append(LinearLevelIntervals(*(log_interval_of(*one) for one in ends), dof=dof))
    return found


def bound_intervals(bounds: Bounds, rows: Sequence[LinearLevel]) -> BoundsIntervals:
    """95 % intervals of B_m and B_M, the least and largest B over the kept levels; None where some B is unbounded."""
    kept = [None if row.ci95 is None else row.ci95.B for row in rows if row.level in bounds.levels]
    known = [interval for interval in kept if interval is not None]
    if not known or len(known) < len(kept):
        return BoundsIntervals()
    low, high = np.array(known).T
    return BoundsIntervals((float(low.min()), float(high.min())), (float(low.max()), float(high.max())))


def white(
    fit: Pooled, rows: Sequence[LinearLevel], levels: Sequence[Level]
) -> tuple[PooledIntervals, list[LinearLevelIntervals]]:
    """Textbook intervals, s² (J'J)⁻¹ on the means: of the pooled fit, and of each level."""
    p = fit.parameters
    slopes = [model.gradient(p, level.time_s, level.level).T for level in levels]
    left = [level.mean - model.step_response(p, level.time_s, level.level) for level in levels]
    M, noise, spare = textbook(slopes, left, 3 if len(levels) > 1 else 2)
    variance = np.maximum(np.diag(scaled_inverse(M, UNSEEN)) * noise, 0).tolist()
    each = []
    for level, row in zip(levels, rows, strict=True):
        J = level_terms(level, row.a0, row.gain)[0]
        M, noise, own = textbook([J], [level.mean - J[:, 1]], 2)
        logs = np.diag(TO_LOG_B @ scaled_inverse(M, UNSEEN) @ TO_LOG_B.T * noise).tolist()
        pairs = zip((row.a0, row.gain, row.B), logs, strict=True)
        each.append(LinearLevelIntervals(*(None if x is None else interval_of(x, x * x * v, own) for x, v in pairs)))
    return _pooled(fit, [(v, spare) for v in variance]), each


def linear_part(
    data: Data, seen: Scatter, options: FitOptions, held_out: Sequence[Level] = ()
) -> tuple[Linear, list[Finding]]:
    """The linear model, pooled and per level, with the bounds of B, intervals, and warnings."""
    solved, huber = minimise(data, options.loss, fit_linear, lambda d, _: fit_linear(d), linear_residuals)
    p, left = solved.parameters, linear_residuals(solved, data)
    total = metrics.errors([record.y for record in data.records], left)
    one = Pooled(
        p.a0, p.b0, p.c0, solver=solved.solver, rmse=total.rmse, sse=total.sse, fit_pct=total.fit_pct, R2=total.R2
    )
    rows = single_levels(data)
    wanted = options.bounds_levels
    kept = None if wanted is None else wanted_levels(wanted, [row.level for row in rows], "bounds_levels")
    bounds = bounds_of(rows, kept)
    pooled = pooled_intervals(one, seen)
    found = [*linear_findings(data, one, rows, bounds, pooled), *huber_findings("linear", huber)]
    found += missed("linear", data, left, one)
    if options.ci != "none":
        own = level_intervals(rows, seen)
        if options.ci == "white":
            pooled, own = white(one, rows, seen.levels)
        rows = tuple(msgspec.structs.replace(row, ci95=ci) for row, ci in zip(rows, own, strict=True))
        bounds = msgspec.structs.replace(bounds, ci95=bound_intervals(bounds, rows))
        one = msgspec.structs.replace(one, ci95=pooled)
    beyond = metrics.hold_out(held_out, lambda level: model.step_response(p, level.time_s, level.level), total.rmse)
    known = not any(each.code in NOT_IDENTIFIABLE for each in found)
    part = Linear.of(one, per_level=rows, bounds=bounds, robust=huber, hold_out=beyond, identifiable=known)
    return part, found


def linear_findings(
    data: Data, fit: Pooled, rows: Sequence[LinearLevel], bounds: Bounds, ci95: PooledIntervals
) -> list[Finding]:
    """Warnings about the linear model and the bounds of B."""
    found, solver, several = [], fit.solver, len(rows) > 1
    if solver is not None and not solver.converged:
        found.append(finding("fit-not-converged", "linear", predicted_decrease=solver.predicted_decrease))
    if solver is not None and solver.at_bounds:
        found.append(finding("a0-not-determined", "linear", constraint=solver.at_bounds[0]))
    levels = {
        "linear-output-negative": [u for u in data.u.tolist() if fit.b0 * u + fit.c0 < 0],
        "linear-level-beyond-record": [
            row.level for row, r in zip(rows, data.records, strict=True) if row.a0 * r.t_s[-1] < 1
        ],
        "level-without-b": [row.level for row in rows if row.B is None and row.level in bounds.levels],
    }
    found += [finding(code, "linear", at) for code, at in levels.items() if at]
    if not several:
        found.append(finding("one-level-linear", "linear", [rows[0].level]))
    for name in ("a0", "b0") if several else ("a0",):
        ends = getattr(ci95, name)
        if ends is not None and ends[0] <= 0:
            found.append(finding(f"{name}-may-be-zero", "linear", low=ends[0], high=ends[1]))
    if bounds.B_m is None:
        found.append(finding("no-b-bounds", "linear"))
    return found
