"""Several columns of time in one log: whether they tell the same time.

Both are taken at the ends of `CLOCK_BLOCKS` equal parts of the log. They contradict each other where, in most parts,
what one says to have passed differs from what the other says by more than `OFF` of the longer, and by more than both
resolve.
"""

import contextlib
import math
from collections.abc import Collection, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from eaid.arrays import Array, median
from eaid.errors import DataError
from eaid.logs.table import Table
from eaid.logs.units import TIME_FACTORS, time_unit

OFF = 0.05  # Share by which two clocks may differ: no clock drifts so far, and units differ by 24 and more
CLOCK_BLOCKS = 20


class Clock(NamedTuple):
    """A column of time, shape (n,), NaN where a cell holds none."""

    column: str
    time_s: Array  # Since its first row, as its header or its stamps say it
    factor: float  # Seconds in one unit of it


def clock_of(column: str, raw: NDArray[Any], factor: float) -> Clock:
    """A column of time by its numbers."""
    return Clock(column, (raw - raw[0]) * factor if len(raw) else raw, factor)


def other_clocks(path: str, table: Table, taken: Collection[int | None]) -> list[Clock]:
    """The columns, besides those that are taken, that say a time and its unit."""
    clocks = []
    for column, name in enumerate(table.columns):
        if column not in taken and len(name) != 1:  # s may be a stroke, h a height
            with contextlib.suppress(DataError):
                if factor := time_unit(path, None, table, column)[1]:
                    clocks.append(clock_of(table.label(column), table.load([column]).values[0], factor))
    return clocks


def contradicting(time: Clock, others: Sequence[Clock]) -> Clock | None:
    """The first of the others, of as many rows, that tells another time."""
    return next((one for one in others if len(one.time_s) == len(time.time_s) and not _agree(time, one)), None)


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
    return bool(median(np.abs(a - b) - OFF * np.maximum(a, b)) <= 2 * finest)


def contradiction(path: str, time: Clock, other: Clock) -> DataError:
    """That two columns of time contradict each other, and what to do."""
    a, b = (float(np.nanmax(one.time_s)) for one in (time, other))
    counts = time.factor * b / a  # seconds in one unit of the first, if the second is right
    likely = next((unit for unit, size in TIME_FACTORS.items() if abs(math.log(counts / size)) < OFF), "")
    own = next((unit for unit, size in TIME_FACTORS.items() if math.isclose(size, time.factor)), "s")
    other_right = f"«units» time={likely}" if likely else f'«columns» time="{other.column}" «units» time=UNIT'
    return DataError(
        f"{path}: two columns of time contradict each other: by {time.column} the log takes {a:.4g} s, by "
        f"{other.column} {b:.4g} s; say {other_right} if the second is right, «units» time={own} if the first is"
    )
