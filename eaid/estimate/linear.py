"""The linear model, Eq. (8), pooled and for each level, with intervals; B = 1/b0, specification 4.3.

Its step response is one exponential with τ = 1/a0 and the gain (b0 u + c0)/a0. Every number here answers linearly to
small changes of the levels' means, δq = Σ_l g_l δȳ_l. With repeats the runs themselves say how the means scatter; with
one run a level the scatter of (T_s, τ1, τ2) is carried through the curve.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import TypeAlias

import msgspec
import numpy as np

from eaid.arrays import Array, scaled_inverse
from eaid.estimate import data as metrics
from eaid.estimate.data import Data, missed
from eaid.estimate.huber import huber_findings, minimise
from eaid.estimate.points import Points, Record, decay
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
SHIFT = 1e-5
"""Step in ln τ of the difference that second derivatives come from."""
A0_GRID = 40
"""Time constants on the starting grid."""
MOST = 3
"""Starts from it."""


@dataclass(frozen=True, eq=False)
class FirstOrder:
    """One time constant for all curves, and gains that are linear in the input."""

    tau: float
    coefficients: Array
    """Of the columns of the design; the gain itself of a single level."""
    cost: float
    solver: Solver


def fit_first_order(data: Data, design: Array) -> FirstOrder:
    """Least squares of gain_l (1 − e^(−t/τ)), gain = design @ coefficients, design of shape (L, k).

    The coefficients are solved for (variable projection): the solver sees ln τ alone.
    """
    shortest = min(float(r.t_s[r.t_s > 0].min()) for r in data.records)
    low, high = 0.01 * shortest, 1e3 * data.longest_s
    look = partial(_projected, data.points, design)

    def exact(x: Array) -> Array:
        return (look(x + SHIFT)[1] - look(x - SHIFT)[1])[:, None] / (2 * SHIFT)

    A, b = np.array([[1.0], [-1.0]]), np.array([np.log(low), -np.log(high)])
    floor = ROUNDING * data.energy
    problem = Problem(lambda x: look(x)[:3], A, b, ("a0-fastest", "a0-slowest").__getitem__, exact, floor)
    grid = np.log(np.geomspace(0.3 * shortest, 3 * data.longest_s, A0_GRID))[:, None]
    costs = np.array([look(x)[0] for x in grid])
    framed = np.pad(costs, 1, constant_values=np.inf)
    minima = np.flatnonzero((costs <= framed[:-2]) & (costs <= framed[2:]))
    end, solver, _ = minimised(problem, grid[minima[np.argsort(costs[minima])][:MOST]])
    tau, coefficients = float(np.exp(end.x[0])), look(end.x)[3]
    gains = (design @ coefficients).tolist()
    left = [first_order_residual(tau, gain, r) for gain, r in zip(gains, data.records, strict=True)]
    return FirstOrder(tau, coefficients, sum(float(r @ r) for r in left), solver)


def _projected(points: Points, design: Array, x: Array) -> tuple[float, Array, Array, Array]:
    """Cost at ln τ with the coefficients solved for, its gradient (1,), Gauss–Newton curvature (1, 1), and these."""
    z = points.t_s * np.exp(-np.clip(x[0], LEAST_LOG, MOST_LOG))  # SLSQP may look far outside before it comes back
    decay = np.exp(-z)
    rise, bent = np.broadcast_to(1 - decay, points.y.shape), np.broadcast_to(-z * decay, points.y.shape)
    square, along, across = ((points.w * rise * other).sum(axis=1) for other in (rise, points.y, bent))
    normal = (design.T * square) @ design
    back = np.linalg.inv(normal + 1e-14 * np.trace(normal) * np.eye(len(normal)))
    coefficients = back @ (design.T @ along)
    gain = design @ coefficients
    left = gain[:, None] * rise - points.y
    slope = gain[:, None] * bent
    cross = design.T @ (gain * across)
    inside = float((points.w * slope * slope).sum()) - float(cross @ back @ cross)
    gradient = np.array([2 * float((points.w * slope * left).sum())])
    return float((points.w * left * left).sum()), gradient, np.array([[2 * max(inside, 0.0)]]), coefficients


def first_order_residual(tau: float, gain: float, record: Record) -> Array:
    """gain (1 − e^(−t/τ)) − y at every sample."""
    return np.asarray(gain * (1 - decay(record, tau)) - record.y)


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
