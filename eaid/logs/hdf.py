"""HDF5 files, MAT v7.3 among them: every group of equally long vectors, and every matrix, is a sheet.

Links to other files, external storage and virtual datasets are refused, and so is an array that claims to be far
larger than the file: both are refused before anything is read.
"""

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from eaid.arrays import read_only
from eaid.errors import DataError
from eaid.logs.chunks import check_chunks
from eaid.logs.extras import damage_told
from eaid.logs.mat import FEWEST, SAVE_AS, labels_of_matrix
from eaid.logs.sheet import Cells, Sheet
from eaid.logs.walk import Item, walk

MOST_VALUES = 1 << 31
"""Values in one array; a day at 1 kHz is 8.6e7."""
MOST_RATIO = 1100
"""An array that claims more than this many times its bytes in the file is a bomb (deflate gets 1032 at most)."""


def is_hdf5(head: bytes) -> bool:
    """True for the first bytes of an HDF5 file, a MAT v7.3 file among them."""
    return head.startswith(b"\x89HDF\r\n\x1a\n") or head[512:520] == b"\x89HDF\r\n\x1a\n"


@contextmanager
def open_hdf5(path: Path, source: str) -> Iterator[Any]:
    """The file, open for reading; raises DataError where it, or what is read of it in the block, is damaged."""
    import h5py

    with damage_told(source, "HDF5"), h5py.File(path, "r", locking=False) as file:
        yield file


def check_safe(items: Sequence[Item], source: str, size: int) -> None:
    """Refuse what reads from other files, and arrays of absurd size."""
    from h5py import h5d, h5g, h5l

    faults: list[str] = []
    for item in items:
        node = item.node
        if isinstance(node, h5g.GroupID):
            faults.extend(
                f"{source}: {item.name}/{key.decode(errors='replace')} is a link to another file; "
                f"copy the data into this one"
                for key in node
                if node.links.get_info(key).type == h5l.TYPE_EXTERNAL
            )
        elif item.is_array:
            plan = node.get_create_plist()
            if plan.get_layout() == h5d.VIRTUAL or plan.get_external_count():
                faults.append(f"{source}: {item.name} keeps its data in another file; copy the data into this one")
            elif item.shape is not None:
                claimed, width, stored = math.prod(item.shape), node.get_type().get_size(), node.get_storage_size()
                chunk = math.prod(plan.get_chunk()) if plan.get_layout() == h5d.CHUNKED else 1
                most = max((MOST_RATIO if plan.get_nfilters() else 1) * min(stored, size), 1 << 24)
                if claimed > MOST_VALUES or max(claimed, chunk) * width > most:
                    faults.append(
                        f"{source}: {item.name} claims {claimed:.3g} values in a file of {size:,} bytes; no log does"
                    )
    if faults:
        raise DataError(*faults)


def _loader(path: Path, source: str, names: Sequence[tuple[str, int | str | None]], across: bool) -> Any:
    """Reads columns later: (dataset, column of a matrix, or field of a compound, or None)."""

    def load(wanted: Sequence[int]) -> Cells:
        with open_hdf5(path, source) as file:
            values = []
            sound = set()
            for i in wanted:
                name, part = names[i]
                item = file[name]
                try:
                    if name not in sound:
                        check_chunks(item.id)
                        sound.add(name)
                    if part is None:
                        array = item[()]
                    elif isinstance(part, str):
                        array = item.fields(part)[()]
                    else:
                        array = item[part, :] if across else item[:, part]
                except (OSError, RuntimeError, ValueError) as fault:
                    reason = " ".join(str(fault).split())[:100]
                    raise DataError(f"{source}: {name} is damaged ({reason}); copy or save the file again") from None
                values.append(read_only(np.asarray(array, dtype=np.float64).reshape(-1)))
            return Cells(tuple(values))

    return load


def read_hdf5(path: Path, source: str) -> list[Sheet]:
    """Sheets of an HDF5 file; raises DataError where it holds no table of numbers."""
    import h5py

    sheets: list[Sheet] = []
    groups: dict[str, dict[int, list[tuple[str, str]]]] = {}
    opaque = False
    with open_hdf5(path, source) as file, damage_told(source, "HDF5"):
        matlab = _is_matlab(path)
        items = walk(file)
        check_safe(items, source, path.stat().st_size)
        below = {item.name: item for item in items}

        def look(name: str, item: Any) -> None:
            nonlocal opaque
            if name.startswith("#"):
                opaque = True
                return
            if not isinstance(item, h5py.Dataset) or item.shape is None:
                return
            if matlab and (kind := _text(below[name].fact("MATLAB_class"))) not in _NUMBERS:
                opaque = opaque or kind not in ("char", "cell", "struct")
                return
            if item.dtype.names and item.ndim == 1:
                fields = [field for field in item.dtype.names if item.dtype[field].kind in "fiu"]
                names: list[tuple[str, int | str | None]] = [(name, field) for field in fields]
                sheets.append(Sheet(name, tuple(fields), _loader(path, source, names, False)))
            elif item.dtype.kind in "fiub" and item.size >= 2:
                shape = tuple(n for n in item.shape if n != 1)
                if len(shape) == 1:
                    parent, _, leaf = name.rpartition("/")
                    groups.setdefault(parent, {}).setdefault(shape[0], []).append((leaf, name))
                elif len(item.shape) == 2 and max(item.shape) >= FEWEST:
                    sheets.append(_matrix(path, source, name, item, below[name].fact("columns")))

        file.visititems(look)
    for parent, lengths in groups.items():
        for columns in lengths.values():
            names = [(name, None) for _, name in columns]
            label = parent if len(lengths) == 1 else columns[0][1]
            sheets.append(Sheet(label, tuple(leaf for leaf, _ in columns), _loader(path, source, names, False)))
    if not sheets:
        if matlab and opaque:
            raise DataError(f"{source}: holds MATLAB objects (a Simulink Dataset or timeseries) only; {SAVE_AS}")
        raise DataError(f"{source}: holds no table of numbers; save time and torque as arrays of one length")
    return sheets


def _is_matlab(path: Path) -> bool:
    with path.open("rb") as file:
        return file.read(6) == b"MATLAB"


_NUMBERS = {"", "double", "single", "logical", *(f"{u}int{n}" for u in ("", "u") for n in (8, 16, 32, 64))}
"""Classes of MATLAB that are numbers; a file of another program says none."""


def _text(value: Any) -> str:
    return value.decode("latin-1") if isinstance(value, bytes) else str(value or "")


def _matrix(path: Path, source: str, name: str, item: Any, said: Any) -> Sheet:
    """A matrix, samples along its longer side, its columns named by its attribute `columns` or by their place."""
    across, count = item.shape[0] < item.shape[1], min(item.shape)
    if isinstance(said, np.ndarray) and said.shape == (count,):
        labels = tuple(str(label) for label in said)
    else:
        check_chunks(item.id)
        labels = labels_of_matrix(np.asarray(item[0, :] if across else item[:, 0]), count)
    names: list[tuple[str, int | str | None]] = [(name, k) for k in range(count)]
    return Sheet(name, labels, _loader(path, source, names, across))
