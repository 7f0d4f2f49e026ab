"""Torque references of the paper's experiments, at the control rate, and what is to be measured on each."""

import itertools
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np
import pandas

from eaid.arrays import Array, read_only
from eaid.control.defaults import Scales
from eaid.errors import DataError, UsageError
from eaid.replay import metrics
from eaid.replay.loop import Trace
from eaid.results.replay import Metrics, Record, Role

STEP_LEVELS_NM = (0.0, 1.0, 2.0, 3.0, 4.0, 3.0, 2.0, 1.0, 0.0)
"""Fig. 11: 0…4 N·m up and down."""
STEP_HOLD_S = 5.0
RAMP_NM = 4.0
RAMP_S = 10.0
"""Peak of the triangle [N·m] and its length [s]."""
MULTISINE_HZ = (0.2, 0.5, 1.0, 2.0, 4.0)
MULTISINE_PHASES = tuple(1.7 * k * k for k in range(len(MULTISINE_HZ)))
"""Fig. 12, specification 6 [rad]."""
MULTISINE_S = 12.0
"""Default length: 5 s to settle, and 7 s that count."""
SETTLED_S = 5.0
"""Errors of a periodic reference count from here."""
SWEEP_HZ = (0.2, 0.3, 0.4, 0.6, 0.8, 1.0, 1.5, 2.0, 2.5, 3.0)
"""Fig. 13."""
TONE_SETTLING_S = 10.0
TONE_MEASURED_S = 5.0
TONE_PERIODS = 2
"""Each tone of a sweep settles for the first, then is measured for the second, and for that many periods at least."""


Signal = tuple[Array, Array]
"""Time [s] and output, shapes (n,) each."""

MOST_SAMPLES = 20_000_000
"""Most control samples of one replay."""


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
    counted_from_s: float = 0.0
    """Errors before this instant do not count [s]."""
    steps: tuple[int, ...] = ()
    """Samples at which the reference steps; each is measured until the next, or the end."""
    tones: tuple[Tone, ...] = ()

    @property
    def begin(self) -> int:
        """First sample whose error counts."""
        return round(self.counted_from_s / self.dt_s)

    @property
    def steepest_nm_s(self) -> float:
        """Largest slope [N·m/s], by central differences."""
        return float(np.abs(np.gradient(self.torque_nm, self.dt_s)).max())


def steps(
    dt_s: float, duration_s: float | None = None, top: float = 1.0, pace: float = 1.0,
    levels_nm: tuple[float, ...] = STEP_LEVELS_NM,
) -> Reference:  # fmt: skip
    """A staircase of levels [N·m] times `top`, each held as long, 5 s by default; that time is divided by `pace`."""
    hold = samples_of(STEP_HOLD_S / pace if duration_s is None else duration_s / len(levels_nm), dt_s)
    torque = np.repeat([top * level for level in levels_nm], hold)
    return Reference(read_only(torque), dt_s, steps=tuple((np.flatnonzero(np.diff(torque)) + 1).tolist()))


def ramp(dt_s: float, duration_s: float | None = None, top: float = 1.0, pace: float = 1.0) -> Reference:
    """A triangle 0 → 4 → 0 N·m at one slope, 10 s by default: 0.8 N·m/s up and down.

    `top` is a factor on the torque; times are divided by `pace`.
    """
    n = samples_of(RAMP_S / pace if duration_s is None else duration_s, dt_s)
    share = np.arange(n) / (n - 1)
    return Reference(read_only(RAMP_NM * top * (1.0 - np.abs(2.0 * share - 1.0))), dt_s)


def multisine(dt_s: float, duration_s: float | None = None, top: float = 1.0, pace: float = 1.0) -> Reference:
    """2 + 0.2 Σ sin(2πft + φ) N·m, f = 0.2, 0.5, 1, 2, 4 Hz, φ = 1.7·(0, 1, 4, 9, 16), 12 s; errors count after 5 s.

    `top` is a factor on the torque, `pace` on the frequencies; times are divided by it.
    """
    length = MULTISINE_S / pace if duration_s is None else duration_s
    t = np.arange(samples_of(length, dt_s)) * dt_s
    torque = np.full_like(t, 2.0 * top)
    for frequency, phase in zip(MULTISINE_HZ, MULTISINE_PHASES, strict=True):
        torque += 0.2 * top * np.sin(2 * math.pi * (pace * frequency) * t + phase)
    settled = SETTLED_S / pace
    return Reference(read_only(torque), dt_s, counted_from_s=settled if length > settled else 0.0)


def sweep(
    dt_s: float, duration_s: float | None = None, top: float = 1.0, pace: float = 1.0,
    frequencies_hz: tuple[float, ...] = SWEEP_HZ,
) -> Reference:  # fmt: skip
    """Sines 2 ± 1 N·m of rising frequency one after another, each from phase 0 for whole periods.

    `top` is a factor on the torque, `pace` on the frequencies; times are divided by it.
    """
    if duration_s is not None:
        raise UsageError("the sweep's length follows from its frequencies; leave «duration» out")
    frequencies_hz = tuple(pace * frequency for frequency in frequencies_hz)
    if max(frequencies_hz) > 0.25 / dt_s:
        raise UsageError(
            f"sweep: frequencies must lie above 0 and up to a quarter of the control rate, {0.25 / dt_s:g} Hz"
        )
    pieces, tones, begin = [], [], 0
    for frequency in frequencies_hz:
        periods_before = math.ceil(TONE_SETTLING_S / pace * frequency)
        periods = max(TONE_PERIODS, math.ceil(TONE_MEASURED_S / pace * frequency))
        measured_from = begin + round(periods_before / frequency / dt_s)
        end = begin + round((periods_before + periods) / frequency / dt_s)
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


def read_reference(path: Path) -> tuple[Array, Array]:
    """Time [s] and reference [N·m] of a CSV with that header; at least two rows."""
    if not path.is_file():
        raise DataError(f"{path}: no such file; give a CSV with the columns time_s,reference_nm")
    try:
        table = pandas.read_csv(path, dtype=str, keep_default_na=False, skip_blank_lines=False, encoding="utf-8-sig")
    except pandas.errors.EmptyDataError:
        table = pandas.DataFrame()
    except (UnicodeDecodeError, pandas.errors.ParserError):
        raise DataError(f"{path}: is no text file; give a CSV with the columns time_s,reference_nm") from None
    table = table.rename(columns=str.strip).fillna("")
    if not {"time_s", "reference_nm"} <= set(table.columns):
        names = ",".join(map(str, table.columns)) or "nothing"
        raise DataError(f"{path}: its first row must name the columns time_s,reference_nm; it has {names}")
    table = table[(table != "").any(axis=1)]
    numbers = table[["time_s", "reference_nm"]].apply(pandas.to_numeric, errors="coerce").astype(float)
    finite = np.isfinite(numbers)
    for row, name in [(row, name) for row in table.index for name in numbers if not finite.at[row, name]][:1]:
        cell = str(table.at[row, name]).strip()
        raise DataError(f"{path}: {name} in row {row + 2} is {cell!r}, not a finite number; mend or drop the row")
    if len(table) < 2:
        raise DataError(f"{path}: holds {len(table)} row(s) of data; a reference needs two or more")
    time_s, torque_nm = (numbers[name].to_numpy() for name in numbers)
    for k in np.flatnonzero(np.diff(time_s) <= 0)[:1]:
        raise DataError(
            f"{path}: time does not rise at row {table.index[k + 1] + 2} ({time_s[k + 1]:g} s after {time_s[k]:g} s); "
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


SCENARIOS: dict[str, Callable[[float, float | None, float, float], Reference]] = {
    "steps": steps,
    "multisine": multisine,
    "sweep": sweep,
    "ramp": ramp,
}
"""Name → its reference at an interval and of a length [s], with factors on the paper's torque and frequencies."""


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
