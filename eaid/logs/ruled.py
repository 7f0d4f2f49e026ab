"""Numbers written with a fixed count of decimals, as loggers print them, read column of digits by column of digits.

Rows that have their signs, points and delimiters at the same places are read together: the digits of a cell make one
integer m < 10^15 (Horner's rule over whole columns of bytes), and its value is m / 10^k, k ≤ 15. Both are exact
doubles, so the one division is correctly rounded: the bits are those of `float()`. Any other text, a row that is short
among it, is left to the other readers.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eaid.arrays import Array

Bytes = NDArray[np.uint8]
Places = NDArray[np.intp]

ROWS = 1 << 14
"""Rows of one piece."""
PROBE = 1 << 13
"""Bytes in the middle that are tried first, so that a text of another kind costs no more than them."""
WIDEST = 200
"""Bytes of a row beyond which it is left to others."""
MOST_DIGITS = 15
"""Digits of a cell that surely make an integer below 2^53."""
MOST, FEW = 24, 8
"""Ways in which the rows of a piece, and those tried first, may be laid out; with more of them others are as quick."""


@dataclass(frozen=True)
class Field:
    """One cell of a layout."""

    digits: tuple[int, ...]
    """Places of its digits in the row."""
    scale: float
    """± 10^decimals."""


def ruled(data: Bytes, columns: int, delimiter: str, wanted: Sequence[int]) -> tuple[Array, ...] | None:
    """The wanted columns of whole lines (no line end behind the last), shape (n,) each; None where not so ruled."""
    if len(data) > 8 * PROBE:
        middle = data[len(data) // 2 :][:PROBE].tobytes()
        some = middle[middle.find(b"\n") + 1 : middle.rfind(b"\n") + 1].rstrip(b"\r\n")
        if not some or _read(np.frombuffer(some, dtype=np.uint8), columns, delimiter, tuple(wanted), FEW) is None:
            return None
    return _read(data, columns, delimiter, tuple(wanted), MOST)


def _read(data: Bytes, columns: int, delimiter: str, wanted: tuple[int, ...], most: int) -> tuple[Array, ...] | None:
    ends = np.append(np.flatnonzero(data == ord("\n")), len(data))
    starts = np.concatenate(([0], ends[:-1] + 1))
    if data[ends[0] - 1] == ord("\r"):
        ends[:-1] -= 1
        if ends[0] < 0 or not (data[ends[:-1]] == ord("\r")).all():
            return None
    lengths = ends - starts
    if lengths.min() < 1 or lengths.max() > WIDEST:
        return None
    values = tuple(np.empty(len(ends)) for _ in wanted)
    for start in range(0, len(ends), ROWS):
        piece = slice(start, start + ROWS)
        for count, (at, signs) in enumerate(_alike(data, starts[piece], lengths[piece]), start=1):
            first = signs[:, 0]
            row = bytes(np.where(_marks(first), first, np.uint8(ord("0"))))  # any digit stands for all
            fields = None if count > most else _fields(row, columns, delimiter.encode(), wanted)
            if fields is None or not _same_marks(signs):
                return None
            for column, field in zip(values, fields, strict=True):
                column[piece][at] = _number(signs, field)
    return values


def _alike(data: Bytes, starts: Places, lengths: Places) -> Iterator[tuple[Places, Bytes]]:
    """Rows with marks at the same places: their indices, and their bytes, shape (length, rows)."""
    for length in np.flatnonzero(np.bincount(lengths)).tolist():
        rows = np.flatnonzero(lengths == length)
        windows = np.ndarray((len(data) - length + 1,), f"V{length}", data, strides=(1,))
        signs = np.ascontiguousarray(windows[starts[rows]].view(np.uint8).reshape(-1, length).T)
        marks = _marks(signs)
        changing = np.flatnonzero(marks.any(axis=1) & ~marks.all(axis=1))
        if len(changing) > 64:  # more than fit into a key
            yield rows, np.full_like(signs, 0xFF)
            return
        key: NDArray[Any] = np.zeros(len(rows), dtype=np.uint32 if len(changing) <= 32 else np.uint64)
        for place in changing.tolist():
            key <<= 1
            key |= marks[place]
        while len(rows):
            same = key == key[0]
            if same.all():
                yield rows, signs
                break
            chosen = np.flatnonzero(same)
            yield rows[chosen], signs.take(chosen, axis=1)
            others = np.flatnonzero(~same)
            rows, key, signs = rows[others], key[others], signs.take(others, axis=1)


def _marks(signs: Bytes) -> NDArray[np.bool_]:
    """True for whatever is no digit."""
    return np.asarray(signs - np.uint8(ord("0")) > 9)  # what is below 0 wraps around


def _same_marks(signs: Bytes) -> bool:
    """True where rows with marks at the same places have the same ones."""
    first = signs[:, 0]
    places = np.flatnonzero(_marks(first))
    return bool((signs[places] == first[places, np.newaxis]).all())


@lru_cache(maxsize=256)
def _fields(row: bytes, columns: int, delimiter: bytes, wanted: tuple[int, ...]) -> list[Field] | None:
    """How the wanted cells of a row are written; None where any cell is not digits with at most a sign and a point."""
    cells = row.split(delimiter)
    if len(cells) != columns:
        return None
    found: list[Field] = []
    start = 0
    for cell in cells:
        signed = cell[:1] in (b"-", b"+")
        whole, _, decimals = cell[signed:].partition(b".")
        figures = whole + decimals
        if not figures.isdigit() or len(figures) > MOST_DIGITS:
            return None
        first = start + signed
        point = first + len(whole)
        places = (*range(first, point), *range(point + 1, start + len(cell)))
        found.append(Field(places, (-1.0 if cell[:1] == b"-" else 1.0) * 10.0 ** len(decimals)))
        start += len(cell) + 1
    return [found[column] for column in wanted]


def _number(digits: Bytes, field: Field) -> Array:
    """Values of one cell of all rows."""
    count = len(field.digits)
    whole: NDArray[Any] = digits[field.digits[0]].astype(np.int32 if count <= 8 else np.int64)
    for place in field.digits[1:]:
        whole *= 10
        whole += digits[place]
    whole -= ord("0") * (10**count // 9)  # what the bytes are above their digits
    return np.asarray(whole / field.scale)
