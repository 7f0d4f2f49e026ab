"""Which bytes at a file's beginning say what it is, to the byte."""

import gzip
from pathlib import Path

import pytest

from eaid.errors import DataError
from eaid.logs.formats import FORMATS, UNREAD, format_of, unread
from eaid.logs.read import read_runs


def mat_v4(kind: int = 0, rows: int = 9, columns: int = 3, imaginary: int = 0, name: bytes = b"log\0") -> bytes:
    words = (kind, rows, columns, imaginary, len(name))
    return b"".join(word.to_bytes(4, "little") for word in words) + name + bytes(9)


@pytest.mark.parametrize(
    ("head", "is_mat"),
    [
        (mat_v4(), True), (mat_v4(52), True), (mat_v4(53), False), (mat_v4(999), False), (mat_v4(1000), True),
        (mat_v4(1052), True), (mat_v4(1053), False), (mat_v4(imaginary=1), True), (mat_v4(imaginary=2), False),
        (mat_v4(rows=1), True), (mat_v4(rows=0), False), (mat_v4(columns=1), True), (mat_v4(columns=0), False),
        (mat_v4(name=b"t\0"), True), (mat_v4(name=b"\0"), False),
        (mat_v4(name=b"a" * 62 + b"\0"), True), (mat_v4(name=b"a" * 63 + b"\0"), False),
        (mat_v4(name=b"a_1\0"), True), (mat_v4(name=b"a-1\0"), False), (mat_v4(name=b"abcd"), False),
        (mat_v4()[:24], False),  # no more than a header
        (bytes(124) + b"\x00\x01IM", True), (bytes(124) + b"\x01\x00MI", True), (bytes(125) + b"\x00\x01IM", False),
        (b"MATLAB 5.0 MAT-file", True), (b"MATLAB 6.0", False),
    ],
)  # fmt: skip
def test_mat_files_by_their_first_header(head: bytes, is_mat: bool) -> None:
    assert (format_of(head).name == "MAT") is is_mat


def test_mat_files_of_a_machine_of_the_other_order() -> None:
    words = (1000, 9, 3, 0, 4)
    assert format_of(b"".join(word.to_bytes(4, "big") for word in words) + b"log\0" + bytes(9)).name == "MAT"


@pytest.mark.parametrize(
    ("head", "name"),
    [
        (b"\xef\xbb\xbfLabVIEW Measurement\r\n", "LVM"), (b"ARROW1\0\0", "Arrow"), (b"MDF     3.30", "MDF"),
        (b"UnFinMF 4.10", "MDF"), (b"#ROSBAG V2.0\n", "ROS bag"), (b"\x89MCAP0\r\n", "ROS bag"),
        (b"SQLite format 3\0", "ROS bag"), (b"\x93NUMPY\x01", "NumPy"), (b"#ROSBAG", "text"), (b"", "text"),
    ],
)  # fmt: skip
def test_other_formats(head: bytes, name: str) -> None:
    assert format_of(head).name == name


def test_every_mark_of_what_is_not_read() -> None:
    for mark, said in UNREAD:
        assert (unread(mark + b"rest"), format_of(mark).name) == (said, "not read")
        assert unread(b" " + mark) is None
    assert [unread(bytes((0x80, n))) is not None for n in range(1, 7)] == [False, True, True, True, True, False]
    assert len({form.name for form in FORMATS}) == len(FORMATS)


def padded(path: Path, blanks: int, rows: int = 60) -> Path:
    """A gzip whose rows, but for the first ten, end with so many blanks, which pack by about a thousand."""
    lines = ["time_s,duty_pct,torque_nm", *(f"{k / 10},{60 * (k > 20)},{k}" for k in range(rows))]
    path.write_bytes(gzip.compress("\n".join(line + " " * blanks * (k > 10) for k, line in enumerate(lines)).encode()))
    return path


def test_a_small_log_may_pack_as_well_as_it_will(tmp_path: Path) -> None:
    """A bomb is told by its ratio, but only beyond 4 MiB."""
    path = padded(tmp_path / "a.csv.gz", 20_000)
    assert 200 * path.stat().st_size < 50 * 20_000
    (run,) = read_runs([path])
    assert len(run.time_s) == 60
    with pytest.raises(DataError, match="unpacks to more than 200 times its size"):
        read_runs([padded(tmp_path / "b.csv.gz", 90_000)])
