"""The stiffest wall: passive against any passive limb, and stable with one limb.

**Passive.** The clutch's torque follows the limb's sampled angle, T(s) = −W(s) D(e^(sh)) θ*(s): D is the wall and the
closed torque loop at the samples, W = P(s)(1 − e^(−sh))/s the hold and the plant. Seen from the limb's speed v = sθ all
aliases ω_n = ω + 2πn/h of a frequency take part, and b |v|² + Re v*T ≥ 0 for every v asks at each ω for

    b ≥ ½ (√(‖p‖²‖q‖² − (Im p*q)²) − Re p*q),     p_n = 1/(jω_n)*,   q_n = D(e^(jωh)) W(jω_n)/h

(the least eigenvalue of a Hermitian matrix of rank two). With W the plain hold this is Colgate and Schenkel's
b ≥ h/2/(1 − cos ωh) · Re{(1 − e^(−jωh)) D}; for slow loops it is b ≥ K max(−Im G(jω)/ω).

**Stable.** With M the sampled angle per wanted torque, hold, plant, limb and dead time in it, the loop of a wall turns
unstable where 1 + (K + B_v (1 − 1/z)/h) M = 0 on |z| = 1: the least K > 0 of

    K = −Re(1/M + B_v (1 − 1/z)/h)   at the frequencies where the imaginary part is 0, the Nyquist frequency among them.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq

from eaid.arrays import Array
from eaid.control.margins import (
    Complex,
    Law,
    Point,
    Timing,
    frequencies,
    hold_response,
    integral_at_rest,
    integral_law,
    lags_at,
    latch_response,
    law_around,
    measured_response,
    slower_hz,
)
from eaid.control.pi import PIGains
from eaid.control.rc import RCGains
from eaid.errors import UsageError
from eaid.models.nonlinear import steady_torque
from eaid.models.parameters import Nonlinear
from eaid.replay.controllers import pi_controller, rc_controller


def operating_point(plant: Nonlinear, torque_nm: float) -> Point:
    """The duty that holds a torque, and the plant around it; UsageError for a torque outside the identified duties."""
    least, most = (float(steady_torque(plant, u)) for u in plant.u_range)
    if not least <= torque_nm <= most:
        raise UsageError(
            f"«torque» {torque_nm:g}: the fitted plant holds {least:.3g} to {most:.3g} within its identified inputs; "
            "choose a torque in between"
        )
    duty = float(brentq(lambda u: float(steady_torque(plant, u)) - torque_nm, *plant.u_range, xtol=1e-12))
    lags = lags_at(plant, duty)
    if not lags[0].gain > 0:
        raise UsageError(f"«torque» {torque_nm:g}: T_s does not rise with the input there; choose another torque")
    return Point(duty, torque_nm, lags)


# step(state, reference, its rate, torque) → (next state, duty)
Step = Callable[[tuple[float, ...], float, float, float], tuple[Any, float]]


@dataclass(frozen=True, eq=False)
class Channel:
    """A clutch around a held torque, its loop without limits."""

    plant: Nonlinear
    point: Point
    law: Law
    step: Step
    start: tuple[float, ...]  # State of the law at rest


def channel_of(loop: str, plant: Nonlinear, torque_nm: float, gains: RCGains | PIGains | None, dt_s: float) -> Channel:
    """A loop around a held torque; UsageError where it needs gains that are not given."""
    point = operating_point(plant, torque_nm)
    if loop == "open-loop":
        duties = np.linspace(*plant.u_range, 20_001)  # so fine a table is good to 1e-8 of the range
        steady = steady_torque(plant, duties)
        law = integral_law(1 / sum(lag.gain for lag in point.lags), 0.0, 0.0, 0.0, dt_s)
        return Channel(plant, point, law, lambda s, r, _v, _t: (s, float(np.interp(r, steady, duties))), ())
    if gains is None:
        kind = "a PI" if loop == "pi" else "a robust controller"
        raise UsageError(f"the loop {loop} needs gains with {kind}; give «gains» that tune-rc wrote")
    free = gains._replace(duty_min=-math.inf, duty_max=math.inf)
    acting = pi_controller(free) if isinstance(free, PIGains) else rc_controller(free)
    rate = 0.0 if loop == "rc-no-rate" else 1.0

    def step(s: tuple[float, ...], r: float, v: float, t: float) -> tuple[Any, float]:
        return acting.step(acting.gains, acting.start._make(s), r, rate * v, t, dt_s)

    law = law_around(gains, torque_nm, point.duty_pct, dt_s)
    law = replace(law, d=law.d * [1.0, rate, 1.0])
    return Channel(plant, point, law, step, (integral_at_rest(free, torque_nm, point.duty_pct),))


@dataclass(frozen=True)
class Limb:
    """What the clutch acts on: J θ'' + b θ' = T − T_0."""

    inertia_kgm2: float = 0.1
    damping_nms: float = 0.8  # [N·m·s/rad]


def duty_response(channel: Channel, timing: Timing, omega: Array) -> Complex:
    """Duty per reference at sampled frequencies [rad/s], the torque loop closed, the PWM by its mean response."""
    z = np.exp(1j * omega * timing.step_s)
    measured = measured_response(channel.point.lags, timing, omega) * np.exp(-1j * omega * timing.delay_s)
    by_reference, by_rate, by_torque = channel.law.response(z).T
    return np.asarray((by_reference + by_rate * (1 - 1 / z) / timing.step_s) / (1 - by_torque * measured))


@dataclass(frozen=True, eq=False)
class WallLoop:
    """What a wall turns about, over frequency; arrays of shape (n,)."""

    omega: Array  # Angular frequency [rad/s]
    stiffness: Complex  # 1/M: wanted torque per angle [N·m/rad]
    damper: Complex  # (1 − 1/z)/h [1/s]
    ends: int  # -1: the last is the samples' Nyquist frequency, where all responses are real; else their number

    def stable(self, virtual_damping: float = 0.0) -> tuple[float, float]:
        """The least K at which the loop stops being stable [N·m/rad], and where [rad/s].

        Infinite beyond `STIFFEST`; 0 where B_v alone is too much.
        """
        if virtual_damping > 0 and self._first(self.stiffness / self.damper)[0] <= virtual_damping:
            return 0.0, 0.0
        least, at = self._first(self.stiffness + virtual_damping * self.damper)
        return (least, at) if least < STIFFEST else (math.inf, 0.0)

    def _first(self, curve: Complex) -> tuple[float, float]:
        """The least −Re of a curve over the frequencies where its imaginary part is 0, and that frequency."""
        real, imag = curve.real, curve.imag
        k = np.flatnonzero((imag[:-1] < 0) != (imag[1:] < 0))
        share = imag[k] / (imag[k] - imag[k + 1])
        K, at = (np.concatenate([x[k] + share * (x[k + 1] - x[k]), x[self.ends :]]) for x in (-real, self.omega))
        turned = K > 0
        return min(zip(K[turned].tolist(), at[turned].tolist(), strict=True), default=(math.inf, 0.0))


def wall_loop(channel: Channel, limb: Limb, timing: Timing) -> WallLoop:
    """A clutch with a limb on it, opened at the wall."""
    h = timing.step_s
    omega = frequencies(channel.point.lags, slower_hz(timing), 4000)
    z = np.exp(1j * omega * h)
    rate = np.zeros((5, 5))  # lags, angle and speed of the limb; the duty held
    for i, (gain, tau) in enumerate(channel.point.lags):
        rate[i, [i, 4]] = -1 / tau, gain / tau
        rate[3, i] = 1 / limb.inertia_kgm2
    rate[2, 3], rate[3, 3] = 1.0, -limb.damping_nms / limb.inertia_kgm2
    flow = expm(rate * h)
    turned = np.linalg.solve(z[:, None, None] * np.eye(4) - flow[:4, :4], flow[:4, 4:])[:, 2, 0]
    late = latch_response(timing, omega) * np.exp(-1j * omega * timing.delay_s)
    angle = duty_response(channel, timing, omega) * turned * late
    return WallLoop(omega, 1 / angle, (1 - 1 / z) / h, -1 if timing.pwm_hz is None else len(omega))


ALIASES = 12  # Aliases on either side: W falls with 1/ω², so the rest weighs less than 1e-5 of the sum
STIFFEST = 1e6  # [N·m/rad]; a wall beyond it is called without limit


@dataclass(frozen=True, eq=False)
class Needed:
    """What a wall needs of the limb, over frequency; arrays of shape (n,)."""

    omega: Array  # Angular frequency [rad/s]
    step_s: float
    size: Array  # ‖p‖‖q‖ for K = 1 [s]
    inner: Complex  # p*q for K = 1 [s]

    def damping(self, stiffness: float, virtual_damping: float = 0.0) -> Array:
        """Damping that the wall K, B_v asks of the limb at each frequency [N·m·s/rad]; per K about −Im G(jω)/ω."""
        wall = stiffness + virtual_damping * (1 - np.exp(-1j * self.omega * self.step_s)) / self.step_s
        inner = wall * self.inner
        across = np.sqrt(np.maximum((np.abs(wall) * self.size) ** 2 - inner.imag**2, inner.real**2))
        return np.asarray(0.5 * (across - inner.real))


def needed_damping(channel: Channel, timing: Timing) -> Needed:
    """What a clutch's walls ask of the limb."""
    h = timing.step_s
    omega = np.geomspace(1e-3, 0.999 * np.pi * timing.rate_hz, 1200)  # to just below the Nyquist frequency
    alias = omega + 2 * np.pi / h * np.arange(-ALIASES, ALIASES + 1)[:, None]
    late = latch_response(timing, omega) * np.exp(-1j * omega * timing.delay_s)
    lags = sum(g / (1 + 1j * alias * tau) for g, tau in channel.point.lags)
    q = duty_response(channel, timing, omega) * late * lags * hold_response(alias, h)  # D W/h for K = 1
    # ‖p‖ in closed form: Σ 1/ω_n² = (h/2)²/sin²(ωh/2)
    size = 0.5 * h / np.sin(0.5 * omega * h) * np.linalg.norm(q, axis=0)
    return Needed(omega, h, size, np.sum(q / (1j * alias), axis=0))


def passive_stiffness(needed: Needed, damping_nms: float, virtual_damping: float = 0.0) -> tuple[float, float]:
    """The stiffest passive wall [N·m/rad] on a limb of a damping b, and the frequency that limits it [rad/s].

    0 where B_v alone is too much, inf where there is no limit below `STIFFEST`. What a wall needs is convex in K (the
    least eigenvalue of a matrix that is linear in K), so it grows beyond b once.
    """
    if virtual_damping > 0:

        def short(stiffness: float) -> float:
            return float(needed.damping(stiffness, virtual_damping).max()) - damping_nms

        least = 1e-3
        if short(least) > 0:
            stiffness = 0.0
        elif short(STIFFEST) <= 0:
            stiffness = math.inf
        else:
            stiffness = float(brentq(short, least, STIFFEST, rtol=1e-9))
        limit = needed.damping(min(max(stiffness, least), STIFFEST), virtual_damping)
    else:
        limit = needed.damping(1.0)
        stiffness = damping_nms / max(float(limit.max()), 1e-300)
    return (stiffness if stiffness < STIFFEST else math.inf), float(needed.omega[int(np.argmax(limit))])
