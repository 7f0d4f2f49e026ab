"""Gains for a fit, and what they do on its plant: the design, its replay beside the ultimate bound."""

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
from eaid.control.design import condition, design, guarantee, least_phi, mismatches
from eaid.control.gains import pi_gains, plant_of, rc_gains
from eaid.control.robust import Design
from eaid.errors import DataError
from eaid.findings import Finding, finding, ranked
from eaid.models.nonlinear import steady_torque
from eaid.models.parameters import Nonlinear
from eaid.options import Rig, TuneOptions
from eaid.replay.controllers import pi_controller, rc_controller
from eaid.replay.references import Reference, Signal, reference_of, replayed
from eaid.results.fit import Fit
from eaid.results.gains import Gains, Guarantee, Replayed
from eaid.steps.stepset import StepSet


def tune(
    fit: Fit,
    options: TuneOptions = TuneOptions(),  # noqa: B008 - frozen
    logs: StepSet | None = None,
    reference: str | Signal | None = None,
    reference_name: str = "",
) -> Gains:
    """`eaid.tune_rc` on what has been read; without a reference the multisine, which Q_M need not cover.

    Raises GainsError where fit or wishes are not physical, out of reach, or unstable on the linear model, and DataError
    where the fit lacks what is asked for.
    """
    why = fit.verdict.of("linear").why
    if why and not options.anyway:
        raise DataError(f"the fit is NOT USABLE: {why}; «anyway» makes gains of it all the same, marked")
    model, plant = model_of(fit), plant_of(fit)
    scales = scales_of(fit, plant)
    given = reference is not None
    dt_s = 1 / timing_of(fit, options).rate_hz
    reference_name = reference_name or (reference if isinstance(reference, str) else "multisine")
    wanted = reference_of(reference or "multisine", dt_s, scales)
    slope = wanted.steepest_nm_s
    bounds = bounds_of(fit, options.bounds_levels, options.widen_bounds)
    found = mismatches(model, bounds, plant, logs, fit.data.input_unit)
    shown = least_phi(found)
    settled = design_options(
        fit, options, scales, slope if given or not scales.paper else None, None if shown is None else shown.pct
    )  # fmt: skip
    settled = with_own_pi(fit, settled, scales)
    if options.epsilon is None and options.gamma is None:
        settled = with_own_layer(fit, settled, scales, bounds, plant)
    findings: list[Finding] = _of_the_rig(fit, scales, settled)
    gains = design(fit, settled, bounds, plant, found, slope if given else None)
    gains, more = _replayed(gains, plant, wanted, reference_name, given, fit.dead_time_s)
    findings += more
    if why:
        findings.insert(0, finding("fit-not-usable", "model", why=why))
    return msgspec.structs.replace(
        gains, options=options, seed=options.seed, not_usable=why or None,
        findings=ranked([*findings, *gains.findings]),
    )  # fmt: skip


def _of_the_rig(fit: Fit, scales: Scales, settled: Design) -> list[Finding]:
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
