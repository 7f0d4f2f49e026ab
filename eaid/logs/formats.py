"""The formats that logs come in, each told by its first bytes, never by the ending of its name."""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from eaid.logs.hdf import is_hdf5, read_hdf5
from eaid.logs.lvm import is_lvm, read_lvm
from eaid.logs.mat import read_mat
from eaid.logs.mdf import is_mdf, read_mdf
from eaid.logs.parquet import is_parquet, read_parquet
from eaid.logs.ros import is_ros, read_ros
from eaid.logs.sheet import Sheet
from eaid.logs.tdms import is_tdms, read_tdms
from eaid.logs.text import read_text
from eaid.logs.unread import is_unread, refuse


class Format(NamedTuple):
    """One row of the table of formats."""

    name: str
    is_it: Callable[[bytes], bool]
    """Tells it by the first 4 KiB of a file."""
    read: Callable[[Path, str], list[Sheet]]


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
    Format("HDF5 or MAT v7.3", is_hdf5, read_hdf5),
    Format("LabVIEW LVM", is_lvm, read_lvm),
    Format("TDMS", is_tdms, read_tdms),
    Format("Parquet", is_parquet, read_parquet),
    Format("MDF", is_mdf, read_mdf),
    Format("ROS bag", is_ros, read_ros),
    Format("MAT v4 or v5", _is_mat, read_mat),
    Format("not read", is_unread, refuse),
    Format("text", lambda _: True, read_text),
)


def format_of(head: bytes) -> Format:
    """The first format that recognises the bytes; text is the last."""
    return next(form for form in FORMATS if form.is_it(head))
