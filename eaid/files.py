"""Files that are whole or not there: written beside their final name, then renamed; and their fingerprints.

What a killed command leaves behind is named `.NAME.….part`: no command reads it, and one that writes NAME an hour later
clears it away.
"""

import contextlib
import errno
import glob
import hashlib
import os
import shutil
import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

from eaid.errors import UsageError

# Failures of writing that more room, or another disk, mends
_NO_ROOM = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO}
# Endings of recordings, besides .txt and .h5, which others have too
LOG_ENDINGS = (".gz", ".csv", ".tsv", ".dat", ".asc", ".lvm", ".mat", ".tdms", ".npy", ".npz")
Ours = Callable[[Path, bytes], bool]  # (file, its first and last 4 kB) → whether a command made it
KILLED_S = 3600  # Age from which what stands beside an output was left there by a writer that is gone
SEAL = b"eaid-sha256:"


def sha256_of(path: Path) -> str:
    """SHA-256 of a file's bytes, in hex."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def refuse_to_overwrite(path: Path, force: bool, inputs: Iterable[Path] = ()) -> None:
    """Leave an existing output alone without `force`; `inputs`, and what is no regular file, are never replaced."""
    if not path.parent.is_dir():
        raise UsageError(f"{path}: the folder {path.parent} does not exist; make it first")
    if not path.exists():
        return
    if not path.is_file():
        raise UsageError(f"{path}: is no regular file, which alone is ever replaced; give another «output»")
    inputs = list(inputs)
    if not all(given.exists() for given in inputs):
        return  # what reads them tells which is missing, and that comes first
    if not force:
        raise UsageError(f"{path}: exists already; give «force» to overwrite it, or another «output»")
    for given in inputs:
        if path.samefile(given):
            raise UsageError(f"{path}: is what the command reads, and is never overwritten; give another «output»")


def strangers(folder: Path, ours: Ours) -> list[Path]:
    """What of a folder a command did not make."""
    items = sorted(folder.iterdir())
    return [item for item in items if item.is_symlink() or not item.is_file() or not ours(item, _ends(item))]


def _ends(path: Path) -> bytes:
    with path.open("rb") as file:
        first = file.read(4096)
        file.seek(max(len(first), path.stat().st_size - 4096))
        return first + file.read()


def refuse_folder(
    folder: Path, force: bool, ours: Ours, command: str, inputs: Iterable[Path] = (),
    names: Iterable[str] | None = None,
) -> None:  # fmt: skip
    """Leave an existing folder alone without `force`; one with an input, or with files of others, always.

    Where `names` are given, files of others beside those of the command stay, but for those names.
    """
    if not folder.exists() and not folder.is_symlink():
        if not folder.resolve().parent.is_dir():
            raise UsageError(f"{folder}: the folder {folder.resolve().parent} does not exist; make it first")
        return
    if not folder.is_dir():
        raise UsageError(f"{folder}: is no folder; give another «output»")
    for given in inputs:
        if given.exists() and any(folder.samefile(above) for above in given.resolve().parents):
            raise UsageError(f"{folder}: holds {given.name}, which the command reads; give another «output»")
    strange, held = [one.name for one in strangers(folder, ours)], len(list(folder.iterdir()))
    if names is not None and len(strange) < held:
        strange = [name for name in strange if name in set(names)]
    if strange:
        raise UsageError(f"{folder}: holds {strange[0]}, which {command} did not make; give another «output»")
    if held and not force:
        raise UsageError(f"{folder}: exists already; give «force» to overwrite it, or another «output»")


@contextlib.contextmanager
def written_whole(*paths: Path, force: bool = False) -> Iterator[list[Path]]:
    """Temporary paths beside outputs that belong together, renamed once all are on the disk and the block ends well."""
    for path in paths:
        refuse_to_overwrite(path, force)
    parts: list[Path] = []
    try:
        parts.extend(map(_part_of, paths))
        yield parts
        for part in parts:
            _to_disk(part)
        for path in paths:
            refuse_to_overwrite(path, force)
        for part, path in zip(parts, paths, strict=True):
            os.replace(part, path)
    except BaseException as fault:
        for part in parts:
            part.unlink(missing_ok=True)
        raise _as_told(paths[0], fault) from None


def _as_told(path: Path, fault: BaseException) -> BaseException:
    """What is raised where an output could not be written: that there is no room, or the fault itself."""
    if isinstance(fault, OSError) and fault.errno in _NO_ROOM:
        return UsageError(f"{path}: cannot be written ({fault.strerror}); make room, or choose another «output»")
    return fault


def _to_disk(path: Path) -> None:
    with path.open("rb+") as file:
        os.fsync(file.fileno())


def _part_of(path: Path, folder: bool = False) -> Path:
    """A new file or folder beside `path` with a name that nothing has; what killed writers of `path` left goes."""
    start = f".{os.fsencode(path.name)[:120].decode(errors='ignore')}."
    with contextlib.suppress(OSError):
        for left in path.parent.glob(f"{glob.escape(start)}{'[0-9a-f]' * 12}.part"):
            if time.time() - left.stat().st_mtime > KILLED_S:
                shutil.rmtree(left) if left.is_dir() else left.unlink()
    part = path.parent / f"{start}{os.urandom(6).hex()}.part"
    try:
        part.mkdir() if folder else part.touch(exist_ok=False)
    except OSError as fault:
        raise UsageError(f"{path}: cannot be written ({fault.strerror}); choose another folder with «output»") from None
    return part


@contextlib.contextmanager
def folder_written_whole(path: Path, ours: Ours) -> Iterator[Path]:
    """A folder that takes the place of `path` and of all files of `ours` in it; what others put there stays.

    Linux exchanges the two in one step; elsewhere, for the folder that the command runs in, and where files of others
    stay, the files inside are replaced one right after the other.
    """
    path = path.resolve()
    part = _part_of(path, folder=True)
    try:
        yield part
        made = sorted(part.iterdir())
        for item in made:
            _to_disk(item)
        theirs = {item.name for item in strangers(path, ours)} if path.exists() else set()
        if not path.exists():
            os.rename(part, path)
        elif theirs or path == Path.cwd() or not _exchanged(part, path):
            for item in made:
                os.replace(item, path / item.name)
            for name in {item.name for item in path.iterdir()} - {item.name for item in made} - theirs:
                (path / name).unlink()
    except OSError as fault:
        raise _as_told(path, fault) from None
    finally:
        shutil.rmtree(part, ignore_errors=True)  # after an exchange: what was there before


def _exchanged(one: Path, other: Path) -> bool:
    """Exchange two paths in one step; False where the system cannot."""
    import ctypes

    try:
        swap = ctypes.CDLL(None, use_errno=True).renameat2
    except (AttributeError, OSError, TypeError):
        return False
    here, exchange = -100, 2  # AT_FDCWD, RENAME_EXCHANGE
    return bool(swap(here, os.fsencode(one), here, os.fsencode(other), exchange) == 0)


def is_as_written(path: Path) -> bool | None:
    """Whether an HDF5 file is what eaid wrote, so safe to open here; None where it has no seal (h5py takes it off)."""
    size = path.stat().st_size - len(SEAL) - 32
    if size <= 0:
        return None
    with path.open("rb") as file:
        file.seek(size)
        mark = file.read()
        if not mark.startswith(SEAL):
            return None
        file.seek(0)
        return mark[len(SEAL) :] == hashlib.sha256(file.read(size)).digest()


@contextlib.contextmanager
def hdf5_written_whole(path: Path, force: bool = False) -> Iterator[Any]:
    """An HDF5 file, built in memory (on a full disk the library may crash) and written whole with its seal.

    Behind its end stand `SEAL` and the SHA-256 of all before it, which the HDF5 library passes over.
    """
    import h5py

    refuse_to_overwrite(path, force)
    with h5py.File(path.name, "w", driver="core", backing_store=False, libver=("v110", "v110")) as file:
        yield file
        file.flush()
        image = file.id.get_file_image()
    with written_whole(path, force=force) as (part,):
        part.write_bytes(image + SEAL + hashlib.sha256(image).digest())
