"""Text logs: CSV and its many dialects, plain or gzipped, read piece by piece by the C parser of pandas.

Its numbers are correctly rounded. A piece that it stumbles over (a word in a column of numbers, an empty cell, a
comment, a row too long) is taken apart cell by cell, so that every bad cell is told by its row and column.
"""

import codecs
import contextlib
import gzip
import io
import math
import re
import zlib
from bisect import bisect_right
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import IO, Any, cast

import numpy as np
from numpy.typing import NDArray

from eaid.arrays import read_only
from eaid.errors import DataError
from eaid.logs.dialect import MARKS, Dialect, encoding_of, sniff, split
from eaid.logs.facts import COMMENT, number, rate_said
from eaid.logs.stamps import seconds_of
from eaid.logs.table import BadCell, Cells, Table

HEAD_BYTES = 1 << 16
PIECE_BYTES = 1 << 22
MOST_RATIO = 200
"""A gzip that unpacks to more than this many times its size is taken for a bomb (recorded logs: about 10)."""
MOST_DIGITS = 15
"""Digits of a whole number that a float surely holds; stamps in ns have more, and stay whole."""
MOST_BAD = 10_000
"""Bad cells that are listed; a log with more is refused whatever they are."""
BLANK = b"\r\n \t\x00\x1a"
_DECIMAL = re.compile(rb"(?<![\d.,])0+,\d|\d,\d{1,2}(?!\d)|\d,\d{4}")
"""A comma that is a decimal mark and cannot be one between thousands."""


def read_text(path: Path, source: str, tell: Callable[[float], None] = lambda _: None) -> list[Table]:
    """The one table of a text log; raises DataError where it holds none. `tell` hears the share of it that is read."""
    with path.open("rb") as raw:
        zipped = raw.read(2) == b"\x1f\x8b"
    with _unpacked(path, source, zipped) as file:
        head = file.read(HEAD_BYTES)
        whole = not file.read(1)
    if zipped and not encoding_of(head):
        raise DataError(f"{source}: is gzip around a file that is no text; unpack it and give what is inside")
    dialect = sniff(source, head, whole)

    def load(columns: Sequence[int]) -> Cells:
        return _load(path, source, zipped, dialect, columns, tell)

    said = dict(dialect.said)
    units = tuple("s" if i in dialect.stamps else unit for i, unit in enumerate(dialect.units))
    return [Table("", dialect.columns, load, units, rate_said(said), 0.0, said)]


@contextlib.contextmanager
def _unpacked(path: Path, source: str, zipped: bool) -> Iterator[IO[bytes]]:
    """A file's bytes, unpacked; raises DataError where the gzip is damaged."""
    try:
        with cast(IO[bytes], gzip.open(path, "rb")) if zipped else path.open("rb") as file:
            yield file
    except (EOFError, zlib.error, gzip.BadGzipFile) as fault:
        reason = re.sub(r"\s+", " ", str(fault)).strip().rstrip(".")
        raise DataError(f"{source}: is no whole gzip file ({reason}); copy it again") from None


def _load(
    path: Path, source: str, zipped: bool, dialect: Dialect, columns: Sequence[int], tell: Callable[[float], None]
) -> Cells:
    """The columns by the marks of the first rows, or by others where later rows show that those were wrong."""
    cells, decimal = _read(path, source, zipped, dialect, columns, tell)
    texts = [bad.text for bad in cells.bad if bad.column >= 0]
    for mark, thousands in MARKS:
        fits = any(math.isfinite(_value(text, False, mark, thousands)) for text in texts)
        if fits and (mark, thousands) != (dialect.decimal, dialect.thousands):
            again, _ = _read(path, source, zipped, replace(dialect, decimal=mark, thousands=thousands), columns, tell)
            if len(again.bad) < len(cells.bad):
                return again
    if dialect.decimal == "," and not decimal:
        raise DataError(
            f"{source}: its commas may be decimal marks or stand between thousands, as three digits follow every one; "
            f"save it with decimal points"
        )
    return cells


def _read(
    path: Path, source: str, zipped: bool, dialect: Dialect, columns: Sequence[int], tell: Callable[[float], None]
) -> tuple[Cells, bool]:
    """The columns, and whether a comma in them is surely a decimal mark."""
    size = path.stat().st_size
    limit = max(MOST_RATIO * size, 1 << 22) if zipped else math.inf
    parts: list[Cells] = []
    bad: list[BadCell] = []
    line, count, seen, decimal = dialect.first_line, 0, 0, False
    with _unpacked(path, source, zipped) as file:
        for piece in _pieces(file, dialect):
            seen += len(piece)
            if seen > limit:
                raise DataError(
                    f"{source}: unpacks to more than {MOST_RATIO} times its size, as no recorded log does; "
                    f"unpack it yourself"
                )
            body = piece.rstrip(BLANK)
            if not body:
                line += _lines(piece)
                continue
            decimal = decimal or (dialect.decimal == "," and _DECIMAL.search(body) is not None)
            cells = _by_pandas(body, dialect, columns, line) or _cell_by_cell(body, dialect, columns, line)
            bad.extend(BadCell(one.row + count, one.column, one.text) for one in cells.bad)
            count += len(cells.values[0])
            line += _lines(piece)
            parts.append(cells)
            tell(min(1.0, seen / size))
            if len(bad) > MOST_BAD:
                raise DataError(f"{source}: more than {MOST_BAD:,} cells are bad up to row {line - 1}; record it again")
    tell(1.0)
    if not parts:
        return Cells(tuple(np.empty(0) for _ in columns)), decimal
    values = [np.concatenate([cells.values[k] for cells in parts]) for k in range(len(columns))]
    for k, column in enumerate(columns):
        if column in dialect.stamps:
            texts = [str(text) for text in values[k]]
            values[k], wrong = seconds_of(texts)
            bad.extend(BadCell(i, column, texts[i].strip()[:40]) for i in wrong if texts[i])
    return Cells(tuple(read_only_(v) for v in values), tuple(bad), _Rows(parts)), decimal


def read_only_(values: NDArray[Any]) -> NDArray[Any]:
    """Whole numbers keep their type: a stamp of 1.7e18 ns has more digits than a float."""
    return values if values.dtype.kind in "iu" else read_only(values)


class _Rows(Sequence[int]):
    """Line of the file of every sample, kept as the lines that each piece begins with."""

    def __init__(self, pieces: Sequence[Cells]) -> None:
        self._pieces = [Cells((), rows=cells.rows, first_row=cells.first_row) for cells in pieces]
        self._starts = np.cumsum([0, *(len(cells.values[0]) for cells in pieces)]).tolist()

    def __len__(self) -> int:
        return int(self._starts[-1])

    def __getitem__(self, index: int) -> int:  # type: ignore[override]
        k = bisect_right(self._starts, index) - 1
        return self._pieces[k].row(index - self._starts[k])


def _lines(piece: bytes) -> int:
    """Line ends in a piece: \\n, \\r\\n, or \\r alone."""
    marks = np.frombuffer(piece, dtype=np.uint8)
    returns = np.count_nonzero(marks == 13) if b"\r" in piece else 0
    return int(np.count_nonzero(marks == 10) + (returns - piece.count(b"\r\n") if returns else 0))


def _pieces(file: IO[bytes], dialect: Dialect) -> Iterator[bytes]:
    """Whole lines from the first row of the table on, in UTF-8 or what the file has, about `PIECE_BYTES` at a time."""
    if dialect.encoding.startswith("utf-16"):
        file = cast(IO[bytes], codecs.EncodedFile(file, "utf-8", dialect.encoding, errors="replace"))
    rest, skip = b"", dialect.first_line - 1
    while block := file.read(PIECE_BYTES):
        block = rest + block
        if skip:
            ends = re.finditer(rb"\r\n|\n|\r", block)
            block = block[next(end for i, end in enumerate(ends, start=1) if i == skip).end() :]
            skip = 0
        end = max(block.rfind(b"\n"), -1 if b"\n" in block else block.rfind(b"\r", 0, -1)) + 1
        if end:
            yield block[:end]
        rest = block[end:]
    if rest:
        yield rest


def _by_pandas(body: bytes, dialect: Dialect, columns: Sequence[int], line: int) -> Cells | None:
    """The columns of a piece by pandas' C parser; None where anything in them is not a plain finite number."""
    import pandas as pd
    from pandas.errors import ParserError

    count, delimiter = len(dialect.columns), dialect.delimiter
    head = split(body[:4096].splitlines()[0].decode("latin-1").strip(), delimiter)
    kinds: dict[int, type] = {}
    for column in {*columns, count - 1}:  # the last comes along to show short rows
        cell = head[min(column, len(head) - 1)]
        if column in dialect.stamps or (
            column not in columns and number(cell, dialect.decimal, dialect.thousands) is None
        ):
            kinds[column] = str
        elif not (cell.isdigit() and len(cell) > MOST_DIGITS):
            kinds[column] = np.float64
    options: dict[str, Any] = {}
    if dialect.thousands:
        options["thousands"] = dialect.thousands
    if tuple(int(part) for part in pd.__version__.split(".")[:2]) < (3, 1):
        options["float_precision"] = "round_trip"  # correctly rounded by itself from 3.1 on
    try:
        frame = pd.read_csv(
            io.BytesIO(body), sep=delimiter or r"\s+", decimal=dialect.decimal, header=None, index_col=False,
            names=list(range(count + dialect.ragged)), usecols=sorted({*columns, count - 1}) if delimiter else None,
            skip_blank_lines=False, encoding_errors="replace", na_filter=False,
            dtype=kinds, **options,
        )  # fmt: skip
    except (ParserError, ValueError, OverflowError):
        return None
    values = [frame[column].to_numpy(object if column in dialect.stamps else None) for column in columns]
    for column, one in zip(columns, values, strict=True):
        if column in dialect.stamps:
            if not all(one):
                return None
        elif one.dtype.kind not in "fiu" or (one.dtype.kind == "f" and not np.isfinite(one).all()):
            return None
    if delimiter:  # a row too long is cut in silence
        marks = np.count_nonzero(np.frombuffer(body, dtype=np.uint8) == ord(delimiter))
        if marks != len(frame) * (count - 1 + dialect.ragged):
            return None
    return Cells(tuple(values), first_row=line)


def _cell_by_cell(body: bytes, dialect: Dialect, columns: Sequence[int], line: int) -> Cells:
    """The columns of a piece cell by cell, every bad cell listed; comment and blank lines are passed over.

    Stamps stay texts: what they mean depends on those before them.
    """
    encoding = "cp1252" if dialect.encoding == "cp1252" else "utf-8"
    count, decimal, thousands = len(dialect.columns), dialect.decimal, dialect.thousands
    values: list[list[Any]] = [[] for _ in columns]
    rows: list[int] = []
    bad: list[BadCell] = []
    plain = decimal == "." and not thousands
    for row, raw in enumerate(re.split(rb"\r\n|\n|\r", body), start=line):
        text = raw.decode(encoding, errors="replace").strip("\r\n \x00\x1a")
        if not text or text.startswith(COMMENT):
            continue
        cells = split(text, dialect.delimiter)
        if len(cells) == count + 1 and not cells[-1].strip():
            cells.pop()
        here = len(rows)
        rows.append(row)
        if len(cells) != count:
            bad.append(BadCell(here, -1, str(len(cells))))
        for k, column in enumerate(columns):
            if column in dialect.stamps:
                values[k].append(cells[column] if len(cells) == count else "")
                continue
            value = _value(cells[column], plain, decimal, thousands) if len(cells) == count else math.nan
            if len(cells) == count and not math.isfinite(value):
                bad.append(BadCell(here, column, cells[column].strip()[:40]))
                value = math.nan
            values[k].append(value)
    arrays = [
        np.array(one, dtype=object if column in dialect.stamps else np.float64)
        for one, column in zip(values, columns, strict=True)
    ]
    return Cells(tuple(arrays), tuple(bad), rows)


def _value(text: str, plain: bool, decimal: str, thousands: str) -> float:
    if plain and "_" not in text:
        with contextlib.suppress(ValueError):
            return float(text)
    value = number(text, decimal, thousands)
    return math.nan if value is None else value
