"""Text logs: CSV in its many dialects, plain or gzipped: encoding, marks, header, units row, comment lines.

They are read piece by piece, by pandas' parser where every cell is a plain finite number, else cell by cell. Wall-clock
stamps (`2024-10-29 16:18:17.123`, `16:18:17,5`) become seconds; an offset from UTC counts. LabVIEW's measurement files
(.lvm) say their dialect in their header.
"""

import contextlib
import csv
import gzip
import io
import math
import re
import zlib
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import IO, Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from eaid.errors import DataError
from eaid.logs.clocks import CLOCK_STAMP, seconds_of
from eaid.logs.table import BadCell, Cells, LogTable, with_times
from eaid.logs.units import unit_of
from eaid.shown import pandas

# A comma that is a decimal mark and cannot be one between thousands
_DECIMAL = re.compile(r"(?<![\d.,])0+,\d|\d,\d{1,2}(?!\d)|\d,\d{4}")
_LABEL = re.compile(r"^([A-Za-z_]\w*)\s*[:=]\s*(?=[-+.\d])")
_WITH_UNIT = re.compile(r"^\s*[-+]?\d+([.,]\d+)?\s?(%|[A-Za-zµ°Ω][\w·*/²]{0,5})\s*$")
COMMENT = ("#", "%", "//")
TABLE_ROWS = 3  # Rows of numbers, one below the other, that make a table
HEAD_BYTES = 1 << 15
PIECE = 1 << 22  # Characters that are read at once
# A gzip that unpacks to more than this many times its size is taken for a bomb (recorded logs: about 10)
MOST_UNPACKED_RATIO = 200
LONGEST_UNIT = 6  # Letters of a unit that eaid does not know: °C, mV/V, counts
MOST_BAD = 10_000  # Bad cells that are listed; a log with more is refused whatever they are


class Marks(NamedTuple):
    """What stands between the cells of a row, and before the decimals of its numbers."""

    delimiter: str | None  # None: any white space
    decimal: str
    labelled: bool = False  # pwm:128, as serial plotters want it

    def cells(self, line: str, count: int = 0) -> list[str]:
        """Cells of a line; quotes keep a delimiter inside a cell.

        A delimiter at the end of the line begins no cell; where `count` are wanted, only if it would be one too many.
        """
        bare = self.parted(line.strip("\r\n "))
        if self.delimiter is None:
            return bare.strip("[]; ").split()  # [1 2 3; as MATLAB writes a matrix
        cells = bare.split(self.delimiter)
        if '"' in bare and len(cells) > 1:
            with contextlib.suppress(csv.Error):  # a return in the middle of a line
                cells = next(csv.reader([bare], delimiter=self.delimiter))
        if not cells[-1].strip() and count in (0, len(cells) - 1):
            cells.pop()
        return cells

    def parted(self, text: str) -> str:
        """A text in which the arrow behind each stamp of a serial monitor, `12:00:01.250 -> 4,1.5`, is a delimiter."""
        return text.replace(" -> ", self.delimiter or " ")

    def value(self, cell: str) -> float | None:
        """Value of a cell, correctly rounded; None where it is no number."""
        text = cell.strip().strip('"').strip().removesuffix(" sec")  # MATLAB's durations
        text = _LABEL.sub("", text) if self.labelled else text
        if self.decimal == ",":
            text = text.replace(".", "no mark").replace(",", ".")
        if "_" not in text:  # which Python passes over
            with contextlib.suppress(ValueError):
                return float(text)
        return None

    def is_good(self, cell: str) -> bool:
        """True for a number and for a wall-clock stamp."""
        return self.value(cell) is not None or CLOCK_STAMP.match(cell.strip().strip('"')) is not None

    def count_good(self, cells: list[str]) -> tuple[int, int]:
        """How many cells are numbers or stamps, and how many are not empty."""
        return sum(map(self.is_good, cells)), sum(bool(cell.strip()) for cell in cells)

    def is_row(self, line: str, count: int) -> bool:
        """Whether a line is a row of a table of so many columns, most of them numbers."""
        cells = [] if line.lstrip().startswith(COMMENT) else self.cells(line, count)
        good, filled = self.count_good(cells)
        return len(cells) == count and good > 0 and good >= filled / 2


@dataclass(frozen=True)
class Dialect:
    """One text log's way of writing numbers."""

    encoding: str
    marks: Marks
    count: int  # Columns
    first_line: int  # Line of the first row of numbers, from 1
    stamps: tuple[int, ...] = ()  # Columns of wall-clock stamps
    remarks: bool = False  # True where a row may have a remark behind its cells


Reading = Callable[[Dialect, Sequence[int]], Cells]  # Reads some columns of a text in its dialect


def encoding_of(head: bytes) -> str:
    """Encoding of a text by its first bytes: byte-order mark, else UTF-8, else Windows-1252; empty of no text."""
    if head.startswith(b"\xef\xbb\xbf"):
        return "utf-8-sig"
    if head.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16"
    if b"\0" in head[:4096]:
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
    return io.StringIO(text, newline=None).read().split("\n")


def has_table(lines: list[str]) -> bool:
    """Whether some `TABLE_ROWS` lines, one below the other, are rows of one table of numbers."""
    marks, count = _marks(lines)
    rows = "".join("+" if count and marks.is_row(line, count) else "-" for line in lines)
    return "+" * TABLE_ROWS in rows


def sniff(path: str, head: bytes, read: Reading) -> LogTable:
    """The table of a text log by its first bytes; raises DataError where there is no table of numbers in them."""
    encoding, lines = encoding_of(head), lines_of(head)
    if not encoding:
        raise DataError(f"{path}: is a binary file of no format that eaid knows; export it as CSV, MAT or HDF5")
    if not any(line.strip() for line in lines):
        raise DataError(f"{path}: is empty; record the log again")
    if b"LabVIEW Measurement" in head[:64]:
        return _of_labview(path, encoding, lines, read)
    if len(head) == HEAD_BYTES and len(lines) > 1:
        lines.pop()
    marks, count = _marks(lines)
    start = next((i for i, line in enumerate(lines) if count and marks.is_row(line, count)), None)
    if start is not None and _is_words(lines[start + 1 :], marks) and not marks.is_good(marks.cells(lines[start])[0]):
        start = next((i for i in range(start + 1, len(lines)) if marks.is_row(lines[i], count)), None)  # x-axis,1,2
    if start is None:
        united = next((cell for line in lines for cell in re.split("[,;\t|]", line) if _WITH_UNIT.match(cell)), None)
        if united is not None:
            raise DataError(
                f"{path}: holds units beside its numbers, as {united.strip()!r}; save the numbers alone, and name "
                "their units in the header or with «units»"
            )
        raise DataError(
            f"{path}: holds no rows of numbers; a log is a table with a column of time and one of what was measured"
        )
    first_cells = marks.cells(lines[start], count)
    ragged = marks.delimiter is not None and lines[start].count(marks.delimiter) == count == len(first_cells)
    start -= _broken_rows(lines[:start], marks)
    rows = 0  # of numbers above the table that is read: another table, which would be lost
    for i, line in enumerate(lines[:start]):
        cells = marks.cells(line, len(line))
        numbers = sum(marks.value(cell) is not None for cell in cells)
        rows = rows + 1 if numbers > 1 and 2 * numbers > len(cells) and not line.lstrip().startswith(COMMENT) else 0
        if rows == TABLE_ROWS:
            raise DataError(
                f"{path}: holds two tables, one from row {i - 1} and another from row {start + 1}; "
                f"save each in a file of its own"
            )
    names, units, unmatched = _header(lines[:start], marks, count, ragged)
    if marks.labelled:
        names = tuple(label[1] if (label := _LABEL.match(cell.strip())) else "" for cell in first_cells)
    stamps = tuple(i for i, cell in enumerate(first_cells) if marks.value(cell) is None and marks.is_good(cell))
    made_by = (re.match(r"[#%/ ]+synthetic\s*[:=]\s*(\S.*)$", line, re.IGNORECASE) for line in lines[:start])
    synthetic = next((match[1].strip() for match in made_by if match), None)
    units = tuple("s" if i in stamps else unit for i, unit in enumerate(units))
    load = partial(read, Dialect(encoding, marks, count, start + 1, stamps))
    return LogTable("", names, load, units, synthetic, stamped=stamps, unmatched=unmatched)


def _of_labview(path: str, encoding: str, lines: list[str], read: Reading) -> LogTable:
    """The table of a LabVIEW measurement file, as its header says it; without times its first column is empty, and all
    channels have a step from row to row."""
    separator = "," if any(line.startswith("Separator,") for line in lines) else "\t"
    rows = [line.rstrip().split(separator) for line in lines]
    at = next((i for i, row in enumerate(rows) if row[0] == "X_Value"), 0)
    header = {row[0]: row[1:] for row in rows[:at]}
    names = [name for name in rows[at] if name not in ("", "Comment")]
    if len(names) < 2 or header.get("X_Columns") == ["Multi"] or {*header.get("X_Dimension", ())} - {"Time", ""}:
        raise DataError(
            f"{path}: is a LabVIEW file without one column of times for all channels; export it as TDMS, or as CSV"
        )
    marks = Marks(separator, *header.get("Decimal_Separator", "."))
    units = ["s", *header.get("Y_Unit_Label", ()), *[""] * len(names)][: len(names)]
    dialect = Dialect(encoding, marks, len(names), at + 2, remarks="Comment" in rows[at])
    load = partial(read, dialect)
    if header.get("X_Columns") == ["No"]:
        clocks = {*zip(*(map(marks.value, header.get(key, ())) for key in ("X0", "Delta_X")), strict=False)}
        if len(clocks) == 1 and None not in (clock := clocks.pop()) and clock[1] > 0:
            load = partial(with_times, load, *clock)
        else:
            names[0], units[0] = "", ""
    return LogTable("", tuple(names), load, tuple(units))


def _marks(lines: list[str], labelled: bool = False) -> tuple[Marks, int]:
    """Marks that explain most cells, and how many columns they give; no columns where nothing is explained.

    Judged by some lines of the later half, without comments and blank lines; by all, if those are few.
    """
    sample: list[str] = []
    later, step = lines[len(lines) // 2 :], max(1, len(lines) // 48)
    # not every so many lines: a slow channel of a log fills its cells as regularly
    for some in ([later[k + k // step % step] for k in range(0, len(later) - step, step)], lines):
        sample = [line for line in some if line.strip() and not line.lstrip().startswith(COMMENT)]
        if len(sample) > 8:
            break
    text = "".join(sample)
    best, columns, chosen = 0.0, 0, Marks(",", ".")
    for delimiter in ("\t", ";", "|", ",", None):
        for decimal in ".,":
            if (delimiter or "") not in text or decimal not in text + "." or (delimiter == decimal and '"' not in text):
                continue
            marks = Marks(delimiter, decimal, labelled)
            score, count = _explained(sample, marks)
            if score > best * 1.0001 or (score >= best * 0.9999 and count > columns == 1):
                best, columns, chosen = score, count, marks
            if best == 1.0 and columns > 1:
                return chosen, columns
    return (chosen, columns) if columns or labelled else _marks(lines, labelled=True)


def _explained(lines: list[str], marks: Marks) -> tuple[float, int]:
    """How much of the text the marks explain, and the number of columns they give."""
    counts: Counter[int] = Counter()
    ends: Counter[int] = Counter()
    numeric = 0.0
    for line in lines:
        cells = marks.cells(line)
        good, filled = marks.count_good(cells)
        if good and good >= filled / 2:
            counts[len(cells)] += 1
            ends[len(cells)] += marks.delimiter is not None and line.rstrip("\r\n ").endswith(marks.delimiter)
            numeric += good / len(cells)
    if not counts:
        return 0.0, 0
    columns, votes = counts.most_common(1)[0]
    if ends[columns] == votes and counts[columns + 1] > max(1, 0.03 * votes):  # a last cell empty in most rows, not all
        columns, votes = columns + 1, votes + counts[columns + 1]
    return numeric * votes / counts.total() / len(lines), columns


def _broken_rows(above: list[str], marks: Marks) -> int:
    """How many lines right above the first good row are rows of numbers too, with too many or too few cells."""
    count = 0
    for at, line in reversed([*enumerate(above)]):
        cells = marks.cells(line, len(line))
        good, filled = marks.count_good(cells)
        if not cells or not marks.is_good(cells[0]):
            break
        torn = '"' in line and _is_words(above[max(at - 1, 0) : at], marks)  # a lone quote joins what follows it
        if good < (filled if marks.delimiter is None else min(2, filled / 2)) and not torn:
            break
        if len(cells) == 1 and count == len(above) - 1:
            break  # a first line that says how many rows follow
        count += 1
    return count


def _is_words(below: list[str], marks: Marks) -> bool:
    """Whether the next line with cells holds words only."""
    good, filled = next((found for line in below if (found := marks.count_good(marks.cells(line)))[1]), (1, 1))
    return good == 0 and filled > 1


def _names(line: str, marks: Marks, count: int) -> list[str]:
    """The cells of a line above the rows; where blanks stand between cells, names of several words have two."""
    bare = line.strip("\r\n ")
    if bare.startswith(COMMENT):
        bare = bare.lstrip("#%/ ")
    cells = marks.cells(bare, count) if marks.delimiter else re.split(r"\s{2,}|\t", bare)
    if marks.delimiter is None and len(cells) != count:
        cells = bare.split()
    return [cell.strip().strip('"').strip() for cell in cells]


def _header(above: list[str], marks: Marks, count: int, ragged: bool) -> tuple[tuple[str, ...], ...]:
    """Names and units of the columns from the lines above the first row, and names that are not as many as those.

    `ragged` rows end with a delimiter.
    """
    rows: list[list[str]] = []
    unmatched: tuple[str, ...] = ()
    for line in reversed(above):
        cells = _names(line, marks, count)
        if len(cells) == count + 1 and ragged:
            cells = cells[:-1]  # the name of an empty column
        if len(cells) == count and any(cells) and (count > 1 or not rows):
            rows.append([f"channel {cell}" if cell.isdigit() and rows else cell for cell in cells])
        elif any(cells):
            if not rows and len(cells) > 2 and marks.delimiter and not marks.count_good(cells)[0]:
                unmatched = tuple(cells)
            break
        if len(rows) == 2:
            break
    none = ("",) * count
    if not rows:
        return none, none, unmatched
    if len(rows) == 2 and _is_units_row(rows[0]) and not _is_units_row(rows[1]):
        units = tuple("" if cell == "-" else cell.strip("[]() ") for cell in rows[0])
        return tuple(rows[1]), units, ()
    return tuple(rows[0]), none, ()


def _is_units_row(cells: list[str]) -> bool:
    """Whether most cells are units that eaid knows, or stand in brackets, and the others are as short as units are."""
    known = [bool(unit_of(cell).quantity) or cell[0] in "[(" for cell in cells if cell]
    short = all(len(cell) <= LONGEST_UNIT for cell in cells if not unit_of(cell).quantity)
    return 2 * sum(known) > len(known) and (short or all(known))


def read_text(path: Path, source: str) -> LogTable:
    """The one table of a text log; raises DataError where it holds none."""
    with path.open("rb") as raw:
        zipped = raw.read(2) == b"\x1f\x8b"
    with _unpacked(path, source, zipped) as file:
        head = file.read(HEAD_BYTES)
    if zipped and not encoding_of(head):
        raise DataError(f"{source}: is gzip around a file that is no text; unpack it and give what is inside")
    return replace(sniff(source, head, partial(_load, path, source, zipped)), source=source)


@contextlib.contextmanager
def _unpacked(path: Path, source: str, zipped: bool) -> Iterator[IO[bytes]]:
    """A file's bytes, unpacked; raises DataError where the gzip is damaged."""
    try:
        with cast(IO[bytes], gzip.open(path, "rb")) if zipped else path.open("rb") as file:
            yield file
    except (EOFError, zlib.error, gzip.BadGzipFile) as fault:
        reason = re.sub(r"\s+", " ", str(fault)).strip().rstrip(".")
        raise DataError(f"{source}: is no whole gzip file ({reason}); copy it again") from None


def _load(path: Path, source: str, zipped: bool, dialect: Dialect, columns: Sequence[int]) -> Cells:
    """Columns of a text log; raises DataError where its commas may be decimal marks or stand between thousands."""
    limit = max(MOST_UNPACKED_RATIO * path.stat().st_size, 1 << 22) if zipped else math.inf
    parts: list[list[NDArray[Any]]] = [[] for _ in columns]
    bad: list[BadCell] = []
    rows: list[tuple[int, int]] = []
    count, seen, decimal, line = 0, 0, False, dialect.first_line
    with _unpacked(path, source, zipped) as file, io.TextIOWrapper(file, dialect.encoding, errors="replace") as text:
        for _ in range(dialect.first_line - 1):
            text.readline()
        while piece := text.read(PIECE) + text.readline():
            seen += len(piece)
            if seen > limit:
                raise DataError(
                    f"{source}: unpacks to more than {MOST_UNPACKED_RATIO} times its size, as no recorded log does; "
                    f"unpack it yourself"
                )
            first, line = line, line + piece.count("\n")
            if not (body := piece.rstrip("\n \t\0\x1a];" if dialect.marks.delimiter is None else "\n \t\0\x1a")):
                continue
            if dialect.marks.decimal == "," and not decimal:
                quoted = " ".join(re.findall(r'"[^"]*"', body)) if dialect.marks.delimiter == "," else body
                decimal = _DECIMAL.search(quoted) is not None
            body = dialect.marks.parted(body)
            cells = at_once(body, dialect, columns, first) or cell_by_cell(body, dialect, columns, first)
            bad.extend(replace(one, row=one.row + count) for one in cells.bad)
            rows.extend((sample + count, row) for sample, row in cells.rows)
            count += len(cells.values[0])
            for part, values in zip(parts, cells.values, strict=True):
                part.append(values)
            if len(bad) > MOST_BAD:
                raise DataError(f"{source}: more than {MOST_BAD:,} of its cells are bad; record it again")
    whole = [np.concatenate(part) if part else np.empty(0) for part in parts]
    for k, column in enumerate(columns):
        if column in dialect.stamps:
            texts = [str(text) for text in whole[k]]
            whole[k] = seconds_of(texts)
            wrong = np.flatnonzero(np.isnan(whole[k])).tolist()
            bad.extend(BadCell(i, column, texts[i].strip()[:40]) for i in wrong if texts[i])
    if dialect.marks.decimal == "," and not decimal:
        raise DataError(
            f"{source}: its commas may be decimal marks or stand between thousands, as three digits follow "
            f"every one; save it with decimal points"
        )
    return Cells(tuple(whole), tuple(bad), tuple(rows))


# A number with a plus before and blanks behind it, of which pandas loses the last digit
_SIGNED = re.compile(r"\+[\d.]\S*[ \t]")


def at_once(body: str, dialect: Dialect, columns: Sequence[int], line: int) -> Cells | None:
    """The columns of a piece by pandas' parser; None where anything in them is not a plain finite number, or a row is
    longer or shorter than the first."""
    if not set(columns).isdisjoint(dialect.stamps):
        return None
    marks = dialect.marks
    if marks.delimiter is None:  # cells stand apart by one blank each
        body = "\n".join(" ".join(row.strip("[]; \r").split()) for row in body.split("\n"))
    between = marks.delimiter or " "
    first = body.partition("\n")[0].split(between)
    data = f"{body}\n".encode()
    signs = np.frombuffer(data, dtype=np.uint8)
    between_cells = (signs == ord(between)) | (signs == ord("\n"))
    ends = signs[between_cells] == ord("\n")  # of cells: which end a row
    quoted = '"' in body and (np.cumsum(signs == ord('"'))[between_cells] % 2).any()  # what parts no cells
    even = len(first) >= dialect.count and ends.sum() * len(first) == len(ends)
    signed = between not in " \t" and "+" in body and _SIGNED.search(body) is not None
    if quoted or signed or not even or not ends[len(first) - 1 :: len(first)].all():
        return None
    # more than a float surely holds: stamps in ns stay whole
    kinds = {i: np.int64 if len(one := first[i].strip('" ')) > 15 and one.isdigit() else np.float64 for i in columns}
    try:
        table = pandas.read_csv(
            io.BytesIO(data), sep=between, decimal=marks.decimal, header=None, usecols=list(kinds), dtype=kinds,
            na_filter=False, skip_blank_lines=False, low_memory=False,
        )  # fmt: skip
    except (ValueError, OverflowError):
        return None
    values = tuple(table[column].to_numpy() for column in columns)
    return Cells(values, rows=((0, line),)) if all(np.isfinite(one).all() for one in values) else None


def cell_by_cell(body: str, dialect: Dialect, columns: Sequence[int], line: int) -> Cells:
    """The columns of a piece cell by cell, every bad cell listed; comment and blank lines are passed over.

    Stamps stay texts: what they mean depends on those before them.
    """
    count, length = dialect.count, 0
    values: list[list[Any]] = [[] for _ in columns]
    rows: list[tuple[int, int]] = []
    bad: list[BadCell] = []
    for row, raw in enumerate(body.split("\n"), start=line):
        text = raw.strip(" \0\x1a")
        if not text.strip("[];") or text.startswith(COMMENT):
            continue
        if not rows or row - length != rows[-1][1] - rows[-1][0]:
            rows.append((length, row))
        cells = dialect.marks.cells(text, count)[: count if dialect.remarks else None]
        whole = len(cells) == count
        if not whole:
            bad.append(BadCell(length, -1, str(len(cells))))
        for k, column in enumerate(columns):
            if column in dialect.stamps:
                values[k].append(cells[column] if whole else "")
                continue
            value = dialect.marks.value(cells[column]) if whole else None
            if whole and (value is None or not math.isfinite(value)):
                bad.append(BadCell(length, column, cells[column].strip()[:40]))
                value = None
            values[k].append(math.nan if value is None else value)
        length += 1
    kinds = [object if column in dialect.stamps else np.float64 for column in columns]
    arrays = (np.array(one, dtype=kind) for one, kind in zip(values, kinds, strict=True))
    return Cells(tuple(arrays), tuple(bad), tuple(rows))
