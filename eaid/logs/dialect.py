"""How a text log is written: encoding, marks of its cells and numbers, header, units row, facts in comment lines."""

import contextlib
import csv
import re
from collections import Counter
from dataclasses import dataclass
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


_RATE = re.compile(
    r"""(?:(?:sampl(?:e|ing)|abtast|scan)[\s_-]*(?P<word>rate|freq(?:uen[cz]y?)?|interval|period)|(?P<fs>f_?s|sampled\s+at)
    |(?P<dt>dt|delta[_ ]?[xt]))\s*(?:[\[(]\s*(?P<beside>[^\s\])]+)\s*[\])])?\s*[:=;,\t]*\s*
    (?P<number>\d[\d.,]*(?:e[+-]?\d+)?)\s*(?P<unit>[a-zµμ/]+)?(?P<rest>[^\d]*)$""",
    re.IGNORECASE | re.VERBOSE,
)
_NOT_OF_THE_ROWS = re.compile(r"decimat|divid|averag|every|max|limit|nominal", re.IGNORECASE)
_PER_S = {"hz": 1.0, "s/s": 1.0, "sps": 1.0, "samples/s": 1.0}


def rates_said(lines: list[str], marks: "Marks") -> tuple[tuple[str, float], ...]:
    """Sample rates that lines above a table say [Hz], with the row: `sampling rate: 1 kHz`, `dt = 0.001 s`, `Fs 50 Hz`.

    A line has to begin with what it says, and to end with a number and its unit.
    """
    rates = []
    for row, line in enumerate(lines, start=1):
        found = _RATE.match(line.strip().lstrip("#%/ ").replace('"', "").rstrip())
        unit = (found["unit"] or found["beside"] or "").replace("μ", "µ") if found else ""
        if not found or not unit or (found["unit"] and found["beside"]) or _NOT_OF_THE_ROWS.search(line):
            continue
        amount = number(found["number"], marks.decimal, "." if marks.decimal == "," else ",")
        amount = number(found["number"], ".", "") if amount is None else amount
        prefix, known = {"k": 1e3, "K": 1e3, "M": 1e6}.get(unit[0], 1.0), unit_of(unit)
        per_s = _PER_S.get(unit.lower()) or (_PER_S.get(unit[1:].lower(), 0.0) * prefix if unit[0] in "kKM" else 0.0)
        lasts = bool(found["dt"]) or (found["word"] or "").lower() in ("interval", "period")
        if amount and not lasts and per_s:
            rates.append((f"row {row}", amount * per_s))
        elif amount and lasts and known is not None and known.quantity == "time":
            rates.append((f"row {row}", 1.0 / (amount * known.factor)))
    return tuple(rates)


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
