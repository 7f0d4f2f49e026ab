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
from eaid.control.noise import white_noise_nm
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

USUAL_NOISE_NM = 0.01
"""Torque noise where no log tells it [N·m], over the paper's torque at 100 %."""


def tune(
    fit: Fit,
    options: TuneOptions = TuneOptions(),  # noqa: B008 - frozen
    logs: StepSet | None = None,
    reference: str | Signal | None = None,
    reference_name: str = "",
    progress: Progress = no_progress,
    judge: Callable[[RCGains], float] | None = None,
) -> Gains:
    """Gains of the robust controller and of a PI for a fit, with one verdict on the guarantee.

    Parameters
    ----------
    fit
        A fit with a linear model; its nonlinear one, where it has one, is what the gains are replayed on.
    options
        What is asked for; what is left out is the paper's on a rig in % duty and N·m, else the rig's own.
    logs
        Logs of the same rig: they speak about φ (`phi="data"`) and about the noise of a search.
    reference
        What Q_M is taken from or judged by: multisine, steps or sweep, at the rig's scale, or time [s] and output of
        the user's own. None: the gains are replayed on the multisine, which Q_M need not cover.
    reference_name
        What the result calls a reference of the user's own.
    judge
        What a search makes least in place of the RMS error, a function of the gains above 0.

    Raises
    ------
    GainsError
        The fit or the wishes are not physical, out of reach, or unstable on the linear model.
    DataError
        The fit lacks what is asked for.
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
    bounds = bounds_of(fit, options.bounds, options.bounds_levels, options.widen_bounds)
    shown = least_phi(mismatches(model, bounds, plant, logs, fit.data.input_unit))
    settled = design_options(
        fit, options, scales, slope if given or not scales.paper else None, None if shown is None else shown.pct
    )  # fmt: skip
    settled = with_own_pi(fit, settled, scales)
    if options.epsilon is None and options.gamma is None:
        settled = with_own_layer(fit, settled, scales, bounds, plant)
    findings: list[Finding] = _of_the_rig(scales, settled)
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


def _of_the_rig(scales: Scales, settled: DesignOptions) -> list[Finding]:
    if scales.paper:
        return []
    return [
        finding(
            "designed-for-rig", "model", input_unit=scales.input_unit or "no unit",
            output_unit=scales.output_unit or "no unit",
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
    bounds = bounds_of(fit, settled.convention, settled.levels, settled.widen)
    points = operating_points(fit, model, plant, bounds, settled.duty_limits_pct)
    with progress("candidates", search.candidates) as tick:
        found = optimize(model, bounds, settled, drawn, points, wanted, search, tick)
    result = Optimized(
        reference=name, plants=len(drawn), noise_nm=noise, noise_source=source, limit_pct=found.limit_pct,
        before=found.start.did, after=found.best.did, also=search.also,
        optimized_for=options.optimize_for, before_cost=found.start.cost, after_cost=found.best.cost,
    )  # fmt: skip
    return found.best.law.options, result, findings


def noise_of(fit: Fit, options: TuneOptions, logs: StepSet | None) -> tuple[float, str]:
    """Noise for the search in the output's unit, and where it comes from."""
    if options.noise_nm is not None:
        return options.noise_nm, "given"
    if logs is not None and logs.output_unit == fit.data.output_unit:
        return white_noise_nm(logs), "logs"
    # The fit keeps a density of the noise at low frequency: an upper bound of what white noise alone would have.
    noise = fit.uncertainty.noise if fit.uncertainty is not None else None
    if noise is not None and noise.sensor_nm2_s and fit.data.sample_rate_hz:
        return float((noise.sensor_nm2_s * fit.data.sample_rate_hz) ** 0.5), "fit"
    return USUAL_NOISE_NM * scales_of(fit, plant_of(fit)).top, "supposed"


def _replayed(
    gains: Gains, plant: Nonlinear | None, wanted: Reference, name: str, given: bool, dead_time_s: float
) -> tuple[Gains, list[Finding]]:
    """The replayed errors beside the ultimate bound, and the verdict with the slope of what was replayed."""
    if plant is None:
        return gains, [finding("nothing-to-replay-on", "model")]
    rc, pi, part = rc_gains(gains), pi_gains(gains), gains.rc
    assert rc is not None and pi is not None and part is not None and part.ultimate_bound is not None
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


def _judged(verdict: Guarantee | None, slope: float) -> Guarantee | None:
    if verdict is None:
        return None
    return guarantee(
        [
            condition(each.name, slope, each.available, each.unit) if each.name == "Q_M" else each
            for each in verdict.conditions
        ]
    )
