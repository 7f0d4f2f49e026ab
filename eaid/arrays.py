"""The array type of every signature, how arrays are made safe to share, and their median and distinct numbers.

The latter two because `np.median` and `np.unique` load `numpy.ma`: 7 ms that a fit has no use for.
"""

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
    rising = np.sort(np.asarray(values, dtype=np.float64), axis=None)
    if not len(rising) or np.isnan(rising[-1]):
        return float("nan")
    return float(0.5 * (rising[(len(rising) - 1) // 2] + rising[len(rising) // 2]))


def distinct(values: Array) -> Array:
    """The different numbers among some, shape (n,), rising."""
    return np.array(sorted(set(values.tolist())), dtype=np.float64)
