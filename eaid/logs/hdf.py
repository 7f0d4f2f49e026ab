"""HDF5 files of eaid's own (data.h5, replay.h5): opened in this process only where they hold what eaid wrote.

One that carries eaid's seal does, to the byte. Any other, such as one that h5py changed since, is read to its end by
the isolated reader first: the HDF5 library goes round for ever on some damaged files, and ends the process on others.
"""

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from eaid.errors import DataError
from eaid.files import is_as_written


@contextlib.contextmanager
def open_hdf5(path: Path, source: str) -> Iterator[h5py.File]:
    """The file, open for reading; raises DataError where it, or what is read of it in the block, is damaged.

    One without a seal is taken as it is.
    """
    as_written = is_as_written(path)
    if as_written is False:
        raise DataError(f"{source}: is a damaged HDF5 file (not the bytes that eaid wrote); copy it again")
    if as_written is None:
        from eaid.logs.formats import CHECKED, ForeignReader

        with contextlib.closing(ForeignReader()) as foreign:
            foreign.tables(CHECKED, path, source)
    try:
        with h5py.File(path, "r", locking=False) as file:
            yield file
    except DataError:
        raise
    except Exception as fault:  # what h5py raises on bytes that it did not expect has no common type
        reason = " ".join(str(fault).split())[:120].rstrip(".") or type(fault).__name__
        raise DataError(f"{source}: is a damaged HDF5 file ({reason}); copy or save it again") from None


def nodes(file: h5py.File, source: str = "") -> Iterator[tuple[str, Any]]:
    """Every object below the root under its path, by name; raises DataError where one lies in another file.

    Groups are opened one from the other, not each from the root: thousands of nested ones take no time. None stays
    open: thousands of them take half a gigabyte.
    """
    known = {h5py.h5o.get_info(file.id).addr}
    waiting: list[tuple[str, h5py.Group, list[str]]] = [("", file, sorted(file, reverse=True))]
    while waiting:
        path, group, keys = waiting[-1]
        if not keys:
            waiting.pop()
            continue
        key = keys.pop()
        name = f"{path}/{key}" if path else key
        if isinstance(group.get(key, getlink=True), h5py.ExternalLink):
            raise DataError(f"{source}: {name} is a link to another file; copy the data into this one")
        try:
            node = group[key]
        except KeyError:
            continue  # a link to nothing
        if isinstance(node, h5py.Dataset) and (node.is_virtual or node.external):
            raise DataError(f"{source}: {name} keeps its data in another file; copy the data into this one")
        yield name, node
        if isinstance(node, h5py.Group) and (address := h5py.h5o.get_info(node.id).addr) not in known:
            known.add(address)
            waiting.append((name, node, sorted(node, reverse=True)))


def text(value: Any) -> str:
    """An attribute as text; bytes that are no UTF-8 are Latin-1, as older writers have `N·m` and `µs`."""
    if not isinstance(value, bytes):
        return str(value)
    try:
        return value.decode()
    except UnicodeDecodeError:
        return value.decode("latin-1")


def attributes(node: h5py.File | h5py.Group) -> dict[str, object]:
    """The attributes of a file or group as Python has them."""
    plain = {}
    for key, value in node.attrs.items():
        if isinstance(value, np.generic) or (isinstance(value, np.ndarray) and value.size == 1):
            value = value.item()
        plain[key] = text(value) if isinstance(value, bytes) else value
    return plain
