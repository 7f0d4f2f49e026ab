"""The formats that logs come in, each told by its first bytes, never by the ending of its name."""

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import NamedTuple

from eaid.logs.hdf import is_hdf5
from eaid.logs.sheet import Sheet
from eaid.logs.unread import is_unread


class Format(NamedTuple):
    """One row of the table of formats."""

    name: str
    is_it: Callable[[bytes], bool]
    """Tells it by the first 4 KiB of a file."""
    reader: str
    """Module and function that read it, imported when such a log comes."""

    def read(self, path: Path, source: str) -> list[Sheet]:
        """Sheets of a log of this format."""
        module, _, function = self.reader.partition(":")
        sheets: list[Sheet] = getattr(import_module(f"eaid.logs.{module}"), function)(path, source)
        return sheets


def _begins(*marks: bytes) -> Callable[[bytes], bool]:
    return lambda head: head.startswith(marks)


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
    Format("HDF5 or MAT v7.3", is_hdf5, "hdf:read_hdf5"),
    Format("LabVIEW LVM", _begins(b"LabVIEW Measurement", b"\xef\xbb\xbfLabVIEW Measurement"), "lvm:read_lvm"),
    Format("TDMS", _begins(b"TDSm"), "tdms:read_tdms"),
    Format("Parquet", _begins(b"PAR1"), "parquet:read_parquet"),
    Format("MDF", _begins(b"MDF     ", b"UnFinMF "), "mdf:read_mdf"),
    Format("ROS bag", _begins(b"#ROSBAG V", b"\x89MCAP0\r\n", b"SQLite format 3\0"), "ros:read_ros"),
    Format("MAT v4 or v5", _is_mat, "mat:read_mat"),
    Format("not read", is_unread, "unread:refuse"),
    Format("text", lambda _: True, "text:read_text"),
)


def format_of(head: bytes) -> Format:
    """The first format that recognises the bytes; text is the last."""
    return next(form for form in FORMATS if form.is_it(head))
