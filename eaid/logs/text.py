"""Text logs: CSV and its many dialects, plain or gzipped.

Numbers with a fixed count of decimals are read by `ruled`; others by the C parser of NumPy or, where much is to be
read, of pandas. All give correctly rounded numbers. Whatever they stumble over (a word in a column of numbers, an empty
cell, a row too long) is read again cell by cell, so that every bad cell is told by its row and column; small logs are
read so from the start.
"""

import gzip
import io
import re
import sys
import warnings
import zlib
from array import array
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import IO, Any, cast

import numpy as np

from eaid.arrays import Array, read_only
from eaid.errors import DataError
from eaid.logs.dialect import COMMENT, Dialect, encoding_of, number, rate_said, sniff, split
from eaid.logs.longtext import load_long
from eaid.logs.ruled import ruled
from eaid.logs.sheet import BadCell, Cells, Sheet
from eaid.logs.stamps import seconds_of

HEAD_BYTES = 1 << 16
SMALL_BYTES = 1 << 18
"""Below this size the cell-by-cell way is quicker than importing pandas."""
TINY_BYTES = 1 << 12
"""Below this size it is quicker than anything."""
PANDAS_BYTES = 1 << 26
"""Bytes read by NumPy from which on the import of pandas, 0.3 s, is won back."""
CHUNK_BYTES = 1 << 24
LONG_BYTES = 1 << 26
"""Size above which a log is read piece by piece; an eighth of it for gzip."""
MOST_RATIO = 200
"""A gzip that unpacks to more than this many times its size is taken for a bomb (recorded logs: about 10)."""

_read_bytes = 0
"""What NumPy has read so far, in this process."""


def is_gzip(head: bytes) -> bool:
    """True for the first bytes of a gzip file."""
    return head.startswith(b"\x1f\x8b")


def _opened(path: Path, zipped: bool) -> IO[bytes]:
    return cast(IO[bytes], gzip.open(path, "rb")) if zipped else path.open("rb")


def _limit(path: Path, zipped: bool) -> int:
    size = path.stat().st_size
    return max(MOST_RATIO * size, 1 << 22) if zipped else size


def read_text(path: Path, source: str) -> list[Sheet]:
    """The one sheet of a text log; raises DataError where it holds no table."""
    with path.open("rb") as raw:
        zipped = is_gzip(raw.read(4))
    try:
        with _opened(path, zipped) as file:
            head = file.read(HEAD_BYTES)
            whole = not file.read(1)
    except (OSError, EOFError, zlib.error) as fault:
        if not zipped:
            raise
        raise DataError(f"{source}: is no whole gzip file ({_plain(fault)}); copy it again") from None
    if zipped and not encoding_of(head):
        raise DataError(f"{source}: is gzip around a file that is no text; unpack it and give what is inside")
    dialect = sniff(source, head, whole)

    def load(columns: Sequence[int]) -> Cells:
        return _load(path, source, zipped, dialect, columns)

    def load_in_pieces(columns: Sequence[int], told: Callable[[float], None]) -> Cells:
        return load_long(path, source, zipped, _limit(path, zipped), dialect, columns, _parse, told)

    said = dict(dialect.said)
    plain = not dialect.encoding.startswith("utf-16") and not dialect.stamps and b"\n" in head
    long = path.stat().st_size > (LONG_BYTES // 8 if zipped else LONG_BYTES)
    return [
        Sheet(
            "", dialect.columns, load, dialect.units, rate_said(said), 0.0, said,
            load_long=load_in_pieces if plain and long else None,
        )
    ]  # fmt: skip


def _parse(piece: bytes, dialect: Dialect, columns: Sequence[int], line: int) -> Cells:
    """Cells of some whole lines of a log, the first of which is `line`."""
    here = replace(dialect, first_line=line)
    end = len(piece.rstrip(b"\r\n \t\x00\x1a"))
    fast = (_load_ruled(piece, 0, end, here, columns) or _load_fast(piece, 0, end, here, columns)) if end else None
    return fast if fast is not None else _load_slow(piece[:end], here, columns)


def _plain(fault: BaseException) -> str:
    return re.sub(r"\s+", " ", str(fault)).strip().rstrip(".") or type(fault).__name__


def _bytes(path: Path, source: str, zipped: bool) -> bytes:
    """All bytes of a log, unpacked; a gzip bomb is refused before it fills the memory."""
    if not zipped:
        return path.read_bytes()
    limit = _limit(path, zipped)
    try:
        with gzip.open(path, "rb") as file:
            data = file.read(limit + 1)
    except (OSError, EOFError, zlib.error) as fault:
        raise DataError(f"{source}: is no whole gzip file ({_plain(fault)}); copy it again") from None
    if len(data) > limit:
        raise DataError(
            f"{source}: unpacks to more than {MOST_RATIO} times its size, as no recorded log does; unpack it yourself"
        )
    return data


def _load(path: Path, source: str, zipped: bool, dialect: Dialect, columns: Sequence[int]) -> Cells:
    data = _bytes(path, source, zipped)
    if dialect.encoding.startswith("utf-16"):
        data = data.decode(dialect.encoding, errors="replace").encode("utf-8")
    if b"\r" in data[:HEAD_BYTES] and b"\n" not in data[:HEAD_BYTES]:
        data = data.replace(b"\r", b"\n")
    start = 0
    for _ in range(dialect.first_line - 1):
        start = data.find(b"\n", start) + 1
        if not start:
            raise DataError(f"{source}: its lines end in different ways; save it with line ends of one kind")
    end = len(data)
    while end > start and data[end - 1] in b"\r\n \t\x00\x1a":
        end -= 1
    if end - start > TINY_BYTES and not dialect.stamps:
        plain = _load_ruled(data, start, end, dialect, columns)
        if plain is not None:
            return plain
    if end - start > SMALL_BYTES and not dialect.stamps:
        fast = _load_fast(data, start, end, dialect, columns)
        if fast is not None:
            return fast
    return _load_slow(data[start:end], dialect, columns)


def _load_ruled(data: bytes, start: int, end: int, dialect: Dialect, columns: Sequence[int]) -> Cells | None:
    """The columns of a log with a fixed count of decimals; None for any other."""
    delimiter = dialect.delimiter
    if delimiter is None or dialect.decimal != "." or dialect.thousands or dialect.ragged or delimiter in "+-.":
        return None
    found = ruled(np.frombuffer(data, dtype=np.uint8)[start:end], len(dialect.columns), delimiter, columns)
    return None if found is None else Cells(tuple(map(read_only, found)), first_row=dialect.first_line)


def _load_fast(data: bytes, start: int, end: int, dialect: Dialect, columns: Sequence[int]) -> Cells | None:
    """The columns by a C parser; None where anything in them is not a plain finite number.

    NumPy's needs no import; pandas' is taken where it is there already, and once much has been read.
    """
    global _read_bytes
    plain = dialect.decimal == "." and not dialect.thousands and not dialect.ragged
    if plain and "pandas" not in sys.modules and _read_bytes + (end - start) < PANDAS_BYTES:
        _read_bytes += end - start
        return _load_numpy(data, start, end, dialect, columns)
    return _load_pandas(data, start, end, dialect, columns)


def _load_numpy(data: bytes, start: int, end: int, dialect: Dialect, columns: Sequence[int]) -> Cells | None:
    """The columns by `numpy.loadtxt`, whose numbers are those of `float()`; a blank line or a short row gives None."""
    count, rows = len(dialect.columns), _count(data, "\n", start, end) + 1
    file = io.BytesIO(data)  # which copies nothing
    file.seek(start)
    with_last = list(dict.fromkeys((*columns, count - 1))) if dialect.delimiter else None
    try:
        table = np.loadtxt(islice(file, rows), comments=None, delimiter=dialect.delimiter, usecols=with_last, ndmin=2)
    except ValueError:
        return None
    marks = _count(data, dialect.delimiter, start, end) if dialect.delimiter else rows * (count - 1)
    if table.shape != (rows, count if with_last is None else len(with_last)) or marks != rows * (count - 1):
        return None
    places = columns if with_last is None else range(len(columns))
    values = [np.ascontiguousarray(table[:, place]) for place in places]
    if not all(np.isfinite(column).all() for column in values):
        return None
    return Cells(tuple(map(read_only, values)), first_row=dialect.first_line)


def _count(data: bytes, mark: str, start: int, end: int) -> int:
    """How often a mark stands in a part of a text; five times as quick as `bytes.count`."""
    part = np.frombuffer(data, dtype=np.uint8)[start:end]
    return sum(int(np.count_nonzero(part[i : i + CHUNK_BYTES] == ord(mark))) for i in range(0, len(part), CHUNK_BYTES))


def _load_pandas(data: bytes, start: int, end: int, dialect: Dialect, columns: Sequence[int]) -> Cells | None:
    """The columns by pandas' C parser; None where anything in them is not a plain finite number."""
    import pandas as pd
    from pandas.errors import DtypeWarning, ParserError

    count = len(dialect.columns)
    options: dict[str, Any] = {}
    if tuple(int(part) for part in pd.__version__.split(".")[:2]) < (3, 1):
        options["float_precision"] = "round_trip"  # correctly rounded by itself from 3.1 on
    if dialect.thousands:
        options["thousands"] = dialect.thousands
    wanted = sorted({*columns, count - 1}) if dialect.delimiter else list(range(count))
    body = memoryview(data)[start:end]
    # the last column comes along to show short rows; making texts of numbers would take longer than all the rest
    first = data[start : start + 4096].split(b"\n", 1)[0].decode("latin-1").strip("\r ")
    last = split(first, dialect.delimiter)[-1 - dialect.ragged]
    warnings.simplefilter("ignore", DtypeWarning)  # words among numbers are told below, cell by cell
    numbers = count - 1 in columns or number(last, dialect.decimal, dialect.thousands) is not None
    try:
        frame = pd.read_csv(
            _Window(body),
            sep=dialect.delimiter or r"\s+",
            decimal=dialect.decimal,
            header=None,
            names=list(range(count + dialect.ragged)),
            usecols=wanted,
            index_col=False,
            skip_blank_lines=False,
            encoding_errors="replace",
            low_memory=True,  # in pieces, which takes a third less memory
            dtype=None if numbers else {count - 1: str},
            **options,
        )
    except (ParserError, ValueError, OverflowError):
        return None
    values = []
    for column in columns:
        cells = frame[column]
        if cells.dtype.kind not in "fiu":
            return None
        array_ = cells.to_numpy(dtype=np.float64)
        if not np.isfinite(array_).all():
            return None
        values.append(read_only(array_))
    marks = len(frame) * (count - 1 + dialect.ragged)
    if dialect.delimiter and _count(data, dialect.delimiter, start, end) != marks:
        return None
    return Cells(tuple(values), first_row=dialect.first_line)


class _Window(io.RawIOBase):
    """A part of a buffer as a file, without copying it."""

    def __init__(self, view: memoryview) -> None:
        self._view = view
        self._at = 0

    def readable(self) -> bool:
        return True

    def read(self, size: int = -1) -> bytes:
        stop = len(self._view) if size is None or size < 0 else self._at + size
        piece = bytes(self._view[self._at : stop])
        self._at += len(piece)
        return piece

    def __iter__(self) -> "Iterator[bytes]":
        while piece := self.read(CHUNK_BYTES):
            yield piece


def _load_slow(body: bytes, dialect: Dialect, columns: Sequence[int]) -> Cells:
    """The columns cell by cell, every bad cell listed; comment and blank lines are passed over."""
    encoding = "cp1252" if dialect.encoding == "cp1252" else "utf-8"
    count, decimal, thousands = len(dialect.columns), dialect.decimal, dialect.thousands
    values = [array("d") for _ in columns]
    stamps: dict[int, list[str]] = {k: [] for k, column in enumerate(columns) if column in dialect.stamps}
    rows = array("q")
    bad: list[BadCell] = []
    plain = decimal == "." and not thousands
    for line_number, raw in enumerate(body.split(b"\n"), start=dialect.first_line):
        line = raw.decode(encoding, errors="replace").strip("\r\n ")
        if not line or line.startswith(COMMENT):
            continue
        cells = split(line, dialect.delimiter)
        if len(cells) == count + 1 and not cells[-1].strip():
            cells.pop()
        index = len(rows)
        rows.append(line_number)
        if len(cells) != count:
            bad.append(BadCell(index, -1, str(len(cells))))
            for column_values in values:
                column_values.append(np.nan)
            for texts in stamps.values():
                texts.append("")
            continue
        for k, column in enumerate(columns):
            text = cells[column]
            if k in stamps:
                stamps[k].append(text)
                values[k].append(0.0)
                continue
            value: float | None
            try:
                value = float(text) if plain and "_" not in text else number(text, decimal, thousands)
            except ValueError:
                value = number(text, decimal, thousands)
            if value is None or not -1.8e308 < value < 1.8e308:
                bad.append(BadCell(index, column, text.strip()[:40]))
                value = np.nan
            values[k].append(value)
    arrays: list[Array] = [np.frombuffer(v, dtype=np.float64) if len(v) else np.empty(0) for v in values]
    for k, texts in stamps.items():
        arrays[k], wrong = seconds_of(texts)
        bad.extend(BadCell(i, columns[k], texts[i].strip()[:40]) for i in wrong if texts[i])
    return Cells(tuple(read_only(a) for a in arrays), tuple(bad), rows)
