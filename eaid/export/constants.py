"""Gains and plant → the constants of `eaid.export.reference` at one sample time.

PI, RC    the gains as they are; tanh(γε) once, Eq. (14)
inverse   observer poles at e^(−w dt): correction 1 − e^(−2 w dt), learning (1 − e^(−w dt))²/dt
rate      r ← m r + (1 − m)/dt (x − x before),  m = e^(−2π f dt)
"""

import math
from dataclasses import dataclass
from typing import TypeAlias

from eaid.control.pi import PIGains
from eaid.control.rc import RCGains
from eaid.export import reference as law
from eaid.export.numbers import Precision, series
from eaid.models.parameters import TAU_FLOOR_S, Nonlinear
from eaid.replay.inverse import DUTY_TOLERANCE_PCT, OBSERVER_PER_S
from eaid.replay.plant import plant_parameters

Constants: TypeAlias = law.PIConstants | law.RCConstants | law.InverseConstants | law.PlantConstants | law.RateConstants
"""Of one law, or of the rate's filter."""
SEARCHES = 16
"""Tries of the inverse's search at most: twelve are the most seen."""
TOLERANCE = {"double": DUTY_TOLERANCE_PCT, "single": 1e-4}
"""The search ends when it moves the duty by no more than that."""


@dataclass(frozen=True)
class Timing:
    """What an export bakes in beside the gains."""

    dt_s: float
    precision: Precision = "double"
    duty_on_fault: float = 0.0
    """Duty while an input is no number, or the state was not made ready."""
    stuck_s: float = 0.5
    """The status tells of a reading that has not changed for so long [s]."""
    rate_filter_hz: float = 25.0
    """Corner of the reference's filtered derivative [Hz]."""

    @property
    def stuck_samples(self) -> int:
        """`stuck_s` in samples."""
        return max(1, round(self.stuck_s / self.dt_s))


def pi_constants(gains: PIGains, timing: Timing) -> law.PIConstants:
    """Constants of the PI."""
    return law.PIConstants(*gains, timing.duty_on_fault, timing.dt_s, timing.stuck_samples)


def rc_constants(gains: RCGains, timing: Timing) -> law.RCConstants:
    """Constants of the robust controller."""
    g = gains
    return law.RCConstants(
        g.K_P, g.K_D, g.B_hat, g.a0, g.b0, g.c0, g.rho_constant, g.rho_slope, g.epsilon, g.gamma, g.Q12, g.Q22,
        math.tanh(g.gamma * g.epsilon), g.duty_min, g.duty_max, g.back_calculation,
        timing.duty_on_fault, timing.dt_s, timing.stuck_samples, series(timing.precision),
    )  # fmt: skip


def plant_constants(plant: Nonlinear, timing: Timing) -> law.PlantConstants:
    """Constants of the plant."""
    return law.PlantConstants(*plant_parameters(plant)[:-1], TAU_FLOOR_S, timing.dt_s, series(timing.precision))


def inverse_constants(
    plant: Nonlinear, limits: tuple[float, float], timing: Timing, observer_per_s: float = OBSERVER_PER_S
) -> law.InverseConstants:
    """Constants of the inverse between the duty limits."""
    gone = -math.expm1(-observer_per_s * timing.dt_s)
    kept = 1.0 - gone
    return law.InverseConstants(
        correction=1.0 - kept * kept,
        learning=gone * gone / timing.dt_s,
        tolerance=TOLERANCE[timing.precision],
        duty_min=limits[0],
        duty_max=limits[1],
        duty_on_fault=timing.duty_on_fault,
        dt=timing.dt_s,
        searches=SEARCHES,
        stuck_samples=timing.stuck_samples,
        plant=plant_constants(plant, timing),
    )


def rate_constants(timing: Timing) -> law.RateConstants:
    """Constants of the filtered derivative."""
    memory = math.exp(-2 * math.pi * timing.rate_filter_hz * timing.dt_s)
    return law.RateConstants(memory, (1.0 - memory) / timing.dt_s)
