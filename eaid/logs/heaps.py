"""The global heaps of an HDF5 file (its texts of free length), walked before the HDF5 library does.

The library goes round for ever in a heap whose free space has no size, as one changed byte can make it. It also trusts
the length of a text, which stands where the text is used: it makes room for that many bytes, up to 4 GB, and then
copies as many as the heap has. So the heaps are walked first, and every mention of one (length, 4 bytes; address of the
heap, 8; number in it, 4) is held against what lies there. Files of the newer layout (superblock 2 and 3, as eaid writes
them) have checksums around what mentions heaps; in older ones the texts of attributes are looked for by their type.
"""

import math
import mmap
import re
from itertools import islice
from pathlib import Path

from eaid.errors import DataError

_SIGNATURE = b"GCOL\x01\0\0\0"
_FILE = b"\x89HDF\r\n\x1a\n"
_TEXT = re.compile(rb"\x19[\x01\x11\x21].\0\x10\0\0\0.{16}\x01", re.DOTALL)
"""The type of a text of free length in an attribute, and the first byte of its shape (version 1)."""
_ROOM = 4096
"""Bytes that the library makes room for at least."""
_WIDEST = 64
"""Bytes of one element of a sequence of free length, at most."""
_MOST_TEXTS = 10_000
"""Texts of one attribute that are looked at."""
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
        base = max(data.find(_FILE), 0)
        known = {start - base: objects for start, objects in heaps.items()}
        if data[base + 8 : base + 9] < b"\x02" and not _texts_held(data, known):
            return False
        return len(heaps) * size > _MOST_SEARCHED or all(
            _mentioned_right(data, address, objects) for address, objects in known.items() if address > 0
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


def _texts_held(data: mmap.mmap, heaps: dict[int, dict[int, int]]) -> bool:
    """True where every text of an attribute is in a heap."""
    for found in _TEXT.finditer(data):
        at = found.end() - 1
        if at + 8 > len(data):
            return False
        rank, more = data[at + 1], data[at + 2]
        if rank > 32 or more > 1:
            continue  # no shape
        sizes = [int.from_bytes(data[at + 8 + 8 * i : at + 16 + 8 * i], "little") for i in range(rank)]
        at += 8 + 8 * rank * (1 + more)
        for text in islice(range(at, len(data) - 15, 16), min(math.prod(sizes), _MOST_TEXTS)):
            length, number = (int.from_bytes(data[text + i : text + i + 4], "little") for i in (0, 12))
            address = int.from_bytes(data[text + 4 : text + 12], "little")
            if length and heaps.get(address, {}).get(number, -1) < length:
                return False
    return True
