"""A fit as the dictionary that fit.json holds (CONTRACT.md)."""

from typing import Any

from eaid.fitting.options import CONVENTIONS
from eaid.fitting.result import (
    Bounds,
    Fit,
    FrictionFit,
    LevelError,
    LinearFit,
    NonlinearFit,
    PooledLinear,
    ReleaseFit,
    Solver,
    Trend,
)
from eaid.steps.stepset import RunRecord, StepSet


def to_json(fit: Fit, stepset: StepSet) -> dict[str, Any]:
    """The body of a fit.json; `eaid.store.stamped` puts schema and version before it."""
    result: dict[str, Any] = {"data": data_json(stepset), "converged": fit.converged}
    if fit.friction:
        result["friction"] = friction_json(fit.friction)
    if fit.nonlinear:
        result["nonlinear"] = nonlinear_json(fit.nonlinear)
    if fit.linear:
        result["linear"] = linear_json(fit.linear)
    if fit.release:
        result["release"] = release_json(fit.release)
    return {**result, **fit.extra, "warnings": list(fit.warnings)}


def data_json(stepset: StepSet) -> dict[str, Any]:
    """What was fitted: kind, units, levels, apparatus, sources."""
    rig = stepset.apparatus
    rates = [run.rate_hz for run in stepset.runs]
    if not rates:
        rates = [(len(level.time_s) - 1) / float(level.time_s[-1] - level.time_s[0]) for level in stepset.levels]
    result: dict[str, Any] = {
        "kind": stepset.kind,
        "input_unit": stepset.input_unit,
        "output_unit": stepset.output_unit,
        "levels": [level.level for level in stepset.levels],
        "repeats": [len(level.runs) for level in stepset.levels],
        "samples": [len(level.time_s) for level in stepset.levels],
        "record_s": [float(level.time_s[-1]) for level in stepset.levels],
        "sample_rate_hz": max(rates),
        "apparatus": {
            "inner_radius_m": rig.inner_radius_m,
            "outer_radius_m": rig.outer_radius_m,
            "surfaces": rig.surfaces,
            "dielectric_m": rig.dielectric_m,
            "voltage_v": rig.voltage_v,
            "pwm_hz": rig.pwm_hz,
            "sample_rate_hz": rig.sample_rate_hz,
            "lever_ratio": rig.lever_ratio,
        },
        "sources": [_source(run) for run in stepset.runs],
        "warnings": list(stepset.warnings),
    }
    if "inputs" in stepset.extra:
        result["inputs"] = stepset.extra["inputs"]
    if stepset.synthetic is not None:
        result["synthetic"] = stepset.synthetic
    return result


def _source(run: RunRecord) -> dict[str, Any]:
    return {
        "path": run.source,
        "sha256": run.sha256,
        "run": run.name,
        "level": run.level,
        "repeat": run.repeat,
        "baseline_nm": run.baseline_nm,
        "step_s": run.step_s,
        "samples": run.samples,
        "edge": run.edge,
        "warnings": list(run.warnings),
    }


def solver_json(solver: Solver) -> dict[str, Any]:
    """How a fit was found, and the verdict on it."""
    return {
        "method": solver.method,
        "converged": solver.converged,
        "message": solver.message,
        "promise": solver.promise,
        "evaluations": solver.evaluations,
        "starts": [{"cost": cost} for cost in solver.starts],
        "at_bounds": list(solver.at_bounds),
    }


def friction_json(fit: FrictionFit) -> dict[str, Any]:
    """The `friction` part."""
    levels = []
    for one, x, coefficient in zip(fit.levels, fit.x, fit.C_f, strict=True):
        row = {
            "level": one.level,
            fit.over: x,
            "C": one.curve.C,
            "Ts": one.curve.Ts,
            "tau1": one.curve.tau1,
            "tau2": one.curve.tau2,
            "rmse": one.rmse,
            "sse": one.sse,
            "samples": one.samples,
            "solver": solver_json(one.solver),
        }
        if coefficient is not None:
            row["C_f"] = coefficient
        levels.append(row)
    return {
        "C": fit.C,
        "levels": levels,
        "trends": {name: _trend(trend) for name, trend in fit.trends.items()},
        "solver": solver_json(fit.solver),
        "warnings": list(fit.warnings),
        **_optional(hold_out=fit.hold_out, robust=fit.robust),
    }


def _trend(trend: Trend) -> dict[str, Any]:
    return {
        "over": trend.over,
        "form": trend.form,
        "coefficients": list(trend.coefficients),
        "rmse": trend.rmse,
        "converged": trend.converged,
        "at_bounds": list(trend.at_bounds),
    }


def nonlinear_json(fit: NonlinearFit) -> dict[str, Any]:
    """The `nonlinear` part."""
    p = fit.parameters
    return {
        "C": p.C,
        "C_free": fit.share_free,
        "tau1": list(p.tau1),
        "tau2": list(p.tau2),
        "Ts": list(p.Ts),
        "u_range": list(p.u_range),
        "rmse": fit.rmse,
        "sse": fit.sse,
        "abs_error": {"mean": fit.abs_mean, "sd": fit.abs_sd},
        "per_level": [_level_error(one) for one in fit.per_level],
        "solver": solver_json(fit.solver),
        "warnings": list(fit.warnings),
        **_optional(weights=fit.weights, robust=fit.robust, hold_out=fit.hold_out),
        **_other_weights(None if fit.other is None else nonlinear_json(fit.other), fit.no_other),
    }


def _other_weights(other: dict[str, Any] | None, missing: str | None) -> dict[str, Any]:
    """`other_weights`: the model under the weights that were not asked for, or why there is none."""
    if other is None:
        return {} if missing is None else {"other_weights": {"absent": missing}}
    kept = {key: part for key, part in other.items() if key not in ("warnings", "robust", "C_free", "weights")}
    name = "sd" if "weights" in other else "equal"
    return {"other_weights": {"weights": name, **kept, **_optional(level_weights=other.get("weights"))}}


def _level_error(one: LevelError) -> dict[str, Any]:
    return {
        "level": one.level,
        "rmse": one.rmse,
        "sse": one.sse,
        "abs_error": {"mean": one.abs_mean, "sd": one.abs_sd},
    }


def linear_json(fit: LinearFit) -> dict[str, Any]:
    """The `linear` part."""
    p = fit.parameters
    return {
        "a0": p.a0,
        "b0": p.b0,
        "c0": p.c0,
        "rmse": fit.rmse,
        "sse": fit.sse,
        "per_level": [
            {
                "level": one.level,
                "a0": one.a0,
                "gain": one.gain,
                "b0": one.b0,
                "c0": one.c0,
                "B": one.B,
                "rmse": one.rmse,
                "sse": one.sse,
                "converged": one.solver.converged,
            }
            for one in fit.per_level
        ],
        "bounds": _bounds(fit.bounds),
        "conventions": {name: _bounds(bounds) for name, bounds in fit.conventions.items()},
        "solver": solver_json(fit.solver),
        "warnings": list(fit.warnings),
        **_optional(weights=fit.weights, robust=fit.robust, hold_out=fit.hold_out),
        **_other_weights(None if fit.other is None else _pooled_json(fit.other), fit.no_other),
    }


def _pooled_json(fit: PooledLinear) -> dict[str, Any]:
    p = fit.parameters
    return {
        "a0": p.a0,
        "b0": p.b0,
        "c0": p.c0,
        "rmse": fit.rmse,
        "sse": fit.sse,
        "solver": solver_json(fit.solver),
        **_optional(weights=fit.weights),
    }


def _bounds(bounds: Bounds) -> dict[str, Any]:
    return {
        "convention": bounds.convention,
        "means": CONVENTIONS[bounds.convention],
        "levels": list(bounds.levels),
        "B_m": bounds.B_m,
        "B_M": bounds.B_M,
    }


def release_json(fit: ReleaseFit) -> dict[str, Any]:
    """The `release` part."""
    return {
        "C": fit.C,
        "tau1": fit.tau1,
        "tau2": fit.tau2,
        "rmse": fit.rmse,
        "sse": fit.sse,
        "levels": [
            {
                "level": one.level,
                "share": one.share,
                "tau1": one.tau1,
                "tau2": one.tau2,
                "rising_tau1": one.rising_tau1,
                "rising_tau2": one.rising_tau2,
                "amplitude": one.amplitude,
                "residual": one.residual,
                "rmse": one.rmse,
                "sse": one.sse,
                "solver": solver_json(one.solver),
            }
            for one in fit.levels
        ],
        "solver": solver_json(fit.solver),
        "warnings": list(fit.warnings),
    }


def _optional(**parts: Any) -> dict[str, Any]:
    return {name: list(part) if isinstance(part, tuple) else part for name, part in parts.items() if part is not None}
