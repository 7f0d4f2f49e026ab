"""Rows of texts → the lines of a table on a terminal: numbers to the right, long texts in several lines.

Where a terminal is too narrow the columns follow one another in blocks, each headed by the columns that tell the rows
apart.
"""

from collections.abc import Sequence
from io import StringIO

LONGEST = 30
"""Letters of a name in a table that is too wide, and of a number with its unit."""
NARROWEST = 24
"""Letters that a column of texts keeps when its cells are written in several lines."""
GAP = 2
NO_NUMBERS = ("", "-", "–", "…", "<", ">", "never", "no", "none", "not", "unstable", "infinite")
"""How cells begin that stand in a column of numbers without being one."""


def shortened(text: str) -> str:
    """A text for a table: the middle of each long name in it is left out."""
    words = text.split(" ")
    return " ".join(word if len(word) <= LONGEST else f"{word[: LONGEST - 12]}…{word[-11:]}" for word in words)


def aligned(rows: Sequence[Sequence[str]], width: int | None = None) -> list[str]:
    """The lines of a table, its first row the heading; None: as wide as it is."""
    if width is None or _length([_widest(column) for column in zip(*rows, strict=True)]) <= width:
        return _block(rows, None)
    short = [list(map(shortened, row)) for row in rows]
    return [
        line for block in _blocks(short, width) for line in _block([[row[i] for i in block] for row in short], width)
    ]


def _length(widths: Sequence[int]) -> int:
    return sum(widths) + GAP * (len(widths) - 1)


def _widest(texts: Sequence[str]) -> int:
    from rich.cells import cell_len

    return max(map(cell_len, texts))


def _least(column: Sequence[str]) -> int:
    """Least width of a column: numbers and single words are not broken, headings and texts are, between words."""
    words, whole = _widest(" ".join(column).split(" ")), _widest(column[1:])
    texts = any(" " in cell and not _is_number(cell) for cell in column[1:])
    return max(words, min(whole, NARROWEST) if texts else whole)


def _blocks(rows: Sequence[Sequence[str]], width: int) -> list[list[int]]:
    """Which columns stand together: in each block those that tell the rows apart, and as many more as there is room."""
    least = [_least(column) for column in zip(*rows, strict=True)]
    apart = (k for k in (1, 2, 3) if len({tuple(row[:k]) for row in rows}) == len(rows))
    lead = list(range(min(next(apart, 1), len(least))))
    blocks = [lead]
    for i in range(len(lead), len(least)):
        if len(blocks[-1]) > len(lead) and _length([least[k] for k in (*blocks[-1], i)]) > width:
            blocks.append(lead)
        blocks[-1] = [*blocks[-1], i]
    return blocks


def _block(rows: Sequence[Sequence[str]], width: int | None) -> list[str]:
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    columns = list(zip(*rows, strict=True))
    widths, least = [_widest(column) for column in columns], [_least(column) for column in columns]
    while width is not None and _length(widths) > width and widths != least:
        k = max(range(len(widths)), key=lambda i: (widths[i] - least[i], widths[i]))
        widths[k] -= 1
    table = Table(box=None, show_header=False, pad_edge=False, padding=(0, GAP, 0, 0))
    for i, column in enumerate(columns):
        table.add_column(justify="right" if i and all(map(_is_number, column[1:])) else "left", width=widths[i])
    for row in rows:
        table.add_row(*map(Text, row))
    told = StringIO()
    Console(file=told, width=_length(widths) + GAP, color_system=None, legacy_windows=False).print(table)
    return [line.rstrip() for line in told.getvalue().splitlines()]


def _is_number(text: str) -> bool:
    """Whether a cell counts as a number for its column: a number, with a unit or % behind it, an interval or a dash."""
    if len(text) > LONGEST:
        return False
    head = text.split(" ")[0].rstrip("%°").replace("−", "-").partition("…")[0]
    if head in NO_NUMBERS:
        return True
    try:
        float(head)
    except ValueError:
        return False
    return True
