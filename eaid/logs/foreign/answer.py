"""The isolated reader's own side: `python -m eaid.logs.foreign.answer` answers questions on stdin (see `ask`)."""

import json
import os
import sys
import threading
import time
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import IO, Any

import msgspec
import numpy as np

from eaid.errors import DataError
from eaid.logs.table import Table

READERS = {
    "hdf5": "hdf5:read_hdf5", "lvm": "lvm:read_lvm", "mat": "mat:read_mat", "mdf": "mdf:read_mdf",
    "parquet": "parquet:read_parquet", "arrow": "parquet:read_arrow",
    "ros": "ros:read_ros", "tdms": "tdms:read_tdms", "through": "hdf5:read_through",
    "is_dataset": "hdf5:read_schema",
}  # fmt: skip
"""Name of a reader → module here and function: (path, source) → tables."""
FLOOR = 512 << 20
"""Memory for any file [bytes], beyond what the process holds before it."""
MOST_RATIO = 40
"""Memory for a file, as a multiple of its size (what is recorded packs by about 10)."""


def _bound_memory(size: int) -> None:
    """Bound what may be allocated from now on; where the system cannot, nothing is done."""
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

    def tables(self, question: dict[str, Any]) -> list[Table]:
        """Its tables, read anew where another file is asked for."""
        key = (question["reader"], question["path"])
        if key != self._key:
            self._key, self._tables = None, []
            module, _, name = READERS[question["reader"]].partition(":")
            read: Callable[[Path, str], list[Table]] = getattr(import_module(f"eaid.logs.foreign.{module}"), name)
            path = Path(question["path"])
            _bound_memory(path.stat().st_size)
            self._tables, self._key = read(path, question["source"]), key
        return self._tables


def _answer(question: dict[str, Any], opened: _Open) -> tuple[dict[str, Any], list[np.ndarray[Any, Any]]]:
    tables = opened.tables(question)
    if "table" not in question:
        return {"tables": [
            {
                "name": one.name, "columns": one.columns, "units": one.units, "rate_hz": one.rate_hz,
                "starts_s": one.starts_s, "said": dict(one.said), "clock": one.clock, "dropped": one.dropped,
            }
            for one in tables
        ]}, []  # fmt: skip
    cells = tables[question["table"]].load(question["wanted"])
    values = [np.ascontiguousarray(_numbers(one)) for one in cells.values]
    bad = [(one.row, one.column, one.text) for one in cells.bad]
    arrays = [(one.dtype.str, len(one)) for one in values]
    return {"arrays": arrays, "bad": bad, "findings": msgspec.to_builtins(cells.findings)}, values


def _numbers(values: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    return values if values.dtype.kind in "iu" else np.asarray(values, dtype=np.float64)


def _refusal(question: dict[str, Any], fault: BaseException) -> list[str]:
    source = question["source"]
    if isinstance(fault, DataError):
        return list(fault.sentences)
    if isinstance(fault, MemoryError):
        return [f"{source}: takes far more memory to unpack than its size accounts for; save it unpacked"]
    reason = " ".join(str(fault).split())[:120].rstrip(".") or type(fault).__name__
    return [f"{source}: is a damaged {question['what']} file ({reason}); copy or save it again"]


def main() -> None:
    """Answer until there are no more questions."""
    _end_with_parent()
    out: IO[bytes] = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # whatever a library prints stays out of the answers
    opened = _Open()
    for line in sys.stdin.buffer:
        question = json.loads(line)
        values: list[np.ndarray[Any, Any]] = []
        try:
            told, values = _answer(question, opened)
        except Exception as fault:  # what a library raises on bytes that it did not expect has no common type
            told = {"refused": _refusal(question, fault), "worn": isinstance(fault, MemoryError)}
        out.write(json.dumps(told).encode() + b"\n")
        for one in values:
            out.write(memoryview(one.data).cast("B") if len(one) else b"")
        out.flush()


if __name__ == "__main__":
    main()
