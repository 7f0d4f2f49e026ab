"""One table → one run: columns found, rows checked, time from its start, units turned into those of eaid."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from eaid.arrays import Array, read_only
from eaid.errors import DataError, UsageError
from eaid.findings import Finding, finding
from eaid.logs.by_values import by_place, steps, the_input
from eaid.logs.checks import checked
from eaid.logs.clock import TimeScale, seconds_since_start, time_scale
from eaid.logs.columns import COUNTERS, Roles, input_default, match_columns, output_default
from eaid.logs.options import ReadOptions
from eaid.logs.run import INPUT_UNITS, Kind, Run
from eaid.logs.scale import LARGEST_NM, Scale, scale_of
from eaid.logs.table import Cells, Table
from eaid.logs.units import split_name, words_of


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


def name_regex(pattern: str) -> re.Pattern[str]:
    """Regular expression of a name pattern; raises UsageError where it names neither level nor repeat."""
    parts = re.split(r"\{(level|repeat)\}", pattern)
    if len(parts) == 1:
        raise UsageError(f"«name_pattern» {pattern}: holds neither {{level}} nor {{repeat}}")
    if len(set(parts[1::2])) < len(parts[1::2]):
        raise UsageError(f"«name_pattern» {pattern}: holds a field twice")
    forms = {"level": r"(?P<level>[+-]?\d+(?:[.,]\d+)?)", "repeat": r"(?P<repeat>\d+)"}
    return re.compile("".join(forms[part] if i % 2 else re.escape(part) for i, part in enumerate(parts)))


def choose(source: str, tables: Sequence[Table], options: ReadOptions) -> tuple[Table, Roles]:
    """The one table that is a log: the one named, else the only one whose columns match."""
    if options.variable is not None:
        named = [table for table in tables if table.name == options.variable]
        if not named:
            names = ", ".join(table.name or "(no name)" for table in tables[:12])
            raise DataError(f"{source}: holds no table {options.variable} for «variable»; it holds {names}")
        return named[0], _roles(source, named[0], options)
    good: list[tuple[Table, Roles]] = []
    faults: list[DataError] = []
    for table in tables:
        try:
            good.append((table, _roles(source, table, options)))
        except DataError as fault:
            faults.append(fault)
    if not good:
        if len(tables) == 1:
            raise faults[0]
        held = "; ".join(
            f"{table.name or 'table'}: {', '.join(c or '?' for c in table.columns[:8])}" for table in tables[:6]
        )
        raise DataError(
            f"{source}: no table in it has columns of time and torque ({held}); choose with «variable» and «columns»"
        )
    full = [pair for pair in good if pair[1].inputs] or good
    if len(full) > 1:
        names = ", ".join(table.name for table, _ in full[:12])
        raise DataError(
            f"{source}: holds several tables that may be the log ({names}); choose one with «variable» NAME"
        )
    return full[0]


def _roles(source: str, table: Table, options: ReadOptions) -> Roles:
    named = any(table.columns) or "output" in options.columns
    return match_columns(source, table, options) if named else by_place(source, table, options)


class _Columns:
    """The columns of a table that have been read, the first of which keeps its own times, and others on demand."""

    def __init__(self, table: Table, wanted: Sequence[int]) -> None:
        first = list(dict.fromkeys(wanted))
        self._table, self._first = table, first[0]
        self.cells: Cells = table.load(first)
        self._held = dict(zip(first, map(_signed, self.cells.values), strict=True))

    def __getitem__(self, column: int) -> NDArray[Any]:
        if column not in self._held:
            self._held[column] = _signed(self._table.load([self._first, column]).values[1])
        return self._held[column]


def _signed(values: NDArray[Any]) -> NDArray[Any]:
    """Unsigned whole numbers as signed ones, booleans as numbers: their differences may be below zero."""
    return values.astype(np.int64) if values.dtype.kind in "ub" else values


def run_of(origin: Origin, tables: Sequence[Table], options: ReadOptions, pattern: re.Pattern[str] | None) -> Run:
    """The run behind the tables of one log; raises DataError with all its faults."""
    source = origin.source
    table, roles = choose(source, tables, options)
    clock = _clock_column(source, table, roles, options)
    level, repeat = _from_name(origin, pattern)
    beside = (clock, roles.reference, roles.trigger, roles.position)
    taken = [one for one in (roles.output, *beside) if one is not None]
    likely = [column for _, column in roles.inputs]
    if roles.inputs and roles.inputs[0][0] == "clutch":
        del likely[1:]  # the others count only where it stands still
    columns = _Columns(table, [*taken, *likely])
    told = pattern is not None or options.step_at_s is not None
    kind, which, findings = the_input(source, table, roles, columns.__getitem__, told)
    if which is not None and which not in likely:
        columns = _Columns(table, [*taken, which])
    trigger = roles.trigger if which is None and level is not None and _is_trigger(columns, roles.trigger) else None
    if which is None and trigger is None and pattern is not None and level is None:
        raise DataError(f"{source}: its name does not match «name_pattern»; rename it or mend the pattern")

    scale = _time_scale(source, table, clock, options)
    raw = columns[clock] if clock is not None else np.arange(len(columns[roles.output]))
    keep = _kept(source, table, columns, raw, (clock, which, roles.output, trigger, roles.position), options, scale)

    def kept(values: NDArray[Any]) -> NDArray[Any]:
        return values if keep is None else values[keep]

    if clock is not None:
        time_s, start_s, doubts = seconds_since_start(source, table.label(clock), kept(raw), scale)
    else:
        time_s, start_s, doubts = read_only(kept(raw) * scale.factor), table.starts_s, ()
    out = _scaled(source, "output", table, roles.output, options, output_default(table.columns[roles.output]))
    output = read_only(_times(kept(columns[roles.output]), out.factor))
    unit, input_, more = _input(source, table, columns, kind, which, options)
    if which is None:
        input_ = np.broadcast_to(np.float64(np.nan), len(raw))  # takes no memory
    if trigger is not None:
        assert level is not None
        on = columns[trigger]
        input_ = np.where(on > 0.5 * (float(on.min()) + float(on.max())), level, 0.0)
        more = (*more, finding("level-times-trigger", source, column=table.label(trigger), level=level))
    input_ = read_only(kept(input_))
    findings = (*roles.findings, *findings, *columns.cells.findings, *doubts, *out.findings, *more)
    findings += _of_values(source, table, out, output, options, None if keep is None else (len(raw), len(keep)))
    if level is not None and which is not None:
        findings += _contradiction(source, level, input_, unit)
    named = {"time": clock, "input": which if which is not None else trigger, "output": roles.output,
             "reference": roles.reference, "position": roles.position}  # fmt: skip
    roled = {column for column in named.values() if column is not None}
    return Run(
        name=origin.name,
        time_s=time_s,
        input=input_,
        output=output,
        input_unit=unit,
        output_unit=out.unit,
        source=source,
        sha256=origin.sha256,
        level=level if which is None and trigger is None else None,
        repeat=repeat,
        step_s=_on_clock(options.step_at_s, time_s, start_s),
        until_s=_on_clock(options.until_s, time_s, start_s),
        reference_nm=read_only(kept(columns[roles.reference])) if roles.reference is not None else None,
        position=read_only(kept(columns[roles.position])) if roles.position is not None else None,
        position_unit="" if roles.position is None else _position_unit(table, roles.position, options),
        findings=tuple(msgspec.structs.replace(one, subject=origin.name) for one in findings),
        kind=options.kind or kind,
        synthetic=table.said.get("synthetic"),
        start_s=start_s,
        taken=tuple((role, table.label(column)) for role, column in named.items() if column is not None),
        left=(*(table.label(i) for i in range(len(table.columns)) if i not in roled), *table.dropped),
    )


def _position_unit(table: Table, column: int, options: ReadOptions) -> str:
    """Unit of a position, as it is called: nothing is turned into it."""
    return options.units.get("position") or table.unit(column) or split_name(table.columns[column])[1]


def _clock_column(source: str, table: Table, roles: Roles, options: ReadOptions) -> int | None:
    """The time column; None where the sample rate stands for it. Raises DataError where both are given."""
    if roles.time is None or options.rate_hz is None:
        return roles.time
    if words_of(split_name(table.columns[roles.time])[0]) & COUNTERS:
        return None
    raise DataError(f"{source}: has a time column, {table.label(roles.time)}, so «rate_hz» does nothing; leave it out")


def _time_scale(source: str, table: Table, clock: int | None, options: ReadOptions) -> TimeScale:
    if clock is not None:
        return time_scale(source, options.units.get("time"), table.columns[clock], table.unit(clock))
    rate = options.rate_hz or table.rate_hz
    assert rate is not None
    return TimeScale(1.0 / rate, True, True)


def _kept(
    source: str, table: Table, columns: _Columns, raw: NDArray[Any], used: Sequence[int | None], options: ReadOptions,
    scale: TimeScale,
) -> NDArray[np.intp] | None:  # fmt: skip
    """Samples to keep; None: all of them."""
    clock, *rest = used
    named = {"time" if clock is None else table.label(clock): raw}
    named |= {table.label(i): columns[i] for i in rest if i is not None}
    cells = columns.cells
    wanted = {-1, *(i for i in used if i is not None)}
    said = [
        (bad.row, "" if bad.column < 0 else table.label(bad.column), bad.text)
        for bad in sorted(cells.bad, key=lambda bad: (bad.row, bad.column))
        if bad.column in wanted
    ]
    return checked(source, named, said, cells.row, "row", options.repair, scale.factor)


def _is_trigger(columns: _Columns, trigger: int | None) -> bool:
    return trigger is not None and steps(columns[trigger]) and len(np.unique(columns[trigger][:1_000_000])) == 2


def _scaled(source: str, role: str, table: Table, column: int, options: ReadOptions, default: str) -> Scale:
    name, said = table.columns[column], options.units.get(role)
    return scale_of(source, role, said, name, table.unit(column), default, table.label(column))


def _input(
    source: str, table: Table, columns: _Columns, kind: Kind | None, which: int | None, options: ReadOptions
) -> tuple[str, Array, tuple[Finding, ...]]:
    """Unit and values of the input; a level from a file name has no unit, unless the user says one."""
    if which is None or kind is None:
        return options.units.get("input", "") if kind is None else INPUT_UNITS[kind], np.empty(0), ()
    into = _scaled(source, "input", table, which, options, input_default(kind, table.columns[which]))
    return into.unit, _times(columns[which], into.factor), into.findings


def _times(values: NDArray[Any], factor: float) -> Array:
    return np.asarray(values, dtype=np.float64) if factor == 1.0 else values * factor


def _of_values(
    source: str, table: Table, out: Scale, output: Array, options: ReadOptions, rows: tuple[int, int] | None
) -> tuple[Finding, ...]:
    """What the numbers themselves bring up."""
    found = []
    if rows is not None:
        found.append(finding("rows-dropped", source, dropped=rows[0] - rows[1], count=rows[0]))
    largest = max(abs(float(output.max())), abs(float(output.min()))) if len(output) else 0.0
    if out.unit == "N·m" and "output" not in options.units and largest > LARGEST_NM:
        found.append(finding("torque-too-large", source, largest=largest))
    if table.dropped:
        found.append(finding("columns-without-numbers", source, columns=", ".join(table.dropped[:8])))
    return tuple(found)


def _contradiction(source: str, level: float, input_: Array, unit: str) -> tuple[Finding, ...]:
    """The level that a file name says, where the input never comes near it."""
    near = np.abs(np.abs(input_) - abs(level)) <= 0.02 * abs(level)
    found = float(input_[np.abs(input_).argmax()]) if len(input_) else 0.0
    return () if near.any() else (finding("level-contradicted", source, level=level, found=found, unit=unit),)


def _on_clock(said: float | None, time_s: Array, start_s: float) -> float | None:
    """An instant of the log's clock on `time_s`; one outside the log that lies inside since its start is meant so."""
    if said is None or not len(time_s):
        return said
    since = said - start_s
    outside = not time_s[0] <= since <= time_s[-1]
    return said if outside and time_s[0] <= said <= time_s[-1] else since


def _from_name(origin: Origin, pattern: re.Pattern[str] | None) -> tuple[float | None, int | None]:
    """Level and repeat that the name tells."""
    found = pattern.search(origin.says) if pattern is not None else None
    said: Mapping[str, str | None] = found.groupdict() if found else {}
    level, repeat = said.get("level"), said.get("repeat")
    return float(level.replace(",", ".")) if level else None, int(repeat) if repeat else None
