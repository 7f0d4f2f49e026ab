"""The isolated reader's own side: `python -m eaid.logs.foreign.answer` answers questions on stdin (see `logs.formats`).

What goes to and fro are typed messages and the bytes of arrays: neither side runs what the other sends.
"""

import os
import sys
import time
from functools import lru_cache
from importlib import import_module
from pathlib import Path
from typing import IO, Any, TypeVar

import msgspec
import numpy as np

from eaid.errors import DataError
from eaid.logs.table import Cells, LogTable

LONGEST_READ_S = 60.0  # Time for any file; a second for every megabyte comes on top [s]
MEMORY_FLOOR = 512 << 20  # Memory for any file [bytes], beyond what the process holds before it
MOST_MEMORY_RATIO = 40  # Memory for a file, as a multiple of its size (what is recorded packs by about 10)


class Question(msgspec.Struct, frozen=True):
    """A question about a file: its tables, or columns of one of them."""

    reader: str  # `module.function` in this folder
    path: str
    source: str  # How sentences name the file
    what: str  # Its format, in words
    table: int | None = None
    wanted: tuple[int, ...] = ()


class Answer(msgspec.Struct, frozen=True, omit_defaults=True):
    """Tables, or columns of one, or what is wrong."""

    tables: tuple[LogTable, ...] = ()
    cells: Cells = Cells(())
    refusal: tuple[str, ...] = ()
    worn: bool = False  # Whether nobody knows what the process still holds: it gets no further question


M = TypeVar("M", Question, Answer)


def send(out: IO[bytes], message: Question | Answer) -> None:
    """Write a message behind its length; how a table is read is not sent."""
    data = msgspec.msgpack.encode(message, enc_hook=_array_in_bytes)
    out.write(len(data).to_bytes(8, "little") + data)
    out.flush()


def received(source: IO[bytes], kind: type[M]) -> M:
    """The next message; raises EOFError where there is none, ValueError where it is something else."""
    count = int.from_bytes(source.read(8), "little")
    data = source.read(count)
    if not data or len(data) < count:
        raise EOFError
    return msgspec.msgpack.decode(data, type=kind, dec_hook=_array_from_bytes)


def _array_in_bytes(value: Any) -> tuple[str, bytes] | None:
    if not isinstance(value, np.ndarray):
        return None
    numbers = value if value.dtype.kind in "iu" else value.astype(np.float64)
    return numbers.dtype.str, numbers.tobytes()


def _array_from_bytes(_: Any, header: Any) -> Any:
    return (lambda _: Cells(())) if header is None else np.frombuffer(header[1], dtype=header[0])


def _bound(size: int) -> None:
    """Bound memory and processor time from now on; where the system cannot (macOS, Windows), nothing is done."""
    try:
        import resource

        def limit(kind: int, most: int) -> None:
            _, hard = resource.getrlimit(kind)
            resource.setrlimit(kind, (most if hard == resource.RLIM_INFINITY else min(most, hard), hard))

        # twice what the command waits for, in case that it is gone
        limit(resource.RLIMIT_CPU, int(time.process_time() + 2 * (LONGEST_READ_S + size / 1e6)))
        words = Path("/proc/self/status").read_text(encoding="ascii", errors="replace").partition("VmData:")[2].split()
        limit(resource.RLIMIT_DATA, (int(words[0]) << 10) + MEMORY_FLOOR + MOST_MEMORY_RATIO * size)
    except (ImportError, OSError, IndexError, ValueError):
        return


@lru_cache(1)
def _tables_of_file(reader: str, path: Path, source: str) -> list[LogTable]:
    """The tables of a file, those of the last one at hand."""
    _bound(path.stat().st_size)
    module, _, function = reader.partition(".")
    tables: list[LogTable] = getattr(import_module(f"eaid.logs.foreign.{module}"), function)(path, source)
    return tables


def _answer(question: Question) -> Answer:
    """The tables of a file, or columns of one of them; what is wrong where they cannot be had."""
    try:
        tables = _tables_of_file(question.reader, Path(question.path), question.source)
        if question.table is None:
            return Answer(tuple(tables))
        return Answer(cells=tables[question.table].load(question.wanted))
    except DataError as fault:
        return Answer(refusal=tuple(fault.sentences))
    except MemoryError:
        far = f"{question.source}: takes far more memory to unpack than its size accounts for; save it unpacked"
        return Answer(refusal=(far,), worn=True)
    except Exception as fault:  # what a library raises on bytes that it did not expect has no common type
        reason = " ".join(str(fault).split())[:120].rstrip(".") or type(fault).__name__
        damaged = f"{question.source}: is a damaged {question.what} file ({reason}); copy or save it again"
        return Answer(refusal=(damaged,))


def main() -> None:
    """Answer until there are no more questions."""
    out = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # whatever a library prints stays out of the answers
    while True:
        try:
            question = received(sys.stdin.buffer, Question)
        except EOFError:
            return
        send(out, _answer(question))


if __name__ == "__main__":
    main()
