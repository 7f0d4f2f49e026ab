"""A recorded run on the fitted plant: its own duty played again, and, over a closed-loop run, the same controllers.

The duty of a row acts until the next row's time, each interval exactly (`plant_step`), from rest at first. A run
that may begin loaded (a release, or a first duty that is not zero) starts at the two parts that fit its first held
duty best (`start_of`), not at its first, noisy sample. The recorded torque is counted from its idle value: the run's
own baseline, else the mean over the leading rows at zero duty where there are ten of them or more.

    difference = recorded − model:   largest, RMS, mean (its sign kept)
    R2                               1 − Σ (recorded − model)² / Σ (recorded − mean recorded)²
"""

import itertools
import math
from dataclasses import dataclass

import msgspec
import numpy as np

from eaid.arrays import Array, read_only
from eaid.errors import DataError
from eaid.logs.run import Run
from eaid.replay.controllers import Controller
from eaid.replay.loop import Trace, replay
from eaid.replay.metrics import tracking
from eaid.replay.plant import PlantParameters, falling_taus, plant_step, plant_terms
from eaid.replay.references import Reference
from eaid.replay.rig import Rig
from eaid.results.metrics import Metrics

IDLE_ROWS = 10
"""Fewest rows at zero duty before the first other one that make an idle value."""
START_ROWS = 20_000
"""Most rows from which the start of a loaded run is estimated."""
LEAST_ROWS = 10
TELLS_APART = 50.0
"""Condition of the two decays below which both parts of the start are estimated."""


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
    start_nm: float
    """Torque from which the model starts [N·m]."""
    reference_nm: Array | None
    """The log's own reference [N·m], where it has one."""


def driven(plant: PlantParameters, time_s: Array, duty_pct: Array, start: tuple[float, float] = (0.0, 0.0)) -> Array:
    """Torque [N·m] of the plant at each row, each row's duty [%] held until the next; shapes (n,), any time steps.

    It starts with its fast and slow part at `start` [N·m].
    """
    torque = np.empty(len(time_s))
    x1, x2 = start
    duties = duty_pct.tolist()
    for k, step_s in enumerate([*np.diff(time_s).tolist(), 0.0]):
        torque[k] = x1 + x2
        x1, x2 = plant_step(plant, x1, x2, duties[k], step_s)
    return torque


def start_of(plant: PlantParameters, time_s: Array, duty_pct: Array, torque_nm: Array) -> tuple[float, float]:
    """Fast and slow part [N·m] with which a run begins: least squares over the first held duty; shapes (n,).

    Both parts go to their ends exponentially while the duty is held, so the torque is linear in what they start with.
    Where the stretch is too short to tell the two apart, C of the torque lies in the fast part, as after a long hold.
    """
    changed = np.flatnonzero(duty_pct != duty_pct[0])
    last = min(int(changed[0]) + 1 if len(changed) else len(duty_pct), START_ROWS)
    since, duty = time_s[:last] - time_s[0], float(duty_pct[0])
    tau1, tau2, steady = plant_terms(plant, duty)
    ends = plant.C * steady, (1 - plant.C) * steady
    each = zip((tau1, tau2), falling_taus(plant, duty), strict=True)
    # a part that falls may have another time constant than one that rises: what fits best tells which it does
    tries = [_start(plant.C, ends, taus, since, torque_nm[:last]) for taus in itertools.product(*map(set, each))]
    return min(tries, key=lambda one: one[0])[1]


def _start(
    share: float, ends: tuple[float, float], taus: tuple[float, ...], since: Array, torque_nm: Array
) -> tuple[float, tuple[float, float]]:
    """Square sum of what is left, and the two parts [N·m], for these time constants."""
    decays = np.stack([np.exp(-since / tau) for tau in taus])
    left = torque_nm - ends[0] * (1 - decays[0]) - ends[1] * (1 - decays[1])
    if len(since) >= LEAST_ROWS and np.linalg.cond(decays) < TELLS_APART:
        x1, x2 = np.linalg.lstsq(decays.T, left)[0].tolist()
    else:
        together = share * decays[0] + (1 - share) * decays[1]
        whole = float(together @ left / (together @ together))
        x1, x2 = share * whole, (1 - share) * whole
    apart = left - x1 * decays[0] - x2 * decays[1]
    return float(apart @ apart), (x1, x2)


def recorded(
    run: Run, plant: PlantParameters, keep_baseline: bool = False, units: tuple[str, str] = ("%", "N·m")
) -> Recorded:
    """A run beside the model; raises `DataError` where its input or output is in another unit than the fit's."""
    if run.input_unit != units[0] or np.isnan(run.input).any():
        raise DataError(
            f"{run.source}: {run.name} holds no input in {units[0]}, which the fit has (its own is {run.input_unit}); "
            "say the column and its unit with «columns» and «units»"
        )
    if run.output_unit != units[1]:
        raise DataError(
            f"{run.source}: {run.name} holds an output in {run.output_unit}, the fit one in {units[1]}; say the "
            "column and its unit with «columns» and «units»"
        )
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
    start = start_of(plant, time_s, run.input, torque) if loaded else (0.0, 0.0)
    model = driven(plant, time_s, run.input, start)
    return Recorded(
        run.name, read_only(time_s), run.input, read_only(torque), read_only(model), idle, sum(start), run.reference_nm
    )


def difference(run: Recorded) -> Metrics:
    """How far the model's torque is from the recorded one [N·m]."""
    apart = run.recorded_nm - run.model_nm
    spread = run.recorded_nm - run.recorded_nm.mean()
    power = float(np.sum(spread * spread))
    return Metrics(
        max_abs_difference_nm=float(np.abs(apart).max()),
        rms_difference_nm=math.sqrt(float(np.mean(apart * apart))),
        mean_difference_nm=float(apart.mean()),
        R2=1.0 - float(np.sum(apart * apart)) / power if power > 0 else None,
        fit_pct=100 * (1 - float(np.linalg.norm(apart)) / power**0.5) if power > 0 else None,
        one_step_pct=100 * (1 - float(np.linalg.norm(np.diff(apart))) / power**0.5) if power > 0 else None,
        idle_nm=run.idle_nm,
        start_nm=run.start_nm,
        reference_is="recorded torque",
    )


def closed_loop_metrics(run: Recorded, limits: tuple[float, float] = (0.0, 100.0)) -> Metrics:
    """The metrics of a replay for the recorded run itself: its reference against its torque."""
    assert run.reference_nm is not None
    found = tracking(run.reference_nm, run.recorded_nm, run.duty_pct, _interval(run), limits)
    return Metrics(**msgspec.structs.asdict(found))


def laid_over(run: Recorded, plant: PlantParameters, controller: Controller, rig: Rig, seed: int = 0) -> Trace:
    """The controller replayed on the recorded run's reference, at the run's own rate: does the model predict the
    rig?"""
    assert run.reference_nm is not None
    return replay(plant, controller, reference_of(run).torque_nm, rig, _interval(run), seed)


def against(run: Recorded, trace: Trace, measured: Metrics) -> Metrics:
    """The metrics, with how far the replay's torque [N·m] and duty [%] are from the recorded ones, on its grid."""
    torque = np.interp(trace.time_s, run.time_s, run.recorded_nm) - trace.torque_nm
    duty = np.interp(trace.time_s, run.time_s, run.duty_pct) - trace.duty_pct
    return msgspec.structs.replace(
        measured,
        rms_from_recorded_nm=math.sqrt(float(np.mean(torque * torque))),
        rms_duty_from_recorded_pct=math.sqrt(float(np.mean(duty * duty))),
    )


def reference_of(run: Recorded) -> Reference:
    """The recorded reference on a uniform grid at the run's mean rate, by straight lines between its rows."""
    assert run.reference_nm is not None
    dt_s = _interval(run)
    grid = np.arange(len(run.time_s)) * dt_s
    return Reference(read_only(np.interp(grid, run.time_s, run.reference_nm)), dt_s)


def _interval(run: Recorded) -> float:
    return float(run.time_s[-1] / (len(run.time_s) - 1))
