"""Text logs: CSV and its many dialects, plain or gzipped.

The plain way is pandas' C parser, whose numbers are correctly rounded, on the wanted columns alone. Whatever it
stumbles over (a word in a column of numbers, an empty cell, a row too long) is read again cell by cell, so that every
bad cell is told by its row and column. Small logs take the second way from the start: importing pandas costs 0.3 s.
"""

import gzip
import io
import re
import warnings
import zlib
from array import array
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import IO, Any, cast

import numpy as np

from eaid.arrays import Array, read_only
from eaid.errors import DataError
from eaid.logs.dialect import COMMENT, Dialect, encoding_of, number, rate_said, sniff, split
from eaid.logs.longtext import load_long
from eaid.logs.sheet import BadCell, Cells, Sheet
from eaid.logs.stamps import seconds_of

HEAD_BYTES = 1 << 16
SMALL_BYTES = 1 << 18
"""Below this size the cell-by-cell way is quicker than importing pandas."""
CHUNK_BYTES = 1 << 24
LONG_BYTES = 1 << 26
"""Size above which a log is read piece by piece; an eighth of it for gzip."""
MOST_RATIO = 200
"""A gzip that unpacks to more than this many times its size is taken for a bomb (recorded logs: about 10)."""


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
    fast = _load_fast(piece, 0, end, here, columns) if end else None
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
    if end - start > SMALL_BYTES and not dialect.stamps:
        fast = _load_fast(data, start, end, dialect, columns)
        if fast is not None:
            return fast
    return _load_slow(data[start:end], dialect, columns)


def _load_fast(data: bytes, start: int, end: int, dialect: Dialect, columns: Sequence[int]) -> Cells | None:
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
    if dialect.delimiter:
        marks = np.count_nonzero(np.frombuffer(body, dtype=np.uint8) == ord(dialect.delimiter))
        if marks != len(frame) * (count - 1 + dialect.ragged):
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
