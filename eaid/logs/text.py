"""Text logs: CSV in its many dialects, plain or gzipped: encoding, marks, header, units row, facts in comment lines.

They are read piece by piece, by Arrow's parser where every cell is a plain finite number, else cell by cell. Wall-clock
stamps (`2024-10-29 16:18:17.123`, `16:18:17,5`) become seconds; an offset from UTC counts.
"""

import codecs
import contextlib
import csv
import gzip
import math
import re
import zlib
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import IO, Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from eaid.arrays import Array
from eaid.errors import DataError
from eaid.logs.table import BadCell, Cells, Table
from eaid.logs.units import unit_of

COMMENT = ("#", "%", "//")
_PLAIN = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eEdD][+-]?\d+)?$")
_WORDS = re.compile(r"[+-]?(nan|inf(inity)?|na|n/a|null|none|-)$", re.IGNORECASE)
_CLOCK = re.compile(
    r"(?:(\d[\d/.-]*)[T ]+)?([01]?\d|2[0-3]):([0-5]\d)(?::([0-5]\d|60)(?:[.,](\d+))?)?\s*(AM|PM)?"
    r"(Z|([+-])(\d{2}):?(\d{2}))?$"
)
_DATES = ("%Y-%m-%d", "%Y/%m/%d", "%Y.%m.%d", "%d.%m.%Y", "%d/%m/%Y", "%m/%d/%Y", "%d-%m-%Y")
_DECIMAL = re.compile(rb"(?<![\d.,])0+,\d|\d,\d{1,2}(?!\d)|\d,\d{4}")
"""A comma that is a decimal mark and cannot be one between thousands."""
NUMBER_MARKS = ((".", ""), (",", ""), (".", ","), (",", "."), (".", "'"), (".", " "), (",", " "))
"""Decimal mark, and the mark between thousands."""
ROWS = 3
"""Rows of numbers, one below the other, that make a table."""
HEAD_BYTES = 1 << 15
PIECE_BYTES = 1 << 22
MOST_RATIO = 200
"""A gzip that unpacks to more than this many times its size is taken for a bomb (recorded logs: about 10)."""
MOST_BAD = 10_000
"""Bad cells that are listed; a log with more is refused whatever they are."""


class Marks(NamedTuple):
    """What stands between the cells of a row, and inside its numbers."""

    delimiter: str | None
    """None: any white space."""
    decimal: str
    thousands: str = ""
    """Empty where nothing stands between thousands."""

    def cells(self, line: str, count: int = 0) -> list[str]:
        """Cells of a line; quotes keep a delimiter inside a cell.

        A delimiter at the end of the line begins no cell; where `count` are wanted, only if it would be one too many.
        """
        bare = line.strip("\r\n ")
        if self.delimiter is None:
            return bare.split()
        cells = bare.split(self.delimiter)
        if '"' in bare and len(cells) > 1:
            with contextlib.suppress(csv.Error):  # a return in the middle of a line
                cells = next(csv.reader([bare], delimiter=self.delimiter))
        if not cells[-1].strip() and count in (0, len(cells) - 1):
            cells.pop()
        return cells

    def value(self, cell: str) -> float | None:
        """Value of a cell, correctly rounded; None where it is no number."""
        decimal, thousands = self.decimal, self.thousands
        if decimal == "." and not thousands and "_" not in cell:
            with contextlib.suppress(ValueError):
                return float(cell)
        text = cell.strip().strip('"').strip()
        if thousands and thousands in text:
            whole = re.escape(thousands).join((r"[+-]?[1-9]\d{0,2}(", r"\d{3})+"))
            if not re.fullmatch(f"{whole}({re.escape(decimal)}\\d*)?", text):
                return None
            text = text.replace(thousands, "")
        if decimal != ".":
            if "." in text:
                return None
            text = text.replace(decimal, ".")
        if _PLAIN.match(text):
            return float(text.replace("d", "e").replace("D", "e"))
        if _WORDS.match(text):
            return math.inf if "inf" in text.lower() else math.nan
        return None

    def number(self, cell: str) -> float:
        """Value of a cell; NaN where it is no number."""
        value = self.value(cell)
        return math.nan if value is None else value

    def is_stamp(self, cell: str) -> bool:
        """True for a wall-clock stamp."""
        return self.value(cell) is None and bool(_CLOCK.match(cell.strip().strip('"')))

    def count_good(self, cells: list[str]) -> tuple[int, int]:
        """How many cells are numbers or stamps, and how many are not empty."""
        good = sum(self.value(cell) is not None or self.is_stamp(cell) for cell in cells)
        return good, sum(bool(cell.strip()) for cell in cells)


_RATE = re.compile(
    r"""(?:(?:sampl(?:e|ing)|abtast|scan)[\s_-]*(?P<word>rate|freq(?:uen[cz]y?)?|interval|period)|(?P<fs>f_?s|sampled\s+at)
    |(?P<dt>dt|delta[_ ]?[xt]))\s*(?:[\[(]\s*(?P<beside>[^\s\])]+)\s*[\])])?\s*[:=;,\t]*\s*
    (?P<number>\d[\d.,]*(?:e[+-]?\d+)?)\s*(?P<unit>[a-zµμ/]+)?(?P<rest>[^\d]*)$""",
    re.IGNORECASE | re.VERBOSE,
)
_NOT_OF_THE_ROWS = re.compile(r"decimat|divid|averag|every|max|limit|nominal", re.IGNORECASE)
_PER_S = {"hz": 1.0, "s/s": 1.0, "sps": 1.0, "samples/s": 1.0}


def rates_said(lines: list[str], marks: Marks) -> tuple[tuple[str, float], ...]:
    """Sample rates that lines above a table say [Hz], with the row: `sampling rate: 1 kHz`, `dt = 0.001 s`, `Fs 50 Hz`.

    A line has to begin with what it says, and to end with a number and its unit.
    """
    rates = []
    for row, line in enumerate(lines, start=1):
        found = _RATE.match(line.strip().lstrip("#%/ ").replace('"', "").rstrip())
        unit = (found["unit"] or found["beside"] or "").replace("μ", "µ") if found else ""
        if not found or not unit or (found["unit"] and found["beside"]) or _NOT_OF_THE_ROWS.search(line):
            continue
        amount = Marks(None, marks.decimal, "." if marks.decimal == "," else ",").value(found["number"])
        amount = Marks(None, ".").value(found["number"]) if amount is None else amount
        prefix, known = {"k": 1e3, "K": 1e3, "M": 1e6}.get(unit[0], 1.0), unit_of(unit)
        per_s = _PER_S.get(unit.lower()) or (_PER_S.get(unit[1:].lower(), 0.0) * prefix if unit[0] in "kKM" else 0.0)
        lasts = bool(found["dt"]) or (found["word"] or "").lower() in ("interval", "period")
        if amount and not lasts and per_s:
            rates.append((f"row {row}", amount * per_s))
        elif amount and lasts and known is not None and known.quantity == "time":
            rates.append((f"row {row}", 1.0 / (amount * known.factor)))
    return tuple(rates)


@dataclass(frozen=True)
class Dialect:
    """One text log's way of writing numbers."""

    encoding: str
    marks: Marks
    columns: tuple[str, ...]
    units: tuple[str, ...]
    first_line: int
    """Line of the first row of numbers, from 1."""
    stamps: tuple[int, ...] = ()
    """Columns of wall-clock stamps."""
    rates: tuple[tuple[str, float], ...] = ()
    """Sample rates that lines above the table say [Hz], and the row."""
    synthetic: str | None = None
    ragged: bool = False
    """True where every row ends with a delimiter."""


def encoding_of(head: bytes) -> str:
    """Encoding of a text by its first bytes: byte-order mark, zero bytes, else UTF-8, else Windows-1252."""
    if head.startswith(b"\xef\xbb\xbf"):
        return "utf-8-sig"
    if head.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16"
    if b"\0" in head[:4096]:
        half = len(head[:4096]) // 2
        for first, encoding in ((1, "utf-16-le"), (0, "utf-16-be")):
            if head[first : 2 * half : 2].count(0) > 0.4 * half:
                return encoding
        return ""
    try:
        head.decode("utf-8")
    except UnicodeDecodeError as fault:
        if fault.start < len(head) - 4:
            return "cp1252"
    return "utf-8"


def lines_of(head: bytes) -> list[str]:
    """The lines of a text by its first bytes; none of bytes that are no text."""
    encoding = encoding_of(head)
    if not encoding:
        return []
    text = head[: len(head) // 2 * 2 if "16" in encoding else None].decode(encoding, errors="replace")
    return text.replace("\r\n", "\n").replace("\r", "\n").split("\n")


def has_table(lines: list[str]) -> bool:
    """Whether some `ROWS` lines, one below the other, are rows of one table of numbers."""
    marks, count = _marks(_body(lines))
    rows = "".join("+" if count and _is_row(line, marks, count) else "-" for line in lines)
    return "+" * ROWS in rows


def sniff(path: str, head: bytes, whole: bool) -> Dialect:
    """Dialect of a text log by its first bytes; raises DataError where there is no table of numbers in them."""
    encoding = encoding_of(head)
    if not encoding:
        raise DataError(f"{path}: is a binary file of no format that eaid knows; export it as CSV, MAT or HDF5")
    lines = lines_of(head)
    if not whole and len(lines) > 1:
        lines.pop()
    if not any(line.strip() for line in lines):
        raise DataError(f"{path}: is empty; record the log again")
    marks, count = _marks(_body(lines))
    start = next((i for i, line in enumerate(lines) if _is_row(line, marks, count)), None) if count else None
    if start is None:
        raise DataError(
            f"{path}: holds no rows of numbers; a log is a table with a column of time and one of torque"
            if any("," not in line for line in lines if line.strip()) or len(lines) > 3
            else f"{path}: has a header but no rows; record the log again"
        )
    cells = marks.cells(lines[start], count)
    ragged = marks.delimiter is not None and lines[start].count(marks.delimiter) == count and len(cells) == count
    start -= _broken_rows(lines[:start], marks)
    _refuse_another_table(path, lines[:start], marks)
    names, units, header_lines = _header(lines[:start], marks, count, ragged)
    stamps = tuple(i for i, cell in enumerate(cells) if marks.is_stamp(cell))
    above = ["" if i in header_lines else line for i, line in enumerate(lines[:start])]
    made_by = (re.match(r"[#%/ ]+synthetic\s*[:=]\s*(\S.*)$", line, re.IGNORECASE) for line in above)
    synthetic = next((found[1].strip() for found in made_by if found), None)
    return Dialect(encoding, marks, names, units, start + 1, stamps, rates_said(above, marks), synthetic, ragged)


def _is_comment(line: str) -> bool:
    return line.lstrip().startswith(COMMENT)


def _body(lines: list[str]) -> list[str]:
    """Lines to judge the marks by: some of the later half, without comments and blank lines; all, if those are few."""
    full: list[str] = []
    later, step = lines[len(lines) // 2 :], max(1, len(lines) // 48)
    # not every so many lines: a slow channel of a log fills its cells as regularly
    for some in ([later[k + k // step % step] for k in range(0, len(later) - step, step)], lines):
        full = [line for line in some if line.strip() and not _is_comment(line)]
        if len(full) > 8:
            break
    return full


def _marks(sample: list[str]) -> tuple[Marks, int]:
    """Marks that explain most cells, and how many columns they give; no columns where nothing is explained."""
    text = "".join(sample)
    best, columns, chosen = 0.0, 0, Marks(",", ".")
    for delimiter in ("\t", ";", "|", ",", None):
        if delimiter is not None and delimiter not in text:
            continue
        for decimal, thousands in NUMBER_MARKS:
            if (delimiter in (decimal, thousands) and '"' not in text) or (delimiter is None and thousands == " "):
                continue
            if (decimal == "," and "," not in text) or (thousands and thousands not in text):
                continue
            marks = Marks(delimiter, decimal, thousands)
            score, count = _explained(sample, marks)
            if score > best * 1.0001 or (score >= best * 0.9999 and count > columns == 1):
                best, columns, chosen = score, count, marks
            if best == 1.0 and columns > 1:
                return chosen, columns
    return chosen, columns


def _explained(lines: list[str], marks: Marks) -> tuple[float, int]:
    """How much of the text the marks explain, and the number of columns they give."""
    counts: Counter[int] = Counter()
    open_ended: Counter[int] = Counter()
    numeric = 0.0
    for line in lines:
        cells = marks.cells(line)
        good, filled = marks.count_good(cells)
        if good and good >= filled / 2:
            counts[len(cells)] += 1
            open_ended[len(cells)] += marks.delimiter is not None and line.rstrip("\r\n ").endswith(marks.delimiter)
            numeric += good / len(cells)
    if not counts:
        return 0.0, 0
    columns, votes = counts.most_common(1)[0]
    if open_ended[columns] == votes and counts[columns + 1] > max(
        1, 0.03 * votes
    ):  # a last cell that is empty in most rows, not in all
        columns, votes = columns + 1, votes + counts[columns + 1]
    return numeric * votes / counts.total() / len(lines), columns


def _is_row(line: str, marks: Marks, count: int) -> bool:
    """Whether a line is a row of the table: as many cells as the body, most of them numbers."""
    if _is_comment(line):
        return False
    cells = marks.cells(line, count)
    good, filled = marks.count_good(cells)
    return len(cells) == count and good > 0 and good >= filled / 2


def _broken_rows(above: list[str], marks: Marks) -> int:
    """How many lines right above the first good row are rows of numbers too, with too many or too few cells."""
    count = 0
    for line in reversed(above):
        cells = marks.cells(line, len(line))
        good, filled = marks.count_good(cells)
        if not cells or not marks.count_good(cells[:1])[0] or good < filled / (1 if marks.delimiter is None else 2):
            break
        if len(cells) == 1 and count == len(above) - 1:
            break  # a first line that says how many rows follow
        count += 1
    return count


def _refuse_another_table(path: str, above: list[str], marks: Marks) -> None:
    """Refuse a file with rows of numbers above the table that is read: two tables, of which one would be lost."""
    rows = 0
    for i, line in enumerate(above):
        cells = marks.cells(line, len(line))
        numbers = sum(marks.value(cell) is not None for cell in cells)
        rows = rows + 1 if numbers > 1 and 2 * numbers > len(cells) and not _is_comment(line) else 0
        if rows == 3:
            raise DataError(
                f"{path}: holds two tables, one from row {i - 1} and another from row {len(above) + 1}; "
                f"save each in a file of its own"
            )


def _header(
    above: list[str], marks: Marks, count: int, ragged: bool
) -> tuple[tuple[str, ...], tuple[str, ...], set[int]]:
    """Names and units of the columns from the lines above the first row, and which lines those are.

    `ragged`: the rows end with a delimiter, and a name behind it is that of an empty column.
    """
    rows: list[tuple[int, list[str]]] = []
    for i in reversed(range(len(above))):
        bare = above[i].strip("\r\n ")
        if _is_comment(bare):
            bare = bare.lstrip("#%/ ")
        cells = [cell.strip().strip('"').strip() for cell in marks.cells(bare, count)]
        if len(cells) == count + 1 and ragged:
            cells = cells[:-1]
        if len(cells) == count and any(cells) and (count > 1 or len(rows) == 0):
            rows.append((i, cells))
        elif bare:
            break
        if len(rows) == 2:
            break
    none = ("",) * count
    if not rows:
        return none, none, set()
    i, cells = rows[0]
    if len(rows) == 2 and _is_units_row(cells) and not _is_units_row(rows[1][1]):
        units = tuple("" if cell in ("-", "") else cell.strip("[]() ") for cell in cells)
        return tuple(rows[1][1]), units, {i, rows[1][0]}
    return tuple(cells), none, {i}


def _is_units_row(cells: list[str]) -> bool:
    filled = [cell for cell in cells if cell]
    return bool(filled) and all(unit_of(cell) is not None or cell[0] in "[(" for cell in filled)


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
            if marks != self.dialect.marks and any(math.isfinite(marks.number(text)) for text in texts):
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
        parts: list[list[NDArray[Any]]] = [[] for _ in columns]
        bad: list[BadCell] = []
        rows: list[tuple[int, int]] = []
        count, seen, decimal = 0, 0, False
        with _unpacked(self.path, self.source, self.zipped) as file:
            for line, piece in _pieces(file, dialect):
                seen += len(piece)
                if seen > limit:
                    raise DataError(
                        f"{self.source}: unpacks to more than {MOST_RATIO} times its size, as no recorded log does; "
                        f"unpack it yourself"
                    )
                body = piece
                while body and body[-1] in b"\r\n \t\x00\x1a":
                    body = body[:-1]
                if not body:
                    continue
                decimal = decimal or (dialect.marks.decimal == "," and _DECIMAL.search(body) is not None)
                cells = _by_arrow(body, dialect, columns, line) or _cell_by_cell(body, dialect, columns, line)
                bad.extend(replace(one, row=one.row + count) for one in cells.bad)
                rows.extend((sample + count, row) for sample, row in cells.rows)
                count += len(cells.values[0])
                for part, values in zip(parts, cells.values, strict=True):
                    part.append(values)
                self.tell(min(1.0, seen / size))
                if len(bad) > MOST_BAD:
                    raise DataError(f"{self.source}: more than {MOST_BAD:,} of its cells are bad; record it again")
        self.tell(1.0)
        whole = [part[0] if len(part) == 1 else np.concatenate([*part, *([] if part else [[]])]) for part in parts]
        for k, column in enumerate(columns):
            if column in dialect.stamps:
                texts = [str(text) for text in whole[k]]
                whole[k], wrong = seconds_of(texts)
                bad.extend(BadCell(i, column, texts[i].strip()[:40]) for i in wrong if texts[i])
        return Cells(tuple(whole), tuple(bad), tuple(rows)), decimal


def _pieces(file: IO[bytes], dialect: Dialect) -> Iterator[tuple[int, memoryview]]:
    """Whole lines from the first row of the table on, about `PIECE_BYTES` at a time, with the number of the first.

    UTF-16 comes as UTF-8.
    """
    if dialect.encoding.startswith("utf-16"):
        file = cast(IO[bytes], codecs.EncodedFile(file, "utf-8", dialect.encoding, errors="replace"))
    rest, skip, line = b"", dialect.first_line - 1, dialect.first_line
    while block := file.read(PIECE_BYTES):
        block, begin = rest + block if rest else block, 0
        if skip:
            ends = re.finditer(rb"\r\n|\n|\r", block)
            begin, skip = next(end for i, end in enumerate(ends, start=1) if i == skip).end(), 0
        end = max(block.rfind(b"\n"), -1 if b"\n" in block else block.rfind(b"\r", 0, -1)) + 1
        if end > begin:
            yield line, memoryview(block)[begin:end]
            alone = block.count(b"\r", begin, end) - block.count(b"\r\n", begin, end)
            line += block.count(b"\n", begin, end) + alone
        rest = block[max(begin, end) :]
    if rest:
        yield line, memoryview(rest)


def _by_arrow(body: memoryview, dialect: Dialect, columns: Sequence[int], line: int) -> Cells | None:
    """The columns of a piece by Arrow's parser; None where anything in them is not a plain finite number."""
    import pyarrow as pa
    from pyarrow import csv as arrow

    marks, names = dialect.marks, [str(i) for i in range(len(dialect.columns) + dialect.ragged)]
    if marks.thousands and marks.thousands.encode() in bytes(body):
        return None
    first = marks.cells(bytes(body[:4096]).splitlines()[0].decode("latin-1"), len(dialect.columns))
    kinds = {}
    for column in columns:
        digits = first[min(column, len(first) - 1)]
        long = digits.isdigit() and len(digits) > 15  # more than a float surely holds: stamps in ns stay whole
        number = pa.int64() if long else pa.float64()
        kinds[names[column]] = pa.string() if column in dialect.stamps else number
    if marks.delimiter is None:  # cells stand apart by one blank each
        body = memoryview(b"\n".join(b" ".join(row.split()) for row in bytes(body).splitlines()))
    try:
        table = arrow.read_csv(
            pa.BufferReader(pa.py_buffer(body)),
            arrow.ReadOptions(use_threads=False, block_size=len(body) + 1, column_names=names),
            arrow.ParseOptions(delimiter=marks.delimiter or " ", ignore_empty_lines=False),
            arrow.ConvertOptions(
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
    return Cells(tuple(values), rows=((0, line),))


def _cell_by_cell(body: memoryview, dialect: Dialect, columns: Sequence[int], line: int) -> Cells:
    """The columns of a piece cell by cell, every bad cell listed; comment and blank lines are passed over.

    Stamps stay texts: what they mean depends on those before them.
    """
    encoding = "cp1252" if dialect.encoding == "cp1252" else "utf-8"
    count, length = len(dialect.columns), 0
    values: list[list[Any]] = [[] for _ in columns]
    rows: list[tuple[int, int]] = []
    bad: list[BadCell] = []
    for row, raw in enumerate(re.split(rb"\r\n|\n|\r", body), start=line):
        text = raw.decode(encoding, errors="replace").strip("\r\n \x00\x1a")
        if not text or text.startswith(COMMENT):
            continue
        if not rows or row - length != rows[-1][1] - rows[-1][0]:
            rows.append((length, row))
        cells = dialect.marks.cells(text, count)
        whole = len(cells) == count
        if not whole:
            bad.append(BadCell(length, -1, str(len(cells))))
        for k, column in enumerate(columns):
            if column in dialect.stamps:
                values[k].append(cells[column] if whole else "")
                continue
            value = dialect.marks.number(cells[column]) if whole else math.nan
            if whole and not math.isfinite(value):
                bad.append(BadCell(length, column, cells[column].strip()[:40]))
                value = math.nan
            values[k].append(value)
        length += 1
    kinds = [object if column in dialect.stamps else np.float64 for column in columns]
    arrays = (np.array(one, dtype=kind) for one, kind in zip(values, kinds, strict=True))
    return Cells(tuple(arrays), tuple(bad), tuple(rows))


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
