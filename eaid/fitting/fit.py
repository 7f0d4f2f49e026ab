"""StepSet → Fit: the models that the kind of experiment allows, with held-out levels, weights and loss."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from eaid.arrays import Array
from eaid.errors import UsageError
from eaid.fitting import kernel, robust
from eaid.fitting.data import Data, data_of
from eaid.fitting.friction import friction_fit, refuse_empty
from eaid.fitting.levels import fit_levels
from eaid.fitting.linear import (
    LinearSolution,
    bounds_of,
    by_convention,
    fit_linear,
    fit_own_levels,
    linear_residuals,
)
from eaid.fitting.nonlinear import Solution, fit_nonlinear, full_residuals, refit_nonlinear
from eaid.fitting.options import ALLOWED, CONVENTIONS, FitOptions, check
from eaid.fitting.release import release_fit
from eaid.fitting.result import Fit, FrictionFit, LevelError, LevelFit, LinearFit, NonlinearFit, PooledLinear
from eaid.fitting.warnings import linear_warnings, nonlinear_warnings
from eaid.fitting.weights import weights_of, with_other_weights
from eaid.models import friction as friction_model
from eaid.models import linear as linear_model
from eaid.models import nonlinear as nonlinear_model
from eaid.models.parameters import SHARE, Friction, Nonlinear
from eaid.models.trends import evaluate
from eaid.steps.stepset import Level, StepSet


def fit(stepset: StepSet, options: FitOptions | None = None) -> Fit:
    """Fit what the kind of experiment allows; raises DataError or UsageError where that is nothing."""
    options = options or FitOptions()
    check(options)
    refuse_empty(stepset)
    models = chosen(stepset.kind, options.models)
    kept, held = split(stepset.levels, options.hold_out)
    stepset = replace(stepset, levels=kept)
    data = data_of(kept, weights_of(kept, options.weights))
    other = with_other_weights(data, kept)
    curves, curve_info = fit_curves(data, options)
    found: dict[str, Any] = {}
    if "friction" in models:
        part = friction_fit(stepset, curves, options.share)
        found["friction"] = replace(part, robust=curve_info, hold_out=friction_hold_out(part, stepset, held))
    if "nonlinear" in models:
        found["nonlinear"] = nonlinear_fit(data, options, held, other)
    if "linear" in models:
        found["linear"] = linear_fit(data, options, held, other)
    if options.weights == "sd" and set(found) == {"friction"}:
        word = "--weights sd changes nothing here: each level is fitted by itself, and trends take all levels alike"
        found["friction"] = replace(found["friction"], warnings=(*found["friction"].warnings, word))
    for name, part in found.items():
        told = (*part.warnings, *robust.huber_warnings(part.robust))
        found[name] = replace(part, robust=robust.with_runs(part.robust, kept), warnings=told)
    if stepset.releases:
        held_s = {level.level: float(level.time_s[-1]) for level in kept}
        found["release"] = release_fit(stepset.releases, curves, held_s, options.share or SHARE)
    return Fit(**found)


def chosen(kind: str, wanted: Sequence[str] | None) -> tuple[str, ...]:
    """The models to fit; raises UsageError for one that the kind does not allow."""
    allowed = ALLOWED[kind]
    for name in wanted or ():
        if name not in allowed:
            raise UsageError(f"--model {name}: {kind} logs can be fitted with {', '.join(allowed)}")
    return tuple(name for name in allowed if wanted is None or name in wanted)


def split(levels: Sequence[Level], hold_out: Sequence[float]) -> tuple[tuple[Level, ...], tuple[Level, ...]]:
    """The levels to fit and those held out; raises UsageError where a held-out level is not there."""
    there = [level.level for level in levels]
    for wanted in hold_out:
        if not any(np.isclose(wanted, level) for level in there):
            raise UsageError(f"--hold-out {wanted:g}: no such level; there are {', '.join(f'{u:g}' for u in there)}")
    held = tuple(level for level in levels if any(np.isclose(level.level, u) for u in hold_out))
    kept = tuple(level for level in levels if not any(np.isclose(level.level, u) for u in hold_out))
    if not kept:
        raise UsageError("--hold-out: every level is held out; leave some to be fitted")
    return kept, held


def fit_curves(data: Data, options: FitOptions) -> tuple[list[LevelFit], dict[str, Any] | None]:
    """The friction curve of each level, under the loss that was asked for; rmse and sse are of the data themselves."""

    def residuals(fits: list[LevelFit], on: Data) -> list[Array]:
        theta = np.array([[f.curve.Ts, f.curve.tau1, f.curve.tau2, f.curve.C] for f in fits]).T
        return kernel.residuals(theta, on.records)

    fits, info = robust.minimise(
        data, options.loss, lambda d: fit_levels(d, options.share), lambda d, _: fit_levels(d, options.share), residuals
    )
    if info is not None:
        squares = [float(r @ r) for r in residuals(fits, data)]
        fits = [replace(f, sse=sse, rmse=float(np.sqrt(sse / f.samples))) for f, sse in zip(fits, squares, strict=True)]
    return fits, info


def level_error(level: float, residual: Array) -> LevelError:
    """RMSE, sum of squares, and mean and standard deviation of |residual| of one level."""
    return _error(level, len(residual), float(residual @ residual), float(np.abs(residual).sum()))


def _error(level: float, samples: int, sse: float, absolute: float) -> LevelError:
    mean = absolute / samples
    square = sse / samples
    return LevelError(level, float(np.sqrt(square)), sse, mean, float(np.sqrt(max(square - mean**2, 0.0))))


def overall(residuals: Sequence[Array]) -> LevelError:
    """The same over all samples of all levels; its level is NaN."""
    samples, sse = sum(len(r) for r in residuals), sum(float(r @ r) for r in residuals)
    return _error(float("nan"), samples, sse, sum(float(np.abs(r).sum()) for r in residuals))


def hold_out_row(held: Sequence[Level], residuals: Sequence[Array], fitted_rmse: float) -> dict[str, Any] | None:
    """What the held-out levels say, beside the error on the fitted ones; None where none was held out."""
    if not held:
        return None
    rows = [level_error(one.level, r) for one, r in zip(held, residuals, strict=True)]
    total = overall(residuals)
    return {
        "levels": [{"level": r.level, "rmse": r.rmse, "abs_error": {"mean": r.abs_mean, "sd": r.abs_sd}} for r in rows],
        "rmse": total.rmse,
        "abs_error": {"mean": total.abs_mean, "sd": total.abs_sd},
        "fitted_rmse": fitted_rmse,
    }


def nonlinear_fit(
    data: Data,
    options: FitOptions,
    held: Sequence[Level] = (),
    other: Data | str | None = None,
    near: Sequence[Nonlinear] = (),
) -> NonlinearFit:
    """The nonlinear model with its errors per level and on the held-out levels.

    `other`: the same data under the other weights, fitted too, starting from this model as well; or why there are none.
    """

    def residuals(solved: Solution, on: Data) -> list[Array]:
        return full_residuals(solved.x, on, solved.basis)

    solution, info = robust.minimise(
        data, options.loss, lambda d: fit_nonlinear(d, options.share, near), refit_nonlinear, residuals
    )
    p = solution.parameters
    left = residuals(solution, data)
    total = overall(left)
    missed = [nonlinear_model.step_response(p, one.time_s, one.level) - one.mean for one in held]
    outside = hold_out_row(held, missed, total.rmse)
    return NonlinearFit(
        parameters=p,
        rmse=total.rmse,
        sse=total.sse,
        abs_mean=total.abs_mean,
        abs_sd=total.abs_sd,
        per_level=tuple(level_error(float(u), r) for u, r in zip(data.u, left, strict=True)),
        solver=solution.solver,
        share_free=options.share is None,
        weights=level_weights(data),
        robust=info,
        other=nonlinear_fit(other, options, near=[p]) if isinstance(other, Data) else None,
        no_other=other if isinstance(other, str) else None,
        warnings=nonlinear_warnings(data, p, solution.solver, [one.level for one in held]),
        hold_out=outside,
    )


def linear_fit(
    data: Data, options: FitOptions, held: Sequence[Level] = (), other: Data | str | None = None
) -> LinearFit:
    """The linear model, pooled and per level, with the bounds of B; under `other` weights the pooled model alone."""
    pooled, info = pooled_linear(data, options)
    p = pooled.parameters
    left = linear_residuals(p, data)
    total = overall(left)
    own = fit_own_levels(data)
    rows = {name: by_convention(data, own, p, name) for name in CONVENTIONS}
    bounds = {name: bounds_of(row, name, options.bounds_levels) for name, row in rows.items()}
    missed = [linear_model.step_response(p, one.time_s, one.level) - one.mean for one in held]
    outside = hold_out_row(held, missed, total.rmse)
    return LinearFit(
        parameters=p,
        rmse=total.rmse,
        sse=total.sse,
        per_level=tuple(rows[options.bounds]),
        bounds=bounds[options.bounds],
        conventions=bounds,
        solver=pooled.solver,
        weights=level_weights(data),
        robust=info,
        other=pooled_only(other, options) if isinstance(other, Data) else None,
        no_other=other if isinstance(other, str) else None,
        warnings=linear_warnings(data, p, pooled.solver, rows[options.bounds], bounds[options.bounds]),
        hold_out=outside,
    )


def pooled_linear(data: Data, options: FitOptions) -> tuple[LinearSolution, dict[str, Any] | None]:
    """Eq. (8) on all levels at once, under the loss that was asked for."""
    return robust.minimise(
        data,
        options.loss,
        fit_linear,
        lambda d, _: fit_linear(d),
        lambda solved, on: linear_residuals(solved.parameters, on),
    )


def pooled_only(data: Data, options: FitOptions) -> PooledLinear:
    """The pooled linear model under other weights; single levels do not know of weights."""
    pooled, _ = pooled_linear(data, options)
    total = overall(linear_residuals(pooled.parameters, data))
    return PooledLinear(pooled.parameters, total.rmse, total.sse, pooled.solver, level_weights(data))


def level_weights(data: Data) -> tuple[float, ...] | None:
    """The levels' weights; None where all are alike."""
    return None if (data.weights == 1).all() else tuple(data.weights.tolist())


def friction_hold_out(part: FrictionFit, stepset: StepSet, held: Sequence[Level]) -> dict[str, Any] | None:
    """Held-out levels against the curve whose T_s, τ1, τ2 the trends give; None where a trend is missing."""
    from eaid.fitting.friction import trend_axis

    if not held or not all(name in part.trends for name in ("Ts", "tau1", "tau2")):
        return None
    axis = trend_axis(stepset, np.array([one.level for one in held]))[1]
    missed = []
    for one, x in zip(held, axis, strict=True):
        Ts, tau1, tau2 = (
            float(evaluate(part.trends[k].form, part.trends[k].coefficients, np.array([x]))[0])
            for k in ("Ts", "tau1", "tau2")
        )
        curve = Friction(Ts, max(tau1, 1e-3), max(tau2, 1e-3), SHARE if part.C is None else part.C)
        missed.append(friction_model.step_response(curve, one.time_s) - one.mean)
    samples = sum(f.samples for f in part.levels)
    return hold_out_row(held, missed, float(np.sqrt(sum(f.sse for f in part.levels) / samples)))
