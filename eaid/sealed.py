"""HDF5 files with a seal: behind the end of each stand `SEAL` and the SHA-256 of all before it.

The HDF5 library passes the seal over when it reads, and takes it off when it writes.
"""

import contextlib
import hashlib
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from eaid.errors import UsageError
from eaid.files import refuse_to_overwrite, sha256_of, written_whole

IN_MEMORY = 1 << 28
"""Content of more raw bytes is written to the disk directly."""
LIBVER = ("v110", "v110")
SEAL = b"eaid-sha256:"


def is_as_written(path: Path) -> bool | None:
    """Whether an HDF5 file holds, to the byte, what eaid wrote; None where it has no seal (h5py takes it off).

    Only one that does is safe to open in this process.
    """
    size = path.stat().st_size - len(SEAL) - 32
    if size <= 0:
        return None
    with path.open("rb") as file:
        file.seek(size)
        mark = file.read()
        if not mark.startswith(SEAL):
            return None
        file.seek(0)
        seen, left = hashlib.sha256(), size
        while left and (block := file.read(min(left, 1 << 20))):
            seen.update(block)
            left -= len(block)
    return mark[len(SEAL) :] == seen.digest()


@contextlib.contextmanager
def hdf5_written_whole(path: Path, force: bool = False, raw_bytes: int = 0) -> Iterator[Any]:
    """An HDF5 file, built in memory and written whole when the block ends well; the same content, the same bytes.

    Behind its end stand `SEAL` and the SHA-256 of all before it, which the HDF5 library passes over.

    On a full disk the HDF5 library itself prints tracebacks and may crash; plain bytes give a plain OSError. Content of
    more than `IN_MEMORY` raw bytes goes to the disk directly, once there is room for all of it.
    """
    import h5py

    refuse_to_overwrite(path, force)
    if raw_bytes > IN_MEMORY:
        free = shutil.disk_usage(path.parent).free
        if free < raw_bytes:
            raise UsageError(
                f"{path}: takes up to {raw_bytes / 1e6:,.0f} MB, and {free / 1e6:,.0f} MB are free; "
                f"make room, or choose another «output»"
            )
        with written_whole(path, force) as part:
            with h5py.File(part, "w", libver=LIBVER) as file:
                yield file
            seal = bytes.fromhex(sha256_of(part))
            with part.open("ab") as raw:
                raw.write(SEAL + seal)
        return
    with h5py.File(path.name, "w", driver="core", backing_store=False, libver=LIBVER) as file:
        yield file
        file.flush()
        image = file.id.get_file_image()
    with written_whole(path, force) as part:
        part.write_bytes(image + SEAL + hashlib.sha256(image).digest())
