"""Formats that eaid does not read, each with what to do instead."""

from pathlib import Path

from eaid.errors import DataError
from eaid.logs.sheet import Sheet

UNREAD: tuple[tuple[bytes, str], ...] = (
    (b"PK\x03\x04", "a ZIP archive or an Excel workbook; unpack it, or save its sheet as CSV"),
    (b"\xd0\xcf\x11\xe0", "an old Excel workbook; save its sheet as CSV"),
    (b"\x80\x02", "a Python pickle, which can run code; export the log as CSV or HDF5"),
    (b"\x80\x03", "a Python pickle, which can run code; export the log as CSV or HDF5"),
    (b"\x80\x04", "a Python pickle, which can run code; export the log as CSV or HDF5"),
    (b"\x80\x05", "a Python pickle, which can run code; export the log as CSV or HDF5"),
    (b"\x93NUMPY", "a NumPy file; export the log as CSV or HDF5"),
    (b"BZh", "packed with bzip2; unpack it, or pack it with gzip"),
    (b"\xfd7zXZ", "packed with xz; unpack it, or pack it with gzip"),
    (b"\x28\xb5\x2f\xfd", "packed with zstd; unpack it, or pack it with gzip"),
    (b"7z\xbc\xaf", "a 7-Zip archive; unpack it"),
    (b"%PDF", "a PDF; export the log as CSV"),
    (b"\x89PNG", "a picture; export the log as CSV"),
    (b"RIFF", "a sound file; export the log as CSV"),
    (b"\xff\xd8\xff", "a picture; export the log as CSV"),
)
"""First bytes of a file, what it is, and the remedy."""


def is_unread(head: bytes) -> bool:
    """True for the first bytes of a format in the table."""
    return any(head.startswith(mark) for mark, _ in UNREAD)


def refuse(path: Path, source: str) -> list[Sheet]:
    """Say what a file is and what to do; nothing in it is opened."""
    with path.open("rb") as file:
        head = file.read(16)
    raise DataError(f"{source}: is {next(said for mark, said in UNREAD if head.startswith(mark))}")
