"""The isolated reader's own side: `python -m eaid.logs.foreign.answer` answers questions on stdin (see `ask`)."""

import os
import pickle
import sys
import threading
import time
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from eaid.errors import DataError
from eaid.logs.foreign.ask import Question, WornError
from eaid.logs.table import Cells, Table, no_columns

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

    def answer(self, question: Question) -> list[Table] | Cells | DataError:
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
                return [replace(table, load=no_columns) for table in self._tables]
            cells = self._tables[question.table].load(question.wanted)
            return replace(cells, values=tuple(map(_numbers, cells.values)))
        except DataError as fault:
            return fault
        except MemoryError:
            return WornError(
                f"{question.source}: takes far more memory to unpack than its size accounts for; save it unpacked"
            )
        except Exception as fault:  # what a library raises on bytes that it did not expect has no common type
            reason = " ".join(str(fault).split())[:120].rstrip(".") or type(fault).__name__
            return DataError(f"{question.source}: is a damaged {question.what} file ({reason}); copy or save it again")


def _numbers(values: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    return np.ascontiguousarray(values, dtype=None if values.dtype.kind in "iu" else np.float64)


def main() -> None:
    """Answer until there are no more questions."""
    _end_with_parent()
    out = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # whatever a library prints stays out of the answers
    opened = _Open()
    while True:
        try:
            question: Question = pickle.load(sys.stdin.buffer)
        except EOFError:
            return
        pickle.dump(opened.answer(question), out, protocol=5)
        out.flush()


if __name__ == "__main__":
    main()
