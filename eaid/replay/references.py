"""Torque references of the paper's experiments, at the control rate, and what is to be measured on each."""

import csv
import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

import msgspec
import numpy as np

from eaid.arrays import Array, read_only
from eaid.control.defaults import Scales
from eaid.errors import DataError, UsageError
from eaid.replay import metrics
from eaid.replay.loop import Trace
from eaid.results.replay import Metrics, Record, Role

Signal = tuple[Array, Array]  # Time [s] and output, shapes (n,) each

MOST_SAMPLES = 20_000_000  # Most control samples of one replay


@dataclass(frozen=True)
class Tone:
    """One frequency of a sweep: the samples over which its fundamental is measured."""

    frequency_hz: float
    begin: int
    end: int


@dataclass(frozen=True, eq=False)
class Reference:
    """A torque reference [N·m] at intervals of dt_s, and where it is measured."""

    torque_nm: Array
    dt_s: float
    counted_from_s: float = 0.0  # Errors before this instant do not count [s]
    steps: tuple[int, ...] = ()  # Samples at which the reference steps; each is measured until the next, or the end
    tones: tuple[Tone, ...] = ()

    @property
    def begin(self) -> int:
        """First sample whose error counts."""
        return round(self.counted_from_s / self.dt_s)

    @property
    def steepest_nm_s(self) -> float:
        """Largest slope [N·m/s], by central differences."""
        return float(np.abs(np.gradient(self.torque_nm, self.dt_s)).max())


def steps(dt_s: float, duration_s: float | None = None, top: float = 1.0, pace: float = 1.0) -> Reference:
    """Fig. 11: a staircase 0…4 N·m up and down, each level held as long, 5 s by default.

    `top` is a factor on the torque; times are divided by `pace`.
    """
    levels = top * np.array([0.0, 1.0, 2.0, 3.0, 4.0, 3.0, 2.0, 1.0, 0.0])
    hold = samples_of(5.0 / pace if duration_s is None else duration_s / len(levels), dt_s)
    torque = np.repeat(levels, hold)
    return Reference(read_only(torque), dt_s, steps=tuple((np.flatnonzero(np.diff(torque)) + 1).tolist()))


def multisine(dt_s: float, duration_s: float | None = None, top: float = 1.0, pace: float = 1.0) -> Reference:
    """Fig. 12: 2 + 0.2 Σ sin(2πft + φ) N·m, f = 0.2, 0.5, 1, 2, 4 Hz, φ = 1.7·(0, 1, 4, 9, 16), 12 s; errors count
    after 5 s.

    `top` is a factor on the torque, `pace` on the frequencies; times are divided by it.
    """
    length, settled = 12.0 / pace if duration_s is None else duration_s, 5.0 / pace
    t = np.arange(samples_of(length, dt_s)) * dt_s
    torque = np.full_like(t, 2.0 * top)
    for k, frequency in enumerate((0.2, 0.5, 1.0, 2.0, 4.0)):
        torque += 0.2 * top * np.sin(2 * math.pi * (pace * frequency) * t + 1.7 * k * k)
    return Reference(read_only(torque), dt_s, counted_from_s=settled if length > settled else 0.0)


def sweep(dt_s: float, duration_s: float | None = None, top: float = 1.0, pace: float = 1.0) -> Reference:
    """Fig. 13: sines 2 ± 1 N·m, 0.2 to 3 Hz, one after another, each from phase 0 for whole periods.

    Each settles for 10 s, then is measured for 5 s and two periods at least. `top` is a factor on the torque, `pace` on
    the frequencies; times are divided by it.
    """
    if duration_s is not None:
        raise UsageError("the sweep's length follows from its frequencies; leave «duration» out")
    frequencies_hz = [pace * f for f in (0.2, 0.3, 0.4, 0.6, 0.8, 1.0, 1.5, 2.0, 2.5, 3.0)]
    if max(frequencies_hz) > 0.25 / dt_s:
        raise UsageError(
            f"sweep: frequencies must lie above 0 and up to a quarter of the control rate, {0.25 / dt_s:g} Hz"
        )
    pieces, tones, begin = [], [], 0
    for frequency in frequencies_hz:
        before, periods = math.ceil(10.0 / pace * frequency), max(2, math.ceil(5.0 / pace * frequency))
        measured_from = begin + round(before / frequency / dt_s)
        end = begin + round((before + periods) / frequency / dt_s)
        t = np.arange(end - begin) * dt_s
        pieces.append(2.0 * top + top * np.sin(2 * math.pi * frequency * t))
        tones.append(Tone(frequency, measured_from, end))
        begin = end
    torque = np.concatenate(pieces)
    return Reference(read_only(torque), dt_s, counted_from_s=tones[0].begin * dt_s, tones=tuple(tones))


def sampled(time_s: Array, torque_nm: Array, dt_s: float, name: str = "the reference") -> Reference:
    """A reference of the user's own on the control grid, by straight lines between its points, shapes (n,)."""
    n = math.floor(min((time_s[-1] - time_s[0]) / dt_s, 1e15) + 1e-6) + 1
    if n < 2:
        raise DataError(
            f"{name}: lasts {time_s[-1] - time_s[0]:g} s, less than one control interval; give a longer reference"
        )
    if n > MOST_SAMPLES:
        raise UsageError(
            f"{name}: lasts {time_s[-1] - time_s[0]:g} s, which is {n:,} control samples of {dt_s:g} s, and a "
            f"replay takes {MOST_SAMPLES:,}; give a lower «rate_hz»"
        )
    grid = time_s[0] + np.arange(n) * dt_s
    return Reference(read_only(np.interp(grid, time_s, torque_nm)), dt_s)


def read_rows(
    path: Path, header: Sequence[str], names: Mapping[str, str] = MappingProxyType({})
) -> list[tuple[int, list[float]]]:
    """Rows of a CSV whose header holds these columns, or other `names` of them, with their finite numbers.

    Raises `DataError` where the file has another header, or with its bad rows.
    """
    wanted = ",".join(header)
    if not path.is_file():
        raise DataError(f"{path}: no such file; give a CSV {wanted}")
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
        if not values or not all(map(math.isfinite, values)):
            faults.append(f"{path}: row {number} holds {','.join(row)!r}, not {len(header)} finite numbers; mend it")
        else:
            numbers.append((number, values))
    if faults:
        raise DataError(*faults[:20])
    return numbers


def read_reference(path: Path) -> Signal:
    """Time [s] and reference [N·m] of a CSV with the columns time_s,reference_nm; at least two rows."""
    rows = read_rows(path, ("time_s", "reference_nm"))
    if len(rows) < 2:
        raise DataError(f"{path}: holds {len(rows)} row(s) of data; a reference needs two or more")
    time_s, torque_nm = np.array([values for _, values in rows]).T
    for k in np.flatnonzero(np.diff(time_s) <= 0)[:1]:
        raise DataError(
            f"{path}: time does not rise at row {rows[k + 1][0]} ({time_s[k + 1]:g} s after {time_s[k]:g} s); "
            "sort it or drop the row"
        )
    return time_s, torque_nm


def samples_of(duration_s: float, dt_s: float) -> int:
    """Control samples in a duration; `UsageError` below two."""
    n = round(duration_s / dt_s)
    if n < 2:
        raise UsageError(f"a duration of {duration_s:g} s holds fewer than two control samples of {dt_s:g} s")
    if n > MOST_SAMPLES:
        raise UsageError(
            f"a duration of {duration_s:g} s holds {n:,} control samples of {dt_s:g} s, and a replay takes "
            f"{MOST_SAMPLES:,}; give a shorter «duration» or a lower «rate_hz»"
        )
    return n


# Name → its reference at an interval and of a length [s], with factors on the paper's torque and frequencies
SCENARIOS: dict[str, Callable[[float, float | None, float, float], Reference]] = {
    "steps": steps,
    "multisine": multisine,
    "sweep": sweep,
}


def reference_of(wanted: str | Signal, dt_s: float, scales: Scales, duration_s: float | None = None) -> Reference:
    """A scenario at the rig's own scale, or a signal of the user's own."""
    if not isinstance(wanted, str):
        return sampled(*wanted, dt_s)
    return SCENARIOS[wanted](dt_s, duration_s, scales.top, scales.pace)


def measure(trace: Trace, reference: Reference) -> Metrics:
    """All metrics of a replay on its reference: tracking, then per step and per tone where there are any."""
    wanted, torque, dt_s = trace.reference_nm, trace.torque_nm, trace.dt_s
    steps = [
        metrics.step(torque[a:b], float(wanted[a - 1]), float(wanted[a]), dt_s)
        for a, b in itertools.pairwise([*reference.steps, len(torque)])
    ]
    tones = [
        metrics.tone(wanted[tone.begin : tone.end], torque[tone.begin : tone.end], tone.frequency_hz, dt_s)
        for tone in reference.tones
    ]
    return Metrics(
        **msgspec.structs.asdict(trace.tracking(slice(reference.begin, None))),
        counted_from_s=reference.counted_from_s,
        steps=tuple(steps),
        frequencies=tuple(tones),
    )


def record(
    trace: Trace, measured: Metrics, further: Mapping[str, Array] | None = None, role: Role = "controller"
) -> Record:
    """A replay as a group of replay.h5, with further columns of its length."""
    names = ("time_s", "reference_nm", "torque_nm", "duty_pct", "measured_nm", "applied_pct")
    columns = {name: column for name in names if (column := getattr(trace, name)) is not None}
    return Record({**columns, **(further or {})}, measured, role=role)
