"""When a loop samples and when its duty takes effect, and what latching and holding do to its frequency response."""

import math
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from eaid.arrays import Array
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
