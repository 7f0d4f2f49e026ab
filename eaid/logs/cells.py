"""The cells of a text log as columns: by Arrow's parser where each is a plain finite number, else cell by cell."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from eaid.logs.table import BadCell, Cells

if TYPE_CHECKING:
    from eaid.logs.text import Dialect

COMMENT = ("#", "%", "//")


def by_arrow(body: str, dialect: "Dialect", columns: Sequence[int], line: int) -> Cells | None:
    """The columns of a piece by Arrow's parser; None where anything in them is not a plain finite number."""
    if not set(columns).isdisjoint(dialect.stamps):
        return None
    import pyarrow as pa
    from pyarrow import csv as arrow

    marks = dialect.marks
    if marks.delimiter is None:  # cells stand apart by one blank each
        body = "\n".join(" ".join(row.strip("[]; \r").split()) for row in body.split("\n"))
    first = body.partition("\n")[0].split(marks.delimiter or " ")
    names = [str(i) for i in range(max(len(first), dialect.count))]
    kinds = {}
    for column in columns:
        digits = first[min(column, len(first) - 1)]
        long = digits.isdigit() and len(digits) > 15  # more than a float surely holds: stamps in ns stay whole
        kinds[names[column]] = pa.int64() if long else pa.float64()
    data = body.encode()
    try:
        table = arrow.read_csv(
            pa.BufferReader(pa.py_buffer(data)),
            arrow.ReadOptions(use_threads=False, block_size=len(data) + 1, column_names=names),
            arrow.ParseOptions(delimiter=marks.delimiter or " ", ignore_empty_lines=False),
            arrow.ConvertOptions(
                column_types=kinds, include_columns=list(kinds), null_values=[], decimal_point=marks.decimal
            ),
        )
    except pa.ArrowInvalid:
        return None
    # one chunk, as the block is the piece; its own to_numpy would load pandas
    values: list[NDArray[Any]] = []
    for column in columns:
        (cells,) = table[names[column]].chunks
        values.append(np.from_dlpack(cells))
        if not np.isfinite(values[-1]).all():
            return None
    return Cells(tuple(values), rows=((0, line),))


def cell_by_cell(body: str, dialect: "Dialect", columns: Sequence[int], line: int) -> Cells:
    """The columns of a piece cell by cell, every bad cell listed; comment and blank lines are passed over.

    Stamps stay texts: what they mean depends on those before them.
    """
    count, length = dialect.count, 0
    values: list[list[Any]] = [[] for _ in columns]
    rows: list[tuple[int, int]] = []
    bad: list[BadCell] = []
    for row, raw in enumerate(body.split("\n"), start=line):
        text = raw.strip(" \0\x1a")
        if not text.strip("[];") or text.startswith(COMMENT):
            continue
        if not rows or row - length != rows[-1][1] - rows[-1][0]:
            rows.append((length, row))
        cells = dialect.marks.cells(text, count)[: count if dialect.remarks else None]
        whole = len(cells) == count
        if not whole:
            bad.append(BadCell(length, -1, str(len(cells))))
        for k, column in enumerate(columns):
            if column in dialect.stamps:
                values[k].append(cells[column] if whole else "")
                continue
            value = dialect.marks.value(cells[column]) if whole else None
            if whole and (value is None or not math.isfinite(value)):
                bad.append(BadCell(length, column, cells[column].strip()[:40]))
                value = None
            values[k].append(math.nan if value is None else value)
        length += 1
    kinds = [object if column in dialect.stamps else np.float64 for column in columns]
    arrays = (np.array(one, dtype=kind) for one, kind in zip(values, kinds, strict=True))
    return Cells(tuple(arrays), tuple(bad), tuple(rows))
