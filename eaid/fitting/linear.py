"""The linear model, Eq. (8), pooled and for each level; B = 1/b0, specification 4.3.

Its step response is one exponential with τ = 1/a0 and the gain (b0 u + c0)/a0.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from eaid.arrays import Array
from eaid.findings import Finding
from eaid.fitting import metrics, robust
from eaid.fitting.data import Data
from eaid.fitting.findings import linear_findings, missed
from eaid.fitting.first_order import first_order_problem, fit_each_level, fit_first_order
from eaid.fitting.samples import decay
from eaid.fitting.solver import slsqp
from eaid.models import linear as model
from eaid.models.parameters import Linear as LinearModel
from eaid.results.common import Huber, Solver
from eaid.results.fit import FitOptions
from eaid.results.linear import Bounds, Linear, LinearLevel, Pooled
from eaid.steps.stepset import Level


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
    x = slsqp(first_order_problem(data, design)[0], start).x
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
    return [
        (p.b0 * u + p.c0) / p.a0 * (1 - decay(r, 1 / p.a0)) - r.y for u, r in zip(data.u, data.records, strict=True)
    ]


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
    bounds = bounds_of(rows, options.bounds_levels)
    found = linear_findings(data, p, one.solver, rows, bounds)
    found += robust.huber_findings("linear", huber)
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
    solved, huber = robust.minimise(data, options.loss, fit_linear, lambda d, _: fit_linear(d), linear_residuals)
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
