"""What a rig adds to the torque of a plant, and what makes two repeats differ.

y = round((T (1 + n_c + r sin(2π f t + φ)) + offset + n_w) / q) q, where n_w is white, n_c an AR(1) process of the
time constant `coloured_s`, f the rotor's frequency, q the resolution of the sensor. Each run has a gain and time
constants of its own.
"""

from dataclasses import dataclass, fields, replace
from math import exp, sqrt

import numpy as np
from scipy.signal import lfilter

from eaid.arrays import Array
from eaid.errors import UsageError
from eaid.models.parameters import Friction


@dataclass(frozen=True)
class Disturbance:
    """Sizes of everything that is not the plant; all 0: the plant alone."""

    white_nm: float = 0.01
    """Standard deviation of white noise [N·m]."""
    coloured: float = 0.01
    """Standard deviation of coloured noise, as a share of the torque [1]."""
    coloured_s: float = 0.05
    """Time constant of the coloured noise [s]."""
    ripple: float = 0.01
    """Amplitude of the rotor ripple, as a share of the torque [1]; its phase differs from run to run."""
    gain_scatter: float = 0.03
    """Run-to-run standard deviation of the torque's gain [1]: 1 + N(0, ·)."""
    tau1_scatter: float = 0.05
    """Run-to-run standard deviation of log τ1 [1]."""
    tau2_scatter: float = 0.0
    """Run-to-run standard deviation of log τ2 [1]."""
    offset_nm: float = 0.02
    """Offset of the torque sensor [N·m], the same in every run."""
    jitter_s: float = 0.0
    """Standard deviation of the sample instants [s]; at most 0.45 of a sample is taken."""
    resolution_nm: float = 1 / 1024
    """Step of the sensor's digits [N·m]; 0: none."""


NONE = Disturbance(**{field.name: 0.0 for field in fields(Disturbance) if field.name != "coloured_s"})
"""The plant alone."""


def check(disturbance: Disturbance) -> None:
    """Refuse sizes that mean nothing."""
    if disturbance.coloured > 0 and disturbance.coloured_s == 0:
        raise UsageError("«coloured_s» 0: coloured noise needs a time constant above 0; white noise is «noise_nm»")


@dataclass(frozen=True)
class Scatter:
    """How one run differs from the plant: factors on T_s, τ1 and τ2."""

    gain: float
    tau1: float
    tau2: float

    def of(self, step: Friction) -> Friction:
        """The step as this run has it."""
        return replace(step, Ts=step.Ts * self.gain, tau1=step.tau1 * self.tau1, tau2=step.tau2 * self.tau2)


def scatter(d: Disturbance, draw: np.random.Generator) -> Scatter:
    """The factors of one run."""
    gain, tau1, tau2 = draw.standard_normal(3).tolist()
    return Scatter(1 + d.gain_scatter * gain, exp(d.tau1_scatter * tau1), exp(d.tau2_scatter * tau2))


def coloured(n: int, dt_s: float, time_constant_s: float, draw: np.random.Generator) -> Array:
    """Stationary AR(1) noise of unit variance, shape (n,)."""
    keep = exp(-dt_s / time_constant_s)
    white = draw.standard_normal(n)
    white[1:] *= sqrt(1 - keep * keep)
    return np.asarray(lfilter([1.0], [1.0, -keep], white))


def sample_times(duration_s: float, rate_hz: float, jitter_s: float, draw: np.random.Generator) -> Array:
    """Sample instants [s], from 0, `duration_s` itself left out; jittered ones to whole microseconds."""
    ticks = np.arange(round(duration_s * rate_hz)) / rate_hz
    if jitter_s == 0:
        return ticks
    reach = 0.45 / rate_hz
    shift = np.clip(draw.standard_normal(ticks.size) * jitter_s, -reach, reach)
    shift[0] = abs(shift[0])
    times: Array = np.round(ticks + shift, 6)
    if not np.all(np.diff(times) > 0):
        raise UsageError(
            f"«jitter_s» {jitter_s:g}: at {rate_hz:g} Hz whole microseconds cannot hold it; lower the rate"
        )
    return times


def measured(torque_nm: Array, time_s: Array, rotor_hz: Array, d: Disturbance, draw: np.random.Generator) -> Array:
    """What the sensor says [N·m] of a torque [N·m] while the rotor turns at `rotor_hz` [Hz]; all of shape (n,)."""
    share, white = noise(time_s, rotor_hz, d, draw)
    return digits(torque_nm * (1 + share) + d.offset_nm + white, d)


def noise(time_s: Array, rotor_hz: Array, d: Disturbance, draw: np.random.Generator) -> tuple[Array, Array]:
    """Noise and ripple as a share of the torque [1], and the noise that is added to it [N·m], shapes (n,)."""
    n = time_s.size
    phase = draw.uniform(0, 2 * np.pi)
    white = draw.standard_normal(n)
    share = np.zeros(n)
    if d.ripple > 0:
        share += d.ripple * np.sin(2 * np.pi * rotor_hz * time_s + phase)
    if d.coloured > 0:
        share += d.coloured * coloured(n, (time_s[-1] - time_s[0]) / max(n - 1, 1), d.coloured_s, draw)
    return share, d.white_nm * white


def digits(torque_nm: Array, d: Disturbance) -> Array:
    """A reading in whole steps of the sensor's digits [N·m]."""
    return np.round(torque_nm / d.resolution_nm) * d.resolution_nm if d.resolution_nm > 0 else torque_nm
