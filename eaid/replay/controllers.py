"""The controllers that a replay knows: one row each, and what a row needs from the user's files."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.polynomial import polynomial

from eaid.control.bounds import physical
from eaid.control.pi import PIGains, PIState, pi_step
from eaid.control.rc import RCGains, RCState, rc_step
from eaid.errors import UsageError
from eaid.models.nonlinear import steady_torque
from eaid.models.parameters import Linear, Nonlinear
from eaid.options import Rig
from eaid.replay.inverse import InverseGains, InverseState, inverse_gains, inverse_step

G = TypeVar("G", RCGains, PIGains)
Step = Callable[[Any, Any, float, float, float, float], tuple[Any, float]]
"""step(gains, state, reference, reference_rate, torque, dt) → (next state, duty)."""


@dataclass(frozen=True)
class Controller:
    """A control law with its gains, ready to run; both are pure functions and tuples of floats."""

    name: str
    step: Step
    gains: Any
    start: Any
    """State before the first sample."""
    looks_ahead: bool = False
    """The rate it is given leads to the next sample of the reference exactly (forward difference), else it is the
    central one."""

    def on(self, rig: Rig) -> "Controller":
        """The law as it acts on a rig: where the actuator has no limits, neither has the law; the inverse keeps those
        of its model, where its search ends. Its numbers are floats all, so that one machine code serves them."""
        gains = self.gains._make(float(value) if isinstance(value, int) else value for value in self.gains)
        if not rig.saturation and not isinstance(gains, InverseGains):
            gains = gains._replace(duty_min=-float("inf"), duty_max=float("inf"))
        return replace(self, gains=gains)

    @property
    def limits_pct(self) -> tuple[float, float]:
        """Duty limits that the law keeps [%]."""
        return self.gains.duty_min, self.gains.duty_max


@dataclass(frozen=True)
class Knowledge:
    """What controllers are made from; a part that is missing costs the controllers that need it."""

    plant: Nonlinear
    """The fitted model (never the perturbed one)."""
    linear: Linear | None
    """Where it is missing, the open loop takes the straight line through the plant's steady torque."""
    rc: RCGains | None
    pi: PIGains | None
    limits: tuple[float, float] = (0.0, 100.0)
    """Range of the actuator [%], for the controllers that have no gains of their own."""


class FeedforwardGains(NamedTuple):
    """The linear model turned round, and a PI on top of it."""

    K_P: float
    K_I: float
    a0: float
    b0: float
    c0: float
    duty_min: float = 0.0
    duty_max: float = 100.0
    back_calculation: float = 0.0
    lead: float = 1.0
    """Share of the reference's slope that is fed forward; 0: the duty of the steady torque, the open loop."""


def feedforward_step(
    gains: FeedforwardGains, state: PIState, reference: float, reference_rate: float, torque: float, dt: float
) -> tuple[PIState, float]:
    """u = (T_d' + a0 T_d − c0)/b0 + K_P e + K_I ∫ e dt: the linear model's own duty, and a PI for what it lacks."""
    K_P, K_I, a0, b0, c0, low, high, back_calculation, lead = gains
    ahead = (lead * reference_rate + a0 * reference - c0) / b0
    within = PIGains(K_P, K_I, low - ahead, high - ahead, back_calculation)
    state, correction = pi_step(within, state, reference, reference_rate, torque, dt)
    # at a limit the sum below may miss it by a rounding
    duty = low if correction <= low - ahead else high if correction >= high - ahead else ahead + correction
    return state, duty


def rc_controller(gains: RCGains) -> Controller:
    """The robust controller, ready to replay."""
    return Controller("rc", rc_step, gains, RCState())


def pi_controller(gains: PIGains) -> Controller:
    """The PI controller, ready to replay."""
    return Controller("pi", pi_step, gains, PIState())


def _given(gains: G | None, name: str) -> G:
    if gains is None:
        raise UsageError(f"controller {name} needs gains: give «gains», which eaid tune-rc writes")
    return gains


def _pi_feedforward(known: Knowledge) -> Controller:
    pi, (a0, b0, c0) = _given(known.pi, "pi"), _line(known)
    gains = FeedforwardGains(pi.K_P, pi.K_I, a0, b0, c0, pi.duty_min, pi.duty_max, pi.back_calculation)
    return Controller("pi-feedforward", feedforward_step, gains, PIState())


def _feedforward(known: Knowledge, name: str, lead: float) -> Controller:
    gains = FeedforwardGains(0.0, 0.0, *_line(known), *known.limits, lead=lead)
    return Controller(name, feedforward_step, gains, PIState())


def _line(known: Knowledge) -> tuple[float, float, float]:
    """a0, b0 and c0 of the linear model; without it of one whose steady torque [N·m] is the least-squares line through
    T_s(u), Eq. (7), at 101 duties."""
    if known.linear is not None:
        linear = physical(known.linear)
        return linear.a0, linear.b0, linear.c0
    duties = np.linspace(*known.plant.u_range, 101)
    offset, slope = polynomial.polyfit(duties, steady_torque(known.plant, duties), 1).tolist()
    if not slope > 0.0:
        raise UsageError("controller open-loop: the plant's steady torque does not rise with the duty; fit it again")
    return 1.0, slope, offset


def _inverse(known: Knowledge) -> Controller:
    gains = inverse_gains(known.plant, limits=known.limits)
    return Controller("inverse", inverse_step, gains, InverseState(), looks_ahead=True)


CONTROLLERS: dict[str, Callable[[Knowledge], Controller]] = {
    "rc": lambda known: rc_controller(_given(known.rc, "rc")),
    "pi": lambda known: pi_controller(_given(known.pi, "pi")),
    "pi-feedforward": _pi_feedforward,
    "feedforward": lambda known: _feedforward(known, "feedforward", 1.0),
    "open-loop": lambda known: _feedforward(known, "open-loop", 0.0),
    "inverse": _inverse,
}
"""Name → how it is made; `UsageError` where its gains are missing."""
