"""The digest of an HDF5 file of eaid: its attributes, shapes and values."""

import hashlib
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from eaid.errors import DataError
from eaid.logs.walk import Item

WITH_VALUES = "values:"
"""Before a digest that covers the values; those of earlier files cover attributes and shapes."""


def digest_of(items: Iterable[Item], with_values: bool = True) -> str:
    """SHA-256 of all attributes, shapes and values, in hex behind `WITH_VALUES`."""
    seen = hashlib.sha256()
    for item in items:
        shape = None if item.values is None else item.values.shape
        facts = sorted((key, _text(value)) for key, value in item.facts.items() if key != "digest")
        seen.update(repr((item.name or "/", shape, facts)).encode("utf-8", errors="replace"))
        if with_values and item.values is not None:
            seen.update(str(item.values.dtype).encode())
            plain = item.values.dtype.kind in "fiub"
            seen.update(np.ascontiguousarray(item.values).data if plain else repr(item.values.tolist()).encode())
    return f"{WITH_VALUES}{seen.hexdigest()}" if with_values else seen.hexdigest()


def check_digest(items: Sequence[Item], source: str, remedy: str) -> None:
    """Refuse a file that no longer holds what was written; one without a digest is taken as it is."""
    try:
        said = items[0].fact("digest")
        same = said is None or _text(said) == digest_of(items, _text(said).startswith(WITH_VALUES))
    except (OSError, RuntimeError, ValueError, KeyError, TypeError):
        same = False
    if not same:
        raise DataError(
            f"{source}: is damaged, or was changed after eaid wrote it; {remedy}, "
            f"or delete the attribute digest if the change is yours"
        )


def _text(value: Any) -> str:
    return value.decode("utf-8", errors="replace") if isinstance(value, bytes) else str(value)
