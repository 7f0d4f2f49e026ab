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
from eaid.logs.foreign.groups import SAVE_AS, Column, grouped, table_of
from eaid.logs.table import Table


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


def tables_of(variables: Mapping[str, Any], name: str = "") -> list[Table]:
    """Tables of named values, those of every structure among them."""
    tables: list[Table] = []
    arrays: dict[str, NDArray[Any]] = {}
    for leaf, value in variables.items():
        if isinstance(value, np.ndarray) and value.dtype.names and value.size == 1:
            tables.extend(_structure(f"{name}.{leaf}" if name else leaf, value.reshape(-1)[0]))
        elif isinstance(value, np.ndarray):
            number = _number(value)
            arrays[leaf] = value if number is None else number
    found, dropped = grouped(name, arrays)
    return [
        *(replace(table, dropped=(*table.dropped, *dropped)) for table in tables),
        *(table_of(label, columns, dropped) for label, columns in found),
    ]


def _texts(value: Any) -> list[str]:
    """All texts of a label: one, or one a column."""
    if isinstance(value, np.ndarray) and value.dtype == object:
        return [text for item in value.reshape(-1) for text in _texts(item)]
    if isinstance(value, np.ndarray) and value.dtype.kind == "U":
        return [str(text) for text in value.reshape(-1)]
    return []


def _apart(columns: Sequence[Column]) -> list[Column]:
    """Columns with names of their own: a number behind a name that comes again."""
    seen: Counter[str] = Counter()
    named = []
    for one in columns:
        seen[one.label] += 1
        named.append(one if seen[one.label] == 1 else one._replace(label=f"{one.label} #{seen[one.label]}"))
    return named


def _signal(k: int, signal: Any, fields: Sequence[str], length: int, alone: bool) -> list[Column]:
    """Columns of one signal of a structure with time, named by its labels."""
    values = _number(signal["values"])
    if values is None:
        return []
    table = values if values.shape[0] == length or not length else values.T
    table = table.reshape(len(table), -1)
    labels = _texts(signal["label"]) if "label" in fields else []
    if len(labels) != table.shape[1]:
        label = labels[-1] if labels else ("output" if alone and table.shape[1] == 1 else f"signal{k + 1}")
        labels = [label] if table.shape[1] == 1 else [f"{label} {j + 1}" for j in range(table.shape[1])]
    return [Column(label, table[:, j]) for j, label in enumerate(labels)]


def _structure(name: str, record: Any) -> list[Table]:
    """Structure with time (`time`, `signals.values`, `signals.label`), or any structure of vectors."""
    fields = record.dtype.names
    signals = record["signals"] if "signals" in fields else None
    if not (isinstance(signals, np.ndarray) and signals.dtype.names and "values" in signals.dtype.names):
        return tables_of({field: record[field] for field in fields}, name)
    time = _number(record["time"]) if "time" in fields else None
    every = signals.reshape(-1)
    columns = [
        column
        for k, signal in enumerate(every)
        for column in _signal(k, signal, signals.dtype.names, 0 if time is None else time.size, len(every) == 1)
    ]
    if time is not None:
        clock = time.reshape(-1)
        columns = [Column("time", clock), *(one for one in columns if not np.array_equal(one.array, clock))]
    columns = [one for one in columns if len(one.array) == len(columns[0].array)]
    return [replace(table_of(name, _apart(columns)), clock=None if time is None else 0)] if columns else []


def read_npy(path: Path, source: str) -> list[Table]:
    """The one table of a NumPy file; raises DataError where it holds no columns of numbers."""
    try:
        array = np.load(path, allow_pickle=False)
    except (ValueError, EOFError) as fault:
        if "pickle" in str(fault):
            raise DataError(
                f"{source}: holds pickled objects, which can run code; save its numbers as numpy.asarray(…, float)"
            ) from None
        raise DataError(f"{source}: is no whole NumPy array of numbers; export the log as CSV or HDF5") from None
    names = [name for name in array.dtype.names or () if array.dtype[name].kind in "fiub"]
    columns = [Column(name, array, name) for name in names]
    if array.ndim == 2 and array.dtype.kind in "fiub":
        columns = [Column("", array, k) for k in range(min(array.shape))]
    if not columns:
        raise DataError(
            f"{source}: holds no columns of numbers; save a matrix, or records with a field for each column"
        )
    return [table_of("", columns)]
