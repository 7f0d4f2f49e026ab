"""What goes to the isolated reader and comes back: typed messages and the bytes of arrays, so that neither side runs
what the other sends."""

from typing import IO, TypeVar

import msgspec
import numpy as np
from numpy.typing import NDArray

from eaid.errors import DataError
from eaid.findings import Finding
from eaid.logs.table import BadCell, Cells, Table, no_columns

LONGEST_HEAD = 1 << 28
"""Bytes of a message without its arrays."""
KINDS = tuple(f"{order}{kind}" for order in "<>|" for kind in ("i1", "i2", "i4", "i8", "u1", "u2", "u4", "u8", "f8"))


class Question(msgspec.Struct, frozen=True):
    """What is asked about a file: its tables, or columns of one of them."""

    reader: str
    """`module.function` in this folder."""
    path: str
    source: str
    """How sentences name the file."""
    what: str
    """Its format, in words."""
    table: int | None = None
    wanted: tuple[int, ...] = ()


class Heading(msgspec.Struct, frozen=True):
    """A table without its columns."""

    name: str
    columns: tuple[str, ...]
    units: tuple[str, ...]
    clock: int | None
    dropped: tuple[str, ...]
    synthetic: str | None


class Answer(msgspec.Struct, frozen=True, omit_defaults=True):
    """Tables, or columns whose arrays follow, or what is wrong."""

    tables: tuple[Heading, ...] = ()
    arrays: tuple[tuple[str, int], ...] = ()
    """Kind and length of each."""
    bad: tuple[tuple[int, int, str], ...] = ()
    rows: bool = False
    """Whether the last array holds the rows of the file."""
    first_row: int = 1
    findings: tuple[Finding, ...] = ()
    refusal: tuple[str, ...] = ()
    worn: bool = False
    """Whether nobody knows what the process still holds: it is not asked again."""


M = TypeVar("M", Question, Answer)


def send(out: IO[bytes], message: Question | Answer, arrays: tuple[NDArray[np.generic], ...] = ()) -> None:
    """Write a message and its arrays."""
    head = msgspec.msgpack.encode(message)
    out.write(len(head).to_bytes(8, "little") + head)
    for array in arrays:
        out.write(np.ascontiguousarray(array).data.cast("B"))
    out.flush()


def _read(source: IO[bytes], count: int) -> bytes:
    data = source.read(count)
    if len(data) < count:
        raise EOFError
    return data


def head(source: IO[bytes], kind: type[M]) -> M:
    """The next message; raises EOFError where there is none, ValueError where it is something else."""
    count = int.from_bytes(_read(source, 8), "little")
    if count > LONGEST_HEAD:
        raise ValueError("no message")
    return msgspec.msgpack.decode(_read(source, count), type=kind)


def tables_sent(tables: list[Table]) -> Answer:
    """Headings of tables."""
    return Answer(tuple(Heading(t.name, t.columns, t.units, t.clock, t.dropped, t.synthetic) for t in tables))


def tables_of(answer: Answer) -> list[Table]:
    """Tables that cannot be read yet."""
    return [
        Table(
            one.name, one.columns, no_columns, one.units, clock=one.clock, dropped=one.dropped, synthetic=one.synthetic
        )
        for one in answer.tables
    ]


def cells_sent(cells: Cells) -> tuple[Answer, tuple[NDArray[np.generic], ...]]:
    """Columns, apart from their arrays."""
    plain = tuple(v if v.dtype.kind in "iu" else np.asarray(v, dtype=np.float64) for v in cells.values)
    rows = () if cells.rows is None else (np.asarray(cells.rows, dtype=np.int64),)
    bad = tuple((int(one.row), int(one.column), one.text) for one in cells.bad)
    arrays = (*plain, *rows)
    kinds = tuple((one.dtype.str, len(one)) for one in arrays)
    return Answer((), kinds, bad, bool(rows), cells.first_row, cells.findings), arrays


def cells_of(answer: Answer, source: IO[bytes]) -> Cells:
    """Columns, their arrays read from behind the message; raises as `head` does."""
    arrays = []
    for kind, count in answer.arrays:
        if kind not in KINDS or count < 0:
            raise ValueError("no array of numbers")
        array = np.empty(count, dtype=kind)
        view = array.data.cast("B") if count else memoryview(b"")
        done = 0
        while done < len(view):
            more = source.readinto(view[done:])  # type: ignore[attr-defined]
            if not more:
                raise EOFError
            done += more
        arrays.append(array)
    rows = arrays.pop().tolist() if answer.rows else None
    return Cells(tuple(arrays), tuple(BadCell(*one) for one in answer.bad), rows, answer.first_row, answer.findings)


def refusal(fault: DataError, worn: bool = False) -> Answer:
    """What is wrong with a file."""
    return Answer(refusal=tuple(fault.sentences), worn=worn)
