"""The time column → seconds since the log's first sample.

The first stamp is subtracted before anything else, in the type that the file has: stamps of 1.7e9 s, or of 1.7e18 ns,
give the times of a clock that starts at 0. Where nothing says the unit, the numbers themselves are looked at: stamps
since 1970 count s, ms, µs or ns, Excel and MATLAB count days, and a clock that no bench has is a finding.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eaid.arrays import Array, read_only
from eaid.errors import DataError, UsageError
from eaid.findings import Finding, finding
from eaid.logs.columns import COUNTERS
from eaid.logs.units import TIME_UNITS, divisor, likely_time_unit, split_name, unit_of, words_of

PER_S = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}
"""What clocks count that began in 1970."""
EPOCH_S = (1e9, 4e9)
"""First stamps of logs of 2001 to 2096, counted from 1970 [s]."""
DAY_S = 86400.0
SLOWEST_S = 90.0
"""Sample time beyond which a clock without a unit counts not from 1970, but in a finer unit from power-up."""
DAYS = ((30_000.0, 60_000.0), (700_000.0, 770_000.0))
"""First stamps in days: Excel's of 1982 to 2064, MATLAB's datenum of 1916 to 2108."""
FASTEST_HZ = 50_000.0
"""Sample rate beyond which a clock whose unit nobody gave is doubted."""
NO_BENCH_HZ = 5e6
"""Sample rate beyond which any clock is doubted."""
LONGEST_S = 3600.0
"""Span beyond which whole numbers of a clock whose unit nobody gave are no seconds."""


@dataclass(frozen=True)
class TimeScale:
    """Seconds in one unit of a time column, and whether somebody said so."""

    factor: float
    stated: bool
    """The user, the file or the column's name says the unit."""
    by_user: bool = False


def time_scale(path: str, said: str | None, column: str, file_unit: str) -> TimeScale:
    """Unit of a time column: what the user says, else the file, else its name; raises where that is no unit of time."""
    if said is not None:
        known = unit_of(said)
        if said.startswith("/"):
            return TimeScale(1.0 / divisor("time", said), True, True)
        if known is None or known.quantity != "time":
            raise UsageError(f"«units» time={said}: is no unit of time; use {TIME_UNITS}")
        return TimeScale(known.factor, True, True)
    bare, named = split_name(column)
    text = file_unit or named or (bare if len(bare) > 1 or bare == "s" else "")
    known = unit_of(text) if text else None
    if known is not None and known.quantity == "time":
        return TimeScale(known.factor, True)
    if file_unit or named:
        raise DataError(
            f"{path}: column {column} is in {file_unit or named}, which is no unit of time that eaid knows; "
            f"say it with «units» time=UNIT ({TIME_UNITS})"
        )
    return TimeScale(1.0, False)


def seconds_since_start(
    path: str, column: str, raw: NDArray[Any], scale: TimeScale
) -> tuple[Array, float, tuple[Finding, ...]]:
    """Time since the first sample [s], shape (n,), the clock there [s], and what is doubtful in it.

    `raw` rises; raises DataError where the column numbers the samples, or names a unit that its stamps contradict.
    """
    if not len(raw):
        return np.empty(0), 0.0, ()
    first = raw[0]
    gone = read_only(raw - first)
    usual = float(np.median(np.diff(gone[:10_000]))) if len(gone) > 1 else 0.0
    factor, findings = scale.factor, list[Finding]()
    counted = _epoch(float(first))
    if not scale.stated:
        if words_of(split_name(column)[0]) & COUNTERS and usual == 1.0:
            raise DataError(
                f"{path}: column {column} numbers the samples and is no time; give their rate with «rate_hz» HZ and "
                f"name no time column, or say «units» time=/1000 for 1000 samples a second"
            )
        if counted is not None and usual / PER_S[counted] <= SLOWEST_S:
            factor = 1.0 / PER_S[counted]
            if counted != "s":
                findings.append(finding("time-since-1970", path, column=column, unit=counted))
        elif usual < 1.0 / FASTEST_HZ and any(low <= first <= high for low, high in DAYS):
            factor = DAY_S
            findings.append(finding("time-in-days", path, column=column))
        else:
            findings.extend(_doubts(path, column, gone, usual))
    elif not scale.by_user and counted is not None and not math.isclose(factor * PER_S[counted], 1.0):
        raise DataError(
            f"{path}: column {column} says its unit, but its first stamp, {float(first):.10g}, counts "
            f"{counted} since 1970; say which with «units» time=UNIT"
        )
    if scale.stated and not scale.by_user and 0 < usual * factor < 1.0 / NO_BENCH_HZ:
        rate_hz = 1.0 / (usual * factor)
        findings.append(finding("time-too-fast", path, column=column, rate_hz=rate_hz, likely="d"))
    return read_only(gone if factor == 1.0 else gone * factor), float(first) * factor, tuple(findings)


def _epoch(first: float) -> str | None:
    """What a clock counts since 1970, by its first stamp."""
    return next((unit for unit, per_s in PER_S.items() if EPOCH_S[0] <= first / per_s <= EPOCH_S[1]), None)


def _doubts(path: str, column: str, gone: Array, usual: float) -> list[Finding]:
    """What speaks against seconds in a clock whose unit nobody gave."""
    if 0 < usual < 1.0 / FASTEST_HZ:
        likely = "d" if usual < 2e-7 else "min"
        return [finding("time-too-fast", path, column=column, rate_hz=1.0 / usual, likely=likely)]
    if usual < 1.0 or not bool(np.all(gone[:100_000] == np.floor(gone[:100_000]))):
        return []
    span = float(gone[-1])
    likely = likely_time_unit(usual)
    code = "time-too-long" if span > LONGEST_S else "time-in-whole-numbers"
    return [finding(code, path, column=column, usual_s=usual, span_s=span, likely=likely)]
