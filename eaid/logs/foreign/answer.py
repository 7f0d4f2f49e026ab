"""The isolated reader's own side: `python -m eaid.logs.foreign.answer` answers questions on stdin (see `ask`)."""

import os
import sys
import threading
import time
from importlib import import_module
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from eaid.errors import DataError
from eaid.logs.foreign.wire import Answer, Question, cells_sent, head, refusal, send, tables_sent
from eaid.logs.table import Table

FLOOR = 512 << 20
"""Memory for any file [bytes], beyond what the process holds before it."""
MOST_RATIO = 40
"""Memory for a file, as a multiple of its size (what is recorded packs by about 10)."""


def _bound_memory(size: int) -> None:
    """Bound what may be allocated from now on; where the system cannot (macOS, Windows), nothing is done."""
    try:
        import resource

        words = Path("/proc/self/status").read_text(encoding="ascii", errors="replace").partition("VmData:")[2].split()
        _, hard = resource.getrlimit(resource.RLIMIT_DATA)
        most = (int(words[0]) << 10) + FLOOR + MOST_RATIO * size
        resource.setrlimit(resource.RLIMIT_DATA, (most if hard == resource.RLIM_INFINITY else min(most, hard), hard))
    except (ImportError, OSError, IndexError, ValueError):
        return


def _end_with_parent() -> None:
    """Leave, whatever is being done, once the command that asks is gone."""
    parent = os.getppid()

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(1.0)
        os._exit(130)

    if os.name == "posix":
        threading.Thread(target=watch, daemon=True).start()


class _Open:
    """The file that was asked for last, with its tables."""

    def __init__(self) -> None:
        self._key: tuple[str, str] | None = None
        self._tables: list[Table] = []

    def answer(self, question: Question) -> tuple[Answer, tuple[NDArray[np.generic], ...]]:
        """The tables of a file, or columns of one of them; what is wrong where they cannot be had."""
        try:
            key = (question.reader, question.path)
            if key != self._key:
                self._key, self._tables = None, []
                path = Path(question.path)
                _bound_memory(path.stat().st_size)
                module, _, function = question.reader.partition(".")
                read = getattr(import_module(f"eaid.logs.foreign.{module}"), function)
                self._tables, self._key = read(path, question.source), key
            if question.table is None:
                return tables_sent(self._tables), ()
            return cells_sent(self._tables[question.table].load(question.wanted))
        except DataError as fault:
            return refusal(fault), ()
        except MemoryError:
            far = f"{question.source}: takes far more memory to unpack than its size accounts for; save it unpacked"
            return refusal(DataError(far), worn=True), ()
        except Exception as fault:  # what a library raises on bytes that it did not expect has no common type
            reason = " ".join(str(fault).split())[:120].rstrip(".") or type(fault).__name__
            damaged = f"{question.source}: is a damaged {question.what} file ({reason}); copy or save it again"
            return refusal(DataError(damaged)), ()


def main() -> None:
    """Answer until there are no more questions."""
    _end_with_parent()
    out = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # whatever a library prints stays out of the answers
    opened = _Open()
    while True:
        try:
            question = head(sys.stdin.buffer, Question)
        except EOFError:
            return
        send(out, *opened.answer(question))


if __name__ == "__main__":
    main()
