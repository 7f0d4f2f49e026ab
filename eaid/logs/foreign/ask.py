"""The isolated reader: one process that opens the binary files of other programs, and is asked for tables and columns.

Compiled libraries break down, go round in circles or unpack without bound on some damaged files. Where they do so in a
process of its own, with bounded memory (Linux) and time, the file is refused and nothing else is lost; the next file
gets a new process. A question is a line of JSON; the answer is one too, followed by the bytes of the columns.
"""

import contextlib
import json
import os
import subprocess
import sys
import threading
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from types import TracebackType
from typing import IO, Any

import msgspec
import numpy as np

from eaid.arrays import read_only
from eaid.errors import DataError
from eaid.findings import Finding
from eaid.logs.table import BadCell, Cells, Table

READER: tuple[str, ...] = (sys.executable, "-P", "-m", "eaid.logs.foreign.answer")
LONGEST_S = 60.0
"""Time for any file; a second for every megabyte comes on top [s]."""
EXTRAS = {"nptdms": "tdms", "asammdf": "mdf", "rosbags": "ros", "pyarrow": "parquet", "lvm_read": "lvm"}
"""Library → the extra of eaid that brings it."""


class ForeignReader:
    """The process, started when the first such file comes and ended with the block that it is used in."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self.alone = threading.RLock()
        """Held while one file is read: the process knows one file at a time."""

    def __enter__(self) -> "ForeignReader":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, fault: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._end()

    def tables(self, reader: str, library: str, what: str, path: Path, source: str) -> list[Table]:
        """Tables of a file; `reader` is a row of `answer.READERS`, `library` what it takes beyond eaid's own needs."""
        if library and find_spec(library) is None:
            raise DataError(
                f'{source}: is a {what} file, which takes {library} to read; pip install "eaid[{EXTRAS[library]}]"'
            )
        question = {"reader": reader, "path": str(path), "source": source, "what": what}
        with self.alone:
            told, _ = self._asked(question, path, source, what)
        return [
            Table(
                name=one["name"], columns=tuple(one["columns"]), units=tuple(one["units"]), rate_hz=one["rate_hz"],
                starts_s=one["starts_s"], said=one["said"], clock=one["clock"], dropped=tuple(one["dropped"]),
                load=partial(self._load, question, k, path, source, what),
            )
            for k, one in enumerate(told["tables"])
        ]  # fmt: skip

    def check(self, path: Path, source: str) -> None:
        """Read an HDF5 file to its end there, so that what breaks the HDF5 library does not break this process."""
        with self.alone:
            self._asked(
                {"reader": "through", "path": str(path), "source": source, "what": "HDF5"}, path, source, "HDF5"
            )

    def _load(
        self, question: dict[str, Any], table: int, path: Path, source: str, what: str, wanted: Sequence[int]
    ) -> Cells:
        with self.alone:
            told, values = self._asked({**question, "table": table, "wanted": list(wanted)}, path, source, what)
        return Cells(
            tuple(values),
            tuple(BadCell(*one) for one in told["bad"]),
            findings=msgspec.convert(told["findings"], tuple[Finding, ...]),
        )

    def _asked(
        self, question: dict[str, Any], path: Path, source: str, what: str
    ) -> tuple[dict[str, Any], list[np.ndarray[Any, Any]]]:
        process = self._running()
        assert process.stdin is not None and process.stdout is not None
        longest_s = LONGEST_S + path.stat().st_size / 1e6
        late = threading.Event()

        def stop() -> None:
            late.set()
            process.kill()

        bell = threading.Timer(longest_s, stop)
        bell.daemon = True
        bell.start()
        try:
            process.stdin.write(json.dumps(question).encode() + b"\n")
            process.stdin.flush()
            told: dict[str, Any] = json.loads(process.stdout.readline())
            values = [_column(process.stdout, kind, count) for kind, count in told.get("arrays", [])]
        except (OSError, ValueError):
            self._end()
            if late.is_set():
                raise DataError(f"{source}: takes longer than {longest_s:.0f} s to read; export it as CSV") from None
            raise DataError(
                f"{source}: is a damaged {what} file (its reader broke down on it); copy or save it again"
            ) from None
        finally:
            bell.cancel()
        if told.get("worn"):  # what it still holds is not known
            self._end()
        if "refused" in told:
            raise DataError(*told["refused"])
        return told, values

    def _running(self) -> subprocess.Popen[bytes]:
        if self._process is None:
            places = os.pathsep.join(place for place in sys.path if place)
            self._process = subprocess.Popen(
                READER, env={**os.environ, "PYTHONPATH": places}, stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
            )  # fmt: skip
        return self._process

    def _end(self) -> None:
        process, self._process = self._process, None
        if process is not None:
            process.kill()
            with contextlib.suppress(OSError):
                process.communicate()


def _column(file: IO[bytes], kind: str, count: int) -> np.ndarray[Any, Any]:
    values = np.empty(count, dtype=np.dtype(kind))
    room = memoryview(values.data).cast("B") if count else memoryview(b"")
    at = 0
    while at < len(room):
        got = file.readinto(room[at:])  # type: ignore[attr-defined]
        if not got:
            raise ValueError("the answer ends early")
        at += got
    return values if values.dtype.kind in "iu" else read_only(values)


def named(tables: Sequence[Table], name: str) -> list[Table]:
    """Tables of a structure, under its name."""
    return [replace(table, name=f"{name}.{table.name}".rstrip(".")) for table in tables]
