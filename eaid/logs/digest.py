"""The digest of an HDF5 file of eaid: its attributes and shapes, which carry no checksum of their own."""

import hashlib
from collections.abc import Iterable, Sequence
from typing import Any

from eaid.errors import DataError
from eaid.logs.walk import Item


def digest_of(items: Iterable[Item]) -> str:
    """SHA-256 of all attributes and shapes, in hex; the columns themselves carry the checksum of their compression."""
    seen = hashlib.sha256()
    for item in items:
        facts = sorted((key, _text(value)) for key, value in item.facts.items() if key != "digest")
        seen.update(repr((item.name or "/", item.shape, facts)).encode("utf-8", errors="replace"))
    return seen.hexdigest()


def check_digest(items: Sequence[Item], source: str, remedy: str) -> None:
    """Refuse a file whose facts are no longer those that were written; one without a digest is taken as it is."""
    try:
        root = items[0].facts
        same = "digest" not in root or _text(root["digest"]) == digest_of(items)
    except (OSError, RuntimeError, ValueError, KeyError):
        same = False
    if not same:
        raise DataError(
            f"{source}: is damaged, or its attributes were changed after eaid wrote it; {remedy}, "
            f"or delete the attribute digest if the change is yours"
        )


def _text(value: Any) -> str:
    return value.decode("utf-8", errors="replace") if isinstance(value, bytes) else str(value)
