"""Every parameter of a fit with its 95 % interval, by the way that was asked for, and what is left open.

robust     scatter of whole runs, pooled over levels; coloured residuals by Bartlett windows (the default)
bootstrap  the same, with the variances from refits to resampled runs (or blocks of a single run): a second opinion
white      the textbook: s² (J'J)⁻¹, as if every sample's error were its own
none       no intervals
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import msgspec
import numpy as np

from eaid.arrays import Array, inverse
from eaid.estimate import linear_intervals
from eaid.estimate.adequacy import adequacy
from eaid.estimate.bootstrap import Draws, bootstrap
from eaid.estimate.data import data_of
from eaid.estimate.identifiability import friction_findings, identifiable, linear_findings, scatter_findings
from eaid.estimate.level_statistics import (
    NAMES,
    UNDETERMINED,
    LevelStatistics,
    level_statistics,
    log_jacobian,
    pooled_statistics,
    share_sensitivity,
    statistics_at_share,
)
from eaid.estimate.levels import fit_levels
from eaid.estimate.nonlinear import nonlinear_part, solved
from eaid.estimate.rig_noise import idle_of, noise_of
from eaid.estimate.runs import t_quantile, textbook
from eaid.estimate.share import Share, share_findings, share_of, share_part
from eaid.findings import Finding, finding, ranked
from eaid.models.parameters import SHARE
from eaid.models.trends import FORMS
from eaid.options import FitOptions
from eaid.results.common import Interval
from eaid.results.fit import Adequacy, Fit, Friction, FrictionLevel, LevelIntervals, Linear, Trend, Uncertainty
from eaid.steps.stepset import StepSet


@dataclass(frozen=True, eq=False)
class Parameter:
    """One parameter of one level: its interval, or why there is none."""

    name: str
    value: float
    interval: tuple[float, float] | None
    """95 % interval; None where it is constrained or open."""
    log_sd: float
    """Standard deviation of its logarithm (of its logit, for C)."""
    open: bool = False
    """Whether the data do not determine it."""


def level_rows(stats: LevelStatistics, white: bool = False) -> list[list[Parameter]]:
    """The parameters of every level with their intervals; the textbook's where `white`."""
    return [_white_parameters(stats, i) if white else level_parameters(stats, i) for i in range(len(stats.levels))]


def level_parameters(stats: LevelStatistics, i: int) -> list[Parameter]:
    """Intervals exp(θ̂ ± t √V) of one level.

    Where the record leaves τ2 open, those of T_s and τ1 reach over all that go with a τ2 that the runs allow.
    """
    one, result = stats.estimates[i], []
    for k, theta in enumerate(one.runs.log_theta.tolist()):
        name, t = NAMES[k], t_quantile(float(stats.degrees[i, k]))
        sd = float(np.sqrt(max(stats.variance[i, k], 0.0)))
        low, high = theta - t * sd, theta + t * sd
        if k < 2 and stats.open_tau2[i] and np.isfinite(stats.tau2_sets.log_theta[i, k]).all():
            ends = stats.tau2_sets.log_theta[i, k]
            low, high = min(theta, float(ends[0])) - t * sd, max(theta, float(ends[1])) + t * sd
        constrained = name in one.constrained
        undetermined = (k == 2 and not stats.determined[i, 2]) or (
            name != "C" and high - low > 2 * np.log(UNDETERMINED)
        )
        value, first, last = (_natural(name, x) for x in (theta, low, high))
        interval = None if constrained or undetermined else (first, last)
        result.append(Parameter(name, value, interval, sd, open=undetermined and not constrained))
    return result


def _natural(name: str, x: float) -> float:
    with np.errstate(over="ignore"):
        return float(1 / (1 + np.exp(-np.clip(x, -700, 700)))) if name == "C" else float(np.exp(x))


def _white_parameters(stats: LevelStatistics, i: int) -> list[Parameter]:
    """The textbook's intervals θ̂ ± t s of one level, with the variance s² A⁻¹ of the logarithms."""
    one, level = stats.estimates[i], stats.levels[i]
    jacobian = log_jacobian(one.curve, level.time_s, one.share_free)
    information, noise, spare = textbook([jacobian], [level.mean - jacobian[:, 0]], jacobian.shape[1])
    variance = np.diag(inverse(information)) * noise
    rows = []
    for p, v in zip(level_parameters(stats, i), variance.tolist(), strict=True):
        reach = t_quantile(spare) * np.sqrt(v) * (p.value * (1 - p.value) if p.name == "C" else p.value)
        interval = None if p.name in one.constrained else (float(p.value - reach), float(p.value + reach))
        rows.append(Parameter(p.name, p.value, interval, float(np.sqrt(v)), p.open))
    return rows


def level_ci95(part: Friction, rows: Sequence[Sequence[Parameter]]) -> tuple[FrictionLevel, ...]:
    """The levels with the 95 % intervals of their parameters."""
    result = []
    for own, level in zip(rows, part.levels, strict=True):
        ci95 = LevelIntervals(**{p.name: p.interval for p in own})
        if level.C_f is not None and ci95.Ts is not None:
            low, high = (level.C_f * end / level.Ts for end in ci95.Ts)
            ci95 = msgspec.structs.replace(ci95, C_f=(low, high))
        result.append(msgspec.structs.replace(level, ci95=ci95))
    return tuple(result)


def trend_ci95(
    part: Friction, rows: Sequence[Sequence[Parameter]], repeats: bool, degrees: float
) -> tuple[dict[str, Trend], list[Finding]]:
    """The trends with 95 % intervals of their coefficients, and a finding where they have none.

    The coefficients answer to the levels as δc = (G'G)⁻¹ G' δy. The levels' own intervals say how δy scatters; where
    the trend misses the levels by more than that, or each level has one run, the residuals about the trend do.
    """
    result: dict[str, Trend] = {}
    found: list[Finding] = []
    x = np.array(part.x)
    for name, trend in part.trends.items():
        values = np.array([np.nan if one.C_f is None else one.C_f for one in part.levels]) if name == "C_f" else None
        k = {"Ts": 0, "C_f": 0, "tau1": 1, "tau2": 2}[name]
        y = values if values is not None else np.exp([_log(own[k]) for own in rows])
        sd = y * np.array([own[k].log_sd for own in rows])
        ci95, code = _coefficients(trend, x, y, sd if repeats else None, degrees)
        result[name] = msgspec.structs.replace(trend, ci95=ci95)
        if code:
            found.append(finding(code, "friction", parameter=name))
    return result, found


def _log(p: Parameter) -> float:
    return float(np.log(max(p.value, 1e-300)))


def _coefficients(
    trend: Trend, x: Array, y: Array, sd: Array | None, degrees: float
) -> tuple[tuple[Interval, ...] | None, str | None]:
    """Intervals of one trend's coefficients, and the code of their warnings."""
    if trend.at_bounds:
        return None, "trend-not-estimable"
    there = np.isfinite(y)
    x, y = x[there], y[there]
    c = np.array(trend.coefficients)
    G = FORMS[trend.form].gradient(c, x).T
    spare = len(y) - len(c)
    if spare < 1:
        return None, "trend-uses-all-levels"
    scale = 1 / np.maximum(np.sqrt((G**2).sum(axis=0)), 1e-300)
    values = np.linalg.svd(G * scale, compute_uv=False)
    if values[-1] < 1e-7 * values[0]:
        return None, "trend-coefficients-alike"
    solve = scale[:, None] * np.linalg.pinv(G * scale)
    left = y - FORMS[trend.form].curve(c, x)
    about = float(left @ left) / spare
    if sd is None:
        variance, own_degrees = np.full(len(y), about), float(spare)
    else:
        variance, own_degrees = sd[there] ** 2, degrees
        expected = float(variance.sum()) * spare / len(y)
        if about * spare > 2 * expected:  # the trend misses the levels by more than they scatter
            share = variance / expected * spare if expected > 0 else np.ones(len(y))
            variance, own_degrees = share * about, float(spare)
    reach = t_quantile(own_degrees) * np.sqrt((solve**2) @ variance)
    vague = (reach > np.abs(c)).any() and trend.form != "linear"
    ends = tuple((float(a - r), float(a + r)) for a, r in zip(c, reach, strict=True))
    return ends, "trend-coefficients-vague" if vague else None


def with_intervals(
    stepset: StepSet,
    fit: Fit,
    options: FitOptions | None = None,
    advance: Callable[[], None] | None = None,
) -> Fit:
    """The fit, which was made from `stepset`, with its intervals, the believed estimate and what is left open.

    `advance` is called once per bootstrap refit.
    """
    options = options or FitOptions()
    try:
        # curves of τ near 0 or far beyond the record overflow on the way; what is not finite in the end becomes none
        with np.errstate(all="ignore"):
            return _with_intervals(stepset, fit, options, advance)
    except (np.linalg.LinAlgError, ZeroDivisionError, OverflowError) as fault:
        found = (*fit.findings, finding("no-intervals-at-all", "data", fault=str(fault)))
        return msgspec.structs.replace(fit, uncertainty=Uncertainty(options.ci), findings=ranked(found))


def _with_intervals(stepset: StepSet, fit: Fit, options: FitOptions, advance: Callable[[], None] | None) -> Fit:
    fitted = fitted_levels(fit)
    held_out = tuple(level for level in stepset.levels if level.level not in fitted)
    stepset = replace(stepset, levels=tuple(level for level in stepset.levels if level.level in fitted))
    friction = fit.friction or _own_curves(stepset, fit)
    stats = level_statistics(stepset.levels, friction.levels, friction.C is None)
    base, draws, first = stats, None, None
    if friction.C is None and fit.nonlinear is not None:
        base = statistics_at_share(stepset.levels, fit.nonlinear.C)
    if fit.nonlinear is not None:
        first = solved(base.levels, base.data, options.held_share, options.loss, base.swept)
    if options.ci == "bootstrap":
        whole = msgspec.structs.replace(fit, friction=friction)
        draws = bootstrap(stepset.levels, whole, first, options, advance)
        stats, base = (_with_draws(one, draws) for one in (stats, base))
    runs_share = share_of(stats) if options.ci != "none" else None
    found = scatter_findings(stats)
    if runs_share is not None:
        found += share_findings(runs_share)
    judged = None
    if fit.friction is not None:
        judged, more = adequacy(stepset, fit, base, runs_share)
        found += more
    result = msgspec.structs.replace(
        fit, uncertainty=_summary(stats, options, judged, runs_share, idle_of(stepset.runs))
    )
    if fit.friction is not None:
        part, more = _friction(fit.friction, stats, options, stepset)
        result, found = msgspec.structs.replace(result, friction=part), found + more
    if fit.linear is not None:
        linear, more = _linear(fit.linear, base, options, draws)
        result, found = msgspec.structs.replace(result, linear=linear), found + more
    result = msgspec.structs.replace(result, findings=(*fit.findings, *found))
    if first is not None:
        unknowns = None if draws is None else draws.unknowns
        result = nonlinear_part(result, base, first, options, held_out, unknowns)
    return msgspec.structs.replace(result, findings=ranked(result.findings))


def fitted_levels(fit: Fit) -> tuple[float, ...]:
    """Levels that the fit rests on."""
    if fit.friction is not None:
        return tuple(one.level for one in fit.friction.levels)
    if fit.nonlinear is not None:
        return tuple(one.level for one in fit.nonlinear.per_level)
    return tuple(one.level for one in fit.linear.per_level) if fit.linear is not None else ()


def _own_curves(stepset: StepSet, fit: Fit) -> Friction:
    """The levels' own curves, which all intervals stand on, where the friction model was not asked for."""
    share = fit.nonlinear.C if fit.nonlinear is not None else SHARE
    return Friction(share, "level", tuple(fit_levels(data_of(stepset.levels), share)))


def _with_draws(base: LevelStatistics, draws: Draws) -> LevelStatistics:
    """The same statistics with the variances of the refits in place of the linear ones."""
    estimates = []
    for one, v in zip(base.estimates, draws.level_variance, strict=True):
        e = one.runs
        own = v[: len(e.log_theta)]
        if e.repeats > 1:
            factor = np.sqrt(own * e.repeats / np.maximum(e.scatter, 1e-300))
            e = replace(e, influence=e.influence * factor)
        else:
            e = replace(e, within=own)
        estimates.append(replace(one, runs=e))
    return pooled_statistics(base.levels, estimates)


def _friction(
    part: Friction, stats: LevelStatistics, options: FitOptions, stepset: StepSet
) -> tuple[Friction, list[Finding]]:
    found = friction_findings(part, stats, stepset.input_unit, stepset.output_unit)
    part = msgspec.structs.replace(part, identifiable=identifiable(found))
    if options.ci == "none":
        return part, found
    rows = level_rows(stats, white=options.ci == "white")
    repeats = stats.source == "repeats" and options.ci != "white"
    trends, more = trend_ci95(part, rows, repeats, stats.total_degrees)
    return msgspec.structs.replace(part, levels=level_ci95(part, rows), trends=trends), found + more


def _linear(
    part: Linear, base: LevelStatistics, options: FitOptions, draws: Draws | None
) -> tuple[Linear, list[Finding]]:
    pooled = linear_intervals.pooled_intervals(part, base)
    found = linear_findings(part, base, pooled)
    part = msgspec.structs.replace(part, identifiable=identifiable(found))
    if options.ci == "none":
        return part, found
    if options.ci == "white":
        pooled, own = linear_intervals.white(part, base.levels)
    elif draws is not None:
        pooled, own = linear_intervals.from_draws(part, draws.pooled, draws.own, base)
    else:
        own = linear_intervals.level_intervals(part, base)
    rows = tuple(msgspec.structs.replace(row, ci95=ci) for row, ci in zip(part.per_level, own, strict=True))
    bounds = part.bounds
    if bounds is not None:
        bounds = msgspec.structs.replace(bounds, ci95=linear_intervals.bound_intervals(part, own))
    return msgspec.structs.replace(part, ci95=pooled, per_level=rows, bounds=bounds), found


def _summary(
    stats: LevelStatistics, options: FitOptions, judged: Adequacy | None, runs_share: Share | None, idle: float | None
) -> Uncertainty:
    share = None
    if not stats.share_free:
        share = share_part(runs_share, stats, share_sensitivity(stats.levels, stats.estimates))
    return Uncertainty(
        ci=options.ci,
        scatter_from=stats.source,
        degrees_of_freedom=stats.total_degrees,
        run_to_run_pct={
            name: 100 * float(np.sqrt(a)) if np.isfinite(a) else None
            for name, a in zip(NAMES, stats.between, strict=False)
        },
        noise=noise_of(stats, idle),
        draws=options.draws if options.ci == "bootstrap" else None,
        share=share,
        adequacy=judged,
    )
