"""What a rig adds to the model, each effect off unless it is asked for.

**Noise as the residuals of a fit have it.** A run's residuals from its level's own curve (`friction` in fit.json) are
taken as white noise plus a first-order autoregression φ^k that holds the share s of the power. Two numbers of
`uncertainty.adequacy` fix both: the first autocorrelation ρ1 = s φ, and the effective sample size
n_e = n / (1 + 2 Σ ρ) = n / (1 + 2 s φ/(1 − φ)), so that

    φ = 1 − 2 ρ1/(n/n_e − 1),    s = ρ1/φ,    memory = −dt/ln φ

The fit sees means of repeats; one run is noisier by the root of their number. What of it is torque that is really
there, and what the sensor adds, residuals cannot tell: all of it is put on the measured torque.
"""

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from eaid.arrays import Array
from eaid.errors import DataError
from eaid.options import Rig
from eaid.results.fit import Fit


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


def with_residual_noise(rig: Rig, fit: Fit) -> Rig:
    """The rig with noise as the residuals of a fit have it; DataError where the fit has none."""
    adequacy = fit.uncertainty.adequacy if fit.uncertainty is not None else None
    levels = fit.friction_levels
    rows = [(row.sse, row.rmse) for row in levels if row.sse is not None and row.rmse is not None]
    first = adequacy.residual_autocorrelation if adequacy is not None else None
    effective = adequacy.effective_samples if adequacy is not None else None
    rate_hz, sources = fit.data.sample_rate_hz, fit.data.sources
    if first is None or not effective or rate_hz is None or not rows or not sources:
        raise DataError(
            "the fit does not say how its residuals are coloured; fit again with «ci» robust, or give «noise_nm»"
        )
    counts = {source.level for source in sources}
    samples = sum(sse / rmse**2 for sse, rmse in rows if rmse > 0)
    if samples <= 0:
        raise DataError("the fit's residuals are zero; there is no noise to take from them")
    repeats = len(sources) / len(counts)
    size = math.sqrt(repeats * sum(sse for sse, _ in rows) / samples)
    surplus = samples / effective - 1
    memory = 1 - 2 * first / surplus if first > 0 and surplus > 0 else 0.0
    # Too short a tail for this first autocorrelation: one process, s = 1.
    if memory <= first:
        memory = first
    if memory <= 0:
        return replace(rig, noise_nm=size, noise_correlation_s=0.0, noise_coloured_share=1.0)
    correlation_s = -1 / (rate_hz * math.log(memory))
    return replace(rig, noise_nm=size, noise_correlation_s=correlation_s, noise_coloured_share=first / memory)
