"""The control loop of the rig, sample by sample, exact in time: no solver, no tolerance.

At t_k the controller reads the torque and gives a duty, which acts until t_{k+1}, from rest. The function
`closed_loop` is written once: plain Python runs it as it stands, and `eaid.replay.compiled` hands the same function to
numba.
"""

import math
from collections.abc import Callable, MutableSequence, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from eaid.arrays import Array, read_only
from eaid.errors import UsageError
from eaid.replay.controllers import Controller, Step
from eaid.replay.plant import PlantParameters, plant_step
from eaid.replay.rig import Rig, RigNumbers, noise, rig_numbers, ripple

INSTANT = 1e-9
"""Two instants nearer than this share of a sample are one."""


@dataclass(frozen=True, eq=False)
class Trace:
    """What one controller did on the plant; arrays of shape (n,), read-only."""

    controller: str
    dt_s: float
    time_s: Array
    reference_nm: Array
    torque_nm: Array
    """True torque [N·m]."""
    duty_pct: Array
    """Duty that the controller gave at each sample [%], after limits and resolution."""
    limits_pct: tuple[float, float] = (0.0, 100.0)
    """Duty limits that the controller kept [%]."""
    measured_nm: Array | None = None
    """Torque that the controller read [N·m]; None: the true one."""
    applied_pct: Array | None = None
    """Mean duty on the clutch from each sample to the next [%], where a delay or the PWM makes it differ from
    `duty_pct`."""
    fast_nm: Array | None = None
    """Fast part x1 of the plant's torque [N·m], where the loop kept it."""
    state: Array | None = None
    """First number of the controller's state before each sample (rc, pi: the integral of the error), where kept."""

    @property
    def error_nm(self) -> Array:
        """Reference minus true torque [N·m]."""
        return self.reference_nm - self.torque_nm


Loop = Callable[..., tuple[float, float]]


def loop_of(law: Step, sources: str = "") -> Loop:
    """The control loop around one law; `sources` is part of the key under which machine code of it is kept."""

    def closed_loop(
        gains: Any,
        start: Any,
        plant: PlantParameters,
        rig: RigNumbers,
        dt: float,
        reference: Sequence[float],
        rate: Sequence[float],
        disturbance: Sequence[float],
        factor: Sequence[float],
        torque: MutableSequence[float],
        measured: MutableSequence[float],
        duty: MutableSequence[float],
        applied: MutableSequence[float],
        fast: MutableSequence[float],
        kept: MutableSequence[float],
    ) -> tuple[float, float]:
        """Fill the last six, each as long as the reference; return the plant's states at the end [N·m].

        `fast` is the plant's fast part [N·m], `kept` the first number of the controller's state, before each sample.
        """
        sources  # noqa: B018 - what a closure holds is part of numba's key
        state = start
        memory, resolution, delay, period = rig
        x1 = 0.0
        x2 = 0.0
        filtered = 0.0
        latched = 0.0
        pulse = 0  # the next PWM period to begin, at pulse·period samples
        for k in range(len(reference)):
            fast[k] = x1
            kept[k] = state[0]
            true = (x1 + x2) * factor[k]
            filtered = true + memory * (filtered - true) if memory > 0.0 else true
            seen = filtered + disturbance[k]
            state, u = law(gains, state, reference[k], rate[k], seen, dt)
            if resolution > 0.0:
                u = math.floor(u / resolution + 0.5) * resolution
            torque[k] = true
            measured[k] = seen
            duty[k] = u
            if delay > 0:
                u = duty[k - delay] if k >= delay else 0.0
            if period > 0.0:
                # Exact also where the period is no whole number of samples: the interval is cut where the new duty
                # takes over.
                wait = pulse * period - k
                if wait >= 1.0 - INSTANT:
                    x1, x2 = plant_step(plant, x1, x2, latched, dt)
                    applied[k] = latched
                else:
                    wait = max(wait, 0.0)
                    x1, x2 = plant_step(plant, x1, x2, latched, wait * dt)
                    x1, x2 = plant_step(plant, x1, x2, u, (1.0 - wait) * dt)
                    applied[k] = wait * latched + (1.0 - wait) * u
                    latched = u
                    pulse = math.ceil((k + 1 - INSTANT) / period)
            else:
                x1, x2 = plant_step(plant, x1, x2, u, dt)
                applied[k] = u
        return x1, x2

    return closed_loop


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
    if n < 2 or not np.isfinite(reference_nm).all():
        raise UsageError("the reference must hold two samples or more, all of them finite")
    acting = controller if rig.saturation else controller.without_limits()
    torque, measured, duty, applied, fast, kept = ([0.0] * n for _ in range(6))
    loop_of(acting.step)(
        acting.gains,
        acting.start,
        plant,
        rig_numbers(rig, dt_s, controller.gains.duty_max),
        dt_s,
        reference_nm.tolist(),
        reference_rate(reference_nm, dt_s, acting.looks_ahead).tolist(),
        noise(rig, n, dt_s, seed).tolist(),
        ripple(rig, n, dt_s).tolist(),
        torque,
        measured,
        duty,
        applied,
        fast,
        kept,
    )
    limits = (acting.gains.duty_min, acting.gains.duty_max)
    done = as_replay(controller.name, rig, dt_s, reference_nm, (torque, measured, duty, applied), limits)
    return replace(done, fast_nm=read_only(fast), state=read_only(kept))


def as_replay(
    name: str,
    rig: Rig,
    dt_s: float,
    reference_nm: Array,
    columns: Sequence[Sequence[float]],
    limits_pct: tuple[float, float] = (0.0, 100.0),
) -> Trace:
    """What the loop filled, as a result; what repeats another column is left out."""
    torque, measured, duty, applied = columns
    reads_otherwise = rig.noise_nm > 0 or rig.sensor_hz > 0
    acts_otherwise = rig.delay_samples > 0 or rig.pwm_hz > 0
    return Trace(
        controller=name,
        dt_s=dt_s,
        time_s=read_only(np.arange(len(reference_nm)) * dt_s),
        reference_nm=reference_nm,
        torque_nm=read_only(torque),
        duty_pct=read_only(duty),
        limits_pct=limits_pct,
        measured_nm=read_only(measured) if reads_otherwise else None,
        applied_pct=read_only(applied) if acts_otherwise else None,
    )
