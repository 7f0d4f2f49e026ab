"""fit.json → gains.json: bounds, B̂, Q, ρ, the verdict on them, PI, margins. One pure function of plain data.

Nothing here reads a file or prints; what is to be doubted is in `warnings`, what cannot be built on raises GainsError.
"""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from eaid.control import robust
from eaid.control.bounds import Bounds, bounds_of, model_of
from eaid.control.lyapunov import Disturbance, error_bound, solve_Q, ultimate_level
from eaid.control.margins import is_stable, linear_lags, pi_feedback, rc_feedback
from eaid.control.mismatch import Mismatch, shown_by_levels, shown_by_logs, shown_by_model
from eaid.control.operating import actuator, loop_margins
from eaid.control.options import DesignOptions
from eaid.control.pi import PIGains
from eaid.control.pi_design import pi_gains, step_metrics
from eaid.control.rc import RCGains
from eaid.errors import GainsError
from eaid.fitting.result import nonlinear_from_json
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
    rc, gains = _robust(model, bounds, options, found, slope_nm_s, warnings)
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


def _robust(
    model: Linear, bounds: Bounds, options: DesignOptions, found: Mapping[str, Mismatch], slope_nm_s: float | None,
    warnings: list[str],
) -> tuple[dict[str, Any], RCGains]:  # fmt: skip
    B_m, B_M = bounds.B_m, bounds.B_M
    pooled = 1 / model.b0
    choices = {"pooled": pooled, "minimax": robust.minimax_B_hat(B_m, B_M)}
    B_hat = choices[options.B_hat] if isinstance(options.B_hat, str) else float(options.B_hat)
    formula, reached = robust.alpha_formula(B_m, B_M), robust.alpha_reached(B_hat, B_m, B_M)
    alpha = formula if options.alpha == "formula" else reached
    if alpha >= 1:
        raise GainsError(
            f"α is {alpha:.4g} with B̂ = {B_hat:.4g}: 1 or more, no ρ covers that; choose B̂ below {2 * B_m:.4g} "
            "(--b-hat minimax)"
        )
    phi = options.phi
    if options.phi_honest_pct is not None:
        phi = robust.phi_of(options.reading, options.phi_honest_pct, B_m, B_M)
    term = robust.uncertainty_term(options.reading, phi, B_m, B_M)
    honest = robust.honest_phi_pct(options.reading, phi, B_m, B_M)
    norm_K = math.hypot(options.K_P, options.K_D)
    rho = robust.rho(options.reading, alpha, options.Q_M, norm_K, term)
    guaranteed = robust.covers(rho, reached, options.Q_M, norm_K, term)
    P = options.p_scale * np.eye(2)
    Q = solve_Q(options.K_P, options.K_D, P)
    natural, damping = robust.frequency_and_damping(options.K_P, options.K_D)
    equal = robust.equal_pi(
        options.K_P, options.K_D, B_hat, rho.constant, options.epsilon, float(Q[0, 1]), float(Q[1, 1])
    )
    back = 1 / equal[0] if options.anti_windup == "back-calculation" else 0.0
    disturbance = Disturbance(
        alpha=reached, n0=reached * options.Q_M + term, n1=reached * norm_K, rho0=rho.constant, rho1=rho.slope,
        epsilon=options.epsilon,
    )  # fmt: skip
    bound = error_bound(ultimate_level(disturbance, P, Q), Q)
    need = least_phi_pct(found)
    phi_holds = None if need is None else bool(need.pct <= honest * (1 + 1e-9))
    q_holds = None if slope_nm_s is None else bool(slope_nm_s <= options.Q_M * (1 + 1e-9))
    if not guaranteed:
        warnings.append(
            f"ρ does not cover the uncertainty: with B̂ = {B_hat:.4g} the α really reached is {reached:.4g}, ρ was made "
            f"with {alpha:.4g}; --b-hat minimax or --alpha reached closes the gap"
        )
    if phi_holds is False and need is not None:
        warnings.append(
            f"φ does not hold: ρ allows |η − η̂| up to {honest:.3g} % duty, the data ask for {need.pct:.3g} % "
            f"({need.where}); --phi data takes it from there"
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
    rc = {
        "K_P": options.K_P,
        "K_D": options.K_D,
        "natural_frequency_rad_s": natural,
        "damping": damping,
        "B_hat": B_hat,
        "B_hat_convention": options.B_hat if isinstance(options.B_hat, str) else "given",
        "B_m": B_m,
        "B_M": B_M,
        "bounds": {"convention": bounds.convention, "levels": list(bounds.levels), "widened": options.widen},
        "alpha": formula,
        "alpha_reached": reached,
        "guaranteed": guaranteed,
        "phi_holds": phi_holds,
        "phi_needed_pct": None if need is None else need.pct,
        "Q_M_holds": q_holds,
        "reference_slope_nm_s": slope_nm_s,
        "Q_M": options.Q_M,
        "phi": phi,
        "phi_honest_pct": honest,
        "rho": {
            "convention": options.reading,
            "alpha": alpha,
            "constant": rho.constant,
            "slope": rho.slope,
            "terms": {"reference_nm_s": rho.reference_term, "phi_nm_s": rho.phi_term},
            "needed": _needed(options.reading, reached, options.Q_M, norm_K, term),
            "readings": {name: _reading(name, alpha, options, norm_K, phi, bounds) for name in ("paper", "textbook")},
        },
        "epsilon": options.epsilon,
        "gamma": options.gamma,
        "P": P.tolist(),
        "Q": Q.tolist(),
        "equal_pi": {"K_P": equal[0], "K_I": equal[1]},
        "anti_windup": {"method": options.anti_windup, "gain": back},
        "ultimate_bound": {"torque_error_nm": bound},
    }
    low, high = options.duty_limits_pct
    gains = RCGains(
        K_P=options.K_P, K_D=options.K_D, B_hat=B_hat, a0=model.a0, b0=model.b0, c0=model.c0,
        rho_constant=rho.constant, rho_slope=rho.slope, epsilon=options.epsilon, gamma=options.gamma,
        Q12=float(Q[0, 1]), Q22=float(Q[1, 1]), duty_min=low, duty_max=high, back_calculation=back,
    )  # fmt: skip
    return rc, gains


def _needed(reading: robust.Reading, alpha: float, Q_M: float, norm_K: float, term: float) -> dict[str, float] | None:
    """Eq. (15) with the α really reached; None where that is 1 or more and no ρ is enough."""
    if alpha >= 1:
        return None
    need = robust.rho(reading, alpha, Q_M, norm_K, term)
    return {"constant": need.constant, "slope": need.slope}


def _reading(
    reading: robust.Reading, alpha: float, options: DesignOptions, norm_K: float, phi: float, bounds: Bounds
) -> dict[str, float]:
    """ρ under one reading with the same number φ, and the φ in % duty that it then means."""
    own = phi
    if options.phi_honest_pct is not None:
        own = robust.phi_of(reading, options.phi_honest_pct, bounds.B_m, bounds.B_M)
    term = robust.uncertainty_term(reading, own, bounds.B_m, bounds.B_M)
    made = robust.rho(reading, alpha, options.Q_M, norm_K, term)
    return {
        "phi": own,
        "phi_term_nm_s": term,
        "phi_honest_pct": term * bounds.B_m,
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
