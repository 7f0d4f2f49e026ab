"""Intervals of the nonlinear model: the joint fit and the two-stage one, side by side.

Run-to-run scatter of the gain leaks into the τ curves of the joint fit, and no interval repairs a biased estimate. So
the joint covariance holds, beside the scatter itself, the outer product of what separates the two estimates.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from eaid.arrays import Array, distinct
from eaid.fitting.fit import hold_out_row, level_error, overall
from eaid.fitting.result import NonlinearFit, Solver
from eaid.fitting.to_json import nonlinear_json
from eaid.fitting.warnings import nonlinear_warnings
from eaid.models import nonlinear
from eaid.steps.stepset import Level
from eaid.uncertainty.curve import Curve
from eaid.uncertainty.joint import (
    BLOCKS,
    Coefficients,
    coefficients_of,
    with_covariance,
    with_draws,
    with_joint_covariance,
)
from eaid.uncertainty.level_statistics import LevelStatistics, curve_degrees, curves
from eaid.uncertainty.student_t import Degrees, middle, t_quantile
from eaid.uncertainty.twostage import two_stage
from eaid.uncertainty.weightings import SYMBOLS

PARAMETRISATION = "coefficients of (u/100 %)^k, lowest power first: tau1 [s], tau2 [s], Ts [N·m]; C last where free"
"""What the rows and columns of `nonlinear.covariance.matrix` are."""
ROW = {"tau1": 1, "tau2": 2, "Ts": 0}
"""Where the parameters of the curves stand among a level's (T_s, τ1, τ2)."""


@dataclass(frozen=True, eq=False)
class Estimates:
    """Both estimates with their covariances."""

    joint: Coefficients
    """Its covariance holds the scatter and what separates it from the two-stage estimate."""
    joint_alone: Coefficients
    """The same estimate with the scatter only."""
    two_stage: Coefficients | None
    """None where too few levels determine their own parameters."""
    degrees: Degrees
    """Degrees of freedom of the intervals of τ1, τ2, T_s at the levels, for both."""
    curves: dict[str, Curve]


def estimates(fit: NonlinearFit, stats: LevelStatistics) -> Estimates:
    """The joint fit with its covariance, and the two-stage estimate, both from the same statistics."""
    joint = scattered(fit, stats)
    through = curves(stats)
    degrees: Degrees = dict.fromkeys(ROW, stats.total_degrees)
    degrees |= {name: curve_degrees(stats, curve, name) for name, curve in through.items()}
    if len(through) < len(ROW):
        return Estimates(joint, joint, None, degrees, through)
    duty, theta = stats.duty_pct, stats.log_theta
    variance = {name: np.where(stats.determined[:, k], stats.expected[:, k], np.inf) for name, k in ROW.items()}
    order = [ROW[name] for name in BLOCKS]
    correlation = stats.correlation()[np.ix_(order, order)]
    both = two_stage(duty, {n: theta[:, k] for n, k in ROW.items()}, variance, through, correlation, joint.share)
    both = replace(_swept(both, stats), open=joint.open)
    return Estimates(_apart_counted(joint, both), joint, both, degrees, through)


def scattered(fit: NonlinearFit, stats: LevelStatistics) -> Coefficients:
    """The coefficients of a joint fit with the covariance that the levels' scatter gives them."""
    weights = None if fit.weights is None else np.array(fit.weights)
    shifts = stats.shifts()
    if fit.share_free and shifts.shape[1] == 3:  # C held at single levels
        shifts = np.pad(shifts, ((0, 0), (0, 1), (0, 1)))
    joint = coefficients_of(fit.parameters, fit.share_free)
    joint = replace(joint, open=stats.open_curves())
    return _swept(with_joint_covariance(joint, stats.data, shifts, weights), stats)


def _swept(c: Coefficients, stats: LevelStatistics) -> Coefficients:
    """The coefficients where all levels of a sweep share a shift: each curve goes up and down as a whole."""
    if stats.scatter is None or not stats.swept:
        return c
    covariance = c.covariance.copy()
    for name, k in ROW.items():
        own = c.block(name)
        covariance[own, own] += stats.scatter.common[k] * np.outer(c.values[own], c.values[own])
    return with_covariance(c, covariance)


def _apart_counted(joint: Coefficients, both: Coefficients) -> Coefficients:
    apart = joint.values - np.append(both.values, joint.values[len(both.values) :])
    return with_covariance(joint, joint.covariance + np.outer(apart, apart))


def coefficient_intervals(c: Coefficients, degrees: Degrees) -> dict[str, list[list[float] | None]]:
    """95 % intervals of the coefficients in powers of the duty [%]; None where a constraint holds the parameter."""
    sd = np.sqrt(np.maximum(np.diag(c.covariance), 0))
    result: dict[str, list[list[float] | None]] = {}
    for k, name in enumerate(BLOCKS):
        own = c.block(name)
        scale = 100.0 ** np.arange(c.counts[k])
        reach = t_quantile(middle(degrees[name])) * sd[own]
        low, high = (c.values[own] - reach) / scale, (c.values[own] + reach) / scale
        held = name in (*c.constrained, *c.open) or not np.isfinite(reach).all()
        carried = (c.values[own] != 0) | (reach > 0)  # a power that the levels do not carry is 0, not known to be 0
        result[name] = [
            [float(a), float(b)] if fine and not held else None for a, b, fine in zip(low, high, carried, strict=True)
        ]
    if c.share_free:
        reach = t_quantile(min(middle(df) for df in degrees.values())) * sd[-1]
        ends = [max(0.0, float(c.values[-1] - reach)), min(1.0, float(c.values[-1] + reach))]
        result["C"] = [ends if np.isfinite(reach) else None]
    return result


def level_curves(
    c: Coefficients, degrees: Degrees, levels: tuple[Level, ...], other: Coefficients | None = None
) -> list[dict[str, Any]]:
    """T_s, τ1, τ2 of the curves at each level with 95 % intervals, and how well the torque curve itself is known.

    Where there is another estimate, the distance to it (in logs) counts as one more standard deviation.
    """
    quantiles = {name: np.broadcast_to(t_quantile(np.asarray(df)), len(levels)) for name, df in degrees.items()}
    duty = np.array([level.level for level in levels])
    rows: list[dict[str, Any]] = [{"level": level.level, "ci95": {}} for level in levels]
    for name in ("Ts", "tau1", "tau2"):
        values, sd = c.at(name, duty), c.log_sd(name, duty)
        if other is not None:
            apart = np.log(np.maximum(values, 1e-300) / np.maximum(other.at(name, duty), 1e-12))
            sd = np.where(values > 0, np.hypot(sd, apart), sd)
        with np.errstate(over="ignore"):
            reach = quantiles[name] * sd
            low, high = values * np.exp(-reach), values * np.exp(reach)
        fine = (values > 0) & np.isfinite(low) & np.isfinite(high) & (name not in (*c.constrained, *c.open))
        for i, row in enumerate(rows):
            row[name] = float(values[i])
            row["ci95"][name] = [float(low[i]), float(high[i])] if fine[i] else None
    widest = np.max(list(quantiles.values()), axis=0)
    for row, level, t in zip(rows, levels, widest, strict=True):
        row["torque_half_width_nm"] = float(t * c.torque_sd(_some(level.time_s), level.level).max())
    return rows


def _some(time_s: Array, most: int = 200) -> Array:
    """A few instants of a record, close together where it is young."""
    if len(time_s) <= most:
        return time_s
    return np.asarray(time_s[distinct(np.floor(np.geomspace(1, len(time_s), most))).astype(int) - 1])


def covariance_json(c: Coefficients, degrees: Degrees, source: str) -> dict[str, Any]:
    """What fit.json keeps, so that plants can be drawn."""
    order = [f"{name}[{i}]" for k, name in enumerate(BLOCKS) for i in range(c.counts[k])]
    return {
        "parametrisation": PARAMETRISATION,
        "order": order + ["C"] * c.share_free,
        "matrix": c.covariance.tolist(),
        "degrees_of_freedom": {name: middle(df) for name, df in degrees.items()},
        "from": source,
    }


def with_joint(found: Estimates, draws: Array) -> Estimates:
    """The same estimates, the joint one with the spread of its refits, shape (draws, P)."""
    alone = with_draws(found.joint, draws)
    counted = alone if found.two_stage is None else _apart_counted(alone, found.two_stage)
    return replace(found, joint=counted, joint_alone=alone)


def joint_json(found: Estimates, levels: tuple[Level, ...], ci: str) -> dict[str, Any]:
    """What fit.json holds beside the joint fit: intervals of the coefficients and of the curves, the covariance."""
    other = None if ci == "white" else found.two_stage
    return {
        **intervals_json(found.joint, found.degrees, levels, found.joint_alone, other),
        "covariance": covariance_json(found.joint, found.degrees, ci),
    }


def intervals_json(
    c: Coefficients,
    degrees: Degrees,
    levels: tuple[Level, ...],
    alone: Coefficients | None = None,
    other: Coefficients | None = None,
) -> dict[str, Any]:
    """95 % intervals of coefficients, and of the curves at the levels: `alone`, the distance to `other` counted in."""
    ci95: dict[str, Any] = dict(coefficient_intervals(c, degrees))
    if "C" in ci95:
        ci95["C"] = ci95["C"][0]
    return {"ci95": ci95, "curves": level_curves(c if alone is None else alone, degrees, levels, other)}


def as_fit(found: Estimates, stats: LevelStatistics, held: Sequence[Level] = ()) -> NonlinearFit | None:
    """The two-stage estimate as a fit like the joint one, its errors on held-out levels too; None where there is none.

    It is solved when every level is: the polynomials then follow by weighted least squares.
    """
    both = found.two_stage
    if both is None:
        return None
    p = both.plant()
    left = [nonlinear.step_response(p, level.time_s, level.level) - level.mean for level in stats.levels]
    total = overall(left)
    solver = Solver(
        converged=stats.converged,
        message="converged: each level's own curve did, and the polynomials pass through them by weighted least squares"
        if stats.converged
        else "did not converge: the own curve of a level did not",
        evaluations=0,
        starts=(total.sse,),
        at_bounds=tuple(f"{SYMBOLS[name]} at its limit" for name in both.constrained),
        promise=0.0,
        method="two-stage",
    )
    missed = [nonlinear.step_response(p, one.time_s, one.level) - one.mean for one in held]
    outside = hold_out_row(held, missed, total.rmse)
    return NonlinearFit(
        parameters=p,
        rmse=total.rmse,
        sse=total.sse,
        abs_mean=total.abs_mean,
        abs_sd=total.abs_sd,
        per_level=tuple(level_error(level.level, r) for level, r in zip(stats.levels, left, strict=True)),
        solver=solver,
        warnings=nonlinear_warnings(stats.data, p, solver, [one.level for one in held]),
        hold_out=outside,
    )


def two_stage_json(found: Estimates, fit: NonlinearFit, stats: LevelStatistics, source: str) -> dict[str, Any]:
    """The two-stage estimate, `fit`, as fit.json holds it, under the same keys as the joint one."""
    both = found.two_stage
    assert both is not None
    result: dict[str, Any] = {
        **nonlinear_json(fit),
        "misfit": {name: curve.misfit for name, curve in found.curves.items()},
    }
    if source != "none":
        degrees = found.degrees
        ci95 = coefficient_intervals(both, degrees)
        result |= {
            "ci95": {name: ci95[name] for name in BLOCKS},
            "curves": level_curves(both, degrees, stats.levels),
            "covariance": covariance_json(both, degrees, source),
        }
    return result


def agreement(found: Estimates, stats: LevelStatistics, output_unit: str) -> dict[str, Any]:
    """Where the joint estimate lies outside the two-stage intervals, and which to believe, in words."""
    if found.two_stage is None:
        word = "no two-stage estimate: no level alone determines all of its parameters; the joint fit stands alone"
        return {"disagreements": [], "believe": "joint", "because": word}
    beyond = [_apart(found.joint, found.two_stage, found.degrees[name], name, stats, output_unit) for name in ROW]
    beyond = [one for one in beyond if one["levels"]]
    if not beyond:
        return {"disagreements": [], "believe": "either", "because": "the two estimates agree within their intervals"}
    weak = found.joint.open
    if weak:
        because = (
            f"too few levels determine {' and '.join(SYMBOLS[name] for name in weak)} on their own for a curve through "
            "them, and the joint fit makes up values there that no level supports"
        )
        return {"disagreements": beyond, "believe": "neither", "because": because}
    gain = float(np.sqrt(max(np.nan_to_num(stats.between[0]), 0.0)))
    scattered = f"runs of one level differ by {100 * gain:.2g} % in T_s, and " if gain > 0.002 else ""
    because = (
        f"{scattered}the joint fit makes up for a level's torque with the time constants of its neighbours; "
        "the two-stage fit takes each level's own"
    )
    return {"disagreements": beyond, "believe": "two-stage", "because": because}


def _apart(
    joint: Coefficients, both: Coefficients, degrees: float | Array, name: str, stats: LevelStatistics, unit: str
) -> dict[str, Any]:
    """Where one parameter's two curves part by more than the two-stage interval; the worst level in numbers."""
    duty = stats.duty_pct
    one, other = joint.at(name, duty), both.at(name, duty)
    reach = t_quantile(np.asarray(degrees)) * both.log_sd(name, duty)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.abs(np.log(one / other)) / reach
    out = np.flatnonzero(~(ratio <= 1))
    if not len(out):
        return {"parameter": name, "levels": []}
    i = int(out[np.nan_to_num(ratio[out], nan=np.inf).argmax()])
    low, high = (float(other[i] * np.exp(sign * reach[i])) for sign in (-1, 1))
    said = unit if name == "Ts" else "s"
    ends = f"{said} (a constraint holds it)" if name in both.constrained else f"[{low:.3g}, {high:.3g}] {said}"
    own = f", the level's own fit {np.exp(stats.log_theta[i, ROW[name]]):.3g}" if stats.determined[i, ROW[name]] else ""
    return {
        "parameter": name,
        "levels": duty[out].tolist(),
        "worst": float(duty[i]),
        "joint": float(one[i]),
        "two_stage": float(other[i]),
        "ci95": [low, high],
        "words": (f"{SYMBOLS[name]} at {duty[i]:g}: joint {one[i]:.3g}, two-stage {other[i]:.3g} {ends}{own}"),
    }
