"""The gains on the plant they will meet: what the actuator can deliver, and margins around its operating points."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from eaid.control.bounds import Bounds
from eaid.control.margins import (
    ENOUGH_DB,
    ENOUGH_DEG,
    Feedback,
    Lag,
    Margins,
    Timing,
    linear_lags,
    margins,
    pi_feedback,
    rc_feedback,
)
from eaid.control.pi import PIGains
from eaid.control.rc import RCGains
from eaid.models.nonlinear import steady_torque, time_constants
from eaid.models.parameters import Linear, Nonlinear

POINTS = 10
"""Operating points of the margins where the fit names no levels."""


def actuator(
    model: Linear, gains: RCGains, plant: Nonlinear | None, bounds: Bounds, warnings: list[str]
) -> dict[str, Any]:
    """How much of the law the actuator can deliver: B̂ρ(0) against the duty that is left at low, middle, high torque."""
    robust_pct = gains.B_hat * gains.rho_constant
    if plant is not None:
        top = float(steady_torque(plant, plant.u_range[1]))
    elif bounds.rows:
        top = max(row["gain"] for row in bounds.rows)
    else:
        top = (model.b0 * gains.duty_max + model.c0) / model.a0
    rows = []
    for torque in (0.1 * top, 0.5 * top, 0.9 * top):
        held = (model.a0 * torque - model.c0) / model.b0
        up = max(0.0, gains.duty_max - held)
        down = max(0.0, held - gains.duty_min)
        rows.append(
            {
                "torque_nm": torque,
                "eta_hat_pct": held,
                "share_up": min(1.0, up / robust_pct) if robust_pct > 0 else 1.0,
                "share_down": min(1.0, down / robust_pct) if robust_pct > 0 else 1.0,
            }
        )
    span = gains.duty_max - gains.duty_min
    if robust_pct > span:
        warnings.append(
            f"outside the boundary layer the robust term alone asks for {robust_pct:.3g} % duty, the actuator spans "
            f"{span:.3g} %: there the Lyapunov argument does not hold on the real clutch"
        )
    return {"robust_term_pct": robust_pct, "span_pct": span, "points": rows}


def operating_points(
    fit: Mapping[str, Any], model: Linear, plant: Nonlinear | None, bounds: Bounds
) -> list[tuple[float, float, tuple[Lag, ...]]]:
    """Duty [%], torque [N·m] and lags around it, over the identified range.

    Around rest on the nonlinear model the lags are those of the duty held, with the slope of T_s: (target − state) is
    0, so the changes of τ play no part. Without that model: the first-order models of the single levels, else the
    pooled one.
    """
    if plant is not None:
        named = (fit.get("data") or {}).get("levels") or []
        low, high = plant.u_range
        duties = [float(u) for u in named if low <= u <= high] or np.linspace(low, high, POINTS).tolist()
        points: list[tuple[float, float, tuple[Lag, ...]]] = []
        for duty in duties:
            tau1, tau2 = time_constants(plant, duty)
            slope = sum(k * c * duty ** (k - 1) for k, c in enumerate(plant.Ts) if k > 0)
            lags = ((plant.C * slope, float(tau1)), ((1 - plant.C) * slope, float(tau2)))
            points.append((duty, float(steady_torque(plant, duty)), lags))
        return points
    if bounds.rows:
        return [(r["level"], r["gain"], linear_lags(1 / r["B"], r["a0"])) for r in bounds.rows]
    middle = 50.0
    return [(middle, (model.b0 * middle + model.c0) / model.a0, linear_lags(model.b0, model.a0))]


def loop_margins(
    fit: Mapping[str, Any], model: Linear, plant: Nonlinear | None, bounds: Bounds, rc: RCGains, pi: PIGains,
    timing: Timing, warnings: list[str],
) -> dict[str, Any]:  # fmt: skip
    """Margins of both controllers around every operating point, their least, and a warning where one is missed."""
    rows: list[dict[str, Any]] = []
    worst: dict[str, dict[str, float]] = {}
    for name in ("rc", "pi"):
        missed = []
        for k, (duty, torque, lags) in enumerate(operating_points(fit, model, plant, bounds)):
            feedback: Feedback = rc_feedback(rc, torque, duty) if name == "rc" else pi_feedback(pi)
            found = margins(feedback, lags, timing)
            if len(rows) <= k:
                rows.append({"duty_pct": duty, "torque_nm": torque})
            rows[k][name] = vars(found)
            if not _enough(found):
                missed.append((duty, found))
        own = [row[name] for row in rows]
        worst[name] = {key: min(row[key] for row in own) for key in ("gain_db", "phase_deg", "delay_s")}
        if missed:
            warnings.append(_missed(name, missed))
    return {"timing": {"rate_hz": timing.rate_hz, "pwm_hz": timing.pwm_hz}, "points": rows, "worst": worst}


def _enough(found: Margins) -> bool:
    return found.stable and found.gain_db >= ENOUGH_DB and found.phase_deg >= ENOUGH_DEG


def _missed(name: str, missed: list[tuple[float, Margins]]) -> str:
    duties = ", ".join(f"{duty:.4g}" for duty, _ in missed)
    if any(not found.stable for _, found in missed):
        unstable = ", ".join(f"{duty:.4g}" for duty, found in missed if not found.stable)
        return f"{name.upper()}: unstable around {unstable} % duty on the fitted plant; ask for slower gains"
    gain = min(found.gain_db for _, found in missed)
    phase = min(found.phase_deg for _, found in missed)
    return (
        f"{name.upper()}: less than {ENOUGH_DB:g} dB or {ENOUGH_DEG:g}° of margin around {duties} % duty "
        f"(least {gain:.3g} dB, {phase:.3g}°)"
    )
