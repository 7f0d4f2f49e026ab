"""Recorded runs beside the fitted plant: their own duty played again.

The duty of a row acts until the next row's time, each interval exactly (`plant_step`), from rest at first. A run
that may begin loaded (a release, or a first duty that is not zero) starts at the two parts that fit its first held
duty best (`start_of`), not at its first, noisy sample. The recorded torque is counted from its idle value: the run's
own baseline, else the mean over the leading rows at zero duty where there are ten of them or more.

    difference = recorded − model:   largest, RMS, mean (its sign kept)
    R2                               1 − Σ (recorded − model)² / Σ (recorded − mean recorded)²
"""

import itertools
import math

import msgspec
import numpy as np

from eaid.arrays import Array, read_only
from eaid.errors import DataError
from eaid.logs.run import Run
from eaid.replay.loop import Trace
from eaid.replay.plant import PlantParameters, falling_taus, plant_pull, plant_step, plant_terms
from eaid.replay.references import record
from eaid.results.replay import Metrics, Record

IDLE_ROWS = 10
"""Fewest rows at zero duty before the first other one that make an idle value."""
FEW_ROWS = 8
"""A duty held for fewer rows is followed row by row, which then is faster."""
START_ROWS = 20_000
"""Most rows from which the start of a loaded run is estimated."""
LEAST_ROWS = 10
TELLS_APART = 50.0
"""Condition of the two decays below which both parts of the start are estimated."""


def _rms(values: Array) -> float:
    return math.sqrt(float(np.mean(values * values)))


def driven(
    plant: PlantParameters, time_s: Array, duty_pct: Array, start: tuple[float, float] = (0.0, 0.0),
    dead_time_s: float = 0.0,
) -> Array:  # fmt: skip
    """Torque [N·m] of the plant at each row, each row's duty [%] held until the next; shapes (n,), any time steps.

    It starts with its fast and slow part at `start` [N·m]; a duty acts `dead_time_s` after its row, the first one from
    the beginning where the run starts loaded.
    """
    instants = np.union1d(time_s, time_s + dead_time_s) if dead_time_s > 0 else time_s
    acting = np.searchsorted(time_s + dead_time_s, instants, side="right") - 1
    before = float(duty_pct[0]) if any(start) else 0.0
    torque = np.empty(len(instants))
    x1, x2 = start
    duties = np.where(acting < 0, before, duty_pct[acting])
    ends = np.append(np.flatnonzero(np.diff(duties)) + 1, len(duties) - 1).tolist()
    torque[0] = x1 + x2
    for first, end, duty in zip([0, *ends[:-1]], ends, duties[[0, *ends[:-1]]].tolist(), strict=True):
        if end - first < FEW_ROWS:
            for k in range(first, end):
                x1, x2 = plant_step(plant, x1, x2, duty, float(instants[k + 1] - instants[k]))
                torque[k + 1] = x1 + x2
            continue
        # while a duty is held each part goes to its end exponentially, and from one side
        fast, slow, tau1, tau2 = plant_pull(plant, x1, x2, duty)
        since = instants[first + 1 : end + 1] - instants[first]
        parts = x1 - np.expm1(-since / tau1) * fast, x2 - np.expm1(-since / tau2) * slow
        torque[first + 1 : end + 1] = parts[0] + parts[1]
        x1, x2 = float(parts[0][-1]), float(parts[1][-1])
    return torque if dead_time_s == 0 else torque[np.searchsorted(instants, time_s)]


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


def compared(
    run: Run, plant: PlantParameters, keep_baseline: bool, units: tuple[str, str], dead_time_s: float
) -> Record:
    """The model's torque for a run's duty, on its own clock from 0, and how far it is from the recorded one, which
    stands as its reference.

    Raises `DataError` where its input or output is in another unit than the fit's.
    """
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
    time_s, torque = read_only(run.time_s - run.time_s[0]), read_only(run.output - idle)
    loaded = run.edge == "falling" or run.input[0] != 0
    start = start_of(plant, time_s, run.input, torque) if loaded else (0.0, 0.0)
    model = read_only(driven(plant, time_s, run.input, start, dead_time_s))
    apart = torque - model
    spread, left = float(np.linalg.norm(torque - torque.mean())), float(np.linalg.norm(apart))
    metrics = Metrics(
        max_abs_difference_nm=float(np.abs(apart).max()), rms_difference_nm=_rms(apart),
        mean_difference_nm=float(apart.mean()), idle_nm=idle, start_nm=sum(start), reference_is="recorded torque",
    )  # fmt: skip
    if spread > 0:
        metrics = msgspec.structs.replace(
            metrics, R2=1 - (left / spread) ** 2, fit_pct=100 * (1 - left / spread),
            one_step_pct=100 * (1 - float(np.linalg.norm(np.diff(apart))) / spread),
        )  # fmt: skip
    dt_s = float(time_s[-1] / (len(time_s) - 1))
    return record(Trace(run.name, dt_s, time_s, torque, model, run.input), metrics, role="recorded-input")
