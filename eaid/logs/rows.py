"""A piece of a text log → its columns: by the CSV parser of Arrow, else cell by cell.

Numbers of both ways are correctly rounded. A piece that Arrow stumbles over (a word in a column of numbers, an empty
cell, a comment, a row too long) is taken apart cell by cell, so that every bad cell is told by its row and column.
"""

import math
import re
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eaid.logs.dialect import Dialect
from eaid.logs.marks import COMMENT, Marks
from eaid.logs.table import BadCell, Cells

MOST_DIGITS = 15
"""Digits of a whole number that a float surely holds; stamps in ns have more, and stay whole."""


def by_arrow(body: memoryview, dialect: Dialect, columns: Sequence[int], line: int) -> Cells | None:
    """The columns of a piece by Arrow's parser; None where anything in them is not a plain finite number."""
    import pyarrow as pa
    from pyarrow import csv

    marks, names = dialect.marks, [str(i) for i in range(len(dialect.columns) + dialect.ragged)]
    first = marks.cells(bytes(body[:4096]).splitlines()[0].decode("latin-1"), len(dialect.columns))
    kinds = {}
    for column in columns:
        digits = first[min(column, len(first) - 1)]
        number = pa.int64() if digits.isdigit() and len(digits) > MOST_DIGITS else pa.float64()
        kinds[names[column]] = pa.string() if column in dialect.stamps else number
    plain = _without_thousands(_one_blank(body) if marks.delimiter is None else body, dialect)
    if plain is None:
        return None
    try:
        table = csv.read_csv(
            pa.BufferReader(pa.py_buffer(plain)),
            csv.ReadOptions(use_threads=False, block_size=len(plain) + 1, column_names=names),
            csv.ParseOptions(delimiter=marks.delimiter or " ", ignore_empty_lines=False),
            csv.ConvertOptions(
                column_types=kinds, include_columns=list(kinds), null_values=[], decimal_point=marks.decimal
            ),
        )
    except pa.ArrowInvalid:
        return None
    # one chunk, as the block is the piece; its own to_numpy would load pandas
    values: list[NDArray[Any]] = []
    for column in columns:
        (cells,) = table[names[column]].chunks
        stamps = column in dialect.stamps
        values.append(np.array(cells.to_pylist(), dtype=object) if stamps else np.from_dlpack(cells))
        if not (values[-1].all() if stamps else np.isfinite(values[-1]).all()):
            return None
    return Cells(tuple(values), first_row=line)


def _one_blank(body: memoryview) -> bytes:
    """A piece whose cells stand apart by one blank each."""
    return b"\n".join(b" ".join(row.split()) for row in bytes(body).splitlines())


def _without_thousands(body: bytes | memoryview, dialect: Dialect) -> bytes | memoryview | None:
    """A piece without the marks between thousands; None where one is something else, or may be."""
    marks = dialect.marks
    if not marks.thousands or marks.thousands.encode() not in bytes(body):
        return body
    if dialect.stamps or marks.thousands == marks.delimiter:
        return None
    other = rf"[^{re.escape(marks.delimiter or ' ')}\r\n]*"
    for cell in re.findall(f"{other}{re.escape(marks.thousands)}{other}".encode(), body):
        if marks.value(cell.decode("latin-1")) is None:
            return None
    return bytes(body).translate(None, marks.thousands.encode())


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
    value = marks.value(text)
    return math.nan if value is None else value
