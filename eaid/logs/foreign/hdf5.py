"""HDF5 files, MAT v7.3 among them: every group of equally long vectors, and every matrix, is a table.

Links to other files, external storage and virtual datasets are refused. What CF and netCDF say of a variable holds:
value = `scale_factor` · stored + `add_offset`, cells that are `_FillValue` or `missing_value` are empty, `units`.
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from eaid.errors import DataError
from eaid.logs.foreign.mat import FEWEST, SAVE_AS, labels_of_matrix
from eaid.logs.hdf import nodes
from eaid.logs.table import BadCell, Cells, Table

_NUMBERS = {"", "double", "single", "logical", *(f"{u}int{n}" for u in ("", "u") for n in (8, 16, 32, 64))}
"""Classes of MATLAB that are numbers; a file of another program says none."""
Part = int | str | None
"""Column of a matrix, field of a compound, or neither."""


def read_through(path: Path, source: str) -> list[Table]:
    """Read a file to its end, attributes and arrays: no table, but whatever the library stumbles over."""
    with h5py.File(path, "r", locking=False) as file:
        for _, node in nodes(file, source):
            for key in node.attrs:
                node.attrs[key]
            if isinstance(node, h5py.Dataset) and node.shape is not None:
                node[()]
    return []


def read_schema(path: Path, source: str) -> list[Table]:
    """A table without columns for a dataset of eaid, none for any other file."""
    with h5py.File(path, "r", locking=False) as file:
        of_eaid = _text(file.attrs.get("schema", "")).startswith("eaid/data/")
        return (
            [Table(source, (), lambda _: Cells(()))] if of_eaid or ("digest" in file.attrs and "runs" in file) else []
        )


def read_hdf5(path: Path, source: str) -> list[Table]:
    """Tables of an HDF5 file; raises DataError where it holds no table of numbers."""
    file = h5py.File(path, "r", locking=False)
    with path.open("rb") as raw:
        matlab = raw.read(6) == b"MATLAB"
    tables: list[Table] = []
    vectors: dict[str, dict[int, list[tuple[str, h5py.Dataset]]]] = {}
    matrices: list[tuple[str, h5py.Dataset]] = []
    dropped: list[str] = []
    opaque = False
    for name, node in nodes(file, source):
        if name.startswith("#"):
            opaque = True
        elif isinstance(node, h5py.Dataset) and node.shape is not None and not name.startswith("#"):
            if matlab and (kind := _text(node.attrs.get("MATLAB_class", ""))) not in _NUMBERS:
                opaque = opaque or kind not in ("char", "cell", "struct")
                dropped.append(name)
            elif node.dtype.names and node.ndim == 1:
                fields = [field for field in node.dtype.names if node.dtype[field].kind in "fiu"]
                tables.append(_table(name, [(field, node, field) for field in fields]))
            elif node.dtype.kind not in "fiub":
                dropped.extend([name] if node.size and node.size > 1 else [])
            elif node.size >= 2:
                length = [n for n in node.shape if n != 1]
                if len(length) == 1:
                    parent, _, leaf = name.rpartition("/")
                    vectors.setdefault(parent, {}).setdefault(length[0], []).append((leaf, node))
                elif len(node.shape) == 2 and max(node.shape) >= FEWEST:
                    matrices.append((name, node))
    for name, node in matrices:
        parent, _, leaf = name.rpartition("/")
        beside = vectors.get(parent, {}).get(max(node.shape))
        columns: list[tuple[str, h5py.Dataset, Part]] = [
            (label, node, k) for k, label in enumerate(_labels(node, leaf, beside is not None))
        ]
        if beside is None:
            tables.append(_table(name, columns))
        else:
            columns = [*((one, vector, None) for one, vector in beside), *columns]
            vectors[parent].pop(max(node.shape))
            tables.append(_table(parent or name, columns))
    for parent, lengths in vectors.items():
        for members in lengths.values():
            label = parent if len(lengths) == 1 else f"{parent}/{members[0][0]}".strip("/")
            tables.append(_table(label, [(leaf, vector, None) for leaf, vector in members]))
    if not tables:
        if matlab and opaque:
            raise DataError(f"{source}: holds MATLAB objects (a Simulink Dataset or timeseries) only; {SAVE_AS}")
        raise DataError(f"{source}: holds no table of numbers; save time and torque as arrays of one length")
    return [_with(table, tuple(dropped)) for table in tables]


def _with(table: Table, dropped: tuple[str, ...]) -> Table:
    return Table(table.name, table.columns, table.load, table.units, dropped=dropped)


def _text(value: Any) -> str:
    return value.decode("latin-1") if isinstance(value, bytes) else str(value if value is not None else "")


def _labels(node: h5py.Dataset, name: str, beside: bool) -> tuple[str, ...]:
    """Names of a matrix's columns: by its attribute `columns`, as `name[k]` beside vectors, else by their place."""
    count, said = min(node.shape), node.attrs.get("columns")
    if isinstance(said, np.ndarray) and said.shape == (count,):
        return tuple(_text(label) for label in said)
    if beside:
        return tuple(f"{name}[{k + 1}]" for k in range(count))
    return labels_of_matrix(node[0, :] if node.shape[0] < node.shape[1] else node[:, 0], count)


def _table(name: str, columns: Sequence[tuple[str, h5py.Dataset, Part]]) -> Table:
    units = tuple(_text(node.attrs.get("units", node.attrs.get("unit", ""))) for _, node, _ in columns)
    return Table(name, tuple(label for label, _, _ in columns), _loader(columns), units)


def _loader(columns: Sequence[tuple[str, h5py.Dataset, Part]]) -> Callable[[Sequence[int]], Cells]:
    def load(wanted: Sequence[int]) -> Cells:
        values, bad = [], list[BadCell]()
        for i in wanted:
            _, node, part = columns[i]
            stored = _stored(node, part).reshape(-1)
            empty = np.zeros(len(stored), dtype=bool)
            for key in ("_FillValue", "missing_value"):
                empty |= np.isin(stored, np.atleast_1d(node.attrs.get(key, ())))
            scale, offset = (np.float64(np.ravel(node.attrs.get(k, d))[0]) for k, d in _CF)
            if (scale, offset) != (1.0, 0.0):
                stored = stored * scale + offset
            if empty.any():
                stored = np.where(empty, np.nan, stored)
                bad.extend(BadCell(int(row), i, "") for row in np.flatnonzero(empty))
            values.append(stored)
        return Cells(tuple(values), tuple(bad))

    return load


_CF = (("scale_factor", 1.0), ("add_offset", 0.0))


def _stored(node: h5py.Dataset, part: Part) -> np.ndarray[Any, Any]:
    if part is None:
        return np.asarray(node[()])
    if isinstance(part, str):
        return np.asarray(node.fields(part)[()])
    return np.asarray(node[part, :] if node.shape[0] < node.shape[1] else node[:, part])
