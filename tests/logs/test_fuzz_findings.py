"""What fuzzing found (`benchmarks/fuzz_readers.py`), each made small by hand: refused in a sentence, or read right."""

import io
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from eaid.errors import DataError
from eaid.logs.mat import read_mat
from eaid.logs.tdms import read_tdms


def mat(columns: dict[str, object]) -> bytearray:
    file = io.BytesIO()
    savemat(file, columns)
    return bytearray(file.getvalue())


def complex_without_its_half(data: bytearray) -> None:
    data[145] |= 0x08


def sparse_without_its_rows(data: bytearray) -> None:
    data[144] = 5


def text_of_no_kind(data: bytearray) -> None:
    data[144] = 4  # its values are float64, which are no letters


def unknown_class(data: bytearray) -> None:
    data[144] = 99


@pytest.mark.parametrize(
    "damage",
    [complex_without_its_half, sparse_without_its_rows, text_of_no_kind, unknown_class],
    ids=lambda f: f.__name__,
)
def test_a_mat_matrix_with_other_parts_than_its_class_has(tmp_path: Path, damage) -> None:
    """SciPy ends the process (SIGSEGV) where a matrix lacks an element of its class."""
    data = mat({"torque": np.arange(40.0)})
    assert data[144] == 6
    path = tmp_path / "log.mat"
    path.write_bytes(data)
    assert len(read_mat(path, "log")) == 1
    damage(data)
    path.write_bytes(data)
    with pytest.raises(DataError, match="log: is a damaged MAT-file"):
        read_mat(path, "log")


def test_a_mat_cell_whose_parts_end_early(tmp_path: Path) -> None:
    """A part that is shorter than it says makes SciPy read on in the next one."""
    cell = np.empty((1, 2), dtype=object)
    cell[0, 0], cell[0, 1] = np.arange(20.0), np.arange(20.0)
    data = mat({"c": cell, "t": np.arange(20.0), "y": np.arange(20.0)})
    at = data.index(np.arange(20.0).tobytes()) - 4
    assert int.from_bytes(data[at : at + 4], "little") == 160
    data[at : at + 4] = (80).to_bytes(4, "little")
    path = tmp_path / "log.mat"
    path.write_bytes(data)
    with pytest.raises(DataError, match="a part of a wrong length"):
        read_mat(path, "log")


def test_mat_field_names_without_an_end(tmp_path: Path) -> None:
    """SciPy reads the name of a field up to the next zero, wherever that is."""
    data = mat({"s": {"time": np.arange(20.0), "torque": np.arange(20.0)}})
    at = data.index(b"torque\0")
    length = len(data[at:].partition(b"torque")[2]) - len(data[at:].partition(b"torque")[2].lstrip(b"\0"))
    data[at + 6 : at + 6 + length] = b"x" * length
    path = tmp_path / "log.mat"
    path.write_bytes(data)
    with pytest.raises(DataError, match="field names without an end|damaged"):
        read_mat(path, "log")


@pytest.mark.parametrize("said", [{"NI_Number_Of_Scales": 1 << 30}, {"NI_Scale[99999999]_Scale_Type": "Linear"}])
@pytest.mark.parametrize("where", ["channel", "group", "file"])
def test_a_tdms_channel_of_a_billion_scales(tmp_path: Path, said: dict[str, object], where: str) -> None:
    """npTDMS makes an object for each scale that a file claims to have."""
    nptdms = pytest.importorskip("nptdms")
    path = tmp_path / "log.tdms"
    with nptdms.TdmsWriter(str(path)) as file:
        file.write_segment(
            [
                nptdms.RootObject(said if where == "file" else {}),
                nptdms.GroupObject("Log", said if where == "group" else {}),
                nptdms.ChannelObject("Log", "torque", np.arange(40.0), said if where == "channel" else {}),
            ]
        )
    with pytest.raises(DataError, match="scales for a channel"):
        read_tdms(path, "log")
