"""Tables of results; the one type of a table: typed cells, as text for the terminal and as HTML for the page."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property
from operator import attrgetter
from typing import TypeVar

from eaid.results.residuals import CORRELATION_LAGS, Correlation
from eaid.shown import number

T = TypeVar("T")


class Name(str):
    """A text that users chose (a run, a file, a unit): shown as it is, never set as a formula."""

    __slots__ = ()


Cell = str | float | int | bool | None | tuple[float, float]  # A text, a number, yes or no, an interval; None is a dash


@dataclass(frozen=True)
class Column:
    """The head of a column, its unit, and the significant digits of its numbers."""

    head: str
    unit: str = ""
    digits: int = 4


@dataclass(frozen=True)
class Table:
    """A table; the first column names the row."""

    heading: str
    caption: str
    columns: tuple[Column, ...]
    rows: tuple[tuple[Cell, ...], ...]

    @cached_property
    def heads(self) -> tuple[str, ...]:
        """What stands above the columns, units in brackets."""
        return tuple(f"{one.head} ({one.unit})" if one.unit else one.head for one in self.columns)

    @cached_property
    def texts(self) -> tuple[tuple[str, ...], ...]:
        """The rows as texts."""
        return tuple(tuple(map(cell_text, row, self.columns)) for row in self.rows)

    @cached_property
    def numeric(self) -> tuple[bool, ...]:
        """Which columns hold numbers only: those are set flush right."""
        return tuple(
            all(cell is None or (isinstance(cell, int | float) and not isinstance(cell, bool)) for cell in column)
            for column in zip(*self.rows, strict=True)
        )

    def plain(self) -> tuple[list[str], list[list[object]]]:
        """Heads and rows for a file: numbers whole, an interval as its two ends named after the column before it."""
        wide = [any(isinstance(row[k], tuple) for row in self.rows) for k in range(len(self.columns))]
        heads, of = [], ""
        for head, two in zip(self.heads, wide, strict=True):
            of = of if head.startswith("95 %") else head
            heads += [f"{of} low", f"{of} high"] if two else [head]
        rows: list[list[object]] = []
        for row in self.rows:
            cells: list[object] = []
            for cell, two in zip(row, wide, strict=True):
                ends = cell if isinstance(cell, tuple) else (None, None) if isinstance(cell, str) else (cell, cell)
                cells += ends if two else [cell]
            rows.append(cells)
        return heads, rows


ColumnHead = str | tuple[str, str] | tuple[str, str, int]  # Head, unit and digits of a column
# A column: its head, and what it shows of an item: an attribute by name, or a function
ColumnPart = tuple[ColumnHead, str | Callable[[T], Cell]]
INTERVAL: ColumnHead = ("95 % interval", "", 3)
NOT_KNOWN = "not known"


def table_of(heading: str, caption: str, items: Iterable[T], *parts: ColumnPart[T] | None) -> Table:
    """A table of one row an item and one column a part; a part that is None is left out."""
    heads, shows = zip(*(part for part in parts if part is not None), strict=True)
    calls = [attrgetter(show) if isinstance(show, str) else show for show in shows]
    rows = [[call(one) for call in calls] for one in items]
    asked = any(isinstance(row[k], tuple) for row in rows for k, head in enumerate(heads) if head == INTERVAL)
    keep = [k for k, head in enumerate(heads) if asked or head != INTERVAL]
    columns = tuple(Column(heads[k]) if isinstance(heads[k], str) else Column(*heads[k]) for k in keep)
    return Table(heading, caption, columns, tuple(tuple(row[k] for k in keep) for row in rows))


# Residuals against their own past and against the input
OUTSIDE = (
    f"Lags outside: of {CORRELATION_LAGS}, those at which the residual goes with its own past, or the input, beyond "
    "the 95 % band; one in twenty does by chance."
)


def outside(of: Callable[[T], Correlation]) -> tuple[ColumnPart[T], ColumnPart[T]]:
    """Columns: lags at which residuals go with their own past, and with the input."""
    own: ColumnPart[T] = ("lags outside: own past", lambda one: of(one).outside()[0])
    return own, ("lags outside: input", lambda one: of(one).outside()[1])


def cell_text(cell: Cell, column: Column) -> str:
    """A cell of a column as text; an interval that the data do not tell, or one without width, is not known."""
    if cell is None and column.head == INTERVAL[0]:
        return NOT_KNOWN
    if isinstance(cell, tuple):  # as many digits as its ends need to differ
        ends = ([number(end, places) for end in cell] for places in range(min(column.digits, 3), 7))
        return next((" … ".join(pair) for pair in ends if pair[0] != pair[1]), NOT_KNOWN)
    return cell if isinstance(cell, str) else number(cell, column.digits)


def level(value: float) -> str:
    """A level as people write it: 10, 17.5, 153."""
    return f"{value:.4g}".replace("-", "−")
