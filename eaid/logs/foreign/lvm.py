"""LabVIEW measurement files (.lvm), read by lvm_read: text with a header, and one or more segments with a header each.

The column of times is made here, whatever the file has: X_Columns One (a column of its own), Multi (one a channel, all
alike) or No (X0 + i Delta_X). Segments follow each other: where their times start anew, the clock times in their
headers tell how far apart they are.
"""

import itertools
import math
from collections.abc import Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from eaid.arrays import Array
from eaid.errors import DataError
from eaid.logs.table import BadCell, Cells, Table

END = "***End_of_Header***"
MARKED = ("***Start_Special***", "***End_Special***")


def read_lvm(path: Path, source: str) -> list[Table]:
    """The one table of a LabVIEW measurement file; raises DataError where its header cannot be followed."""
    import lvm_read

    raw = path.read_bytes()
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = raw.decode("cp1252", errors="replace")
    lines = _without_special([line + "\n" for line in text.splitlines()])
    if not any(line.startswith(END) for line in lines[:100]):
        raise DataError(f"{source}: its header has no end ({END}); copy or save it again")
    separator = next((line[9:10] for line in lines[:100] if line.startswith("Separator")), "\t") or "\t"
    try:
        said: Mapping[Any, Any] = lvm_read.read_lines(_joined(lines, separator), separator=separator)
        segments = [said[k] for k in range(int(said["Segments"]))]
        names = [_channels(one) for one in segments]
    except Exception as fault:  # lvm_read has no type of its own for a header that it cannot follow
        reason = " ".join(str(fault).split())[:100] or type(fault).__name__
        raise DataError(f"{source}: its header cannot be followed ({reason}); save it again") from None
    own = str(said.get("X_Columns", "One")).strip()
    if own not in ("No", "One", "Multi"):
        raise DataError(f"{source}: its X_Columns is {own!r}, not No, One or Multi; save it again")
    if not names or not names[0]:
        raise DataError(f"{source}: names no channels; record the log again")
    for others in names:
        if others != names[0]:
            raise DataError(f"{source}: its channels change ({', '.join(others[:8])}, before: "
                            f"{', '.join(names[0][:8])}); split the file there")  # fmt: skip
    dimension = next((one for one in segments[0].get("X_Dimension", []) if one), "Time")
    if dimension != "Time":
        raise DataError(f"{source}: its X is {dimension}, not Time: no log; save the signal itself")
    parts = [_segment(source, one, own, len(names[0])) for one in segments]
    time = [times for times, _ in parts]
    _put_apart(time, [_clock(one, str(said.get("Decimal_Separator", "."))) for one in segments])
    columns = [np.concatenate(time), *np.concatenate([values for _, values in parts]).T]

    def load(wanted: Sequence[int]) -> Cells:
        bad = [BadCell(int(row), i, "") for i in wanted for row in np.flatnonzero(~np.isfinite(columns[i]))]
        return Cells(tuple(columns[i] for i in wanted), tuple(bad))

    units = [str(unit).strip() for unit in segments[0].get("Y_Unit_Label", [])][: len(names[0])]
    return [Table("", ("time", *names[0]), load, ("s", *units, *[""] * (len(names[0]) - len(units))))]


def _without_special(lines: list[str]) -> list[str]:
    """The lines without the blocks that other programs put between the headers."""
    kept, inside = [], False
    for line in lines:
        inside = inside or line.startswith(MARKED[0])
        if not inside:
            kept.append(line)
        inside = inside and not line.startswith(MARKED[1])
    return kept


def _joined(lines: list[str], separator: str) -> list[str]:
    """The lines as lvm_read needs them: a blank one before each segment and nowhere else, `Channels` as wide as names.

    It takes any blank line for the next segment, and counts columns by the cells behind `Channels`.
    """
    kept = []
    for i, line in enumerate(lines):
        if not line.strip(" \t\r\n" + separator):
            continue
        if line.startswith("Channels"):
            names = next((one for one in lines[i:] if one.startswith("X_Value")), "")
            count = line.split(separator)[1].strip() if separator in line else ""
            line = separator.join(["Channels", count, *[""] * (names.count(separator) - 1)]) + "\n"
            kept.append("\n")
        kept.append(line)
    return kept


def _channels(segment: Mapping[str, Any]) -> list[str]:
    """Channels of a segment, without the times and the comment."""
    names = [str(name).strip().strip('"') for name in segment["Channel names"]]
    return [name for name in names if name and name not in ("X_Value", "Comment")]


def _segment(source: str, segment: Mapping[str, Any], own: str, count: int) -> tuple[Array, Array]:
    """Times [s] and values, shape (n, channels), of one segment."""
    table = np.asarray(segment["data"], dtype=np.float64)
    if table.ndim != 2 or not len(table):
        raise DataError(f"{source}: holds a segment without rows; record the log again")
    names = [str(name).strip().strip('"') for name in segment["Channel names"]]
    if own == "No":
        step = next((float(one) for one in segment.get("Delta_X", []) if math.isfinite(one)), math.nan)
        start = next((float(one) for one in segment.get("X0", []) if math.isfinite(one)), 0.0)
        if not step > 0:
            raise DataError(f"{source}: has neither a column of times nor a Delta_X above 0; save it again")
        return np.asarray(start + np.arange(len(table)) * step, dtype=np.float64), table[:, :count]
    times = [i for i, name in enumerate(names) if name == "X_Value"]
    places = [i for i, name in enumerate(names) if name not in ("", "X_Value", "Comment")]
    if any(not np.array_equal(table[:, i], table[:, times[0]], equal_nan=True) for i in times[1:]):
        raise DataError(f"{source}: its channels have different times; export them on one X column")
    return table[:, times[0]], table[:, places]


def _clock(segment: Mapping[str, Any], decimal: str) -> float:
    """Clock time of a segment [s], counted from a fixed day; NaN where the header has none that can be read."""

    def first(key: str) -> str:
        value = segment.get(key, "")
        return next((str(one) for one in ([value] if isinstance(value, str) else value) if one), "")

    whole, _, fraction = first("Time").replace(decimal, ".").partition(".")
    try:
        at = datetime.strptime(f"{first('Date')} {whole}", "%Y/%m/%d %H:%M:%S")
        return (at - datetime(2000, 1, 1)).total_seconds() + float(f"0.{fraction or 0}")
    except ValueError:
        return math.nan


def _put_apart(times: list[Array], started: Sequence[float]) -> None:
    """Add each segment's start by the clock where the times of the segments start anew."""
    anew = any(after[0] <= before[-1] for before, after in itertools.pairwise(times))
    if anew and all(math.isfinite(one) for one in started):
        for k, start in enumerate(started):
            times[k] = times[k] + (start - started[0])
