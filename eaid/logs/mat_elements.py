"""The elements of a MAT-file v5, walked before SciPy reads them.

SciPy trusts the type word of an element and ends the process on one that it does not know, it makes room for as many
cells as a header claims, and it takes the next bytes for whatever its class of matrix should have there. So every
element is looked at first: its type, its length, its place inside the element around it, its claimed shape against the
bytes that are there, and that each matrix has just the elements of its class. Nothing is decoded.
"""

import zlib
from pathlib import Path
from typing import BinaryIO

from eaid.errors import DataError

_MATRIX, _COMPRESSED = 14, 15
_NUMBERS = (1, 2, 3, 4, 5, 6, 7, 9, 12, 13)
_TEXT = (1, 2, 3, 4, 16, 17, 18)
_NAME = (1, 2, 16)
_NUMERIC = range(6, 16)
_CELL, _STRUCT, _OBJECT, _CHAR, _SPARSE, _FUNCTION, _OPAQUE = 1, 2, 3, 4, 5, 16, 17
_DEEPEST = 30
MOST_RATIO = 200


class _ElementError(Exception):
    pass


def check_elements(path: Path, source: str) -> None:
    """Raise DataError where an element of a MAT-file is not what it claims."""
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(128)
        try:
            if head[126:128] in (b"MI", b"IM"):
                _file(file, size, "little" if head[126:128] == b"IM" else "big")
            else:
                _version_4(file, size)
        except (_ElementError, zlib.error) as fault:
            raise DataError(f"{source}: is a damaged MAT-file ({fault}); save it again") from None


def _version_4(file: BinaryIO, size: int) -> None:
    """Variables of a v4 file: type word MOPT, rows, columns, imaginary, length of the name; then name and numbers."""
    at = 0
    while at + 20 <= size:
        file.seek(at)
        head = file.read(20)
        order = "little" if _word(head, 0, "little") < 5000 else "big"
        kind, rows, columns, imaginary, name = (_word(head, i, order) for i in range(0, 20, 4))
        machine, digits = divmod(kind, 1000)
        number, sort = divmod(digits % 100, 10)
        if machine not in (0, 1) or digits >= 100 or number > 5 or sort > 2 or imaginary > 1 or not 0 < name < 4096:
            raise _ElementError(f"a variable with a header that means nothing at byte {at}")
        at += 20 + name + rows * columns * (8, 4, 4, 2, 2, 1)[number] * (1 + imaginary)
        if at > size:
            raise _ElementError("it is cut short")


def _file(file: BinaryIO, size: int, order: str) -> None:
    while len(tag := file.read(8)) == 8:
        kind, length = _word(tag, 0, order), _word(tag, 4, order)
        if length > size - file.tell():
            raise _ElementError("it is cut short")
        data = file.read(length)
        if kind == _COMPRESSED:
            most = max(MOST_RATIO * size, 1 << 25)
            unpacker = zlib.decompressobj()
            data = unpacker.decompress(data, most)
            if not unpacker.eof:
                raise _ElementError(
                    f"a variable is cut short, or unpacks to more than {MOST_RATIO} times the file's size"
                )
            kind, inner, start, _ = _element(memoryview(data), 0, order)
            if kind == _MATRIX:
                _matrix(memoryview(data)[start : start + inner], order, 0)
        elif kind == _MATRIX:
            _matrix(memoryview(data), order, 0)
        else:
            raise _ElementError(f"it holds an element of type {kind}")


def _word(data: bytes | memoryview, at: int, order: str) -> int:
    return int.from_bytes(data[at : at + 4], "little" if order == "little" else "big")


def _element(data: memoryview, at: int, order: str) -> tuple[int, int, int, int]:
    """Type, bytes, start of the bytes and start of the next element."""
    if at + 8 > len(data):
        raise _ElementError("an element is cut short")
    first = _word(data, at, order)
    if first >> 16:
        kind, length, start, after = first & 0xFFFF, first >> 16, at + 4, at + 8
        if length > 4:
            raise _ElementError("a small element claims more than 4 bytes")
    else:
        kind, length, start = first, _word(data, at + 4, order), at + 8
        after = start + length + -length % 8
    if start + length > len(data):
        raise _ElementError("an element claims more bytes than there are")
    return kind, length, start, after


def _matrix(data: memoryview, order: str, depth: int) -> int:
    """Walk one matrix and all in it; returns where its elements end. An empty one has none."""
    if not len(data):
        return 0
    if depth > _DEEPEST:
        raise _ElementError(f"it is nested more than {_DEEPEST} deep")

    def take(at: int, kinds: tuple[int, ...], what: str) -> tuple[int, int, int]:
        kind, length, start, after = _element(data, at, order)
        if kind not in kinds:
            raise _ElementError(f"{what} of type {kind}")
        return length, start, after

    length, start, at = take(0, (6,), "array flags")
    if length != 8:
        raise _ElementError("array flags of a wrong length")
    kind, parts = _word(data, start, order) & 0xFF, 2 if _word(data, start, order) >> 11 & 1 else 1
    count = 1
    if kind != _OPAQUE:
        length, start, at = take(at, (5, 6), "dimensions")
        if length < 8 or length % 4 or length > 4 * 32:
            raise _ElementError("dimensions of a wrong length")
        for i in range(start, start + length, 4):
            count *= _word(data, i, order)
        if count > len(data) and kind != _SPARSE:
            raise _ElementError(f"a variable claims {count:.3g} values in {len(data):,} bytes")
    length, _, at = take(at, _NAME, "a name")
    if length > 4096:
        raise _ElementError("a name of more than 4096 letters")
    if kind in _NUMERIC or kind == _SPARSE:
        for _ in range(parts if kind in _NUMERIC else 2 + parts):
            *_, at = take(at, _NUMBERS, "values")
        return at
    if kind == _CHAR:
        return take(at, _TEXT, "text")[2]
    if kind in (_OBJECT, _OPAQUE):
        for _ in range(2 if kind == _OPAQUE else 1):
            *_, at = take(at, _NAME, "a class name")
    if kind in (_STRUCT, _OBJECT):
        length, start, at = take(at, (5, 6), "the length of field names")
        longest = _word(data, start, order) if length == 4 else 0
        if not 0 < longest <= 4096:
            raise _ElementError("field names of a wrong length")
        length, start, at = take(at, _NAME, "field names")
        names = bytes(data[start : start + length])
        if any(0 not in names[i : i + longest] for i in range(0, length - length % longest, longest)):
            raise _ElementError("field names without an end")
        count *= length // longest
    elif kind in (_FUNCTION, _OPAQUE):
        count = 1
    elif kind != _CELL:
        raise _ElementError(f"a matrix of class {kind}")
    for _ in range(count):
        if _word(data, at, order) != _MATRIX:  # SciPy does not know a small one here
            raise _ElementError("a matrix without its parts")
        length, start, at = take(at, (_MATRIX,), "a part")
        if length and _matrix(data[start : start + length], order, depth + 1) != length:
            raise _ElementError("a part of a wrong length")
    return at
