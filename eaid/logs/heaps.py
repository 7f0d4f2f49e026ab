"""The global heaps of an HDF5 file (its texts of free length), walked before the HDF5 library does.

The library goes round for ever in a heap whose free space has no size, as one changed byte can make it.
"""

import mmap
from pathlib import Path

from eaid.errors import DataError

_SIGNATURE = b"GCOL\x01\0\0\0"


def check_heaps(path: Path, source: str) -> None:
    """Raise DataError where the objects of a global heap do not fill it."""
    if not path.stat().st_size:
        return  # nothing to walk, and nothing that can be mapped
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        at = data.find(_SIGNATURE)
        while at >= 0:
            if not _whole(data, at):
                raise DataError(f"{source}: is a damaged HDF5 file (its heap of texts); copy or save it again")
            at = data.find(_SIGNATURE, at + 8)


def _whole(data: mmap.mmap, start: int) -> bool:
    """True where every object of a heap has room in it, up to its free space (object 0)."""
    end = start + int.from_bytes(data[start + 8 : start + 16], "little")
    if not start + 16 <= end <= len(data):
        return False
    at = start + 16
    while at + 16 <= end:
        index = int.from_bytes(data[at : at + 2], "little")
        size = int.from_bytes(data[at + 8 : at + 16], "little")
        if index == 0:
            return size == end - at
        at += 16 + size + -size % 8
    return at <= end
