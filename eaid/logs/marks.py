"""Marks of a text log: what stands between the cells of a row and inside its numbers; cells as numbers or stamps."""

import contextlib
import csv
import re
from typing import NamedTuple

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
