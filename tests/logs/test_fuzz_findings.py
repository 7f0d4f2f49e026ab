"""Damaged files on which libraries break down: refused in a sentence, or read right, and this process lives on."""

import io
import sys
import zlib
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from eaid.apparatus import Apparatus
from eaid.errors import DataError
from eaid.logs.dataset import read_dataset, write_dataset
from eaid.logs.foreign.hdf5 import read_hdf5
from eaid.logs.foreign.ros import read_ros
from eaid.logs.read import read_runs
from eaid.logs.run import Run

sys.path.insert(0, str(Path(__file__).parent))
import logs_written as written


def _mat(columns: dict[str, object]) -> bytearray:
    file = io.BytesIO()
    savemat(file, columns)
    return bytearray(file.getvalue())


def complex_without_its_half(path: Path) -> None:
    """SciPy ends the process (SIGSEGV) where a matrix lacks an element of its class."""
    data = _mat({"time": np.arange(40.0), "torque": np.arange(40.0)})
    data[145] |= 0x08
    path.write_bytes(data)


def text_of_no_kind(path: Path) -> None:
    """Its values are float64, which are no letters."""
    data = _mat({"torque": np.arange(40.0)})
    data[144] = 4
    path.write_bytes(data)


def cell_whose_parts_end_early(path: Path) -> None:
    """A part that is shorter than it says makes SciPy read on in the next one."""
    cell = np.empty((1, 2), dtype=object)
    cell[0, 0], cell[0, 1] = np.arange(20.0), np.arange(20.0)
    data = _mat({"c": cell, "t": np.arange(20.0)})
    at = data.index(np.arange(20.0).tobytes()) - 4
    data[at : at + 4] = (80).to_bytes(4, "little")
    path.write_bytes(data)


def billion_scales(path: Path) -> None:
    """npTDMS makes an object for each scale that a file claims to have."""
    nptdms = pytest.importorskip("nptdms")
    with nptdms.TdmsWriter(str(path)) as file:
        said = {"NI_Number_Of_Scales": 1 << 30}
        file.write_segment([nptdms.ChannelObject("Log", "torque", np.arange(40.0), said)])


def circle_of_blocks(path: Path) -> None:
    """asammdf follows blocks that point in a circle for ever."""
    asammdf = pytest.importorskip("asammdf")
    with asammdf.MDF(version="4.10") as file:
        for _ in range(2):
            file.append([asammdf.Signal(np.arange(9.0), np.arange(9.0), name="torque")])
        saved = file.save(path.with_suffix(".mf4"), overwrite=True)
    data = bytearray(Path(saved).read_bytes())
    Path(saved).unlink()
    first = data.index(b"##DG")
    second = data.index(b"##DG", first + 1)
    path.write_bytes(data.replace(second.to_bytes(8, "little"), first.to_bytes(8, "little")))


def class_of_matlab_that_is_a_number(path: Path) -> None:
    """bytes(n) are n zeros: 8 GB of them."""
    with h5py.File(path, "w", userblock_size=512) as file:
        file["time"], file["torque"] = np.arange(40.0), np.arange(40.0)
        file["torque"].attrs["MATLAB_class"] = np.int64(1 << 33)
    path.write_bytes(b"MATLAB 7.3 MAT-file".ljust(512) + path.read_bytes()[512:])


def heap_without_free_space(path: Path) -> None:
    """The HDF5 library goes round for ever in a heap of texts whose free space has no size."""
    with h5py.File(path, "w") as file:
        file.attrs["schema"] = "eaid/data/1"
        file["time"], file["torque"] = np.arange(40.0), np.arange(40.0)
    data = bytearray(path.read_bytes())
    at = data.index(b"GCOL") + 16
    while int.from_bytes(data[at : at + 2], "little"):
        at += 16 + -(-int.from_bytes(data[at + 8 : at + 16], "little") // 8) * 8
    data[at + 8 : at + 16] = bytes(8)
    path.write_bytes(data)


DAMAGED = (
    complex_without_its_half, text_of_no_kind, cell_whose_parts_end_early, billion_scales, circle_of_blocks,
    class_of_matlab_that_is_a_number, heap_without_free_space,
)  # fmt: skip


@pytest.mark.parametrize("damage", DAMAGED, ids=lambda f: f.__name__)
def test_what_breaks_a_library_is_refused(
    tmp_path: Path, damage: Callable[[Path], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("eaid.logs.foreign.ask.LONGEST_S", 4.0)
    path = tmp_path / "log"
    damage(path)
    with pytest.raises(DataError, match="damaged|takes longer|far more memory|holds no|no column|no table"):
        read_runs([path])


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
    with pytest.raises(DataError):
        read_runs([path])


@pytest.mark.parametrize("settings", [{}, {"fletcher32": True}, {"compression": "lzf"}, {"compression": "gzip"},
                                      {"compression": "gzip", "shuffle": True, "fletcher32": True},
                                      {"compression": "lzf", "fletcher32": True}, {"scaleoffset": 9}])  # fmt: skip
def test_hdf5_chunks_as_the_library_writes_them(tmp_path: Path, settings: dict[str, object]) -> None:
    path = tmp_path / "log.h5"
    values = np.sin(np.arange(1000.0))
    with h5py.File(path, "w") as file:
        for name in ("time", "torque"):
            file.create_dataset(name, data=values, chunks=(64,), **settings)
    (table,) = read_hdf5(path, "log")
    np.testing.assert_allclose(table.load([1]).values[0], values, atol=1e-8)


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
    with pytest.raises(DataError, match="damaged Parquet file .*CRC"):
        read_runs([path])


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
    (table,) = read_ros(path, "log")
    with pytest.raises(DataError, match="/ft has 299 messages where the bag counts 300"):
        table.load([torque])


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


FULL = np.arange(1000.0).tobytes()
CHUNKS = {
    "deflated short": (zlib.compress(FULL[:800]), 0, {"compression": "gzip"}),
    "deflated long": (zlib.compress(FULL * 2), 0, {"compression": "gzip"}),
    "no deflate": (b"nothing of the kind", 0, {"compression": "gzip"}),
    "filter passed over": (FULL[:800], 1, {"compression": "gzip"}),
    "plain short": (FULL[:800], 0, {}),
    "checksum alone": (b"12", 0, {"fletcher32": True}),
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
    with pytest.raises(DataError, match="is a damaged HDF5 file"):
        read_runs([path])
