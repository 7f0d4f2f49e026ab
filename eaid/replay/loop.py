"""The control loop of the rig, sample by sample, exact in time: no solver, no tolerance.

At t_k the controller reads the torque and gives a duty, which acts until t_{k+1}, from rest. Behind a dead time θ the
torque is what the plant without it had θ before, y(t) = y0(t − θ): between two samples too, each as exactly. The
function `closed_loop` is written once: plain Python runs it as it stands, and `eaid.replay.many` hands the same
function to numba. What a rig adds to the model is off unless it is asked for.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from eaid.arrays import Array, read_only
from eaid.control.kinds import ControllerStep
from eaid.options import RigExtras
from eaid.plant.dynamics import PlantNumbers, plant_step
from eaid.replay.controllers import Controller

INSTANT = 1e-9  # Two instants nearer than this share of a sample are one


class Held(NamedTuple):
    """Where plant and latch are; at rest, before the first pulse, all is 0."""

    x1: float  # Fast part of the torque [N·m]
    x2: float  # Slow part [N·m]
    latched: float  # Duty that acts [%]
    pulse: int  # The next PWM period to begin, at pulse·period samples


def hold_step(plant: PlantNumbers, period: float, dt: float, k: int, duty: float, held: Held) -> tuple[Held, float]:
    """From sample k to the next with a duty [%], latched once a PWM period [samples; 0: at once]; and the mean duty."""
    x1, x2, latched, pulse = held
    if period == 0.0:
        x1, x2 = plant_step(plant, x1, x2, duty, dt)
        return Held(x1, x2, duty, pulse), duty
    wait = pulse * period - k
    if wait >= 1.0 - INSTANT:
        x1, x2 = plant_step(plant, x1, x2, latched, dt)
        return Held(x1, x2, latched, pulse), latched
    wait = max(wait, 0.0)
    x1, x2 = plant_step(plant, x1, x2, latched, wait * dt)
    x1, x2 = plant_step(plant, x1, x2, duty, (1.0 - wait) * dt)
    return Held(x1, x2, duty, math.ceil((k + 1 - INSTANT) / period)), wait * latched + (1.0 - wait) * duty


def output_within(
    plant: PlantNumbers, period: float, dt: float, k: int, duty: float, held: Held, share: float
) -> float:
    """Torque of `hold_step` a share of a sample after sample k."""
    x1, x2, latched, pulse = held
    wait = 0.0
    if period > 0.0:
        wait = min(max(pulse * period - k, 0.0), share)
        x1, x2 = plant_step(plant, x1, x2, latched, wait * dt)
    x1, x2 = plant_step(plant, x1, x2, duty, (share - wait) * dt)
    return x1 + plant.z * x2


def rig_numbers(rig: RigExtras, dt_s: float) -> tuple[int, float]:
    """The rig as the loop takes it, at a control interval of dt_s [s]: delay, and PWM period [samples; 0: at once]."""
    return rig.delay_samples, 1.0 / (rig.pwm_hz * dt_s) if rig.pwm_hz > 0 else 0.0


def coloured(samples: int, dt_s: float, memory_s: float, random: np.random.Generator) -> Array:
    """Stationary first-order autoregression of unit variance, shape (samples,): x_k − keep x_(k−1) is white."""
    from scipy.linalg.blas import dtbsv

    keep = math.exp(-dt_s / memory_s)
    white = random.standard_normal(samples)
    white[1:] *= math.sqrt(1.0 - keep * keep)
    band = np.repeat([[1.0], [-keep]], samples, axis=1)
    return np.asarray(dtbsv(1, band, white, lower=1, diag=1))


def sensor_noise(rig: RigExtras, samples: int, seed: int) -> Array:
    """White noise on the measured torque [N·m], shape (samples,)."""
    return rig.noise_nm * np.random.default_rng(seed).standard_normal(samples)


class Course(NamedTuple):
    """What a loop meets at each sample; columns of one length."""

    reference: Any  # [N·m]
    rate: Any  # Slope of the reference [N·m/s]
    disturbance: Any  # Noise on what the sensor gives [N·m]
    factor: Any  # What the sensor gives of the torque; 1 but for logs that are synthesised


def loop_of(law: ControllerStep) -> Callable[..., None]:
    """The control loop around one law."""

    def closed_loop(
        gains: Any, start: Any, plant: PlantNumbers, rig: tuple[int, float], dt: float, inputs: Course, filled: Any
    ) -> None:
        """Fill four columns of zeros, as long as the inputs: true and read torque, duty given and mean duty applied."""
        reference, rate, disturbance, factor = inputs
        torque, measured, duty, applied = filled
        state = start
        delay, period = rig
        held = Held(0.0, 0.0, 0.0, 0)
        late = plant.late_s / dt
        whole = int(late + INSTANT)
        part = late - whole  # of a sample, by which the torque is later than whole samples
        split = part > INSTANT
        n = len(reference)
        for k in range(n):
            measured[k] = torque[k] * factor[k] + disturbance[k]
            state, duty[k] = law(gains, state, reference[k], rate[k], measured[k], dt)
            given = 0.0 if k < delay else duty[k - delay]
            after = k + whole + 1
            if split and after < n:
                torque[after] = output_within(plant, period, dt, k, given, held, 1.0 - part)
            held, mean = hold_step(plant, period, dt, k, given, held)
            if after <= n:
                applied[after - 1] += (1.0 - part) * mean
            if after < n:
                applied[after] += part * mean
                if not split:
                    torque[after] = held.x1 + plant.z * held.x2

    return closed_loop


def inputs_of(controller: Controller, reference_nm: Array, rig: RigExtras, dt_s: float, seed: int) -> Course:
    """The columns that a controller meets on a reference [N·m], shape (n,)."""
    n, rate = len(reference_nm), np.ascontiguousarray(reference_rate(reference_nm, dt_s, controller.looks_ahead))
    return Course(np.array(reference_nm, dtype=np.float64), rate, sensor_noise(rig, n, seed), np.ones(n))


def reference_rate(reference_nm: Array, dt_s: float, looks_ahead: bool) -> Array:
    """Slope of the reference at each sample [N·m/s]: central differences, or forward ones (zero at the end) to look
    ahead."""
    if looks_ahead:
        return np.append(np.diff(reference_nm) / dt_s, 0.0)
    return np.gradient(reference_nm, dt_s)


def replay(
    plant: PlantNumbers, controller: Controller, reference_nm: Array, rig: RigExtras, dt_s: float, seed: int = 0
) -> dict[str, Array]:
    """What one controller does on one plant, from rest, as `loop_columns` has it; reference in N·m at intervals of dt_s
    [s], shape (n,), n ≥ 2."""
    inputs = Course(*(column.tolist() for column in inputs_of(controller, reference_nm, rig, dt_s, seed)))
    filled = [[0.0] * len(reference_nm) for _ in range(4)]
    loop_of(controller.step)(
        controller.gains, controller.start(dt_s), plant, rig_numbers(rig, dt_s), dt_s, inputs, filled
    )
    return loop_columns(rig, plant, dt_s, reference_nm, filled)


def loop_columns(
    rig: RigExtras, plant: PlantNumbers, dt_s: float, reference_nm: Array, filled: Sequence[Sequence[float] | Array]
) -> dict[str, Array]:
    """What the loop filled, each of shape (n,), read-only: `torque_nm` is the true torque, `duty_pct` what the
    controller gave; with noise `measured_nm`, what it read; where a delay or the PWM makes it another, `applied_pct`,
    the mean duty that the plant feels until the next sample."""
    torque, measured, duty, applied = filled
    time_s = np.arange(len(reference_nm)) * dt_s
    columns = {"time_s": time_s, "reference_nm": reference_nm, "torque_nm": torque, "duty_pct": duty}
    if rig.noise_nm > 0:
        columns["measured_nm"] = measured
    if rig.delay_samples > 0 or rig.pwm_hz > 0 or plant.late_s > 0:
        columns["applied_pct"] = applied
    return {name: read_only(column) for name, column in columns.items()}
