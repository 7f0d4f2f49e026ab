"""NumPy files (.npy): records with named fields, or a matrix with samples in its rows or columns. Never a pickle."""

from pathlib import Path

import numpy as np

from eaid.errors import DataError
from eaid.logs.foreign.groups import Column, table_of
from eaid.logs.table import Table


def read_npy(path: Path, source: str) -> list[Table]:
    """The one table of a NumPy file; raises DataError where it holds no columns of numbers."""
    try:
        array = np.load(path, allow_pickle=False)
    except (ValueError, EOFError):  # a pickled object, or no whole array
        raise DataError(f"{source}: is no whole NumPy array of numbers; export the log as CSV or HDF5") from None
    names = [name for name in array.dtype.names or () if array.dtype[name].kind in "fiub"]
    columns = [Column(name, array, name) for name in names]
    if array.ndim == 2 and array.dtype.kind in "fiub":
        columns = [Column("", array, k) for k in range(min(array.shape))]
    if not columns:
        raise DataError(
            f"{source}: holds no columns of numbers; save a matrix, or records with a field for each column"
        )
    return [table_of("", columns)]
