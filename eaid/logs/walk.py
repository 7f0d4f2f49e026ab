"""One walk through an HDF5 file: every object once, with its shape and its attributes as Python values.

h5py's own objects cost 30 to 60 µs each and as much again for every attribute; a dataset of 60 runs has 240 objects and
500 attributes, and safety, digest and runs all ask for them. Here they are read once, by h5py's low-level calls.
"""

import zlib
from collections.abc import Iterator
from functools import cached_property
from typing import Any

import numpy as np

from eaid.arrays import Array, read_only


class Item:
    """One object of an HDF5 file."""

    def __init__(self, name: str, node: Any, attributes: "_Attributes") -> None:
        self.name = name
        """Path from the root, without a slash before it; empty for the root."""
        self.node = node
        """Its low-level identifier, open."""
        self.shape, self.is_array = _shape(node)
        """Shape of an array (None for one without any, and for anything else), and whether it is one."""
        self._attributes = attributes

    def fact(self, key: str) -> Any:
        """One attribute, as h5py gives it; None where there is none."""
        from h5py import h5a

        name = key.encode()
        return self._attributes.one(self.node, self.name, name) if h5a.exists(self.node, name) else None

    def links(self, key: str) -> bool:
        """Whether it is a group that holds something of this name, wherever that leads."""
        from h5py import h5g

        return isinstance(self.node, h5g.GroupID) and self.node.links.exists(key.encode())

    @cached_property
    def facts(self) -> dict[str, Any]:
        """Its attributes, as h5py gives them."""
        return self._attributes.of(self.node, self.name)


def walk(file: Any) -> list[Item]:
    """The root and every object below it, in h5py's order; links to other files are not followed."""
    return list(walked(file))


def walked(file: Any) -> Iterator[Item]:
    """The same one by one: an object that is let go is closed, and thousands of open ones take half a gigabyte."""
    from h5py import h5o

    places: list[bytes] = []
    h5o.visit(file.id, places.append)
    attributes = _Attributes(file)
    yield Item("", file.id, attributes)
    for place in places:
        yield Item(place.decode("utf-8", "surrogateescape"), h5o.open(file.id, place), attributes)


def root_of(file: Any) -> Item:
    """The root alone."""
    return Item("", file.id, _Attributes(file))


def item_at(file: Any, name: str) -> Item:
    """One object under any of its names."""
    return Item(name, file[name].id, _Attributes(file))


def _shape(node: Any) -> tuple[tuple[int, ...] | None, bool]:
    from h5py import h5d, h5s

    if not isinstance(node, h5d.DatasetID):
        return None, False
    space = node.get_space()
    return (None if space.get_simple_extent_type() == h5s.NULL else space.shape), True


class _Attributes:
    """Reads attributes: a text, a double or a 64-bit integer at once, other numbers and texts by h5py.

    Of other types (sequences, compounds, references) eaid has no use, and the HDF5 library ends the process on some
    that are damaged: they are None.
    """

    def __init__(self, file: Any) -> None:
        import h5py
        from h5py import h5t

        self._file = file
        self._text = np.empty((), dtype=h5py.string_dtype())
        self._text_type = h5t.py_create(self._text.dtype)
        self._numbers = [(h5t.IEEE_F64LE, np.empty((), "<f8")), (h5t.STD_I64LE, np.empty((), "<i8"))]

    def of(self, node: Any, name: str) -> dict[str, Any]:
        """All attributes of an object."""
        from h5py import h5a

        keys: list[bytes] = []
        h5a.iterate(node, keys.append)
        return {key.decode("utf-8", "surrogateescape"): self.one(node, name, key) for key in keys}

    def one(self, node: Any, name: str, key: bytes) -> Any:
        """One attribute of an object."""
        from h5py import h5a, h5s, h5t

        one = h5a.open(node, key)
        kind = one.get_type()
        if kind.get_class() not in (h5t.FLOAT, h5t.INTEGER, h5t.ENUM, h5t.STRING):
            return None
        if one.get_space().get_simple_extent_type() == h5s.SCALAR:
            if isinstance(kind, h5t.TypeStringID) and kind.is_variable_str():
                one.read(self._text, mtype=self._text_type)
                text = self._text[()]
                return text.decode("utf-8", "surrogateescape") if isinstance(text, bytes) else str(text)
            for same, room in self._numbers:
                if kind.equal(same):
                    one.read(room, mtype=same)
                    return room[()]
        return self._file[name or "/"].attrs[key]


Unpacked = dict[tuple[int, bytes], Array]
"""Columns by their length and their bytes in the file: repeats share a time axis, which is then unpacked once."""


def unpacked(node: Any, known: Unpacked) -> Array | None:
    """A column of doubles as eaid packs them (shuffled, then deflated), shape (n,), read-only; None for any other.

    Also None where something is wrong with it: reading it by h5py then says what.
    """
    from h5py import h5d, h5t, h5z

    plan = node.get_create_plist()
    if plan.get_layout() != h5d.CHUNKED or plan.get_nfilters() != 2 or not node.get_type().equal(h5t.IEEE_F64LE):
        return None
    filters = [plan.get_filter(i)[0] for i in range(2)]
    if filters != [h5z.FILTER_SHUFFLE, h5z.FILTER_DEFLATE] or len(node.shape) != 1:
        return None
    count, long = node.shape[0], plan.get_chunk()[0]
    parts = []
    for start in range(0, count, long):
        try:
            skipped, packed = node.read_direct_chunk((start,))
        except (OSError, RuntimeError, ValueError):
            return None
        part = None if skipped else _part(packed, long, known)
        if part is None:
            return None
        parts.append(part if len(part) <= count - start else part[: count - start])
    if len(parts) == 1:
        return parts[0]
    return read_only(np.concatenate(parts)) if parts else None


def _part(packed: bytes, count: int, known: Unpacked) -> Array | None:
    """One chunk, whose length and checksum have to be right."""
    key = (count, packed)
    if key not in known:
        stream = zlib.decompressobj()
        try:
            planes = stream.decompress(packed, 8 * count + 1)  # room for the checksum behind the last byte
        except zlib.error:
            return None
        if not stream.eof or len(planes) != 8 * count:
            return None
        rows = np.empty((count, 8), dtype=np.uint8)
        for k, plane in enumerate(np.frombuffer(planes, dtype=np.uint8).reshape(8, count)):
            rows[:, k] = plane
        known[key] = read_only(rows.view("<f8").reshape(-1))
    return known[key]
