"""Which table of a file is the log, and which of its columns is what, by names, else by the numbers.

By its numbers a time rises all the way, and a commanded input stands still but for jumps.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eaid.errors import DataError
from eaid.findings import Finding, finding
from eaid.logs.columns import Roles, kind_of, match_columns, shown
from eaid.logs.run import Kind
from eaid.logs.table import Table
from eaid.logs.units import likely_time_unit
from eaid.options import ReadOptions

FEWEST = 20
"""Samples below which a column is not said to step."""


def chosen_table(source: str, tables: Sequence[Table], options: ReadOptions) -> tuple[Table, Roles]:
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
        contents = "; ".join(
            f"{table.name or 'table'}: {', '.join(c or '?' for c in table.columns[:8])}" for table in tables[:6]
        )
        raise DataError(
            f"{source}: no table in it has columns of time and torque ({contents}); "
            "choose with «variable» and «columns»"
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


def by_place(path: str, table: Table, options: ReadOptions) -> Roles:
    """Columns without names: time, input, output where there are three; time, output where there are two.

    The first has to be the only one that rises all the way; where another one does, it is proposed.
    """
    count, rate = len(table.columns), bool(options.rate_hz or table.rate_hz)
    places = {(3, False): (0, 1, 2), (2, False): (0, None, 1), (2, True): (None, 0, 1), (1, True): (None, None, 0)}
    columns: tuple[NDArray[Any], ...] = ()
    rising: tuple[int, ...] = ()
    stepping: tuple[int, ...] = ()
    if count <= 64:
        columns = table.load(range(count)).values
        rising = tuple(i + 1 for i, values in enumerate(columns) if rises(values))
        stepping = tuple(i + 1 for i, values in enumerate(columns) if steps(values))
    if options.columns or (count, rate) not in places or (not rate and rising and 1 not in rising):
        time = rising[0] if len(rising) == 1 else 1
        input_ = next((i for i in stepping if i != time), None)
        output = next((i for i in range(count, 0, -1) if i not in (time, input_)), count)
        proposed = ",".join(
            f"{role}={place}" for role, place in (("time", time), ("input", input_), ("output", output)) if place
        )
        only = f"; only column {time} rises all the way" if len(rising) == 1 else ""
        usual = float(np.median(np.diff(columns[time - 1]))) if only else 0.0
        units = (
            f"; and the unit of time if it is not s, perhaps «units» time={likely_time_unit(usual)}"
            if usual >= 1
            else ""
        )
        raise DataError(
            f"{path}: its {count} columns have no names{only}; say by number, from 1 to {count}, what they are: "
            f"«columns» {proposed}{units}"
        )
    time_at, input_at, output_at = places[count, rate]
    order = [name for name, at in (("time", time_at), ("input", input_at), ("output", output_at)) if at is not None]
    inputs = ((options.kind or "clutch", input_at),) if input_at is not None else ()
    by_order = finding("columns-by-place", path, order=", ".join(order))
    return Roles(time_at, inputs, output_at, None, findings=(by_order,))


def rises(values: NDArray[Any]) -> bool:
    """Whether a column rises all the way but for 1 % of its rows, as a time does."""
    kept = values[np.isfinite(values)]
    return len(kept) > 2 and bool(np.mean(np.diff(kept) > 0) > 0.99)


def steps(values: NDArray[Any]) -> bool:
    """Whether a column stands still but for a few jumps, each from one sample to the next, as a commanded input."""
    kept = values[np.isfinite(values)].astype(np.float64)
    span = float(np.ptp(kept)) if len(kept) >= FEWEST else 0.0
    if span == 0.0:
        return False
    jumps = np.abs(np.diff(kept)) > 0.01 * span
    alone = jumps.copy()
    alone[1:] &= ~jumps[:-1]
    alone[:-1] &= ~jumps[1:]
    return 1 <= int(jumps.sum()) <= max(3, len(kept) // 20) and int(alone.sum()) >= 0.8 * int(jumps.sum())


def the_input(
    path: str, table: Table, roles: Roles, column: Callable[[int], NDArray[Any]], known: bool
) -> tuple[Kind | None, int | None, tuple[Finding, ...]]:
    """The input among the columns that may be it: the one that moves, where the names leave a choice.

    Where none that is called like an input moves, the only other column that steps is taken, and said; not where
    options say level and instant (`told`).
    """
    first = roles.inputs[0] if roles.inputs else None
    if first and (roles.said or (len(roles.inputs) == 1 and not roles.others)):
        return (*first, ())
    if first and first[0] == "clutch" and _moves(column(first[1])):  # a duty beside the constant speed and force
        return (*first, ())
    moving = [(kind, which) for kind, which in roles.inputs if _moves(column(which))]
    jumping = [one for one in moving if steps(column(one[1]))]
    if not jumping and not known:  # a speed that follows a throttle moves, but steps nowhere
        stepping = [which for which in roles.others[:64] if steps(column(which))]
        if moving:
            stepping = [which for which in stepping if len(np.unique(column(which))) > 2]  # more than on and off
        if len(stepping) == 1:
            name = table.label(stepping[0])
            still = shown([table.label(which) for _, which in roles.inputs])
            code = "input-by-its-steps" if still else "input-unnamed"
            return kind_of(name, ""), stepping[0], (finding(code, path, column=name, still=still),)
    if len(moving) == 1:
        return (*moving[0], ())
    if first is None:
        return None, None, ()
    if len(roles.inputs) == 1 or first[0] == "clutch":
        return (*first, ())
    kinds = " and ".join(kind for kind, _ in roles.inputs)
    raise DataError(f"{path}: may be {kinds}, as it has a column of each; say which with «kind»")


def _moves(values: NDArray[Any]) -> bool:
    kept = values[np.isfinite(values)]
    low, high = (float(kept.min()), float(kept.max())) if len(kept) else (0.0, 0.0)
    return high - low > 0.2 * max(abs(low), abs(high))
