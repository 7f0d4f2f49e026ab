"""LabVIEW measurement files (.lvm): text with a header, and one or more segments with a header each.

The column of times is made here, whatever the file has: X_Columns One (a column of its own), Multi (one a channel, all
alike) or No (X0 + i Delta_X). Segments follow each other: where their times start anew, the clock times in their
headers tell how far apart they are.
"""

import itertools
import math
import re
from collections.abc import Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import NamedTuple

import numpy as np

from eaid.arrays import Array
from eaid.errors import DataError
from eaid.logs.table import BadCell, Cells, Table
from eaid.logs.text import Marks

END = "***End_of_Header***"
MARKED = ("***Start_Special***", "***End_Special***")


class _Segment(NamedTuple):
    header: Mapping[str, Sequence[str]]
    names: Sequence[str]
    """Of all columns, `X_Value` and `Comment` among them."""
    rows: Sequence[tuple[int, list[str]]]
    """Line of the file and cells."""

    @property
    def places(self) -> list[int]:
        """The columns of its channels."""
        return [i for i, name in enumerate(self.names) if name not in ("", "X_Value", "Comment")]

    @property
    def channels(self) -> list[str]:
        return [self.names[i] for i in self.places]

    def said(self, key: str) -> str:
        """The first cell of a line of the header that is not empty."""
        return next((cell for cell in self.header.get(key, ()) if cell), "")

    def clock(self, decimal: str) -> float:
        """Clock time [s], counted from a fixed day; NaN where the header has none that can be read."""
        whole, _, fraction = self.said("Time").replace(decimal, ".").partition(".")
        try:
            at = datetime.strptime(f"{self.said('Date')} {whole}", "%Y/%m/%d %H:%M:%S")
            return (at - datetime(2000, 1, 1)).total_seconds() + float(f"0.{fraction or 0}")
        except ValueError:
            return math.nan


def read_lvm(path: Path, source: str) -> list[Table]:
    """The one table of a LabVIEW measurement file; raises DataError where its header cannot be followed."""
    raw = path.read_bytes()
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = raw.decode("cp1252", errors="replace")
    lines = _without_special(source, re.split(r"\r\n|\n|\r", text))
    separator = next((line[9:10] for _, line in lines[:100] if line.startswith("Separator")), "\t") or "\t"
    cells = [(k, [cell.strip().strip('"') for cell in line.split(separator)]) for k, line in lines]
    end = next((i for i, (_, row) in enumerate(cells[:100]) if row[0] == END), None)
    if end is None:
        raise DataError(f"{source}: its header has no end ({END}); copy or save it again")
    said = {row[0]: row[1:] for _, row in cells[:end]}
    segments = _segments(source, cells[end + 1 :])
    x_columns = next(iter(said.get("X_Columns", ())), "One")
    if x_columns not in ("No", "One", "Multi"):
        raise DataError(f"{source}: its X_Columns is {x_columns!r}, not No, One or Multi; save it again")
    names = segments[0].channels
    if not names:
        raise DataError(f"{source}: names no channels; record the log again")
    for segment in segments:
        if segment.channels != names:
            raise DataError(f"{source}: its channels change ({', '.join(segment.channels[:8])}, before: "
                            f"{', '.join(names[:8])}); split the file there")  # fmt: skip
    if (dimension := segments[0].said("X_Dimension") or "Time") != "Time":
        raise DataError(f"{source}: its X is {dimension}, not Time: no log; save the signal itself")
    marks = Marks(separator, next(iter(said.get("Decimal_Separator", ())), "."))
    bad: list[BadCell] = []
    tables: list[Array] = []
    for segment in segments:
        tables.append(_table(source, segment, x_columns, marks, bad, sum(map(len, tables))))
    times = [table[:, 0] for table in tables]
    started = [segment.clock(marks.decimal) for segment in segments]
    anew = any(after[0] <= before[-1] for before, after in itertools.pairwise(times))
    if anew and all(math.isfinite(one) for one in started):
        times = [time + (start - started[0]) for time, start in zip(times, started, strict=True)]
    columns = [np.concatenate(times), *np.concatenate([table[:, 1:] for table in tables]).T]
    at = [0, *(line for segment in segments for line, _ in segment.rows)]
    rows = tuple((i, line) for i, (before, line) in enumerate(itertools.pairwise(at)) if not i or line != before + 1)

    def load(wanted: Sequence[int]) -> Cells:
        return Cells(tuple(columns[i] for i in wanted), tuple(one for one in bad if one.column in (-1, *wanted)), rows)

    units = [*segments[0].header.get("Y_Unit_Label", ()), *[""] * len(names)][: len(names)]
    return [Table("", ("time", *names), load, ("s", *units))]


def _without_special(source: str, lines: list[str]) -> list[tuple[int, str]]:
    """The lines and their numbers, without the blocks that other programs put between the headers."""
    kept, begun = [], 0
    for number, line in enumerate(lines, start=1):
        begun = begun or number * line.startswith(MARKED[0])
        if not begun:
            kept.append((number, line))
        if line.startswith(MARKED[1]):
            begun = 0
    if begun:
        raise DataError(f"{source}: row {begun} begins a special block that does not end; copy or save it again")
    return kept


def _segments(source: str, cells: list[tuple[int, list[str]]]) -> list[_Segment]:
    """Headers and rows, segment by segment, each begun by the line `Channels`; blank lines count nowhere."""
    full = [(number, row) for number, row in cells if len(row) > 2 or any(row)]
    begins = [i for i, (_, row) in enumerate(full) if row[0] == "Channels"]
    segments = []
    for begin, end in itertools.pairwise([*begins, len(full)]):
        part = full[begin:end]
        names = next((i for i, (_, row) in enumerate(part) if row[0] == "X_Value"), None)
        if names is None:
            raise DataError(f"{source}: its header cannot be followed (no line X_Value); save it again")
        segments.append(_Segment({row[0]: row[1:] for _, row in part[:names]}, part[names][1], part[names + 1 :]))
    if not segments or begins[0] > 0:
        raise DataError(f"{source}: its header cannot be followed (no line Channels); save it again")
    return segments


def _table(source: str, segment: _Segment, x_columns: str, marks: Marks, bad: list[BadCell], before: int) -> Array:
    """Times [s] and values of one segment, shape (n, 1 + channels); its bad cells, `before` rows on, go to `bad`."""
    if not segment.rows:
        raise DataError(f"{source}: holds a segment without rows; record the log again")
    clocks = [i for i, name in enumerate(segment.names) if name == "X_Value"] if x_columns != "No" else []
    taken = [*clocks, *segment.places]
    table = np.full((len(segment.rows), len(taken)), np.nan)
    for k, (_, row) in enumerate(segment.rows):
        more = "Comment" not in segment.names and any(row[len(segment.names) :])
        if len(row) <= taken[-1] or more:
            bad.append(BadCell(before + k, -1, str(len(row))))
            continue
        for j, place in enumerate(taken):
            table[k, j] = marks.number(row[place])
            if not math.isfinite(table[k, j]):
                bad.append(BadCell(before + k, max(0, j - len(clocks) + 1), row[place][:40]))
                table[k, j] = np.nan
    if clocks:
        if any(not np.array_equal(table[:, j], table[:, 0], equal_nan=True) for j in range(1, len(clocks))):
            raise DataError(f"{source}: its channels have different times; export them on one X column")
        return np.column_stack([table[:, 0], table[:, len(clocks) :]])
    step, start = (marks.value(segment.said(key) or "nan") for key in ("Delta_X", "X0"))
    for key, value in (("Delta_X", step), ("X0", start)):
        if value is None:
            said = segment.said(key)
            raise DataError(f"{source}: its header cannot be followed ({said!r} is no number); save it again")
    if not step or not step > 0:
        raise DataError(f"{source}: has neither a column of times nor a Delta_X above 0; save it again")
    return np.column_stack([(start if start and math.isfinite(start) else 0.0) + np.arange(len(table)) * step, table])
