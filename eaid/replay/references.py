"""Torque references of the paper's experiments, and a user's own, at the control rate."""

import csv
import itertools
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from eaid.arrays import Array, read_only
from eaid.control.defaults import Scales
from eaid.control.guarantee import steepest
from eaid.errors import DataError, UsageError
from eaid.findings import Finding, finding
from eaid.logs.table import seconds
from eaid.plant.dynamics import PlantNumbers, plant_terms
from eaid.results.verdict import LARGEST_OUTPUT

Signal = tuple[Array, Array]  # Time [s] and output, shapes (n,) each

MOST_SAMPLES = 20_000_000  # Most control samples of one replay


@dataclass(frozen=True, eq=False)
class Reference:
    """A torque reference [N·m] at intervals of dt_s, and where it is measured."""

    torque_nm: Array
    dt_s: float
    counted_from_s: float = 0.0  # Errors before this instant do not count [s]
    steps: tuple[int, ...] = ()  # Samples at which the reference steps; each is measured until the next, or the end
    # Frequencies of a sweep [Hz], and the samples over which the fundamental of each is measured: first, end
    tones: tuple[tuple[float, int, int], ...] = ()

    @property
    def begin(self) -> int:
        """First sample whose error counts."""
        return round(self.counted_from_s / self.dt_s)

    @property
    def steepest_nm_s(self) -> float:
        """Largest slope [N·m/s]."""
        return steepest(self.torque_nm, self.dt_s)


def steps(dt_s: float, duration_s: float | None, top: float, pace: float) -> Reference:
    """Fig. 11: a staircase 0…4 N·m up and down, each level held as long, 5 s by default."""
    levels = top * np.array([0.0, 1.0, 2.0, 3.0, 4.0, 3.0, 2.0, 1.0, 0.0])
    hold = samples_of(5.0 / pace if duration_s is None else duration_s / len(levels), dt_s)
    torque = np.repeat(levels, hold)
    return Reference(read_only(torque), dt_s, steps=tuple((np.flatnonzero(np.diff(torque)) + 1).tolist()))


def multisine(dt_s: float, duration_s: float | None, top: float, pace: float) -> Reference:
    """Fig. 12: 2 + 0.2 Σ sin(2πft + φ) N·m, f = 0.2, 0.5, 1, 2, 4 Hz, φ = 1.7·(0, 1, 4, 9, 16), 12 s; errors count
    after 5 s."""
    length, settled = 12.0 / pace if duration_s is None else duration_s, 5.0 / pace
    t = np.arange(samples_of(length, dt_s)) * dt_s
    torque = np.full_like(t, 2.0 * top)
    for k, frequency in enumerate((0.2, 0.5, 1.0, 2.0, 4.0)):
        torque += 0.2 * top * np.sin(2 * math.pi * (pace * frequency) * t + 1.7 * k * k)
    return Reference(read_only(torque), dt_s, counted_from_s=settled if length > settled else 0.0)


def sweep(dt_s: float, duration_s: float | None, top: float, pace: float) -> Reference:
    """Fig. 13: sines 2 ± 1 N·m, 0.2 to 3 Hz, one after another, each from phase 0 for whole periods: 10 s to settle,
    then 5 s and two periods at least to measure."""
    if duration_s is not None:
        raise UsageError("the sweep's length follows from its frequencies; leave «duration» out")
    frequencies_hz = [pace * f for f in (0.2, 0.3, 0.4, 0.6, 0.8, 1.0, 1.5, 2.0, 2.5, 3.0)]
    if max(frequencies_hz) > 0.25 / dt_s:
        raise UsageError(
            f"sweep: frequencies must lie above 0 and up to a quarter of the control rate, {0.25 / dt_s:g} Hz; raise "
            "«rate_hz»"
        )
    pieces, tones, begin = [], [], 0
    for frequency in frequencies_hz:
        before, periods = math.ceil(10.0 / pace * frequency), max(2, math.ceil(5.0 / pace * frequency))
        measured_from = begin + round(before / frequency / dt_s)
        end = begin + round((before + periods) / frequency / dt_s)
        t = np.arange(end - begin) * dt_s
        pieces.append(2.0 * top + top * np.sin(2 * math.pi * frequency * t))
        tones.append((frequency, measured_from, end))
        begin = end
    torque = np.concatenate(pieces)
    return Reference(read_only(torque), dt_s, counted_from_s=tones[0][1] * dt_s, tones=tuple(tones))


FIRST_PART = 0.2  # Of a reference that begins off rest


def from_its_start(wanted: Reference) -> Reference:
    """A reference by which controllers are compared: where it begins off rest, as no loop does, errors count after its
    first part, for the jump is the same for all of them."""
    if not wanted.torque_nm[0] or wanted.counted_from_s:
        return wanted
    return replace(wanted, counted_from_s=FIRST_PART * len(wanted.torque_nm) * wanted.dt_s)


def sampled(time_s: Array, torque_nm: Array, dt_s: float) -> Reference:
    """A reference of the user's own on the control grid, by straight lines between its points, shapes (n,)."""
    lasts_s = float(time_s[-1] - time_s[0])
    n = math.floor(min(lasts_s / dt_s, 1e15) + 1e-6) + 1
    if n < 2:
        raise DataError(f"the reference: lasts {lasts_s:g} s, less than one control interval; give a longer reference")
    refuse_too_long(f"the reference: lasts {lasts_s:g} s, which is", n, dt_s)
    grid = time_s[0] + np.arange(n) * dt_s
    return Reference(read_only(np.interp(grid, time_s, torque_nm)), dt_s)


GIVEN_S = 10.0  # Length of a reference that is a function [s]


def signal_of(given: Any, dt_s: float, duration_s: float | None = None) -> Signal:
    """A reference as a user gives it: a file, a Series over time [s], rows (time, reference), one value a control
    sample, or a function of time [s]."""
    if isinstance(given, str | os.PathLike):
        time_s, values = np.array([row for _, row in read_rows(Path(given), ("time_s", "reference_nm"))]).T
        return time_s, values
    signal: Any
    try:
        if callable(given):
            time_s = np.arange(samples_of(GIVEN_S if duration_s is None else duration_s, dt_s)) * dt_s
            signal = time_s, np.array([float(given(t)) for t in time_s.tolist()])
        elif hasattr(given, "index") and hasattr(given, "to_numpy"):
            at = np.asarray(given.index)
            signal = seconds(at) if at.dtype.kind in "mM" else np.asarray(at, np.float64), np.asarray(given, np.float64)
        else:
            rows = np.asarray(given, dtype=np.float64)
            rows = rows.T if rows.ndim == 2 and rows.shape[1] == 2 else rows
            signal = (rows[0], rows[1]) if rows.ndim == 2 and len(rows) == 2 else (np.arange(rows.size) * dt_s, rows)
        time_s, values = signal
        fine = (
            values.ndim == 1
            and len(values) >= 2
            and (np.abs(signal) <= LARGEST_OUTPUT).all()
            and (np.diff(time_s) > 0).all()
        )
    except (TypeError, ValueError):
        fine = False
    if not fine:
        raise UsageError(
            "«reference»: give finite numbers over a time that rises: a Series over seconds, an array of rows (time, "
            "reference) or of one value a control sample, or a function of time"
        )
    return read_only(time_s), read_only(values)


def read_rows(
    path: Path, header: Sequence[str], names: Mapping[str, str] = MappingProxyType({})
) -> list[tuple[int, list[float]]]:
    """Row numbers and finite numbers of a CSV whose header holds these columns, or other `names` of them; DataError for
    another header, or with its bad rows: the first column is a time that rises."""
    wanted = ",".join(header)
    if not path.is_file():
        raise DataError(f"{path}: {'is no plain file' if path.exists() else 'no such file'}; give a CSV {wanted}")
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise DataError(f"{path}: is no text; give a CSV {wanted}") from None
    lines = enumerate(csv.reader(text.splitlines()), 1)
    rows = [(number, row) for number, row in lines if any(map(str.strip, row)) and row[0][:1] != "#"]
    named = [names.get(cell.strip(), cell.strip()) for cell in rows[0][1]] if rows else []
    if not set(header) <= set(named):
        raise DataError(f"{path}: its header is not {wanted}, but {','.join(named) or 'empty'}; name these columns")
    columns = [named.index(name) for name in header]
    faults, numbers = [], []
    for number, row in rows[1:]:
        try:
            values = [float(row[column]) for column in columns] if len(row) == len(named) else []
        except ValueError:
            values = []
        if values and all(map(math.isfinite, values)):
            numbers.append((number, values))
        else:
            faults.append(f"{path}: row {number} holds {','.join(row)!r}, not {len(header)} finite numbers; mend it")
    for (_, before), (number, now) in itertools.pairwise(numbers):
        if now[0] <= before[0]:
            faults.append(
                f"{path}: time does not rise at row {number} ({now[0]:g} s after {before[0]:g} s); sort the rows or "
                "drop this one"
            )
    if faults:
        raise DataError(*faults[:20])
    if len(numbers) < 2:
        raise DataError(f"{path}: holds {len(numbers)} row(s) of data; two or more are needed")
    return numbers


def samples_of(duration_s: float, dt_s: float) -> int:
    """Control samples in a duration; `UsageError` below two."""
    n = round(duration_s / dt_s)
    if n < 2:
        raise UsageError(f"a duration of {duration_s:g} s holds fewer than two control samples of {dt_s:g} s")
    refuse_too_long(f"a duration of {duration_s:g} s holds", n, dt_s)
    return n


def refuse_too_long(said: str, n: int, dt_s: float) -> None:
    """UsageError where there are more control samples than a replay takes."""
    if n > MOST_SAMPLES:
        raise UsageError(
            f"{said} {n:,} control samples of {dt_s:g} s, and a replay takes {MOST_SAMPLES:,}; make it shorter or give "
            "a lower «rate_hz»"
        )


# Name → its reference at an interval and of a length [s], with factors on the paper's torque and frequencies; its times
# are divided by the latter
SCENARIO_SIGNALS = {"steps": steps, "multisine": multisine, "sweep": sweep}


MOST_PACE = 1 / 16  # Over the interval: four samples of the multisine's highest frequency


def reference_of(wanted: str | Signal, dt_s: float, scales: Scales, duration_s: float | None = None) -> Reference:
    """A scenario at the rig's own scale, or a signal of the user's own."""
    if not isinstance(wanted, str):
        return sampled(*wanted, dt_s)
    pace = min(scales.pace, max(MOST_PACE / dt_s, 1.0))  # a slow controller follows slower ones
    return SCENARIO_SIGNALS[wanted](dt_s, duration_s, scales.top, pace)


def reference_beyond(wanted: Reference, plant: PlantNumbers, subject: str, unit: str) -> list[Finding]:
    """Whether a reference goes beyond what the plant has."""
    asked, highest = float(wanted.torque_nm.max()), plant_terms(plant, plant.u_high)[2]
    if asked <= highest:
        return []
    return [finding("reference-above-plant", subject, asked=asked, highest=highest, unit=unit)]
