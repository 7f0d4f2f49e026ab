"""The control loop of the rig, sample by sample, exact in time: no solver, no tolerance.

At t_k the controller reads the torque and gives a duty, which acts until t_{k+1}, from rest. The function
`closed_loop` is written once: plain Python runs it as it stands, and `eaid.replay.many` hands the same function to
numba. What a rig adds to the model is off unless it is asked for.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from eaid.arrays import Array, read_only
from eaid.options import Rig
from eaid.replay.controllers import Controller, Step
from eaid.replay.metrics import tracking
from eaid.replay.plant import Held, PlantParameters, hold_step
from eaid.results.gains import Tracking


@dataclass(frozen=True, eq=False)
class Trace:
    """What one controller did on the plant; arrays of shape (n,), read-only."""

    controller: str
    dt_s: float
    time_s: Array
    reference_nm: Array
    torque_nm: Array  # True torque [N·m]
    duty_pct: Array  # Duty that the controller gave at each sample [%], within its limits
    limits_pct: tuple[float, float] = (0.0, 100.0)  # Duty limits that the controller kept [%]
    measured_nm: Array | None = None  # Torque that the controller read [N·m]; None: the true one
    # Mean duty on the clutch from each sample to the next [%], where a delay or the PWM makes it differ from `duty_pct`
    applied_pct: Array | None = None

    def tracking(self, counted: "slice | NDArray[np.int64]" = slice(None)) -> Tracking:
        """How well the torque follows the reference over the samples that count."""
        reference, torque, duty = self.reference_nm[counted], self.torque_nm[counted], self.duty_pct[counted]
        return tracking(reference, torque, duty, self.dt_s, self.limits_pct)


class RigNumbers(NamedTuple):
    """The rig as the loop takes it; floats and integers only."""

    delay: int  # [samples]
    pwm_period: float  # [samples]; 0: no latching


def rig_numbers(rig: Rig, dt_s: float) -> RigNumbers:
    """The rig at a control interval of dt_s seconds."""
    return RigNumbers(rig.delay_samples, 1.0 / (rig.pwm_hz * dt_s) if rig.pwm_hz > 0 else 0.0)


def coloured(samples: int, dt_s: float, memory_s: float, random: np.random.Generator) -> Array:
    """Stationary first-order autoregression of unit variance, shape (samples,): x_k − keep x_(k−1) is white."""
    from scipy.linalg.blas import dtbsv

    keep = math.exp(-dt_s / memory_s)
    white = random.standard_normal(samples)
    white[1:] *= math.sqrt(1.0 - keep * keep)
    band = np.repeat([[1.0], [-keep]], samples, axis=1)
    return np.asarray(dtbsv(1, band, white, lower=1, diag=1))


def noise(rig: Rig, samples: int, seed: int) -> Array:
    """White noise on the measured torque [N·m], shape (samples,)."""
    if rig.noise_nm <= 0:
        return np.zeros(samples)
    return rig.noise_nm * np.random.default_rng(seed).standard_normal(samples)


class Inputs(NamedTuple):
    """What a loop meets at each sample; columns of one length."""

    reference: Any  # [N·m]
    rate: Any  # Slope of the reference [N·m/s]
    disturbance: Any  # Noise on what the sensor gives [N·m]
    factor: Any  # What the sensor gives of the torque; 1 but for logs that are synthesised


def loop_of(law: Step, sources: str = "") -> Callable[..., tuple[float, float]]:
    """The control loop around one law; `sources` is part of the key under which machine code of it is kept."""

    def closed_loop(
        gains: Any, start: Any, plant: PlantParameters, rig: RigNumbers, dt: float, inputs: Inputs, filled: Any
    ) -> tuple[float, float]:
        """Fill four columns as long as the inputs; return the plant's states at the end [N·m].

        They are the true and the read torque, the duty given and the mean duty applied.
        """
        sources  # noqa: B018 - what a closure holds is part of numba's key
        reference, rate, disturbance, factor = inputs
        torque, measured, duty, applied = filled
        state = start
        delay, period = rig
        held = Held(0.0, 0.0, 0.0, 0)
        for k in range(len(reference)):
            torque[k] = held.x1 + held.x2
            measured[k] = torque[k] * factor[k] + disturbance[k]
            state, duty[k] = law(gains, state, reference[k], rate[k], measured[k], dt)
            late = 0.0 if k < delay else duty[k - delay]
            held, applied[k] = hold_step(plant, period, dt, k, late, held)
        return held.x1, held.x2

    return closed_loop


def inputs_of(controller: Controller, reference_nm: Array, rig: Rig, dt_s: float, seed: int) -> Inputs:
    """The columns that a controller meets on a reference [N·m], shape (n,)."""
    n, rate = len(reference_nm), reference_rate(reference_nm, dt_s, controller.looks_ahead)
    return Inputs(np.array(reference_nm, dtype=np.float64), np.ascontiguousarray(rate), noise(rig, n, seed), np.ones(n))


def reference_rate(reference_nm: Array, dt_s: float, looks_ahead: bool) -> Array:
    """Slope of the reference at each sample [N·m/s]: central differences, or forward ones (zero at the end) to look
    ahead."""
    if looks_ahead:
        return np.append(np.diff(reference_nm) / dt_s, 0.0)
    return np.gradient(reference_nm, dt_s)


def replay(
    plant: PlantParameters, controller: Controller, reference_nm: Array, rig: Rig, dt_s: float, seed: int = 0
) -> Trace:
    """Trace one controller on one plant, from rest; reference in N·m at intervals of dt_s [s], shape (n,), n ≥ 2."""
    reference_nm = read_only(reference_nm)
    n = len(reference_nm)
    inputs = inputs_of(controller, reference_nm, rig, dt_s, seed)
    numbers = rig_numbers(rig, dt_s)
    inputs, columns = Inputs(*(column.tolist() for column in inputs)), [[0.0] * n for _ in range(4)]
    loop_of(controller.step)(controller.gains, controller.start, plant, numbers, dt_s, inputs, columns)
    return as_trace(controller, rig, dt_s, reference_nm, columns)


def as_trace(
    law: Controller, rig: Rig, dt_s: float, reference_nm: Array, columns: Sequence[Sequence[float] | Array]
) -> Trace:
    """What the loop filled, as a result; what repeats another column is left out."""
    torque, measured, duty, applied = (read_only(column) for column in columns)
    reads_otherwise = rig.noise_nm > 0
    acts_otherwise = rig.delay_samples > 0 or rig.pwm_hz > 0
    return Trace(
        law.name, dt_s, read_only(np.arange(len(reference_nm)) * dt_s), reference_nm, torque, duty, law.limits_pct,
        measured if reads_otherwise else None, applied if acts_otherwise else None,
    )  # fmt: skip
