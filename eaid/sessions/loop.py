"""Does a recorded loop do what its fit and gains promise: error and overshoot against the replay with its interval.

The log's own reference is replayed by the loop that ran, on the fitted plant and on drawn ones (or a replay is given);
a promise is kept where the recorded number is not above the upper end of what 95 % of the plants do. Recorded numbers
stand as they are read; the replay has no noise, so that the sensor's, by the scatter from sample to sample, is added to
what was promised. Where it hides the error, nothing is better than promised.
"""

from dataclasses import replace

import numpy as np

from eaid.arrays import Array, Mask, median
from eaid.errors import DataError, UsageError
from eaid.logs.run import Run
from eaid.options import CompareOptions, SimulateOptions
from eaid.replay.simulate import simulate
from eaid.results.common import Number, Result
from eaid.results.fit import Fit
from eaid.results.gains import Gains
from eaid.results.replay import Record, Replay
from eaid.steps.noise import block_noise

HIDES = 0.1  # Part of the recorded error's square from which noise hides it
ROUNDED_S = 1e-9  # Of a time stamp
# First rows of a log, and part of its reference by which their output lies off idle, where it begins under load
FIRST_ROWS, LOADED = 5, 0.1
# Standard errors, by the noise, that an RMS of so many rows lies off by chance, and a part of it that no one sees
RMS_ERRORS, NO_PART_OF_RMS = 2.0, 0.002
HELD_ROWS, JUMP_PART = 8, 1e-6  # Rows of a reference that is held, in the mean; part of a row that a jump of it takes


class Kept(Result, frozen=True):
    """One number of the loop: as recorded, as promised, with what 95 % of the plants do."""

    name: str
    recorded: Number
    promised: Number
    low: Number | None = None
    high: Number | None = None

    @property
    def kept(self) -> bool:
        """Whether the loop is as good as promised."""
        return self.recorded <= (self.promised if self.high is None else self.high)

    @property
    def word(self) -> str:
        """The same in words."""
        better = self.low is not None and self.recorded < self.low
        return "better than promised" if better else "kept" if self.kept else "worse than promised"


class Promise(Result, frozen=True):
    """A recorded loop against its replay."""

    controller: str
    log: str
    unit: str
    noise: Number = 0.0
    """Standard deviation of the sensor's white noise in the log."""
    rows: tuple[Kept, ...] = ()
    others: tuple[str, ...] = ()
    """Controllers that it may be the loop of as well, where none was named."""

    @property
    def kept(self) -> bool:
        """Whether every number is."""
        return all(one.kept for one in self.rows)

    def lines(self) -> list[str]:
        """The verdict, and every number."""
        said = [f"{'kept   ' if self.kept else 'MISSED '} {self.controller} in {self.log}"]
        for one in self.rows:
            ends = "" if one.high is None else f" ({one.low:.3g} … {one.high:.3g})"
            numbers = f"{one.recorded:.3g} {self.unit}, promised {one.promised:.3g}{ends}"
            said.append(f"        {one.name} {numbers}: {one.word}")
        if self.others:
            others = " or ".join(self.others)
            said.append(f"        taken for the loop of {self.controller}; if it is of {others}, say «controller»")
        return said


def promise_of(
    run: Run, options: CompareOptions, fit: Fit | None, gains: Gains | None, given: Replay | None
) -> Promise:
    """What was promised of a recorded loop, and what it does; DataError for a log without a reference."""
    if run.reference_nm is None or not run.has_input:
        raise DataError(
            f"{run.where}: holds no reference beside input and output; say its column with «columns» reference=NAME"
        )
    if fit is not None and fit.turned:  # as the fit took it
        run = replace(run, output=-run.output, reference_nm=-run.reference_nm)
    held = given.records if given is not None else gains.controllers_by_name if gains is not None else {}
    name = options.controller or next(iter(held), "")
    if not held and not options.controller:
        raise UsageError(f"{run.where}: is a loop's log; give the gains that it ran with, «gains» gains.json")
    if name not in held and name not in ("open-loop", "inverse"):
        raise UsageError(f"«controller» {name}: the files hold {', '.join(held) or 'none'}; give the loop that ran")
    if given is None:
        if fit is None:
            raise UsageError("a recorded loop is held against a fit with its gains, or a replay; give the fit too")
        timing = gains.margins.timing if gains is not None and gains.margins is not None else None
        how = SimulateOptions(
            controller=(name,), plants=options.plants, seed=options.seed,
            pwm_hz=(timing.pwm_hz or 0.0) if timing else 0.0,
        )  # fmt: skip
        refuse_loaded(run, fit)
        given = simulate(fit, gains, how, as_followed(run), one_run=True)
    units, wanted = (run.input_unit, run.output_unit), (given.head.input_unit, given.head.output_unit)
    if units != wanted:
        raise DataError(f"{run.where}: is in {' and '.join(units)}, the promise in {' and '.join(wanted)}; say «units»")
    noise = block_noise(run.output)
    record = given.records[name]
    from_s = max(record.metrics.counted_from_s or 0.0, given.head.counted_from_s or 0.0)
    others = () if options.controller else tuple(one for one in held if one != name)
    return Promise(name, run.where, run.output_unit, noise, _errors_of_loop(run, record, noise, from_s), others)


def refuse_loaded(run: Run, fit: Fit) -> None:
    """DataError for a log that begins while its loop runs: a replay begins at rest."""
    assert run.reference_nm is not None
    idle = run.baseline if run.baseline is not None else fit.plant.idle if fit.plant_ is not None else 0.0
    begin, size = median(run.output[:FIRST_ROWS]) - idle, float(np.ptp(run.reference_nm))
    driven = bool((run.input[:FIRST_ROWS] != 0).all())  # else what lies off idle is another zero of the sensor
    if driven and abs(begin) > LOADED * max(size, float(np.abs(run.reference_nm).max())):
        raise DataError(
            f"{run.where}: begins under load, {begin:.3g} {run.output_unit} above idle, while a replay begins at rest; "
            "give the log from where its loop began"
        )


def as_followed(run: Run) -> tuple[Array, Array]:
    """Time from 0 on and reference of a log; one that is held between its rows goes from value to value at once, as a
    loop at its own rate followed it, not in a ramp of a row."""
    assert run.reference_nm is not None
    time_s, wanted = run.time_s - run.time_s[0], run.reference_nm
    jumps = np.flatnonzero(np.diff(wanted)) + 1
    if not 0 < HELD_ROWS * len(jumps) <= len(wanted):
        return time_s, wanted
    before = time_s[jumps] - JUMP_PART * (time_s[jumps] - time_s[jumps - 1])
    return np.insert(time_s, jumps, before), np.insert(wanted, jumps, wanted[jumps - 1])


def _errors_of_loop(run: Run, record: Record, noise: float, from_s: float) -> tuple[Kept, ...]:
    """RMS and largest error from the instant on that those of the replay count from, and by how much the output peaks
    above the reference's highest value."""
    assert run.reference_nm is not None
    counted, top = run.time_s - run.time_s[0] >= from_s - ROUNDED_S, float(run.reference_nm.max())
    if not counted.any():
        raise DataError(f"{run.where}: ends before {from_s:g} s, from where on the replay's errors count")
    error = np.abs(run.reference_nm - run.output)[counted]
    seen = _part_in_rows(run, record, counted)
    spread = record.metrics.plants.metrics if record.metrics.plants is not None else {}
    peak_of_noise = noise * float(np.sqrt(2 * np.log(len(error))))  # what the largest of so many samples lies off by
    rms, largest = float(np.sqrt(np.mean(error**2))), float(error.max())
    hides = noise**2 > HIDES * rms**2
    rows = []
    for key, name, recorded in (("rms_error_nm", "RMS error", rms), ("max_abs_error_nm", "largest error", largest)):
        one, promised = spread.get(key), getattr(record.metrics, key) or 0.0
        low, high = (promised, promised) if one is None else (one.low or 0.0, one.high or 0.0)
        promised, low, high = (seen[key] * value for value in (promised, low, high))
        if key == "rms_error_nm":
            promised, low, high = np.hypot([promised, low, high], noise).tolist()
            chance = RMS_ERRORS * noise / len(error) ** 0.5 + NO_PART_OF_RMS * promised
            low, high = low - chance, high + chance
        else:  # where the noise of that instant may add to it, or not
            low, high = low - peak_of_noise, high + peak_of_noise
        rows.append(Kept(name, recorded, promised, max(min(low, recorded) if hides else low, 0.0), high))
    band, own = record.tables.get("plants/band_nm"), record.columns
    peak = max(float(own["torque_nm"].max() - own["reference_nm"].max()), 0.0)
    low, high = (None, None) if band is None else (max(float(band[k].max()) - top, 0.0) for k in (1, 5))
    high = None if high is None else max(high, peak)
    return *rows, Kept("overshoot", max(float(run.output.max()) - top - peak_of_noise, 0.0), peak, low, high)


def _part_in_rows(run: Run, record: Record, counted: Mask) -> dict[str, float]:
    """By what factor the errors of the replay are others at the log's rows alone: of a step that a log of 20 Hz holds,
    few rows show what happens after it."""
    time_s, own = run.time_s - run.time_s[0], record.columns
    at = np.clip(np.searchsorted(own["time_s"], time_s[counted] - ROUNDED_S), 0, len(own["time_s"]) - 1)
    off = np.abs(own["reference_nm"] - own["torque_nm"])
    whole = off[own["time_s"] >= time_s[counted][0] - ROUNDED_S]
    rms, largest = (float(size(off[at]) / size(whole)) if whole.any() else 1.0 for size in (np.linalg.norm, np.max))
    return {"rms_error_nm": rms * float(np.sqrt(len(whole) / len(at))), "max_abs_error_nm": largest}
