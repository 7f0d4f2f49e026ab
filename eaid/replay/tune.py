"""Gains for a fit, and what they do on its plant: design, search, replay beside the ultimate bound.

One pure function: everything that it reads is handed to it.
"""

from collections.abc import Callable

import msgspec

from eaid.control.bounds import bounds_of, model_of
from eaid.control.defaults import (
    OVERSHOOT_PCT,
    Scales,
    design_options,
    scales_of,
    timing_of,
    with_own_layer,
    with_own_pi,
)
from eaid.control.design import design, least_phi, mismatches
from eaid.control.gains import pi_gains, rc_gains
from eaid.control.guarantee import condition, guarantee
from eaid.control.operating import operating_points
from eaid.control.options import DesignOptions
from eaid.control.plant import plant_of, why_not
from eaid.control.rc import RCGains
from eaid.errors import DataError
from eaid.findings import Finding, finding, ranked
from eaid.models.nonlinear import steady_torque
from eaid.models.parameters import Nonlinear
from eaid.progress import Progress, no_progress
from eaid.replay.controllers import pi_controller, rc_controller
from eaid.replay.noise import noise_of
from eaid.replay.optimize import Search, optimize
from eaid.replay.references import Reference, Signal
from eaid.replay.rig import Rig
from eaid.replay.scenarios import reference_of, replayed
from eaid.results.fit import Fit
from eaid.results.gain_checks import Optimized, Replayed
from eaid.results.gains import Gains, Guarantee
from eaid.results.tuning import TuneOptions
from eaid.steps.stepset import StepSet
from eaid.uncertainty.draw import draw, drawable


def tune(
    fit: Fit,
    options: TuneOptions = TuneOptions(),  # noqa: B008 - frozen
    logs: StepSet | None = None,
    reference: str | Signal | None = None,
    reference_name: str = "",
    progress: Progress = no_progress,
    judge: Callable[[RCGains], float] | None = None,
) -> Gains:
    """`eaid.tune_rc` on what has been read; without a reference the multisine, which Q_M need not cover.

    A search makes `judge` least, a function of the gains above 0, where it is given, else the RMS error. Raises
    GainsError where fit or wishes are not physical, out of reach, or unstable on the linear model, and DataError where
    the fit lacks what is asked for.
    """
    why = why_not(fit, "linear")
    if why and not options.allow_unidentified:
        raise DataError(f"the linear model is not identifiable ({why}); «allow_unidentified» uses it, marked")
    model, plant = model_of(fit), plant_of(fit)
    scales = scales_of(fit, plant)
    given = reference is not None
    dt_s = 1 / timing_of(fit, options).rate_hz
    reference_name = reference_name or (reference if isinstance(reference, str) else "multisine")
    wanted = reference_of(reference or "multisine", dt_s, scales)
    slope = wanted.steepest_nm_s
    bounds = bounds_of(fit, options.bounds_levels, options.widen_bounds)
    shown = least_phi(mismatches(model, bounds, plant, logs, fit.data.input_unit))
    settled = design_options(
        fit, options, scales, slope if given or not scales.paper else None, None if shown is None else shown.pct
    )  # fmt: skip
    settled = with_own_pi(fit, settled, scales)
    if options.epsilon is None and options.gamma is None:
        settled = with_own_layer(fit, settled, scales, bounds, plant)
    findings: list[Finding] = _of_the_rig(fit, scales, settled)
    found = None
    if options.searches:
        settled, found, more = _searched(fit, options, settled, plant, logs, wanted, reference_name, progress, judge)
        findings += more
    gains = design(fit, settled, logs, slope if given else None)
    gains, more = _replayed(gains, plant, wanted, reference_name, given, fit.dead_time_s)
    findings += more
    if why:
        findings.insert(0, finding("fit-not-identifiable", "model", why=why))
    return msgspec.structs.replace(
        gains, options=options, seed=options.seed, optimized=found, unidentified=why or None,
        findings=ranked([*findings, *gains.findings]),
    )  # fmt: skip


def _of_the_rig(fit: Fit, scales: Scales, settled: DesignOptions) -> list[Finding]:
    if scales.paper:
        return []
    return [
        finding(
            "designed-for-rig", "model", input_unit=fit.data.input_unit or "no unit",
            output_unit=fit.data.output_unit or "no unit",
            pace=scales.pace, highest=settled.duty_limits_pct[1],
            overshoot_pct=settled.pi.overshoot_pct or OVERSHOOT_PCT, settling_s=settled.pi.settling_s or 0.0,
        )
    ]  # fmt: skip


def _searched(
    fit: Fit, options: TuneOptions, settled: DesignOptions, plant: Nonlinear | None, logs: StepSet | None,
    wanted: Reference, name: str, progress: Progress, judge: Callable[[RCGains], float] | None,
) -> tuple[DesignOptions, Optimized, list[Finding]]:  # fmt: skip
    """The options that the search ends at, and what it traded."""
    if plant is None:
        raise DataError("the fit holds no nonlinear model, which «optimize» replays on; fit clutch data with it")
    findings = []
    noise, source = noise_of(fit, options, logs)
    if source == "supposed":
        findings.append(finding("noise-supposed", "rc", noise=noise))
    drawn = [plant]
    if not drawable(fit):
        findings.append(finding("search-on-fitted-plant", "rc"))
    else:
        several = draw(fit, options.plants or 16, options.seed)
        drawn = list(several.plants)
        findings += several.findings
    search = Search(
        noise_nm=noise, limit_pct=options.chatter_limit, also=options.optimize_also,
        evaluations=options.evaluations or 160, seed=options.seed, judge=judge,
    )  # fmt: skip
    model = model_of(fit)
    bounds = bounds_of(fit, settled.levels, settled.widen)
    points = operating_points(fit, model, plant, bounds, settled.duty_limits_pct)
    with progress("candidates", search.candidates) as tick:
        found = optimize(model, bounds, settled, drawn, points, wanted, search, tick)
    result = Optimized(
        reference=name, plants=len(drawn), noise_nm=noise, noise_source=source, limit_pct=found.limit_pct,
        before=found.start.did, after=found.best.did, also=search.also,
        optimized_for=options.optimize_for, before_cost=found.start.cost, after_cost=found.best.cost,
    )  # fmt: skip
    return found.best.law.options, result, findings


def _replayed(
    gains: Gains, plant: Nonlinear | None, wanted: Reference, name: str, given: bool, dead_time_s: float
) -> tuple[Gains, list[Finding]]:
    """The replayed errors beside the ultimate bound, and the verdict with the slope of what was replayed."""
    if plant is None:
        return gains, [finding("nothing-to-replay-on", "model")]
    rc, pi, part = rc_gains(gains), pi_gains(gains), gains.rc
    assert rc is not None and pi is not None and part is not None and part.ultimate_bound is not None
    assert gains.guarantee is not None
    findings = []
    most, highest = float(wanted.torque_nm.max()), float(steady_torque(plant, plant.u_range[1]))
    if most > highest:
        findings.append(
            finding("reference-beyond-plant", "model", reference=name, asked=most, highest=highest,
                    unit=gains.output_unit)
        )  # fmt: skip
    rig = Rig(delay_samples=round(dead_time_s / wanted.dt_s))
    by_rc, by_pi = (replayed(plant, each, wanted, rig) for each in (rc_controller(rc), pi_controller(pi)))
    slope, Q_M = wanted.steepest_nm_s, part.Q_M
    assert Q_M is not None
    if not given and slope > Q_M * (1 + 1e-9):
        findings.append(finding("slope-above-q-max", "rc", slope=slope, Q_M=Q_M, reference=name))
    bound = msgspec.structs.replace(part.ultimate_bound, replayed_nm=by_rc.max_abs_error_nm)
    return msgspec.structs.replace(
        gains, rc=msgspec.structs.replace(part, ultimate_bound=bound),
        replayed=Replayed(name, slope, wanted.counted_from_s, by_rc, by_pi),
        guarantee=_judged(gains.guarantee, slope),
    ), findings  # fmt: skip


def _judged(verdict: Guarantee, slope: float) -> Guarantee:
    """The verdict with the slope [output/s] of what was replayed."""
    rows = {each.name: each for each in verdict.conditions}
    rows["Q_M"] = condition("Q_M", slope, rows["Q_M"].available, rows["Q_M"].unit)
    return guarantee(tuple(rows.values()))
