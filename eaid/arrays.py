"""The array type of every signature, how arrays are made safe to share, and their median."""

from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array: TypeAlias = NDArray[np.float64]


def read_only(values: ArrayLike) -> Array:
    """A float64 array that nobody can change by accident; copied only where it has to be."""
    array = np.asarray(values, dtype=np.float64)
    if array.flags.writeable:
        array = array.view()
        array.flags.writeable = False
    return array


def median(values: ArrayLike) -> float:
    """Median of all numbers of an array; NaN where there are none, or one of them is NaN."""
    array = np.asarray(values, dtype=np.float64)
    return float(np.median(array)) if array.size else float("nan")
