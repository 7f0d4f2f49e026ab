"""The gains on the plant they will meet: what the actuator can deliver, and margins around its operating points."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.polynomial.polynomial import polyder, polyval

from eaid.control.bounds import Bounds
from eaid.control.margins import (
    ENOUGH_DB,
    ENOUGH_DEG,
    Lag,
    LoopMargins,
    Timing,
    linear_lags,
    margins,
    pi_feedback,
    rc_feedback,
)
from eaid.control.pi import PIGains
from eaid.control.rc import RCGains
from eaid.findings import Finding, finding
from eaid.models.nonlinear import steady_torque, time_constants
from eaid.models.parameters import Linear, Nonlinear
from eaid.results import gains as parts
from eaid.results.fit import Fit

Points = Sequence[tuple[float, float, tuple[Lag, ...]]]
"""Duty [%], torque [N·m] and lags of each operating point."""
POINTS = 10
"""Operating points of the margins where the fit names no levels."""


def actuator(model: Linear, gains: RCGains, plant: Nonlinear | None, bounds: Bounds) -> parts.Actuator:
    """How much of the law the actuator can deliver: B̂ρ(0) against the duty that is left at low, middle, high torque."""
    robust_pct = gains.B_hat * gains.rho_constant
    if plant is not None:
        top = float(steady_torque(plant, plant.u_range[1]))
    elif bounds.rows:
        top = max(row.gain for row in bounds.rows)
    else:
        top = (model.b0 * gains.duty_max + model.c0) / model.a0
    rows = []
    for torque in (0.1 * top, 0.5 * top, 0.9 * top):
        held = (model.a0 * torque - model.c0) / model.b0
        up = max(0.0, gains.duty_max - held)
        down = max(0.0, held - gains.duty_min)
        shares = [min(1.0, left / robust_pct) if robust_pct > 0 else 1.0 for left in (up, down)]
        rows.append(parts.TorquePoint(torque, held, *shares))
    return parts.Actuator(robust_pct, gains.duty_max - gains.duty_min, tuple(rows))


def lags_at(plant: Nonlinear, duty_pct: float) -> tuple[Lag, Lag]:
    """The plant around a duty held for long: two lags in parallel, C and 1 − C of the slope of T_s."""
    tau1, tau2 = time_constants(plant, duty_pct)
    slope = float(polyval(duty_pct, polyder(plant.Ts)))
    return (plant.C * slope, float(tau1)), ((1 - plant.C) * slope, float(tau2))


def operating_points(
    fit: Fit, model: Linear, plant: Nonlinear | None, bounds: Bounds, limits: tuple[float, float] = (0.0, 100.0)
) -> list[tuple[float, float, tuple[Lag, ...]]]:
    """Duty [%], torque [N·m] and lags around it, over the identified range.

    Around rest on the nonlinear model the lags are those of the duty held, with the slope of T_s: (target − state) is
    0, so the changes of τ play no part. Without that model, or where one level gave T_s no slope: the first-order
    models of the single levels, else the pooled one.
    """
    if plant is not None and any(plant.Ts[1:]):
        low, high = plant.u_range
        duties = [u for u in fit.data.levels if low <= u <= high] or np.linspace(low, high, POINTS).tolist()
        return [(duty, float(steady_torque(plant, duty)), lags_at(plant, duty)) for duty in duties]
    if bounds.rows:
        return [(row.level, row.gain, linear_lags(1 / row.B, row.a0)) for row in bounds.rows]
    middle = sum(limits) / 2
    return [(middle, (model.b0 * middle + model.c0) / model.a0, linear_lags(model.b0, model.a0))]


def keeps_margins(gains: RCGains, points: Points, timing: Timing) -> bool:
    """Whether the loop has 6 dB and 45° around every operating point, the duty latched."""
    return all(enough(margins(rc_feedback(gains, torque, duty), lags, timing)) for duty, torque, lags in points)


def enough(found: LoopMargins) -> bool:
    """Whether a loop has 6 dB and 45°."""
    return found.gain_db >= ENOUGH_DB and found.phase_deg >= ENOUGH_DEG


def loop_margins(
    fit: Fit, model: Linear, plant: Nonlinear | None, bounds: Bounds, rc: RCGains, pi: PIGains, timing: Timing
) -> tuple[parts.Margins, list[Finding]]:
    """Margins of both controllers around every operating point, their least, and a finding where one is missed."""
    points = operating_points(fit, model, plant, bounds, (rc.duty_min, rc.duty_max))
    found: dict[str, list[LoopMargins]] = {"rc": [], "pi": []}
    for duty, torque, lags in points:
        found["rc"].append(margins(rc_feedback(rc, torque, duty), lags, timing))
        found["pi"].append(margins(pi_feedback(pi), lags, timing))
    rows = [
        parts.MarginPoint(duty, torque, _kept(one), _kept(other))
        for (duty, torque, _), one, other in zip(points, found["rc"], found["pi"], strict=True)
    ]
    worst = parts.WorstMargins(*(_least(found[name]) for name in ("rc", "pi")))
    duties = [duty for duty, _, _ in points]
    findings = [one for name in ("rc", "pi") for one in _missed(name, duties, found[name], fit.data.input_unit)]
    return parts.Margins(
        parts.SampleTiming(timing.rate_hz, timing.pwm_hz, timing.delay_samples), tuple(rows), worst
    ), findings


def _kept(found: LoopMargins) -> parts.Margin:
    """As gains.json has it: a margin without end is not known."""
    return parts.Margin(
        found.stable, *(known(x) for x in (found.gain_db, found.delay_s, found.phase_deg, found.crossover_hz))
    )


def _least(found: list[LoopMargins]) -> parts.Margin:
    least = {name: known(min(getattr(one, name) for one in found)) for name in ("gain_db", "phase_deg", "delay_s")}
    return parts.Margin(stable=all(one.stable for one in found), **least)


def known(value: float) -> float | None:
    """A number that is finite; None elsewhere."""
    return value if math.isfinite(value) else None


def _missed(name: str, duties: list[float], found: list[LoopMargins], unit: str) -> list[Finding]:
    unstable = [duty for duty, one in zip(duties, found, strict=True) if not one.stable]
    if unstable:
        return [finding("loop-unstable-on-plant", name, unstable, unit=unit)]
    missed = [(duty, one) for duty, one in zip(duties, found, strict=True) if not enough(one)]
    if not missed:
        return []
    return [
        finding(
            "margin-missed", name, [duty for duty, _ in missed], unit=unit, enough_db=ENOUGH_DB, enough_deg=ENOUGH_DEG,
            gain_db=known(min(one.gain_db for _, one in missed)),
            phase_deg=known(min(one.phase_deg for _, one in missed)),
        )
    ]  # fmt: skip
