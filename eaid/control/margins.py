"""Gain, delay and phase margins of the loop as it really runs: sampled at 1 kHz, the duty latched once a PWM period.

Around an operating point both controllers are δu_k = −k_T δT_k + k_q δq_k, δq_{k+1} = δq_k − h δT_k (for a PI
k_T = K_P, k_q = K_I), and the plant is a sum of lags, T = Σ x_i, x_i' = (g_i u − x_i)/τ_i. The loop is opened at the
duty.

Samples at k h and latches at j/f_pwm repeat together after a common period. Over it the loop is a linear map of the
state (lags, integral, latched duty, duties on their way): stable where its spectral radius is below 1. The gain
margin is the factor on the duty, the delay margin the extra time between latch and plant, that bring the radius to 1:
exact, aliasing included. The phase margin is read at the crossover of the loop's frequency response, the latch by its
mean response. Behind a dead time, or sampled above 2 kHz, all three are read there, on a loop that is stable without
the delay: the map would have too many states.
"""

import cmath
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from eaid.arrays import Array
from eaid.control.pi import PIGains
from eaid.control.rc import RCGains, RCState, rc_step
from eaid.errors import UsageError


@dataclass(frozen=True)
class Timing:
    """Sampling, latching, delay and the sensor's filter."""

    rate_hz: float = 1000.0
    pwm_hz: float | None = None
    """Rate at which the duty is latched; None: it takes effect at once."""
    delay_samples: int = 0
    """Dead time of the loop [samples]: from reading to duty, and of the plant itself."""
    sensor_hz: float = 0.0
    """Corner of the torque sensor's low-pass [Hz]; 0: none."""

    @property
    def step_s(self) -> float:
        """Control interval [s]."""
        return 1 / self.rate_hz

    @property
    def delay_s(self) -> float:
        """Dead time [s]."""
        return self.delay_samples / self.rate_hz

    @property
    def memory(self) -> float:
        """Share of its old value that the sensor's low-pass keeps in a sample."""
        return math.exp(-2 * math.pi * self.sensor_hz / self.rate_hz) if self.sensor_hz > 0 else 0.0

    @property
    def pattern(self) -> tuple[int, int]:
        """Samples and latches in their common period."""
        if self.pwm_hz is None:
            return 1, 1
        ratio = Fraction(self.rate_hz / self.pwm_hz).limit_denominator(20)
        if not Fraction(1, 20) <= ratio <= 100:
            raise UsageError(
                f"a PWM of {self.pwm_hz:g} Hz under control at {self.rate_hz:g} Hz is outside what margins are worked "
                "out for (0.05 to 100 samples a period); check «pwm_hz»"
            )
        return ratio.numerator, ratio.denominator


RIG = Timing(pwm_hz=300.0)
"""Control at 1 kHz, the duty latched at 300 Hz (§IV)."""


def latch_response(timing: Timing, omega: Array) -> NDArray[np.complex128]:
    """Mean response of the PWM's latch over that of the plain hold at the control rate: 1 where there is no latch."""
    samples, latches = timing.pattern
    h = timing.step_s
    hold = samples * h / latches
    # Latch j holds the duty of sample ⌊j hold/h⌋; its age is what the sum carries.
    ages = [j * hold - math.floor(j * hold / h + 1e-9) * h for j in range(latches)]
    mean = np.mean([np.exp(-1j * omega * age) for age in ages], axis=0)
    return np.asarray(mean * hold_response(omega, hold) / hold_response(omega, h), dtype=np.complex128)


def hold_response(omega: Array, hold_s: float) -> NDArray[np.complex128]:
    """Response of a zero-order hold of unit gain."""
    return np.asarray(np.sinc(omega * hold_s / (2 * math.pi)) * np.exp(-0.5j * omega * hold_s))


Lag = tuple[float, float]
"""Gain g [N·m/%] and time constant τ [s] of x' = (g u − x)/τ."""
ENOUGH_DB, ENOUGH_DEG = 6.0, 45.0
LONGEST_DELAY_S = 0.2
"""Delay margins are sought up to here; beyond, they are no worry."""
MOST_LATE = 400
"""Samples on their way up to which a loop is taken as the map of its state."""


@dataclass(frozen=True)
class Feedback:
    """A controller, linearised: δu = −k_T δT + k_q δq."""

    k_T: float
    """[%/(N·m)]"""
    k_q: float
    """[%/(N·m·s)]"""


@dataclass(frozen=True)
class LoopMargins:
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
    rest, step = integral_at_rest(gains, torque_nm, duty_pct), 1e-6
    free = gains._replace(duty_min=-math.inf, duty_max=math.inf)

    def duty(integral: float, torque: float) -> float:
        return rc_step(free, RCState(integral), torque_nm, 0.0, torque, 0.0)[1]

    return Feedback(
        k_T=-(duty(rest, torque_nm + step) - duty(rest, torque_nm - step)) / (2 * step),
        k_q=(duty(rest + step, torque_nm) - duty(rest - step, torque_nm)) / (2 * step),
    )


def integral_at_rest(gains: RCGains, torque_nm: float, duty_pct: float) -> float:
    """Integral of the error [N·m·s] with which the robust controller holds a torque [N·m] with a duty [%]."""
    free = gains._replace(duty_min=-math.inf, duty_max=math.inf)

    def short(integral: float) -> float:
        return rc_step(free, RCState(integral), torque_nm, 0.0, torque_nm, 0.0)[1] - duty_pct

    reach = 1.0
    while short(-reach) > 0 or short(reach) < 0:
        reach *= 2
    return float(brentq(short, -reach, reach, xtol=1e-15))


def linear_lags(b: float, a: float) -> tuple[Lag, ...]:
    """The linear model Ṫ = −a T + b u as one lag; a [1/s], b [N·m/(s·%)]."""
    return ((b / a, 1 / a),)


def margins(feedback: Feedback, lags: tuple[Lag, ...], timing: Timing) -> LoopMargins:
    """Gain, delay and phase margin of one loop."""
    if timing.delay_samples or LONGEST_DELAY_S * timing.rate_hz > MOST_LATE:
        return _behind_dead_time(feedback, lags, timing)
    phase, crossover_hz = phase_margin(feedback, lags, timing)
    if not is_stable(feedback, lags, timing):
        return LoopMargins(False, -math.inf, 0.0, phase, crossover_hz)
    gain = _edge(lambda db: spectral_radius(feedback, lags, timing, 10 ** (db / 20), 0.0), 2.0, 80.0)
    # The phase margin's delay is nearly it; a third of that as the step keeps the search short.
    guess = math.radians(phase) / (2 * math.pi * crossover_hz) if crossover_hz > 0 else LONGEST_DELAY_S
    step = min(max(guess / 3, 1e-3), LONGEST_DELAY_S / 4)
    delay = _edge(lambda s: spectral_radius(feedback, lags, timing, 1.0, s), step, LONGEST_DELAY_S)
    return LoopMargins(True, gain, delay, phase, crossover_hz)


def _behind_dead_time(feedback: Feedback, lags: tuple[Lag, ...], timing: Timing) -> LoopMargins:
    """The margins by Nyquist's criterion: no crossover may lag by half a turn or more, the dead time included."""
    phase, crossover_hz = phase_margin(feedback, lags, timing)
    if phase <= 0 or not is_stable(feedback, lags, replace(timing, delay_samples=0)):
        return LoopMargins(False, -math.inf, 0.0, phase, crossover_hz)
    omega = np.geomspace(1e-3, _top(timing), 20_000)
    loop = loop_response(feedback, lags, timing, omega)
    lag = np.unwrap(np.angle(loop)) - omega * timing.delay_s
    turned = np.flatnonzero((lag[:-1] > -math.pi) & (lag[1:] <= -math.pi))
    gain = min((-20 * math.log10(abs(loop[k])) for k in turned), default=math.inf)
    delay = math.radians(phase) / (2 * math.pi * crossover_hz) if crossover_hz > 0 else math.inf
    return LoopMargins(True, gain, delay, phase, crossover_hz)


def is_stable(feedback: Feedback, lags: tuple[Lag, ...], timing: Timing) -> bool:
    """Whether the sampled loop, as it runs, dies out."""
    at_once = spectral_radius(feedback, lags, timing, 1.0, 0.0) < 1
    return at_once and (timing.delay_samples == 0 or phase_margin(feedback, lags, timing)[0] > 0)


def _edge(radius: Callable[[float], float], step: float, limit: float) -> float:
    """First value at which the radius reaches 1: steps to bracket it, then Brent; infinite beyond the limit."""
    low, high = 0.0, step
    while radius(high) < 1:
        low, high = high, high + step
        if low >= limit:
            return math.inf
    return float(brentq(lambda x: radius(x) - 1, low, high, xtol=1e-9 * high))


def spectral_radius(feedback: Feedback, lags: tuple[Lag, ...], timing: Timing, factor: float, delay_s: float) -> float:
    """Spectral radius of the loop's map over one common period of sampling and latching, duty times `factor`, late by
    `delay_s` [s], the timing's own dead time left out."""
    samples, latches = timing.pattern
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


def loop_response(feedback: Feedback, lags: tuple[Lag, ...], timing: Timing, omega: Array) -> NDArray[np.complex128]:
    """Response of the loop opened at the duty, without its dead time, over angular frequency [rad/s].

    L = (k_T + k_q h/(z − 1)) Σ g (1 − a)/(z − a) · latch, z = e^(jωh), a = e^(−h/τ).
    """
    h = 1 / timing.rate_hz
    z = np.exp(1j * omega * h)
    controller = feedback.k_T + feedback.k_q * h / (z - 1)
    plant = np.sum([g * -math.expm1(-h / tau) / (z - math.exp(-h / tau)) for g, tau in lags], axis=0)
    return np.asarray(controller * plant * latch_response(timing, omega), dtype=np.complex128)


def phase_margin(feedback: Feedback, lags: tuple[Lag, ...], timing: Timing) -> tuple[float, float]:
    """Least phase margin [deg] over the crossovers, and that crossover [Hz]; the dead time's lag is taken off it."""
    omega = np.geomspace(1e-3, _top(timing), 1500)

    def response(omega: float) -> complex:
        return complex(loop_response(feedback, lags, timing, np.array([omega]))[0])

    above = np.abs(loop_response(feedback, lags, timing, omega)) >= 1
    found = (math.inf, 0.0)
    for k in np.flatnonzero(above[:-1] != above[1:]):
        crossover = float(brentq(lambda x: abs(response(x)) - 1, omega[k], omega[k + 1]))
        left = cmath.phase(-response(crossover)) - crossover * timing.delay_s
        found = min(found, (math.degrees(left), crossover / (2 * math.pi)))
    return found


def _top(timing: Timing) -> float:
    """Half the slower of sampling and latching [rad/s]."""
    return math.pi * min(timing.rate_hz, timing.pwm_hz or timing.rate_hz)
