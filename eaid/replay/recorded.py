"""A recorded run on the fitted plant: its own duty played again, and, over a closed-loop run, the same controllers.

The duty of a row acts until the next row's time, each interval exactly (`plant_step`), from rest at first. A run
that may begin loaded (a release, or a first duty that is not zero) starts at the torque of its first row, C of it in
the fast part. The recorded torque is counted from its idle value: the run's own baseline, else the mean over the
leading rows at zero duty where there are ten of them or more.

    difference = recorded − model:   largest, RMS, mean (its sign kept)
    explained variance               1 − Σ (recorded − model)² / Σ (recorded − mean recorded)²
"""

import math
from dataclasses import dataclass

import numpy as np

from eaid.arrays import Array, read_only
from eaid.errors import DataError
from eaid.logs.run import Run
from eaid.replay.controllers import Controller
from eaid.replay.loop import Replay, replay
from eaid.replay.metrics import Metrics, tracking
from eaid.replay.plant import PlantParameters, plant_step
from eaid.replay.references import Reference
from eaid.replay.rig import Rig

IDLE_ROWS = 10
"""Fewest rows at zero duty before the first other one that make an idle value."""


@dataclass(frozen=True, eq=False)
class Recorded:
    """A run on its own clock from 0, torque counted from idle, with the model's torque for the same duty; shapes
    (n,)."""

    name: str
    time_s: Array
    duty_pct: Array
    recorded_nm: Array
    model_nm: Array
    idle_nm: float
    """What was subtracted from the recorded torque [N·m]."""
    reference_nm: Array | None
    """The log's own reference [N·m], where it has one."""


def driven(plant: PlantParameters, time_s: Array, duty_pct: Array, start_nm: float = 0.0) -> Array:
    """Torque [N·m] of the plant at each row, each row's duty [%] held until the next; shapes (n,), any time steps.

    It starts at `start_nm`, C of it in the fast part, as after a long hold.
    """
    torque = np.empty(len(time_s))
    x1 = plant.C * start_nm
    x2 = start_nm - x1
    duties = duty_pct.tolist()
    for k, step_s in enumerate([*np.diff(time_s).tolist(), 0.0]):
        torque[k] = x1 + x2
        x1, x2 = plant_step(plant, x1, x2, duties[k], step_s)
    return torque


def recorded(run: Run, plant: PlantParameters, keep_baseline: bool = False) -> Recorded:
    """A run beside the model; raises `DataError` where the run's input is no duty or its output no torque."""
    if run.input_unit != "%" or np.isnan(run.input).any():
        raise DataError(f"{run.source}: {run.name} holds no duty in %; --log takes runs of the clutch with their duty")
    if run.output_unit != "N·m":
        raise DataError(f"{run.source}: {run.name} holds an output in {run.output_unit}; --log compares torque in N·m")
    acting = np.flatnonzero(run.input != 0)
    before = int(acting[0]) if len(acting) else len(run.input)
    idle = 0.0
    if not keep_baseline:
        if run.baseline is not None:
            idle = run.baseline
        elif before >= IDLE_ROWS and run.edge == "rising":
            idle = float(run.output[:before].mean())
    time_s = run.time_s - run.time_s[0]
    torque = run.output - idle
    loaded = run.edge == "falling" or run.input[0] != 0
    start = float(torque[0]) if loaded else 0.0
    return Recorded(
        run.name,
        read_only(time_s),
        run.input,
        read_only(torque),
        read_only(driven(plant, time_s, run.input, start)),
        idle,
        run.reference_nm,
    )


def difference(run: Recorded) -> Metrics:
    """How far the model's torque is from the recorded one [N·m]."""
    apart = run.recorded_nm - run.model_nm
    spread = run.recorded_nm - run.recorded_nm.mean()
    power = float(np.sum(spread * spread))
    return {
        "max_abs_difference_nm": float(np.abs(apart).max()),
        "rms_difference_nm": math.sqrt(float(np.mean(apart * apart))),
        "mean_difference_nm": float(apart.mean()),
        "explained_variance": 1.0 - float(np.sum(apart * apart)) / power if power > 0 else None,
        "idle_nm": run.idle_nm,
    }


def closed_loop_metrics(run: Recorded) -> Metrics:
    """The metrics of a replay for the recorded run itself: its reference against its torque."""
    assert run.reference_nm is not None
    return tracking(run.reference_nm, run.recorded_nm, run.duty_pct, _interval(run))


def laid_over(run: Recorded, plant: PlantParameters, controller: Controller, rig: Rig, seed: int = 0) -> Replay:
    """The controller replayed on the recorded run's reference, at the run's own rate: does the model predict the
    rig?"""
    assert run.reference_nm is not None
    return replay(plant, controller, reference_of(run).torque_nm, rig, _interval(run), seed)


def against(run: Recorded, replayed: Replay) -> Metrics:
    """How far the replay's torque [N·m] and duty [%] are from the recorded ones, on the replay's grid."""
    torque = np.interp(replayed.time_s, run.time_s, run.recorded_nm) - replayed.torque_nm
    duty = np.interp(replayed.time_s, run.time_s, run.duty_pct) - replayed.duty_pct
    return {
        "rms_from_recorded_nm": math.sqrt(float(np.mean(torque * torque))),
        "rms_duty_from_recorded_pct": math.sqrt(float(np.mean(duty * duty))),
    }


def reference_of(run: Recorded) -> Reference:
    """The recorded reference on a uniform grid at the run's mean rate, by straight lines between its rows."""
    assert run.reference_nm is not None
    dt_s = _interval(run)
    grid = np.arange(len(run.time_s)) * dt_s
    return Reference(read_only(np.interp(grid, run.time_s, run.reference_nm)), dt_s)


def _interval(run: Recorded) -> float:
    return float(run.time_s[-1] / (len(run.time_s) - 1))
