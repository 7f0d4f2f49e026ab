"""Formats read by libraries of their own: the libraries write, eaid reads; and what it says where one is missing."""

import sys
from pathlib import Path

import numpy as np
import pytest
from eaid.logs.options import ReadOptions

from eaid.errors import DataError
from eaid.logs.foreign.mdf import read_mdf
from eaid.logs.foreign.parquet import read_parquet
from eaid.logs.formats import FORMATS
from eaid.logs.read import read_runs, read_what_can_be

sys.path.insert(0, str(Path(__file__).parent))
from logs_written import mdf, parquet, ros1, ros2, step, tables, tdms

REAL = Path(__file__).parents[2] / "../shared/realdata/formats"
NOTHING = ReadOptions()
ROS = ReadOptions(columns={"input": "clutch/duty", "output": "ft/wrench.torque.z"})


def one(path, options=NOTHING):
    (run,) = read_runs([path], options)
    return run


def test_tdms_by_its_waveform_properties(tmp_path):
    pytest.importorskip("nptdms")
    t, duty, torque = step()
    run = one(tdms(tmp_path / "log", t + 3.5, duty, torque))
    np.testing.assert_allclose(run.time_s, t, atol=1e-14)
    assert run.start_s == 3.5
    np.testing.assert_array_equal(run.input, duty)
    np.testing.assert_allclose(run.output, torque, rtol=1e-14)
    assert (run.input_unit, run.output_unit, run.kind) == ("%", "N·m", "clutch")


def test_tdms_of_several_groups_is_chosen_from(tmp_path):
    nptdms = pytest.importorskip("nptdms")
    _, duty, torque = step()
    rate = {"wf_increment": 0.005, "wf_start_offset": 0.0}
    path = tmp_path / "log"
    with nptdms.TdmsWriter(str(path)) as file:
        for group, factor in (("Run 1", 1.0), ("Run 2", 2.0)):
            file.write_segment(
                [
                    nptdms.ChannelObject(group, "Duty", duty, rate),
                    nptdms.ChannelObject(group, "Torque", factor * torque, rate),
                ]
            )
    with pytest.raises(DataError, match=r"several tables .*Run 1, Run 2.*choose one with variable="):
        one(path)
    np.testing.assert_array_equal(one(path, ReadOptions(variable="Run 2")).output, 2 * torque)


def test_tdms_vectors_with_stamps_and_a_channel_of_another_rate(tmp_path):
    nptdms = pytest.importorskip("nptdms")
    t, duty, torque = step()
    stamps = np.datetime64("2024-10-29T16:18:17.5", "us") + np.round(t * 1e6).astype("timedelta64[us]")
    path = tmp_path / "log"
    with nptdms.TdmsWriter(str(path)) as file:
        file.write_segment(
            [
                nptdms.ChannelObject("g", "Time", stamps),
                nptdms.ChannelObject("g", "Duty", duty),
                nptdms.ChannelObject("g", "Torque", torque),
            ]
        )
    run = one(path)
    np.testing.assert_allclose(run.time_s, t, atol=1e-12)
    np.testing.assert_array_equal(run.output, torque)
    with nptdms.TdmsWriter(str(path)) as file:
        file.write_segment(
            [
                nptdms.ChannelObject("g", "Duty", duty[::4], {"wf_increment": 0.02, "wf_start_offset": 0.01}),
                nptdms.ChannelObject("g", "Torque", torque, {"wf_increment": 0.005, "wf_start_offset": 0.0}),
            ]
        )
    run = one(path)
    np.testing.assert_array_equal(run.output, torque[2:])
    # the step at 1 s is in the duty's sample at 1.00 s, which its offset makes 1.01 s
    np.testing.assert_array_equal(run.input, np.where(np.arange(2, 600) * 5 >= 1010, 60.0, 0.0))
    held = next(one for one in run.findings if one.code == "signals-held")
    assert held.values == {"columns": "Duty", "left_out": 2}


@pytest.mark.skipif(not REAL.is_dir(), reason="the recorded logs are not here")
def test_tdms_of_a_rig_comes_scaled():
    pytest.importorskip("nptdms")
    options = ReadOptions(columns={"output": "First  Channel"})
    run = one(REAL / "tdms_daqmx_scaled__raw1.tdms", options)
    assert len(run.output) == 2000
    assert run.output_unit == "V"
    # counts times the slope in the file, NI_Scale[1]_Linear_Slope
    np.testing.assert_allclose(run.output[:3] / 0.0003051850947599719, [-603, 485, -803], rtol=1e-12)
    np.testing.assert_allclose(run.time_s[-1], 1999 * 2e-5, rtol=1e-12)


@pytest.mark.parametrize("compression", ["uncompressed", "lz4"])
def test_feather_is_read_as_parquet_is(tmp_path, compression):
    pytest.importorskip("pyarrow")
    from pyarrow import feather
    from pyarrow import parquet as pq

    known = one(parquet(tmp_path / "log", *step()))
    feather.write_feather(pq.read_table(tmp_path / "log"), tmp_path / "log.feather", compression=compression)
    run = one(tmp_path / "log.feather")
    assert (run.name, run.output_unit, run.input_unit) == ("log", "N·m", "%")
    for name in ("time_s", "input", "output"):
        np.testing.assert_array_equal(getattr(run, name), getattr(known, name))


def test_numpy_records_and_matrices_are_read(tmp_path):
    t, duty, torque = step()
    names = ("time_s", "duty_pct", "torque_nm")
    np.save(tmp_path / "records.npy", np.rec.fromarrays((t, duty, torque), names=names))
    np.save(tmp_path / "matrix.npy", np.array([t, torque, duty]))  # a signal in each row
    known = one(tmp_path / "records.npy")
    run = one(tmp_path / "matrix.npy", ReadOptions(columns={"time": "1", "output": "2", "input": "3"}))
    for name, values in (("time_s", t), ("input", duty), ("output", torque)):
        np.testing.assert_array_equal(getattr(known, name), values)
        np.testing.assert_array_equal(getattr(run, name), values)
    np.save(tmp_path / "vector.npy", torque)
    with pytest.raises(DataError, match="save a matrix, or records"):
        one(tmp_path / "vector.npy")


def test_parquet_with_units_stamps_and_empty_cells(tmp_path):
    pa = pytest.importorskip("pyarrow")
    import pyarrow.parquet as pq

    t, duty, torque = step()
    run = one(parquet(tmp_path / "log", t, duty, torque))
    np.testing.assert_array_equal(run.time_s, t)
    np.testing.assert_allclose(run.output, torque, rtol=1e-14)
    assert run.output_unit == "N·m"
    stamps = np.datetime64("2024-10-29T16:18:17.123456789", "ns") + np.round(t * 1e9).astype("timedelta64[ns]")
    cells = [None if i == 7 else v for i, v in enumerate(torque.tolist())]
    pq.write_table(
        pa.table({"time": stamps, "duty": duty.astype("f4"), "torque": cells, "note": ["x"] * 600}), tmp_path / "log"
    )
    with pytest.raises(DataError, match="row 8, column torque, is empty; mend the cell, or drop such rows"):
        one(tmp_path / "log")
    run = one(tmp_path / "log", ReadOptions(repair=True))
    np.testing.assert_allclose(run.time_s, np.delete(t, 7), atol=1e-12)
    pq.write_table(pa.table({"note": ["x"]}), tmp_path / "log")
    with pytest.raises(DataError, match="holds no columns of numbers"):
        one(tmp_path / "log")


@pytest.mark.parametrize("version", ["4.10", "3.30"])
def test_mdf(tmp_path, version):
    pytest.importorskip("asammdf")
    t, duty, torque = step()
    run = one(mdf(tmp_path / "log", t, duty, torque, version))
    np.testing.assert_allclose(run.time_s, t, rtol=1e-15)
    np.testing.assert_array_equal(run.input, duty)
    np.testing.assert_allclose(run.output, np.round(torque * 1e4) * 1e-4, rtol=1e-12)
    assert (run.input_unit, run.output_unit) == ("%", "N·m")


def test_mdf_of_two_rasters_and_a_formula(tmp_path):
    asammdf = pytest.importorskip("asammdf")
    t, duty, torque = step()
    file = asammdf.MDF(version="4.10")
    file.append([asammdf.Signal(duty[::10], t[::10], name="duty", unit="%")])
    file.append([asammdf.Signal(torque, t, name="torque", unit="Nm")])
    path = Path(file.save(str(tmp_path / "log.mf4")))
    run = one(path)
    np.testing.assert_array_equal(run.output, torque)
    np.testing.assert_array_equal(run.input, duty)
    assert [one.values for one in run.findings] == [{"columns": "duty", "left_out": 0}]
    data = path.read_bytes()
    path.write_bytes(b"UnFinMF " + data[8:])
    with pytest.raises(DataError, match="was not closed by its recorder; open it there and save it again"):
        one(path)


@pytest.mark.parametrize("version", ["4.10", "3.30"])
def test_an_mdf_whose_values_are_a_formula_is_refused(tmp_path, version):
    asammdf = pytest.importorskip("asammdf")
    file = asammdf.MDF(version=version)
    formula = {"formula": "X1 * 2"}
    file.append([asammdf.Signal(np.arange(600), np.arange(600.0), name="torque", unit="Nm", conversion=formula)])
    (sheet,) = read_mdf(Path(file.save(str(tmp_path / "formula"))), "a")
    with pytest.raises(DataError, match="torque is scaled by a formula in the file, which eaid does not run"):
        sheet.load([1])


def test_a_reader_that_breaks_down_takes_nothing_with_it(tmp_path, monkeypatch):
    """Compiled libraries write outside their memory, or go round for ever, on some damaged files."""
    pytest.importorskip("asammdf")
    path = tmp_path / "log"
    path.write_bytes(b"MDF     4.10    " + bytes(200))
    with pytest.raises(DataError, match=r"is a damaged MDF file .*; copy or save it again"):
        one(path)
    monkeypatch.setattr("eaid.logs.foreign.ask.READER", (sys.executable, "-c", "import os; os.read(0, 1); os.abort()"))
    with pytest.raises(DataError, match=r"is a damaged MDF file \(its reader broke down on it\); copy or"):
        one(path)
    monkeypatch.setattr("eaid.logs.foreign.ask.READER", (sys.executable, "-c", "import time; time.sleep(60)"))
    monkeypatch.setattr("eaid.logs.foreign.ask.LONGEST_S", 0.3)
    with pytest.raises(DataError, match=r"takes longer than 0 s to read; export it as CSV"):
        one(path)


def test_the_next_file_is_read_after_one_that_broke_the_reader(tmp_path):
    """One process for all files of a call: what one of them does to it, the next does not feel."""
    pytest.importorskip("nptdms")
    t, duty, torque = step()
    (tmp_path / "a.mat").write_bytes(
        b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM" + b"\x0e\0\0\0\x40\0\0\0" + b"\xff" * 64
    )
    tdms(tmp_path / "b.tdms", t, duty, torque)
    runs, faults = read_what_can_be([tmp_path / "a.mat", tmp_path / "b.tdms"], NOTHING)
    assert len(faults) == 1 and "a.mat: is a damaged MAT file" in faults[0]
    np.testing.assert_allclose(runs[0].output, torque, rtol=1e-14)


def test_a_tdms_file_that_was_cut_short_is_refused(tmp_path):
    pytest.importorskip("nptdms")
    path = tdms(tmp_path / "log", *step())
    path.write_bytes(path.read_bytes()[:-2000])
    with pytest.raises(DataError, match="is cut short: its last segment ends early"):
        one(path)


def _ros_files(folder):
    yield "bag 1", lambda *a: ros1(folder / "log", *a)
    yield "bag 1, lz4", lambda *a: ros1(folder / "log", *a, compress="LZ4")
    yield "bag 1, bz2", lambda *a: ros1(folder / "log", *a, compress="BZ2")
    yield "mcap", lambda *a: ros2(folder / "log", *a)
    yield "mcap, zstd", lambda *a: ros2(folder / "log", *a, compress=True)
    yield "sqlite", lambda *a: ros2(folder / "log", *a, storage="sqlite3")


@pytest.mark.parametrize("which", range(6))
def test_ros_bags(tmp_path, which):
    pytest.importorskip("rosbags")
    t, duty, torque = step(300)
    _, write = list(_ros_files(tmp_path))[which]
    path = write(t, duty, torque)
    run = one(path, ROS)
    np.testing.assert_array_equal(run.output, torque)
    np.testing.assert_array_equal(run.input, duty)
    # by the headers' stamps: receipt is up to 2 ms late
    np.testing.assert_allclose(run.time_s, t, atol=1e-9)
    assert run.output_unit == "N·m"
    assert next(one for one in run.findings if one.code == "signals-held").values["columns"] == "clutch/duty"


def test_ros_joints_are_named_and_blobs_passed_over(tmp_path):
    rosbags = pytest.importorskip("rosbags.typesys")
    from rosbags.rosbag1 import Writer

    store = rosbags.get_typestore(rosbags.Stores.ROS1_NOETIC)
    joint, image = store.types["sensor_msgs/msg/JointState"], store.types["std_msgs/msg/UInt8MultiArray"]
    header, time = store.types["std_msgs/msg/Header"], store.types["builtin_interfaces/msg/Time"]
    layout = store.types["std_msgs/msg/MultiArrayLayout"]
    path = tmp_path / "log"
    with Writer(path) as file:
        joints = file.add_connection("/joints", "sensor_msgs/msg/JointState", typestore=store)
        blob = file.add_connection("/blob", "std_msgs/msg/UInt8MultiArray", typestore=store)
        for i in range(20):
            effort = np.array([i * 0.5, -1.0])
            stamp = header(0, time(0, 0), "")
            message = joint(stamp, ["elbow", "wrist"], np.zeros(2), np.zeros(0), effort)
            file.write(joints, 10**9 + i * 10**7, store.serialize_ros1(message, "sensor_msgs/msg/JointState"))
            raw = store.serialize_ros1(image(layout([], 0), np.zeros(9, np.uint8)), "std_msgs/msg/UInt8MultiArray")
            file.write(blob, 10**9 + i * 10**7, raw)
    (sheet,) = tables(path)
    assert sheet.columns == (
        "time", "blob/layout.data_offset", "joints/position[elbow]", "joints/position[wrist]",
        "joints/effort[elbow]", "joints/effort[wrist]",
    )  # fmt: skip
    cells = sheet.load([4, 0])
    np.testing.assert_array_equal(cells.values[0], np.arange(20) * 0.5)
    np.testing.assert_allclose(cells.values[1], np.arange(20) * 0.01, atol=1e-12)  # a stamp of 0: the bag's own time


@pytest.mark.parametrize(
    ("head", "what", "extra", "module"),
    [
        (b"TDSm", "TDMS", "tdms", "nptdms"),
        (b"MDF     4.10", "MDF", "mdf", "asammdf"),
        (b"#ROSBAG V2.0\n", "ROS bag", "ros", "rosbags"),
        (b"\x89MCAP0\r\n", "ROS bag", "ros", "rosbags"),
        (b"SQLite format 3\0", "ROS bag", "ros", "rosbags"),
    ],
)
def test_a_missing_library_is_named_with_its_pip_line(tmp_path, monkeypatch, head, what, extra, module):
    monkeypatch.setattr("eaid.logs.foreign.ask.find_spec", lambda name: None)
    path = tmp_path / "log"
    path.write_bytes(head + bytes(100))
    with pytest.raises(DataError) as caught:
        one(path)
    assert caught.value.sentences == (
        f'{path}: is a {what} file, which takes {module} to read; pip install "eaid[{extra}]"',
    )


def test_every_format_is_known_by_its_first_bytes_alone(tmp_path):
    """No reader looks at the ending: each file of these tests is called plain `log`."""
    assert [form.name for form in FORMATS][-1] == "text"
    assert not any(form.is_it(b"time_s,duty_pct,torque_nm\n0,0,0\n") for form in FORMATS[:-1])


@pytest.mark.parametrize("times", ["datetime64[ns]", "datetime64[ms]", "timedelta64[ns]"])
def test_stamps_of_parquet_are_seconds_whatever_their_column_is_called(tmp_path, times):
    """A column `t` on which nothing says a unit, and one that says another: the type tells."""
    pa = pytest.importorskip("pyarrow")
    import pyarrow.parquet as pq

    t, duty, torque = step()
    unit = times.split("[")[1][:2]
    start = np.datetime64("2024-10-29T16:18:17", unit) if times.startswith("date") else np.timedelta64(0, unit)
    stamps = start + np.round(t * (1e9 if unit == "ns" else 1e3)).astype(f"timedelta64[{unit}]")
    table = pa.table({"time_ms": stamps, "duty_pct": duty, "torque_nm": torque})
    pq.write_table(table, tmp_path / "log")
    assert read_parquet(tmp_path / "log", "log")[0].units[0] == "s"
