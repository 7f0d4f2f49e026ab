"""Intervals of the nonlinear model: the joint fit and the two-stage one, side by side.

Run-to-run scatter of the gain leaks into the τ curves of the joint fit, and no interval repairs a biased estimate. So
the joint covariance holds, beside the scatter itself, the outer product of what separates the two estimates.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import msgspec
import numpy as np

from eaid.arrays import Array, inverse, median
from eaid.findings import Finding, Value, finding
from eaid.fitting.data import fit_findings, missed
from eaid.fitting.nonlinear import estimate
from eaid.fitting.solver import Problem, slsqp
from eaid.models import nonlinear
from eaid.models.parameters import Nonlinear as NonlinearParameters
from eaid.results.common import Interval, Solver, StartCost
from eaid.results.fit import (
    Agreement,
    CoefficientIntervals,
    Covariance,
    CurveLevel,
    Disagreement,
    Estimate,
    Fit,
    LevelIntervals,
    Nonlinear,
)
from eaid.steps.stepset import Level
from eaid.uncertainty.curve import Curve, covariance_between, powers
from eaid.uncertainty.identifiability import identifiable, nonlinear_findings
from eaid.uncertainty.joint import (
    BLOCKS,
    Coefficients,
    coefficients_of,
    curves_apart,
    free_inverse,
    limits_of,
    with_covariance,
    with_draws,
    with_joint_covariance,
    with_white_covariance,
)
from eaid.uncertainty.level_statistics import CURVES, LevelStatistics, curve_degrees, curves
from eaid.uncertainty.runs import Degrees, t_quantile


def two_stage(
    duty_pct: Array,
    log_values: dict[str, Array],
    variance: dict[str, Array],
    curves: dict[str, Curve],
    correlation: Array,
    share: float,
) -> Coefficients:
    """The coefficients from the three curves; where they break a constraint, the best ones that keep all of them.

    `correlation`, shape (3, 3), is that of the scatter of (τ1, τ2, T_s) within a level. Levels that do not determine a
    parameter have an infinite variance there.
    """
    first, second, third = (len(curves[name].coefficients) for name in BLOCKS)
    counts = (first, second, third)
    u_range = (float(duty_pct.min()), float(duty_pct.max()))
    values = np.concatenate([curves[name].coefficients for name in BLOCKS])
    rows, offset = limits_of(counts, u_range)
    if (rows @ values - offset).min() < -1e-12:
        values = _constrained(duty_pct, log_values, variance, counts, rows, offset)
    parts = np.split(values, np.cumsum(counts)[:2])
    raw = [tuple((part / 100.0 ** np.arange(len(part))).tolist()) for part in parts]
    c = coefficients_of(NonlinearParameters(raw[0], raw[1], raw[2], u_range, share))
    covariance = covariance_between([curves[name] for name in BLOCKS], correlation)
    if c.constrained:
        covariance = free_inverse(c, inverse(covariance), len(duty_pct))
    return with_covariance(c, covariance)


def _constrained(
    duty_pct: Array,
    log_values: dict[str, Array],
    variance: dict[str, Array],
    counts: Sequence[int],
    rows: Array,
    offset: Array,
) -> Array:
    """Σ (θ̂ − log p)²/V over all three parameters under the constraints, from constant τ1, τ2 and T_s."""
    design = np.zeros((3 * len(duty_pct), sum(counts)))
    for k, count in enumerate(counts):
        start = sum(counts[:k])
        design[k * len(duty_pct) : (k + 1) * len(duty_pct), start : start + count] = powers(duty_pct, count)
    aim = np.concatenate([log_values[name] for name in BLOCKS])
    weight = 1 / np.sqrt(np.concatenate([np.maximum(variance[name], 1e-18) for name in BLOCKS]))

    def normal(c: Array) -> tuple[float, Array, Array]:
        now = np.maximum(design @ c, 1e-9)
        left = weight * (np.log(now) - aim)
        J = design * (weight / now)[:, None]
        return float(left @ left), 2 * J.T @ left, 2 * J.T @ J

    begin = np.zeros(sum(counts))
    for k, name in enumerate(BLOCKS):
        begin[sum(counts[:k])] = np.exp(np.average(log_values[name], weights=1 / np.maximum(variance[name], 1e-18)))
    begin[0] = max(begin[0], 2e-3)
    begin[counts[0]] = max(begin[counts[0]], 1.5 * begin[0])
    return slsqp(Problem(normal, rows, offset, str), begin).x


PARAMETRISATION = "coefficients of (u/100 %)^k, lowest power first: tau1 [s], tau2 [s], Ts [N·m]; C last where free"
"""What the rows and columns of `nonlinear.covariance.matrix` are."""
ROW = {"tau1": 1, "tau2": 2, "Ts": 0}
"""Where the parameters of the curves stand among a level's (T_s, τ1, τ2)."""

E = TypeVar("E", bound=Estimate)
SAYS_NOTHING = 100.0
"""Factor up and down from which the interval of a curve is left out."""


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


def both_estimates(fit: Estimate, stats: LevelStatistics) -> Estimates:
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


def scattered(fit: Estimate, stats: LevelStatistics) -> Coefficients:
    """The coefficients of a joint fit with the covariance that the levels' scatter gives them."""
    shifts = stats.shifts()
    if fit.C_free and shifts.shape[1] == 3:  # C held at single levels
        shifts = np.pad(shifts, ((0, 0), (0, 1), (0, 1)))
    joint = replace(coefficients_of(fit.parameters, fit.C_free), open=stats.open_curves())
    return _swept(with_joint_covariance(joint, stats.data, shifts), stats)


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


def coefficient_intervals(c: Coefficients, degrees: Degrees) -> CoefficientIntervals:
    """95 % intervals of the coefficients in powers of the duty [%]; None where a constraint holds the parameter."""
    sd = np.sqrt(np.maximum(np.diag(c.covariance), 0))
    found: dict[str, tuple[Interval, ...]] = {}
    for k, name in enumerate(BLOCKS):
        own = c.block(name)
        scale = 100.0 ** np.arange(c.counts[k])
        reach = t_quantile(median(degrees[name])) * sd[own]
        low, high = (c.values[own] - reach) / scale, (c.values[own] + reach) / scale
        held = name in (*c.constrained, *c.open) or not np.isfinite(reach).all()
        carried = (c.values[own] != 0) | (reach > 0)  # a power that the levels do not carry is 0, not known to be 0
        found[name] = tuple(
            (float(a), float(b)) if fine and not held else None for a, b, fine in zip(low, high, carried, strict=True)
        )
    share: Interval = None
    if c.share_free:
        reach = t_quantile(min(median(df) for df in degrees.values())) * sd[-1]
        if np.isfinite(reach):
            share = (max(0.0, float(c.values[-1] - reach)), min(1.0, float(c.values[-1] + reach)))
    return CoefficientIntervals(**found, C=share)


def level_curves(
    c: Coefficients, degrees: Degrees, levels: tuple[Level, ...], other: Coefficients | None = None
) -> tuple[CurveLevel, ...]:
    """T_s, τ1, τ2 of the curves at each level with 95 % intervals, and how well the torque curve itself is known.

    Where there is another estimate, the distance to it (in logs) counts as one more standard deviation. Where τ2 is
    not estimated and stands beyond the record, the share of T_s that it delays is not seen, and T_s has no interval.
    """
    quantiles = {name: np.broadcast_to(t_quantile(np.asarray(df)), len(levels)) for name, df in degrees.items()}
    duty = np.array([level.level for level in levels])
    values: dict[str, list[float]] = {}
    ends: dict[str, list[Interval]] = {}
    for name in CURVES:
        at, sd = c.at(name, duty), c.log_sd(name, duty)
        if other is not None:
            apart = np.log(np.maximum(at, 1e-300) / np.maximum(other.at(name, duty), 1e-12))
            sd = np.where(at > 0, np.hypot(sd, apart), sd)
        with np.errstate(over="ignore"):
            reach = quantiles[name] * sd
            low, high = at * np.exp(-reach), at * np.exp(reach)
        fine = (at > 0) & (reach < np.log(SAYS_NOTHING)) & (name not in (*c.constrained, *c.open))
        if name == "Ts" and "tau2" in (*c.constrained, *c.open):
            fine &= c.at("tau2", duty) <= np.array([level.time_s[-1] for level in levels])
        values[name] = at.tolist()
        ends[name] = [(float(a), float(b)) if ok else None for a, b, ok in zip(low, high, fine, strict=True)]
    widest = np.max(list(quantiles.values()), axis=0).tolist()
    rows = []
    for i, (level, t) in enumerate(zip(levels, widest, strict=True)):
        ci95 = LevelIntervals(**{name: own[i] for name, own in ends.items()})
        width = float(t * c.torque_sd(_some(level.time_s), level.level).max())
        rows.append(
            CurveLevel(level.level, **{k: v[i] for k, v in values.items()}, ci95=ci95, torque_half_width_nm=width)
        )
    return tuple(rows)


def _some(time_s: Array, most: int = 200) -> Array:
    """A few instants of a record, close together where it is young."""
    if len(time_s) <= most:
        return time_s
    return np.asarray(time_s[np.unique(np.floor(np.geomspace(1, len(time_s), most))).astype(int) - 1])


def covariance_part(c: Coefficients, degrees: Degrees, source: str) -> Covariance:
    """What a fit keeps, so that plants can be drawn."""
    order = [f"{name}[{i}]" for k, name in enumerate(BLOCKS) for i in range(c.counts[k])]
    return Covariance(
        PARAMETRISATION,
        (*order, *(["C"] * c.share_free)),
        tuple(tuple(row) for row in c.covariance.tolist()),
        {name: median(df) for name, df in degrees.items()},
        source,
    )


def with_joint(found: Estimates, draws: Array) -> Estimates:
    """The same estimates, the joint one with the spread of its refits, shape (draws, P)."""
    alone = with_draws(found.joint, draws)
    counted = alone if found.two_stage is None else _apart_counted(alone, found.two_stage)
    return replace(found, joint=counted, joint_alone=alone)


def with_intervals(estimate: E, c: Coefficients, degrees: Degrees, curves: tuple[CurveLevel, ...], source: str) -> E:
    """An estimate with its curves, intervals of its coefficients, and their covariance."""
    covariance = covariance_part(c, degrees, source)
    return msgspec.structs.replace(
        estimate, ci95=coefficient_intervals(c, degrees), curves=curves, covariance=covariance
    )


def two_stage_part(
    found: Estimates, stats: LevelStatistics, source: str, held_out: Sequence[Level] = ()
) -> tuple[Estimate, list[Finding]] | None:
    """The two-stage estimate with its intervals, and what is to be doubted of it; None where there is none.

    It is solved when every level is: the polynomials then follow by weighted least squares.
    """
    both = found.two_stage
    if both is None:
        return None
    p = both.plant()
    left = [nonlinear.step_response(p, level.time_s, level.level) - level.mean for level in stats.levels]
    sse = sum(float(r @ r) for r in left)
    said = (
        "converged: each level's own curve did, and the polynomials pass through them by weighted least squares"
        if stats.converged
        else "not converged: the own curve of a level did not"
    )
    solver = Solver(
        method="two-stage",
        converged=stats.converged,
        message=said,
        predicted_decrease=0.0,
        starts=(StartCost(sse),),
        at_bounds=tuple(f"{name}-held" for name in both.constrained),
    )
    part = estimate(p, stats.data, left, solver, held_out)
    doubts = fit_findings(p, solver, {}, [one.level for one in held_out])
    doubts += [finding("two-stage-held", "nonlinear", parameter=name) for name in both.constrained]
    doubts += missed("nonlinear", stats.data, left, part)
    misfit = {name: curve.misfit if np.isfinite(curve.misfit) else None for name, curve in found.curves.items()}
    part = msgspec.structs.replace(part, C_free=found.joint.share_free, misfit=misfit)
    if source != "none":
        part = with_intervals(part, both, found.degrees, level_curves(both, found.degrees, stats.levels), source)
    return part, doubts


OF_THE_JOINT_FIT = ("fit-not-converged", "constraint-holds", "starts-end-apart", "model-explains-little")
"""Codes that are said of the joint fit only, where that is the estimate that stands."""


def believed(
    fit: Fit, base: LevelStatistics, ci: str, estimator: str, held_out: Sequence[Level], draws: Array | None = None
) -> Fit:
    """The fit with intervals of its nonlinear model, the believed estimate in its place and the other beside it."""
    joint = fit.nonlinear
    assert joint is not None
    estimates = both_estimates(joint, base)
    if draws is not None:
        estimates = with_joint(estimates, draws)
    if ci == "white":
        white, spare = with_white_covariance(estimates.joint, base.levels)
        estimates = replace(estimates, joint=white, joint_alone=white, degrees=dict.fromkeys(BLOCKS, spare))
    held_out = held_out if joint.hold_out is not None else ()
    beside = two_stage_part(estimates, base, "none" if ci == "none" else "robust", held_out)
    two_stage, of_two_stage = (None, []) if beside is None else beside

    by_estimate = agreement(estimates, base)
    if ci != "none":
        beyond = None if ci == "white" else estimates.two_stage
        curves = level_curves(estimates.joint_alone, estimates.degrees, base.levels, beyond)
        joint = with_intervals(joint, estimates.joint, estimates.degrees, curves, ci)

    taken, because = chosen(estimator, by_estimate, two_stage)
    findings = _findings(taken, by_estimate, base, estimates.joint.open)
    if taken == "two-stage" and two_stage is not None:
        of_fit = [found for found in fit.findings if found.subject != "nonlinear" or found.code not in OF_THE_JOINT_FIT]
        told = {found.code for found in of_fit if found.subject == "nonlinear"}
        findings += [found for found in of_two_stage if found.code not in told]
        model = Nonlinear.of(two_stage, estimator="two-stage", robust=joint.robust, joint=joint.estimate)
    else:
        of_fit = list(fit.findings)
        model = msgspec.structs.replace(joint, two_stage=two_stage)
    data = fit.data
    left_open = nonlinear_findings(model, base, data.input_unit, data.output_unit, with_levels=fit.friction is None)
    model = msgspec.structs.replace(
        model, because=because, identifiable=identifiable(left_open), agreement=(by_estimate,)
    )
    return msgspec.structs.replace(fit, nonlinear=model, findings=(*of_fit, *left_open, *findings))


def agreement(estimates: Estimates, stats: LevelStatistics) -> Agreement:
    """Where the joint estimate lies outside the two-stage intervals, and which to believe."""
    between, two_stage = ("joint", "two-stage"), estimates.two_stage
    if two_stage is None:
        return Agreement(between, "joint", "alone")
    apart = curves_apart(estimates.joint, two_stage, estimates.degrees, stats.duty_pct)
    if not apart:
        return Agreement(between, "either", "agree")
    weak = estimates.joint.open
    return Agreement(between, "neither" if weak else "two-stage", "weak" if weak else "apart", tuple(apart))


def chosen(estimator: str, agreed: Agreement, two_stage: Estimate | None) -> tuple[str, str]:
    """Which estimate is taken, joint or two-stage, and why: asked, alone, agree, apart or weak."""
    if two_stage is None:
        return "joint", "alone"
    if estimator == "joint":
        return "joint", "asked"
    return ("two-stage" if agreed.believe == "two-stage" else "joint"), agreed.because


def _findings(taken: str, agreed: Agreement, base: LevelStatistics, weak: Sequence[str]) -> list[Finding]:
    """What is to be said of the two estimates: nothing where they agree."""
    if not agreed.disagreements:
        return []
    worst = max(agreed.disagreements, key=_distance)
    low, high = worst.ci95_other or (None, None)
    values: dict[str, Value] = {"worst": worst.worst, "joint": worst.one, "two_stage": worst.other, "low": low}
    if agreed.believe == "neither":
        code = "estimates-part-and-neither-holds"
        extra: dict[str, Value] = {"weak": tuple(weak)}
    else:
        gain = base.between[0]
        code = "two-stage-estimate-taken" if taken == "two-stage" else "two-stage-estimate-is-better"
        extra = {"gain_pct": 100 * float(gain) ** 0.5 if gain > 0 else 0.0}
    return [finding(code, "nonlinear", worst.levels, parameter=worst.parameter, high=high, **values, **extra)]


def _distance(apart: Disagreement) -> float:
    """How far apart two estimates of a parameter are, as a ratio above 1."""
    first, second = abs(apart.one or 0.0), abs(apart.other or 0.0)
    return max(first, second) / max(min(first, second), 1e-300)
