"""Gain, delay and phase margins of the loop as it really runs: sampled at 1 kHz, the duty latched once a PWM period.

Around an operating point both controllers are δu_k = −k_T δT_k + k_q δq_k, δq_{k+1} = δq_k − h δT_k (for a PI
k_T = K_P, k_q = K_I), and the plant is a sum of lags, T = Σ x_i, x_i' = (g_i u − x_i)/τ_i. The loop is opened at the
duty.

Samples at k h and latches at j/f_pwm repeat together after a common period. Over it the loop is a linear map of the
state (lags, integral, latched duty, duties on their way): stable where its spectral radius is below 1. The gain
margin is the factor on the duty, the delay margin the extra time between latch and plant, that bring the radius to 1:
exact, aliasing included. The phase margin is read at the crossover of the loop's frequency response, the latch by its
mean response.
"""

import cmath
import math
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from eaid.arrays import Array
from eaid.control.pi import PIGains
from eaid.control.rc import RCGains, RCState, rc_step
from eaid.errors import UsageError

Lag = tuple[float, float]
"""Gain g [N·m/%] and time constant τ [s] of x' = (g u − x)/τ."""
ENOUGH_DB, ENOUGH_DEG = 6.0, 45.0
LONGEST_DELAY_S = 0.2
"""Delay margins are sought up to here; beyond, they are no worry."""


@dataclass(frozen=True)
class Timing:
    """When the loop samples and when the duty takes effect."""

    rate_hz: float = 1000.0
    pwm_hz: float | None = 300.0
    """None: the duty takes effect at once, as in a replay without `pwm_hz`."""


@dataclass(frozen=True)
class Feedback:
    """A controller, linearised: δu = −k_T δT + k_q δq."""

    k_T: float
    """[%/(N·m)]"""
    k_q: float
    """[%/(N·m·s)]"""


@dataclass(frozen=True)
class Margins:
    """How far a loop is from instability."""

    stable: bool
    gain_db: float
    """Factor on the duty that makes it unstable [dB]; infinite where none up to 80 dB does."""
    delay_s: float
    """Extra delay that makes it unstable [s]; infinite beyond 0.2 s."""
    phase_deg: float
    """Phase margin at the crossover, the least where there are several [deg]; infinite where the gain stays below 1."""
    crossover_hz: float
    """0 where the gain stays below 1."""


def pi_feedback(gains: PIGains) -> Feedback:
    """The PI is linear as it stands."""
    return Feedback(k_T=gains.K_P, k_q=gains.K_I)


def rc_feedback(gains: RCGains, torque_nm: float, duty_pct: float) -> Feedback:
    """The robust controller around a held torque [N·m] that takes a duty [%], by central differences of `rc_step`.

    At rest e = 0 and the integral stands where the law gives that duty; far from the layer's middle the slope differs.
    """
    free = gains._replace(duty_min=-math.inf, duty_max=math.inf)

    def duty(integral: float, torque: float) -> float:
        return rc_step(free, RCState(integral), torque_nm, 0.0, torque, 0.0)[1]

    low, high = -1.0, 1.0
    while duty(low, torque_nm) > duty_pct:
        low *= 2
    while duty(high, torque_nm) < duty_pct:
        high *= 2
    for _ in range(100):
        middle = (low + high) / 2
        low, high = (middle, high) if duty(middle, torque_nm) < duty_pct else (low, middle)
    rest, step = (low + high) / 2, 1e-6
    return Feedback(
        k_T=-(duty(rest, torque_nm + step) - duty(rest, torque_nm - step)) / (2 * step),
        k_q=(duty(rest + step, torque_nm) - duty(rest - step, torque_nm)) / (2 * step),
    )


def linear_lags(b: float, a: float) -> tuple[Lag, ...]:
    """The linear model Ṫ = −a T + b u as one lag; a [1/s], b [N·m/(s·%)]."""
    return ((b / a, 1 / a),)


def margins(feedback: Feedback, lags: tuple[Lag, ...], timing: Timing) -> Margins:
    """Gain, delay and phase margin of one loop."""
    phase, crossover_hz = phase_margin(feedback, lags, timing)
    if not is_stable(feedback, lags, timing):
        return Margins(False, -math.inf, 0.0, phase, crossover_hz)
    gain = _edge(lambda db: spectral_radius(feedback, lags, timing, 10 ** (db / 20), 0.0), 2.0, 80.0)
    # The phase margin's delay is nearly it; a third of that as the step keeps the search short.
    guess = math.radians(phase) / (2 * math.pi * crossover_hz) if crossover_hz > 0 else LONGEST_DELAY_S
    step = min(max(guess / 3, 1e-3), LONGEST_DELAY_S / 4)
    delay = _edge(lambda s: spectral_radius(feedback, lags, timing, 1.0, s), step, LONGEST_DELAY_S)
    return Margins(True, gain, delay, phase, crossover_hz)


def is_stable(feedback: Feedback, lags: tuple[Lag, ...], timing: Timing) -> bool:
    """Whether the sampled loop, as it runs, dies out."""
    return spectral_radius(feedback, lags, timing, 1.0, 0.0) < 1


def _edge(radius: Callable[[float], float], step: float, limit: float) -> float:
    """First value at which the radius reaches 1: steps to bracket it, then bisection; infinite beyond the limit."""
    low, high = 0.0, step
    while radius(high) < 1:
        low, high = high, high + step
        if low >= limit:
            return math.inf
    for _ in range(24):
        middle = (low + high) / 2
        low, high = (middle, high) if radius(middle) < 1 else (low, middle)
    return high


def spectral_radius(feedback: Feedback, lags: tuple[Lag, ...], timing: Timing, factor: float, delay_s: float) -> float:
    """Spectral radius of the loop's map over one common period of sampling and latching, duty times `factor`, late by
    `delay_s` [s]."""
    samples, latches = _pattern(timing)
    h, hold = 1 / timing.rate_hz, samples / timing.rate_hz / latches
    late = int(delay_s / hold + 1e-9)  # whole holds that the delay spans
    rest = max(delay_s - late * hold, 0.0)
    memory = late + 1
    size = len(lags) + 1 + memory
    x = list(np.eye(size)[: len(lags)])
    integral = np.eye(size)[len(lags)]
    latched = {-1 - k: row for k, row in enumerate(np.eye(size)[len(lags) + 1 :])}
    latest, acting = latched[-1], latched[-1 - late]
    # (time, order, index): a sample comes before a latch at the same instant, a latch before the plant sees it.
    events = [(k * h, 0, k) for k in range(samples)] + [(j * hold, 1, j) for j in range(latches)]
    events += [(j * hold + rest, 2, j - late) for j in range(latches)]
    now = 0.0
    for time, order, index in [*sorted(events, key=_in_order), (samples * h, 3, 0)]:
        if time > now + 1e-12:
            for i, (gain, tau) in enumerate(lags):
                x[i] = x[i] - math.expm1((now - time) / tau) * (gain * acting - x[i])
            now = time
        if order == 0:
            torque = sum(x[1:], x[0])
            latest = factor * (feedback.k_q * integral - feedback.k_T * torque)
            integral = integral - h * torque
        elif order == 1:
            latched[index] = latest
        elif order == 2:
            acting = latched[index]
    # Without integral action nothing reads the integral, whose own eigenvalue of 1 says nothing about the loop.
    after = [*x, integral if feedback.k_q != 0 else 0.0 * integral, *(latched[latches - 1 - k] for k in range(memory))]
    return float(np.abs(np.linalg.eigvals(np.array(after))).max())


def _in_order(event: tuple[float, int, int]) -> tuple[float, int]:
    return round(event[0], 12), event[1]


@lru_cache
def _pattern(timing: Timing) -> tuple[int, int]:
    """Samples and latches in their common period."""
    if timing.pwm_hz is None:
        return 1, 1
    ratio = Fraction(timing.rate_hz / timing.pwm_hz).limit_denominator(20)
    if not 0.05 <= ratio <= 100:
        raise UsageError(
            f"a PWM of {timing.pwm_hz:g} Hz under control at {timing.rate_hz:g} Hz is outside what margins are worked "
            "out for (0.05 to 100 samples a period); check «pwm_hz»"
        )
    return ratio.numerator, ratio.denominator


def loop_response(feedback: Feedback, lags: tuple[Lag, ...], timing: Timing, omega: Array) -> NDArray[np.complex128]:
    """Response of the loop opened at the duty, over angular frequency [rad/s], shape of `omega`.

    L = (k_T + k_q h/(z − 1)) Σ g (1 − a)/(z − a) · latch, z = e^(jωh), a = e^(−h/τ).
    """
    h = 1 / timing.rate_hz
    z = np.exp(1j * omega * h)
    controller = feedback.k_T + feedback.k_q * h / (z - 1)
    plant = np.sum([g * -math.expm1(-h / tau) / (z - math.exp(-h / tau)) for g, tau in lags], axis=0)
    return np.asarray(controller * plant * _latch_response(timing, omega), dtype=np.complex128)


def _latch_response(timing: Timing, omega: Array) -> NDArray[np.complex128]:
    """Mean response of the latch over that of the plain hold at the control rate: 1 where there is no latch."""
    samples, latches = _pattern(timing)
    h = 1 / timing.rate_hz
    hold = samples * h / latches
    # Latch j holds the duty of sample ⌊j hold/h⌋; its age is what the sum carries.
    ages = [j * hold - math.floor(j * hold / h + 1e-9) * h for j in range(latches)]
    mean = np.mean([np.exp(-1j * omega * age) for age in ages], axis=0)
    return np.asarray(mean * _hold_response(omega, hold) / _hold_response(omega, h), dtype=np.complex128)


def _hold_response(omega: Array, hold_s: float) -> NDArray[np.complex128]:
    return np.asarray(np.sinc(omega * hold_s / (2 * math.pi)) * np.exp(-0.5j * omega * hold_s))


def phase_margin(feedback: Feedback, lags: tuple[Lag, ...], timing: Timing) -> tuple[float, float]:
    """Least phase margin [deg] over the crossovers, and that crossover [Hz]."""
    top = math.pi * min(timing.rate_hz, timing.pwm_hz or timing.rate_hz)
    omega = np.geomspace(1e-3, top, 1500)
    size = np.abs(loop_response(feedback, lags, timing, omega))
    found = (math.inf, 0.0)
    for k in np.flatnonzero((size[:-1] >= 1) != (size[1:] >= 1)):
        low, high = omega[k], omega[k + 1]
        for _ in range(3):  # each narrows the bracket 64 times
            finer = np.geomspace(low, high, 65)
            above = np.abs(loop_response(feedback, lags, timing, finer)) >= 1
            turn = int(np.flatnonzero(above[1:] != above[:-1])[0]) if above[0] != above[-1] else 0
            low, high = finer[turn], finer[turn + 1]
        phase = cmath.phase(complex(-loop_response(feedback, lags, timing, np.array([low]))[0]))
        found = min(found, (math.degrees(phase), float(low) / (2 * math.pi)))
    return found
