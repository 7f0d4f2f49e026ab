"""Records too long for the memory: columns kept in a nameless file on disk and mapped, walked through piece by piece.

A day at 1 kHz is 86 million samples, 0.7 GB a column. What is walked through by `pieces` is let go again behind it, so
that the memory in use stays at a few pieces. Which way a result is computed depends on the length alone, never on where
the array lies, so that a record gives the same numbers from a log and from a dataset.
"""

import mmap
from collections.abc import Iterator
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from eaid.arrays import Array

LONG = 1 << 22
"""Samples from which a record is kept on disk and judged piece by piece (32 MB a column)."""
PIECE = 1 << 19
"""Samples of one piece."""


def _nameless() -> BinaryIO:
    """A file without a name, gone when it is closed."""
    import tempfile  # 2 ms, for long records only

    return tempfile.TemporaryFile(prefix="eaid-")


def room(shape: int | tuple[int, int]) -> Array:
    """A writable array of that shape, not yet filled: in memory, or on disk where it is long."""
    count = int(np.prod(shape))
    if count < LONG:
        return np.empty(shape)
    with _nameless() as file:  # goes when the map does
        file.truncate(8 * count)
        array: Array = np.memmap(file, dtype=np.float64, mode="r+", shape=shape)
    return array


class Spool:
    """A column that is read piece by piece."""

    def __init__(self) -> None:
        self._file = _nameless()  # it lives until array()
        self._count = 0

    def append(self, values: Array) -> None:
        """Add values, float64, at the end."""
        self._file.write(np.ascontiguousarray(values, dtype=np.float64).data)
        self._count += len(values)

    def array(self) -> Array:
        """All that was added, shape (n,), read-only."""
        self._file.flush()
        if not self._count:
            return np.empty(0)
        array: Array = np.memmap(self._file, dtype=np.float64, mode="r", shape=(self._count,))
        self._file.close()
        return array


def on_disk(*arrays: Array) -> list[Array]:
    """The same columns, read-only, mapped from one nameless file; what takes no memory stays as it is."""
    with _nameless() as file:
        starts: list[int | None] = []
        for array in arrays:
            starts.append(None if 0 in array.strides or not array.size else file.tell())
            if starts[-1] is not None:
                file.write(np.ascontiguousarray(array, dtype=np.float64).data)
        file.flush()
        if not file.tell():
            return list(arrays)
        whole = np.asarray(np.memmap(file, dtype=np.float64, mode="r"))
    kept = []
    for array, start in zip(arrays, starts, strict=True):
        kept.append(array if start is None else whole[start // 8 : start // 8 + len(array)])
    release(whole)
    return kept


def release(*arrays: NDArray[Any]) -> None:
    """Let go of the memory behind mapped arrays; it is read from the disk again when it is needed."""
    for array in arrays:
        base: Any = array
        while base is not None and not isinstance(base, mmap.mmap):
            base = getattr(base, "base", None)
        if base is not None and hasattr(mmap, "MADV_DONTNEED"):
            base.madvise(mmap.MADV_DONTNEED)


def pieces(*arrays: Array, overlap: int = 0) -> Iterator[tuple[slice, tuple[Array, ...]]]:
    """Slices of arrays of one length, in order, with so many samples of the next one; let go behind each piece."""
    count = len(arrays[0])
    for start in range(0, max(count, 1), PIECE):
        place = slice(start, min(count, start + PIECE + overlap))
        yield place, tuple(array[place] for array in arrays)
        if count >= LONG:
            release(*arrays)


def less(values: Array, base: float, sign: float = 1.0) -> Array:
    """sign · (values − base), shape (n,)."""
    if len(values) < LONG:
        return sign * (values - base) if sign != 1.0 else values - base
    filled = room(len(values))
    for place, (piece,) in pieces(values):
        filled[place] = sign * (piece - base)
        release(filled)
    return filled


def times(values: Array, factor: float) -> Array:
    """Values · factor, shape (n,); the same array where the factor is 1."""
    if factor == 1.0:
        return values
    if len(values) < LONG:
        return values * factor
    filled = room(len(values))
    for place, (piece,) in pieces(values):
        filled[place] = piece * factor
        release(filled)
    return filled


def extent(values: Array) -> tuple[float, float]:
    """Smallest and largest value; (0, 0) of nothing."""
    if not len(values):
        return 0.0, 0.0
    ends = [(float(piece.min()), float(piece.max())) for _, (piece,) in pieces(values) if len(piece)]
    return min(low for low, _ in ends), max(high for _, high in ends)


def mean(values: Array) -> float:
    """Mean of a record."""
    if len(values) < LONG:
        return float(values.mean())
    return float(sum(float(piece.sum()) for _, (piece,) in pieces(values)) / len(values))


def sample(values: Array) -> Array:
    """Values, or of a long record some stretches of it, evenly spread: what medians and quantiles are taken from."""
    if len(values) < LONG:
        return values
    starts = np.linspace(0, len(values) - (1 << 14), 32).astype(np.int64).tolist()
    taken = np.concatenate([values[start : start + (1 << 14)] for start in starts])
    release(values)
    return taken


def sample_steps(values: Array) -> Array:
    """Differences of neighbours, or of a long record those of some stretches of it."""
    if len(values) < LONG:
        return np.diff(values)
    starts = np.linspace(0, len(values) - (1 << 14), 32).astype(np.int64).tolist()
    taken = np.concatenate([np.diff(values[start : start + (1 << 14)]) for start in starts])
    release(values)
    return taken
