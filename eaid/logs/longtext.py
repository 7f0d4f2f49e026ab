"""Text logs too long to be held: read piece by piece, their columns kept on disk.

Each piece goes the same two ways as a short log does (`text.py`): the C parser, or cell by cell where it stumbles.
"""

import gzip
import zlib
from bisect import bisect_right
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import IO, cast

import numpy as np

from eaid.errors import DataError
from eaid.logs.dialect import Dialect
from eaid.logs.sheet import BadCell, Cells
from eaid.logs.spool import Spool

PIECE_BYTES = 1 << 24
MOST_BAD = 10_000
"""Bad cells that are listed; a log with more is refused whatever they are."""
Parse = Callable[[bytes, Dialect, Sequence[int], int], Cells]
"""Parses whole lines of a log: (bytes, dialect, columns, line of the first) → cells."""


class Rows(Sequence[int]):
    """Line of the file of every sample, kept as the lines that each piece begins with."""

    def __init__(self) -> None:
        self._starts: list[int] = []
        self._pieces: list[Cells] = []
        self._count = 0

    def append(self, cells: Cells) -> None:
        """Add the samples of one piece."""
        self._starts.append(self._count)
        self._pieces.append(Cells((), rows=cells.rows, first_row=cells.first_row))
        self._count += len(cells.values[0])

    def __len__(self) -> int:
        return self._count

    def __getitem__(self, index: int) -> int:  # type: ignore[override]
        k = bisect_right(self._starts, index) - 1
        return self._pieces[k].row(index - self._starts[k])


def _pieces(file: IO[bytes], limit: int) -> Iterator[bytes]:
    """Whole lines, about `PIECE_BYTES` at a time; stops behind `limit` bytes."""
    rest = b""
    seen = 0
    while block := file.read(PIECE_BYTES):
        seen += len(block)
        if seen > limit:
            raise OverflowError
        end = block.rfind(b"\n") + 1
        if end:
            yield rest + block[:end]
            rest = block[end:]
        else:
            rest += block
    if rest.strip(b"\r\n \t\x00\x1a"):
        yield rest


def load_long(
    path: Path,
    source: str,
    zipped: bool,
    limit: int,
    dialect: Dialect,
    columns: Sequence[int],
    parse: Parse,
    told: Callable[[float], None],
) -> Cells:
    """Cells of a long log; `told` hears the share of the file that is read. Raises DataError on damage."""
    spools = [Spool() for _ in columns]
    rows, bad = Rows(), list[BadCell]()
    size = path.stat().st_size
    with path.open("rb") as raw:
        file = cast(IO[bytes], gzip.GzipFile(fileobj=raw)) if zipped else raw
        for _ in range(dialect.first_line - 1):
            file.readline()
        line = dialect.first_line
        try:
            for piece in _pieces(file, limit):
                cells = parse(piece, dialect, columns, line)
                line += int(np.count_nonzero(np.frombuffer(piece, dtype=np.uint8) == 10))
                if not len(cells.values[0]):
                    continue
                bad.extend(BadCell(cell.row + len(rows), cell.column, cell.text) for cell in cells.bad)
                rows.append(cells)
                for spool, values in zip(spools, cells.values, strict=True):
                    spool.append(values)
                told(min(1.0, raw.tell() / size))
                if len(bad) > MOST_BAD:
                    raise DataError(
                        f"{source}: more than {MOST_BAD:,} cells are bad up to row {line - 1}; record it again"
                    )
        except OverflowError:
            raise DataError(
                f"{source}: unpacks to far more than its size, as no recorded log does; unpack it"
            ) from None
        except (EOFError, zlib.error, gzip.BadGzipFile) as fault:
            raise DataError(f"{source}: is no whole gzip file ({str(fault).rstrip('.')}); copy it again") from None
    return Cells(tuple(spool.array() for spool in spools), tuple(bad), rows)
