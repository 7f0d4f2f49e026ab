"""Files that are whole or not there: written beside their final name, then renamed; and their fingerprints."""

import contextlib
import errno
import hashlib
import os
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from eaid.errors import UsageError

IN_MEMORY = 1 << 28
_NO_ROOM = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO}
"""Failures of writing that more room, or another disk, mends."""


def sha256_of(path: Path) -> str:
    """SHA-256 of a file's bytes, in hex."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def refuse_to_overwrite(path: Path, force: bool) -> None:
    """Leave an existing output alone unless the user says otherwise; call it before the work is done."""
    if path.exists() and not force:
        raise UsageError(f"{path}: exists already; give --force to overwrite it, or another -o")
    if not path.parent.is_dir():
        raise UsageError(f"{path}: the folder {path.parent} does not exist; make it first")


@contextlib.contextmanager
def written_whole(path: Path, force: bool = False) -> Iterator[Path]:
    """A temporary path in the same folder; renamed to `path` when the block ends well, removed when not.

    Two commands that write the same output never mix: each has a name of its own until the rename.
    """
    refuse_to_overwrite(path, force)
    try:
        handle, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=".part", dir=path.parent)
    except OSError as fault:
        raise UsageError(f"{path}: cannot be written ({fault.strerror}); choose another folder with -o") from None
    os.close(handle)
    part = Path(name)
    try:
        yield part
        umask = os.umask(0)
        os.umask(umask)
        part.chmod(0o666 & ~umask)
        with part.open("rb+") as file:
            os.fsync(file.fileno())
        refuse_to_overwrite(path, force)
        os.replace(part, path)
    except OSError as fault:
        part.unlink(missing_ok=True)
        if fault.errno in _NO_ROOM:
            raise UsageError(f"{path}: cannot be written ({fault.strerror}); make room, or choose another -o") from None
        raise
    except BaseException:
        part.unlink(missing_ok=True)
        raise


@contextlib.contextmanager
def hdf5_written_whole(path: Path, force: bool = False, raw_bytes: int = 0) -> Iterator[Any]:
    """An HDF5 file, built in memory and written whole when the block ends well; the same content, the same bytes.

    On a full disk the HDF5 library itself prints tracebacks and may crash; plain bytes give a plain OSError. Content of
    more than `IN_MEMORY` raw bytes goes to the disk directly, once there is room for all of it.
    """
    import h5py

    refuse_to_overwrite(path, force)
    settings: dict[str, Any] = {"libver": ("v110", "v110")}
    if raw_bytes > IN_MEMORY:
        free = shutil.disk_usage(path.parent).free
        if free < raw_bytes:
            raise UsageError(
                f"{path}: takes up to {raw_bytes / 1e6:,.0f} MB, and {free / 1e6:,.0f} MB are free; "
                f"make room, or choose another -o"
            )
        with written_whole(path, force) as part, h5py.File(part, "w", **settings) as file:
            yield file
        return
    with h5py.File(path.name, "w", driver="core", backing_store=False, **settings) as file:
        yield file
        file.flush()
        image = file.id.get_file_image()
    with written_whole(path, force) as part:
        part.write_bytes(image)
