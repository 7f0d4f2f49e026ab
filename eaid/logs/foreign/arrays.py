"""Files of named arrays → tables: MAT v4, v5 and v7.3, HDF5, NumPy's .npy and .npz.

Vectors of one length that lie in one place (the variables of a MAT-file, a structure, an HDF5 group) are a table, with
the matrices of that length beside them, column by column. A matrix without vectors beside it is a table by itself
(QuaRC: time first, samples in columns or rows), and so is every array of records. Only numbers are taken; objects,
function handles and cells are left where they are and nothing in them is run.

Links to other files, external storage and virtual datasets are refused. What CF and netCDF say of a variable holds:
value = `scale_factor` · stored + `add_offset`, cells that are `_FillValue` or `missing_value` are empty, `units`.
"""

import math
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np
from numpy.typing import NDArray

from eaid.errors import DataError
from eaid.logs.hdf import nodes, text
from eaid.logs.run import numbered
from eaid.logs.table import Cells, LogTable

FEWEST_IN_MATRIX = 10  # Rows below which a matrix is no record, but gains and other settings
OBJECTS = (
    "holds MATLAB objects (a Simulink Dataset or timeseries) only; in MATLAB, save it as plain arrays: t = S.Time; "
    "y = squeeze(S.Data); save('log.mat', 't', 'y', '-v7') for each signal S of the Dataset"
)
# Classes of MATLAB that are numbers; a file of another program says none
_CLASSES = {"", "double", "single", "logical", *(f"{u}int{n}" for u in ("", "u") for n in (8, 16, 32, 64))}


class ArrayColumn(NamedTuple):
    """A column of a table: an array of NumPy or h5py, one of its rows or columns (whichever are longer), or a field."""

    label: str
    array: Any
    part: int | str | None = None

    def attribute(self, name: str, plain: Any) -> Any:
        """An attribute of its array in an HDF5 file."""
        return self.array.attrs.get(name, plain) if isinstance(self.array, h5py.Dataset) else plain

    def values(self) -> NDArray[Any]:
        """Its numbers, shape (n,); NaN where none was ever written."""
        key: Any = () if self.part is None else self.part
        if isinstance(self.part, int):
            across = self.array.shape[0] < self.array.shape[1]
            key = (self.part, slice(None)) if across else (slice(None), self.part)
        if isinstance(self.array, h5py.Dataset):
            _check_chunks(self.array)
        stored = np.asarray(self.array[key]).reshape(-1)
        empty = np.zeros(len(stored), dtype=bool)
        for name in ("_FillValue", "missing_value"):
            empty |= np.isin(stored, np.atleast_1d(self.attribute(name, ())))
        usual = {"scale_factor": 1.0, "add_offset": 0.0}
        scale, offset = (np.float64(np.ravel(self.attribute(name, one))[0]) for name, one in usual.items())
        if (scale, offset) != (1.0, 0.0):
            stored = stored * scale + offset
        return np.where(empty, np.nan, stored) if empty.any() else stored


def _table(name: str, columns: Sequence[ArrayColumn], clock: int | None = None) -> LogTable:
    def load(wanted: Sequence[int]) -> Cells:
        return Cells(tuple(columns[i].values() for i in wanted))

    units = tuple(text(one.attribute("units", one.attribute("unit", ""))) for one in columns)
    return LogTable(name, tuple(one.label for one in columns), load, units, clock=clock)


def _tables(name: str, arrays: Mapping[str, Any], between: str = ".") -> tuple[list[LogTable], list[str]]:
    """Tables of the arrays in the place `name`, and which of them hold no real numbers.

    `between` stands between a place and what lies in it.
    """
    vectors: dict[int, list[ArrayColumn]] = {}
    matrices: list[tuple[str, Any]] = []
    tables: list[LogTable] = []
    dropped: list[str] = []

    def inside(leaf: str) -> str:
        return f"{name}{between}{leaf}" if name else leaf

    for leaf, array in arrays.items():
        long = [n for n in array.shape if n != 1]
        if array.dtype.names and array.ndim == 1:
            fields = [field for field in array.dtype.names if array.dtype[field].kind in "fiub"]
            tables.append(_table(inside(leaf), [ArrayColumn(field, array, field) for field in fields]))
        elif array.dtype.kind not in "fiub":
            dropped.extend([inside(leaf)] if array.size > 1 else [])
        elif len(long) == 1 and array.size:
            vectors.setdefault(array.size, []).append(ArrayColumn(leaf, array))
        elif len(long) == array.ndim == 2 and max(long) >= FEWEST_IN_MATRIX:
            matrices.append((leaf, array))
    for leaf, array in matrices:
        count, beside = min(array.shape), vectors.get(max(array.shape))
        columns = [ArrayColumn(f"{leaf}[{k + 1}]" if beside else "", array, k) for k in range(count)]
        if beside is None:
            tables.append(_table(inside(leaf), columns))
        else:
            beside.extend(columns)
    tables += [_table(name if len(vectors) == 1 else inside(one[0].label), one) for one in vectors.values()]
    return tables, dropped


def _with_dropped(tables: Sequence[LogTable], dropped: Sequence[str]) -> list[LogTable]:
    return [replace(table, dropped=(*table.dropped, *dropped)) for table in tables]


def read_mat(path: Path, source: str) -> list[LogTable]:
    """Tables of a MAT-file v4 or v5; raises DataError where it holds no numbers."""
    from scipy.io import loadmat

    try:
        content: Mapping[str, Any] = loadmat(str(path), struct_as_record=True, squeeze_me=False)
    except NotImplementedError:
        raise DataError(f"{source}: is a MAT-file of a version that eaid cannot read; save it with -v7") from None
    tables = _of_variables({name: value for name, value in content.items() if not name.startswith("__")})
    if not tables:
        opaque = any("function" in name.lower() or "None" in name for name in content) or any(
            type(value).__name__ in ("MatlabOpaque", "MatlabFunction") for value in content.values()
        )
        raise DataError(
            f"{source}: {OBJECTS}" if opaque else f"{source}: holds no table of numbers; save time and output as arrays"
        )
    return tables


def read_numpy(path: Path, source: str) -> list[LogTable]:
    """Tables of a .npy or .npz; nothing pickled is loaded."""
    try:
        with path.open("rb") as file:
            content = np.load(file, allow_pickle=False)
            several = isinstance(content, np.lib.npyio.NpzFile)
            arrays = {name: content[name] for name in content} if several else {"": content}
    except ValueError as fault:
        if "Object arrays" not in str(fault):
            raise
        raise DataError(f"{source}: holds Python objects, which can run code; save arrays of plain numbers") from None
    kept = {name: array if array.dtype.names else _real_array(array) for name, array in arrays.items()}
    tables, _ = _tables("", {name: array for name, array in kept.items() if array is not None})
    if not tables:
        raise DataError(f"{source}: holds no table of numbers; save time and output as arrays of one length")
    return tables


def _real_array(value: Any) -> NDArray[Any] | None:
    """A real numeric array without its empty axes, or None."""
    if isinstance(value, np.ndarray) and value.dtype.kind in "fiub" and value.size:
        return np.squeeze(value) if value.ndim > 2 else value
    return None


def _of_variables(variables: Mapping[str, Any], name: str = "") -> list[LogTable]:
    """Tables of named values, those of every structure among them."""
    tables: list[LogTable] = []
    arrays: dict[str, NDArray[Any]] = {}
    for leaf, value in variables.items():
        if isinstance(value, np.ndarray) and value.dtype.names and value.size == 1:
            tables.extend(_structure(f"{name}.{leaf}" if name else leaf, value.reshape(-1)[0]))
        elif isinstance(value, np.ndarray):
            number = _real_array(value)
            arrays[leaf] = value if number is None else number
    here, dropped = _tables(name, arrays)
    return _with_dropped([*tables, *here], dropped)


def _texts(value: Any) -> list[str]:
    """All texts of a label: one, or one a column."""
    if isinstance(value, np.ndarray) and value.dtype == object:
        return [one for item in value.reshape(-1) for one in _texts(item)]
    return [str(one) for one in value.reshape(-1)] if isinstance(value, np.ndarray) and value.dtype.kind == "U" else []


def _structure(name: str, record: Any) -> list[LogTable]:
    """Structure with time (`time`, `signals.values`, `signals.label`), or any structure of vectors."""
    fields = record.dtype.names
    signals = record["signals"] if "signals" in fields else None
    if not (isinstance(signals, np.ndarray) and signals.dtype.names and "values" in signals.dtype.names):
        return _of_variables({field: record[field] for field in fields}, name)
    time = _real_array(record["time"]) if "time" in fields else None
    clock = None if time is None else time.reshape(-1)
    columns = [] if clock is None else [ArrayColumn("time", clock)]
    for k, signal in enumerate(signals.reshape(-1)):
        if (values := _real_array(signal["values"])) is None:
            continue
        table = values if clock is None or len(values) == len(clock) else values.T
        table = table.reshape(len(table), -1)
        labels = _texts(signal["label"]) if "label" in signals.dtype.names else []
        if len(labels) != table.shape[1]:
            label = labels[-1] if labels else ("output" if signals.size == table.shape[1] == 1 else f"signal{k + 1}")
            labels = [label] if table.shape[1] == 1 else [f"{label} {j + 1}" for j in range(table.shape[1])]
        columns += [ArrayColumn(label, table[:, j]) for j, label in enumerate(labels)
                    if clock is None or not np.array_equal(table[:, j], clock)]  # fmt: skip
    columns = [one for one in columns if len(one.array) == len(columns[0].array)]
    names = numbered((one.label for one in columns), " #")
    columns = [one._replace(label=name) for one, name in zip(columns, names, strict=True)]
    return [_table(name, columns, clock=None if clock is None else 0)] if columns else []


def read_through(path: Path, source: str) -> list[LogTable]:
    """Read an HDF5 file to its end, attributes and arrays: no table, but whatever the library stumbles over."""
    with h5py.File(path, "r", locking=False) as file:
        for _, node in nodes(file, source):
            for key in node.attrs:
                node.attrs[key]
            if isinstance(node, h5py.Dataset) and node.shape is not None:
                _check_chunks(node)
                node[()]
    return []


def read_hdf5(path: Path, source: str) -> list[LogTable]:
    """Tables of an HDF5 file, none of a dataset of eaid; raises DataError where it holds no table of numbers."""
    file = h5py.File(path, "r", locking=False)
    if text(file.attrs.get("schema", "")).startswith("eaid/data/"):
        return []
    with path.open("rb") as raw:
        matlab = raw.read(6) == b"MATLAB"
    places: dict[str, dict[str, h5py.Dataset]] = {}
    every: list[LogTable] = []
    dropped: list[str] = []
    opaque = False
    for name, node in nodes(file, source):
        if name.startswith("#"):
            opaque = True
        elif isinstance(node, h5py.Dataset) and node.shape is not None:
            if matlab and (kind := text(node.attrs.get("MATLAB_class", ""))) not in _CLASSES:
                opaque = opaque or kind not in ("char", "cell", "struct")
                dropped.append(name)
            elif node.dtype.names and node.ndim == 1:
                every += _tables("", {name: node})[0]
            else:
                place, _, leaf = name.rpartition("/")
                places.setdefault(place, {})[leaf] = node
    for place, arrays in places.items():
        tables, others = _tables(place, arrays, "/")
        every.extend(tables)
        dropped.extend(others)
    if not every:
        raise DataError(
            f"{source}: {OBJECTS}"
            if matlab and opaque
            else f"{source}: holds no table of numbers; save time and output as arrays of one length"
        )
    return _with_dropped(every, dropped)


def _check_chunks(array: h5py.Dataset) -> None:
    """Raise ValueError where a chunk, as it lies in the file or unpacked, is not as long as its part of the array.

    The HDF5 library does not look: whatever lies behind a short one in memory comes out as numbers.
    """
    plan, node = array.id.get_create_plist(), array.id
    if plan.get_layout() != h5py.h5d.CHUNKED:
        return
    whole = math.prod(plan.get_chunk()) * node.get_type().get_size()
    filters = [plan.get_filter(i)[0] for i in range(plan.get_nfilters())]
    added = {h5py.h5z.FILTER_SHUFFLE: 0, h5py.h5z.FILTER_FLETCHER32: 4}  # bytes, by filters that do not pack
    for i in range(node.get_num_chunks()):
        info = node.get_chunk_info(i)
        used = [one for k, one in enumerate(filters) if not info.filter_mask >> k & 1]
        packed = [one for one in used if one not in added]
        if not packed:
            fits = info.size == whole + sum(added[one] for one in used)
        elif packed == [h5py.h5z.FILTER_DEFLATE]:
            before = sum(added[one] for one in used[: used.index(h5py.h5z.FILTER_DEFLATE)])
            _, raw = node.read_direct_chunk(info.chunk_offset)
            fits = len(zlib.decompressobj().decompress(raw, whole + before + 1)) == whole + before
        else:  # the others check the length themselves
            fits = True
        if not fits:
            raise ValueError("a chunk of it has a wrong length")
