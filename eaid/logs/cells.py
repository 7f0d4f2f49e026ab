"""The cells of a text log as columns: by pandas' parser where each is a plain finite number, else cell by cell."""

import io
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from eaid.logs.table import BadCell, Cells
from eaid.shown import pandas

if TYPE_CHECKING:
    from eaid.logs.text import Dialect

COMMENT = ("#", "%", "//")


def at_once(body: str, dialect: "Dialect", columns: Sequence[int], line: int) -> Cells | None:
    """The columns of a piece by pandas' parser; None where anything in them is not a plain finite number, or a row is
    longer or shorter than the first."""
    if not set(columns).isdisjoint(dialect.stamps):
        return None
    marks = dialect.marks
    if marks.delimiter is None:  # cells stand apart by one blank each
        body = "\n".join(" ".join(row.strip("[]; \r").split()) for row in body.split("\n"))
    between = marks.delimiter or " "
    first = body.partition("\n")[0].split(between)
    data = f"{body}\n".encode()
    signs = np.frombuffer(data, dtype=np.uint8)
    between_cells = (signs == ord(between)) | (signs == ord("\n"))
    ends = signs[between_cells] == ord("\n")  # of cells: which end a row
    quoted = '"' in body and (np.cumsum(signs == ord('"'))[between_cells] % 2).any()  # what parts no cells
    even = len(first) >= dialect.count and ends.sum() * len(first) == len(ends)
    if quoted or not even or not ends[len(first) - 1 :: len(first)].all():
        return None
    # more than a float surely holds: stamps in ns stay whole
    kinds = {i: np.int64 if len(one := first[i].strip('" ')) > 15 and one.isdigit() else np.float64 for i in columns}
    try:
        table = pandas.read_csv(
            io.BytesIO(data), sep=between, decimal=marks.decimal, header=None, usecols=list(kinds), dtype=kinds,
            na_filter=False, skip_blank_lines=False, low_memory=False,
        )  # fmt: skip
    except (ValueError, OverflowError):
        return None
    values = tuple(table[column].to_numpy() for column in columns)
    return Cells(values, rows=((0, line),)) if all(np.isfinite(one).all() for one in values) else None


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
