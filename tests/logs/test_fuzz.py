"""Readers on anything at all: random bytes, mutated files, mutated cells. Only refusals come out, no wrong number."""

import contextlib
import gzip
import re
import sys
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest
from eaid.logs.options import ReadOptions
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from eaid.apparatus import Apparatus
from eaid.cli.inputs import runs_from
from eaid.errors import DataError, UsageError
from eaid.logs.dataset import write_dataset
from eaid.logs.foreign.ask import ForeignReader
from eaid.logs.foreign.lvm import read_lvm
from eaid.logs.formats import format_of, unread
from eaid.logs.read import read_runs, read_what_can_be
from eaid.logs.run import Run
from eaid.logs.text import read_text

sys.path.insert(0, str(Path(__file__).parent))
import logs_written as written

NOTHING = ReadOptions()
LIBRARIES = {"tdms": "nptdms", "parquet": "pyarrow", "mdf": "asammdf", "ros1": "rosbags", "mcap": "rosbags",
             "sqlite": "rosbags"}  # fmt: skip
MAGIC = (
    b"", b"\x1f\x8b\x08\x00", b"\x89HDF\r\n\x1a\n", b"TDSm\x0e\x00\x00\x00\x69\x12\x00\x00", b"PAR1",
    b"#ROSBAG V2.0\nE\x00\x00\x00", b"\x89MCAP0\r\n\x01",
    b"SQLite format 3\0", b"LabVIEW Measurement\t\n",
    b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM\x0f\x00\x00\x00", b"\xff\xfe", b"\x93NUMPY\x01\x00", b"PK\x03\x04",
)  # fmt: skip
LVM = (
    "LabVIEW Measurement\t\nSeparator\tTab\nDecimal_Separator\t.\nX_Columns\tOne\n***End_of_Header***\n\n"
    "Channels\t1\nY_Unit_Label\tNm\nX_Dimension\tTime\nX0\t0\nDelta_X\t0.01\n***End_of_Header***\n"
    "X_Value\tTorque\tComment\n" + "".join(f"{i / 100}\t{i}\n" for i in range(30))
)


@pytest.fixture(scope="module")
def foreign():
    """The isolated reader, one for all files of these tests."""
    with ForeignReader() as reader:
        yield reader


def load_all(path: Path, foreign: ForeignReader) -> None:
    """Read a file and every column in it; refusals are what is wanted."""
    head = path.read_bytes()[:4096]
    form = format_of(head)
    try:
        tables = foreign.tables(form, path, "log") if form.reader else read_text(path, "log")
        for table in tables if unread(head) is None else []:
            table.load(range(len(table.columns)))
    except (DataError, UsageError) as refusal:
        assert all(sentence.startswith("log: ") for sentence in refusal.sentences)  # noqa: PT017


@pytest.fixture(scope="module")
def seeds(tmp_path_factory):
    """A valid file of each format, as bytes."""
    folder = tmp_path_factory.mktemp("seeds")
    made: dict[str, bytes] = {}

    def seed(name: str) -> bytes:
        if name in LIBRARIES:
            pytest.importorskip(LIBRARIES[name])
        if name not in made:
            made[name] = _seed(name, folder / name)
        return made[name]

    return seed


def _seed(name: str, path: Path) -> bytes:
    t, duty, torque = written.step(60 if name in ("text", "gzip") else 250)
    if name in ("text", "gzip"):
        rows = "".join(f"{a:.4f},{b:g},{c:.6f}\n" for a, b, c in zip(t, duty, torque, strict=True))
        data = ("# rate: 200 Hz\ntime_s,duty_pct,torque_nm\n" + rows).encode()
        return gzip.compress(data) if name == "gzip" else data
    if name == "lvm":
        return LVM.encode()
    if name.startswith("mat"):
        from scipy.io import savemat

        columns = {"log": np.stack([t, duty, torque])} if name == "mat4" else {"s": {"time": t, "torque": torque}}
        savemat(path, columns, appendmat=False, format="4" if name == "mat4" else "5", do_compression=name == "matz")
    elif name == "hdf5":
        import h5py

        with h5py.File(path, "w") as file:
            file.create_dataset("time", data=t, compression="gzip")
            file["torque"] = torque
    elif name in ("mcap", "sqlite"):
        written.ros2(path, t, duty, torque, storage="mcap" if name == "mcap" else "sqlite3")
    else:
        getattr(written, name)(path, t, duty, torque)
    return path.read_bytes()


BRIEF = settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


@given(magic=st.sampled_from(MAGIC), rest=st.binary(max_size=600))
@settings(BRIEF, max_examples=150)
def test_random_bytes(tmp_path, foreign, magic, rest):
    path = tmp_path / "log"
    path.write_bytes(magic + rest)
    load_all(path, foreign)


EDITS = st.lists(
    st.tuples(
        st.floats(0, 1), st.sampled_from(("set", "drop", "copy", "cut")), st.integers(0, 255), st.integers(1, 60)
    ),
    min_size=1,
    max_size=6,
)


def edited(data: bytes, edits) -> bytes:
    """A file with some bytes set, dropped or doubled, or cut off."""
    changed = bytearray(data)
    for place, how, byte, length in edits:
        at = int(place * (len(changed) - 1)) if changed else 0
        if how == "set" and changed:
            changed[at] = byte
        elif how == "drop":
            del changed[at : at + length]
        elif how == "copy":
            changed[at:at] = changed[at : at + length]
        elif how == "cut" and length > 50:
            del changed[at:]
    return bytes(changed)


@pytest.mark.parametrize(
    "name", ["text", "gzip", "lvm", "mat4", "mat5", "matz", "hdf5", "tdms", "parquet", "mdf", "ros1", "mcap", "sqlite"]
)
def test_mutated_files(tmp_path, seeds, foreign, name, monkeypatch):
    monkeypatch.setattr("eaid.logs.foreign.ask.LONGEST_S", 1.0)
    data = seeds(name)

    @given(edits=EDITS)
    @settings(BRIEF, max_examples=5 if name in ("mdf", "sqlite") else 20)
    def tried(edits):
        path = tmp_path / "log"
        path.write_bytes(edited(data, edits))
        load_all(path, foreign)

    tried()


def test_a_mutated_dataset_gives_the_numbers_that_were_written_or_none(tmp_path):
    """Unless its attributes are no longer sealed: then they are the user's."""
    t, duty, torque = written.step(60)
    path = tmp_path / "data.h5"
    run = Run(
        name="a", time_s=t, input=duty, output=torque, input_unit="%", output_unit="N·m", source="a.csv",
        sha256="0" * 64, level=60.0, repeat=1, step_s=0.1, baseline=0.0,
    )  # fmt: skip
    write_dataset(path, [run], kind="clutch", apparatus=Apparatus())
    data = path.read_bytes()

    @given(edits=EDITS)
    @settings(BRIEF, max_examples=100)
    def tried(edits):
        path.write_bytes(edited(data, edits))
        try:
            runs, _ = read_what_can_be([path], NOTHING)
        except (DataError, UsageError):
            return
        for found in runs:
            assert (found.name, found.level, found.repeat, found.step_s) == ("a", 60.0, 1, 0.1)
            for name in ("time_s", "input", "output"):
                np.testing.assert_array_equal(getattr(found, name), getattr(run, name))

    tried()


MANIFEST = """schema = "eaid/manifest/1"
[options]
kind = "clutch"
columns = "time=time_s,output=3"
rate = 200.0
repair = true
[[log]]
file = "a.csv"
sha256 = "00"
repeat = 1
level = 60.0
"""


@given(edits=EDITS)
@settings(BRIEF, max_examples=100)
def test_a_mutated_manifest(tmp_path, edits):
    (tmp_path / "a.csv").write_text("time_s,duty_pct,torque_nm\n" + "0.1,60,1.0\n" * 20)
    (tmp_path / "dataset.toml").write_bytes(edited(MANIFEST.encode(), edits))
    with contextlib.suppress(DataError, UsageError):
        runs_from([tmp_path])


CELL = st.text(st.characters(codec="ascii", exclude_characters="\r\n", exclude_categories=("Cc",)), max_size=12)
NEARLY = st.builds(lambda a, b, c: a + b + c, st.sampled_from(["", "-", "+", " ", '"']),
                   st.from_regex(r"[0-9]{0,4}[.,]?[0-9]{0,3}([eEdD][+-]?[0-9]{1,3})?", fullmatch=True),
                   st.sampled_from(["", " ", "x", "_1", "%", '"', " 2", "\t"]))  # fmt: skip


def meaning(cell: str) -> float | None:
    """What a cell means where the decimal mark is a point, by the simplest rule; None where it means nothing."""
    bare = cell.strip().strip('"').strip()
    if cell.strip().startswith('"') and re.fullmatch(r"[+-]?[1-9]\d{0,2}(,\d{3})+(\.\d*)?", bare):
        bare = bare.replace(",", "")  # between thousands
    if not re.fullmatch(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eEdD][+-]?[0-9]+)?", bare):
        return None
    value = float(re.sub("[dD]", "e", bare))
    return value if np.isfinite(value) else None


@given(cell=CELL | NEARLY, row=st.integers(0, 199), column=st.sampled_from([1, 2]), quick=st.booleans())
@settings(BRIEF, max_examples=200)
def test_a_mutated_cell_is_read_as_it_stands_or_refused(tmp_path, cell, row, column, quick):
    t, duty, torque = written.step(400)
    t, duty, torque = t[100:300], duty[100:300], torque[100:300]
    cells = [[f"{a:.4f}", f"{b:g}", f"{c:.6f}"] for a, b, c in zip(t, duty, torque, strict=True)]
    cells[row][column] = cell
    cell = re.sub(r',[\s"]*$', "", cell) if column == 2 else cell  # a row may end with a delimiter
    path = tmp_path / "log.csv"
    path.write_text("time_s,duty_pct,torque_nm\n" + "\n".join(",".join(one) for one in cells) + "\n")
    cells[row][column] = cell
    expected = np.array([[meaning(one) for one in line] for line in cells], dtype=object)
    with contextlib.nullcontext() if quick else patch("eaid.logs.text.by_arrow", lambda *_: None):
        try:
            (run,) = read_runs([path], NOTHING)
        except DataError as refusal:
            assert f"row {row + 2}" in str(refusal) or meaning(cell) is not None  # noqa: PT017
            return
    assert ("," not in cell or '"' in cell) and expected[row, column] is not None
    np.testing.assert_allclose(run.time_s + run.start_s, expected[:, 0].astype(float), atol=1e-12)
    np.testing.assert_array_equal(run.input, expected[:, 1].astype(float))
    np.testing.assert_array_equal(run.output, expected[:, 2].astype(float))


@given(cell=CELL | NEARLY, row=st.integers(0, 29))
@settings(BRIEF, max_examples=100)
def test_a_mutated_cell_of_an_lvm_is_read_or_told(tmp_path, cell, row):
    lines = LVM.splitlines()
    lines[13 + row] = f"{row / 100}\t{cell}"
    path = tmp_path / "log.lvm"
    path.write_text("\n".join(lines) + "\n")
    try:
        (table,) = read_lvm(path, "log")
    except DataError:
        return
    cells = table.load([0, 1])
    if cells.bad:
        assert [bad.row for bad in cells.bad] == [row]
        return
    wanted = [float(i) for i in range(30)]
    wanted[row] = float(cell.partition("\t")[0].strip(' "').upper().replace("D", "E"))
    np.testing.assert_array_equal(cells.values[1], wanted)


def test_a_lone_return_ends_a_line(tmp_path):
    """Line ends of several kinds in one file: \\n, \\r\\n and \\r."""
    t, duty, torque = written.step(400)
    ends = ["\n", "\r\n", "\r"]
    rows = "".join(
        f"{a:.4f},{b:g},{c:.6f}{ends[i % 3]}" for i, (a, b, c) in enumerate(zip(t, duty, torque, strict=True))
    )
    path = tmp_path / "log.csv"
    path.write_text("# a\r# note\ntime_s,duty_pct,torque_nm\n" + rows, newline="")
    (run,) = read_runs([path], NOTHING)
    np.testing.assert_array_equal(run.time_s, np.round(t, 4))
