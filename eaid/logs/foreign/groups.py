"""Named arrays that lie side by side (the variables of a MAT-file, the datasets of an HDF5 group) → tables.

Vectors of one length are a table, with the matrices of that length beside them, column by column. A matrix without
vectors beside it is a table by itself. Arrays may be NumPy's or h5py's, which are read when somebody asks.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from eaid.logs.table import Cells, Table

FEWEST = 10
"""Rows below which a matrix is no record, but gains and other settings."""
SAVE_AS = (
    "in MATLAB, save it as plain arrays: t = S.Time; y = squeeze(S.Data); save('log.mat', 't', 'y', '-v7') "
    "for each signal S of the Dataset"
)


class Column(NamedTuple):
    """A column of a table: an array, one of its rows or columns (whichever are longer), or one of its fields."""

    label: str
    array: Any
    part: int | str | None = None

    def values(self) -> NDArray[Any]:
        """Its numbers, shape (n,)."""
        key: Any = () if self.part is None else self.part
        if isinstance(self.part, int):
            across = self.array.shape[0] < self.array.shape[1]
            key = (self.part, slice(None)) if across else (slice(None), self.part)
        return np.asarray(self.array[key]).reshape(-1)


def table_of(name: str, columns: Sequence[Column], dropped: Sequence[str] = (), units: Sequence[str] = ()) -> Table:
    """A table of columns that hold numbers as they are."""

    def load(wanted: Sequence[int]) -> Cells:
        return Cells(tuple(columns[i].values() for i in wanted))

    return Table(name, tuple(one.label for one in columns), load, tuple(units), dropped=tuple(dropped))


def grouped(
    name: str, arrays: Mapping[str, Any], between: str = ".", said: Callable[[Any], Sequence[str]] = lambda _: ()
) -> tuple[list[tuple[str, list[Column]]], list[str]]:
    """Tables of the arrays in one place, a name and its columns each; and the names of what holds no real numbers.

    `name` is that of the place, `between` stands before what lies in it; `said`: names that a matrix has for its
    columns.
    """
    vectors: dict[int, list[Column]] = {}
    matrices: list[tuple[str, Any]] = []
    dropped: list[str] = []

    def inside(leaf: str) -> str:
        return f"{name}{between}{leaf}" if name else leaf

    for leaf, array in arrays.items():
        long = [n for n in array.shape if n != 1]
        if array.dtype.kind not in "fiub":
            dropped.extend([inside(leaf)] if array.size > 1 else [])
        elif len(long) == 1 and array.size:
            vectors.setdefault(array.size, []).append(Column(leaf, array))
        elif len(long) == array.ndim == 2 and max(long) >= FEWEST:
            matrices.append((leaf, array))
    tables: list[tuple[str, list[Column]]] = []
    for leaf, array in matrices:
        count, beside = min(array.shape), vectors.get(max(array.shape))
        labels = said(array)
        if len(labels) != count:
            first = Column("", array, 0).values() if beside is None else ()
            labels = (
                [f"{leaf}[{k + 1}]" for k in range(count)] if beside else _labels_by_first(np.asarray(first), count)
            )
        columns = [Column(label, array, k) for k, label in enumerate(labels)]
        if beside is None:
            tables.append((inside(leaf), columns))
        else:
            beside.extend(columns)
    tables.extend((name if len(vectors) == 1 else inside(columns[0].label), columns) for columns in vectors.values())
    return tables, dropped


def _labels_by_first(first: NDArray[Any], count: int) -> list[str]:
    """Names of a matrix's columns: none where the first is a time (they go by their place), else their numbers."""
    rising = len(first) > 2 and bool(np.mean(np.diff(first.astype(np.float64)) > 0) > 0.9)
    return [""] * count if rising else [f"column {i + 1}" for i in range(count)]
