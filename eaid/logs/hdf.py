"""HDF5 files of eaid's own, opened in this process: damage becomes a sentence."""

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from eaid.errors import DataError


@contextlib.contextmanager
def open_hdf5(path: Path, source: str) -> Iterator[Any]:
    """The file, open for reading; raises DataError where it, or what is read of it in the block, is damaged."""
    import h5py

    try:
        with h5py.File(path, "r", locking=False) as file:
            yield file
    except DataError:
        raise
    except Exception as fault:  # what h5py raises on bytes that it did not expect has no common type
        reason = " ".join(str(fault).split())[:120].rstrip(".") or type(fault).__name__
        raise DataError(f"{source}: is a damaged HDF5 file ({reason}); copy or save it again") from None


def is_old_layout(head: bytes) -> bool:
    """Whether an HDF5 file has the layout without checksums; those that eaid writes have the newer one."""
    return head[8:9] < b"\x02"
