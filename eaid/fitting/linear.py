"""The linear model, Eq. (8), pooled and for each level; B = 1/b0 under three conventions, specification 4.3.

Its step response is one exponential with τ = 1/a0 and the gain (b0 u + c0)/a0.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import msgspec
import numpy as np

from eaid.arrays import Array
from eaid.findings import Finding
from eaid.fitting import metrics, robust
from eaid.fitting.choices import CONVENTIONS
from eaid.fitting.data import Data
from eaid.fitting.findings import linear_findings, missed
from eaid.fitting.first_order import FirstOrder, first_order_problem, fit_each_level, fit_first_order
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


def by_convention(
    data: Data, level_fits: Sequence[FirstOrder], pooled: LinearModel, convention: str
) -> tuple[LinearLevel, ...]:
    """b0, c0 and B of each level under one convention, specification 4.3."""
    rows = []
    for fit, u, record in zip(level_fits, data.u.tolist(), data.records, strict=True):
        a0, gain, sse, converged = 1 / fit.tau, float(fit.coefficients[0]), fit.cost, fit.solver.converged
        c0 = 0.0 if convention == "zero-offset" else pooled.c0
        if convention == "pooled-dynamics":
            a0 = pooled.a0
            rise = 1 - decay(record, 1 / a0)
            gain = float(rise @ record.y / (rise @ rise))
            left = record.y - gain * rise
            sse, converged = float(left @ left), True  # a linear solve
        b0 = (a0 * gain - c0) / u if u else 0.0
        B = 1 / b0 if b0 > 0 else None
        fit_pct, R2 = metrics.quality(sse, [record.y])
        rmse = float(np.sqrt(sse / len(record.y)))
        rows.append(LinearLevel(u, a0, gain, b0, c0, B, converged, rmse=rmse, sse=sse, fit_pct=fit_pct, R2=R2))
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


def linear_fit(
    data: Data, options: FitOptions, held_out: Sequence[Level] = (), other: Data | Finding | None = None
) -> tuple[Linear, list[Finding]]:
    """The linear model, pooled and per level, with the bounds of B; under `other` weights the pooled model alone."""
    one, left, huber = pooled_linear(data, options)
    p = one.parameters
    level_fits = fit_each_level(data)
    rows = {name: by_convention(data, level_fits, p, name) for name in CONVENTIONS}
    bounds = {name: bounds_of(row, name, options.bounds_levels) for name, row in rows.items()}
    found = linear_findings(data, p, one.solver, rows[options.bounds], bounds[options.bounds])
    found += robust.huber_findings("linear", huber)
    found += missed("linear", data, left, one)
    linear = Linear.of(
        one,
        per_level=rows[options.bounds],
        bounds=bounds[options.bounds],
        conventions=bounds,
        robust=huber,
        hold_out=metrics.hold_out(
            held_out, lambda level: model.step_response(p, level.time_s, level.level), one.rmse or 0.0
        ),
        other_weights=pooled_linear(other, options)[0] if isinstance(other, Data) else None,
    )
    if isinstance(other, Finding):
        found.append(msgspec.structs.replace(other, subject="linear"))
    return linear, found


def pooled_linear(data: Data, options: FitOptions) -> tuple[Pooled, list[Array], Huber | None]:
    """Eq. (8) on all levels at once, under the loss that was asked for, with its residuals."""
    solved, huber = robust.minimise(data, options.loss, fit_linear, lambda d, _: fit_linear(d), linear_residuals)
    p, left, weights = solved.parameters, linear_residuals(solved, data), data.unequal_weights
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
        weights="equal" if weights is None else "sd",
        level_weights=weights,
    )
    return pooled, left, huber
