"""Edges of the binary readers, each in this process: messages, arrays side by side, chunks, segments, labels."""

import struct
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from eaid.errors import DataError
from eaid.logs.foreign.groups import grouped
from eaid.logs.foreign.hdf5 import _check_chunks, read_hdf5
from eaid.logs.foreign.lvm import read_lvm
from eaid.logs.foreign.mat import read_mat, read_npy
from eaid.logs.foreign.ros import DEEPEST, FORMATS, _unit, layout_of
from eaid.logs.table import Table


def base(name: str) -> tuple[int, Any]:
    return 1, (name, 0)


def fixed(inner: Any, count: int) -> tuple[int, Any]:
    return 3, (inner, count)


def free(inner: Any) -> tuple[int, Any]:
    return 4, (inner, 0)


def message(*fields: tuple[str, Any], **more: Any) -> dict[str, Any]:
    return {"m": ([], list(fields)), **{name: ([], list(inner)) for name, inner in more.items()}}


def values(definitions: dict[str, Any], raw: bytes, ros1: bool = True) -> dict[str, float]:
    layout = layout_of(definitions, "m", raw, ros1=ros1)
    return {field: layout.value(raw, field)[1] for field in layout.places}


NUMBERS = {"bool": 1, "byte": 200, "char": 7, "octet": 9, "int8": -5, "uint8": 250, "int16": -300, "uint16": 60000,
           "int32": -70000, "uint32": 4_000_000_000, "int64": -(2**40), "uint64": 2**41, "float32": 0.5,
           "float64": -0.1}  # fmt: skip


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("name", NUMBERS)
def test_every_kind_of_number_behind_a_byte(name: str, order: str) -> None:
    """ROS 1 packs without gaps, in little-endian order; CDR aligns each number to its size."""
    number, form = NUMBERS[name], FORMATS[name]
    fields = message(("first", base("uint8")), ("x", base(name)), ("last", base("uint8")))
    if order == "<":
        assert values(fields, struct.pack(f"<B{form}B", 3, number, 4)) == {"first": 3, "x": number, "last": 4}
    gap = bytes(struct.calcsize(form) - 1)
    raw = bytes((0, order == "<", 0, 0, 3)) + gap + struct.pack(f"{order}{form}B", number, 4)
    assert values(fields, raw, ros1=False) == {"first": 3, "x": number, "last": 4}


def test_strings_and_blobs_are_passed_over_to_the_byte() -> None:
    fields = message(("name", base("string")), ("blob", free(base("uint8"))), ("list", free(base("float32"))),
                     ("three", fixed(base("float32"), 3)), ("x", base("float64")))  # fmt: skip
    raw = struct.pack("<I3sI5sI2f3fd", 3, b"abc", 5, b"12345", 2, 1.5, 2.5, 7, 8, 9, -4.0)
    expected = {"list[0]": 1.5, "list[1]": 2.5, "three[0]": 7.0, "three[1]": 8.0, "three[2]": 9.0, "x": -4.0}
    assert values(fields, raw) == expected
    cdr = struct.pack("<4sI3sxI5s3xI2f3f4xd", b"\0\1\0\0", 3, b"abc", 5, b"12345", 2, 1.5, 2.5, 7, 8, 9, -4.0)
    assert values(fields, cdr, ros1=False) == expected


def test_long_arrays_are_skipped_with_their_alignment() -> None:
    for count, kept in ((64, 64), (65, 0)):
        fields = message(("n", base("uint8")), ("v", free(base("float64"))), ("x", base("uint8")))
        raw = struct.pack(f"<4sB3xI{count}dB", b"\0\1\0\0", 1, count, *range(count), 9)
        found = values(fields, raw, ros1=False)
        assert (len(found), found["n"], found["x"]) == (kept + 2, 1.0, 9.0)
    empty = message(("n", base("uint8")), ("v", free(base("float64"))), ("x", base("uint8")))
    assert values(empty, struct.pack("<4sB3xIB", b"\0\1\0\0", 1, 0, 9), ros1=False) == {"n": 1.0, "x": 9.0}


@pytest.mark.parametrize(
    ("fields", "raw", "ros1"),
    [
        (message(("x", base("string"))), struct.pack("<I2s", 3, b"ab"), True),  # longer than what is left
        (message(("x", free(base("float64")))), struct.pack("<I", 9), True),
        (message(("x", base("wstring"))), bytes(9), True),
        (message(("x", (2, "nowhere"))), bytes(9), True),
        (message(("x", (2, "m"))), bytes(9), True),  # holds itself
        (message(("x", fixed((2, "e"), 10**9)), e=()), bytes(9), True),
        (message(("x", base("uint8"))), b"\1\1\0\0\5", False), (message(("x", base("uint8"))), b"\0\2\0\0\5", False),
        (message(("x", base("uint8"))), b"\0\1\0", False),
    ],
)  # fmt: skip
def test_messages_that_cannot_be_followed(fields: dict[str, Any], raw: bytes, ros1: bool) -> None:
    with pytest.raises(ValueError, match="message|array|type"):
        layout_of(fields, "m", raw, ros1=ros1)


def test_definitions_may_be_twenty_deep() -> None:
    for deep in (DEEPEST - 1, DEEPEST):
        inner = {f"t{k}": [("a", (2, f"t{k + 1}"))] for k in range(deep - 1)} | {f"t{deep - 1}": [("a", base("uint8"))]}
        fields = message(("a", (2, "t0")), **inner)
        if deep < DEEPEST:
            assert list(values(fields, b"\7").values()) == [7.0]
        else:
            with pytest.raises(ValueError, match="holds itself"):
                values(fields, b"\7")


def test_joints_are_called_by_their_names() -> None:
    fields = message(("name", free(base("string"))), ("effort", free(base("float64"))), ("other", base("float64")))
    raw = struct.pack("<II3sI0sI2dd", 2, 3, b"arm", 0, b"", 2, 1.0, 2.0, 5.0)
    assert values(fields, raw) == {"effort[arm]": 1.0, "effort[1]": 2.0, "other": 5.0}
    layout = layout_of(fields, "m", raw, ros1=True)
    short = struct.pack("<II3sI1dd", 1, 3, b"arm", 1, 4.0, 6.0)
    assert layout.value(short, "effort[arm]")[1] == 4.0 and np.isnan(layout.value(short, "effort[1]")[1])


def test_units_of_wrenches_only() -> None:
    assert _unit("geometry_msgs/msg/WrenchStamped", "wrench.torque.z") == "N·m"
    assert _unit("geometry_msgs/msg/Wrench", "force.x") == "N"
    assert _unit("geometry_msgs/msg/Wrench", "forces.x") == "" and _unit("my_msgs/msg/Wrench", "torque.z") == ""


LONG = np.arange(20.0)


def labels(arrays: dict[str, Any], **more: Any) -> tuple[list[tuple[str, list[str]]], list[str]]:
    found, dropped = grouped("at", arrays, **more)
    return [(name, [one.label for one in columns]) for name, columns in found], dropped


def test_arrays_that_lie_side_by_side() -> None:
    both = {"t": LONG, "u": LONG[None], "m": np.zeros((20, 2)), "k": np.array(3.0), "s": np.array(["a", "b"])}
    assert labels(both) == ([("at", ["t", "u", "m[1]", "m[2]"])], ["at.s"])
    two = {"t": LONG, "u": LONG, "a": LONG[:9], "b": LONG[:9, None]}
    assert labels(two) == ([("at.t", ["t", "u"]), ("at.a", ["a", "b"])], [])
    rising, falling = np.stack([LONG, -LONG]), np.stack([-LONG, LONG])
    assert labels({"m": rising}) == ([("at.m", ["", ""])], [])
    assert labels({"m": falling}, between="/") == ([("at/m", ["column 1", "column 2"])], [])
    assert labels({"m": falling.T}) == ([("at.m", ["column 1", "column 2"])], [])
    assert labels({"m": falling}, said=lambda _: ("a", "b")) == ([("at.m", ["a", "b"])], [])
    assert labels({"m": falling}, said=lambda _: ("a",)) == ([("at.m", ["column 1", "column 2"])], [])
    assert labels({"c": LONG + 1j, "one": np.array(["x"]), "e": np.empty(0), "cube": np.zeros((11, 2, 2))}) == (
        [],
        ["at.c"],
    )
    assert grouped("", {"m": rising})[0][0][0] == "m"


@pytest.mark.parametrize(("falls", "unnamed"), [(2, True), (3, False)])
def test_a_matrix_whose_first_column_rises_goes_by_place(falls: int, unnamed: bool) -> None:
    """More than nine in ten of its 29 differences rise."""
    first = np.arange(30.0)
    first[5 : 5 + 3 * falls : 3] -= 2
    found = grouped("", {"m": np.stack([first, LONG.repeat(2)[:30]])})[0]
    assert (found[0][1][0].label == "") is unnamed


def test_samples_of_a_matrix_lie_along_its_longer_side() -> None:
    for matrix in (np.stack([LONG, -LONG]), np.stack([LONG, -LONG], axis=1)):
        ((_, columns),) = grouped("", {"m": matrix})[0]
        assert [one.values().tolist() for one in columns] == [LONG.tolist(), (-LONG).tolist()]


def test_structures_with_time(tmp_path: Path) -> None:
    def read(signals: Any, time: np.ndarray | None = LONG) -> tuple[tuple[str, ...], int | None, list[float]]:
        savemat(tmp_path / "a.mat", {"S": {"signals": signals} | ({} if time is None else {"time": time})})
        (table,) = read_mat(tmp_path / "a.mat", "a")
        return table.columns, table.clock, [float(v.sum()) for v in table.load(range(len(table.columns))).values]

    one, two = LONG[:, None], np.stack([LONG, 2 * LONG], axis=1)
    assert read({"values": one, "label": "torque"}) == (("time",), 0, [190.0])  # the time again
    assert read({"values": 3 * one, "label": "torque"}) == (("time", "torque"), 0, [190.0, 570.0])
    assert read({"values": 3 * one}) == (("time", "output"), 0, [190.0, 570.0])
    assert read({"values": 3 * two}) == (("time", "signal1 1", "signal1 2"), 0, [190.0, 570.0, 1140.0])
    assert read({"values": 3 * two.T, "label": "a"}) == (("time", "a 1", "a 2"), 0, [190.0, 570.0, 1140.0])
    assert read({"values": 3 * one, "label": "y"}, None) == (("y",), None, [570.0])
    pair = np.array([(3 * one, "y"), (5 * one, "y")], [("values", "O"), ("label", "O")])
    assert read(pair) == (("time", "y", "y #2"), 0, [190.0, 570.0, 950.0])
    pair = np.array([(3 * one, ""), (np.zeros((7, 1)), "b")], [("values", "O"), ("label", "O")])
    assert read(pair)[0] == ("time", "signal1")  # one of another length is no column


def test_numpy_files(tmp_path: Path) -> None:
    def read(array: np.ndarray) -> Table:
        np.save(tmp_path / "a.npy", array)
        return read_npy(tmp_path / "a.npy", "a")[0]

    records = np.zeros(5, dtype=[("t", "f8"), ("s", "U3"), ("u", "i2"), ("b", "?")])
    assert read(records).columns == ("t", "u", "b")
    assert read(np.zeros((20, 3))).columns == read(np.zeros((3, 20))).columns == ("",) * 3
    for array in (np.zeros(5), np.zeros((2, 2, 2)), np.zeros((2, 3), dtype="U3"), np.zeros(3, dtype=[("s", "U3")])):
        with pytest.raises(DataError, match="holds no columns of numbers"):
            read(array)
    np.save(tmp_path / "a.npy", np.array([{}], dtype=object), allow_pickle=True)
    with pytest.raises(DataError, match="is no whole NumPy array of numbers"):
        read_npy(tmp_path / "a.npy", "a")


@pytest.mark.parametrize(
    ("said", "cells"),
    [
        ({}, [1, 2, 3, 4]), ({"scale_factor": 2.0}, [2, 4, 6, 8]), ({"add_offset": -1.0}, [0, 1, 2, 3]),
        ({"scale_factor": 2.0, "add_offset": 1.0}, [3, 5, 7, 9]), ({"scale_factor": [0.5]}, [0.5, 1, 1.5, 2]),
        ({"_FillValue": 2}, [1, None, 3, 4]), ({"missing_value": [1, 4]}, [None, 2, 3, None]),
        ({"_FillValue": 2, "missing_value": 3, "scale_factor": 10.0}, [10, None, None, 40]),
    ],
)  # fmt: skip
def test_what_cf_says_of_a_variable(said: dict[str, Any], cells: list[float | None], tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["log/t"], file["log/y"] = np.arange(4.0), np.arange(1, 5, dtype="i2")
        file["log/y"].attrs.update(said)
        file["log/y"].attrs["units"], file["log/t"].attrs["unit"] = "mN", b"ms"
        file["note"] = np.array([b"a", b"b"])
    (table,) = read_hdf5(tmp_path / "a.h5", "a")
    assert (table.name, table.columns, table.units, table.dropped) == ("log", ("t", "y"), ("ms", "mN"), ("note",))
    found = table.load([1, 0])
    assert [None if np.isnan(v) else v for v in found.values[0].astype(float)] == cells
    assert [(bad.row, bad.column, bad.text) for bad in found.bad] == [
        (k, 1, "") for k, v in enumerate(cells) if v is None
    ]
    np.testing.assert_array_equal(found.values[1], np.arange(4.0))


FILTERS = {
    "none": {}, "packed": {"compression": "gzip"}, "shuffled": {"shuffle": True}, "summed": {"fletcher32": True},
    "all": {"compression": "gzip", "shuffle": True, "fletcher32": True}, "lzf": {"compression": "lzf"},
}  # fmt: skip


@pytest.mark.parametrize("name", FILTERS)
def test_chunks_of_the_right_length_pass(name: str, tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        whole = file.create_dataset("x", data=np.arange(100.0), chunks=(30,), **FILTERS[name])
        _check_chunks(whole)
        _check_chunks(file.create_dataset("plain", data=np.arange(5)))


@pytest.mark.parametrize(
    ("name", "size"),
    [("none", 79), ("none", 81), ("shuffled", 79), ("summed", 80), ("packed", 72), ("packed", 79), ("packed", 81)],
)
def test_chunks_of_a_wrong_length_are_refused(name: str, size: int, tmp_path: Path) -> None:
    """A chunk of ten numbers takes 80 bytes, 84 with its sum."""
    import zlib

    raw = zlib.compress(bytes(size)) if name == "packed" else bytes(size)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        node = file.create_dataset("x", shape=(10,), dtype="f8", chunks=(10,), **FILTERS[name])
        node.id.write_direct_chunk((0,), raw)
        with pytest.raises(ValueError, match="a chunk of it has a wrong length"):
            _check_chunks(node)


def test_a_filter_that_a_chunk_leaves_out_does_not_count(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        node = file.create_dataset("x", shape=(10,), dtype="f8", chunks=(10,), shuffle=True, compression="gzip")
        node.id.write_direct_chunk((0,), bytes(80), filter_mask=0b11)
        _check_chunks(node)
        node.id.write_direct_chunk((0,), bytes(79), filter_mask=0b11)
        with pytest.raises(ValueError, match="wrong length"):
            _check_chunks(node)


def lvm(path: Path, *body: str, **top: str) -> Table:
    said = {"Separator": "Tab", "Decimal_Separator": ".", "X_Columns": "One"} | top
    lines = [
        "LabVIEW Measurement",
        *(f"{key}\t{value}" for key, value in said.items()),
        "***End_of_Header***",
        "",
        *body,
    ]
    path.write_text("\n".join(lines) + "\n")
    return read_lvm(path, "a")[0]


def segment(
    *rows: str, date: str = "2026/03/01", time: str = "10:00:00", names: str = "X_Value\tA", **more: str
) -> list[str]:
    said = {"Channels": "1", "Date": date, "Time": time, "X0": "0", "Delta_X": "0.5"} | more
    return [*(f"{key}\t{value}" for key, value in said.items()), "***End_of_Header***", names, *rows]


@pytest.mark.parametrize(
    ("first", "second", "starts"),
    [
        ({"time": "10:00:00"}, {"time": "10:00:05"}, 5.0),
        ({"time": "10:00:00.25"}, {"time": "10:00:05.5"}, 5.25),
        ({"time": "23:59:59"}, {"date": "2026/03/02", "time": "00:00:01"}, 2.0),
        ({"time": "10:00:00"}, {"time": "what"}, 0.0),  # no clock: as it stands
    ],
)
def test_segments_that_begin_anew(first: dict[str, str], second: dict[str, str], starts: float, tmp_path: Path) -> None:
    table = lvm(tmp_path / "a", *segment("0\t1", "0.5\t2", **first), *segment("0\t3", "0.5\t4", **second))
    time, values_ = table.load([0, 1]).values
    assert time.tolist() == [0, 0.5, starts, starts + 0.5] and values_.tolist() == [1, 2, 3, 4]
    later = lvm(tmp_path / "a", *segment("0\t1", "0.5\t2", **first), *segment("1\t3", "1.5\t4", **second))
    assert later.load([0]).values[0].tolist() == [0, 0.5, 1, 1.5]  # their times follow: no clock is asked


def test_times_made_of_a_start_and_a_step(tmp_path: Path) -> None:
    no = {"X_Columns": "No"}
    assert lvm(tmp_path / "a", *segment("\t1", "\t2", X0="3"), **no).load([0]).values[0].tolist() == [3, 3.5]
    assert lvm(tmp_path / "a", *segment("\t1", "\t2", X0=""), **no).load([0]).values[0].tolist() == [0, 0.5]
    for step in ("0", "-1", ""):
        with pytest.raises(DataError, match="neither a column of times nor a Delta_X above 0"):
            lvm(tmp_path / "a", *segment("\t1", "\t2", Delta_X=step), **no)
    with pytest.raises(DataError, match="'x' is no number"):
        lvm(tmp_path / "a", *segment("\t1", "\t2", Delta_X="x"), **no)


def test_cells_beyond_the_columns(tmp_path: Path) -> None:
    rows = ("0\t1", "1\t2\tnoted", "2\t3\t", "3", "4\tx")
    table = lvm(tmp_path / "a", *segment(*rows))
    assert [(one.row, one.column, one.text) for one in table.load([0, 1]).bad] == [
        (1, -1, "3"),
        (3, -1, "1"),
        (4, 1, "x"),
    ]
    assert [(one.row, one.column) for one in table.load([0]).bad] == [(1, -1), (3, -1)]
    table = lvm(tmp_path / "a", *segment(*rows, names="X_Value\tA\tComment"))
    assert [one.row for one in table.load([0, 1]).bad] == [3, 4]
    assert [table.load([0]).row(k) for k in (0, 4)] == [14, 18]


def test_channels_with_a_time_of_their_own(tmp_path: Path) -> None:
    names, own = "X_Value\tA\tX_Value\tB", {"X_Columns": "Multi"}
    table = lvm(tmp_path / "a", *segment("0\t1\t0\t2", "1\t3\t1\t4", names=names), **own)
    assert table.columns == ("time", "A", "B")
    assert [one.tolist() for one in table.load([0, 1, 2]).values] == [[0, 1], [1, 3], [2, 4]]
    with pytest.raises(DataError, match="its channels have different times"):
        lvm(tmp_path / "a", *segment("0\t1\t0\t2", "1\t3\t1.5\t4", names=names), **own)


def test_an_mdf_unit_in_bytes() -> None:
    from eaid.logs.foreign.mdf import _unit as of_channel

    conversion = SimpleNamespace(unit=b"mV\0 ")
    assert of_channel(SimpleNamespace(unit="", conversion=conversion)) == "mV"
    assert of_channel(SimpleNamespace(unit=b"N\xb0 ", conversion=conversion)) == "N°"
    assert of_channel(SimpleNamespace(unit=None, conversion=None)) == ""
