"""Every parameter of a fit with its 95 % interval, by the way that was asked for, and what is left open.

robust     scatter of whole runs, pooled over levels; coloured residuals by Bartlett windows (the default)
bootstrap  the same, with the variances from refits to resampled runs (or blocks of a single run): a second opinion
white      the textbook: s² (J'J)⁻¹, as if every sample's error were its own
none       no intervals
"""

from collections.abc import Callable
from dataclasses import replace

import msgspec
import numpy as np

from eaid.findings import Finding, finding, ranked
from eaid.fitting.choices import check
from eaid.fitting.data import data_of
from eaid.fitting.levels import fit_levels
from eaid.models.parameters import SHARE
from eaid.results.fit import Fit, FitOptions
from eaid.results.friction import Friction
from eaid.results.linear import Linear
from eaid.results.uncertainty import Adequacy, Uncertainty
from eaid.steps.stepset import StepSet
from eaid.uncertainty import friction_intervals, linear_intervals
from eaid.uncertainty.adequacy import adequacy
from eaid.uncertainty.bootstrap import Draws, bootstrap
from eaid.uncertainty.estimators import believed
from eaid.uncertainty.identifiability import friction_findings, identifiable, linear_findings, scatter_findings
from eaid.uncertainty.level_statistics import LevelStatistics, level_statistics, pooled_statistics, statistics_at_share
from eaid.uncertainty.levels import NAMES, share_sensitivity
from eaid.uncertainty.rig_noise import idle_of, noise_of
from eaid.uncertainty.share import Share, share_findings, share_of, share_part


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
    check(options)
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
    draws = None
    if options.ci == "bootstrap":
        whole = msgspec.structs.replace(fit, friction=friction)
        draws = bootstrap(stepset.levels, whole, options.seed, options.draws, advance)
        stats = _with_draws(stats, draws)
    base = stats
    if friction.C is None and fit.nonlinear is not None:
        base = statistics_at_share(stepset.levels, fit.nonlinear.C)
        base = base if draws is None else _with_draws(base, draws)
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
    if fit.nonlinear is not None:
        result = believed(result, base, options.ci, options.estimator, held_out, None if draws is None else draws.joint)
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
    rows = friction_intervals.level_rows(stats, white=options.ci == "white")
    repeats = stats.source == "repeats" and options.ci != "white"
    trends, more = friction_intervals.trend_ci95(part, rows, repeats, stats.total_degrees)
    return msgspec.structs.replace(part, levels=friction_intervals.level_ci95(part, rows), trends=trends), found + more


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
        there = stats
        if runs_share is not None and runs_share.matters and runs_share.estimate is not None:
            there = statistics_at_share(stats.levels, runs_share.estimate)
        share = share_part(runs_share, there, share_sensitivity(stats.levels, stats.estimates))
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
