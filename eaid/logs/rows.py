"""Which rows of a log are bad, by their cells or by a time that does not rise, and which are kept."""

import re
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eaid.errors import DataError
from eaid.logs.columns import FEWEST_IN_COLUMN

THOUSANDS = r"[+-]?\d{1,3}([,.' ]\d{3})+[,.]\d+"  # A number with marks between thousands, and a decimal mark
SHOWN_FAULTS = 5  # Bad rows of a kind up to which each is told; of more, the first and a count

Unread = Mapping[tuple[int, str], str]  # What stands at a sample under a label (empty: in its whole row)


def checked(
    source: str, columns: Mapping[str, NDArray[Any]], unread: Unread, at: Callable[[int], str], repair: bool,
    time_factor: float = 1.0,
) -> NDArray[np.intp] | None:  # fmt: skip
    """Samples to keep (None: all); raises DataError where rows are bad, all its faults at once.

    `columns` by their label, the first of them the time; `unread` are cells that could not be read; `at` says where a
    sample stands in the file.
    """
    time = next(iter(columns.values()))
    count = len(time)
    if count == 0:
        raise DataError(f"{source}: has a header but no rows; record the log again")
    if not unread and all(np.isfinite(values).all() for values in columns.values()) and (np.diff(time) > 0).all():
        return None
    cells = _bad_cells(source, columns, unread, at)
    bad = np.isin(np.arange(count), list(cells))
    fine = np.flatnonzero(~bad)
    rising = time[fine]
    # a row is bad where its time is not above all times before it: dropping those leaves a rising time
    highest = np.maximum.accumulate(rising)
    late = np.flatnonzero(rising[1:] <= highest[:-1]) + 1
    repeated = int(np.count_nonzero(rising[1:] == rising[:-1]))
    if repeated > 0.2 * count:  # the stamps have too few digits
        raise DataError(
            f"{source}: {repeated} of {count} rows repeat the time of the row before, from {at(int(fine[late[0]]))} "
            "on: its stamps have too few digits, or rows were written twice; save each row once, with all digits, or "
            "give the sample rate with «rate_hz»"
        )
    jumps = np.flatnonzero(np.diff(rising) <= 0) + 1
    set_back = len(late) > 5 * len(jumps)  # the clock was set back, and went on
    falls = []
    for k in (jumps if set_back else late).tolist():
        now, before = float(rising[k]) * time_factor, float(highest[k - 1]) * time_factor
        how = "is repeated" if rising[k] == highest[k - 1] else "falls"
        falls.append(f"time {how} at {at(int(fine[k]))} ({now:.12g} s after {before:.12g} s)")
    bad[fine[late]] = True
    dropped = int(bad.sum())
    few = dropped <= 0.01 * count
    drop = ", or drop such rows with «repair»" if few else ""
    of_time = (
        "split the log where its clock was set back; or number its runs in a further column, if the next begins there"
        if set_back
        else f"sort the rows{drop}"
    )
    faults = _listed(source, [one for sample in sorted(cells) for one in cells[sample]], f"mend the cell{drop}")
    faults += _listed(source, falls, of_time)
    if not repair:
        raise DataError(*faults)
    if not few:
        most = f"{dropped} of {count} rows are bad, more than «repair» drops (1 % of a log)"
        raise DataError(f"{source}: {most}; record it again, or cut them out of the file, whose gap is told", *faults)
    return np.flatnonzero(~bad)


def _bad_cells(
    source: str, columns: Mapping[str, NDArray[Any]], unread: Unread, at: Callable[[int], str]
) -> dict[int, list[str]]:
    """What is wrong with the cells of each bad sample; DataError where a column holds too few numbers."""
    for label, values in columns.items():
        gone, count = int(np.isnan(values).sum()), len(values)
        words = [text for (_, column), text in unread.items() if column == label and text]
        if gone == count and words:
            raise DataError(
                f"{source}: column {label} holds no number in any row, but words such as {words[0]!r}; write what they "
                f"stand for in numbers, or name another column with «columns»"
            )
        if grouped := [text for text in words if re.fullmatch(THOUSANDS, text)]:
            raise DataError(
                f"{source}: column {label} holds {grouped[0]!r} and the like in {len(grouped)} of {count} rows; write "
                f"them with one decimal mark, and none for thousands"
            )
        if count >= FEWEST_IN_COLUMN and 0.2 * count < gone < count:
            raise DataError(
                f"{source}: column {label} holds a number in {count - gone} of {count} rows only; save the rows in "
                f"which it was sampled, or all columns at one rate"
            )
    torn = {sample: text for (sample, label), text in unread.items() if not label}
    faults = {sample: [f"{at(sample)} has {text} cells, unlike the others"] for sample, text in torn.items()}
    for label, values in columns.items():
        for sample in sorted({*np.flatnonzero(~np.isfinite(values)).tolist()} - torn.keys()):
            found = unread.get((sample, label))
            what = "is infinite" if np.isinf(values[sample]) else "is empty or not a number"
            if found is not None:
                number = re.fullmatch(r"[+-]?(nan|inf|[\d.]+e\+?\d{3,})", found, re.IGNORECASE)
                what = f"holds {found!r}, which is {'not finite' if number else 'no number'}" if found else "is empty"
            faults.setdefault(sample, []).append(f"{at(sample)}, column {label}, {what}")
    return faults


def _listed(source: str, faults: list[str], remedy: str) -> list[str]:
    if len(faults) > SHOWN_FAULTS:
        faults = [f"{faults[0]}, and {len(faults) - 1} more such rows"]
    return [f"{source}: {what}; {remedy}" for what in faults]
