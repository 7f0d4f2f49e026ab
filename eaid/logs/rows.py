"""A piece of a text log → its columns: by the C parser of pandas, else cell by cell.

Numbers of both ways are correctly rounded. A piece that pandas stumbles over (a word in a column of numbers, an empty
cell, a comment, a row too long) is taken apart cell by cell, so that every bad cell is told by its row and column.
"""

import contextlib
import math
import re
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from eaid.logs.dialect import Dialect
from eaid.logs.marks import COMMENT, Marks
from eaid.logs.table import BadCell, Cells

MOST_DIGITS = 15
"""Digits of a whole number that a float surely holds; stamps in ns have more, and stay whole."""


def by_pandas(body: memoryview, dialect: Dialect, columns: Sequence[int], line: int) -> Cells | None:
    """The columns of a piece by pandas' C parser; None where anything in them is not a plain finite number."""
    import pandas as pd
    from pandas.errors import ParserError

    count, marks = len(dialect.columns), dialect.marks
    head = marks.cells(bytes(body[:4096]).splitlines()[0].decode("latin-1"), count)
    kinds: dict[int, Any] = {count - 1: "S1"}  # its first byte shows that a row is not too short
    for column in columns:
        if column in dialect.stamps:
            kinds[column] = str
        elif (cell := head[min(column, len(head) - 1)]).isdigit() and len(cell) > MOST_DIGITS:
            kinds.pop(column, None)  # whole numbers
        else:
            kinds[column] = np.float64
    wanted = sorted({*columns, count - 1})
    file: Any = _Counted(body, (marks.delimiter or "\n").encode())
    options: dict[str, Any] = {"thousands": marks.thousands} if marks.thousands else {}
    if tuple(int(part) for part in pd.__version__.split(".")[:2]) < (3, 1):
        options["float_precision"] = "round_trip"  # correctly rounded by itself from 3.1 on
    try:
        frame = pd.read_csv(
            file, sep=marks.delimiter or r"\s+", decimal=marks.decimal, header=None, index_col=False,
            names=list(range(count + dialect.ragged)), usecols=wanted if marks.delimiter else None,
            skip_blank_lines=False, encoding_errors="replace", na_filter=False, low_memory=False,
            dtype=kinds, **options,
        )  # fmt: skip
    except (ParserError, ValueError, OverflowError):
        return None
    if kinds.get(count - 1) == "S1" and not frame[count - 1].to_numpy().view(np.uint8).all():
        return None
    values = [frame[column].to_numpy(object if column in dialect.stamps else None) for column in columns]
    for column, one in zip(columns, values, strict=True):
        if column in dialect.stamps:
            if not all(one):
                return None
        elif one.dtype.kind not in "fiu" or (one.dtype.kind == "f" and not np.isfinite(one).all()):
            return None
    if marks.delimiter and file.count != len(frame) * (count - 1 + dialect.ragged):  # it cuts a row too long in silence
        return None
    return Cells(tuple(values), first_row=line)


class _Counted:
    """A piece as a file for pandas, whose bytes it takes as they are; counts one mark on the way."""

    def __init__(self, body: memoryview, mark: bytes) -> None:
        self._body, self._mark, self._at = body, ord(mark), 0
        self.count = 0

    def read(self, most: int) -> bytes:
        """The next bytes."""
        block = bytes(self._body[self._at : self._at + most])
        self._at += most
        self.count += int(np.count_nonzero(np.frombuffer(block, dtype=np.uint8) == self._mark))
        return block

    def __iter__(self) -> Iterator[bytes]:
        """Lines, which pandas asks of whatever is a file, and never takes."""
        return iter(())


def cell_by_cell(body: memoryview, dialect: Dialect, columns: Sequence[int], line: int) -> Cells:
    """The columns of a piece cell by cell, every bad cell listed; comment and blank lines are passed over.

    Stamps stay texts: what they mean depends on those before them.
    """
    encoding = "cp1252" if dialect.encoding == "cp1252" else "utf-8"
    count = len(dialect.columns)
    values: list[list[Any]] = [[] for _ in columns]
    rows: list[int] = []
    bad: list[BadCell] = []
    for row, raw in enumerate(re.split(rb"\r\n|\n|\r", body), start=line):
        text = raw.decode(encoding, errors="replace").strip("\r\n \x00\x1a")
        if not text or text.startswith(COMMENT):
            continue
        cells = dialect.marks.cells(text, count)
        here, whole = len(rows), len(cells) == count
        rows.append(row)
        if not whole:
            bad.append(BadCell(here, -1, str(len(cells))))
        for k, column in enumerate(columns):
            if column in dialect.stamps:
                values[k].append(cells[column] if whole else "")
                continue
            value = plain_value(cells[column], dialect.marks) if whole else math.nan
            if whole and not math.isfinite(value):
                bad.append(BadCell(here, column, cells[column].strip()[:40]))
                value = math.nan
            values[k].append(value)
    arrays = [
        np.array(one, dtype=object if column in dialect.stamps else np.float64)
        for one, column in zip(values, columns, strict=True)
    ]
    return Cells(tuple(arrays), tuple(bad), rows)


def plain_value(text: str, marks: Marks) -> float:
    """Value of a cell; NaN where it is no number."""
    if marks.decimal == "." and not marks.thousands and "_" not in text:
        with contextlib.suppress(ValueError):
            return float(text)
    value = marks.value(text)
    return math.nan if value is None else value
