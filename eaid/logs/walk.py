"""Every object of an HDF5 file of eaid's own, each once: its attributes as Python values, and its array."""

from collections.abc import Iterator
from typing import Any, NamedTuple

import h5py
import numpy as np

from eaid.errors import DataError


class Item(NamedTuple):
    """One object of an HDF5 file, read and closed: thousands of open ones take half a gigabyte."""

    name: str
    """Path from the root, without a slash before it; empty for the root."""
    facts: dict[str, Any]
    """Its attributes."""
    values: np.ndarray[Any, Any] | None = None
    """The whole array; None where it is none, or holds nothing."""

    def fact(self, key: str) -> Any:
        """One attribute; None where there is none."""
        return self.facts.get(key)


def walk(file: h5py.File, source: str = "") -> list[Item]:
    """The root and every object below it, by name."""
    below = [_item(name, node) for name, node in nodes(file, source)]
    return [root_of(file), *sorted(below, key=lambda item: item.name.split("/"))]


def root_of(file: h5py.File) -> Item:
    """The root alone."""
    return Item("", dict(file.attrs.items()))


def _item(name: str, node: Any) -> Item:
    holds = isinstance(node, h5py.Dataset) and node.shape is not None
    values = np.asarray(node[()]) if holds else None
    if values is not None:
        values.flags.writeable = False
    return Item(name, dict(node.attrs.items()), values)


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
