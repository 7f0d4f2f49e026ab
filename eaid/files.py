"""Files that are whole or not there: written beside their final name, then renamed; and their fingerprints."""

import contextlib
import hashlib
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

from eaid.errors import UsageError


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
    handle, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=".part", dir=path.parent)
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
    except BaseException:
        part.unlink(missing_ok=True)
        raise
