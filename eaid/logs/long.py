"""A long table: the rows of several runs one below the other, and a column that tells the runs apart.

Its time falls where the next run begins, and some column that is nothing else changes there.
"""

import itertools
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from eaid.logs.columns import chosen_table
from eaid.logs.table import Cells, LogTable
from eaid.options import ReadOptions

FEWEST_RUN_ROWS = 20  # Of a run on the average: a column that changes more often tells none
MOST_KEYS = 8  # Columns that are looked at


class OneRun(NamedTuple):
    """The rows of one run."""

    column: str  # What the column that tells the runs apart is called
    value: float  # What stands there
    table: LogTable


def runs_in(tables: Sequence[LogTable], options: ReadOptions) -> list[OneRun]:
    """The runs of a long table; none of a table of one log."""
    table, roles = chosen_table(tables, options)
    keys = [column for column in range(len(table.columns)) if column not in roles.taken][:MOST_KEYS]
    if roles.time is None or not keys:
        return []
    time, *values = table.load([roles.time, *keys]).values
    falls = np.flatnonzero(np.diff(time) < 0) + 1
    for column, key in zip(keys, values, strict=True):
        begins = np.flatnonzero(np.diff(key) != 0) + 1
        if len(falls) and np.isin(falls, begins).all() and FEWEST_RUN_ROWS * (len(begins) + 1) <= len(key):
            ends = [0, *begins.tolist(), len(key)]
            tables = _cut_table(table, ends)
            return [OneRun(table.label(column), float(key[at]), one) for at, one in zip(ends[:-1], tables, strict=True)]
    return []


def _cut_table(table: LogTable, ends: Sequence[int]) -> list[LogTable]:
    """The table in parts, each from one of its ends to the next; every column is read once for all of them."""
    whole = lru_cache(maxsize=8)(table.load)

    def of_rows(first: int, end: int) -> LogTable:
        def load(wanted: Sequence[int]) -> Cells:
            cells = whole(tuple(wanted))
            bad = tuple(replace(one, row=one.row - first) for one in cells.bad if first <= one.row < end)
            return Cells(tuple(values[first:end] for values in cells.values), bad, ((0, cells.row(first)),))

        return replace(table, load=load)

    return [of_rows(*one) for one in itertools.pairwise(ends)]
