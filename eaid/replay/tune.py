"""Gains for a fit, and what they do on its plant: the design, its replay beside the ultimate bound."""

from dataclasses import replace

import msgspec

from eaid.control.defaults import Scales, design_options, quickest_pi, scales_of, timing_of, workable_rc
from eaid.control.design import design, least_phi, mismatches, pi_of
from eaid.control.gains import bounds_of, model_of, pi_gains, plant_of, rc_gains
from eaid.control.margins import operating_points
from eaid.control.pi import PAPER_PI, step_metrics
from eaid.errors import DataError
from eaid.findings import Finding, finding, ranked
from eaid.models.nonlinear import steady_torque
from eaid.models.parameters import Nonlinear
from eaid.options import Rig, TuneOptions
from eaid.replay.controllers import Controller, pi_controller, rc_controller
from eaid.replay.loop import replay
from eaid.replay.plant import plant_parameters
from eaid.replay.references import Reference, Signal, reference_of
from eaid.results.fit import Fit
from eaid.results.gains import Gains, Replayed, Tracking


def tune(
    fit: Fit,
    options: TuneOptions = TuneOptions(),  # noqa: B008 - frozen
    reference: str | Signal | None = None,
    reference_name: str = "",
) -> Gains:
    """`eaid.tune_rc` on what has been read; without a reference the multisine, which Q_M need not cover.

    Raises GainsError where fit or wishes are not physical, out of reach, or unstable on the linear model, and DataError
    where the fit lacks what is asked for.
    """
    why = fit.verdict.of("linear").sentence
    if why and not options.anyway:
        raise DataError(f"the fit is NOT USABLE: {why}; «anyway» makes gains of it all the same, marked")
    model, plant = model_of(fit), plant_of(fit)
    scales, unit = scales_of(fit, plant), fit.data.input_unit
    given, name = reference is not None, reference_name or (reference if isinstance(reference, str) else "multisine")
    wanted = reference_of(reference or "multisine", timing_of(fit, options).step_s, scales)
    slope = wanted.steepest_nm_s
    bounds = bounds_of(fit)
    mismatch = mismatches(model, bounds, plant, unit)
    shown = least_phi(mismatch)
    settled = design_options(
        fit, options, scales, slope if given or not scales.paper else None, None if shown is None else shown.pct
    )  # fmt: skip
    points = operating_points(plant, model, bounds.rows, fit.data.levels, settled.duty_limits_pct)
    if options.pi_gains is None and options.pi_overshoot is None:
        settled = replace(settled, pi=quickest_pi(model, points, settled.timing, scales.pace, unit))
    tuned = workable_rc(model, settled, scales, bounds, points, pi_of(model, settled))
    gains = design(fit, tuned, bounds, plant, points, mismatch, slope, name, given)
    findings: list[Finding] = []
    if not scales.paper:
        findings.append(
            finding(
                "designed-for-rig", "model", input_unit=fit.data.input_unit or "no unit",
                output_unit=fit.data.output_unit or "no unit", pace=scales.pace, highest=settled.duty_limits_pct[1],
                overshoot_pct=settled.pi.overshoot_pct or 0.0, settling_s=settled.pi.settling_s or 0.0,
            )
        )  # fmt: skip
    elif tuned != settled:
        findings.append(
            finding("rc-slowed", "rc", epsilon=tuned.epsilon, K_P=tuned.K_P, K_D=tuned.K_D, loop=settled.timing.words())
        )
    if plant is None:
        findings.append(finding("nothing-to-replay-on", "model"))
    else:
        gains, more = _replayed(fit, gains, plant, wanted, name, scales)
        findings += more
    if why:
        findings.insert(0, finding("fit-not-usable", "model", why=why))
    return msgspec.structs.replace(
        gains, options=options, seed=options.seed, not_usable=why or None,
        findings=ranked([*findings, *gains.findings]),
    )  # fmt: skip


def _replayed(
    fit: Fit, gains: Gains, plant: Nonlinear, wanted: Reference, name: str, scales: Scales
) -> tuple[Gains, list[Finding]]:
    """The replayed errors."""
    rc, pi = rc_gains(gains), pi_gains(gains)
    assert rc is not None and pi is not None and gains.margins is not None
    timing, findings = gains.margins.timing, []
    most, highest = float(wanted.torque_nm.max()), float(steady_torque(plant, plant.u_range[1]))
    if most > highest:
        findings.append(
            finding("reference-above-plant", name, asked=most, highest=highest, unit=gains.output_unit)
        )  # fmt: skip
    flat, rig = plant_parameters(plant), Rig(delay_samples=timing.delay_samples)

    def errors(controller: Controller) -> Tracking:
        trace = replay(flat, controller, wanted.torque_nm, rig, wanted.dt_s)
        return trace.tracking(slice(wanted.begin, None))

    by_rc, by_pi, by_paper = errors(rc_controller(rc)), errors(pi_controller(pi)), None
    if scales.paper and (pi.K_P, pi.K_I) != PAPER_PI:
        by_paper = errors(pi_controller(pi._replace(K_P=PAPER_PI[0], K_I=PAPER_PI[1])))
        overshoot_pct, settling_s = step_metrics(model_of(fit), *PAPER_PI)
        findings.append(
            finding("paper-pi", "pi", overshoot_pct=overshoot_pct, settling_s=settling_s, unit=gains.output_unit,
                    error=by_paper.max_abs_error_nm)
        )  # fmt: skip
    errors_of = Replayed(name, wanted.steepest_nm_s, wanted.counted_from_s, by_rc, by_pi, by_paper)
    return msgspec.structs.replace(gains, replayed=errors_of), findings
