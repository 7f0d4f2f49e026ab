"""The array type of every signature, how arrays are made safe to share, their median, extremes, noise and inverses."""

import contextlib
import ctypes
import itertools
from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array: TypeAlias = NDArray[np.float64]
Mask: TypeAlias = NDArray[np.bool_]


MMAP_THRESHOLD, TRIM_THRESHOLD = -3, -1  # Of glibc's mallopt


def keep_freed_memory() -> None:
    """Have the C library keep what large arrays leave for the next ones; the system, to which it would go back, clears
    every page that it hands out, a third of the time of a fit of ten million rows. Only glibc has such a switch."""
    with contextlib.suppress(AttributeError, OSError, TypeError):
        library = ctypes.CDLL(None)
        library.mallopt(MMAP_THRESHOLD, 1 << 30)
        library.mallopt(TRIM_THRESHOLD, (1 << 31) - 1)


def read_only(values: ArrayLike) -> Array:
    """A float64 array that nobody can change by accident; copied only where it has to be."""
    array = np.asarray(values, dtype=np.float64)
    if array.flags.writeable:
        array = array.view()
        array.flags.writeable = False
    return array


def inverse(matrix: Array, rcond: float = 1e-14) -> Array:
    """(Pseudo-)inverse of a symmetric matrix: directions below `rcond` of the largest get none."""
    return np.asarray(np.linalg.pinv(matrix, rcond=rcond, hermitian=True))


def scaled_inverse(matrix: Array, rcond: float = 1e-13) -> Array:
    """The same in scaled form: its condition is that of the correlations, not of the units."""
    scale = 1 / np.sqrt(np.maximum(np.abs(np.diag(matrix)), 1e-300))
    return np.asarray(scale[:, None] * inverse(scale[:, None] * matrix * scale, rcond) * scale)


def link(tied: Mask) -> NDArray[np.intp]:
    """Which of n are tied to each other, be it by way of others: the number of its group for each, (n,)."""
    from scipy.sparse.csgraph import connected_components

    return np.asarray(connected_components(tied, directed=False)[1], dtype=np.intp)


def white_squares(values: Array) -> float:
    """Sum of squares of the white noise in values, by the differences of neighbours."""
    between = np.diff(values)
    return float(between @ between) / 2


def means_of(values: Array, rows: int) -> Array:
    """Means over so many rows each, (n, …) → (n // rows, …); what is left at the end is not in them."""
    return np.asarray(values[: len(values) // rows * rows].reshape(-1, rows, *values.shape[1:]).mean(axis=1))


def median(values: ArrayLike) -> float:
    """Median of all numbers of an array; NaN where there are none, or one of them is NaN.

    `np.median` puts three places in order; one and a maximum take a quarter of the time.
    """
    part = np.array(values, dtype=np.float64).ravel()
    if not part.size:
        return float("nan")
    half = part.size // 2
    part.partition(half)
    middle, largest = part[half], part[half:].max()  # NaN goes to the end
    return float(largest if np.isnan(largest) else middle if part.size % 2 else 0.5 * (part[:half].max() + middle))


def extremes(rows: Sequence[Array], stretches: int) -> NDArray[np.intp]:
    """Samples at which one of k rows, (n,), is least or greatest within its stretch; all where they are few."""
    count, n = len(rows), len(rows[0])
    if n <= 2 * count * stretches:
        return np.arange(n)
    starts = np.linspace(0, n, stretches + 1).astype(np.intp)
    places = [np.array([0, n - 1])]
    for first, last in itertools.pairwise(starts.tolist()):
        parts = [row[first:last] for row in rows]
        places += [first + np.array([at for one in parts for at in (one.argmin(), one.argmax())])]
    return np.unique(np.concatenate(places))


def best_gain(curve: Array, y: Array) -> float:
    """The multiple of a curve that is nearest to y, shapes (n,); 0 of a curve that is 0."""
    return float(curve @ y) / max(float(curve @ curve), 1e-300)


def lowest_places(costs: Array) -> NDArray[np.intp]:
    """Where a row of costs has a minimum, the least first."""
    framed = np.pad(costs, 1, constant_values=np.inf)
    minima = np.flatnonzero((costs <= framed[:-2]) & (costs <= framed[2:]))
    return minima[np.argsort(costs[minima])]
