"""Recorded runs beside the fitted plant: their own duty played again.

The duty of a row acts until the next row's time, each interval exactly (`driven`), from rest at first. A run
that may begin loaded (a release, or a first duty that is not zero) starts at the two parts that fit its first held
duty best (`start_of`), not at its first, noisy sample. The recorded torque is counted from its idle value: the run's
own baseline, else the mean over the leading rows at zero duty where there are ten of them or more.

    difference = recorded − model:   largest, RMS, mean (its sign kept)
    R2                               1 − Σ (recorded − model)² / Σ (recorded − mean recorded)²
"""

import itertools
import math
from functools import partial

import msgspec
import numpy as np

from eaid.arrays import Array, read_only
from eaid.errors import DataError
from eaid.logs.run import Run
from eaid.replay.plant import PlantParameters, driven, plant_pull, plant_terms
from eaid.results.replay import Metrics, Record

IDLE_ROWS = 10  # Fewest rows at zero duty before the first other one that make an idle value
START_ROWS = 20_000  # Most rows from which the start of a loaded run is estimated
LEAST_ROWS = 10
TELLS_APART = 50.0  # Condition of the two decays below which both parts of the start are estimated


def start_of(plant: PlantParameters, time_s: Array, duty_pct: Array, torque_nm: Array) -> tuple[float, float]:
    """Fast and slow part [N·m] with which a run begins: least squares over the first held duty; shapes (n,).

    Both parts go to their ends exponentially while the duty is held, so the torque is linear in what they start with.
    Where the stretch is too short to tell the two apart, C of the torque lies in the fast part, as after a long hold.
    """
    changed = np.flatnonzero(duty_pct != duty_pct[0])
    last = min(int(changed[0]) + 1 if len(changed) else len(duty_pct), START_ROWS)
    since, duty, C = time_s[:last] - time_s[0], float(duty_pct[0]), plant.C
    steady = plant_terms(plant, duty)[2]
    rising, falling = (plant_pull(plant, x, x, duty)[2:] for x in (-math.inf, math.inf))
    found = []
    # a part that falls may have another time constant than one that rises: what fits best tells which it does
    for taus in itertools.product(*map(set, zip(rising, falling, strict=True))):
        fast, slow = decays = np.stack([np.exp(-since / tau) for tau in taus])
        left = torque_nm[:last] - steady * (C * (1 - fast) + (1 - C) * (1 - slow))
        if len(since) >= LEAST_ROWS and np.linalg.cond(decays) < TELLS_APART:
            x1, x2 = np.linalg.lstsq(decays.T, left)[0].tolist()
        else:
            together = C * fast + (1 - C) * slow
            whole = float(together @ left / (together @ together))
            x1, x2 = C * whole, (1 - C) * whole
        found.append((float(np.sum((left - x1 * fast - x2 * slow) ** 2)), (x1, x2)))
    return min(found)[1]


def compared(run: Run, plant: PlantParameters, units: tuple[str, str], dead_time_s: float) -> Record:
    """The model's torque for a run's duty, on its own clock from 0, and how far it is from the recorded one, its
    reference; DataError where its input or output is in another unit than the fit's."""
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
    idle = run.baseline or 0.0
    if run.baseline is None and before >= IDLE_ROWS and run.edge == "rising":
        idle = float(run.output[:before].mean())
    time_s, torque = read_only(run.time_s - run.time_s[0]), read_only(run.output - idle)
    loaded = run.edge == "falling" or run.input[0] != 0
    start = start_of(plant, time_s, run.input, torque) if loaded else (0.0, 0.0)
    pull, changes_s, duties = partial(plant_pull, plant), time_s + dead_time_s, run.input
    if dead_time_s > 0:  # until the first row's duty acts, what acted before: that duty where the run starts loaded
        changes_s, duties = np.append(time_s[0], changes_s), np.append(run.input[0] if loaded else 0.0, duties)
    model = read_only(driven(pull, changes_s, duties, time_s, start))
    apart = torque - model
    spread, left = float(np.linalg.norm(torque - torque.mean())), float(np.linalg.norm(apart))
    metrics = Metrics(
        max_abs_difference_nm=float(np.abs(apart).max()), rms_difference_nm=math.sqrt(float(np.mean(apart * apart))),
        mean_difference_nm=float(apart.mean()), idle_nm=idle, start_nm=sum(start),
    )  # fmt: skip
    if spread > 0:
        metrics = msgspec.structs.replace(
            metrics, R2=1 - (left / spread) ** 2, fit_pct=100 * (1 - left / spread),
            one_step_pct=100 * (1 - float(np.linalg.norm(np.diff(apart))) / spread),
        )  # fmt: skip
    columns = {"time_s": time_s, "reference_nm": torque, "torque_nm": model, "duty_pct": run.input}
    return Record(columns, metrics, role="recorded-input")
