"""One table → one run: columns found, rows checked, time from its start, units turned into those of eaid."""

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from eaid.arrays import Array, read_only
from eaid.errors import DataError, UsageError
from eaid.findings import Finding, finding
from eaid.logs.columns import COUNTERS, FEWEST, INPUTS, OUTPUTS, Roles, chosen_table, default_unit, steps, the_input
from eaid.logs.run import INPUT_UNITS, Run
from eaid.logs.table import Cells, Table, plain
from eaid.logs.units import (
    LARGEST_NM,
    TIME_UNITS,
    Scale,
    divisor,
    likely_time_unit,
    scale_of,
    split_name,
    unit_of,
    unit_said,
    words_of,
)
from eaid.options import ReadOptions

LARGEST = 1e100
"""Beyond it, or all below its inverse, numbers are none that a sensor gives, and their squares may be none at all."""
SHOWN = 5
"""Bad rows told one by one; the rest of a kind are counted."""


def checked(
    source: str,
    columns: Mapping[str, NDArray[Any]],
    said: Sequence[tuple[int, str, str]],
    row_of: Callable[[int], int],
    word: str,
    repair: bool,
    time_factor: float = 1.0,
) -> NDArray[np.intp] | None:
    """Samples to keep (None: all); raises DataError where rows are bad, all its faults at once.

    `columns` by their label, the first of them the time. `said` lists cells that could not be read: (sample, column
    label or empty for the whole row, what stands there).
    """
    time = next(iter(columns.values()))
    count = len(time)
    lengths = {len(values) for values in columns.values()}
    if len(lengths) > 1:
        raise DataError(
            f"{source}: its columns have different lengths ({', '.join(map(str, sorted(lengths)))}); save it again"
        )
    if count == 0:
        raise DataError(f"{source}: has a header but no rows; record the log again")
    if not said and all(np.isfinite(values).all() for values in columns.values()) and (np.diff(time) > 0).all():
        return None
    for label, values in columns.items():
        if count >= FEWEST and 0.2 * count < (gone := int(np.isnan(values).sum())) < count:
            raise DataError(
                f"{source}: column {label} holds a number in {count - gone} of {count} rows only; save the rows in "
                f"which it was sampled, or all columns at one rate"
            )
    bad = np.zeros(count, dtype=bool)
    named: set[tuple[int, str]] = set()
    cells = []
    for sample, label, text in said:
        bad[sample] = True
        named.update((sample, column) for column in ([label] if label else columns))
        if not label:
            cells.append(f"{word} {row_of(sample)} has {text} cells, unlike the others")
        elif not text:
            cells.append(f"{word} {row_of(sample)}, column {label}, is empty")
        else:
            finite = "is not finite" if _overflows(text) else "is no number"
            cells.append(f"{word} {row_of(sample)}, column {label}, holds {text!r}, which {finite}")
    for label, values in columns.items():
        for sample in np.flatnonzero(~np.isfinite(values)).tolist():
            if (sample, label) not in named:
                value = "empty or not a number" if np.isnan(values[sample]) else "infinite"
                cells.append(f"{word} {row_of(sample)}, column {label}, is {value}")
            bad[sample] = True
    falls: list[str] = []
    fine = np.flatnonzero(~bad)
    rising = time[fine]
    # a row is bad where its time is not above all times before it: dropping those leaves a rising time
    highest = np.maximum.accumulate(rising)
    late = np.flatnonzero(rising[1:] <= highest[:-1]) + 1
    repeated = int(np.count_nonzero(rising[1:] == rising[:-1]))
    if repeated > 0.2 * count:  # the stamps have too few digits
        raise DataError(
            f"{source}: {repeated} of {count} rows repeat the time of the row before, from {word} "
            f"{row_of(int(fine[late[0]]))} on: its stamps have too few digits, or rows were written twice; save each "
            f"row once, with all digits, or leave the time out and give the sample rate with «rate_hz»"
        )
    jumps = np.flatnonzero(np.diff(rising) <= 0) + 1
    set_back = len(late) > 5 * len(jumps)  # the clock was set back, and went on
    for k in (jumps if set_back else late).tolist():
        now, before = float(rising[k]) * time_factor, float(highest[k - 1]) * time_factor
        how = "is repeated" if rising[k] == highest[k - 1] else "falls"
        falls.append(f"time {how} at {word} {row_of(int(fine[k]))} ({now:.12g} s after {before:.12g} s)")
    bad[fine[late]] = True
    dropped = int(bad.sum())
    few = dropped <= 0.01 * count
    drop = ", or drop such rows with «repair»" if few else ""
    faults = [
        *_listed(source, cells, f"mend the cell{drop}"),
        *_listed(source, falls, "split the log where its clock was set back" if set_back else f"sort the rows{drop}"),
    ]
    if not repair:
        raise DataError(*faults)
    if not few:
        raise DataError(
            f"{source}: {dropped} of {count} rows are bad, more than «repair» drops (1 % of a log); record it again",
            *faults,
        )
    return np.flatnonzero(~bad)


def without_moving_steps(
    keep: NDArray[np.intp], time: NDArray[Any], input_: NDArray[Any]
) -> tuple[NDArray[np.intp], list[int]]:
    """Samples to keep, shape (n,), so that the input changes where it did; and dropped samples at which it changed.

    Of two rows at one time the one with the new input is kept, where the other is not the only one before the step.
    """
    keep, lost = keep.copy(), []
    least = 0.1 * float(np.nanmax(input_) - np.nanmin(input_))  # by which the input changes at a step
    for sample in np.setdiff1d(np.arange(len(time)), keep).tolist():
        behind = int(np.searchsorted(keep, sample))
        if not 0 < behind < len(keep):
            continue
        before, after = keep[behind - 1], keep[behind]
        change = abs(float(input_[sample] - input_[before]))
        if change > least and abs(float(input_[sample] - input_[after])) < 0.5 * change:
            if behind > 1 and time[sample] == time[before]:
                keep[behind - 1] = sample
            else:
                lost.append(sample)
    return keep, lost


def _overflows(text: str) -> bool:
    """True for what reads as a number that no finite one is: nan, inf, 1e400."""
    try:
        return not math.isfinite(float(text))
    except ValueError:
        return False


def _listed(source: str, found: Sequence[str], remedy: str) -> list[str]:
    sentences = [f"{source}: {what}; {remedy}" for what in found[:SHOWN]]
    if len(found) > SHOWN:
        sentences.append(f"{source}: and {len(found) - SHOWN} more such rows; {remedy}")
    return sentences


class Clock(NamedTuple):
    """A clock that began at a fixed day: what it counts, how many a second, its first stamps of our time [s]."""

    counts: str
    per_s: float
    first_s: tuple[float, float]


PER_S = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}
CLOCKS = (
    *(Clock(f"{unit} since 1970", per_s, (1e9, 4e9)) for unit, per_s in PER_S.items()),
    Clock("100 ns since 1601 (FILETIME)", 1e7, (1.26e10, 1.56e10)),
    Clock("100 ns since the year 1 (.NET)", 1e7, (6.31e10, 6.61e10)),
)
SLOWEST_S = 90.0
"""Sample time beyond which a clock without a unit counts not from a fixed day, but in a finer unit from power-up."""
DAYS = ((30_000.0, 60_000.0), (700_000.0, 770_000.0))
"""First stamps in days: Excel's of 1982 to 2064, MATLAB's datenum of 1916 to 2108."""
FASTEST_HZ = 50_000.0
"""Sample rate beyond which a clock whose unit nobody gave is warned of."""
BRIEF_S, QUICK_HZ = 2.0, 2000.0
"""Span and sample rate of a log that may be one of minutes, if nobody gave the unit."""
LONGEST_S = 3600.0
"""Span beyond which a clock whose unit nobody gave counts no seconds, if it counts whole numbers, or seldom."""


@dataclass(frozen=True)
class TimeScale:
    """Seconds in one unit of a time column, and who said so: the user, or the file or the column's name."""

    by_user: float | None = None
    by_column: float | None = None

    @property
    def factor(self) -> float:
        """Seconds in one unit, as far as it is known before the stamps are."""
        return self.by_user or self.by_column or 1.0


def time_scale(path: str, said: str | None, column: str, file_unit: str) -> TimeScale:
    """Unit of a time column as the user, the file or its name says; raises where that is no unit of time."""
    by_user = None
    if said is not None:
        known = unit_of(said)
        if not said.startswith("/") and (known is None or known.quantity != "time"):
            raise UsageError(f"«units» time={said}: is no unit of time; use {TIME_UNITS}")
        by_user = 1.0 / divisor("time", said) if known is None else known.factor
    bare = split_name(column)[0]
    text = unit_said(path, "time", said, column, file_unit)
    known = unit_of(text or (bare if len(bare) > 1 or bare == "s" else ""))
    if known is not None and known.quantity == "time":
        return TimeScale(by_user, known.factor)
    if text and by_user is None:
        raise DataError(
            f"{path}: column {column} is in {text}, which is no unit of time that eaid knows; "
            f"say it with «units» time=UNIT ({TIME_UNITS})"
        )
    return TimeScale(by_user)


def seconds_since_start(
    path: str, column: str, raw: NDArray[Any], scale: TimeScale
) -> tuple[Array, float, tuple[Finding, ...]]:
    """Time since the first sample [s], shape (n,), the clock there [s], and its warnings.

    `raw` rises; raises DataError where the column numbers the samples, or names a unit that its stamps contradict.
    """
    if not len(raw):
        return np.empty(0), 0.0, ()
    first = raw[0]
    gone = read_only(raw - first)
    usual = float(np.median(np.diff(gone[:10_000]))) if len(gone) > 1 else 0.0
    factor, of_column, findings = scale.factor, scale.by_column, list[Finding]()
    day = next((one for one in CLOCKS if one.first_s[0] <= float(first) / one.per_s <= one.first_s[1]), None)
    refuted = day is not None and of_column is not None and not math.isclose(of_column * day.per_s, 1.0)
    too_fast = of_column is not None and 0 < usual * of_column < 1.0 / 5e6  # no bench samples so fast
    if scale.by_user is not None:
        if of_column is not None and not (refuted or too_fast) and not math.isclose(scale.by_user, of_column):
            raise DataError(
                f"{path}: column {column} says its unit, «units» time=UNIT another; leave it out, or mend the name"
            )
    elif refuted and day is not None:
        raise DataError(
            f"{path}: column {column} says its unit, but its first stamp, {float(first):.10g}, counts {day.counts}; "
            f"say which with «units» time=UNIT"
        )
    elif too_fast:
        rate_hz = 1.0 / (usual * factor)
        findings.append(finding("time-too-fast", path, column=column, rate_hz=rate_hz, likely="d"))
    elif of_column is None:
        if words_of(split_name(column)[0]) & COUNTERS and usual == 1.0:
            raise DataError(
                f"{path}: column {column} numbers the samples and is no time; give their rate with «rate_hz» HZ and "
                f"name no time column, or say «units» time=/1000 for 1000 samples a second"
            )
        _refuse_times_of_day(path, column, raw)
        if day is not None and usual / day.per_s <= SLOWEST_S:
            factor = 1.0 / day.per_s
            if day.per_s != 1:
                findings.append(finding("time-since-a-day", path, column=column, counts=day.counts))
        elif usual < 1.0 / FASTEST_HZ and any(low <= first <= high for low, high in DAYS):
            factor = 86400.0
            findings.append(finding("time-in-days", path, column=column))
        else:
            findings.append(_of_seconds(path, column, gone, usual))
    return read_only(gone if factor == 1.0 else gone * factor), float(first) * factor, tuple(findings)


def _refuse_times_of_day(path: str, column: str, raw: NDArray[Any]) -> None:
    """Refuse times of day that are written as numbers, 161859.9 and then 161900.0: minutes of 100 seconds."""
    late = np.flatnonzero(np.diff(raw) >= 40)
    ends, begins = raw[late] % 100, raw[late + 1] % 100
    if len(late) and float(raw[-1]) < 240_000 and bool(((ends >= 59) & (ends < 60) & (begins < 1)).all()):
        raise DataError(
            f"{path}: column {column} holds times of day as numbers, {raw[late[0]]:.10g} and then "
            f"{raw[late[0] + 1]:.10g}; save it as 16:18:59.9, or in seconds"
        )


def _of_seconds(path: str, column: str, gone: Array, usual: float) -> Finding:
    """That seconds are assumed of a clock whose unit nobody gave, and what speaks against them."""
    span, likely = float(gone[-1]), likely_time_unit(usual)
    if 0 < usual < 1.0 / FASTEST_HZ:
        likely = "d" if usual < 2e-7 else "min"
        return finding("time-too-fast", path, column=column, rate_hz=1.0 / usual, likely=likely)
    if usual > SLOWEST_S and span > LONGEST_S:
        return finding("time-too-long", path, column=column, usual_s=usual, span_s=span, likely=likely)
    if usual >= 1.0 and bool(np.all(gone[:100_000] == np.floor(gone[:100_000]))):
        code = "time-too-long" if span > LONGEST_S else "time-in-whole-numbers"
        return finding(code, path, column=column, usual_s=usual, span_s=span, likely=likely)
    if 0 < usual < 1.0 / QUICK_HZ and span < BRIEF_S:
        return finding("time-brief", path, column=column, rate_hz=1.0 / usual, span_s=span)
    return finding("unit-assumed", path, role="time", column=column, unit="s")


@dataclass(frozen=True)
class Origin:
    """Where a table comes from."""

    name: str
    """Of the run."""
    source: str
    """How sentences name it."""
    sha256: str
    says: str
    """The text in which the name pattern is looked for."""


class _Columns:
    """The columns of a table that have been read, the first of which keeps its own times, and others on demand."""

    def __init__(self, source: str, table: Table, wanted: Sequence[int]) -> None:
        first = list(dict.fromkeys(wanted))
        self._source, self._table, self._first = source, table, first[0]
        self.cells: Cells = table.load(first)
        self._values = {
            column: self._sane(column, values) for column, values in zip(first, self.cells.values, strict=True)
        }
        self.keep: NDArray[np.intp] | None = None
        """Samples that are kept; None: all of them."""

    def __getitem__(self, column: int) -> NDArray[Any]:
        if column not in self._values:
            self._values[column] = self._sane(column, self._table.load([self._first, column]).values[1])
        return self._values[column]

    def _sane(self, column: int, values: NDArray[Any]) -> NDArray[Any]:
        """Values whose differences may be below zero; raises DataError where they are too large or too small."""
        values = _signed(values)
        size = np.abs(values[np.isfinite(values)]).max(initial=0) if values.dtype.kind == "f" else 1
        if size != 0 and not 1 / LARGEST <= size <= LARGEST:
            raise DataError(
                f"{self._source}: column {self._table.label(column)} goes to {size:g}, as no sensor does; mend it"
            )
        return values

    def kept(self, column: int) -> NDArray[Any]:
        """The samples of a column that are kept."""
        return self[column] if self.keep is None else self[column][self.keep]


def _signed(values: NDArray[Any]) -> NDArray[Any]:
    """Unsigned whole numbers as signed ones, booleans as numbers, floats in full: differences stay what they are."""
    if values.dtype.kind == "f":
        return np.asarray(values, dtype=np.float64)
    if values.dtype.kind not in "ub":
        return values
    too_large = values.dtype == np.uint64 and len(values) and values.max() > np.iinfo(np.int64).max
    return values.astype(np.float64 if too_large else np.int64)


@dataclass(frozen=True)
class _Log:
    """The table that is read, what its columns are, and what the user says of them."""

    source: str
    table: Table
    roles: Roles
    options: ReadOptions

    @cached_property
    def clock(self) -> int | None:
        """The time column; None where the sample rate stands for it. Raises DataError where both are given."""
        time = self.roles.time
        if time is None or self.options.rate_hz is None:
            return time
        if words_of(split_name(self.table.columns[time])[0]) & COUNTERS:
            return None
        label = self.table.label(time)
        raise DataError(f"{self.source}: has a time column, {label}, so «rate_hz» does nothing; leave it out")

    @cached_property
    def time_scale(self) -> TimeScale:
        """Unit of the time column, or of the sample numbers."""
        if self.clock is None:
            said = {rate_hz for _, rate_hz in self.table.rates}
            if len(said) > 1 and self.options.rate_hz is None:
                listed = " and ".join(f"{rate_hz:g} Hz in {place}" for place, rate_hz in self.table.rates)
                raise DataError(f"{self.source}: has no time column, and says {listed}; say which with «rate_hz» HZ")
            return TimeScale(1.0 / (self.options.rate_hz or said.pop()))
        column, unit = self.table.columns[self.clock], self.table.unit(self.clock)
        return time_scale(self.source, self.options.units.get("time"), column, unit)

    def scale(self, role: str, column: int, default: str) -> Scale:
        """Unit of an input or output column, and its factor."""
        name, label, said = self.table.columns[column], self.table.label(column), self.options.units.get(role)
        return scale_of(self.source, role, said, name, self.table.unit(column), default, label)

    def good(self, columns: _Columns, time: NDArray[Any], used: Sequence[int | None]) -> NDArray[np.intp] | None:
        """Samples to keep; None: all of them."""
        taken = [column for column in used if column is not None and column != self.clock]
        named = {"time" if self.clock is None else self.table.label(self.clock): time}
        named |= {self.table.label(column): columns[column] for column in taken}
        wanted = {-1, self.clock, *taken}
        bad = sorted((cell for cell in columns.cells.bad if cell.column in wanted), key=lambda c: (c.row, c.column))
        cells = [(cell.row, "" if cell.column < 0 else self.table.label(cell.column), cell.text) for cell in bad]
        repair, factor = self.options.repair, self.time_scale.factor
        return checked(self.source, named, cells, columns.cells.row, "row", repair, factor)


_BEFORE = re.compile(r"\d[.,ep_-]?$", re.IGNORECASE)
_AFTER = re.compile(r"[.,]?\d|[ep-][+-]?\d|_\d{1,3}(?!\d)", re.IGNORECASE)
"""What stands beside a number that may be a part of a longer one: 2-5V, 2p5V, 1e2V, 2_5V, 1,000V."""
_DATED = re.compile(r"(\d{4}([-_.]?)\d\d\2\d\d|\d\d[-_.]\d\d[-_.]\d{4})[-_]$")


def level_and_repeat(source: str, pattern: str | None, name: str) -> tuple[float | None, int | None]:
    """Level and repeat that the name of a log tells, the pattern being found anywhere in it.

    Raises DataError where the number that stands for the level may be a part of a longer one.
    """
    if pattern is None:
        return None, None
    parts = re.split(r"\{(level|repeat)\}", pattern)
    forms = {"level": r"(?P<level>[+-]?(?:\d+(?:[.,]\d+)?|\.\d+))", "repeat": r"(?P<repeat>\d+)"}
    every = re.finditer("".join(forms[part] if i % 2 else re.escape(part) for i, part in enumerate(parts)), name)
    match = next(every, None)
    if match is None:
        return None, None
    told = match.groupdict()
    level, repeat = told.get("level"), told.get("repeat")
    if repeat is not None and int(repeat) > np.iinfo(np.int64).max:
        raise DataError(f"{source}: its repeat, {repeat}, is no count; mend «name_pattern», or rename the log")
    if level is None:
        return None, None if repeat is None else int(repeat)
    begins = match.end("repeat") if repeat is not None and match.start("repeat") < match.start("level") else 0
    ends = pattern.endswith("{level}") and _AFTER.match(name[match.end("level") :])  # else the pattern says where
    before = name[begins : match.start("level")]
    longer = _BEFORE.search(before) and not _DATED.search(before)
    thousands = re.fullmatch(r"[+-]?[1-9]\d{0,2},\d{3}", level)
    if longer or ends or thousands or any(other["level"] != level for other in every):
        raise DataError(
            f"{source}: {level} in its name may not be the whole level, or not the only one; rename it, as in 2.5V, or "
            f"let «name_pattern» hold what stands beside it, as in {{repeat}}_{{level}}V"
        )
    return float(level.replace(",", ".")), None if repeat is None else int(repeat)


def run_of(origin: Origin, tables: Sequence[Table], options: ReadOptions) -> Run:
    """The run behind the tables of one log; raises DataError with all its faults."""
    source, name = origin.source, plain(origin.name)
    table, roles = chosen_table(source, tables, options)
    log = _Log(source, table, roles, options)
    clock, (level, repeat) = log.clock, level_and_repeat(source, options.name_pattern, origin.says)
    beside = (clock, roles.reference, roles.trigger, roles.position)
    taken = [column for column in (roles.output, *beside) if column is not None]
    likely = [column for _, column in roles.inputs]
    if roles.inputs and roles.inputs[0][0] == "clutch":
        del likely[1:]  # the others count only where it stands still
    columns = _Columns(source, table, [*taken, *likely])
    known = options.name_pattern is not None or options.step_at is not None
    kind, which, findings = the_input(source, table, roles, columns.__getitem__, known)
    if which is not None and which not in likely:
        columns = _Columns(source, table, [*taken, which])
    trigger = roles.trigger if which is None and level is not None else None
    if trigger is not None and not (steps(columns[trigger]) and len(np.unique(columns[trigger][:1_000_000])) == 2):
        trigger = None
    if which is None and trigger is None and options.name_pattern is not None and level is None:
        raise DataError(f"{source}: its name does not match «name_pattern»; rename it or mend the pattern")

    raw_time = columns[clock] if clock is not None else np.arange(len(columns[roles.output]))
    columns.keep = log.good(columns, raw_time, (clock, which, roles.output, trigger, roles.position))
    switch = which if which is not None else trigger
    lost: list[int] = []
    if columns.keep is not None and switch is not None:
        columns.keep, lost = without_moving_steps(columns.keep, raw_time, columns[switch])
    kept_time = raw_time if columns.keep is None else raw_time[columns.keep]
    if clock is not None:
        time_s, start_s, of_time = seconds_since_start(source, table.label(clock), kept_time, log.time_scale)
    else:
        time_s, start_s, of_time = read_only(kept_time * log.time_scale.factor), 0.0, ()
        if options.rate_hz is None:
            place, rate_hz = table.rates[0]
            of_time = (finding("rate-from-comment", source, rate_hz=rate_hz, place=place),)
    of_time += _contradicted_rate(source, table, time_s) if clock is not None else ()
    into = log.scale("output", roles.output, default_unit(table.columns[roles.output], OUTPUTS))
    output = into.of(columns.kept(roles.output))
    if which is not None and kind is not None:
        scale = log.scale("input", which, default_unit(table.columns[which], INPUTS[kind]))
        unit, input_, of_input = scale.unit, scale.of(columns.kept(which)), scale.findings
    else:  # a name says a level and no unit
        unit = options.units.get("input", "") if kind is None else INPUT_UNITS[kind]
        input_, of_input = _input_of_trigger(log, columns, trigger, level, len(kept_time))
    findings = (*roles.findings, *findings, *columns.cells.findings, *of_time, *into.findings, *of_input)
    findings += _of_dropped(log, columns, raw_time, lost)
    findings += _of_values(log, into, output)
    if level is not None and which is not None:
        findings += _contradiction(source, level, input_, unit)
    named = {"time": clock, "input": switch, "output": roles.output,
             "reference": roles.reference, "position": roles.position}  # fmt: skip
    used = {role: column for role, column in named.items() if column is not None}
    others = [table.label(column) for column in range(len(table.columns)) if column not in used.values()]
    position_unit = ""
    if roles.position is not None:  # as it is called: nothing is turned into it
        by_name = split_name(table.columns[roles.position])[1]
        position_unit = options.units.get("position") or table.unit(roles.position) or by_name
    return Run(
        name=name,
        time_s=time_s,
        input=read_only(input_),
        output=output,
        input_unit=unit,
        output_unit=into.unit,
        source=source,
        sha256=origin.sha256,
        level=level if which is None and trigger is None else None,
        repeat=repeat,
        step_s=_on_clock(options.step_at, time_s, start_s),
        until_s=_on_clock(options.until, time_s, start_s),
        reference_nm=None if roles.reference is None else read_only(columns.kept(roles.reference)),
        position=None if roles.position is None else read_only(columns.kept(roles.position)),
        position_unit=position_unit,
        findings=tuple(msgspec.structs.replace(found, subject=name) for found in findings),
        kind=options.kind or kind,
        synthetic=table.synthetic,
        start_s=start_s,
        taken=tuple((role, table.label(column)) for role, column in used.items()),
        left=(*others, *table.dropped),
    )


def _contradicted_rate(source: str, table: Table, time_s: Array) -> tuple[Finding, ...]:
    """The sample rate that a comment says, where the stamps have another."""
    usual = float(np.median(np.diff(time_s[:10_000]))) if len(time_s) > 1 else 0.0
    wrong = next(((place, rate) for place, rate in table.rates if not 0.9 < usual * rate < 1.1), None)
    if wrong is None or usual == 0:
        return ()
    return (finding("rate-contradicted", source, place=wrong[0], said=wrong[1], found=1.0 / usual),)


def _input_of_trigger(
    log: _Log, columns: _Columns, trigger: int | None, level: float | None, count: int
) -> tuple[Array, tuple[Finding, ...]]:
    """The level while its trigger is on, with a finding that says so; without a trigger an input that is not known."""
    if trigger is None or level is None:
        return np.broadcast_to(np.float64(np.nan), count), ()  # takes no memory
    on = columns[trigger]
    middle = 0.5 * (float(on.min()) + float(on.max()))
    said = finding("level-times-trigger", log.source, column=log.table.label(trigger), level=level)
    return np.where(columns.kept(trigger) > middle, level, 0.0), (said,)


def _of_dropped(log: _Log, columns: _Columns, raw_time: NDArray[Any], lost: Sequence[int]) -> tuple[Finding, ...]:
    """How many rows were dropped, and which of them a step began at."""
    if columns.keep is None:
        return ()
    total = len(raw_time)
    findings = [finding("rows-dropped", log.source, dropped=total - len(columns.keep), count=total)]
    for row in lost if log.options.step_at is None else ():
        at_s = float(raw_time[row]) * log.time_scale.factor
        findings.append(finding("step-row-dropped", log.source, row=columns.cells.row(row), at_s=at_s))
    return tuple(findings)


def _of_values(log: _Log, into: Scale, output: Array) -> tuple[Finding, ...]:
    """What the numbers themselves bring up."""
    findings = []
    largest = max(abs(float(output.max())), abs(float(output.min()))) if len(output) else 0.0
    if into.unit == "N·m" and "output" not in log.options.units and largest > LARGEST_NM:
        findings.append(finding("torque-too-large", log.source, largest=largest))
    if log.table.dropped:
        findings.append(finding("columns-without-numbers", log.source, columns=", ".join(log.table.dropped[:8])))
    return tuple(findings)


def _contradiction(source: str, level: float, input_: Array, unit: str) -> tuple[Finding, ...]:
    """The level that a file name says, where the input never comes near it."""
    near = np.abs(np.abs(input_) - abs(level)) <= 0.02 * abs(level)
    most = float(input_[np.abs(input_).argmax()]) if len(input_) else 0.0
    return () if near.any() else (finding("level-contradicted", source, level=level, found=most, unit=unit),)


def _on_clock(instant_s: float | None, time_s: Array, start_s: float) -> float | None:
    """An instant of the log's clock on `time_s`; one outside the log that lies inside since its start is meant so."""
    if instant_s is None or not len(time_s):
        return instant_s
    since = instant_s - start_s
    outside = not time_s[0] <= since <= time_s[-1]
    return instant_s if outside and time_s[0] <= instant_s <= time_s[-1] else since
