"""MAT-files v4 and v5: a matrix (QuaRC: time first, samples in columns or rows), vectors, structures with time.

Only numbers are taken; objects, function handles and cells are left where they are and nothing in them is run.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eaid.errors import DataError
from eaid.logs.foreign.ask import named
from eaid.logs.table import Cells, Table

FEWEST = 10
"""Rows below which a matrix is no record."""
SAVE_AS = (
    "in MATLAB, save it as plain arrays: t = S.Time; y = squeeze(S.Data); save('log.mat', 't', 'y', '-v7') "
    "for each signal S of the Dataset"
)


def read_mat(path: Path, source: str) -> list[Table]:
    """Tables of a MAT-file v4 or v5; raises DataError where it holds no numbers."""
    from scipy.io import loadmat

    try:
        content: Mapping[str, Any] = loadmat(str(path), struct_as_record=True, squeeze_me=False)
    except NotImplementedError:
        raise DataError(f"{source}: is a MAT-file of a version that eaid cannot read; save it with -v7") from None
    variables = {name: value for name, value in content.items() if not name.startswith("__")}
    tables = tables_of(variables)
    if not tables:
        opaque = any("function" in name.lower() or "None" in name for name in content) or any(
            type(value).__name__ in ("MatlabOpaque", "MatlabFunction") for value in content.values()
        )
        if opaque:
            raise DataError(f"{source}: holds MATLAB objects (a Simulink Dataset or timeseries) only; {SAVE_AS}")
        raise DataError(f"{source}: holds no table of numbers; save time and torque as arrays")
    return tables


def _number(value: Any) -> NDArray[Any] | None:
    """A real numeric array without its empty axes, or None."""
    if isinstance(value, np.ndarray) and value.dtype.kind in "fiub" and value.size:
        return np.squeeze(value) if value.ndim > 2 else value
    return None


def tables_of(variables: Mapping[str, Any]) -> list[Table]:
    """Tables of named values: vectors of one length together, with the matrices of that length, column by column.

    A matrix without vectors beside it, and every structure, is a table by itself.
    """
    tables: list[Table] = []
    vectors: dict[int, list[tuple[str, NDArray[Any]]]] = {}
    matrices: list[tuple[str, NDArray[Any]]] = []
    dropped: list[str] = []
    for name, value in variables.items():
        if isinstance(value, np.ndarray) and value.dtype.names and value.size == 1:
            tables.extend(_structure(name, value.reshape(-1)[0]))
            continue
        array = _number(value)
        if array is None or array.ndim > 2:
            dropped.extend([name] if isinstance(value, np.ndarray) and value.size > 1 else [])
        elif array.size < 2 or (array.ndim == 2 and min(array.shape) > 1 and max(array.shape) < FEWEST):
            continue  # gains and other settings, no record
        elif array.ndim == 1 or 1 in array.shape:
            vectors.setdefault(array.size, []).append((name, array.reshape(-1)))
        else:
            matrices.append((name, array if array.shape[0] >= array.shape[1] else array.T))
    for name, matrix in matrices:
        if len(matrix) in vectors:
            vectors[len(matrix)].extend((f"{name}[{k + 1}]", column) for k, column in enumerate(matrix.T))
        else:
            labels = labels_of_matrix(matrix[:, 0], matrix.shape[1])
            tables.append(_table(name, list(zip(labels, matrix.T, strict=True))))
    tables.extend(_table("" if len(vectors) == 1 else columns[0][0], columns) for columns in vectors.values())
    return [replace(table, dropped=tuple(dropped)) for table in tables]


def _table(name: str, columns: Sequence[tuple[str, NDArray[Any]]]) -> Table:
    """A table of arrays that are in memory already."""

    def load(wanted: Sequence[int]) -> Cells:
        return Cells(tuple(columns[i][1] for i in wanted))

    return Table(name, tuple(column for column, _ in columns), load)


def labels_of_matrix(first: NDArray[Any], count: int) -> tuple[str, ...]:
    """Names of a matrix's columns: none where the first is a time (they go by their place), else their numbers."""
    rising = len(first) > 2 and bool(np.mean(np.diff(first.astype(np.float64)) > 0) > 0.9)
    return ("",) * count if rising else tuple(f"column {i + 1}" for i in range(count))


def _texts(value: Any) -> list[str]:
    """All texts of a label: one, or one a column."""
    if isinstance(value, np.ndarray) and value.dtype == object:
        return [text for item in value.reshape(-1) for text in _texts(item)]
    if isinstance(value, np.ndarray) and value.dtype.kind == "U":
        return [str(text) for text in value.reshape(-1)]
    return []


def _apart(columns: Sequence[tuple[str, NDArray[Any]]]) -> list[tuple[str, NDArray[Any]]]:
    """Columns with names of their own: a number behind a name that comes again."""
    seen: Counter[str] = Counter()
    named = []
    for name, values in columns:
        seen[name] += 1
        named.append((name if seen[name] == 1 else f"{name} #{seen[name]}", values))
    return named


def _signal(k: int, signal: Any, fields: Sequence[str], length: int, alone: bool) -> list[tuple[str, NDArray[Any]]]:
    """Columns of one signal of a structure with time, named by its labels."""
    values = _number(signal["values"])
    if values is None:
        return []
    table = values if values.shape[0] == length or not length else values.T
    table = table.reshape(len(table), -1)
    labels = _texts(signal["label"]) if "label" in fields else []
    if len(labels) == table.shape[1]:
        return [(label, table[:, j]) for j, label in enumerate(labels)]
    label = labels[-1] if labels else ("output" if alone and table.shape[1] == 1 else f"signal{k + 1}")
    if table.shape[1] == 1:
        return [(label, table[:, 0])]
    return [(f"{label} {j + 1}", table[:, j]) for j in range(table.shape[1])]


def _structure(name: str, record: Any) -> list[Table]:
    """Structure with time (`time`, `signals.values`, `signals.label`), or any structure of vectors."""
    fields = record.dtype.names
    if "signals" in fields:
        time = _number(record["time"]) if "time" in fields else None
        signals = record["signals"]
        if isinstance(signals, np.ndarray) and signals.dtype.names and "values" in signals.dtype.names:
            length = 0 if time is None else time.size
            every = signals.reshape(-1)
            columns = [
                column
                for k, signal in enumerate(every)
                for column in _signal(k, signal, signals.dtype.names, length, len(every) == 1)
            ]
            if time is not None:
                clock = time.reshape(-1)
                columns = [("time", clock), *(c for c in columns if not np.array_equal(c[1], clock))]
            columns = [column for column in columns if len(column[1]) == len(columns[0][1])]
            if not columns:
                return []
            return [replace(_table(name, _apart(columns)), clock=None if time is None else 0)]
    inside = {field: record[field] for field in fields}
    return named(tables_of(inside), name)
