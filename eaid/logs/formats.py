"""The formats that logs come in, each told by its first bytes, and the isolated reader of those of other programs.

Compiled libraries break down, go round in circles or unpack without bound on some damaged files. Where they do so in a
process of its own, with bounded time and (on Linux) memory, the file is refused and nothing else is lost; the next file
gets a new process. It is kept apart for its crashes, not as a prison: it runs with the rights of the command.
"""

import contextlib
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

import msgspec

from eaid.errors import DataError
from eaid.logs.foreign.answer import LONGEST_READ_S, Answer, Question, received, send
from eaid.logs.table import Cells, LogTable
from eaid.logs.text import read_text

NPY, ZIP, HDF5 = b"\x93NUMPY", b"PK\x03\x04", b"\x89HDF\r\n\x1a\n"
OFFICE = (b"[Content_Types].xml", b"_rels/", b"docProps/", b"xl/")  # As the archives of its documents begin
# First bytes of a file that is not read, what it is, and the remedy; any other binary file is refused as one
UNREAD: tuple[tuple[bytes, str], ...] = (
    (ZIP, "a ZIP archive; unpack it"),
    (b"\xd0\xcf\x11\xe0", "an old Excel workbook; save its sheet as CSV"),
    *((bytes((0x80, n)), "a Python pickle, which can run code; export the log as CSV or HDF5") for n in (2, 3, 4, 5)),
    *((mark, "packed, but not with gzip; unpack it") for mark in (b"BZh", b"\xfd7zXZ", b"(\xb5/\xfd", b"7z\xbc\xaf")),
    (b'{\n "schema": "eaid/', "a result of eaid, no log; give the logs that it was made of (eaid.load opens it)"),
    (b"%PDF", "a PDF; export the log as CSV"),
    *((mark, "an MDF measurement file; export it as CSV or HDF5") for mark in (b"MDF     ", b"UnFinMF ")),
    *((mark, "a ROS bag; export its topics as CSV or HDF5") for mark in (b"#ROSBAG V", b"\x89MCAP0\r\n")),
)
READER: tuple[str, ...] = (sys.executable, "-P", "-m", "eaid.logs.foreign.answer")


class Format(NamedTuple):
    """One row of the table of formats."""

    name: str
    is_it: Callable[[bytes], bool]  # Tells it by the first 4 KiB of a file
    reader: str = ""  # `module.function` in `foreign`; empty: read, or refused, in this process
    library: str = ""  # Library that it takes, where eaid itself does not need it


def _first_zipped(head: bytes) -> bytes:
    """The name of the first file of a ZIP archive; empty for what is none."""
    return head[30 : 30 + int.from_bytes(head[26:28], "little")] if head.startswith(ZIP) else b""


def unread(head: bytes) -> str | None:
    """What a file of none of the formats that are read is, and the remedy; None for a text."""
    return next((what for mark, what in UNREAD if head.startswith(mark)), None)


def _is_mat(head: bytes) -> bool:
    """MAT v5 by its text and version word; MAT v4 by its first header: type, rows, columns, imaginary, name length."""
    if head[124:128] in (b"\x00\x01IM", b"\x01\x00MI") or head.startswith(b"MATLAB 5.0"):
        return True
    for order in ("little", "big"):
        words = [int.from_bytes(head[i : i + 4], order) for i in range(0, 20, 4)]
        kind = words[0]
        plausible = kind in range(0, 53) or kind in range(1000, 1053)
        if len(head) > 24 and plausible and words[3] in (0, 1) and 2 <= words[4] < 64 and min(words[1:3]) > 0:
            name = head[20 : 20 + words[4]]
            if name.endswith(b"\0") and name[:-1].replace(b"_", b"a").isalnum():
                return True
    return False


FORMATS: tuple[Format, ...] = (
    # a MAT-file v7.3 among them
    Format("HDF5", lambda head: HDF5 in (head[: len(HDF5)], head[512 : 512 + len(HDF5)]), "arrays.read_hdf5"),
    Format("TDMS", lambda head: head.startswith(b"TDSm"), "tdms.read_tdms", "nptdms"),
    Format("MAT", _is_mat, "arrays.read_mat"),
    Format("NumPy", lambda head: head.startswith(NPY) or _first_zipped(head).endswith(b".npy"), "arrays.read_numpy"),
    Format("Excel", lambda head: _first_zipped(head).startswith(OFFICE), "excel.read_excel", "openpyxl"),
    Format("not read", lambda head: unread(head) is not None),
    Format("text", lambda _: True),
)
# An HDF5 file read to its end, so that what breaks the HDF5 library does not break this process
CHECKED = FORMATS[0]._replace(reader="arrays.read_through")


def format_of(head: bytes) -> Format:
    """The first format that recognises the bytes; text is the last."""
    return next(form for form in FORMATS if form.is_it(head))


class ForeignReader:
    """Reads files of any format; its process is started when the first that takes it comes, until it is closed."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self.alone = threading.RLock()  # Held while one file is read: the process knows one file at a time

    def tables(self, form: Format, path: Path, source: str) -> list[LogTable]:
        """Tables of a file of a format; one of text is read here."""
        if not form.reader:
            return [read_text(path, source)]
        if form.library and find_spec(form.library) is None:
            raise DataError(
                f"{source}: is a file of {form.name}, which takes {form.library} to read; "
                f'pip install "eaid[{form.name.lower()}]"'
            )
        question = Question(form.reader, str(path), source, form.name)
        tables = self._answer(question).tables
        return [replace(table, load=partial(self._load, question, k), source=source) for k, table in enumerate(tables)]

    def _load(self, question: Question, table: int, wanted: Sequence[int]) -> Cells:
        with self.alone:
            later = self._process is None  # behind the call that read the file: no process may stay
            cells = self._answer(msgspec.structs.replace(question, table=table, wanted=tuple(wanted))).cells
            if later:
                self.close()
        return cells

    def _answer(self, question: Question) -> Answer:
        with self.alone:
            if self._process is None:
                places = os.pathsep.join(place for place in sys.path if place)
                self._process = subprocess.Popen(
                    READER, env={**os.environ, "PYTHONPATH": places}, stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                    stderr=subprocess.DEVNULL,
                )  # fmt: skip
            process = self._process
            assert process.stdin is not None and process.stdout is not None
            longest_s = LONGEST_READ_S + Path(question.path).stat().st_size / 1e6
            begun_s = time.monotonic()
            bell = threading.Timer(longest_s, process.kill)
            bell.start()
            try:
                send(process.stdin, question)
                answer = received(process.stdout, Answer)
            except (OSError, EOFError, ValueError, MemoryError, OverflowError):
                self.close()
                raise DataError(
                    f"{question.source}: takes longer than {longest_s:.0f} s to read; export it as CSV"
                    if time.monotonic() - begun_s >= longest_s
                    else f"{question.source}: is a damaged {question.what} file (its reader broke down on it); "
                    f"copy or save it again"
                ) from None
            finally:
                bell.cancel()
            if answer.worn:
                self.close()
            if answer.refusal:
                raise DataError(*answer.refusal)
            return answer

    def close(self) -> None:
        """End the process; the next file gets a new one."""
        process, self._process = self._process, None
        if process is not None:
            process.kill()
            with contextlib.suppress(OSError):
                process.communicate()
