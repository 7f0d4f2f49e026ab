"""The isolated reader: one process that opens the binary files of other programs, and is asked for tables and columns.

Compiled libraries break down, go round in circles or unpack without bound on some damaged files. Where they do so in a
process of its own, with bounded time and (on Linux) memory, the file is refused and nothing else is lost; the next file
gets a new process. It is kept apart for its crashes, not as a prison: it runs with the rights of the command. What it
answers is taken as typed numbers and texts (`wire`) and never run.
"""

import contextlib
import os
import subprocess
import sys
import threading
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from importlib.util import find_spec
from pathlib import Path

import msgspec

from eaid.arrays import read_only
from eaid.errors import DataError
from eaid.logs.foreign.wire import Answer, Question, cells_of, head, send, tables_of
from eaid.logs.formats import Format
from eaid.logs.table import Cells, Table

READER: tuple[str, ...] = (sys.executable, "-P", "-m", "eaid.logs.foreign.answer")
LONGEST_S = 60.0
"""Time for any file; a second for every megabyte comes on top [s]."""
EXTRAS = {"nptdms": "tdms", "asammdf": "mdf", "rosbags": "ros"}
"""Library → the extra of eaid that brings it."""


class ForeignReader:
    """The process, started when the first such file comes and ended with the block that it is used in."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self.alone = threading.RLock()
        """Held while one file is read: the process knows one file at a time."""

    def __enter__(self) -> "ForeignReader":
        return self

    def __exit__(self, *_: object) -> None:
        self._end()

    def tables(self, form: Format, path: Path, source: str) -> list[Table]:
        """Tables of a file of a format."""
        if form.library and find_spec(form.library) is None:
            raise DataError(
                f"{source}: is a {form.name} file, which takes {form.library} to read; "
                f'pip install "eaid[{EXTRAS[form.library]}]"'
            )
        question = Question(form.reader, str(path), source, form.name)
        found = tables_of(self._asked(question)[0])
        return [replace(table, load=partial(self._load, question, k)) for k, table in enumerate(found)]

    def _load(self, question: Question, table: int, wanted: Sequence[int]) -> Cells:
        _, cells = self._asked(msgspec.structs.replace(question, table=table, wanted=tuple(wanted)))
        return replace(cells, values=tuple(v if v.dtype.kind in "iu" else read_only(v) for v in cells.values))

    def _asked(self, question: Question) -> tuple[Answer, Cells]:
        with self.alone:
            process = self._running()
            assert process.stdin is not None and process.stdout is not None
            longest_s = LONGEST_S + Path(question.path).stat().st_size / 1e6
            late = threading.Event()

            def stop() -> None:
                late.set()
                process.kill()

            bell = threading.Timer(longest_s, stop)
            bell.daemon = True
            bell.start()
            try:
                send(process.stdin, question)
                answer = head(process.stdout, Answer)
                cells = cells_of(answer, process.stdout)
            except (OSError, EOFError, ValueError, MemoryError):
                self._end()
                raise DataError(
                    f"{question.source}: takes longer than {longest_s:.0f} s to read; export it as CSV"
                    if late.is_set()
                    else f"{question.source}: is a damaged {question.what} file (its reader broke down on it); "
                    f"copy or save it again"
                ) from None
            finally:
                bell.cancel()
            if answer.worn:
                self._end()
            if answer.refusal:
                raise DataError(*answer.refusal)
            return answer, cells

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
