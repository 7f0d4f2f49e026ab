"""Intervals of the nonlinear model: the joint fit and the two-stage one, side by side.

Run-to-run scatter of the gain leaks into the τ curves of the joint fit, and no interval repairs a biased estimate. So
the joint covariance holds, beside the scatter itself, the outer product of what separates the two estimates.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import msgspec
import numpy as np

from eaid.arrays import Array, median
from eaid.findings import Finding, finding
from eaid.fitting.findings import missed, nonlinear_findings
from eaid.fitting.nonlinear import estimate
from eaid.models import nonlinear
from eaid.results.common import Interval, Solver, StartCost
from eaid.results.friction import LevelIntervals
from eaid.results.nonlinear import CoefficientIntervals, Covariance, CurveLevel, Estimate
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
from eaid.uncertainty.levels import CURVES
from eaid.uncertainty.student_t import Degrees, t_quantile
from eaid.uncertainty.twostage import two_stage

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


def estimates(fit: Estimate, stats: LevelStatistics) -> Estimates:
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


def with_intervals(
    estimate: E, c: Coefficients, degrees: Degrees, curves: tuple[CurveLevel, ...], source: str | None = None
) -> E:
    """An estimate with its curves and intervals of its coefficients; with its covariance, where `source` is given."""
    covariance = None if source is None else covariance_part(c, degrees, source)
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
    doubts = nonlinear_findings(p, solver, {}, [one.level for one in held_out])
    doubts += [finding("two-stage-held", "nonlinear", parameter=name) for name in both.constrained]
    doubts += missed("nonlinear", stats.data, left, part)
    misfit = {name: curve.misfit if np.isfinite(curve.misfit) else None for name, curve in found.curves.items()}
    part = msgspec.structs.replace(part, C_free=found.joint.share_free, misfit=misfit)
    if source != "none":
        part = with_intervals(part, both, found.degrees, level_curves(both, found.degrees, stats.levels), source)
    return part, doubts
