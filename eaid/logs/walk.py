"""Every object of an HDF5 file of eaid's own, each once: its attributes as Python values, and its array."""

from collections.abc import Iterator
from functools import cached_property
from typing import Any

import h5py
import numpy as np

from eaid.errors import DataError


class Item:
    """One object of an HDF5 file."""

    def __init__(self, name: str, node: Any) -> None:
        self.name = name
        """Path from the root, without a slash before it; empty for the root."""
        self.node = node

    @property
    def is_array(self) -> bool:
        """Whether it is an array that holds something."""
        return isinstance(self.node, h5py.Dataset) and self.node.shape is not None

    def fact(self, key: str) -> Any:
        """One attribute; None where there is none."""
        return self.node.attrs.get(key)

    @cached_property
    def facts(self) -> dict[str, Any]:
        """Its attributes."""
        return dict(self.node.attrs.items())

    @cached_property
    def values(self) -> np.ndarray[Any, Any]:
        """The whole array, read once."""
        values = np.asarray(self.node[()])
        values.flags.writeable = False
        return values


def walk(file: h5py.File, source: str = "") -> list[Item]:
    """The root and every object below it, by name."""
    below = sorted(nodes(file, source), key=lambda one: one[0].split("/"))
    return [Item("", file), *(Item(name, node) for name, node in below)]


def root_of(file: h5py.File) -> Item:
    """The root alone."""
    return Item("", file)


def nodes(file: h5py.File, source: str) -> Iterator[tuple[str, Any]]:
    """Every object below the root under its path, arrays under each of their names; one in another file is refused.

    Groups are opened one from the other, not each from the root: thousands of nested ones take no time.
    """
    waiting: list[tuple[str, h5py.Group]] = [("", file)]
    known = {h5py.h5o.get_info(file.id).addr}
    while waiting:
        path, group = waiting.pop()
        for key in group:
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
            if isinstance(node, h5py.Group):
                address = h5py.h5o.get_info(node.id).addr
                if address not in known:
                    known.add(address)
                    waiting.append((name, node))
