"""One table → one run: columns by name, rows checked, time from its start, units turned into those of eaid."""

import contextlib
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from eaid.arrays import Array, read_only
from eaid.errors import DataError
from eaid.findings import Finding, finding
from eaid.logs.clocks import seconds_since_start, unit_of_time
from eaid.logs.columns import MOTION, Roles, chosen_table, default_unit, leaves_rest, moves_in_steps, rises
from eaid.logs.names import level_and_repeat, unit_beside
from eaid.logs.rows import checked
from eaid.logs.run import Beside, Run
from eaid.logs.table import Cells, LogTable, plain
from eaid.logs.units import (
    UNKNOWN,
    Scale,
    declared_unit,
    may_drive,
    numbers_samples,
    scale_of,
    split_name,
    unit_of,
    words_of,
)
from eaid.options import ExperimentKind, ReadOptions

# Beyond it, or all below its inverse, numbers are none that a sensor gives, and their squares may be none at all
LARGEST_READING = 1e100
LARGEST_NM = 1000.0  # Torque beyond any clutch that a bench holds [N·m]: a column of counts, or of another unit
TOO_COARSE = 0.2  # Part of the stamps that repeat the one before, from which they tell no time
# Of an input of alternating sign: part by which its size may be off the level, part of the rows that are at it or at
# rest, turns, changes of its size for each of these, and correlations of the output with it and with its size
SEEN_ALIKE, ALTERNATES, FEWEST_TURNS, HELD_PART, GOES_WITH = 0.02, 0.95, 10, 0.25, (0.2, 0.5)
MOST_OTHERS = 8  # Columns that are not read up to which they are looked at


def _loaded(table: LogTable, wanted: Sequence[int | None]) -> tuple[Cells, dict[int, NDArray[Any]]]:
    """Columns by their number; DataError where one is too large or too small for a sensor."""
    columns = list(dict.fromkeys(one for one in wanted if one is not None))
    cells, sane = table.load(columns), dict[int, NDArray[Any]]()
    for column, values in zip(columns, cells.values, strict=True):
        if values.dtype.kind in "ub":  # signed, so that differences may be below zero
            too_large = values.dtype == np.uint64 and len(values) and values.max() > np.iinfo(np.int64).max
            values = values.astype(np.float64 if too_large else np.int64)
        if values.dtype.kind != "i":
            values = np.asarray(values, dtype=np.float64)
            size = np.abs(values[np.isfinite(values)]).max(initial=0)
            if size != 0 and not 1 / LARGEST_READING <= size <= LARGEST_READING:
                raise table.fault(f"column {table.label(column)} goes to {size:g}, as no sensor does; mend it")
        sane[column] = values
    return cells, sane


def _input_of(table: LogTable, roles: Roles) -> tuple[ExperimentKind | None, int | None]:
    """The input among the columns that may be it: the one that moves, where the names leave a choice."""
    if not roles.inputs:
        return None, None
    first = roles.inputs[0]

    def moves(column: int) -> bool:
        return _moves(_loaded(table, [column])[1][column])

    # a duty that moves is it, beside whatever speed and force
    if len(roles.inputs) == 1 or (first[0] == "clutch" and moves(first[1])):
        return first
    moving = [one for one in roles.inputs if moves(one[1])]
    if len(moving) == 1 or first[0] == "clutch":
        return moving[0] if len(moving) == 1 else first
    kinds = " and ".join(kind for kind, _ in roles.inputs)
    raise table.fault(f"may be {kinds}, as it has a column of each; say which with «kind»")


def refuse_still(table: LogTable, roles: Roles, which: int, values: NDArray[Any]) -> None:
    """Refuse an input found by its name, (n,), that stands still while another column steps that drives by its unit."""
    if roles.position is not None or _moves(values):  # what is cut at the turns of a position is held
        return
    taken = {which, roles.time, roles.output, roles.reference, roles.position}
    units = {i: table.unit(i) or split_name(name)[1] for i, name in enumerate(table.columns) if i not in taken}
    for column in (i for i, unit in units.items() if may_drive(unit)):
        if moves_in_steps(_loaded(table, [column])[1][column]):
            still, other = table.label(which), table.label(column)
            raise table.fault(
                f'{still} stands still, and {other} steps; say which is the input with «columns» input="{other}", '
                f'or input="{still}"'
            )


def _moves(values: NDArray[Any]) -> bool:
    kept = values[np.isfinite(values)]
    return bool(len(kept)) and bool(np.ptp(kept) > 0.2 * np.abs(kept).max())


def run_of(name: str, sha256: str, tables: Sequence[LogTable], options: ReadOptions, file: str = "") -> Run:
    """The run behind the tables of one log; the name pattern is looked for in `file`, or in the name."""
    name = plain(name)
    table, roles = chosen_table(tables, options)
    source, clock, units = table.source, _clock(table, roles, options), options.units
    level, repeat = level_and_repeat(source, options.name_pattern, file or name)
    if level is None and options.name_pattern is not None:  # which the name of its folder may tell
        folder = Path(source).resolve().parent.name
        level, repeat = level_and_repeat(source, options.name_pattern, f"{folder}-{file or name}")
    kind, which = _input_of(table, roles)
    if which is None and options.name_pattern is not None and level is None:
        raise table.fault("its name does not match «name_pattern»; rename it or mend the pattern")

    cells, columns = _loaded(table, [roles.output, clock, roles.reference, roles.position, which])
    if which is not None and "input" not in options.columns:
        refuse_still(table, roles, which, columns[which])
    raw_time = np.arange(len(columns[roles.output])) if clock is None else columns[clock]
    by_user, by_column = unit_of_time(table, roles, clock, raw_time, options)
    used = [column for column in (which, roles.output, roles.position) if column is not None]
    label = "time" if clock is None else table.label(clock)
    by_label = {label: raw_time} | {table.label(i): columns[i] for i in used}
    unread = {
        (one.row, "" if one.column < 0 else table.label(one.column)): one.text
        for one in cells.bad if one.column in {-1, clock, *used}
    }  # fmt: skip
    factor = by_user or by_column or 1.0
    keep = checked(source, by_label, unread, lambda sample: f"row {cells.row(sample)}", options.repair, factor)
    rows = slice(None) if keep is None else keep
    kept = {column: values[rows] for column, values in columns.items()}
    time_s, start_s, of_time = seconds_since_start(table, label, raw_time[rows], by_user, by_column)
    into = scale_of(table, roles.output, "output", units.get("output"), default_unit(table.columns[roles.output]))
    output = into.of(kept[roles.output])
    if which is not None and kind is not None:
        scale = scale_of(table, which, "input", units.get("input"), default_unit(table.columns[which], kind))
        input_ = scale.of(kept[which])
    else:
        scale = _of_names(name, options)
        input_ = np.broadcast_to(np.float64(np.nan), len(output))  # takes no memory
    told = [*roles.findings, *of_time, *_asked_once([*scale.findings, *into.findings])]
    if keep is not None:
        told.append(finding("rows-dropped", name, dropped=len(raw_time) - len(keep), count=len(raw_time)))
    if into.unit == "N·m" and "output" not in units and np.abs(output).max() > LARGEST_NM:
        told.append(finding("torque-too-large", name, largest=float(np.abs(output).max())))
    if level is not None and which is not None and not (np.abs(np.abs(input_) - abs(level)) <= 0.02 * abs(level)).any():
        most = float(input_[np.abs(input_).argmax()])
        told.append(finding("level-contradicted", name, level=level, found=most, unit=scale.unit))
    if which is not None and alternates(input_, output, level):
        input_ = np.abs(input_)
        told.append(finding("input-alternates", name, level=float(input_.max()), unit=scale.unit))
    of_role = {"time": clock, "input": which, "output": roles.output, "reference": roles.reference,
               "position": roles.position}  # fmt: skip
    taken = {role: column for role, column in of_role.items() if column is not None}
    others = [table.label(column) for column in range(len(table.columns)) if column not in taken.values()]
    beside = partial(_beside, table, roles, rows)
    reference = (
        None if roles.reference is None else _reference_scale(table, roles, options, into).of(kept[roles.reference])
    )
    position = None if roles.position is None else read_only(kept[roles.position])
    return Run(
        name, time_s, read_only(input_), output, scale.unit, into.unit, source, sha256,
        level=level if which is None else None, repeat=repeat, start_s=start_s, synthetic=table.synthetic,
        step_s=_on_clock(options.step_at, time_s, start_s), until_s=_on_clock(options.until, time_s, start_s),
        reference_nm=reference, position=position, position_unit=_position_unit(table, roles, options),
        kind=options.kind or kind,
        findings=tuple(msgspec.structs.replace(one, subject=name) for one in told),
        taken=tuple((role, table.label(column)) for role, column in taken.items()), left=(*others, *table.dropped),
        moves=tuple(
            (label, float(time_s[at])) for label, values in (beside() if which is None else ())
            if (at := leaves_rest(values)) is not None
        ), others=beside,
    )  # fmt: skip


def alternates(input_: Array, output: Array, level: float | None) -> bool:
    """Whether an input is of alternating sign only to hold its size, as the voltage of a drive is: that of the `level`
    which a name tells, or one that is held while its sign turns again and again, and that the output goes with."""
    size, turns = np.abs(input_), int(np.count_nonzero(np.diff(np.sign(input_[input_ != 0]))))
    if turns < FEWEST_TURNS or not np.isfinite(size).all() or np.ptp(output) == 0:
        return False
    if level is not None:
        still = (np.abs(size - level) <= SEEN_ALIKE * level) | (size <= SEEN_ALIKE * level)
        return float(still.mean()) >= ALTERNATES
    if np.ptp(size) == 0 or np.count_nonzero(np.abs(np.diff(size)) > SEEN_ALIKE * size.max()) > HELD_PART * turns:
        return False
    by_size, by_sign = (float(np.corrcoef(one, output)[0, 1]) for one in (size, input_))
    return by_size > GOES_WITH[1] and abs(by_sign) < GOES_WITH[0]


def without_switches(runs: Sequence[Run], options: ReadOptions) -> list[Run]:
    """Runs, without an input that goes to one value in all of them while the levels in their names differ: it is a
    switch, and tells when they step."""
    told = [one.values for run in runs for one in run.findings if one.code == "level-contradicted"]
    levels, tops = ([float(str(one[key])) for one in told] for key in ("level", "found"))
    alike = 0 < len(told) == len(runs) and np.ptp(np.abs(tops)) <= 0.02 * np.abs(tops).max()
    if not alike or len(set(levels)) < 2 or "input" in options.columns:
        return list(runs)
    found = []
    for run, level, top in zip(runs, levels, tops, strict=True):
        on = np.abs(run.input) > 0.5 * abs(top)
        first = int(on.argmax())
        off = first + int((~on[first:]).argmax())  # `first` where it stays on
        taken, unit = dict(run.taken), _of_names(run.source, options)
        column, at_s = taken.pop("input"), float(run.time_s[first])
        switch = finding("input-is-a-switch", run.name, column=column, top=top, unit=run.input_unit)
        of_input = [
            one for one in run.findings if one.code == "level-contradicted" or one.values.get("role") == "input"
        ]
        kept = [one for one in run.findings if one not in of_input]
        ends_s = float(run.time_s[off]) if off > first else None
        found.append(replace(
            run, input=np.broadcast_to(np.float64(np.nan), len(run.output)), input_unit=unit.unit, level=level,
            kind=options.kind, findings=(*kept, *unit.findings, switch), taken=tuple(taken.items()),
            left=(column, *run.left), moves=((column, at_s),) if words_of(split_name(column)[0]) & MOTION else (),
            step_s=at_s if run.step_s is None else run.step_s, until_s=ends_s if run.until_s is None else run.until_s,
        ))  # fmt: skip
    return found


def _clock(table: LogTable, roles: Roles, options: ReadOptions) -> int | None:
    """The column of the time; None where the user gives the rate of rows that nothing but numbers them, or whose stamps
    have too few digits to tell one from the next."""
    if roles.time is None or options.rate_hz is None:
        return roles.time
    stamps = _loaded(table, [roles.time])[1][roles.time]
    if numbers_samples(table.columns[roles.time]) or np.mean(np.diff(stamps) == 0) > TOO_COARSE:
        return None
    raise table.fault(f"has a time column, {table.label(roles.time)}, so «rate_hz» does nothing; leave it out")


def _reference_scale(table: LogTable, roles: Roles, options: ReadOptions, output: Scale) -> Scale:
    """What turns a reference into the output's unit: that of its own, else that of the output, which it is meant for;
    DataError where the two are of different kinds."""
    assert roles.reference is not None
    given = options.units.get("reference")
    if not given and not declared_unit(table, roles.reference, "reference", None):
        return Scale(output.unit, output.factor)
    own = scale_of(table, roles.reference, "reference", given, "")
    if own.unit != output.unit:
        raise table.fault(
            f"its reference, {table.label(roles.reference)}, is in {own.unit}, its output in {output.unit}: no loop "
            "follows that; say which column is the reference with «columns» reference=NAME, or its unit with «units» "
            "reference=UNIT"
        )
    return own


def _position_unit(table: LogTable, roles: Roles, options: ReadOptions) -> str:
    """The unit of a position as it is called: nothing is turned into it."""
    if roles.position is None or options.units.get("position"):
        return options.units.get("position", "")
    return table.unit(roles.position) or split_name(table.columns[roles.position])[1]


def _of_names(subject: str, options: ReadOptions) -> Scale:
    """The unit of levels that names tell, which hold none but beside the level."""
    if unit := options.units.get("input"):
        known = unit_of(unit)
        return Scale(known.to if known.quantity and known.factor == 1 else unit, 1.0)
    likely = unit_beside(options.name_pattern or "") or "UNIT"
    asked = finding("unit-unknown", subject, column="the levels of names", ask=f"input={likely}")
    return Scale(UNKNOWN, 1.0, (asked,) if options.name_pattern else ())


def _asked_once(findings: Sequence[Finding]) -> list[Finding]:
    """Unknown units of one log as one question."""
    open_ = [one for one in findings if one.code == "unit-unknown"]
    if len(open_) < 2:
        return list(findings)
    column, ask = (sep.join(str(one.values[key]) for one in open_) for key, sep in (("column", " and "), ("ask", ",")))
    one = finding("unit-unknown", open_[0].subject, column=column, ask=ask)
    return [one, *(other for other in findings if other not in open_)]


def _beside(table: LogTable, roles: Roles, rows: slice | NDArray[np.intp]) -> Beside:
    """The few columns that are not read, where they are numbers that move and no clock."""
    others = [column for column in range(len(table.columns)) if column not in roles.taken]
    cells: tuple[NDArray[Any], ...] = ()
    if 0 < len(others) <= MOST_OTHERS:
        with contextlib.suppress(DataError, OSError):  # what is bad in them is no fault of the log
            cells = table.load(others).values
    found = []
    for column, values in zip(others, cells, strict=False):
        values = values[rows]
        if not rises(values) and np.isfinite(values).all() and np.ptp(values):
            found.append((table.label(column), read_only(values.astype(np.float64))))
    return tuple(found)


def _on_clock(instant_s: float | None, time_s: Array, start_s: float) -> float | None:
    """An instant of the log's clock on `time_s`; one outside the log that lies inside since its start is meant so."""
    if instant_s is None or not len(time_s):
        return instant_s
    since = instant_s - start_s
    outside = not time_s[0] <= since <= time_s[-1]
    return instant_s if outside and time_s[0] <= instant_s <= time_s[-1] else since
