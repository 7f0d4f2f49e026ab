"""A table of a file: its columns are named before they are read."""

import sys
import unicodedata
from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eaid.arrays import Array
from eaid.errors import DataError


def plain(text: str) -> str:
    """A name or unit without control, bidirectional and other unseen characters, which any output might obey."""
    if text.isprintable():
        return text
    visible = "".join(" " if unicodedata.category(one)[0] in "CZ" else one for one in text)
    return " ".join(visible.split())


def seconds(stamps: NDArray[Any]) -> Array:
    """Seconds since the first of datetime64 or timedelta64 stamps, to the nanosecond; NaN where there is none."""
    known = ~np.isnat(stamps)
    gone = (stamps - stamps[known.argmax() if len(stamps) else slice(0)]).astype("timedelta64[ns]").astype(np.int64)
    return np.where(known, gone / 1e9, np.nan)


@dataclass(frozen=True)
class BadCell:
    """A cell that is no finite number."""

    row: int  # Index into the arrays, from 0
    column: int  # Index into `LogTable.columns`; −1: the whole row (too few or too many cells)
    text: str  # What stands there, shortened; empty where nothing does


@dataclass(frozen=True)
class Cells:
    """Columns as read, shape (n,) each, numbers of any type; bad cells are NaN and listed."""

    values: tuple[NDArray[Any], ...]
    bad: tuple[BadCell, ...] = ()
    # Samples, and their rows of the file, from which on rows go with samples; the first sample is 0
    rows: tuple[tuple[int, int], ...] = ((0, 1),)

    def row(self, index: int) -> int:
        """Row of the file, counted as an editor counts lines, of one sample."""
        sample, row = self.rows[bisect_right(self.rows, (index, sys.maxsize)) - 1]
        return row + index - sample


def with_times(load: Callable[[Sequence[int]], Cells], start_s: float, step_s: float, columns: Sequence[int]) -> Cells:
    """Columns of a file whose header says the time of its rows; its first column is empty."""
    cells = load([column for column in columns if column] or [1])
    time_s = start_s + step_s * np.arange(len(cells.values[0]))
    values = iter(cells.values)
    return replace(cells, values=tuple(next(values) if column else time_s for column in columns))


@dataclass(frozen=True)
class LogTable:
    """What the columns of a table are called, and how to read some of them."""

    name: str  # Variable, group or channel group; empty where a file is one table
    columns: tuple[str, ...]  # Names as the file has them; empty strings where it has none
    # Reads the chosen columns, in the chosen order
    load: Callable[[Sequence[int]], Cells]
    # Unit of each column where the file says it apart from the name; empty strings where not
    units: tuple[str, ...] = ()
    synthetic: str | None = None  # What made the data, where a comment or a property says so
    clock: int | None = None  # Column of the time, where the format itself says which it is
    stamped: tuple[int, ...] = ()  # Columns of wall-clock stamps, whose unit nobody has to say
    unmatched: tuple[str, ...] = ()  # Names that the file has and that are not as many as its columns
    # Columns that hold no numbers (texts, complex numbers, cells), and so cannot be chosen
    dropped: tuple[str, ...] = ()
    source: str = ""  # How sentences name its file

    def __post_init__(self) -> None:
        for name in ("columns", "units", "dropped", "unmatched"):
            object.__setattr__(self, name, tuple(map(plain, getattr(self, name))))
        if self.synthetic is not None:
            object.__setattr__(self, "synthetic", plain(self.synthetic))

    def unit(self, column: int) -> str:
        """Unit of a column as the file says it apart from its name; empty where it does not."""
        return self.units[column] if self.units else ""

    def fault(self, what: str) -> DataError:
        """A refusal of its file."""
        return DataError(f"{self.source}: {what}")

    def label(self, column: int) -> str:
        """How a sentence names a column."""
        return self.columns[column] or f"column {column + 1}"
