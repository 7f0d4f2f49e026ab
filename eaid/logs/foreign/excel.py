"""Excel workbooks (`.xlsx`) → tables: the block of numbers of each sheet under the row of names above it."""

from collections.abc import Sequence
from datetime import date
from itertools import zip_longest
from pathlib import Path
from typing import Any

import numpy as np

from eaid.errors import DataError
from eaid.logs.table import BadCell, Cells, LogTable, seconds
from eaid.logs.units import unit_of

SheetRow = Sequence[Any]


def read_excel(path: Path, source: str) -> list[LogTable]:
    """One table a sheet that holds numbers: its values as last computed, not its formulas."""
    import openpyxl

    book = openpyxl.load_workbook(path, read_only=True, data_only=True)
    sheets = ((sheet.title, list(sheet.iter_rows(values_only=True))) for sheet in book.worksheets)
    tables = [table for name, rows in sheets if (table := _sheet_table(str(name), rows)) is not None]
    if not tables:
        raise DataError(f"{source}: no sheet of it holds rows of numbers; a log is a table, one row a sample")
    return tables


def _is_number(cell: Any) -> bool:
    return isinstance(cell, int | float | date) and not isinstance(cell, bool)


def _sheet_table(name: str, rows: Sequence[SheetRow]) -> LogTable | None:
    """The rows from the first one with as many numbers as any; None without two of two columns."""
    counts = [sum(map(_is_number, row)) for row in rows]
    most = max(counts, default=0)
    if most < 2 or counts.count(most) < 2:
        return None
    start = counts.index(most)
    while rows and not any(cell is not None for cell in rows[-1]):
        rows = rows[:-1]
    places = [i for i, cell in enumerate(rows[start]) if _is_number(cell)]
    columns = [column for i, column in enumerate(zip_longest(*rows)) if i in places]
    above = [row for row in range(start - 1, -1, -1) if any(map(bool, rows[row]))]
    words = [["" if column[row] is None else str(column[row]).strip() for column in columns] for row in above]
    told = [unit_of(word).quantity for word in (words[0] if words else ()) if word]
    units = words.pop(0) if len(words) > 1 and told and all(told) else [""] * len(places)
    stamped = tuple(k for k, i in enumerate(places) if isinstance(rows[start][i], date))
    units = ["s" if k in stamped else unit for k, unit in enumerate(units)]

    def load(wanted: Sequence[int]) -> Cells:
        values, bad = [], []
        for k in wanted:
            cells = columns[k][start:]
            if k in stamped:
                stamps = [np.datetime64(cell) if isinstance(cell, date) else np.datetime64("NaT") for cell in cells]
                column = seconds(np.array(stamps, dtype="datetime64[us]"))
            else:
                column = np.array([cell if _is_number(cell) else np.nan for cell in cells], dtype=np.float64)
            wrong = {row: cells[row] for row in np.flatnonzero(~np.isfinite(column)).tolist()}
            bad += [BadCell(row, k, "" if cell is None else str(cell)[:40]) for row, cell in wrong.items()]
            values.append(column)
        return Cells(tuple(values), tuple(bad), ((0, start + 1),))

    labels = tuple(words[0]) if words else ("",) * len(places)
    return LogTable(name, labels, load, tuple(units), stamped=stamped)
