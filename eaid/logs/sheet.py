"""A sheet: one table of a file, with its columns named before they are read."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from eaid.arrays import Array


@dataclass(frozen=True)
class BadCell:
    """A cell that is no finite number."""

    row: int
    """Index into the arrays, from 0."""
    column: int
    """Index into `Sheet.columns`; −1: the whole row (too few or too many cells)."""
    text: str
    """What stands there, shortened; empty where nothing does."""


@dataclass(frozen=True)
class Cells:
    """Columns as read: float64, shape (n,) each; bad cells are NaN and listed."""

    values: tuple[Array, ...]
    bad: tuple[BadCell, ...] = ()
    rows: Sequence[int] | None = None
    """Row of the file for each sample; None: counted from `first_row`."""
    first_row: int = 1
    notes: tuple[str, ...] = ()
    """What reading had to do, in words."""

    def row(self, index: int) -> int:
        """Row of the file, counted as an editor counts lines, of one sample."""
        return self.rows[index] if self.rows is not None else self.first_row + index


@dataclass(frozen=True)
class Sheet:
    """One table: what its columns are called, and how to read some of them."""

    name: str
    """Variable, group or channel group; empty where a file is one table."""
    columns: tuple[str, ...]
    """Names as the file has them; empty strings where it has none."""
    load: Callable[[Sequence[int]], Cells]
    """Reads the chosen columns, in the chosen order; columns of other times are brought to those of the first."""
    units: tuple[str, ...] = ()
    """Unit of each column where the file says it apart from the name; empty strings where not."""
    rate_hz: float | None = None
    """Sample rate said by the file, for tables without a time column [Hz]."""
    starts_s: float = 0.0
    """First time of a table without a time column [s]."""
    said: Mapping[str, str] = field(default_factory=dict)
    """Facts told in comment lines or properties (`synthetic`, `level`, …)."""
    load_long: Callable[[Sequence[int], Callable[[float], None]], Cells] | None = None
    """Reads a table that is too long to be held, columns on disk, and tells how far it is; None: it is short."""
    clock: int | None = None
    """Column of the time, where the format itself says which it is."""

    def unit(self, column: int) -> str:
        """Unit of a column as the file says it apart from its name; empty where it does not."""
        return self.units[column] if self.units else ""
