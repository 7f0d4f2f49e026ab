"""How a text log is written: encoding, delimiter, decimal mark, header, units row, facts in comment lines."""

import re
from collections import Counter
from dataclasses import dataclass, field

from eaid.errors import DataError
from eaid.logs.facts import COMMENT, facts_of, number
from eaid.logs.units import unit_of

_DELIMITERS = ("\t", ";", "|", ",", None)  # None: any white space
MARKS = ((".", ""), (",", ""), (".", ","), (",", "."), (".", "'"), (".", " "), (",", " "))

STAMP = re.compile(
    r"(\d{1,4}[-/.]\d{1,2}[-/.]\d{1,4}[T ]+)?\d{1,2}:\d{2}(:\d{2}([.,]\d+)?)?\s*(Z|[+-]\d{2}:?\d{2}|AM|PM)?$"
)


@dataclass(frozen=True)
class Dialect:
    """One text log's way of writing numbers."""

    encoding: str
    delimiter: str | None
    """None: any white space."""
    decimal: str
    thousands: str
    """Mark between thousands; empty where there is none."""
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
        pairs = head[: 4096 // 2 * 2]
        if pairs[1::2].count(0) > 0.4 * len(pairs[1::2]):
            return "utf-16-le"
        if pairs[0::2].count(0) > 0.4 * len(pairs[0::2]):
            return "utf-16-be"
        return ""
    try:
        head.decode("utf-8")
    except UnicodeDecodeError as fault:
        if fault.start < len(head) - 4:
            return "cp1252"
    return "utf-8"


def split(line: str, delimiter: str | None) -> list[str]:
    """Cells of a line; a delimiter inside quotes does not part cells."""
    if delimiter is None:
        return line.split()
    cells = line.split(delimiter)
    if '"' in line and len(cells) > 1:
        import csv

        try:
            cells = next(csv.reader([line], delimiter=delimiter))
        except csv.Error:  # a return in the middle of a line
            return line.split(delimiter)
    return cells


def _is_cell(text: str, decimal: str, thousands: str) -> bool:
    return number(text, decimal, thousands) is not None or bool(STAMP.match(text.strip().strip('"')))


def _fit(lines: list[str], delimiter: str | None, decimal: str, thousands: str) -> tuple[float, int]:
    """How much of the text these marks explain, and the number of columns they give."""
    counts: Counter[int] = Counter()
    numeric = 0.0
    for line in lines:
        cells = split(line.strip("\r\n "), delimiter)
        if cells and not cells[-1].strip():
            cells = cells[:-1]
        good = sum(_is_cell(cell, decimal, thousands) for cell in cells)
        if good and good >= len([cell for cell in cells if cell.strip()]) / 2:
            counts[len(cells)] += 1
            numeric += good / len(cells)
    if not counts:
        return 0.0, 0
    columns, votes = counts.most_common(1)[0]
    return numeric * votes / sum(counts.values()) / len(lines), columns


def _marks(sample: list[str]) -> tuple[tuple[str | None, str, str], int]:
    """Delimiter, decimal and thousands marks that explain most cells, and how many columns they give."""
    text = "".join(sample)
    best, columns = 0.0, 0
    chosen: tuple[str | None, str, str] = (",", ".", "")
    for delimiter in _DELIMITERS:
        if delimiter is not None and delimiter not in text:
            continue
        for decimal, thousands in MARKS:
            if (delimiter in (decimal, thousands) and '"' not in text) or (delimiter is None and thousands == " "):
                continue
            if (decimal == "," and "," not in text) or (thousands and thousands not in text):
                continue
            score, count = _fit(sample, delimiter, decimal, thousands)
            if score > best * 1.0001 or (score >= best * 0.9999 and count > columns == 1):
                best, columns, chosen = score, count, (delimiter, decimal, thousands)
            if best == 1.0 and columns > 1:
                return chosen, columns
    return chosen, columns


def _body(lines: list[str]) -> list[str]:
    """Lines to judge the marks by: the later half of the head, without comments and blank lines."""
    later = lines[len(lines) // 2 :] if len(lines) > 200 else lines
    some = later[:: max(1, len(later) // 100)]
    full = [line for line in some if line.strip() and not line.lstrip().startswith(COMMENT)]
    if len(full) <= 8:
        full = [line for line in lines if line.strip() and not line.lstrip().startswith(COMMENT)]
    if len(full) <= 8:
        return full
    rest = full[len(full) // 2 :]
    return rest[:: max(1, len(rest) // 50)]


def sniff(path: str, head: bytes, whole: bool) -> Dialect:
    """Dialect of a text log by its first bytes; raises DataError where there is no table of numbers in them."""
    encoding = encoding_of(head)
    if not encoding:
        raise DataError(f"{path}: is a binary file of no format that eaid knows; export it as CSV, MAT or HDF5")
    text = head[: len(head) // 2 * 2 if "16" in encoding else None].decode(encoding, errors="replace")
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    if not whole and len(lines) > 1:
        lines.pop()
    if not any(line.strip() for line in lines):
        raise DataError(f"{path}: is empty; record the log again")
    (delimiter, decimal, thousands), count = _marks(_body(lines))
    start = _first_row(lines, delimiter, decimal, thousands, count) if count else None
    if start is None:
        raise DataError(
            f"{path}: holds no rows of numbers; a log is a table with a column of time and one of torque"
            if any(len(split(line, ",")) < 2 for line in lines if line.strip()) or len(lines) > 3
            else f"{path}: has a header but no rows; record the log again"
        )
    cells = split(lines[start].strip("\r\n "), delimiter)
    ragged = len(cells) == count + 1 and not cells[-1].strip()
    start -= _broken_rows(lines[:start], delimiter, decimal, thousands)
    _refuse_another_table(path, lines[:start], delimiter, decimal, thousands)
    names, units, header_lines = _header(lines[:start], delimiter, count, ragged)
    stamps = tuple(
        i
        for i, cell in enumerate(cells[:count])
        if number(cell, decimal, thousands) is None and STAMP.match(cell.strip().strip('"'))
    )
    said = facts_of([line for i, line in enumerate(lines[:start]) if i not in header_lines], delimiter)
    return Dialect(encoding, delimiter, decimal, thousands, names, units, start + 1, stamps, said, ragged)


def _broken_rows(above: list[str], delimiter: str | None, decimal: str, thousands: str) -> int:
    """How many lines right above the first good row are rows of numbers too, with too many or too few cells."""
    count = 0
    for line in reversed(above):
        cells = split(line.strip("\r\n "), delimiter)
        good = [_is_cell(cell, decimal, thousands) for cell in cells]
        filled = sum(bool(cell.strip()) for cell in cells)
        if not good or not good[0] or sum(good) < (filled if delimiter is None else filled / 2):
            break
        if len(cells) == 1 and count == len(above) - 1:
            break  # a first line that says how many rows follow
        count += 1
    return count


def _refuse_another_table(path: str, above: list[str], delimiter: str | None, decimal: str, thousands: str) -> None:
    """Refuse a file with rows of numbers above the table that is read: two tables, of which one would be lost."""
    held = 0
    for i, line in enumerate(above):
        cells = split(line.strip("\r\n "), delimiter)
        numbers = sum(number(cell, decimal, thousands) is not None for cell in cells)
        held = held + 1 if numbers > 1 and 2 * numbers > len(cells) and not line.lstrip().startswith(COMMENT) else 0
        if held == 3:
            raise DataError(
                f"{path}: holds two tables, one from row {i - 1} and another from row {len(above) + 1}; "
                f"save each in a file of its own"
            )


def _first_row(lines: list[str], delimiter: str | None, decimal: str, thousands: str, count: int) -> int | None:
    """Index of the first line that is a row of the table: as many cells as the body, most of them numbers."""

    def is_row(line: str) -> bool:
        if line.lstrip().startswith(COMMENT):
            return False
        cells = split(line.strip("\r\n "), delimiter)
        if len(cells) == count + 1 and not cells[-1].strip():
            cells = cells[:-1]
        good = sum(_is_cell(cell, decimal, thousands) for cell in cells)
        filled = sum(bool(cell.strip()) for cell in cells)
        return len(cells) == count and good > 0 and good >= filled / 2

    return next((i for i, line in enumerate(lines) if is_row(line)), None)


def _header(
    above: list[str], delimiter: str | None, count: int, ragged: bool
) -> tuple[tuple[str, ...], tuple[str, ...], set[int]]:
    """Names and units of the columns from the lines above the first row, and which lines those are.

    `ragged`: the rows end with a delimiter, and a name behind it is that of an empty column.
    """
    rows: list[tuple[int, list[str]]] = []
    for i in reversed(range(len(above))):
        bare = above[i].strip("\r\n ")
        if bare.lstrip().startswith(COMMENT):
            bare = bare.lstrip("#%/ ")
        cells = [cell.strip().strip('"').strip() for cell in split(bare, delimiter)]
        if len(cells) == count + 1 and (ragged or not cells[-1]):
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
