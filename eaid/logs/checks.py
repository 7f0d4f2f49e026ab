"""Bad rows of a log: told by row and column, or dropped where the user asks for it."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eaid.errors import DataError

MOST_DROPPED = 0.01
"""`repair` drops up to this share of a log's rows."""
MOST_REPEATED = 0.2
"""Share of rows that repeat the time before them from which on the stamps have too few digits."""
CHANGES = 0.1
"""Share of its range by which an input changes at a dropped row for it to be that of a step."""
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
    if repeated > MOST_REPEATED * count:
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
    few = dropped <= MOST_DROPPED * count
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
    least = CHANGES * float(np.nanmax(input_) - np.nanmin(input_))
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
