"""Columns of time: their unit, as the user, the header or the numbers say it, and time from the start of a log.

Where several columns tell a time, both are taken at the ends of `CLOCK_BLOCKS` equal parts of the log. They contradict
each other where, in most parts, what one says to have passed differs from what the other says by more than `CLOCKS_OFF`
of the longer, and by more than both resolve.
"""

import contextlib
import math
import re
from collections.abc import Collection, Sequence
from datetime import datetime
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from eaid.arrays import Array, median, read_only
from eaid.errors import DataError, UsageError
from eaid.findings import Finding, finding
from eaid.logs.columns import Roles
from eaid.logs.table import LogTable
from eaid.logs.units import TIME_FACTORS, TIME_UNITS, declared_unit, divisor, numbers_samples, split_name, unit_of
from eaid.options import ReadOptions

CLOCKS_OFF = 0.05  # Share by which two clocks may differ: no clock drifts so far, and units differ by 24 and more
CLOCK_BLOCKS = 20
# What a clock counts that began at a fixed day, how many of it a second, and its first stamps of our time [s]
CLOCKS = (
    *((f"{unit} since 1970", per_s, 1e9, 4e9) for unit, per_s in (("s", 1.0), ("ms", 1e3), ("us", 1e6), ("ns", 1e9))),
    ("100 ns since 1601 (FILETIME)", 1e7, 1.26e10, 1.56e10),
    ("100 ns since the year 1 (.NET)", 1e7, 6.31e10, 6.61e10),
)
# Sample time beyond which a clock without a unit counts not from a fixed day, but in a finer unit from power-up
SLOWEST_CLOCK_S = 90.0
FASTEST_HZ = 50_000.0  # Sample rate beyond which a clock whose unit nobody gave is warned of
BRIEF_S, QUICK_HZ = 2.0, 2000.0  # Span and sample rate of a log that may be one of minutes, if nobody gave the unit
# Span beyond which a clock whose unit nobody gave is asked for it, if it counts one and more a row
LONGEST_LOG_S = 3600.0
WHOLE_S = 600.0  # Span from which whole seconds may be ms under a header that says s

CLOCK_STAMP = re.compile(
    r"(?:(?P<date>\d[\d/.-]*)[T ]+)?(?P<h>[01]?\d|2[0-3]):(?P<m>[0-5]\d)(?::(?P<s>[0-5]\d|60)(?:[.,](?P<f>\d+))?)?"
    r"\s*(?P<noon>AM|PM)?(?:Z|(?P<utc>[+-])(?P<uh>\d{2}):?(?P<um>\d{2}))?$"
)
_DATES = ("%Y-%m-%d", "%Y/%m/%d", "%Y.%m.%d", "%d.%m.%Y", "%d/%m/%Y", "%m/%d/%Y", "%d-%m-%Y")


class Clock(NamedTuple):
    """A column of time, shape (n,), NaN where a cell holds none."""

    column: str
    time_s: Array  # Since its first row, as its header or its stamps say it
    factor: float  # Seconds in one unit of it


def _clock_of(column: str, raw: NDArray[Any], factor: float) -> Clock:
    """A column of time by its numbers."""
    return Clock(column, (raw - raw[0]) * factor if len(raw) else raw, factor)


def _other_clocks(table: LogTable, taken: Collection[int | None]) -> list[Clock]:
    """The columns, besides those that are taken, that say a time and its unit."""
    clocks = []
    for column, name in enumerate(table.columns):
        if column not in taken and len(name) != 1:  # s may be a stroke, h a height
            with contextlib.suppress(DataError):
                if factor := _time_unit(table, column, None)[1]:
                    clocks.append(_clock_of(table.label(column), table.load([column]).values[0], factor))
    return clocks


def unit_of_time(
    table: LogTable, roles: Roles, clock: int | None, raw: NDArray[Any], options: ReadOptions
) -> tuple[float | None, float | None]:
    """Seconds in one unit of the time, as the user says, and as its column does; DataError where another contradicts
    it and the user says nothing."""
    if clock is None:
        return None if options.rate_hz is None else 1.0 / options.rate_hz, None
    by_user, by_column = _time_unit(table, clock, options.units.get("time"))
    if clock in table.stamped:
        return by_user, by_column
    own = _clock_of(table.label(clock), raw, by_column or 1.0)
    others = [one for one in _other_clocks(table, roles.taken) if len(one.time_s) == len(raw)]
    other = next((one for one in others if not _agree(own, one)), None)
    if other is not None and by_user is None:
        raise _clocks_contradict(table, own, other)
    return by_user, by_column if other is None else None  # its header is wrong, or the user knows better


def _agree(one: Clock, other: Clock) -> bool:
    whole = np.flatnonzero(np.isfinite(one.time_s) & np.isfinite(other.time_s))
    if len(whole) < CLOCK_BLOCKS:
        return True
    finest = 0.0
    for steps in (np.diff(clock.time_s[whole]) for clock in (one, other)):
        rises = steps[steps > 0]
        if len(rises) < 3 or (steps < 0).any():
            return True  # it stands, or starts anew: no clock of the whole log
        finest = max(finest, median(rises) if len(rises) < len(steps) else 0.0)
    at = whole[np.linspace(0, len(whole) - 1, CLOCK_BLOCKS).astype(np.intp)]
    a, b = np.diff(one.time_s[at]), np.diff(other.time_s[at])
    return bool(median(np.abs(a - b) - CLOCKS_OFF * np.maximum(a, b)) <= 2 * finest)


def _clocks_contradict(table: LogTable, time: Clock, other: Clock) -> DataError:
    """That two columns of time contradict each other, and what to do."""
    a, b = (float(np.nanmax(one.time_s)) for one in (time, other))
    counts = time.factor * b / a  # seconds in one unit of the first, if the second is right
    likely = next((unit for unit, size in TIME_FACTORS.items() if abs(math.log(counts / size)) < CLOCKS_OFF), "")
    own = next((unit for unit, size in TIME_FACTORS.items() if math.isclose(size, time.factor)), "s")
    other_right = f"«units» time={likely}" if likely else f'«columns» time="{other.column}" «units» time=UNIT'
    return table.fault(
        f"two columns of time contradict each other: by {time.column} the log takes {a:.4g} s, by "
        f"{other.column} {b:.4g} s; say {other_right} if the second is right, «units» time={own} if the first is"
    )


def _time_unit(table: LogTable, column: int, given: str | None) -> tuple[float | None, float | None]:
    """Seconds in one unit of a time column, as the user says, and as its file or its name does; None where not."""
    by_user = None
    if given is not None:
        known = unit_of(given)
        if not given.startswith("/") and known.quantity != "time":
            raise UsageError(f"«units» time={given}: is no unit of time; use {TIME_UNITS}")
        by_user = known.factor if known.quantity else 1.0 / divisor("time", given)
    name = table.columns[column]
    bare = split_name(name)[0]
    text = declared_unit(table, column, "time", given)
    known = unit_of(text or (bare if len(bare) > 1 or bare == "s" else ""))
    if known.quantity == "time":
        return by_user, known.factor
    if text and by_user is None:
        raise table.fault(
            f"column {name} is in {text}, which is no unit of time that eaid knows; "
            f"say it with «units» time=UNIT ({TIME_UNITS})"
        )
    return by_user, None


def seconds_since_start(
    table: LogTable, column: str, raw: NDArray[Any], by_user: float | None, by_column: float | None
) -> tuple[Array, float, tuple[Finding, ...]]:
    """Time since the first sample [s], shape (n,), the clock there [s], and its warnings.

    `raw` rises; `by_user`, `by_column`: seconds in one unit of it, as far as somebody says.
    """
    first = raw[0]
    gone = read_only(raw - first)
    usual = median(np.diff(gone[:10_000])) if len(gone) > 1 else 0.0
    factor, findings = by_user or by_column or 1.0, list[Finding]()
    days = ((counts, per_s) for counts, per_s, low, high in CLOCKS if low <= float(first) / per_s <= high)
    counts, per_s = next(days, ("", 0.0))
    refuted = bool(counts) and by_column is not None and not math.isclose(by_column * per_s, 1.0)
    too_fast = by_column is not None and 0 < usual * by_column < 1.0 / (5e6 if by_column > 1e-6 else 5e9)
    long = by_column == 1.0 and usual >= 1.0 and gone[-1] > WHOLE_S and _is_whole(gone)
    if by_user is not None:
        if by_column is not None and not (refuted or too_fast or long) and not math.isclose(by_user, by_column):
            raise table.fault(
                f"column {column} says its unit, «units» time=UNIT another; leave it out, or mend the name"
            )
    elif refuted:
        raise table.fault(
            f"column {column} says its unit, but its first stamp, {float(first):.10g}, counts {counts}; "
            f"say which with «units» time=UNIT"
        )
    elif long:
        findings.append(finding("whole-seconds", "time", column=column, usual_s=usual, span_s=float(gone[-1])))
    elif too_fast:
        findings.append(_unclear(column, usual, float(gone[-1]), "d", factor))
    elif by_column is None:
        if numbers_samples(column) and usual == 1.0:
            raise table.fault(
                f"column {column} numbers the samples and is no time; give their rate with «rate_hz» HZ and "
                f"name no time column, or say «units» time=/1000 for 1000 samples a second"
            )
        late = np.flatnonzero(np.diff(raw) >= 40)  # times of day as numbers, 161859.9 and then 161900.0
        ends, begins = raw[late] % 100, raw[late + 1] % 100
        if len(late) and float(raw[-1]) < 240_000 and bool(((ends >= 59) & (ends < 60) & (begins < 1)).all()):
            raise table.fault(
                f"column {column} holds times of day as numbers, {raw[late[0]]:.10g} and then "
                f"{raw[late[0] + 1]:.10g}; save it as 16:18:59.9, or in seconds"
            )
        if counts and usual / per_s <= SLOWEST_CLOCK_S:
            factor = 1.0 / per_s
            if per_s != 1:
                findings.append(finding("time-since-a-day", "time", column=column, counts=counts))
        else:
            findings.append(_of_seconds(column, gone, usual))
    return read_only(gone if factor == 1.0 else gone * factor), float(first) * factor, tuple(findings)


def _is_whole(values: Array) -> bool:
    return bool(np.all(values[:100_000] == np.floor(values[:100_000])))


def _is_round(rate_hz: float) -> bool:
    """Whether a rate is 1, 2, 2.5, 4 or 5 times a power of ten, as people set it."""
    first = rate_hz / 10 ** math.floor(math.log10(rate_hz) + 1e-3)
    return any(math.isclose(first, one, rel_tol=2e-3) for one in (1, 2, 2.5, 4, 5))


def _of_seconds(column: str, gone: Array, usual: float) -> Finding:
    """That seconds are assumed of a clock whose unit nobody gave, and what speaks against them."""
    span, too_fast = float(gone[-1]), 0 < usual < 1.0 / FASTEST_HZ
    coarse = usual >= 1.0
    brief = 0 < usual < 1.0 / QUICK_HZ and span < BRIEF_S
    too_fast |= brief and not _is_round(1 / usual) and _is_round(1 / usual / 60)  # 100 rows a second, in minutes

    def off(unit: str) -> float:  # from a hundred samples a second, and from a minute in all
        return sum(abs(math.log(size * TIME_FACTORS[unit])) for size in (usual / 0.01, span / 60))

    # if it counts no seconds: the coarsest unit with half a second a sample, and an hour in all, at most
    finer = (one for one in ("ms", "us") if max(usual / 0.5, span / LONGEST_LOG_S) * TIME_FACTORS[one] <= 1)
    likely = min(("min", "h", "d"), key=off) if brief or too_fast else next(finer, "ns")
    if too_fast or (coarse and span > LONGEST_LOG_S):
        return _unclear(column, usual, span, likely)
    if coarse or brief:
        return finding("time-doubtful", "time", column=column, usual_s=usual, span_s=span, likely=likely)
    return finding("unit-assumed", "time", role="time", column=column, unit="s")


def _unclear(column: str, usual: float, span: float, likely: str, factor: float = 1.0) -> Finding:
    """The question which unit a clock counts: the one that is likely, or that of its header, in the end seconds."""
    own = next(unit for unit, size in TIME_FACTORS.items() if math.isclose(size, factor))
    likely_s, own_s = span * TIME_FACTORS[likely], span * factor
    return finding(
        "time-unclear", "time", column=column, usual=usual, span=span, likely=likely, own=own, likely_s=likely_s,
        own_s=own_s,
    )  # fmt: skip


def seconds_of(texts: Sequence[str]) -> Array:
    """Seconds since the whole second of the first stamp, shape (n,); NaN of those that cannot be read.

    A clock without a date that falls by more than half a day has passed midnight.
    """
    seconds = np.full(len(texts), np.nan)
    stamps = [CLOCK_STAMP.match(text.strip().strip('"')) for text in texts]
    dates, ways = dict.fromkeys(stamp["date"] for stamp in stamps if stamp and stamp["date"]), []
    for form in _DATES:  # the way of writing in which most are dates, none falls and the fewest days pass
        days = {"": 0}
        for date in dates:
            with contextlib.suppress(ValueError):
                days[date] = datetime.strptime(date, form).toordinal()
        passed = [*days.values()][1:] or [0]
        ways.append((-len(days), passed != sorted(passed), max(passed) - min(passed), days))
    days = min(ways, key=lambda way: way[:3])[3]
    first: int | None = None
    midnights, last = 0, 0
    for i, stamp in enumerate(stamps):
        date = (stamp["date"] or "") if stamp else ""
        if not stamp or date not in days:
            continue
        hour = int(stamp["h"]) if not stamp["noon"] else int(stamp["h"]) % 12 + 12 * (stamp["noon"] == "PM")
        clock = 3600 * hour + 60 * int(stamp["m"]) + int(stamp["s"] or 0)
        midnights += not date and clock - last < -43200
        last = clock
        if stamp["utc"]:  # a stamp of 14:00+02:00 is one of 12:00 UTC
            clock -= int(f"{stamp['utc']}1") * (3600 * int(stamp["uh"]) + 60 * int(stamp["um"]))
        # whole seconds and their fraction apart: a day number times 86,400 would cost the last digits
        whole = (days[date] + midnights) * 86400 + clock
        first = whole if first is None else first
        seconds[i] = (whole - first) + float(f"0.{stamp['f'] or 0}")
    return without_clock_change(seconds, first) if dates and first is not None else seconds


HOUR_S = 3600.0
CHANGE_ROWS = 3.0  # Rows within which a clock is set forward or back, at a full hour
FEWEST_STAMPS = 100  # By which the time from row to row is told from an hour


def without_clock_change(seconds: Array, first: int) -> Array:
    """Stamps in local time that begin at `first` [s], as if the clock had not been set for summer or winter: at a full
    hour the next row comes an hour later, or earlier, than the usual one."""
    steps = np.diff(seconds)
    usual = median(steps[np.isfinite(steps)]) if np.isfinite(steps).any() else 0.0
    near = CHANGE_ROWS * usual
    if len(seconds) < FEWEST_STAMPS or not 0 < near < HOUR_S / 60:
        return seconds
    to_hour = (seconds[:-1] + first + near) % HOUR_S <= 2 * near
    moved = np.where(to_hour & (np.abs(np.abs(steps) - HOUR_S) <= near), np.sign(steps), 0.0)
    return np.asarray(seconds - HOUR_S * np.append(0.0, np.cumsum(moved))) if moved.any() else seconds
