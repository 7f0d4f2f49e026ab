"""MAT-files v4 and v5: a matrix (QuaRC: time first, samples in columns or rows), vectors, structures with time.

Only numbers are taken; objects, function handles and cells are left where they are and nothing in them is run.
"""

import zlib
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from eaid.arrays import read_only
from eaid.errors import DataError
from eaid.logs.mat_elements import check_elements
from eaid.logs.sheet import Cells, Sheet

FEWEST = 10
"""Rows below which a matrix is no record."""
MOST_RATIO = 200
"""A variable that unpacks to more than this many times the size of its file is a bomb (records: about 10)."""
_COMPRESSED = 15  # miCOMPRESSED
SAVE_AS = (
    "in MATLAB, save it as plain arrays: t = S.Time; y = squeeze(S.Data); save('log.mat', 't', 'y', '-v7') "
    "for each signal S of the Dataset"
)


def read_mat(path: Path, source: str) -> list[Sheet]:
    """Sheets of a MAT-file v4 or v5; raises DataError where it holds no numbers."""
    check_size(path, source)
    check_elements(path, source)
    from scipy.io import loadmat

    try:
        content: Mapping[str, Any] = loadmat(str(path), struct_as_record=True, squeeze_me=False)
    except NotImplementedError:
        raise DataError(f"{source}: is a MAT-file of a version that eaid cannot read; save it with -v7") from None
    except Exception as fault:  # SciPy has no common type for what it stumbles over
        reason = " ".join(str(fault).split())[:120] or type(fault).__name__
        raise DataError(f"{source}: is a damaged MAT-file ({reason}); save it again") from None
    variables = {name: value for name, value in content.items() if not name.startswith("__")}
    sheets = sheets_of(variables)
    if not sheets:
        opaque = any("function" in name.lower() or "None" in name for name in content) or any(
            type(value).__name__ in ("MatlabOpaque", "MatlabFunction") for value in content.values()
        )
        if opaque:
            raise DataError(f"{source}: holds MATLAB objects (a Simulink Dataset or timeseries) only; {SAVE_AS}")
        raise DataError(f"{source}: holds no table of numbers; save time and torque as arrays")
    return sheets


def check_size(path: Path, source: str) -> None:
    """Refuse a MAT-file whose variables claim to be far larger than the file, before anything is unpacked."""
    size = path.stat().st_size
    limit = max(MOST_RATIO * size, 1 << 25)
    with path.open("rb") as file:
        head = file.read(128)
        order: Literal["little", "big"] = "big" if head[126:128] == b"MI" else "little"
        if head[126:128] not in (b"MI", b"IM"):
            rows, columns = (int.from_bytes(head[i : i + 4], "little", signed=True) for i in (4, 8))
            claimed = 8 * rows * columns if rows > 0 and columns > 0 else 0
            if claimed > limit and rows < 1 << 24 and columns < 1 << 24:
                raise DataError(f"{source}: claims {claimed:,} bytes in a file of {size:,} bytes; no log does")
            return
        while len(tag := file.read(8)) == 8:
            kind, length = (int.from_bytes(tag[i : i + 4], order) for i in (0, 4))
            here = file.tell()
            if kind == _COMPRESSED:
                try:
                    inner = zlib.decompressobj().decompress(file.read(min(length, 4096)), 8)
                except zlib.error:
                    inner = b""
                claimed = int.from_bytes(inner[4:8], order)
            else:
                claimed = length
            if claimed > limit:
                raise DataError(f"{source}: claims {claimed:,} bytes in a file of {size:,} bytes; no log does")
            file.seek(here + length)


def _number(value: Any) -> NDArray[Any] | None:
    """A real numeric array without its empty axes, or None."""
    if isinstance(value, np.ndarray) and value.dtype.kind in "fiub" and value.size:
        return np.squeeze(value) if value.ndim > 2 else value
    return None


def sheets_of(variables: Mapping[str, Any]) -> list[Sheet]:
    """Sheets of named values: vectors of one length together, each matrix and each structure by itself."""
    sheets: list[Sheet] = []
    vectors: dict[int, list[tuple[str, NDArray[Any]]]] = {}
    for name, value in variables.items():
        if isinstance(value, np.ndarray) and value.dtype.names and value.size == 1:
            sheets.extend(_structure(name, value.reshape(-1)[0]))
            continue
        array = _number(value)
        if array is None or array.size < 2 or array.ndim > 2:
            continue
        if array.ndim == 2 and min(array.shape) > 1 and max(array.shape) < FEWEST:
            continue  # gains and other settings, no record
        if array.ndim == 1 or 1 in array.shape:
            vectors.setdefault(array.size, []).append((name, array.reshape(-1)))
        else:
            sheets.append(_matrix(name, array))
    sheets.extend(_sheet("" if len(vectors) == 1 else columns[0][0], columns) for columns in vectors.values())
    return sheets


def _sheet(name: str, columns: Sequence[tuple[str, NDArray[Any]]]) -> Sheet:
    """A sheet of arrays that are in memory already."""

    def load(wanted: Sequence[int]) -> Cells:
        return Cells(tuple(read_only(columns[i][1]) for i in wanted))

    return Sheet(name, tuple(column for column, _ in columns), load)


def labels_of_matrix(first: NDArray[Any], count: int) -> tuple[str, ...]:
    """Names of a matrix's columns: none where the first is a time (they go by their place), else their numbers."""
    rising = len(first) > 2 and bool(np.mean(np.diff(first.astype(np.float64)) > 0) > 0.9)
    return ("",) * count if rising else tuple(f"column {i + 1}" for i in range(count))


def _matrix(name: str, array: NDArray[Any]) -> Sheet:
    """A matrix, samples along its longer side."""
    table = array if array.shape[0] >= array.shape[1] else array.T
    labels = labels_of_matrix(table[:, 0], table.shape[1])
    return _sheet(name, [(label, table[:, i]) for i, label in enumerate(labels)])


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


def _structure(name: str, record: Any) -> list[Sheet]:
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
            return [replace(_sheet(name, _apart(columns)), clock=None if time is None else 0)]
    inside = {field: record[field] for field in fields}
    return [
        Sheet(f"{name}.{sheet.name}".rstrip("."), sheet.columns, sheet.load, sheet.units) for sheet in sheets_of(inside)
    ]
