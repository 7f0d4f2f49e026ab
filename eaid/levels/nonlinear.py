"""The nonlinear model of a fit: the estimate that is believed with its intervals, the paper's joint fit beside it.

Which of the two stands as the model is the option «estimator»: auto, or joint. Scatter of the gain between runs leaks
into the τ curves of the joint fit; its intervals count what separates it from the other as one more deviation.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import msgspec
import numpy as np
from scipy.special import fdtri

from eaid.arrays import Array, median
from eaid.estimate.coefficients import map_unknowns, with_intervals
from eaid.estimate.data import Data, Errors, each_level, errors, hold_out, missed
from eaid.estimate.forms import Model
from eaid.estimate.own_level import LAG_OFF, find_exchanged, find_levelled_off, levels_scatter
from eaid.estimate.points import level_residuals
from eaid.estimate.scatter import CURVES, held_parameters
from eaid.estimate.spread import Influence, gains_of, t_quantile
from eaid.findings import Finding, Value, finding
from eaid.levels.adequacy import decays
from eaid.levels.bootstrap import drawn_ends, spread_of
from eaid.levels.certainty import Estimate, single_scores
from eaid.levels.each_level import own_levels
from eaid.levels.friction import HELD_BY, LevelValues, level_findings, quote_each, quote_levels, tau2_open, widen
from eaid.levels.from_steps import Solution, textbook_covariance
from eaid.levels.slow_part import slow_part
from eaid.levels.task import FitTask
from eaid.levels.unseen import leave_levels_out
from eaid.options import FitOptions
from eaid.plant.dynamics import Plant, Step
from eaid.plant.respond import from_rest
from eaid.results import models as results
from eaid.results.common import HoldOut, LevelError, Solver
from eaid.steps.stepset import Level

# Chance to be surpassed from which levels have a time constant each by itself, and from which their curve is less sure
LAG_BEYOND, LAG_WIDER = 0.99, 0.95
SAME_VALUE = 1e-12  # Of ln T_s, by which a level's own value is that of the curve
NO_PART = 1e-3  # Of a value, by which the joint fit's may differ and nothing is said
HOLDING = {"tau2-meets-tau1", "tau2-endless"}  # Constraints that take τ2's freedom, which is T_s's then
# Least and largest ln T_s, ln τ1, ln τ2 of the levels and degrees of freedom, (3, L) each
Ends = tuple[Array, Array, Array]


def with_errors(
    p: Plant, free: bool, total: Errors, rows: Sequence[LevelError], solver: Solver, held: HoldOut | None = None
) -> results.Nonlinear:
    """Ten coefficients with their errors over all, per level, and on held-out levels."""
    return results.Nonlinear(
        tau1=p.tau1,
        tau2=p.tau2,
        Ts=p.Ts,
        Ts_through=p.Ts_through,
        u_range=p.u_range,
        C=p.C,
        C_free=free,
        abs_error=total.abs_error,
        per_level=tuple(rows),
        solver=solver,
        hold_out=held,
        **total.scores,
    )


def of_steps(
    p: Plant, free: bool, data: Data, left: Sequence[Array], solver: Solver, held_out: Sequence[Level]
) -> results.Nonlinear:
    """The same of the mean curves of levels; `left` are the residuals."""
    outputs = [record.y for record in data.records]
    total, rows = errors(outputs, left), each_level(data.u.tolist(), outputs, left)
    rmse = total.scores["rmse"]
    beyond = hold_out(held_out, lambda level: from_rest(p, level.time_s, level.level), rmse)
    return with_errors(p, free, total, rows, solver, beyond)


@dataclass(frozen=True, eq=False)
class Standing:
    """The estimate that stands as the model: its part of the result, unknowns, constraints and intervals."""

    part: results.Nonlinear
    levels: Sequence[Level]
    unknowns: Array  # Of the whole model, (n,)
    held: dict[str, tuple[float, ...]]  # Constraints that hold it, and where
    covariance: Array  # Of the unknowns, (n, n)
    ends: Ends

    @property
    def theta(self) -> Array:
        """T_s, τ1, τ2, C of the model at the levels, (4, L)."""
        return _curves(self.part.parameters, self.levels)

    @property
    def constrained(self) -> tuple[str, ...]:
        """Parameters that a constraint holds somewhere."""
        return tuple(dict.fromkeys(name for code in self.held for name in HELD_BY.get(code, ())))

    @property
    def held_at(self) -> list[tuple[str, ...]]:
        """Parameters that a constraint holds at each level."""
        rows = zip(self.theta.T.tolist(), self.levels, strict=True)
        own = (held_parameters(Step(*row), float(one.time_s[-1]), self.part.C_free) for row, one in rows)
        return [tuple(dict.fromkeys([*self.constrained, *held])) for held in own]

    @property
    def values(self) -> LevelValues:
        """T_s, τ1, τ2 of the model at the levels."""
        return quote_levels(self.levels, self.theta, self.held_at, self.ends)


def nonlinear_part(
    task: FitTask, estimate: Estimate, joint: Solution, draws: Array | None
) -> tuple[results.Nonlinear, LevelValues, list[Finding]]:
    """The model, its values at the levels, findings; `draws` are its refits to resampled runs, (draws, n)."""
    data, options, held_out = task.data, task.options, task.held_out
    levels, model, p = estimate.levels, estimate.model, estimate.plant(options)
    papers_stand, turn = options.estimator == "joint", map_unknowns(model)
    left = level_residuals(_curves(p, levels), data.records)
    part = of_steps(p, model.free_share, data, left, estimate.solved.solver, held_out)
    papers = of_steps(joint.parameters, model.free_share, data, joint.residuals(data), joint.solver, held_out)
    misfit, bent, wider = misfits(estimate, options.through)
    part = msgspec.structs.replace(part, misfit=misfit or None)
    covariance, ends = estimate.influence.covariance(), estimate.intervals(data.u)
    one = Standing(part, levels, estimate.coefficients, estimate.held, covariance, ends)
    one = count_misfits(one, model, {name: misfit[name] for name in wider})
    parts = joint_findings(papers, one, "joint-fit-asked-for-parts" if papers_stand else "joint-fit-parts")
    if papers_stand:
        one = take_joint(papers, joint, estimate)
    if options.ci == "white":
        one = by_textbook(one, estimate)
    covariance = turn @ one.covariance @ turn.T
    if draws is not None:
        one, covariance = take_draws(one, estimate, draws), covariance_of_draws(draws @ turn.T)
    values = own = one.values
    seen = scatter = unseen = None
    told, more = bent_findings(bent), parts
    if not papers_stand:
        own, seen, scatter = own_values(one, estimate, options), estimate.scatter, estimate.level_scatter
        unseen, worse = leave_levels_out(estimate, options)
        more = [*level_scatter_findings(estimate, part), *worse, *parts]
        if (lags := [name for name in bent if name != "Ts"]) and options.ci in ("robust", "none"):
            own = quote_each(own_levels(levels, data, model.share))  # no quadratic follows their time constants
            told = bent_findings(bent, lags, own, values)
    values, shown, solver = own if options.through else values, one.part, one.part.solver
    if options.ci != "none":
        curves = [
            results.CurveLevel(level.level, Ts, tau1, tau2, values.ci95(i))
            for i, (level, (Ts, tau1, tau2)) in enumerate(zip(levels, values.theta[:3].T.tolist(), strict=True))
        ]
        by_name = dict(zip(CURVES, one.ends[2], strict=True))
        shown = with_intervals(one.part, curves, covariance, by_name, one.constrained)
    if solver is not None and not solver.converged:
        told.append(finding("fit-not-converged", "nonlinear", predicted_decrease=solver.predicted_decrease))
    for code, at in one.held.items():
        told.append(finding("constraint-holds", "nonlinear", sorted({*at[:1], *at[-1:]}), constraint=code))
    low, high = one.part.u_range
    if outside := [level.level for level in held_out if not low <= level.level <= high]:
        told.append(finding("held-out-beyond-the-levels", "nonlinear", outside))
    told += missed("nonlinear", data, level_residuals(one.theta, data.records), one.part)
    told += [*level_findings(own, seen, "nonlinear", task.stepset), *open_findings(one.part, own), *more]
    estimator = "joint" if papers_stand else "levels-first"
    shown = msgspec.structs.replace(shown, estimator=estimator, joint=papers, level_scatter=scatter, left_out=unseen)
    return shown, own, told


def own_values(one: Standing, estimate: Estimate, options: FitOptions) -> LevelValues:
    """T_s, τ1, τ2 of the levels, T_s each level's own about the curve."""
    theta, (low, high, degrees) = one.theta, (part.copy() for part in one.ends)
    held, (value, half, known) = one.held_at, estimate.own_Ts
    curve = np.log(np.maximum(theta[0], 1e-300))
    theta[0] = np.where(np.abs(value - curve) < SAME_VALUE, theta[0], np.exp(value))
    if options.ci in ("white", "bootstrap", "none"):  # their widths are those of the curve
        low[0], high[0] = low[0] + value - curve, high[0] + value - curve
        return quote_levels(estimate.levels, theta, held, (low, high, degrees))
    slow, holding, unseen = estimate.slow, bool(HOLDING & {*one.held}), estimate.leaves_slow_part(high[2])
    if unseen or (holding and (estimate.scatter.repeats == 1).all()):  # what noise makes of a run no other run shows
        slow = slow_part(estimate.levels, estimate.solved.steps, estimate.solved.x, tested=False)
    if one.part.C_free or not (slow.endless or tau2_open(one.levels, theta[2], low[2], high[2]) or holding or unseen):
        if estimate.level_scatter > 0:
            beyond = np.maximum(0.5 * (high[0] - low[0]) - estimate.curve_half_width(), 0.0)
            low[0], high[0], degrees[0] = value - half - beyond, value + half + beyond, known
        return quote_levels(estimate.levels, theta, held, (low, high, degrees))
    # T_s with every slow part that is possible, C being held
    least, most = np.log(np.maximum([slow.Ts_low, slow.Ts_high], 1e-300))
    half = estimate.gain_half_width()
    low[0], high[0] = np.minimum(value, least) - half, np.maximum(value, most) + half
    low[1], high[1] = widen(low[1], high[1])
    high[2] = np.inf
    return LevelValues(estimate.levels, theta, held, low, high, degrees)


def count_misfits(one: Standing, model: Model, misfit: Mapping[str, float]) -> Standing:
    """The same, time constants whose curve misses its levels as much less sure as these lie off beyond chance."""
    scale, (low, high, degrees) = np.ones(model.size), (part.copy() for part in one.ends)
    for name, ratio in misfit.items():
        k, factor = CURVES.index(name), float(np.sqrt(ratio))
        scale[model.slices[k]] = factor
        low[k], high[k] = widen(low[k], high[k], factor)
    return replace(one, covariance=one.covariance * np.outer(scale, scale), ends=(low, high, degrees))


def bent_findings(
    bent: Sequence[str], lags: Sequence[str] = (), own: LevelValues | None = None, curve: LevelValues | None = None
) -> list[Finding]:
    """That polynomials are too low, and the level whose time constant they have farthest off its `own`."""
    if not bent:
        return []
    told = finding("polynomials-too-low", "nonlinear", (), parameters=tuple(bent))
    if own is None or curve is None:
        return [told]
    off = np.log(curve.theta[:3] / own.theta[:3])
    k, i = max(((CURVES.index(name), i) for name in lags for i in range(len(own.levels))), key=lambda at: abs(off[at]))
    worst = {"worst": own.levels[i].level, "off_pct": 100 * float(np.expm1(off[k, i])), "lag": CURVES[k]}
    far = abs(off[k, i]) > LAG_OFF
    both = {**told.values, **worst}
    return [msgspec.structs.replace(told, severity="caution" if far else told.severity, values=both)]


def level_scatter_findings(estimate: Estimate, part: results.Nonlinear) -> list[Finding]:
    """Where levels lie off the curve by more than their runs scatter, or the curve explains nothing."""
    found = []
    if nothing := [row for row in part.per_level if row.fit_pct is not None and row.fit_pct < 0]:
        worst = min(nothing, key=lambda row: row.fit_pct or 0.0)
        repeats = bool((estimate.scatter.repeats > 1).any())
        values = {"worst": worst.level, "fit_pct": worst.fit_pct, "repeats": repeats}
        if len(nothing) == len(part.per_level):
            found.append(finding("model-explains-little", "nonlinear", R2=part.R2, fit_pct=part.fit_pct))
        else:
            found.append(finding("curve-misses-levels", "nonlinear", [row.level for row in nothing], **values))
    u = estimate.solved.steps.data.u
    if exchanged := find_exchanged(u, estimate.solved.at.theta[0]):
        return exchanged
    found += (flat := find_flat_levels(estimate, part.through_levels))
    if part.through_levels or (line := estimate.levels_about_curve) is None:
        return found
    curve = np.log(np.maximum(estimate.parameters.steady(u), 1e-300))
    return [*found, *levels_scatter(line, u, estimate.own_Ts[0], curve, by_curve=bool(flat))]


def find_flat_levels(estimate: Estimate, through: bool = False) -> list[Finding]:
    """Where the highest levels have one output, which no cubic follows; T_s(u) may go `through` them."""
    u, Ts, spread = estimate.solved.steps.data.u, estimate.solved.at.theta[0], None
    curve = np.log(np.maximum(estimate.parameters.steady(u), 1e-300))
    if (estimate.scatter.repeats > 1).any():
        spread = float(np.sqrt(median(estimate.gain_scatter.expected[:, 0])))
    return find_levelled_off(u, np.log(np.maximum(Ts, 1e-300)), curve, spread, how="levels" * through)


def by_textbook(one: Standing, estimate: Estimate) -> Standing:
    """The textbook: covariance s² (J'J)⁻¹ with N − P degrees of freedom."""
    data = estimate.solved.steps.data
    covariance, spare = textbook_covariance(data, estimate.model, one.unknowns)
    value, D = estimate.numbers(data.u, one.unknowns)
    reach = t_quantile(spare) * np.sqrt(np.maximum(np.einsum("klp,pq,klq->kl", D, covariance, D), 0.0))
    ends = value - reach, value + reach, np.full(reach.shape, spare)
    return replace(one, covariance=covariance, ends=ends)


def _curves(p: Plant, levels: Sequence[Level]) -> Array:
    """T_s, τ1, τ2, C of a model at the levels, (4, L)."""
    u = np.array([level.level for level in levels])
    return np.array([p.steady(u), *p.time_constants(u), np.full(len(u), p.C)])


def take_joint(part: results.Nonlinear, joint: Solution, estimate: Estimate) -> Standing:
    """The paper's joint fit as the model, by how its unknowns answer to the runs."""
    at, x, model = joint.at, joint.x, estimate.model
    take = joint.steps.M.transpose(1, 0, 2)
    gain, back = gains_of(at.information, estimate.along(at.theta), take, joint.steps.limits.A[list(joint.active)])
    alone = np.zeros((0, model.size))
    if (estimate.scatter.repeats == 1).all():
        gain, alone = 0 * gain, single_scores(take, at.information, at.score, back)
    influence = Influence(gain, estimate.scatter.of_levels, alone @ back, estimate.single_degrees)
    u = joint.steps.data.u
    value, slopes = estimate.numbers(u, x)
    other = estimate.numbers(u, estimate.coefficients)[0]
    variance, degrees = (v.reshape(3, -1) for v in influence.of(slopes.reshape(-1, model.size)).variance())
    reach = t_quantile(degrees) * np.hypot(np.sqrt(variance), value - other)
    apart = x - estimate.coefficients
    covariance = influence.covariance() + np.outer(apart, apart)
    return Standing(part, estimate.levels, x, joint.held, covariance, (value - reach, value + reach, degrees))


def take_draws(one: Standing, estimate: Estimate, draws: Array) -> Standing:
    """The same with intervals from refits to resampled runs."""
    u = estimate.solved.steps.data.u
    near = np.array([estimate.numbers(u, x)[0] for x in draws])
    return replace(one, ends=drawn_ends(estimate.numbers(u, one.unknowns)[0], near, one.ends[2]))


def covariance_of_draws(c: Array) -> Array:
    """Covariance of the coefficients of refits, (draws, P); those that run away (a lost τ2) count by rank."""
    size, middle = spread_of(c), np.median(c, axis=0)
    tame = np.clip(c, middle - 3 * size, middle + 3 * size)
    sd = tame.std(axis=0)
    factor = size / np.where(sd > 0, sd, 1.0)
    return np.asarray(np.cov(tame, rowvar=False) * np.outer(factor, factor))


def misfits(estimate: Estimate, through: bool) -> tuple[dict[str, float], list[str], list[str]]:
    """χ² of the levels about each polynomial over its degrees of freedom, and those where that is beyond chance, T_s
    among them unless it goes `through` the levels; and time constants where it is likely to be."""
    seen = estimate.scatter
    found = {} if estimate.curve.misfit is None else {"Ts": estimate.curve.misfit}
    beyond, wider = ["Ts"] if estimate.curve.widened > 1 and not through else [], list[str]()
    _, slopes = estimate.numbers(seen.duty, estimate.coefficients)
    for k, name in enumerate(CURVES[1:], 1):
        known = seen.usable[:, k] & (seen.repeats > 1)
        part = estimate.model.slices[k]
        spare = int(known.sum()) - (part.stop - part.start)
        if spare > 0:
            of_curve = estimate.influence.of(slopes[k, known]).variance()[0]
            off = seen.shift[known, k] ** 2 / (seen.pooled.expected[known, k] + of_curve)
            found[name] = float(off.sum()) / spare
            by_chance = partial(fdtri, spare, max(seen.degrees / 2, 1.0))
            beyond += [name] if found[name] > by_chance(LAG_BEYOND) else []
            wider += [name] if found[name] > by_chance(LAG_WIDER) else []
    return found, beyond, wider


def open_findings(part: results.Nonlinear, values: LevelValues) -> list[Finding]:
    """Levels too few for the polynomials, parameters that are open at most levels, and a free C."""
    count = len(values.levels)
    found = []
    if count == 1:
        found.append(finding("one-level-nonlinear", "nonlinear", [values.levels[0].level]))
    elif count < 4:
        found.append(finding("few-levels-for-polynomials", "nonlinear", count=count))
    met = values.theta[2] <= values.theta[1] * (1 + 1e-4)
    longest = max(float(level.time_s[-1]) for level in values.levels)
    decaying = {u for u, _ in decays(values.levels)}
    for open_there, name in zip(values.open, CURVES, strict=True):
        if 2 * open_there.sum() > count:
            one = 2 * (met & open_there).sum() > open_there.sum()
            at = [level.level for level, there in zip(values.levels, open_there, strict=True) if there]
            late = "decays" if 2 * len(decaying.intersection(at)) > len(at) else "short-record"
            cause = "one-exponential" if one else late if name == "tau2" else "records"
            said: dict[str, Value] = {"parameter": name, "count": len(at), "of": count, "cause": cause}
            found.append(finding("parameter-unknown-at-half-the-levels", "nonlinear", at, **said, record_s=longest))
    if part.C_free:
        found.append(finding("share-free", "nonlinear", C=part.C))
    return found


def joint_findings(joint: results.Nonlinear, one: Standing, code: str) -> list[Finding]:
    """Where the joint fit's curves leave the intervals of the estimate that is believed: the one that does so most."""
    believed, a, b = one.values, _curves(joint.parameters, one.levels)[:3], one.theta[:3]
    with np.errstate(divide="ignore", invalid="ignore"):
        out = ~((np.log(a) >= believed.low) & (np.log(a) <= believed.high))
    ratio = np.abs(np.log(np.maximum(a, 1e-300) / np.maximum(b, 1e-300)))
    out &= ~(ratio <= NO_PART)  # of records without noise, whose intervals are points
    if not out.any():
        return []
    k, i = np.unravel_index(np.where(out, ratio, -1.0).argmax(), out.shape)
    levels = [level.level for level in one.levels]
    low, high = np.exp([believed.low[k, i], believed.high[k, i]]).tolist()
    low, high = (low, high) if low > 0 and np.isfinite(high) else (None, None)
    worst: dict[str, Value] = {"parameter": CURVES[k], "worst": levels[i], "low": low, "high": high}
    worst |= {"joint": float(a[k, i]), "other": float(b[k, i])}
    at = [level for level, off in zip(levels, out[k], strict=True) if off]
    return [finding(code, "nonlinear", at, **worst)]
