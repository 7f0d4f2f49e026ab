"""Recorded runs beside the fitted plant: their own input played again.

The input of a row acts until the next row's time, each interval exactly, behind the plant's dead time (`respond`), from
rest at first. A run that may begin loaded (a release, or a first input that is not zero) starts at the two states that
fit its first held input best (`start_of`), not at its first, noisy sample. A log of the fit itself has the idle output
and the start that were fitted, is without the creep and the jump that the fit is without, and is compared from where
the fit does. Of another, the recorded output is counted from its idle value: the run's own baseline, else the mean over
its leading rows at rest, else the plant's.

    difference = recorded − model:   largest, RMS, mean (its sign kept)
    R2                               1 − Σ (recorded − model)² / Σ (recorded − mean recorded)²
"""

import itertools
import math
from collections.abc import Sequence
from dataclasses import replace

import msgspec
import numpy as np

from eaid.arrays import Array, median, read_only
from eaid.errors import DataError
from eaid.estimate.recorded_log import creep_at, recorded_log, shift_input, without_drift
from eaid.logs.run import Run
from eaid.plant.dynamics import Plant, plant_numbers, plant_rest, plant_terms
from eaid.plant.respond import left_of_start, respond
from eaid.results.common import LogReplayed
from eaid.results.fit import Fit
from eaid.results.recorded import LogFit
from eaid.results.replay import Metrics, Record
from eaid.shown import pandas

MOST_START_ROWS = 20_000  # Most rows from which the start of a loaded run is estimated
LEAST_COMPARED_ROWS = 10
TELLS_APART = 50.0  # Condition of the two decays below which both parts of the start are estimated


def start_of(plant: Plant, time_s: Array, duty_pct: Array, torque_nm: Array) -> tuple[float, float]:
    """States with which a run begins: least squares over the first held input; shapes (n,).

    Both go to their ends while the input is held, so the output is linear in what they start with. Where the stretch is
    too short to tell the two apart, they are as after a long hold.
    """
    changed = np.flatnonzero(duty_pct != duty_pct[0])
    last = min(int(changed[0]) + 1 if len(changed) else len(duty_pct), MOST_START_ROWS)
    numbers, since, duty = plant_numbers(plant), time_s[:last] - time_s[0], float(duty_pct[0])
    ends = np.array(plant_rest(numbers, plant_terms(numbers, duty)[2]))
    rest = np.array(plant_rest(numbers, 1.0))
    found = []
    # a part that falls may have another time constant than one that rises: what fits best tells which it does
    for falls in itertools.product((False, True), (False, True)):
        decays = left_of_start(numbers, duty, since, falls)
        left = torque_nm[:last] - float(ends[0] + numbers.z * ends[1]) + ends @ decays
        if len(since) >= LEAST_COMPARED_ROWS and plant.kind != "lag" and np.linalg.cond(decays) < TELLS_APART:
            x = np.linalg.lstsq(decays.T, left)[0]
        else:
            together = rest @ decays
            x = rest * float(together @ left / (together @ together))
        found.append((float(np.sum((left - x @ decays) ** 2)), (float(x[0]), float(x[1]))))
    return min(found)[1]


def compared(run: Run, fit: Fit, plant: Plant) -> Record:
    """The plant's output for a run's input, on its own clock from 0, and how far it is from the recorded one, its
    reference; DataError where its input or output is in another unit than the fit's."""
    refuse_units_of_run(run, fit)
    if fit.turned:  # as the fit took it
        run = replace(run, output=-run.output, baseline=None if run.baseline is None else -run.baseline)
    level = recorded_log(run, float(fit.options.reading.get("rest") or 0.0))
    own = next((log for log in fit.logs if log.sha256 == run.sha256 and log.sha256 and log.name == run.name), None)
    if own is not None:
        level = shift_input(level, own.late_rows)
        share = (run.time_s - run.time_s[0]) / (run.time_s[-1] - run.time_s[0])
        jumped = own.jump[1] * (run.time_s - run.time_s[0] >= own.jump[0])
        output = without_drift(run.output - jumped, share, own.idle or 0.0, own.drift)
        run = replace(run, output=output - creep_at(share) @ np.array(own.creep))
    elif run.sha256 and any(one.sha256 == run.sha256 for one in fit.data.sources):  # a log of its steps
        level = shift_input(level, round(fit.noted_late_s / median(level.dt_s)))
        run = without_creep(run, fit)
    duty, stepwise = level.input, level.stepwise
    idle = idle_of(run, duty, own, plant)
    time_s, torque = read_only(run.time_s - run.time_s[0]), read_only(run.output - idle)
    loaded = run.edge == "falling" or duty[0] != 0
    if own is not None:
        start = own.start
    else:
        start = start_of(plant, time_s, duty, torque) if loaded else (0.0, 0.0)
    changes_s, inputs = time_s - level.late_s, duty
    if own is not None and start == (0.0, 0.0) and duty[0] != 0:  # switched on at its first row, from rest
        changes_s, inputs = np.append(changes_s[0] - time_s[1], changes_s), np.append(0.0, duty)
    model = read_only(respond(plant, changes_s, inputs, time_s, start, stepwise))
    from_s = own.counted_from_s if own is not None else 0.0
    counted = (time_s >= from_s - 1e-9 * time_s[-1]) & np.isfinite(level.output)
    metrics = distance_to(torque[counted], model[counted], idle, start[0] + start[1] * plant_numbers(plant).z)
    return Record(
        {"time_s": time_s, "reference_nm": torque, "torque_nm": model, "duty_pct": run.input},
        msgspec.structs.replace(metrics, counted_from_s=from_s or None),
        role="recorded-input",
    )


def without_creep(run: Run, fit: Fit) -> Run:
    """A log of a fit's steps without the creep of its output that the fit is without; 0 amid its idle time, one in
    proportion up to its step, and that of the end of the hold behind it."""
    source = next((one for one in fit.data.sources if (one.sha256, one.run) == (run.sha256, run.name)), None)
    if (creep := fit.data.creep) is None or source is None or source.step_s is None:
        return run
    since_s = run.time_s - source.step_s
    if not creep.in_proportion:
        return replace(run, output=read_only(run.output - creep.rate * (since_s + creep.t0_s)))
    idle, held_s = source.baseline_nm or 0.0, np.clip(since_s, 0.0, max(fit.data.record_s))
    return replace(run, output=read_only(idle + (run.output - idle) / (1 + creep.rate * held_s)))


def of_own_logs(fit: Fit, logs: Sequence[Run]) -> tuple[LogReplayed, ...]:
    """The logs behind a fit of steps through its plant, where their input was recorded and is held."""
    rest, found = float(fit.options.reading.get("rest") or 0.0), []
    fitted = {one.sha256 for one in fit.data.sources if one.edge != "falling"}
    for run in logs if fit.plant_ is not None else ():
        if run.sha256 not in fitted or (run.cut and fit.on_tails):  # it was left out, or what it begins on is not known
            continue
        if np.isfinite(run.input).all() and run.edge == "rising" and recorded_log(run, rest).stepwise:
            metrics = compared(run, fit, fit.plant).metrics
            found.append(LogReplayed(run.name, run.source, metrics.fit_pct, metrics.rms_difference_nm))
    return tuple(found)


def residuals_of_logs(fit: Fit, runs: Sequence[Run]) -> "pandas.DataFrame":
    """The recorded outputs of logs behind a fit, without a creep that was taken off, and the plant's, from where they
    are compared; indexed by (log, time_s)."""
    parts = {}
    for run in runs:
        record = compared(run, fit, fit.plant)
        metrics, time_s = record.metrics, record.columns["time_s"]
        counted = time_s >= (metrics.counted_from_s or 0.0) - 1e-9 * time_s[-1]
        both = {
            name: record.columns[column][counted] + (metrics.idle_nm or 0.0)
            for name, column in (("recorded", "reference_nm"), ("fitted", "torque_nm"))
        }
        parts[run.name] = pandas.DataFrame(both, index=time_s[counted])
    return pandas.concat(parts, names=["log", "time_s"])


def distance_to(torque: Array, model: Array, idle: float, start: float) -> Metrics:
    """How far a model is from what was recorded."""
    off = torque - model
    spread, left = float(np.linalg.norm(torque - torque.mean())), float(np.linalg.norm(off))
    metrics = Metrics(
        max_abs_difference_nm=float(np.abs(off).max()), rms_difference_nm=math.sqrt(float(np.mean(off * off))),
        mean_difference_nm=float(off.mean()), idle_nm=idle, start_nm=start,
    )  # fmt: skip
    if spread == 0:
        return metrics
    return msgspec.structs.replace(
        metrics, R2=1 - (left / spread) ** 2, fit_pct=100 * (1 - left / spread),
        one_step_pct=100 * (1 - float(np.linalg.norm(np.diff(off))) / spread),
    )  # fmt: skip


def idle_of(run: Run, duty: Array, own: LogFit | None, plant: Plant) -> float:
    """The output at rest that a run is counted from."""
    if own is not None and own.idle is not None:
        return own.idle
    if run.baseline is not None:
        return run.baseline
    acting = np.flatnonzero(duty != 0)
    before = int(acting[0]) if len(acting) else 0
    return float(run.output[:before].mean()) if before and run.edge == "rising" else plant.idle


def refuse_units_of_run(run: Run, fit: Fit) -> None:
    """DataError where a run's input or output is in another unit than the fit's."""
    units = fit.data.input_unit, fit.data.output_unit
    if np.isnan(run.input).any():
        raise DataError(
            f"{run.source}: {run.name} has no input in every row, and the input drives the model; log it, or name its "
            "column with «columns» input=NAME"
        )
    if run.input_unit != units[0]:
        raise DataError(
            f"{run.source}: {run.name} holds no input in {units[0]}, which the fit has (its own is {run.input_unit}); "
            "say the column and its unit with «columns» and «units»"
        )
    if run.output_unit != units[1]:
        raise DataError(
            f"{run.source}: {run.name} holds an output in {run.output_unit}, the fit one in {units[1]}; say the "
            "column and its unit with «columns» and «units»"
        )
