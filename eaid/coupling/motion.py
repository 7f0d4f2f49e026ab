"""The stiffest wall by replay: the nonlinear plant and the very law, sample by sample, with the limb on it.

The limb is let go a little beside its rest. Its oscillation grows or dies away; the stiffness at which it does neither
is found by bracketing the rate of growth, log of the swing between the third and the last quarter of the time.
"""

import math
from dataclasses import dataclass

import numpy as np

from eaid.arrays import Array
from eaid.control.timing import Timing
from eaid.coupling.linearised import Point, Step
from eaid.coupling.sampled import Limb
from eaid.models.parameters import Nonlinear
from eaid.replay.plant import Held, hold_step, plant_parameters
from eaid.replay.rehab import limb_steps

BESIDE_RAD = 1e-4
"""Where the limb is let go."""
PERIODS = 20
"""Oscillations that are replayed."""


@dataclass(frozen=True)
class Drive:
    """One clutch, its law and the point it works around."""

    plant: Nonlinear
    point: Point
    step: Step
    start: tuple[float, ...]


def swing(drive: Drive, limb: Limb, timing: Timing, stiffness: float, time_s: float) -> Array:
    """Angle of the limb at each sample [rad], shape (n,), from `BESIDE_RAD`, at rest, the torque held at T_0."""
    h, plant, point = timing.step_s, plant_parameters(drive.plant), drive.point
    held = Held(plant.C * point.torque_nm, (1 - plant.C) * point.torque_nm, point.duty_pct, 0)
    state, angle, speed, before = drive.start, BESIDE_RAD, 0.0, point.torque_nm
    memory, seen = timing.memory, point.torque_nm
    waiting = [point.duty_pct] * timing.delay_samples
    period = timing.rate_hz / timing.pwm_hz if timing.pwm_hz else 0.0
    keep, push, drift, lift = limb_steps(limb.inertia_kgm2, limb.damping_nms, h)
    angles = []
    for k in range(round(time_s / h)):
        torque = held.x1 + held.x2
        seen = torque + memory * (seen - torque)
        wanted = point.torque_nm - stiffness * angle
        state, duty = drive.step(state, wanted, (wanted - before) / h, seen)
        before = wanted
        waiting.append(duty)
        held, _ = hold_step(plant, period, h, k, waiting.pop(0), held)
        moment = 0.5 * (torque + held.x1 + held.x2) - point.torque_nm
        angles.append(angle)
        angle, speed = angle + drift * speed + lift * moment, keep * speed + push * moment
        if abs(angle) > 1.0:
            break
    return np.array(angles)


def growth(drive: Drive, limb: Limb, timing: Timing, stiffness: float, time_s: float) -> float:
    """Log of how much the swing grows from the third to the last quarter of the time; below 0: it dies away."""
    angle = np.diff(swing(drive, limb, timing, stiffness, time_s))  # a slow drift of the middle weighs little
    quarter = (round(time_s / timing.step_s) - 1) // 4
    if len(angle) < 4 * quarter:
        return math.inf  # left the range before the time was over
    late, last = (float(np.std(angle[i * quarter : (i + 1) * quarter])) for i in (2, 3))
    return math.log(max(last, 1e-300) / max(late, 1e-300))


def replayed_stiffness(drive: Drive, limb: Limb, timing: Timing, expected: float) -> float | None:
    """The stiffness at which the replay neither grows nor dies away [N·m/rad], near what linear theory expects.

    None where it is not within a factor of two of that.
    """
    turn_s = 2 * math.pi * math.sqrt(limb.inertia_kgm2 / expected)
    time_s = max(PERIODS * turn_s, 200 * timing.step_s)

    def rate(log_stiffness: float) -> float:
        return min(growth(drive, limb, timing, math.exp(log_stiffness), time_s), 20.0)

    for factor in (1.03, 1.3, 2.0):
        low, high = math.log(expected / factor), math.log(expected * factor)
        below, above = rate(low), rate(high)
        if not below < 0 < above:
            continue
        for _ in range(2 if factor < 1.1 else 8):  # false position: growth is nearly linear in log K so near its edge
            middle = low - below * (high - low) / (above - below)
            at = rate(middle)
            low, below, high, above = (middle, at, high, above) if at < 0 else (low, below, middle, at)
        return math.exp(low - below * (high - low) / (above - below))
    return None
