"""The nonlinear model of a fit: the estimate that is believed with its intervals, the paper's joint fit beside it.

Which of the two stands as the model is the option «estimator»: auto, or joint. Scatter of the gain between runs leaks
into the τ curves of the joint fit; its intervals count what separates it from the other as one more deviation.
"""

from collections.abc import Sequence
from dataclasses import replace

import msgspec
import numpy as np
from scipy.special import fdtri

from eaid.arrays import Array
from eaid.estimate.certainty import BEYOND_CHANCE, SAYS_NOTHING, Estimate, levels_first
from eaid.estimate.coefficients import (
    Coefficients,
    coefficient_intervals,
    coefficients_of,
    covariance_part,
    from_basis,
)
from eaid.estimate.data import Data, fit_findings, missed
from eaid.estimate.huber import minimise
from eaid.estimate.identifiability import identifiable, nonlinear_findings
from eaid.estimate.joint import estimate as scored
from eaid.estimate.joint import nonlinear_problem
from eaid.estimate.level_statistics import CURVES, LevelStatistics, log_jacobian
from eaid.estimate.points import residuals
from eaid.estimate.runs import Degrees, t_quantile, textbook
from eaid.estimate.spread import Influence, corrected, free_inverse, influence_of
from eaid.findings import Finding, finding
from eaid.models import friction, nonlinear
from eaid.models.parameters import Friction
from eaid.options import FitOptions
from eaid.results import fit as results
from eaid.results.common import Interval
from eaid.steps.stepset import Level

QUOTED_RECORDS = 3.0
"""Record lengths that the interval of τ2 may reach to: where most levels' reach further, none is quoted, for what is
quoted would be what came out short by chance."""
OPEN = float(np.log(3.0))
"""Half-width of the logarithm from which a parameter counts as open at a level."""
OF_THE_SOLUTION = (
    "fit-not-converged", "constraint-holds", "model-explains-little", "held-out-beyond-the-levels",
)  # fmt: skip
"""Codes that are said of the joint fit only, where that is the estimate that stands."""
OF_TAU2_ALONE = ("tau2-open", "tau2-outlasts-record", "no-level-determines-all")
"""Codes of what single levels leave open: not said where the levels together tell it."""
HELD_BY = {
    "tau1-floor": ("tau1",),
    "tau2-meets-tau1": ("tau1", "tau2"),
    "Ts-zero": ("Ts",),
    "tau2-endless": ("tau2",),
}
"""Parameters that a constraint holds: not estimable."""


def solved(levels: Sequence[Level], data: Data, share: float | None, loss: str, swept: bool) -> Estimate:
    """The estimate that is believed, under the loss that was asked for."""

    def left(one: Estimate, on: Data) -> list[Array]:
        theta = np.concatenate([one.at.Ts[None], one.problem.values(one.x)])
        return residuals(theta, on.records)

    return minimise(
        data,
        loss,
        lambda d: levels_first(levels, d, share, swept),
        lambda d, near: levels_first(levels, d, share, swept, near),
        left,
    )[0]


def scores_of(one: Estimate, data: Data, held_out: Sequence[Level]) -> tuple[results.Estimate, list[Finding]]:
    """The estimate with its errors, and its warnings."""
    p = one.parameters
    left = residuals(one.basis.theta(one.coefficients, one.basis.M), data.records)
    part = scored(p, data, left, one.solver, held_out)
    findings = fit_findings(p, one.solver, one.active, [level.level for level in held_out])
    findings += missed("nonlinear", data, left, part)
    return msgspec.structs.replace(part, C_free=one.basis.free_share), findings


def misfits(first: Estimate, base: LevelStatistics) -> tuple[dict[str, float], list[Finding]]:
    """χ² of the levels about each polynomial over its degrees of freedom, and where that is beyond chance."""
    found = {} if first.curve.misfit is None else {"Ts": first.curve.misfit}
    beyond = ["Ts"] if first.curve.widened > 1 else []
    value, slopes = first.numbers(base.duty_pct, first.coefficients)
    for k, name in enumerate(CURVES[1:], 1):
        known = base.determined[:, k] & (base.repeats > 1)
        spare = int(known.sum()) - 1 - first.basis.degrees[k]
        if spare > 0:
            of_curve = first.influence.of(slopes[k, known]).variance()[0]
            off = (base.log_theta[known, k] - value[k, known]) ** 2 / (base.expected[known, k] + of_curve)
            found[name] = float(off.sum()) / spare
            if found[name] > fdtri(spare, max(base.total_degrees / 2, 1.0), BEYOND_CHANCE):
                beyond.append(name)
    return found, [finding("polynomials-too-low", "nonlinear", (), parameters=tuple(beyond))] if beyond else []


def with_intervals(
    part: results.Estimate,
    levels: Sequence[Level],
    c: Coefficients,
    covariance: Array,
    ends: tuple[Array, Array, Array],
    held: Sequence[str],
    source: str,
) -> results.Estimate:
    """An estimate with intervals of its curves and coefficients; `ends`: low, high and degrees of freedom, (3, L) each.

    Where a constraint holds τ2 beyond a record, the share of T_s that it delays is not seen, and T_s has no interval.
    """
    low, high, degrees = ends
    constrained = tuple(dict.fromkeys(name for code in held for name in HELD_BY.get(code, ())))
    p = part.parameters
    u = np.array([level.level for level in levels])
    tau1, tau2 = nonlinear.time_constants(p, u)
    values = dict(zip(CURVES, (nonlinear.steady_torque(p, u), tau1, tau2), strict=True))
    rows = []
    for i, level in enumerate(levels):
        intervals: dict[str, Interval] = {}
        for k, name in enumerate(CURVES):
            fine = name not in constrained and values[name][i] > 0 and high[k, i] - low[k, i] < 2 * SAYS_NOTHING
            fine &= not (name == "Ts" and "tau2" in constrained and tau2[i] > level.time_s[-1])
            intervals[name] = (float(np.exp(low[k, i])), float(np.exp(high[k, i]))) if fine else None
        t = t_quantile(float(degrees[:, i].min()))
        width = float(t * torque_sd(c, covariance, level).max())
        own = {name: float(values[name][i]) for name in CURVES}
        row = results.CurveLevel(level.level, **own, ci95=results.LevelIntervals(**intervals))
        rows.append(msgspec.structs.replace(row, torque_half_width_nm=width))
    by_name: Degrees = dict(zip(CURVES, degrees, strict=True))
    return msgspec.structs.replace(
        part,
        curves=tuple(rows),
        ci95=coefficient_intervals(c, covariance, by_name, constrained),
        covariance=covariance_part(c, covariance, by_name, source),
    )


def torque_sd(c: Coefficients, covariance: Array, level: Level, most: int = 200) -> Array:
    """Standard deviation of the output curve at a few instants of a record, close together where it is young."""
    t = level.time_s
    if len(t) > most:
        t = t[np.unique(np.floor(np.geomspace(1, len(t), most))).astype(int) - 1]
    slopes = log_jacobian(nonlinear.at_duty(c.plant(), level.level), t, c.share_free) @ chain(c, level.level)
    return np.asarray(np.sqrt(np.maximum(((slopes @ covariance) * slopes).sum(axis=1), 0.0)))


def chain(c: Coefficients, u: float) -> Array:
    """∂(ln T_s, ln τ1, ln τ2[, logit C])/∂coefficients at one input, (3 or 4, P)."""
    D = np.zeros((4 if c.share_free else 3, len(c.values)))
    for row, name in enumerate(CURVES):
        own = c.block(name)
        power = (u / 100) ** np.arange(own.stop - own.start)
        D[row, own] = power / max(float(power @ c.values[own]), 1e-12)
    if c.share_free:
        D[3, -1] = 1 / max(c.share * (1 - c.share), 1e-12)
    return D


def white(c: Coefficients, levels: Sequence[Level]) -> tuple[Array, Array, float]:
    """The textbook: covariance s² (J'J)⁻¹, variance of ln T_s, ln τ1, ln τ2 by level, (3, L), and N − P."""
    g = [
        log_jacobian(nonlinear.at_duty(c.plant(), one.level), one.time_s, c.share_free) @ chain(c, one.level)
        for one in levels
    ]
    left = [one.mean - nonlinear.step_response(c.plant(), one.time_s, one.level) for one in levels]
    M, noise, spare = textbook(g, left, len(c.values))
    covariance = free_inverse(M, np.zeros((0, len(M)))) * noise
    D = np.array([chain(c, one.level)[:3] for one in levels])
    return covariance, np.maximum(np.einsum("lkp,pq,lkq->kl", D, covariance, D), 0.0), spare


def of_joint(joint: results.Estimate, data: Data, first: Estimate) -> Influence:
    """How the unknowns of the paper's joint fit answer to the runs."""
    basis, points = first.basis, data.points
    problem = nonlinear_problem(data, basis)
    x = basis.unknowns(joint.parameters)
    theta = basis.theta(x, basis.M)
    curves = [Friction(*one) for one in theta.T.tolist()]
    times = np.broadcast_to(points.t_s, points.y.shape)
    ways = np.array([friction.gradient(curve, t) for curve, t in zip(curves, times, strict=True)])
    weighed, take = ways * points.w[:, None], basis.M.transpose(1, 0, 2)
    held = problem.A[problem.A @ x - problem.b < 1e-7 * (1 + np.abs(problem.b))]
    left = np.array([curve.Ts for curve in curves])[:, None] * ways[:, 0] - points.y
    swept, none = first.swept and bool((first.repeats > 1).all()), np.zeros((0, basis.size))
    found, back = influence_of(weighed, ways, take, first.runs, held, none, first.single_degrees, swept)
    alone = [none]
    for i in np.flatnonzero(first.repeats == 1).tolist():
        own = take[i].T @ weighed[i] @ ways[i].T @ take[i]
        alone.append(corrected(own, back, -take[i].T @ weighed[i] @ left[i])[None])
    return replace(found, singles=np.concatenate(alone) @ back)


def nonlinear_part(
    fit: results.Fit,
    base: LevelStatistics,
    first: Estimate,
    options: FitOptions,
    held_out: Sequence[Level] = (),
    draws: Array | None = None,
) -> results.Fit:
    """The fit with the estimate that stands as its nonlinear model, its intervals, and the joint fit beside it.

    `draws` are unknowns of refits to resampled runs of the estimate that stands, (draws, n).
    """
    joint = fit.nonlinear
    assert joint is not None
    levels, data, basis, ci = base.levels, base.data, first.basis, options.ci
    held_out = held_out if joint.hold_out is not None else ()
    part, findings = scores_of(first, data, held_out)
    misfit, bent = misfits(first, base)
    part = msgspec.structs.replace(part, misfit=misfit or None)
    u, ends = base.duty_pct, first.intervals(base.duty_pct)
    leave_out_tau2(ends, levels)
    wide = ~(0.5 * (ends[1] - ends[0]) <= OPEN)
    for name in (name for code in first.active for name in HELD_BY.get(code, ())):
        wide[CURVES.index(name)] = True
    parts = parted(joint, part, u, ends)
    stands: results.Estimate = part
    unknowns, held, influence = first.coefficients, tuple(first.active), first.influence
    if options.estimator == "joint":
        stands, unknowns = joint.estimate, basis.unknowns(joint.parameters)
        held = tuple(joint.solver.at_bounds) if joint.solver is not None else ()
        influence = of_joint(joint, data, first)
        findings = [one for one in fit.findings if one.subject == "nonlinear" and one.code in OF_THE_SOLUTION]
    value, slopes = first.numbers(u, unknowns)
    turn = from_basis(basis)
    c = coefficients_of(stands.parameters, basis.free_share)
    covariance = turn @ influence.covariance() @ turn.T
    if options.estimator == "joint":
        variance, degrees = (v.reshape(3, -1) for v in influence.of(slopes.reshape(-1, basis.size)).variance())
        other = first.numbers(u, first.coefficients)[0]
        apart = turn @ (unknowns - first.coefficients)
        covariance = covariance + np.outer(apart, apart)
        reach = t_quantile(degrees) * np.hypot(np.sqrt(variance), value - other)
        ends = value - reach, value + reach, degrees
    if draws is not None:
        degrees, near = ends[2], np.log(np.maximum(np.einsum("kln,dn->dkl", basis.rows(u)[:3], draws), 1e-12))
        reach = t_quantile(degrees) * spread_of(near, axis=0)
        ends, covariance = (value - reach, value + reach, degrees), tame_covariance(draws @ turn.T)
    if ci == "white":
        covariance, variance, spare = white(c, levels)
        reach = t_quantile(spare) * np.sqrt(variance)
        ends = value - reach, value + reach, np.full(reach.shape, spare)
    leave_out_tau2(ends, levels)
    if ci != "none":
        stands = with_intervals(stands, levels, c, covariance, ends, held, ci)
    model = results.Nonlinear.of(
        stands,
        estimator="joint" if options.estimator == "joint" else "levels-first",
        robust=joint.robust,
        joint=joint.estimate,
        parts=parts,
    )
    left_open = nonlinear_findings(model, base, fit.data.input_unit, fit.data.output_unit, wide, fit.friction is None)
    model = msgspec.structs.replace(model, identifiable=identifiable(left_open))
    known = {level.level for level, there in zip(levels, wide[2], strict=True) if not there}
    others = [
        one
        for one in fit.findings
        if not (one.subject == "nonlinear" and one.code in OF_THE_SOLUTION)
        and not (one.code in OF_TAU2_ALONE and known.issuperset(one.levels))
    ]
    told = joint_findings(parts, options.estimator)
    return msgspec.structs.replace(fit, nonlinear=model, findings=(*others, *findings, *left_open, *bent, *told))


def leave_out_tau2(ends: tuple[Array, Array, Array], levels: Sequence[Level]) -> None:
    """No end of τ2 where most levels' lie beyond `QUOTED_RECORDS` records."""
    beyond = ends[1][2] > np.log([QUOTED_RECORDS * level.time_s[-1] for level in levels])
    if 2 * beyond.sum() > len(levels):
        ends[1][2] = np.inf


def parted(
    joint: results.Estimate, part: results.Estimate, u: Array, ends: tuple[Array, Array, Array]
) -> tuple[results.Disagreement, ...]:
    """Parameters whose joint curve leaves the intervals of the estimate that is believed; the worst level each."""
    found = []
    curves = [
        (nonlinear.steady_torque(p, u), *nonlinear.time_constants(p, u)) for p in (joint.parameters, part.parameters)
    ]
    for k, name in enumerate(CURVES):
        one, other = (np.asarray(curve[k]) for curve in curves)
        with np.errstate(divide="ignore", invalid="ignore"):
            apart = np.log(one)
            out = np.flatnonzero(~((apart >= ends[0][k]) & (apart <= ends[1][k])))
        if len(out):
            i = int(out[np.abs(np.log(np.maximum(one[out], 1e-300) / np.maximum(other[out], 1e-300))).argmax()])
            low, high = np.exp([ends[0][k, i], ends[1][k, i]]).tolist()
            known = (low, high) if low > 0 and np.isfinite(high) else None
            at = tuple(u[out].tolist())
            found.append(results.Disagreement(name, at, float(u[i]), float(one[i]), float(other[i]), known))
    return tuple(found)


def joint_findings(parts: Sequence[results.Disagreement], estimator: str) -> list[Finding]:
    """Where the joint fit parts from the estimate that is believed: the parameter that does so most."""
    if not parts:
        return []

    def ratio(one: results.Disagreement) -> float:
        first, second = abs(one.one or 0.0), abs(one.other or 0.0)
        return max(first, second) / max(min(first, second), 1e-300)

    worst = max(parts, key=ratio)
    low, high = worst.ci95_other or (None, None)
    code = "joint-fit-asked-for-parts" if estimator == "joint" else "joint-fit-parts"
    values = {"parameter": worst.parameter, "worst": worst.worst, "joint": worst.one, "other": worst.other}
    return [finding(code, "nonlinear", worst.levels, low=low, high=high, **values)]


def spread_of(values: Array, axis: int) -> Array:
    """Standard deviation from the middle 95 % of refits: some run away (a τ2 that a draw lost), and count by rank."""
    low, high = np.quantile(values, [0.025, 0.975], axis=axis)
    return np.asarray((high - low) / 3.92)


def tame_covariance(draws: Array) -> Array:
    """Covariance of refits, (draws, P), those that run away held at three standard deviations."""
    size, middle = spread_of(draws, axis=0), np.median(draws, axis=0)
    near = np.clip(draws, middle - 3 * size, middle + 3 * size)
    sd = near.std(axis=0)
    factor = size / np.where(sd > 0, sd, 1.0)
    return np.asarray(np.cov(near, rowvar=False) * np.outer(factor, factor))
