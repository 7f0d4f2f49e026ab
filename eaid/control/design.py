"""A fit and settled numbers → gains: the law, the verdict on it, PI, margins, and how far η is from η̂ by the data."""

import itertools
import math
from collections.abc import Mapping, Sequence

import msgspec
import numpy as np

from eaid.arrays import Array
from eaid.control.bounds import Bounds, LevelB, model_of
from eaid.control.margins import is_stable, linear_lags, pi_feedback, rc_feedback
from eaid.control.operating import actuator, loop_margins
from eaid.control.pi import PIGains, pi_gains, step_metrics
from eaid.control.robust import Design, law_of
from eaid.errors import GainsError
from eaid.findings import Finding, finding, ranked
from eaid.models.nonlinear import steady_torque, time_constants
from eaid.models.parameters import Linear, Nonlinear
from eaid.results.fit import Fit
from eaid.results.gains import (
    PI,
    AntiWindup,
    AskedPI,
    Condition,
    Gains,
    Guarantee,
    LinearModel,
    Mismatch,
    PhiFromData,
    Robust,
)
from eaid.steps.stepset import StepSet

WITHIN = 1e-9
"""Share by which the needed may exceed the available: rounding."""


def condition(name: str, needed: float | None, available: float | None, unit: str) -> Condition:
    """One condition; it cannot be told where one of the two is not known."""
    known = needed is not None and available is not None
    holds = None if needed is None or available is None else bool(needed <= available * (1 + WITHIN))
    return Condition(name, holds if known else None, needed, available, unit)


def guarantee(conditions: Sequence[Condition]) -> Guarantee:
    """It holds where every condition does; it cannot be told where none fails and one is not known."""
    verdicts = [each.holds for each in conditions]
    holds = False if False in verdicts else None if None in verdicts else True
    return Guarantee(holds, tuple(conditions))


WINDOW_S = 0.1
"""Slopes of logs are straight lines through this much time."""
FEWEST = 3
"""Samples of such a line, at least."""
DUTIES = 19
INSTANTS = 200


def distance(left_pct: Array, slope: Array, B_m: float, B_M: float) -> Array:
    """Signed distance of u − η̂(T) [% duty] from B Ṫ over B in [B_m, B_M]; slope in N·m/s, shapes alike."""
    low, high = np.minimum(B_m * slope, B_M * slope), np.maximum(B_m * slope, B_M * slope)
    return np.maximum(left_pct - high, 0.0) + np.minimum(left_pct - low, 0.0)


def shown_by_model(plant: Nonlinear, model: Linear, B_m: float, B_M: float, unit: str = "%") -> Mismatch:
    """Over the nonlinear model's steps between identified duties and from rest."""
    duties = np.linspace(*plant.u_range, DUTIES)
    tau1, tau2 = time_constants(plant, duties)
    steady = steady_torque(plant, duties)
    shown = []
    for duty, fast, slow, end in zip(duties, tau1, tau2, steady, strict=True):
        t = np.concatenate([[0.0], np.geomspace(1e-3, 5 * slow, INSTANTS)])
        first, second = np.exp(-t / fast), np.exp(-t / slow)
        start = np.concatenate([[0.0], steady])[:, None]
        torque = end + (start - end) * (plant.C * first + (1 - plant.C) * second)
        slope = (end - start) * (plant.C / fast * first + (1 - plant.C) / slow * second)
        found = distance(duty - (model.a0 * torque - model.c0) / model.b0, slope, B_m, B_M)
        i, k = np.unravel_index(np.abs(found).argmax(), found.shape)
        origin = "rest" if i == 0 else f"{duties[i - 1]:.3g} {unit}"
        shown.append((float(found[i, k]), f"{t[k]:.3g} s after a step from {origin} to {duty:.3g} {unit}"))
    return _largest(shown)


def _largest(shown: list[tuple[float, str]]) -> Mismatch:
    """The largest of signed mismatches and where they are; none where nothing is shown."""
    value, where = max(shown, key=lambda each: abs(each[0]), default=(0.0, ""))
    return Mismatch(abs(value), value, where if value else "")


def shown_by_logs(stepset: StepSet, model: Linear, B_m: float, B_M: float) -> Mismatch:
    """Over the averaged rising steps of the logs."""
    shown = []
    for level in stepset.levels:
        t, torque, slope = _smoothed(level.time_s, level.mean)
        found = distance(level.level - (model.a0 * torque - model.c0) / model.b0, slope, B_m, B_M)
        k = int(np.abs(found).argmax())
        shown.append((float(found[k]), f"{t[k]:.3g} s after the step to {level.level:.4g} {stepset.input_unit}"))
    return _largest(shown)


def _smoothed(time_s: Array, torque_nm: Array) -> tuple[Array, Array, Array]:
    """Time, torque and slope of straight lines through successive windows, shapes (windows,)."""
    edges = np.searchsorted(time_s, np.arange(time_s[0], time_s[-1], WINDOW_S))
    edges = np.append(edges, len(time_s))
    held = np.diff(edges)
    if np.median(held[held > 0]) < FEWEST:  # sampled too slowly for that: as few as tell a slope
        edges = np.append(np.arange(0, len(time_s), FEWEST), len(time_s))
    rows = []
    for begin, end in itertools.pairwise(edges.tolist()):
        if end - begin < FEWEST:
            continue
        t, y = time_s[begin:end], torque_nm[begin:end]
        centred = t - t.mean()
        rows.append((t.mean(), y.mean(), float(centred @ y / (centred @ centred))))
    table = np.array(rows).reshape(-1, 3)
    return table[:, 0], table[:, 1], table[:, 2]


def shown_by_levels(per_level: Sequence[LevelB], model: Linear, torque_max_nm: float, unit: str = "%") -> Mismatch:
    """Over the single levels' first-order models from 0 to a torque [N·m]; linear in T, so one end is the worst."""
    shown = []
    for row, torque in itertools.product(per_level, (0.0, torque_max_nm)):
        eta = row.a0 * torque * row.B
        where = f"at an output of {torque:.3g} on the model of {row.level:.4g} {unit} alone"
        shown.append((eta - (model.a0 * torque - model.c0) / model.b0, where))
    return _largest(shown)


SHARP = 5.0
"""γε below which the printed switch, Eq. (14), visibly jumps at z = 0."""
PAPER_PI = (21.0, 360.0)


def design(
    fit: Fit, settled: Design, bounds: Bounds, plant: Nonlinear | None, found: Mapping[str, Mismatch],
    slope_nm_s: float | None,
) -> Gains:  # fmt: skip
    """Gains for a fit, with everything that is known about them.

    `found` is what shows how far η is from η̂, `slope_nm_s` the largest slope of a given reference [N·m/s].
    Raises GainsError where the wishes are not physical, out of reach, or unstable on the linear model.
    """
    model, unit, timing = model_of(fit), fit.data.input_unit, settled.timing
    law, rc = law_of(model, bounds, settled)
    need, phi, Q_M = least_phi(found), rc.phi_honest_pct, settled.Q_M
    rc = msgspec.structs.replace(
        rc, phi_holds=None if need is None or phi is None else bool(need.pct <= phi * (1 + WITHIN)),
        phi_needed_pct=None if need is None else need.pct,
        Q_M_holds=None if slope_nm_s is None else bool(slope_nm_s <= Q_M * (1 + WITHIN)),
        reference_slope_nm_s=slope_nm_s,
    )  # fmt: skip
    pi, pi_part, of_pi = _pi(model, settled)
    for name, feedback in (
        ("RC", rc_feedback(law, 1.0, (model.a0 - model.c0) / model.b0)),
        ("PI", pi_feedback(pi)),
    ):
        if not is_stable(feedback, linear_lags(model.b0, model.a0), timing):
            latched = "" if timing.pwm_hz is None else f" with the duty latched at {timing.pwm_hz:g} Hz"
            if timing.delay_s > 0:
                latched += f" behind the dead time of {timing.delay_s:.3g} s that the steps show"
            raise GainsError(
                f"the {name} loop is unstable on the linear model at {timing.rate_hz:g} Hz{latched}; ask for slower "
                "gains"
            )
    reach = actuator(model, law, plant, bounds)
    margins, missed = loop_margins(fit, model, plant, bounds, law, pi, timing)
    verdict = _guarantee(rc, reach.robust_term_pct, reach.span_pct, fit)
    return Gains(
        model=LinearModel(model.a0, model.b0, model.c0), rc=rc, pi=pi_part, input_unit=unit,
        output_unit=fit.data.output_unit, duty_limits_pct=settled.duty_limits_pct, guarantee=verdict, actuator=reach,
        phi_from_data=PhiFromData(**found), margins=margins,
        findings=ranked([*_warnings(rc, verdict, need, unit), *of_pi, *missed]),
    )  # fmt: skip


def mismatches(
    model: Linear, bounds: Bounds, plant: Nonlinear | None, logs: StepSet | None, unit: str = "%"
) -> dict[str, Mismatch]:
    """What shows how far η is from η̂: nonlinear model, logs, single levels; those that the data allow."""
    found = {}
    if plant is not None:
        found["model"] = shown_by_model(plant, model, bounds.B_m, bounds.B_M, unit)
    if logs is not None:
        found["logs"] = shown_by_logs(logs, model, bounds.B_m, bounds.B_M)
    if bounds.rows:
        found["levels"] = shown_by_levels(bounds.rows, model, max(row.gain for row in bounds.rows), unit)
    return found


def least_phi(found: Mapping[str, Mismatch]) -> Mismatch | None:
    """The φ that the data ask for: the larger of model and logs; the single levels' where there is neither."""
    shown = [found[name] for name in ("model", "logs") if name in found] or list(found.values())
    return max(shown, key=lambda mismatch: mismatch.pct, default=None)


def _guarantee(rc: Robust, asked: float | None, span: float | None, fit: Fit) -> Guarantee:
    """Everything that the argument needs; the reference's slope is not known before one is given."""
    unit, out = fit.data.input_unit, fit.data.output_unit
    needed = None if rc.rho.needed is None else rc.rho.needed.constant
    return guarantee(
        [
            Condition("rho", rc.guaranteed, needed, rc.rho.constant, f"{out}/s"),
            condition("phi", rc.phi_needed_pct, rc.phi_honest_pct, unit),
            condition("Q_M", rc.reference_slope_nm_s, rc.Q_M, f"{out}/s"),
            condition("duty-limit", asked, span, unit),
            *([Condition("dead-time", False, 0.0, fit.dead_time_s, "s")] if fit.dead_time_s > 0 else []),
        ]
    )


def _warnings(rc: Robust, verdict: Guarantee, need: Mismatch | None, unit: str) -> list[Finding]:
    findings, sharpness = [], rc.gamma * rc.epsilon
    asked = next(each for each in verdict.conditions if each.name == "duty-limit")
    if not rc.guaranteed:
        findings.append(finding("rho-not-covered", "rc", B_hat=rc.B_hat, reached=rc.alpha_reached, made=rc.rho.alpha))
    if rc.phi_holds is False and need is not None:
        findings.append(
            finding("phi-exceeded", "rc", allowed=rc.phi_honest_pct, needed=need.pct, where=need.where, unit=unit)
        )
    if rc.Q_M_holds is False:
        findings.append(
            finding("slope-above-q-max", "rc", slope=rc.reference_slope_nm_s, Q_M=rc.Q_M, reference="reference")
        )
    if sharpness < SHARP:
        findings.append(finding("switch-jumps", "rc", sharpness=sharpness, least=SHARP, jump=1 - math.tanh(sharpness)))
    if rc.ultimate_bound is not None and rc.ultimate_bound.torque_error_nm is None:
        findings.append(finding("no-ultimate-bound", "rc"))
    if asked.holds is False:
        findings.append(
            finding("robust-term-beyond-actuator", "rc", asked=asked.needed, span=asked.available, unit=unit)
        )
    return findings


def _pi(model: Linear, settled: Design) -> tuple[PIGains, PI, list[Finding]]:
    asked, how = settled.pi, settled.asked.anti_windup
    if asked.overshoot_pct is not None and asked.settling_s is not None:
        K_P, K_I = pi_gains(model, asked.overshoot_pct, asked.settling_s)
    else:
        K_P, K_I = settled.asked.pi_gains or PAPER_PI
    if not (K_P >= 0 and K_I >= 0 and K_P + K_I > 0):
        raise GainsError(f"PI gains {K_P:g} and {K_I:g}: neither may be negative, nor both 0")
    overshoot_pct, settling_s = step_metrics(model, K_P, K_I)
    findings, papers = [], asked == AskedPI() and settled.asked.pi_gains is None
    if papers and (overshoot_pct > 1.5 or settling_s > 0.3):
        findings.append(finding("paper-pi-misses", "pi", overshoot_pct=overshoot_pct, settling_s=settling_s))
    back = 1 / K_P if how == "back-calculation" and K_P > 0 else 0.0
    part = PI(
        K_P, K_I, overshoot_pct, settling_s if math.isfinite(settling_s) else None,
        None if asked == AskedPI() else asked, AntiWindup(how, back),
    )  # fmt: skip
    return PIGains(K_P, K_I, *settled.duty_limits_pct, back), part, findings
