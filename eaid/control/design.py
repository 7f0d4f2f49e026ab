"""fit.json → gains.json: bounds, B̂, Q, ρ, the verdict on them, PI, margins. One pure function of plain data.

Nothing here reads a file or prints; what is to be doubted is in `warnings`, what cannot be built on raises GainsError.
"""

import math
from collections.abc import Mapping
from typing import Any

from eaid.control import robust
from eaid.control.bounds import Bounds, bounds_of, model_of
from eaid.control.law import Law, law_of
from eaid.control.margins import is_stable, linear_lags, pi_feedback, rc_feedback
from eaid.control.mismatch import Mismatch, shown_by_levels, shown_by_logs, shown_by_model
from eaid.control.operating import actuator, loop_margins
from eaid.control.options import DesignOptions
from eaid.control.pi import PIGains
from eaid.control.pi_design import pi_gains, step_metrics
from eaid.errors import GainsError
from eaid.fitting.stored import nonlinear_from_json
from eaid.models.parameters import Linear, Nonlinear
from eaid.steps.stepset import StepSet

SHARP = 5.0
"""γε below which the printed switch, Eq. (14), visibly jumps at z = 0."""
PAPER_PI = (21.0, 360.0)
PAPER = DesignOptions()
"""Table IV and §V-B."""


def design(
    fit: Mapping[str, Any], options: DesignOptions = PAPER, source: str = "fit.json",
    stepset: StepSet | None = None, slope_nm_s: float | None = None,
) -> dict[str, Any]:  # fmt: skip
    """Gains for a fit, with everything that is known about them: the body of gains.json, without schema.

    `stepset` lets the logs speak about φ; `slope_nm_s` is the largest slope of a given reference [N·m/s].
    Raises GainsError where the fit or the wishes are not physical, out of reach, or unstable on the linear model.
    """
    model = model_of(fit, source)
    bounds = bounds_of(fit, source, options.convention, options.levels, options.widen)
    plant = plant_of(fit)
    warnings: list[str] = []
    found = mismatches(model, bounds, plant, stepset)
    law = law_of(model, bounds, options)
    gains = law.gains
    rc = _robust(law, found, slope_nm_s, warnings)
    pi, pi_given = _pi(model, options, warnings)
    limits = options.duty_limits_pct
    for name, feedback in (("RC", rc_feedback(gains, 1.0, (model.a0 - model.c0) / model.b0)), ("PI", pi_feedback(pi))):
        if not is_stable(feedback, linear_lags(model.b0, model.a0), options.timing):
            raise GainsError(
                f"the {name} loop is unstable on the linear model at {options.timing.rate_hz:g} Hz"
                f"{_latched(options)}; ask for slower gains"
            )
    return {
        "model": {"a0": model.a0, "b0": model.b0, "c0": model.c0},
        "rc": rc,
        "pi": pi_given,
        "duty_limits_pct": list(limits),
        "actuator": actuator(model, gains, plant, bounds, warnings),
        "phi_from_data": {name: vars(value) for name, value in found.items()},
        "margins": loop_margins(fit, model, plant, bounds, gains, pi, options.timing, warnings),
        "warnings": warnings,
    }


def plant_of(fit: Mapping[str, Any]) -> Nonlinear | None:
    """The nonlinear model of a fit.json; None where it holds none."""
    return nonlinear_from_json(dict(fit)) if fit.get("nonlinear") else None


def mismatches(model: Linear, bounds: Bounds, plant: Nonlinear | None, stepset: StepSet | None) -> dict[str, Mismatch]:
    """What shows how far η is from η̂: nonlinear model, logs, single levels; those that the data allow."""
    found = {}
    if plant is not None:
        found["model"] = shown_by_model(plant, model, bounds.B_m, bounds.B_M)
    if stepset is not None:
        found["logs"] = shown_by_logs(stepset, model, bounds.B_m, bounds.B_M)
    if bounds.rows:
        highest = max(row["gain"] for row in bounds.rows)
        found["levels"] = shown_by_levels(bounds.rows, model, highest)
    return found


def least_phi_pct(found: Mapping[str, Mismatch]) -> Mismatch | None:
    """The φ that the data ask for: the larger of model and logs; the single levels' where there is neither."""
    shown = [found[name] for name in ("model", "logs") if name in found] or list(found.values())
    return max(shown, key=lambda mismatch: mismatch.pct, default=None)


def _robust(law: Law, found: Mapping[str, Mismatch], slope_nm_s: float | None, warnings: list[str]) -> dict[str, Any]:
    """The `rc` part of gains.json."""
    options, bounds, rho = law.options, law.bounds, law.rho
    natural, damping = robust.frequency_and_damping(options.K_P, options.K_D)
    bound = law.ultimate_bound_nm()
    need = least_phi_pct(found)
    phi_holds = None if need is None else bool(need.pct <= law.phi_honest_pct * (1 + 1e-9))
    q_holds = None if slope_nm_s is None else bool(slope_nm_s <= options.Q_M * (1 + 1e-9))
    if not law.guaranteed:
        warnings.append(
            f"ρ does not cover the uncertainty: with B̂ = {law.gains.B_hat:.4g} the α really reached is "
            f"{law.alpha_reached:.4g}, ρ was made with {rho.alpha:.4g}; --b-hat minimax or --alpha reached closes it"
        )
    if phi_holds is False and need is not None:
        warnings.append(
            f"φ does not hold: ρ allows |η − η̂| up to {law.phi_honest_pct:.3g} % duty, the data ask for "
            f"{need.pct:.3g} % ({need.where}); --phi data takes it from there"
        )
    if q_holds is False:
        warnings.append(
            f"Q_M does not hold: the reference rises at up to {slope_nm_s:.4g} N·m/s, Q_M is {options.Q_M:g} N·m/s"
        )
    if options.gamma * options.epsilon < SHARP:
        jump = 1 - math.tanh(options.gamma * options.epsilon)
        warnings.append(
            f"γε is {options.gamma * options.epsilon:.3g}, below {SHARP:g}: the printed switch jumps by {jump:.2g} ρ "
            "at z = 0; eaid takes the jump out, so its law is no longer the printed one"
        )
    if not math.isfinite(bound):
        warnings.append("no ultimate bound on the torque error follows from these gains: V may rise without end")
    return {
        "K_P": options.K_P,
        "K_D": options.K_D,
        "natural_frequency_rad_s": natural,
        "damping": damping,
        "B_hat": law.gains.B_hat,
        "B_hat_convention": options.B_hat if isinstance(options.B_hat, str) else "given",
        "B_m": bounds.B_m,
        "B_M": bounds.B_M,
        "bounds": {"convention": bounds.convention, "levels": list(bounds.levels), "widened": options.widen},
        "alpha": law.alpha,
        "alpha_reached": law.alpha_reached,
        "guaranteed": law.guaranteed,
        "phi_holds": phi_holds,
        "phi_needed_pct": None if need is None else need.pct,
        "Q_M_holds": q_holds,
        "reference_slope_nm_s": slope_nm_s,
        "Q_M": options.Q_M,
        "phi": law.phi,
        "phi_honest_pct": law.phi_honest_pct,
        "rho": {
            "convention": options.reading,
            "alpha": rho.alpha,
            "constant": rho.constant,
            "slope": rho.slope,
            "terms": {"reference_nm_s": rho.reference_term, "phi_nm_s": rho.phi_term},
            "needed": _needed(law),
            "readings": {"paper": _reading("paper", law), "textbook": _reading("textbook", law)},
        },
        "epsilon": options.epsilon,
        "gamma": options.gamma,
        "P": law.P.tolist(),
        "Q": law.Q.tolist(),
        "equal_pi": {"K_P": law.equal_pi[0], "K_I": law.equal_pi[1]},
        "anti_windup": {"method": options.anti_windup, "gain": law.gains.back_calculation},
        "ultimate_bound": {"torque_error_nm": bound},
    }


def _needed(law: Law) -> dict[str, float] | None:
    """Eq. (15) with the α really reached; None where that is 1 or more and no ρ is enough."""
    if law.alpha_reached >= 1:
        return None
    need = robust.rho(law.options.reading, law.alpha_reached, law.options.Q_M, law.norm_K, law.phi_nm_s)
    return {"constant": need.constant, "slope": need.slope}


def _reading(reading: robust.Reading, law: Law) -> dict[str, float]:
    """ρ under one reading with the same number φ, and the φ in % duty that it then means."""
    B_m, B_M, honest = law.bounds.B_m, law.bounds.B_M, law.options.phi_honest_pct
    phi = law.phi if honest is None else robust.phi_of(reading, honest, B_m, B_M)
    term = robust.uncertainty_term(reading, phi, B_m, B_M)
    made = robust.rho(reading, law.rho.alpha, law.options.Q_M, law.norm_K, term)
    return {
        "phi": phi,
        "phi_term_nm_s": term,
        "phi_honest_pct": term * B_m,
        "constant": made.constant,
        "slope": made.slope,
    }


def _pi(model: Linear, options: DesignOptions, warnings: list[str]) -> tuple[PIGains, dict[str, Any]]:
    asked = options.pi.overshoot_pct, options.pi.settling_s
    if asked[0] is not None and asked[1] is not None:
        K_P, K_I = pi_gains(model, asked[0], asked[1])
    else:
        K_P, K_I = options.pi.gains or PAPER_PI
    if not (K_P >= 0 and K_I >= 0 and K_P + K_I > 0):
        raise GainsError(f"PI gains {K_P:g} and {K_I:g}: neither may be negative, nor both 0")
    reached = step_metrics(model, K_P, K_I)
    if asked[0] is None and options.pi.gains is None and (reached.overshoot_pct > 1.5 or reached.settling_s > 0.3):
        warnings.append(
            f"the paper's PI, 21 and 360, gives {reached.overshoot_pct:.3g} % overshoot and {reached.settling_s:.3g} s "
            "on this linear model, not the 1 % and 0.27 s it was meant for; --pi-overshoot 1 --pi-settling 0.27 does"
        )
    low, high = options.duty_limits_pct
    back = 1 / K_P if options.anti_windup == "back-calculation" and K_P > 0 else 0.0
    gains = PIGains(K_P=K_P, K_I=K_I, duty_min=low, duty_max=high, back_calculation=back)
    return gains, {
        "K_P": K_P,
        "K_I": K_I,
        "overshoot_pct": reached.overshoot_pct,
        "settling_s": reached.settling_s,
        "asked": None if asked[0] is None else {"overshoot_pct": asked[0], "settling_s": asked[1]},
        "anti_windup": {"method": options.anti_windup, "gain": back},
    }


def _latched(options: DesignOptions) -> str:
    pwm = options.timing.pwm_hz
    return "" if pwm is None else f" with the duty latched at {pwm:g} Hz"
