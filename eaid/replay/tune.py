"""Gains for a fit, and what they do on its plant."""

from dataclasses import replace

import msgspec

from eaid.control.defaults import design_options, pi_of, quickest_pi, scales_of, timing_of, workable_rc
from eaid.control.design import guarantee_of, margins_of, phi_needed, robust_of, warnings_of
from eaid.control.gains import bounds_of, model_of, plant_of, rc_law
from eaid.control.margins import known, operating_points
from eaid.control.pi import PAPER_PI, PIGains, step_metrics
from eaid.errors import DataError
from eaid.findings import finding, ranked
from eaid.options import Rig, TuneOptions
from eaid.plant.dynamics import plant_numbers
from eaid.replay.controllers import Controller, feedback
from eaid.replay.loop import replay
from eaid.replay.references import Signal, reference_beyond, reference_of, tracking
from eaid.results.fit import Fit
from eaid.results.gains import PI, AskedPI, Gains, Replayed, Tracking


def tune(
    fit: Fit,
    options: TuneOptions = TuneOptions(),  # noqa: B008 - frozen
    reference: str | Signal | None = None,
    reference_name: str = "",
) -> Gains:
    """`eaid.tune_rc` on what has been read; without a reference the multisine, which Q_M need not cover. GainsError
    where fit or wishes are not physical, out of reach or unstable, DataError where the fit lacks what is asked for."""
    why = fit.verdict.of("linear").sentence
    if why and not options.anyway:
        raise DataError(f"the fit is NOT USABLE: {why}; «anyway» makes gains of it all the same, marked")
    model, plant, bounds = model_of(fit), plant_of(fit), bounds_of(fit)
    scales, unit, output_unit = scales_of(fit, plant), fit.data.input_unit, fit.data.output_unit
    given, name = reference is not None, reference_name or (reference if isinstance(reference, str) else "multisine")
    wanted = reference_of(reference or "multisine", timing_of(fit, options).step_s, scales)
    slope = wanted.steepest_nm_s
    needed_phi = phi_needed(model, bounds, plant)
    settled = design_options(fit, options, scales, slope if given or not scales.paper else None, needed_phi)
    timing, limits = settled.timing, settled.duty_limits_pct
    points = operating_points(plant, model, bounds.rows, fit.data.levels, limits)
    if options.pi_gains is None and options.pi_overshoot is None:
        settled = replace(settled, pi=quickest_pi(model, points, timing, scales.pace, unit))
    pi = pi_of(model, settled)
    tuned = workable_rc(model, settled, scales, bounds, points, pi)
    rc = robust_of(model, bounds, tuned)
    law = rc_law(model, rc, limits)
    judged, findings = margins_of({"rc": law, "pi": pi}, points, timing, unit)
    # a slope that nothing follows says nothing
    verdict = guarantee_of(rc, needed_phi, slope if given or plant is not None else None, limits, fit)
    findings += warnings_of(rc, verdict, unit, "reference" if given else name)
    if options.b_hat is None and rc.B_hat != 1 / model.b0:
        findings.append(finding("b-hat-between-levels", "rc", pooled=1 / model.b0, B_hat=rc.B_hat, B_m=rc.B_m))
    if not scales.paper:
        findings.append(
            finding(
                "designed-for-rig", "model", input_unit=unit or "no unit", output_unit=output_unit or "no unit",
                pace=scales.pace, highest=limits[1], overshoot_pct=settled.pi.overshoot_pct or 0.0,
                settling_s=settled.pi.settling_s or 0.0,
            )
        )  # fmt: skip
    elif tuned != settled:
        findings.append(
            finding("rc-slowed", "rc", epsilon=tuned.epsilon, K_P=tuned.K_P, K_D=tuned.K_D, loop=timing.words())
        )
    replayed = None
    if plant is None:
        findings.append(finding("nothing-to-replay-on", "model"))
    else:
        findings += reference_beyond(wanted, plant_numbers(plant), name, output_unit)
        by_paper, flat, rig = None, plant_numbers(plant), Rig(delay_samples=timing.delay_samples)

        def errors(controller: Controller) -> Tracking:
            columns = replay(flat, controller, wanted.torque_nm, rig, wanted.dt_s)
            return tracking(columns, controller.limits_pct, slice(wanted.begin, None))

        if scales.paper and (pi.K_P, pi.K_I) != PAPER_PI:
            by_paper = errors(feedback(PIGains(*PAPER_PI, *limits)))
            overshoot_pct, settling_s = step_metrics(model, *PAPER_PI)
            findings.append(
                finding("paper-pi", "pi", overshoot_pct=overshoot_pct, settling_s=settling_s, unit=output_unit,
                        error=by_paper.max_abs_error_nm)
            )  # fmt: skip
        by_rc, by_pi = errors(feedback(law)), errors(feedback(pi))
        replayed = Replayed(name, slope, wanted.counted_from_s, by_rc, by_pi, by_paper)
    if why:
        findings.insert(0, finding("fit-not-usable", "model", why=why))
    overshoot_pct, settling_s = step_metrics(model, pi.K_P, pi.K_I)
    asked = None if settled.pi == AskedPI() else settled.pi
    return Gains(
        model=model, rc=msgspec.structs.replace(rc, phi_holds=verdict.conditions[1].holds),
        pi=PI(pi.K_P, pi.K_I, overshoot_pct, known(settling_s), asked), input_unit=unit, output_unit=output_unit,
        duty_limits_pct=limits, guarantee=verdict, margins=judged, replayed=replayed, options=options,
        seed=options.seed, not_usable=why or None, findings=ranked(findings),
    )  # fmt: skip
