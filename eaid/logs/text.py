"""Text logs: CSV in its many dialects, plain or gzipped, read piece by piece (`rows`) in their own marks.

Wall-clock stamps (`2024-10-29 16:18:17.123`, `16:18:17,5`) become seconds; an offset from UTC counts.
"""

import codecs
import contextlib
import gzip
import math
import re
import zlib
from bisect import bisect_right
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import IO, Any, cast

import numpy as np
from numpy.typing import NDArray

from eaid.arrays import Array, read_only
from eaid.errors import DataError
from eaid.logs.dialect import COMMENT, NUMBER_MARKS, Dialect, Marks, encoding_of, sniff
from eaid.logs.table import BadCell, Cells, Table


def by_arrow(body: memoryview, dialect: Dialect, columns: Sequence[int], line: int) -> Cells | None:
    """The columns of a piece by Arrow's parser; None where anything in them is not a plain finite number."""
    import pyarrow as pa
    from pyarrow import csv

    marks, names = dialect.marks, [str(i) for i in range(len(dialect.columns) + dialect.ragged)]
    first = marks.cells(bytes(body[:4096]).splitlines()[0].decode("latin-1"), len(dialect.columns))
    kinds = {}
    for column in columns:
        digits = first[min(column, len(first) - 1)]
        long = digits.isdigit() and len(digits) > 15  # more than a float surely holds: stamps in ns stay whole
        number = pa.int64() if long else pa.float64()
        kinds[names[column]] = pa.string() if column in dialect.stamps else number
    if marks.delimiter is None:  # cells stand apart by one blank each
        body = memoryview(b"\n".join(b" ".join(row.split()) for row in bytes(body).splitlines()))
    plain = _without_thousands(body, dialect)
    if plain is None:
        return None
    try:
        table = csv.read_csv(
            pa.BufferReader(pa.py_buffer(plain)),
            csv.ReadOptions(use_threads=False, block_size=len(plain) + 1, column_names=names),
            csv.ParseOptions(delimiter=marks.delimiter or " ", ignore_empty_lines=False),
            csv.ConvertOptions(
                column_types=kinds, include_columns=list(kinds), null_values=[], decimal_point=marks.decimal
            ),
        )
    except pa.ArrowInvalid:
        return None
    # one chunk, as the block is the piece; its own to_numpy would load pandas
    values: list[NDArray[Any]] = []
    for column in columns:
        (cells,) = table[names[column]].chunks
        stamps = column in dialect.stamps
        values.append(np.array(cells.to_pylist(), dtype=object) if stamps else np.from_dlpack(cells))
        if not (values[-1].all() if stamps else np.isfinite(values[-1]).all()):
            return None
    return Cells(tuple(values), first_row=line)


def _without_thousands(body: bytes | memoryview, dialect: Dialect) -> bytes | memoryview | None:
    """A piece without the marks between thousands; None where one is something else, or may be."""
    marks = dialect.marks
    if not marks.thousands or marks.thousands.encode() not in bytes(body):
        return body
    if dialect.stamps or marks.thousands == marks.delimiter:
        return None
    other = rf"[^{re.escape(marks.delimiter or ' ')}\r\n]*"
    for cell in re.findall(f"{other}{re.escape(marks.thousands)}{other}".encode(), body):
        if marks.value(cell.decode("latin-1")) is None:
            return None
    return bytes(body).translate(None, marks.thousands.encode())


def cell_by_cell(body: memoryview, dialect: Dialect, columns: Sequence[int], line: int) -> Cells:
    """The columns of a piece cell by cell, every bad cell listed; comment and blank lines are passed over.

    Stamps stay texts: what they mean depends on those before them.
    """
    encoding = "cp1252" if dialect.encoding == "cp1252" else "utf-8"
    count = len(dialect.columns)
    values: list[list[Any]] = [[] for _ in columns]
    rows: list[int] = []
    bad: list[BadCell] = []
    for row, raw in enumerate(re.split(rb"\r\n|\n|\r", body), start=line):
        text = raw.decode(encoding, errors="replace").strip("\r\n \x00\x1a")
        if not text or text.startswith(COMMENT):
            continue
        cells = dialect.marks.cells(text, count)
        here, whole = len(rows), len(cells) == count
        rows.append(row)
        if not whole:
            bad.append(BadCell(here, -1, str(len(cells))))
        for k, column in enumerate(columns):
            if column in dialect.stamps:
                values[k].append(cells[column] if whole else "")
                continue
            value = plain_value(cells[column], dialect.marks) if whole else math.nan
            if whole and not math.isfinite(value):
                bad.append(BadCell(here, column, cells[column].strip()[:40]))
                value = math.nan
            values[k].append(value)
    arrays = [
        np.array(one, dtype=object if column in dialect.stamps else np.float64)
        for one, column in zip(values, columns, strict=True)
    ]
    return Cells(tuple(arrays), tuple(bad), rows)


def plain_value(text: str, marks: Marks) -> float:
    """Value of a cell; NaN where it is no number."""
    value = marks.value(text)
    return math.nan if value is None else value


HEAD_BYTES = 1 << 15
PIECE_BYTES = 1 << 22
MOST_RATIO = 200
"""A gzip that unpacks to more than this many times its size is taken for a bomb (recorded logs: about 10)."""
MOST_BAD = 10_000
"""Bad cells that are listed; a log with more is refused whatever they are."""
BLANK = b"\r\n \t\x00\x1a"
_DECIMAL = re.compile(rb"(?<![\d.,])0+,\d|\d,\d{1,2}(?!\d)|\d,\d{4}")
"""A comma that is a decimal mark and cannot be one between thousands."""
_CLOCK = re.compile(
    r"(?:(\S+?)[T ]+)?([01]?\d|2[0-3]):([0-5]\d)(?::([0-5]\d|60)(?:[.,](\d+))?)?\s*(AM|PM)?(Z|([+-])(\d{2}):?(\d{2}))?$"
)
_DATES = ("%Y-%m-%d", "%Y/%m/%d", "%Y.%m.%d", "%d.%m.%Y", "%d/%m/%Y", "%m/%d/%Y", "%d-%m-%Y")


def read_text(path: Path, source: str, tell: Callable[[float], None] = lambda _: None) -> list[Table]:
    """The one table of a text log; raises DataError where it holds none. `tell` hears the share of it that is read."""
    with path.open("rb") as raw:
        zipped = raw.read(2) == b"\x1f\x8b"
    with _unpacked(path, source, zipped) as file:
        head = file.read(HEAD_BYTES)
    if zipped and not encoding_of(head):
        raise DataError(f"{source}: is gzip around a file that is no text; unpack it and give what is inside")
    dialect = sniff(source, head, len(head) < HEAD_BYTES)
    units = tuple("s" if i in dialect.stamps else unit for i, unit in enumerate(dialect.units))
    load = _TextLog(path, source, zipped, dialect, tell).load
    return [Table("", dialect.columns, load, units, dialect.rates, dialect.synthetic)]


@contextlib.contextmanager
def _unpacked(path: Path, source: str, zipped: bool) -> Iterator[IO[bytes]]:
    """A file's bytes, unpacked; raises DataError where the gzip is damaged."""
    try:
        with cast(IO[bytes], gzip.open(path, "rb")) if zipped else path.open("rb") as file:
            yield file
    except (EOFError, zlib.error, gzip.BadGzipFile) as fault:
        reason = re.sub(r"\s+", " ", str(fault)).strip().rstrip(".")
        raise DataError(f"{source}: is no whole gzip file ({reason}); copy it again") from None


@dataclass(frozen=True)
class _TextLog:
    """A text log whose dialect is known."""

    path: Path
    source: str
    zipped: bool
    dialect: Dialect
    tell: Callable[[float], None]

    def load(self, columns: Sequence[int]) -> Cells:
        """The columns by the marks of the first rows, or by others where later rows show that those were wrong."""
        cells, decimal = self._read(self.dialect, columns)
        texts = [bad.text for bad in cells.bad if bad.column >= 0]
        for mark, thousands in NUMBER_MARKS:
            marks = self.dialect.marks._replace(decimal=mark, thousands=thousands)
            if marks != self.dialect.marks and any(math.isfinite(plain_value(text, marks)) for text in texts):
                again, _ = self._read(replace(self.dialect, marks=marks), columns)
                if len(again.bad) < len(cells.bad):
                    return again
        if self.dialect.marks.decimal == "," and not decimal:
            raise DataError(
                f"{self.source}: its commas may be decimal marks or stand between thousands, as three digits follow "
                f"every one; save it with decimal points"
            )
        return cells

    def _read(self, dialect: Dialect, columns: Sequence[int]) -> tuple[Cells, bool]:
        """The columns, and whether a comma in them is surely a decimal mark."""
        size = self.path.stat().st_size
        limit = max(MOST_RATIO * size, 1 << 22) if self.zipped else math.inf
        parts: list[Cells] = []
        bad: list[BadCell] = []
        count, seen, decimal = 0, 0, False
        line, before = dialect.first_line, memoryview(b"")
        with _unpacked(self.path, self.source, self.zipped) as file:
            for piece in _pieces(file, dialect):
                line, before = line + _lines(before), piece
                seen += len(piece)
                if seen > limit:
                    raise DataError(
                        f"{self.source}: unpacks to more than {MOST_RATIO} times its size, as no recorded log does; "
                        f"unpack it yourself"
                    )
                body = piece
                while body and body[-1] in BLANK:
                    body = body[:-1]
                if not body:
                    continue
                decimal = decimal or (dialect.marks.decimal == "," and _DECIMAL.search(body) is not None)
                cells = by_arrow(body, dialect, columns, line) or cell_by_cell(body, dialect, columns, line)
                bad.extend(BadCell(one.row + count, one.column, one.text) for one in cells.bad)
                count += len(cells.values[0])
                parts.append(cells)
                self.tell(min(1.0, seen / size))
                if len(bad) > MOST_BAD:
                    raise DataError(f"{self.source}: more than {MOST_BAD:,} of its cells are bad; record it again")
        self.tell(1.0)
        pieces = [[cells.values[k] for cells in parts] or [np.empty(0)] for k in range(len(columns))]
        values = [one[0] if len(one) == 1 else np.concatenate(one) for one in pieces]
        for k, column in enumerate(columns):
            if column in dialect.stamps:
                texts = [str(text) for text in values[k]]
                values[k], wrong = seconds_of(texts)
                bad.extend(BadCell(i, column, texts[i].strip()[:40]) for i in wrong if texts[i])
        # whole numbers keep their type: a stamp of 1.7e18 ns has more digits than a float
        kept = tuple(one if one.dtype.kind in "iu" else read_only(one) for one in values)
        return Cells(kept, tuple(bad), _Rows(parts)), decimal


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


def _pieces(file: IO[bytes], dialect: Dialect) -> Iterator[memoryview]:
    """Whole lines from the first row of the table on, about `PIECE_BYTES` at a time; UTF-16 comes as UTF-8."""
    if dialect.encoding.startswith("utf-16"):
        file = cast(IO[bytes], codecs.EncodedFile(file, "utf-8", dialect.encoding, errors="replace"))
    rest, skip = b"", dialect.first_line - 1
    while block := file.read(PIECE_BYTES):
        block, begin = rest + block if rest else block, 0
        if skip:
            ends = re.finditer(rb"\r\n|\n|\r", block)
            begin, skip = next(end for i, end in enumerate(ends, start=1) if i == skip).end(), 0
        end = max(block.rfind(b"\n"), -1 if b"\n" in block else block.rfind(b"\r", 0, -1)) + 1
        if end > begin:
            yield memoryview(block)[begin:end]
        rest = block[max(begin, end) :]
    if rest:
        yield memoryview(rest)


def _lines(view: memoryview) -> int:
    """Line ends in a piece: \\n, \\r\\n, or \\r alone."""
    piece = bytes(view)
    return piece.count(b"\n") + (piece.count(b"\r") - piece.count(b"\r\n") if b"\r" in piece else 0)


def _days(dates: Sequence[str]) -> dict[str, int]:
    """The day of each date, in the one way of writing in which most are dates, none falls and the fewest days pass."""
    ways: list[tuple[int, bool, int, dict[str, int]]] = []
    for form in _DATES:
        days = {}
        for date in dates:
            with contextlib.suppress(ValueError):
                days[date] = datetime.strptime(date, form).toordinal()
        in_order = [*days.values()]
        span = max(in_order, default=0) - min(in_order, default=0)
        ways.append((-len(days), in_order != sorted(in_order), span, days))
    return min(ways, key=lambda way: way[:3])[3]


def seconds_of(texts: Sequence[str]) -> tuple[Array, list[int]]:
    """Seconds since the whole second of the first stamp, shape (n,), and the places of those that cannot be read (NaN).

    A clock without a date that falls by more than half a day has passed midnight.
    """
    seconds = np.full(len(texts), np.nan)
    wrong = []
    read = [_CLOCK.match(text.strip().strip('"')) for text in texts]
    days = {"": 0} | _days([*dict.fromkeys(found[1] for found in read if found and found[1])])
    first: float | None = None
    added, last = 0, 0.0
    for i, found in enumerate(read):
        date = (found.group(1) or "") if found else ""
        day = days.get(date)
        if not found or day is None:
            wrong.append(i)
            continue
        hour = int(found.group(2))
        if found.group(6):
            hour = hour % 12 + 12 * (found.group(6) == "PM")
        clock = 3600 * hour + 60 * int(found.group(3)) + int(found.group(4) or 0)
        if not date and clock - last < -43200:
            added += 1
        last = clock
        if found.group(8):  # a stamp of 14:00+02:00 is one of 12:00 UTC
            clock -= int(f"{found.group(8)}1") * (3600 * int(found.group(9)) + 60 * int(found.group(10)))
        # whole seconds and their fraction apart: a day number times 86,400 would cost the last digits
        whole = (day + added) * 86400 + clock
        first = whole if first is None else first
        seconds[i] = (whole - first) + float(f"0.{found.group(5) or 0}")
    return seconds, wrong
