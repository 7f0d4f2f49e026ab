"""What a rig adds to the model, each effect off unless it is asked for.

In the order a sample meets them: rotor ripple is torque that is really there, T = (x1 + x2)(1 + r sin 2πft); the
torque sensor's first-order low-pass sees that torque; noise is added to what the sensor gives; the controller reads
the sum at t_k; its duty is rounded to the resolution of the output, waits `delay_samples`, and is latched at the next
start of a PWM period.
"""

import math
from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np

from eaid.arrays import Array
from eaid.limits import check_all


@dataclass(frozen=True)
class Rig:
    """The rig's own effects; the default is none of them but saturation."""

    noise_nm: float = 0.0
    """Standard deviation of the noise on the measured torque [N·m]."""
    noise_correlation_s: float = 0.0
    """Time in which the noise forgets itself [s], e^(−t/·); 0: white."""
    noise_coloured_share: float = 1.0
    """Share of the noise's power that has this memory; the rest is white."""
    ripple_pct: float = 0.0
    """Amplitude of the rotor ripple, in percent of the torque."""
    ripple_hz: float = 1.0 / 6.0
    """Frequency of the ripple [Hz]; once per turn at 10 RPM by default."""
    sensor_hz: float = 0.0
    """Corner of the torque sensor's low-pass [Hz]; 0: none."""
    delay_samples: int = 0
    """Control samples between a reading and its duty."""
    pwm_hz: float = 0.0
    """Rate at which the duty is latched [Hz], once per PWM period; 0: at every control sample."""
    duty_bits: int = 0
    """Resolution of the duty [bit], 2^bits values from 0 to the highest duty; 0: unlimited."""
    saturation: bool = True
    """Duty kept within its limits. Without, the controllers ask for more, and the plant keeps its edge values."""

    def __post_init__(self) -> None:
        check_all(**{field.name: getattr(self, field.name) for field in fields(self) if field.name != "saturation"})


class RigNumbers(NamedTuple):
    """The rig as the loop takes it; floats and integers only."""

    memory: float
    """Share of its old value that the sensor's low-pass keeps in a sample; 0: no low-pass."""
    duty_step: float
    """Resolution of the duty [%]; 0: unlimited."""
    delay: int
    """[samples]"""
    pwm_period: float
    """[samples]; 0: no latching."""


def rig_numbers(rig: Rig, dt_s: float, highest_pct: float = 100.0) -> RigNumbers:
    """The rig at a control interval of dt_s seconds, its duty ending at `highest_pct`."""
    memory = math.exp(-2 * math.pi * rig.sensor_hz * dt_s) if rig.sensor_hz > 0 else 0.0
    step = highest_pct / (2**rig.duty_bits - 1) if rig.duty_bits > 0 else 0.0
    period = 1.0 / (rig.pwm_hz * dt_s) if rig.pwm_hz > 0 else 0.0
    return RigNumbers(memory, step, rig.delay_samples, period)


def noise(rig: Rig, samples: int, dt_s: float, seed: int) -> Array:
    """Noise on the measured torque [N·m], shape (samples,); white, or a first-order autoregression of the same
    variance."""
    if rig.noise_nm <= 0:
        return np.zeros(samples)
    random = np.random.default_rng(seed)
    white = random.standard_normal(samples)
    if rig.noise_correlation_s <= 0:
        return rig.noise_nm * white
    memory = math.exp(-dt_s / rig.noise_correlation_s)
    fresh = math.sqrt(1.0 - memory * memory)
    values = white.tolist()
    for k in range(1, samples):
        values[k] = memory * values[k - 1] + fresh * values[k]
    coloured = math.sqrt(rig.noise_coloured_share) * np.array(values)
    return rig.noise_nm * (coloured + math.sqrt(1 - rig.noise_coloured_share) * random.standard_normal(samples))


def ripple(rig: Rig, samples: int, dt_s: float) -> Array:
    """Factor of the rotor ripple on the torque, shape (samples,)."""
    if rig.ripple_pct <= 0:
        return np.ones(samples)
    angle: Array = np.arange(samples, dtype=np.float64) * (2 * math.pi * rig.ripple_hz * dt_s)
    factor: Array = 1.0 + rig.ripple_pct / 100 * np.sin(angle)
    return factor
