"""The global heaps of an HDF5 file (its texts of free length), walked before the HDF5 library does.

The library goes round for ever in a heap whose free space has no size, as one changed byte can make it. It also trusts
the length of a text, which stands where the text is used: it makes room for that many bytes, up to 4 GB, and then
copies as many as the heap has. So the heaps are walked first, and every mention of one (length, 4 bytes; address of the
heap, 8; number in it, 4) is held against what lies there.
"""

import mmap
from pathlib import Path

from eaid.errors import DataError

_SIGNATURE = b"GCOL\x01\0\0\0"
_FILE = b"\x89HDF\r\n\x1a\n"
_ROOM = 4096
"""Bytes that the library makes room for at least."""
_WIDEST = 64
"""Bytes of one element of a sequence of free length, at most."""
_MOST_SEARCHED = 1 << 30
"""Bytes searched for mentions, in all; of files beyond (with many heaps) only the heaps are walked."""


def check_heaps(path: Path, source: str) -> None:
    """Raise DataError where the objects of a global heap do not fill it, or a text is not as long as it says."""
    size = path.stat().st_size
    if not size:
        return  # nothing to walk, and nothing that can be mapped
    if not _sound(path, size):
        raise DataError(f"{source}: is a damaged HDF5 file (its heap of texts); copy or save it again")


def _sound(path: Path, size: int) -> bool:
    """True where all heaps of a file are whole, and mentioned as they are."""
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        heaps: dict[int, dict[int, int]] = {}
        at = data.find(_SIGNATURE)
        while at >= 0:
            objects = _objects(data, at)
            if objects is None:
                return False
            heaps[at] = objects
            at = data.find(_SIGNATURE, at + 8)
        base = max(data.find(_FILE), 0) if heaps else 0
        return len(heaps) * size > _MOST_SEARCHED or all(
            _mentioned_right(data, start - base, objects) for start, objects in heaps.items() if start > base
        )


def _objects(data: mmap.mmap, start: int) -> dict[int, int] | None:
    """Number and size of every object of a heap; None where one has no room in it, up to its free space (object 0)."""
    end = start + int.from_bytes(data[start + 8 : start + 16], "little")
    if not start + 16 <= end <= len(data):
        return None
    found: dict[int, int] = {}
    at = start + 16
    while at + 16 <= end:
        index = int.from_bytes(data[at : at + 2], "little")
        size = int.from_bytes(data[at + 8 : at + 16], "little")
        if index == 0:
            return found if size == end - at else None
        found[index] = size
        at += 16 + size + -size % 8
    return found if at <= end else None


def _mentioned_right(data: mmap.mmap, address: int, objects: dict[int, int]) -> bool:
    """True where no mention of a heap claims more than its object has, or has no room for it."""
    wanted = address.to_bytes(8, "little")
    at = data.find(wanted, 4)
    while at >= 0:
        length = int.from_bytes(data[at - 4 : at], "little")
        held = objects.get(int.from_bytes(data[at + 8 : at + 12], "little"))
        if length and held is not None and (length > held or held > max(_ROOM, _WIDEST * length)):
            return False
        at = data.find(wanted, at + 1)
    return True
