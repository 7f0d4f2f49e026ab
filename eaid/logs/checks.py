"""Bad rows of a log: told by row and column, or dropped where the user asks for it."""

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from eaid.arrays import Array
from eaid.errors import DataError
from eaid.logs.spool import pieces

MOST_DROPPED = 0.01
"""`--repair` drops up to this share of a log's rows (CONTRACT.md)."""
SHOWN = 5
"""Bad rows told one by one; the rest of a kind are counted."""


def checked(
    source: str,
    columns: Mapping[str, Array],
    said: Sequence[tuple[int, str, str]],
    row_of: Callable[[int], int],
    word: str,
    repair: bool,
    labels: Mapping[str, str] | None = None,
    time_factor: float = 1.0,
) -> tuple[NDArray[np.intp] | None, tuple[str, ...]]:
    """Samples to keep (None: all), and what was dropped in words; raises DataError where rows are bad.

    `said` lists cells that could not be read: (sample, column label or empty for the whole row, what stands there).
    """
    labels = labels or {}
    time = columns["time"]
    count = len(time)
    lengths = {len(values) for values in columns.values()}
    if len(lengths) > 1:
        raise DataError(
            f"{source}: its columns have different lengths ({', '.join(map(str, sorted(lengths)))}); save it again"
        )
    if count == 0:
        raise DataError(f"{source}: has a header but no rows; record the log again")
    if not said and _all_good(columns):
        return None, ()
    bad = np.zeros(count, dtype=bool)
    faults: list[str] = []
    told: dict[tuple[int, str], None] = {}
    cells = []
    for sample, label, text in said:
        bad[sample] = True
        told[sample, label] = None
        if not label:
            cells.append(f"{word} {row_of(sample)} has {text} cells, unlike the others")
        elif not text:
            cells.append(f"{word} {row_of(sample)}, column {label}, is empty")
        else:
            finite = "is not finite" if _overflows(text) else "is no number"
            cells.append(f"{word} {row_of(sample)}, column {label}, holds {text!r}, which {finite}")
    whole = {sample for sample, label, _ in said if not label}
    for role, values in columns.items():
        label = labels.get(role) or role
        for sample in np.flatnonzero(~np.isfinite(values)).tolist():
            if (sample, label) not in told and sample not in whole:
                value = "empty or not a number" if np.isnan(values[sample]) else "infinite"
                cells.append(f"{word} {row_of(sample)}, column {label}, is {value}")
            bad[sample] = True
    faults.extend(_listed(source, cells, "mend the cell, or drop such rows with --repair"))

    fine = np.flatnonzero(~bad)
    steps = np.diff(time[fine])
    falls: list[str] = []
    if len(fine) > 1 and not (steps > 0).all():
        # a row is bad where its time is not above all times before it: dropping those leaves a rising time
        highest = np.maximum.accumulate(time[fine])
        late = np.flatnonzero(time[fine][1:] <= highest[:-1]) + 1
        for k in late.tolist():
            now, before = time[fine[k]] * time_factor, highest[k - 1] * time_factor
            how = "is repeated" if now == before else "falls"
            falls.append(f"time {how} at {word} {row_of(int(fine[k]))} ({now:.9g} s after {before:.9g} s)")
        bad[fine[late]] = True
        faults.extend(_listed(source, falls, "sort the rows, or drop such rows with --repair"))
    if not faults:
        return None, ()
    dropped = int(bad.sum())
    if not repair:
        raise DataError(*faults)
    if dropped > MOST_DROPPED * count:
        raise DataError(
            f"{source}: {dropped} of {count} rows are bad, more than --repair drops (1 % of a log); record it again",
            *faults,
        )
    return np.flatnonzero(~bad), (f"--repair dropped {dropped} of {count} rows",)


def _all_good(columns: Mapping[str, Array]) -> bool:
    """True where every value is finite and the time rises, found piece by piece."""
    for _, found in pieces(*columns.values(), overlap=1):
        if not all(np.isfinite(piece).all() for piece in found):
            return False
        time = found[list(columns).index("time")]
        if not (np.diff(time) > 0).all():
            return False
    return True


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
