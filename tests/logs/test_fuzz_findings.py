"""What fuzzing found (`benchmarks/fuzz_readers.py`), each made small by hand: refused in a sentence, or read right."""

import io
import signal
import struct
import subprocess
import sys
import zlib
from itertools import pairwise
from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from eaid.apparatus import Apparatus
from eaid.errors import DataError
from eaid.logs.dataset import is_dataset, read_dataset, write_dataset
from eaid.logs.hdf import read_hdf5
from eaid.logs.mat import read_mat
from eaid.logs.mdf import read_mdf
from eaid.logs.parquet import read_parquet
from eaid.logs.read import read_runs
from eaid.logs.ros import read_ros
from eaid.logs.run import Run
from eaid.logs.tdms import read_tdms

sys.path.insert(0, str(Path(__file__).parent))
import logs_written as written

HDF5 = b"\x89HDF\r\n\x1a\n"


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


def sealed(path: Path) -> bytearray:
    """A data.h5 of eaid."""
    t = np.arange(40) / 200
    run = Run(
        name="a", time_s=t, input=np.full(40, 60.0), output=t, input_unit="%", output_unit="N·m", source="a.csv",
        sha256="0" * 64, level=60.0, repeat=1, step_s=0.0, baseline=0.0,
    )  # fmt: skip
    write_dataset(path, [run], kind="clutch", apparatus=Apparatus())
    return bytearray(path.read_bytes())


def test_no_byte_of_a_dataset_changes_unseen(tmp_path: Path) -> None:
    """Its structure and its columns carry checksums, its attributes a digest: the same numbers come out, or none."""
    path = tmp_path / "data.h5"
    data = sealed(path)
    (whole,), _ = read_dataset(path, "log", "")
    refused = 0
    for at in range(7, len(data), len(data) // 300):
        changed = bytearray(data)
        changed[at] ^= 1 << at % 8
        path.write_bytes(changed)
        try:
            runs, faults = read_dataset(path, "log", "")
        except DataError:
            refused += 1
            continue
        refused += bool(faults)
        for run in runs:
            assert (run.name, run.level, run.step_s, run.sha256) == (
                whole.name,
                whole.level,
                whole.step_s,
                whole.sha256,
            )
            assert np.array_equal(run.output, whole.output)
            assert np.array_equal(run.input, whole.input)
            assert np.array_equal(run.time_s, whole.time_s)
    assert refused > 20


def test_a_schema_that_is_no_text(tmp_path: Path) -> None:
    """The HDF5 library ends the process on sequences where a changed byte says that a text is one."""
    path = tmp_path / "log.h5"
    with h5py.File(path, "w") as file:
        file.attrs["schema"] = "eaid/data/1"
        file["time"], file["torque"] = np.arange(40.0), np.arange(40.0)
    data = bytearray(path.read_bytes())
    at = data.index(b"schema\0\0") + 8
    assert data[at : at + 2] == b"\x19\x01"  # version 1, of free length; a text (1)
    data[at + 1] = 0x42
    path.write_bytes(data)
    assert not is_dataset(path)
    assert len(read_hdf5(path, "log")) == 1


FULL = np.arange(1000.0).tobytes()
CHUNKS = {
    "deflated short": (zlib.compress(FULL[:800]), 0, {"compression": "gzip"}),
    "deflated long": (zlib.compress(FULL * 2), 0, {"compression": "gzip"}),
    "no deflate": (b"nothing of the kind", 0, {"compression": "gzip"}),
    "filter passed over": (FULL[:800], 1, {"compression": "gzip"}),
    "plain short": (FULL[:800], 0, {}),
    "checksum alone": (b"12", 0, {"fletcher32": True}),
    "checksum of deflated": (b"123", 0, {"fletcher32": True, "compression": "gzip"}),
}


@pytest.mark.parametrize("how", CHUNKS)
def test_an_hdf5_chunk_of_a_wrong_length(tmp_path: Path, how: str) -> None:
    """The HDF5 library gives out what lies behind a short chunk in memory as numbers, or ends the process."""
    payload, passed_over, settings = CHUNKS[how]
    path = tmp_path / "log.h5"
    with h5py.File(path, "w") as file:
        file["time"] = np.arange(1000.0)
        column = file.create_dataset("torque", (1000,), "f8", chunks=(1000,), **settings)
        column.id.write_direct_chunk((0,), payload, passed_over)
    (sheet,) = read_hdf5(path, "log")
    with pytest.raises(DataError, match="torque is damaged .a chunk of it"):
        sheet.load([0, 1])


@pytest.mark.parametrize("settings", [{}, {"fletcher32": True}, {"compression": "lzf"}, {"compression": "gzip"},
                                      {"compression": "gzip", "shuffle": True, "fletcher32": True},
                                      {"compression": "lzf", "fletcher32": True}, {"scaleoffset": 9}])  # fmt: skip
def test_hdf5_chunks_as_the_library_writes_them(tmp_path: Path, settings: dict[str, object]) -> None:
    path = tmp_path / "log.h5"
    values = np.sin(np.arange(1000.0))
    with h5py.File(path, "w") as file:
        for name in ("time", "torque"):
            file.create_dataset(name, data=values, chunks=(64,), **settings)
    (sheet,) = read_hdf5(path, "log")
    np.testing.assert_allclose(sheet.load([1]).values[0], values, atol=1e-8)


def test_a_chunk_larger_than_its_file(tmp_path: Path) -> None:
    """A chunk is unpacked whole, however few of its values belong to the array."""
    path = tmp_path / "log.h5"
    with h5py.File(path, "w") as file:
        file.create_dataset("time", (40,), "f8", chunks=(1 << 27,), maxshape=(None,))
        file["torque"] = np.arange(40.0)
    with pytest.raises(DataError, match="time claims"):
        read_hdf5(path, "log")


def test_a_class_of_matlab_that_is_a_number(tmp_path: Path) -> None:
    """bytes(n) are n zeros: 8 GB of them."""
    path = tmp_path / "log.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        file["time"], file["torque"] = np.arange(40.0), np.arange(40.0)
        file["time"].attrs["MATLAB_class"] = np.int64(1 << 33)
        file["torque"].attrs["MATLAB_class"] = np.int64(1 << 33)
    path.write_bytes(b"MATLAB 7.3 MAT-file".ljust(512) + path.read_bytes()[512:])
    with pytest.raises(DataError):
        read_hdf5(path, "log")


@pytest.mark.skipif(sys.platform != "linux", reason="memory is bounded by the kernel, as Linux does it")
def test_an_mdf_block_that_unpacks_to_more_than_its_channels_have(tmp_path: Path) -> None:
    """asammdf unpacks a block to the last byte, whatever the records need: 128 MB for a file of 0.6 MB."""
    asammdf = pytest.importorskip("asammdf")
    path = tmp_path / "log.mf4"
    with asammdf.MDF(version="4.10") as file:
        t = np.arange(2000) / 200
        file.append([asammdf.Signal(np.sin(t), t, name="torque")])
        file.save(path, overwrite=True, compression=1)
    data = bytearray(path.read_bytes())
    at = data.index(b"##DZ")
    packed = zlib.compress(bytes(1 << 27), 1)
    head = data[at : at + 32] + struct.pack("<QQ", 16 * len(t), len(packed))
    head[8:16] = (48 + len(packed)).to_bytes(8, "little")
    data += bytes(-len(data) % 8)
    data = data.replace(at.to_bytes(8, "little"), len(data).to_bytes(8, "little"))
    path.write_bytes(data + head + packed)
    with pytest.raises(DataError, match="takes far more memory"):
        read_mdf(path, "log")[0].load([0, 1])


def test_a_parquet_page_whose_checksum_is_wrong(tmp_path: Path) -> None:
    """Parquet's checksums are optional and not looked at unless asked for; where there are some, they count."""
    pytest.importorskip("pyarrow")
    import pyarrow
    import pyarrow.parquet as pq

    path = tmp_path / "log.parquet"
    t = np.arange(200) / 200 + 0.123
    table = pyarrow.table({"time": t, "torque": t})
    pq.write_table(table, path, compression="none", use_dictionary=False, write_page_checksum=True)
    data = bytearray(path.read_bytes())
    data[data.index(t[7:9].tobytes())] ^= 1
    path.write_bytes(data)
    (sheet,) = read_parquet(path, "log")
    with pytest.raises(DataError, match="damaged Parquet file .*CRC"):
        sheet.load([0, 1])


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="processor time is not bounded here")
def test_an_mdf_file_whose_blocks_point_in_a_circle(tmp_path: Path) -> None:
    """asammdf follows them for ever."""
    asammdf = pytest.importorskip("asammdf")
    path = tmp_path / "log.mf4"
    with asammdf.MDF(version="4.10") as file:
        for _ in range(2):
            file.append([asammdf.Signal(np.arange(9.0), np.arange(9.0), name="torque")])
        file.save(path, overwrite=True)
    data = bytearray(path.read_bytes())
    first = data.index(b"##DG")
    second = data.index(b"##DG", first + 1)
    data = data.replace(second.to_bytes(8, "little"), first.to_bytes(8, "little"))
    path.write_bytes(data)
    hurried = "from eaid.logs import mdf_apart; mdf_apart.SLOWEST_S = 1.0; raise SystemExit(mdf_apart.main())"
    done = subprocess.run([sys.executable, "-c", hurried, str(path)], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout.partition(" to read")[0]) == (3, "takes more than 1 s")


def test_an_mcap_message_that_swallows_the_next(tmp_path: Path) -> None:
    """rosbags passes over what a wrong length covers; the bag's own count tells that messages are missing."""
    pytest.importorskip("rosbags")
    path = tmp_path / "log.mcap"
    written.ros2(path, *written.step(300))
    data = bytearray(path.read_bytes())
    (whole,) = read_ros(path, "log")
    torque = whole.columns.index("ft/wrench.torque.z")
    assert len(whole.load([torque]).values[0]) == 300
    at = data.index(b"clutch\0") - 46  # length, channel, number, two times, CDR, stamp, length of the text
    size = int.from_bytes(data[at : at + 8], "little")
    records = [i for i in range(len(data)) if data.startswith(b"\x05" + size.to_bytes(8, "little"), i)]
    at = next(i for i, after in pairwise(records) if after - i == 9 + size)
    data[at + 1 : at + 9] = (2 * size + 9).to_bytes(8, "little")
    path.write_bytes(data)
    (sheet,) = read_ros(path, "log")
    with pytest.raises(DataError, match="/ft has 299 messages where the bag counts 300"):
        sheet.load([torque])


def test_a_dataset_whose_schema_is_damaged_is_no_plain_log(tmp_path: Path) -> None:
    """It was read as an HDF5 log of three columns: its numbers, without level, step instant and baseline."""
    path = tmp_path / "data.h5"
    data = sealed(path)
    whole = read_runs([path])
    damaged = 0
    letters = range(start := data.index(b"eaid/data/1"), start + 11)
    for at in (*letters, *range(5, len(data), len(data) // 400)):
        changed = bytearray(data)
        changed[at] = 1
        path.write_bytes(changed)
        try:
            (run,) = read_runs([path])
        except DataError:
            damaged += 1
            continue
        assert (run.level, run.step_s) == (whole[0].level, whole[0].step_s)
    assert damaged > 20
