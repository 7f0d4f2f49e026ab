"""Binary formats and LVM: written by the libraries that make them, read back to the last digit; and what is refused.

All files of one set of options are read in one call, as they share the process that reads them.
"""

import datetime
import os
import struct
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import h5py
import logs_written as written
import numpy as np
import pytest
from logs_written import U, Y, later
from scipy.io import savemat

import eaid
from eaid import DataError
from eaid.logs import formats
from eaid.logs.read import read_runs
from eaid.options import ReadOptions

T = written.T + 25
STAMPS = np.datetime64("2024-10-29T16:18:17.123456789", "ns") + np.round(written.T * 1e9).astype("m8[ns]")


@dataclass(frozen=True)
class File:
    """How a file is written, what is said to it, and what comes out if not T, U and Y in % and N·m."""

    write: Callable[[Path], Any]
    said: dict[str, Any] = field(default_factory=dict)
    start: float = 25.0
    within: float = 0.0
    units: str = "% N·m"
    left: str = ""
    codes: str = ""
    input: Any = None


@later
def mat(path: Path, content: dict[str, Any], **how: Any) -> None:
    savemat(path, content, appendmat=False, **how)


def structure(labels: list[Any], values: list[Any], time: bool = True) -> dict[str, Any]:
    """What Simulink's To Workspace writes as structure with time."""
    signals = np.empty(len(labels), dtype=[("values", "O"), ("dimensions", "O"), ("label", "O"), ("title", "O")])
    for k, (label, value) in enumerate(zip(labels, values, strict=True)):
        signals[k] = (value, 1, label, "")
    return {"signals": signals, "blockName": "clutch/To Workspace"} | ({"time": T[:, None]} if time else {})


@later
def hdf5(path: Path, columns: dict[str, Any], userblock: int = 0, **how: Any) -> None:
    """Arrays by their paths, attributes behind them; with a user block the file that MATLAB writes with -v7.3."""
    with h5py.File(path, "w", userblock_size=userblock) as file:
        for name, value in columns.items():
            values, said = value if isinstance(value, tuple) else (value, {})
            plain = {"MATLAB_class": np.bytes_(b"double")} if userblock else {}
            file.create_dataset(name, data=values, **how).attrs.update(plain | said)
    if userblock:
        path.write_bytes(
            b"MATLAB 7.3 MAT-file, Platform: GLNXA64 HDF5 schema 1.00 .".ljust(512) + path.read_bytes()[512:]
        )


def table(columns: dict[str, Any]) -> np.ndarray:
    """Records with a field for each column."""
    return np.rec.fromarrays(list(columns.values()), names=list(columns))


@later
def of(path: Path, write: Callable[..., Any], **how: Any) -> None:
    """A file of `logs_written` with this step."""
    write(path, T, U, Y, **how)


tdms = later(written.tdms_of)
HEAD = ["Channels|2", "Samples|3|3", "Y_Unit_Label|%|Nm", "X_Dimension|Time|Time", "X0|25|25", "Delta_X|0.01|0.01"]
NAMES = "X_Value|Duty|Torque|Comment"
END = "***End_of_Header***"
CELLS = [f"{t:.2f}|{u:g}|{y:.6f}" for t, u, y in zip(T, U, Y, strict=True)]
BARE = [f"|{u:g}|{y:.6f}" for u, y in zip(U, Y, strict=True)]


@later
def lvm(path: Path, *segments: Any, own: str = "One", mark: str = ".", separator: str = "\t", top: str = "") -> None:
    """A LabVIEW measurement file; each segment: header lines, names, rows of cells."""
    lines = ["LabVIEW Measurement", "Writer_Version|2", f"Separator|{'Comma' if separator == ',' else 'Tab'}",
             f"Decimal_Separator|{mark}", f"X_Columns|{own}", END, top]  # fmt: skip
    for header, names, rows in segments:
        lines += [*header, END, names, *rows, ""]
    path.write_bytes(("\n".join(lines).replace(".", mark).replace("|", separator) + "\n").encode("cp1252"))


MATRIX = np.stack([T, U, Y])
VECTORS, LETTERS = {"time": T, "duty": U, "torque_nm": Y}, {"MATLAB_class": np.bytes_(b"char")}
EPOCH_NS = 1_700_000_000_000_000_000 + np.round(written.T * 1e9).astype("i8")
ONE, TWO, THREE = U[:, None], Y[:, None], -Y[:, None]
BY_NUMBER: dict[str, Any] = {"said": {"columns": {"time": "1", "input": "2", "output": "3"}}, "units": "? ?"}
BY_PLACE: dict[str, Any] = {"units": "? ?", "codes": "columns-by-place"}
SINCE_1970: dict[str, Any] = {"start": 1.7e9, "within": 1e-9, "codes": "time-since-a-day"}
GOOD: dict[str, File] = {
    "MAT matrix, samples in columns": File(mat({"data": MATRIX}), **BY_PLACE),
    "MAT v4": File(mat({"data": MATRIX}, format="4"), **BY_PLACE),
    "MAT compressed, with settings": File(mat({"data": MATRIX, "Kp": 3.0, "name": "rig", "gains": np.eye(2)},
                                              do_compression=True), **BY_PLACE),
    "MAT one of two": File(mat({"a": MATRIX, "b": 2 * MATRIX}), {"variable": "a"}, **BY_PLACE),
    "MAT wide matrix": File(mat({"log": np.stack([T, U, Y, 0 * T])}), **BY_NUMBER, left="column 4"),
    "MAT vectors": File(mat(VECTORS | {"note": "x", "c": Y * 1j, "n": np.array(["ab", "c"])}), left="c, n"),
    "MAT vectors of two lengths": File(mat(VECTORS | {"z": np.arange(9.0), "zz": np.arange(9.0)[:, None]})),
    "MAT matrices by column": File(mat({"t": T, "u": np.stack([0 * T, U], 1), "y": np.stack([0 * T, Y, T])}), {
        "columns": {"time": "t", "input": "u[2]", "output": "y[2]"}, "units": {"input": "%", "output": "Nm"}},
        left="u[1], y[1], y[3]"),
    "MAT structure of vectors": File(mat({"log": {"time_s": T, "duty_pct": U, "torque_nm": Y}})),
    "MAT structure with time": File(mat({"out": structure(["duty (%)", "torque (Nm)"], [ONE, TWO])})),
    "MAT signal of two columns": File(mat({"out": structure([np.array([["duty", "torque_nm"]], object)],
                                                            [np.stack([U, Y], 1)])})),
    "MAT signals without labels": File(mat({"o": structure([""] * 3, [ONE, TWO, THREE])}), **BY_NUMBER, left="signal3"),
    "MAT a signal without a label": File(mat({"out": structure([""], [TWO])}), units="? ?", input=np.nan * T),
    "v7.3 vectors": File(hdf5({name: one[None] for name, one in VECTORS.items()} | {"x": (np.ones((2, 1)), LETTERS)},
                              512), left="x"),
    "v7.3 structure": File(hdf5({f"log/{name}": one[None] for name, one in VECTORS.items()}, 512)),
    "v7.3 matrix": File(hdf5({"data": MATRIX}, 512), **BY_PLACE),
    "HDF5 group": File(hdf5({f"rig/{name}": one for name, one in VECTORS.items()} | {"rig/K": np.eye(3)})),
    "HDF5 compound table": File(hdf5({"log/table": table(VECTORS | {"note": np.array(["a"] * 300, "S3")})})),
    "HDF5 other numbers": File(hdf5({"time_s": T, "duty_pct": U.astype(">f4"), "torque_nm": Y, "n": U > 0}), left="n"),
    "HDF5 deep groups": File(hdf5(VECTORS | {"/".join("g" * 400): np.zeros(3)})),
    "HDF5 counts and offsets": File(hdf5({
        "time": (1e3 * T, {"units": "ms"}), "duty": (U / 2, {"scale_factor": [2.0], "unit": b"%"}),
        "torque": (np.round((1e3 * Y + 1000) / 0.001).astype("i4"), {
            "units": "mN.m", "scale_factor": 0.001, "add_offset": -1000.0, "_FillValue": np.int32(-1)})}), within=1e-9),
    "HDF5 unsigned ns since 1970": File(hdf5({"time": EPOCH_NS.astype("u8"), "duty": U.astype("u1"), "torque_nm": Y}),
                                        **SINCE_1970),
    **{f"HDF5 chunks {how}": File(hdf5(VECTORS | {"name": np.full(300, k)}, chunks=(64,), **how), left="name")
       for k, how in enumerate(({}, {"fletcher32": True}, {"compression": "lzf"}, {"compression": "gzip"},
                                {"compression": "gzip", "shuffle": True, "fletcher32": True}, {"shuffle": True},
                                {"compression": "lzf", "fletcher32": True}))},
    "npz vectors": File(lambda path: np.savez(path.open("wb"), **VECTORS)),
    "npy records": File(lambda path: np.save(path.open("wb"), table(VECTORS))),
    "LVM a column of times": File(lvm((HEAD, NAMES, [f"{CELLS[0]}|hello", *CELLS[1:]]))),
    "LVM without times, decimal comma": File(lvm((HEAD, NAMES, BARE), own="No", mark=","), within=1e-12),
    "LVM of two rates": File(lvm(([*HEAD[:-1], "Delta_X|0.01|0.02"], NAMES, BARE), own="No"), {"rate_hz": 100.0},
                             start=0, within=1e-12, left="column 1"),
    "LVM commas, a special block": File(lvm((HEAD, NAMES, CELLS), separator=",",
                                            top="***Start_Special***\nanything, at all\n***End_Special***")),
    "TDMS waveforms": File(of(written.tdms), within=1e-12),
    "TDMS vectors and stamps": File(tdms(("g", "Time", STAMPS.astype("M8[us]"), {}), ("g", "Duty", U, {}),
                                         ("g", "Torque", Y, {"NI_UnitDescription": "Nm"})), start=0, within=2e-6),
    "TDMS waveforms of a start time": File(tdms(
        ("g", "Duty", U, {"wf_increment": 0.01, "wf_start_time": STAMPS[0].astype("M8[us]"), "wf_start_offset": 0.02}),
        ("g", "Torque", Y, {"wf_increment": 0.01, "wf_start_time": STAMPS[2].astype("M8[us]"), "unit_string": "Nm"})),
        start=0.02, within=1e-9),
}  # fmt: skip


def library(name: str) -> str:
    """What a file is written and read by, where eaid itself does not need it."""
    return "nptdms" if name.startswith("TDMS") else "numpy"


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    """The runs of all files, by name."""
    folder, sets, found = tmp_path_factory.mktemp("good"), defaultdict(dict), {}
    for k, (name, file) in enumerate(GOOD.items()):
        if find_spec(library(name)):
            file.write(folder / f"{k:03}")
            sets[repr(file.said)][str(folder / f"{k:03}")] = name
    for names in sets.values():
        said = GOOD[next(iter(names.values()))].said
        found |= {names[run.source]: run for run in read_runs([*map(Path, names)], ReadOptions(**said))}
    return found


@pytest.mark.parametrize("name", GOOD)
def test_a_file(name, good, codes):
    pytest.importorskip(library(name))
    file, run = GOOD[name], good[name]
    near = {"rtol": 1e-12, "atol": file.within}
    np.testing.assert_allclose(run.time_s, written.T, rtol=0, atol=max(file.within, 1e-9))
    assert run.start_s == pytest.approx(file.start, abs=1e-6)
    np.testing.assert_allclose(run.output, Y, **near)
    np.testing.assert_allclose(run.input, U if file.input is None else file.input, **near)
    assert file.within or run.output.tolist() == Y.tolist()
    told = [code for code in codes(run) if code != "unit-unknown"]
    units = f"{run.input_unit} {run.output_unit}".replace("a.u.", "?")
    assert (units, ", ".join(run.left), ", ".join(told)) == (file.units, file.left, file.codes)


def opaque(kind: bytes) -> Callable[[Path], None]:
    return hdf5({"#refs#/a": np.zeros(3), "data": (np.zeros((1, 6), "u4"), {"MATLAB_class": np.bytes_(kind)})}, 512)


@later
def elsewhere(path: Path, torque: Any = None, **how: Any) -> None:
    """The torque is a link, lies in another file, or is larger than any."""
    with h5py.File(path, "w") as file:
        file["time"] = T
        if torque is not None:
            file["torque"] = torque
        else:
            file.create_dataset("torque", dtype="f8", **how)


@later
def chunk(path: Path, raw: bytes, skipped: int = 0, **filters: Any) -> None:
    """A chunk of a hundred numbers takes 800 bytes, 804 with its sum."""
    with h5py.File(path, "w") as file:
        file["time"] = np.arange(100.0)
        column = file.create_dataset("torque", (100,), "f8", chunks=(100,), **filters)
        column.id.write_direct_chunk((0,), raw, skipped)


@later
def cut(path: Path, write: Callable[[Path], Any], end: int) -> None:
    write(path)
    path.write_bytes(path.read_bytes()[:end])


def row46(row: str, names: str = NAMES) -> Callable[[Path], Any]:
    return lvm((HEAD, names, [*CELLS[:30], row, *CELLS[31:]]))


def raw(content: bytes) -> Callable[[Path], Any]:
    return lambda path: path.write_bytes(content)


OBJECTS = "holds MATLAB objects (a Simulink Dataset or timeseries) only; in MATLAB, save it as plain arrays: t = S.Time"
LENGTH = "is a damaged HDF5 file (a chunk of it has a wrong length); copy or save it again"
NO_TABLE = "no table in it has columns of time and output ("
NO_HEAD = "is a LabVIEW file without one column of times for all channels; export it as TDMS, or as CSV"
ZIPPED = (("u", U), ("y", Y))
NEVER = {"_FillValue": 1.0, "missing_value": [2.0, 3.0]}
BAD: dict[str, tuple[Callable[[Path], Any], str]] = {
    "v7.3 dataset": (opaque(b"Simulink.SimulationData.Dataset"), OBJECTS),
    "v7.3 words": (hdf5({"a": (np.ones((1, 6)), LETTERS)}, 512), "holds no table of numbers; save time and output as"),
    "HDF5 link": (elsewhere(h5py.ExternalLink("/etc/passwd", "/x")), "torque is a link to another file; copy the data"),
    "HDF5 outside": (elsewhere(shape=(300,), external=[(os.devnull, 0, 2400)]), "torque keeps its data in another fil"),
    "HDF5 absurd size": (elsewhere(shape=(10**13,), chunks=(1024,)), NO_TABLE + "time: time; torque: torque); choose"),
    "HDF5 words": (hdf5({"note": np.bytes_(b"x")}), "holds no table of numbers; save time and output as arrays of one"),
    "HDF5 lengths": (hdf5({"time_s": T, "torque_nm": Y[:-1]}), NO_TABLE),
    "HDF5 never written": (hdf5(VECTORS | {"torque_nm": (np.r_[1, 2, 3, Y[3:]], NEVER)}),
                           "row 1, column torque_nm, is empty or not a number; mend the cell, or drop such rows"),
    "HDF5 short": (chunk(bytes(799)), LENGTH), "HDF5 long": (chunk(bytes(801)), LENGTH),
    "HDF5 filter left out": (chunk(bytes(799), 1, compression="gzip"), LENGTH),
    "HDF5 not packed": (chunk(b"nothing of the kind", compression="gzip"), "is a damaged HDF5 file ("),
    **{f"HDF5 cut at {n}": (cut(hdf5(VECTORS), n), "is a damaged HDF5 file (") for n in (60, 600, 2000, -1)},
    "MAT words": (mat({"note": "x", "Kp": 2.0, "g": np.ones((9, 2))}), "holds no table of numbers; save time and "),
    "MAT two": (mat({"a": MATRIX, "b": 2 * MATRIX}), "holds several tables that may be the log (a, b); choose one with "
                                                    "«variable» NAME"),
    "MAT none": (mat({"a": np.stack([T, U, Y, Y]), "b": np.ones((4, 90))}), NO_TABLE),
    "MAT falling": (mat({"a": np.stack([-T, U])}), "its 2 columns have no names; say by number, from 1 to 2, what"),
    "MAT complex": (mat({"time": T, "torque": Y * 1j}),
                    "no column is called torque, force … (columns: time; without numbers: torque)"),
    "no MAT v4": (raw(struct.pack("<5i", 7, 1, 1, 9, 4) + b"abc\0" + bytes(99)), "is a binary file of no format"),
    "MAT damaged": (raw(b"MATLAB 5.0 MAT-file".ljust(124) + b"\0\1IM\x0e\0\0\0\x40\0\0\0" + b"\xff" * 64),
                    "is a damaged MAT file ("),
    **{f"MAT cut at {n}": (cut(mat({"data": MATRIX}), n), "is ") for n in (60, 127, 130, 200, 2000, -1)},
    "LVM no end": (raw(b"LabVIEW Measurement\nSeparator\tTab\n1\t2\n"), NO_HEAD),
    "LVM nothing": (lvm(), NO_HEAD), "LVM no channels": (lvm((HEAD, "X_Value|Comment", ["0"])), NO_HEAD),
    "LVM no rows": (lvm((HEAD, NAMES, [])), "has a header but no rows; record the log again"),
    "LVM spectrum": (lvm((["Channels|1", "X_Dimension|Frequency"], "X_Value|A", ["0|1"])), NO_HEAD),
    "LVM no times": (lvm((HEAD[:-1], NAMES, BARE), own="No"), "no column is called time (columns: column 1, Duty, Tor"),
    "LVM segments": (lvm((HEAD, NAMES, CELLS[:99]), (HEAD, NAMES, CELLS[99:])), "row 116 has 2 cells, unlike the oth"),
    "LVM times": (lvm((HEAD, "X_Value|A|X_Value|B", ["0|1|0|2", "1|3|1.5|4"]), own="Multi"), NO_HEAD),
    "LVM word": (row46("25.3|0|x"), "row 46, column Torque, holds 'x', which is no number; mend the cell"),
    "LVM long": (row46("25.3|0|1|noted", "X_Value|Duty|Torque"), "row 46 has 4 cells, unlike the others"),
    "LVM half": (row46("Channels|2"), "row 46 has 2 cells, unlike the others"),
    "TDMS cut": (cut(of(written.tdms), -2000), "is cut short: its last segment ends early; copy it again, or"),
    "TDMS groups": (tdms(*((run, name, one, {"wf_increment": 0.01}) for run in "AB" for name, one in ZIPPED)),
                    "holds several tables that may be the log (A, B); choose one with «variable» NAME"),
    "TDMS words": (tdms(("g", "note", ["a", "b"], {})), "holds no channels of numbers; record the log again"),
    "TDMS of two clocks": (tdms(("g", "Duty", U[::4], {"wf_increment": 0.04}),
                                ("g", "Torque", Y, {"wf_increment": 0.01})),
                           "Duty stands in another table, or is of another length, than the output; save them on one "),
    **{mark.decode("latin-1"): (raw(mark + bytes(99)), f"{said} as CSV or HDF5") for mark, said in (
        (b"MDF     4.10", "is an MDF measurement file; export it"),
        (b"UnFinMF ", "is an MDF measurement file; export it"),
        (b"#ROSBAG V2.0", "is a ROS bag; export its topics"), (b"\x89MCAP0\r\n", "is a ROS bag; export its topics"))},
}  # fmt: skip


@pytest.fixture(scope="module")
def bad(tmp_path_factory):
    """All that is said of all bad files of one call, by name: what breaks the reader of one file costs no other."""
    folder = tmp_path_factory.mktemp("bad")
    paths = {name: f"{folder / f'{k:03}'}: " for k, name in enumerate(BAD) if find_spec(library(name))}
    for name, path in paths.items():
        BAD[name][0](Path(path[:-2]))
    with pytest.raises(DataError) as caught:
        eaid.read([path[:-2] for path in paths.values()])
    every = caught.value.sentences
    return {
        name: "".join(f"{s.removeprefix(path)}\n" for s in every if s.startswith(path)) for name, path in paths.items()
    }


@pytest.mark.parametrize("name", BAD)
def test_a_bad_file(name, bad):
    pytest.importorskip(library(name))
    assert bad[name].startswith(BAD[name][1]) and (bad[name].count("\n") == 1 or " cell" in bad[name])


def test_what_is_not_there(tmp_path):
    mat({"data": MATRIX})(tmp_path / "a.mat")
    with pytest.raises(DataError, match="holds no table c for variable=; it holds data"):
        eaid.read(tmp_path / "a.mat", variable="c")


@pytest.mark.parametrize(("head", "said"), [
    (b"TDSm", 'is a file of TDMS, which takes nptdms to read; pip install "eaid[tdms]"'),
    (b"PK\3\4" + bytes(22) + b"\x13\0\0\0[Content_Types].xml",
     'is a file of Excel, which takes openpyxl to read; pip install "eaid[excel]"'),
])  # fmt: skip
def test_a_missing_library_is_named_with_its_pip_line(head, said, read, monkeypatch):
    monkeypatch.setattr(formats, "find_spec", lambda name: None)
    assert read.refused(head + bytes(100)) == [said]


def test_a_workbook(tmp_path):
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    book.create_sheet("notes").append(["recorded", "on a bench"])
    sheet = book.active
    for row in (["run of May"], [], ["when", "Voltage", "Load cell", "remark"], [None, "V", "mN"]):
        sheet.append(row)
    start = datetime.datetime(2024, 10, 29, 16, 18, 17)
    for k, (u, y) in enumerate(zip(U.tolist(), Y.tolist(), strict=True)):
        sheet.append([start + datetime.timedelta(seconds=0.01 * k), u, 1000 * y])
    book.save(tmp_path / "bench.xlsx")
    (run,) = eaid.read(tmp_path / "bench.xlsx", logs_as="recorded").recorded
    assert (run.input_unit, run.output_unit) == ("V", "N")
    np.testing.assert_allclose(run.output, Y, rtol=1e-12)
    np.testing.assert_allclose(run.time_s, 0.01 * np.arange(len(Y)), atol=1e-6)
    sheet["C40"] = "lost"
    book.save(tmp_path / "bench.xlsx")
    with pytest.raises(DataError, match="row 40, column Load cell, holds 'lost', which is no number"):
        eaid.read(tmp_path / "bench.xlsx", logs_as="recorded")
