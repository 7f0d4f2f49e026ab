"""A PI behind a Smith predictor, as one pure step: it acts on what the output will be when its duty is felt.

    x' = −a0 x + b0 u        the linear model, from rest, without the dead time θ
    e = T_d − T − x(t) + x(t − θ),      u = K_P e + K_I ∫ e dt

A model that is right leaves a PI on a plant without dead time. One that is wrong may ring: the gains are the quickest
with 6 dB and 45° around every held input, with the dead time that was fitted and with one a fifth shorter or longer.

Around a held input, between two instants z = e^(iωh), with G(z) = b0 (1 − φ)/(a0 (z − φ)), φ = e^(−a0 h),

    u = −R T/(1 + R G (1 − z^(−θ/h))),      R = K_P + K_I h/(z − 1)
"""

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from eaid.arrays import Array
from eaid.control.pi import Wanted, pi_gains
from eaid.errors import GainsError
from eaid.plant.dynamics import in_samples
from eaid.plant.linear import LinearPlant
from eaid.plant.operating import Complex

WRONG = (0.8, 1.0, 1.2)  # Factors on the dead time under which the loop has its margins
SHORT_DEAD_TIME = 0.1  # Share of 1/a0 below which a dead time is not worth a predictor


class SmithGains(NamedTuple):
    """All that `smith_step` needs; floats only."""

    K_P: float  # [%/(N·m)]
    K_I: float  # [%/(N·m·s)]
    dead_time_s: float  # θ
    a0: float  # [1/s]
    b0: float  # [N·m/(s·%)]
    duty_min: float = 0.0  # Lowest duty of the actuator [%]
    duty_max: float = 100.0  # Highest duty of the actuator [%]


class SmithState(NamedTuple):
    """Integral of the error, the model, and what it was at the last samples, in a ring."""

    integral: float
    model: float
    line: Any
    at: int


def start(gains: SmithGains, dt: float) -> SmithState:
    """At rest."""
    return SmithState(0.0, 0.0, np.zeros(in_samples(gains.dead_time_s, dt)[0] + 2), 0)


def smith_step(
    gains: SmithGains, state: SmithState, reference: float, _reference_rate: float, torque: float, dt: float
) -> tuple[SmithState, float]:
    """One sample: the next state, and the duty [%] until the next sample; reference and torque in N·m, dt in s."""
    integral, model, line, at = state
    line[at] = model
    whole, part = in_samples(gains.dead_time_s, dt)
    size = whole + 2
    before = (1.0 - part) * float(line[(at - whole) % size]) + part * float(line[(at - whole - 1) % size])
    error = reference - torque - model + before
    wanted = gains.K_P * error + gains.K_I * integral
    duty = min(max(wanted, gains.duty_min), gains.duty_max)
    if (wanted - duty) * error <= 0.0:  # within the limits, or the error leads back to them
        integral = integral + dt * error
    model = model - math.expm1(-gains.a0 * dt) * (gains.b0 / gains.a0 * duty - model)
    return SmithState(integral, model, line, (at + 1) % size), duty


@dataclass(frozen=True)
class Around:
    """The controller around a held input, its limits left out."""

    gains: SmithGains

    def over(self, h: float) -> tuple[Array, Array, Array, float]:
        """A, B, C and D of s ← A s − B T, u = C s − D T, a sample being h; s is the integral, the model, the ring."""
        g, (whole, part) = self.gains, in_samples(self.gains.dead_time_s, h)
        told = np.zeros(whole + 3)  # e = told s − T
        told[1] = -1.0
        told[1 + whole] += 1.0 - part
        told[2 + whole] += part
        C = g.K_P * told
        C[0] = g.K_I
        A, B = np.eye(whole + 3, k=-1), np.zeros(whole + 3)
        gone = -math.expm1(-g.a0 * h)
        A[0], B[0] = h * told, h
        A[0, 0] = 1.0
        A[1], B[1] = gone * g.b0 / g.a0 * C, gone * g.b0 / g.a0 * g.K_P
        A[1, 1] += 1.0 - gone
        return A, B, C, g.K_P

    def response(self, z: Complex, h: float) -> Complex:
        """Duty per torque that is read, its sign turned, at z = e^(iωh)."""
        g = self.gains
        pi, gone = g.K_P + g.K_I * h / (z - 1), -math.expm1(-g.a0 * h)
        model = gone * g.b0 / g.a0 / (z - 1 + gone)
        return np.asarray(pi / (1 + pi * model * (1 - np.exp(-np.log(z) * g.dead_time_s / h))))


def law(model: LinearPlant, held: Any, limits: tuple[float, float]) -> SmithGains:
    """The gains of a file on a model as the step takes them."""
    return SmithGains(held["K_P"], held["K_I"], held["dead_time_s"], model.a0, model.b0, *limits)


def design(wanted: Wanted) -> dict[str, float] | None:
    """The quickest gains that bear a wrong dead time; None where it is short, GainsError where there are none."""
    model, late_s = wanted.model, wanted.timing.delay_s
    if late_s * model.a0 < SHORT_DEAD_TIME:
        return None

    def made(K_P: float, K_I: float) -> SmithGains:
        return law(model, {"K_P": K_P, "K_I": K_I, "dead_time_s": late_s}, wanted.limits)

    asked = wanted.quickest(made, WRONG)
    if asked is None or asked.overshoot_pct is None or asked.settling_s is None:
        raise GainsError("no gains have 6 dB and 45° around every level where the dead time is a fifth off")
    K_P, K_I = pi_gains(model, asked.overshoot_pct, asked.settling_s)
    return {"K_P": K_P, "K_I": K_I, "dead_time_s": late_s}
