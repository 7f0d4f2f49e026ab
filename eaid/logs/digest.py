"""The digest of an HDF5 file of eaid: its attributes and shapes, which carry no checksum of their own."""

import hashlib
from typing import Any

from eaid.errors import DataError


def digest_of(file: Any) -> str:
    """SHA-256 of all attributes and shapes, in hex; the columns themselves carry the checksum of their compression."""
    seen = hashlib.sha256()

    def look(name: str, item: Any) -> None:
        facts = sorted((key, _text(value)) for key, value in item.attrs.items() if key != "digest")
        seen.update(repr((name, getattr(item, "shape", None), facts)).encode("utf-8", errors="replace"))

    look("/", file)
    file.visititems(look)
    return seen.hexdigest()


def check_digest(file: Any, source: str, remedy: str) -> None:
    """Refuse a file whose facts are no longer those that were written; one without a digest is taken as it is."""
    try:
        same = "digest" not in file.attrs or _text(file.attrs["digest"]) == digest_of(file)
    except (OSError, RuntimeError, ValueError, KeyError):
        same = False
    if not same:
        raise DataError(
            f"{source}: is damaged, or its attributes were changed after eaid wrote it; {remedy}, "
            f"or delete the attribute digest if the change is yours"
        )


def _text(value: Any) -> str:
    return value.decode("utf-8", errors="replace") if isinstance(value, bytes) else str(value)
