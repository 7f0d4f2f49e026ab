"""StepSet → Fit: the models that the kind of experiment allows, with held-out levels, weights and loss.

Intervals and the choice between estimates follow in `eaid.uncertainty.workflow`.
"""

from collections.abc import Sequence
from dataclasses import replace

import msgspec
import numpy as np

from eaid.arrays import Array
from eaid.errors import UsageError
from eaid.findings import Finding, finding, ranked
from eaid.fitting import metrics, robust, samples
from eaid.fitting.data import Data, data_of
from eaid.fitting.findings import linear_findings, nonlinear_findings
from eaid.fitting.first_order import fit_own_levels
from eaid.fitting.friction import friction_fit, refuse_empty, trend_axis
from eaid.fitting.levels import fit_levels
from eaid.fitting.linear import LinearSolution, bounds_of, by_convention, fit_linear, linear_residuals
from eaid.fitting.nonlinear import Solution, fit_nonlinear, full_residuals, refit_nonlinear
from eaid.fitting.options import ALLOWED, CONVENTIONS, FitOptions, check
from eaid.fitting.release import release_fit
from eaid.fitting.sources import data_part
from eaid.fitting.weights import weights_of, with_other_weights
from eaid.models import friction as friction_model
from eaid.models import linear as linear_model
from eaid.models import nonlinear as nonlinear_model
from eaid.models import parameters
from eaid.models.parameters import SHARE
from eaid.models.trends import evaluate
from eaid.results.common import HoldOut, Huber, Solver
from eaid.results.fit import Fit
from eaid.results.friction import Friction, FrictionLevel
from eaid.results.linear import Linear, Pooled
from eaid.results.nonlinear import Estimate, Nonlinear
from eaid.steps.stepset import Level, StepSet


def fit(stepset: StepSet, options: FitOptions | None = None) -> Fit:
    """Fit what the kind of experiment allows; raises DataError or UsageError where that is nothing.

    The nonlinear model is the joint estimate here; no part has intervals yet.
    """
    options = options or FitOptions()
    check(options)
    refuse_empty(stepset)
    models = chosen(stepset.kind, options.models)
    kept, held = split(stepset.levels, options.hold_out)
    whole, stepset = stepset, replace(stepset, levels=kept)
    data = data_of(kept, weights_of(kept, options.weights))
    other = with_other_weights(data, kept)
    curves, huber = fit_curves(data, options)
    found = [finding("curve-explains-little", "friction", little)] if (little := missed_levels(curves, data)) else []
    result = Fit(data=data_part(whole))
    if "friction" in models:
        part, more = friction_fit(stepset, curves, options.share)
        held_out = friction_hold_out(part, stepset, held)
        part = msgspec.structs.replace(part, robust=robust.with_runs(huber, kept), hold_out=held_out)
        result, found = msgspec.structs.replace(result, friction=part), [*found, *more]
        found += robust.huber_findings("friction", huber)
    if "nonlinear" in models:
        model, more = nonlinear_fit(data, options, held, other)
        model = msgspec.structs.replace(model, robust=robust.with_runs(model.robust, kept))
        result, found = msgspec.structs.replace(result, nonlinear=model), [*found, *more]
    if "linear" in models:
        pooled, more = linear_fit(data, options, held, other)
        pooled = msgspec.structs.replace(pooled, robust=robust.with_runs(pooled.robust, kept))
        result, found = msgspec.structs.replace(result, linear=pooled), [*found, *more]
    if options.weights == "sd" and models == ("friction",):
        found.append(finding("weights-change-nothing", "friction"))
    if stepset.releases:
        held_s = {level.level: float(level.time_s[-1]) for level in kept}
        release, more = release_fit(stepset.releases, curves, held_s, options.share or SHARE)
        result, found = msgspec.structs.replace(result, release=release), [*found, *more]
    return msgspec.structs.replace(result, findings=ranked(found), converged=converged(result))


def converged(result: Fit) -> bool:
    """Whether every model that was fitted passed our verdict."""
    parts = (result.friction, result.nonlinear, result.linear, result.release)
    return all(part.solver is None or part.solver.converged for part in parts if part is not None)


def chosen(kind: str, wanted: Sequence[str] | None) -> tuple[str, ...]:
    """The models to fit; raises UsageError for one that the kind does not allow."""
    allowed = ALLOWED[kind]
    for name in wanted or ():
        if name not in allowed:
            raise UsageError(f"«model» {name}: {kind} logs can be fitted with {', '.join(allowed)}")
    return tuple(name for name in allowed if wanted is None or name in wanted)


def split(levels: Sequence[Level], hold_out: Sequence[float]) -> tuple[tuple[Level, ...], tuple[Level, ...]]:
    """The levels to fit and those held out; raises UsageError where a held-out level is not there."""
    there = [level.level for level in levels]
    for wanted in hold_out:
        if not any(np.isclose(wanted, level) for level in there):
            raise UsageError(f"«hold_out» {wanted:g}: no such level; there are {', '.join(f'{u:g}' for u in there)}")
    held = tuple(level for level in levels if any(np.isclose(level.level, u) for u in hold_out))
    kept = tuple(level for level in levels if not any(np.isclose(level.level, u) for u in hold_out))
    if not kept:
        raise UsageError("«hold_out»: every level is held out; leave some to be fitted")
    return kept, held


def curve_residuals(fits: Sequence[FrictionLevel], on: Data) -> list[Array]:
    """f − y of each level's own curve at every sample."""
    return samples.residuals(np.array([[f.Ts, f.tau1, f.tau2, f.C] for f in fits]).T, on.records)


def fit_curves(data: Data, options: FitOptions) -> tuple[list[FrictionLevel], Huber | None]:
    """The friction curve of each level, under the loss that was asked for; errors are of the data themselves."""
    fits, huber = robust.minimise(
        data,
        options.loss,
        lambda d: fit_levels(d, options.share),
        lambda d, _: fit_levels(d, options.share),
        curve_residuals,
    )
    rows = []
    for one, record, r in zip(fits, data.records, curve_residuals(fits, data), strict=True):
        sse = one.sse if huber is None and one.sse is not None else float(r @ r)
        fit_pct, R2 = metrics.quality(sse, [record.y])
        rmse = float(np.sqrt(sse / len(r)))
        rows.append(msgspec.structs.replace(one, sse=sse, rmse=rmse, fit_pct=fit_pct, R2=R2))
    return rows, huber


def missed_levels(fits: Sequence[FrictionLevel], data: Data) -> list[float]:
    """Levels whose own curve explains little of their output."""
    pairs = zip(fits, data.records, curve_residuals(fits, data), strict=True)
    return [one.level for one, record, r in pairs if metrics.explains_little([record.y], [r])]


def estimate(
    p: parameters.Nonlinear, data: Data, residuals: Sequence[Array], solver: Solver, held: Sequence[Level] = ()
) -> Estimate:
    """Ten coefficients with their errors per level, over all, and on held-out levels."""
    outputs = [record.y for record in data.records]
    total = metrics.errors(outputs, residuals)
    rows = [metrics.errors([y], [r]).at(u) for u, y, r in zip(data.u.tolist(), outputs, residuals, strict=True)]
    missed = [nonlinear_model.step_response(p, one.time_s, one.level) - one.mean for one in held]
    weights = level_weights(data)
    return Estimate(
        tau1=p.tau1,  # type: ignore[arg-type]  # padded with zeros to the paper's degrees
        tau2=p.tau2,  # type: ignore[arg-type]
        Ts=p.Ts,  # type: ignore[arg-type]
        u_range=p.u_range,
        C=p.C,
        rmse=total.rmse,
        sse=total.sse,
        abs_error=total.abs_error,
        fit_pct=total.fit_pct,
        R2=total.R2,
        per_level=tuple(rows),
        solver=solver,
        weights="equal" if weights is None else "sd",
        level_weights=weights,
        hold_out=metrics.hold_out([one.level for one in held], [one.mean for one in held], missed, total.rmse),
    )


def nonlinear_fit(
    data: Data,
    options: FitOptions,
    held: Sequence[Level] = (),
    other: Data | Finding | None = None,
    near: Sequence[parameters.Nonlinear] = (),
) -> tuple[Nonlinear, list[Finding]]:
    """The joint estimate with its errors, and what is to be doubted of it.

    `other`: the same data under the other weights, fitted too, starting from this model as well; or why there are none.
    """

    def residuals(solved: Solution, on: Data) -> list[Array]:
        return full_residuals(solved.x, on, solved.basis)

    solution, huber = robust.minimise(
        data, options.loss, lambda d: fit_nonlinear(d, options.share, near), refit_nonlinear, residuals
    )
    p, left = solution.parameters, residuals(solution, data)
    one = msgspec.structs.replace(estimate(p, data, left, solution.solver, held), C_free=options.share is None)
    found = nonlinear_findings(p, solution.solver, solution.held, [level.level for level in held])
    found += robust.huber_findings("nonlinear", huber)
    if metrics.explains_little([record.y for record in data.records], left):
        found.append(finding("model-explains-little", "nonlinear", R2=one.R2, fit_pct=one.fit_pct))
    beside = None
    if isinstance(other, Data):
        beside = nonlinear_fit(other, options, held, near=[p])[0].estimate
    elif other is not None:
        found.append(msgspec.structs.replace(other, subject="nonlinear"))
    return Nonlinear.of(one, robust=huber, other_weights=beside), found


def linear_fit(
    data: Data, options: FitOptions, held: Sequence[Level] = (), other: Data | Finding | None = None
) -> tuple[Linear, list[Finding]]:
    """The linear model, pooled and per level, with the bounds of B; under `other` weights the pooled model alone."""
    one, left, huber = pooled_linear(data, options)
    p = one.parameters
    own = fit_own_levels(data)
    rows = {name: by_convention(data, own, p, name) for name in CONVENTIONS}
    bounds = {name: bounds_of(row, name, options.bounds_levels) for name, row in rows.items()}
    missed = [linear_model.step_response(p, level.time_s, level.level) - level.mean for level in held]
    found = linear_findings(data, p, one.solver, rows[options.bounds], bounds[options.bounds])
    found += robust.huber_findings("linear", huber)
    if metrics.explains_little([record.y for record in data.records], left):
        found.append(finding("model-explains-little", "linear", R2=one.R2, fit_pct=one.fit_pct))
    linear = Linear.of(
        one,
        per_level=rows[options.bounds],
        bounds=bounds[options.bounds],
        conventions=bounds,
        robust=huber,
        hold_out=metrics.hold_out(
            [level.level for level in held], [level.mean for level in held], missed, one.rmse or 0.0
        ),
        other_weights=pooled_linear(other, options)[0] if isinstance(other, Data) else None,
    )
    if isinstance(other, Finding):
        found.append(msgspec.structs.replace(other, subject="linear"))
    return linear, found


def pooled_linear(data: Data, options: FitOptions) -> tuple[Pooled, list[Array], Huber | None]:
    """Eq. (8) on all levels at once, under the loss that was asked for, with its residuals."""

    def residuals(solved: LinearSolution, on: Data) -> list[Array]:
        return linear_residuals(solved.parameters, on)

    solved, huber = robust.minimise(data, options.loss, fit_linear, lambda d, _: fit_linear(d), residuals)
    p, left, weights = solved.parameters, residuals(solved, data), level_weights(data)
    total = metrics.errors([record.y for record in data.records], left)
    pooled = Pooled(
        p.a0,
        p.b0,
        p.c0,
        total.rmse,
        total.sse,
        total.fit_pct,
        total.R2,
        solved.solver,
        weights="equal" if weights is None else "sd",
        level_weights=weights,
    )
    return pooled, left, huber


def level_weights(data: Data) -> tuple[float, ...] | None:
    """The levels' weights; None where all are alike."""
    return None if (data.weights == 1).all() else tuple(data.weights.tolist())


def friction_hold_out(part: Friction, stepset: StepSet, held: Sequence[Level]) -> HoldOut | None:
    """Held-out levels against the curve whose T_s, τ1, τ2 the trends give; None where a trend is missing."""
    if not held or not all(name in part.trends for name in ("Ts", "tau1", "tau2")):
        return None
    axis = trend_axis(stepset, np.array([one.level for one in held]))[1]
    missed = []
    for one, x in zip(held, axis, strict=True):
        Ts, tau1, tau2 = (
            float(evaluate(part.trends[k].form, part.trends[k].coefficients, np.array([x]))[0])
            for k in ("Ts", "tau1", "tau2")
        )
        least = parameters.TAU_FLOOR_S
        curve = parameters.Friction(Ts, max(tau1, least), max(tau2, least), SHARE if part.C is None else part.C)
        missed.append(friction_model.step_response(curve, one.time_s) - one.mean)
    samples, sse = sum(f.samples or 0 for f in part.levels), sum(f.sse or 0.0 for f in part.levels)
    fitted_rmse = float(np.sqrt(sse / samples))
    return metrics.hold_out([one.level for one in held], [one.mean for one in held], missed, fitted_rmse)
