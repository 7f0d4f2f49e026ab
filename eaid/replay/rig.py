"""What a rig adds to the model, each effect off unless it is asked for."""

import math
from typing import NamedTuple

import numpy as np

from eaid.arrays import Array
from eaid.options import Rig


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
