"""How a text log is written: encoding, marks of its cells and numbers, header, units row, facts in comment lines."""

import contextlib
import csv
import re
from collections import Counter
from dataclasses import dataclass, field
from typing import NamedTuple

from eaid.errors import DataError
from eaid.logs.units import unit_of

COMMENT = ("#", "%", "//")
_PLAIN = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eEdD][+-]?\d+)?$")
_WORDS = re.compile(r"[+-]?(nan|inf(inity)?|na|n/a|null|none|-)$", re.IGNORECASE)
_STAMP = re.compile(
    r"(\d{1,4}[-/.]\d{1,2}[-/.]\d{1,4}[T ]+)?\d{1,2}:\d{2}(:\d{2}([.,]\d+)?)?\s*(Z|[+-]\d{2}:?\d{2}|AM|PM)?$"
)
NUMBER_MARKS = ((".", ""), (",", ""), (".", ","), (",", "."), (".", "'"), (".", " "), (",", " "))
"""Decimal mark, and the mark between thousands."""


def number(text: str, decimal: str, thousands: str) -> float | None:
    """Value of a cell, correctly rounded; None where it is no number."""
    if decimal == "." and not thousands and "_" not in text:
        with contextlib.suppress(ValueError):
            return float(text)
    text = text.strip().strip('"').strip()
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
        return float("inf") if "inf" in text.lower() else float("nan")
    return None


class Marks(NamedTuple):
    """What stands between the cells of a row, and inside its numbers."""

    delimiter: str | None
    """None: any white space."""
    decimal: str
    thousands: str
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
        """Value of a cell; None where it is no number."""
        return number(cell, self.decimal, self.thousands)

    def is_stamp(self, cell: str) -> bool:
        """True for a wall-clock stamp."""
        return self.value(cell) is None and bool(_STAMP.match(cell.strip().strip('"')))

    def count_good(self, cells: list[str]) -> tuple[int, int]:
        """How many cells are numbers or stamps, and how many are not empty."""
        good = sum(self.value(cell) is not None or self.is_stamp(cell) for cell in cells)
        return good, sum(bool(cell.strip()) for cell in cells)


def facts_of(lines: list[str], delimiter: str | None) -> dict[str, str]:
    """Facts in the lines above the table: `key: value`, `key = value`, `key<delimiter>value`."""
    said = {}
    for line in lines:
        bare = line.strip().lstrip("#%/ ").strip()
        found = re.match(r"([^:=]{1,60}?)\s*[:=]\s*(\S.*)$", bare)
        if not found and delimiter and bare.count(delimiter):
            found = re.match(
                rf"([^{re.escape(delimiter)}]{{1,60}}){re.escape(delimiter)}+([^{re.escape(delimiter)}]+)", bare
            )
        if found:
            said[found.group(1).strip().lower()] = found.group(2).strip().strip('"')
        elif bare and line.lstrip().startswith(COMMENT):
            said[""] = f"{said.get('', '')} {bare}".strip()
    return said


def rate_said(said: dict[str, str]) -> float | None:
    """Sample rate told in a comment [Hz]: `sampling rate: 1 kHz`, `dt = 0.001 s`, `sampled at 500 Hz`; else None."""
    for key, value in said.items():
        free = re.search(r"([\d.,]+(?:[eE][+-]?\d+)?)\s*(k|m)?(hz|s/s|sps|samples)\b", value, re.IGNORECASE)
        if not key and free and re.search(r"sampl|abtast|rate|fs\b|daq|acqui", value, re.IGNORECASE):
            amount = number(free.group(1).replace(",", "."), ".", "")
            if amount and amount > 0:
                return amount * {"k": 1e3, "m": 1e6}.get((free.group(2) or "").lower(), 1.0)
        found = re.match(r"([\d.,]+(?:[eE][+-]?\d+)?)\s*([a-zA-Zµμ/]*)", value)
        amount = number(found.group(1).replace(",", "."), ".", "") if found else None
        if not found or not amount or amount <= 0:
            continue
        unit = found.group(2) or "".join(re.findall(r"[\[(]\s*([a-zA-Zµμ]+)\s*[\])]", key))
        if re.search(r"(sampl|abtast|acquisition|scan).*(rate|freq|hz)|^(fs|f_s|rate|frequency)\b", key):
            factor = {"khz": 1e3, "mhz": 1e6}.get(unit.lower(), 1.0)
            return amount * factor
        if re.search(r"(sampl|scan).*(time|interval|period|step)|^(dt|delta[_ ]?[xt])\b", key):
            known = unit_of(unit) if unit else None
            return 1.0 / (amount * (known.factor if known and known.quantity == "time" else 1.0))
    return None


_DELIMITERS = ("\t", ";", "|", ",", None)
ROWS = 3
"""Rows of numbers, one below the other, that make a table."""


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
    said: dict[str, str] = field(default_factory=dict)
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
    said = facts_of([line for i, line in enumerate(lines[:start]) if i not in header_lines], marks.delimiter)
    return Dialect(encoding, marks, names, units, start + 1, stamps, said, ragged)


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
    best, columns, chosen = 0.0, 0, Marks(",", ".", "")
    for delimiter in _DELIMITERS:
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
    numeric = 0.0
    for line in lines:
        cells = marks.cells(line)
        good, filled = marks.count_good(cells)
        if good and good >= filled / 2:
            counts[len(cells)] += 1
            numeric += good / len(cells)
    if not counts:
        return 0.0, 0
    columns, votes = counts.most_common(1)[0]
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
