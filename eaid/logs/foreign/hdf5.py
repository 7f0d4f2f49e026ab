"""HDF5 files, MAT v7.3 among them: the arrays of every group make tables, and so does every compound array.

Links to other files, external storage and virtual datasets are refused. What CF and netCDF say of a variable holds:
value = `scale_factor` · stored + `add_offset`, cells that are `_FillValue` or `missing_value` are empty, `units`.
"""

import math
import zlib
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from eaid.errors import DataError
from eaid.logs.foreign.groups import SAVE_AS, Column, grouped
from eaid.logs.hdf import nodes
from eaid.logs.table import BadCell, Cells, Table, no_columns

_NUMBERS = {"", "double", "single", "logical", *(f"{u}int{n}" for u in ("", "u") for n in (8, 16, 32, 64))}
"""Classes of MATLAB that are numbers; a file of another program says none."""


def read_through(path: Path, source: str) -> list[Table]:
    """Read a file to its end, attributes and arrays: no table, but whatever the library stumbles over."""
    with h5py.File(path, "r", locking=False) as file:
        for _, node in nodes(file, source):
            for key in node.attrs:
                node.attrs[key]
            if isinstance(node, h5py.Dataset) and node.shape is not None:
                _check_chunks(node)
                node[()]
    return []


def read_schema(path: Path, source: str) -> list[Table]:
    """A table without columns for a dataset of eaid, none for any other file."""
    with h5py.File(path, "r", locking=False) as file:
        of_eaid = _text(file.attrs.get("schema", "")).startswith("eaid/data/")
        return [Table(source, (), no_columns)] if of_eaid or ("digest" in file.attrs and "runs" in file) else []


def read_hdf5(path: Path, source: str) -> list[Table]:
    """Tables of an HDF5 file; raises DataError where it holds no table of numbers."""
    file = h5py.File(path, "r", locking=False)
    with path.open("rb") as raw:
        matlab = raw.read(6) == b"MATLAB"
    places: dict[str, dict[str, h5py.Dataset]] = {}
    found: list[tuple[str, list[Column]]] = []
    dropped: list[str] = []
    opaque = False
    for name, node in nodes(file, source):
        if name.startswith("#"):
            opaque = True
        elif isinstance(node, h5py.Dataset) and node.shape is not None:
            if matlab and (kind := _text(node.attrs.get("MATLAB_class", ""))) not in _NUMBERS:
                opaque = opaque or kind not in ("char", "cell", "struct")
                dropped.append(name)
            elif node.dtype.names and node.ndim == 1:
                fields = [field for field in node.dtype.names if node.dtype[field].kind in "fiu"]
                found.append((name, [Column(field, node, field) for field in fields]))
            else:
                place, _, leaf = name.rpartition("/")
                places.setdefault(place, {})[leaf] = node
    for place, arrays in places.items():
        tables, others = grouped(
            place, arrays, "/", lambda matrix: [_text(label) for label in np.ravel(matrix.attrs.get("columns", ()))]
        )
        found.extend(tables)
        dropped.extend(others)
    if not found:
        if matlab and opaque:
            raise DataError(f"{source}: holds MATLAB objects (a Simulink Dataset or timeseries) only; {SAVE_AS}")
        raise DataError(f"{source}: holds no table of numbers; save time and torque as arrays of one length")
    return [
        Table(
            name, tuple(one.label for one in columns), partial(_load, columns),
            tuple(_text(one.array.attrs.get("units", one.array.attrs.get("unit", ""))) for one in columns),
            dropped=tuple(dropped),
        )
        for name, columns in found
    ]  # fmt: skip


def _text(value: Any) -> str:
    return value.decode("latin-1") if isinstance(value, bytes) else str(value)


def _load(columns: Sequence[Column], wanted: Sequence[int]) -> Cells:
    values, bad = [], list[BadCell]()
    for i in wanted:
        _check_chunks(columns[i].array)
        stored, said = columns[i].values(), columns[i].array.attrs
        empty = np.zeros(len(stored), dtype=bool)
        for key in ("_FillValue", "missing_value"):
            empty |= np.isin(stored, np.atleast_1d(said.get(key, ())))
        scale, offset = (np.float64(np.ravel(said.get(name, plain))[0]) for name, plain in _CF)
        if (scale, offset) != (1.0, 0.0):
            stored = stored * scale + offset
        if empty.any():
            stored = np.where(empty, np.nan, stored)
            bad.extend(BadCell(int(row), i, "") for row in np.flatnonzero(empty))
        values.append(stored)
    return Cells(tuple(values), tuple(bad))


_CF = (("scale_factor", 1.0), ("add_offset", 0.0))


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
