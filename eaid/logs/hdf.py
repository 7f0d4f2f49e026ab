"""HDF5 files of eaid's own (data.h5, replay.h5): opened in this process only where they are what eaid wrote.

Any other is read to its end by the isolated reader first: the HDF5 library goes round for ever on some damaged files,
and ends the process on others.
"""

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from eaid.errors import DataError
from eaid.files import is_as_written


@contextlib.contextmanager
def open_hdf5(path: Path, source: str) -> Iterator[Any]:
    """The file, open for reading; raises DataError where it, or what is read of it in the block, is damaged."""
    import h5py

    as_written = is_as_written(path)
    if as_written is False:
        raise DataError(f"{source}: is a damaged HDF5 file (not the bytes that eaid wrote); copy it again")
    if as_written is None:
        from eaid.logs.foreign.ask import ForeignReader

        with ForeignReader() as foreign:
            foreign.check(path, source)
    try:
        with h5py.File(path, "r", locking=False) as file:
            yield file
    except DataError:
        raise
    except Exception as fault:  # what h5py raises on bytes that it did not expect has no common type
        reason = " ".join(str(fault).split())[:120].rstrip(".") or type(fault).__name__
        raise DataError(f"{source}: is a damaged HDF5 file ({reason}); copy or save it again") from None
