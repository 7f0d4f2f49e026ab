"""Files made to do harm, or damaged so that libraries break down: refused in a sentence, and this process lives on."""

import os
import pickle
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import logs_written as written
import numpy as np
import pytest
from logs_written import changed

import eaid
from eaid import DataError
from eaid.logs import formats


class Payload:
    """A pickle that leaves a file behind where it is loaded."""

    def __init__(self, marker: Path) -> None:
        self.marker = marker

    def __reduce__(self) -> Any:
        return os.system, (f"touch {self.marker}",)


def test_code_in_a_log_is_never_run(tmp_path):
    from scipy.io import savemat

    marker = tmp_path / "it-was-run"
    payload = pickle.dumps(Payload(marker))
    array = np.array([Payload(marker)], dtype=object)
    (tmp_path / "a.csv").write_bytes(payload)
    np.save(tmp_path / "b.npy", array, allow_pickle=True)
    np.savez(tmp_path / "c.npz", time=np.arange(3.0), torque=array)
    with h5py.File(tmp_path / "d.h5", "w") as file:
        file["time"], file["torque"], file.attrs["schema"] = np.arange(50.0), np.void(payload), np.void(payload)
    savemat(tmp_path / "e.mat", {"code": "delete('*')", "torque": np.array([payload])})
    files = sorted(path for path in tmp_path.iterdir())
    with pytest.raises(DataError) as caught:
        eaid.read(files)
    assert len(files) == 5 and all(any(str(path) in said for said in caught.value.sentences) for path in files)
    assert not marker.exists()
    pickle.loads((tmp_path / "a.csv").read_bytes())  # the payload works
    assert marker.exists()


@written.later
def mat(path: Path, **columns: Any) -> None:
    from scipy.io import savemat

    savemat(path, columns, appendmat=False)


def no_dataset(path: Path) -> None:
    with h5py.File(path, "w") as file:
        file["time"], file["torque"], file.attrs["schema"] = LONG, LONG, "eaid/data/1"


def half_a_complex_matrix(data: bytearray) -> None:
    """SciPy ends the process where a matrix lacks an element of its class."""
    data[145] |= 0x08


def text_of_no_kind(data: bytearray) -> None:
    """Its values are float64, which are no letters."""
    data[144] = 4


def part_that_ends_early(data: bytearray) -> None:
    """It makes SciPy read on in the next one."""
    at = data.index(np.arange(20.0).tobytes()) - 4
    data[at : at + 4] = (80).to_bytes(4, "little")


def class_that_is_a_number(path: Path) -> None:
    """bytes(n) are n zeros: 8 GB of them."""
    with h5py.File(path, "w", userblock_size=512) as file:
        file["time"], file["torque"] = LONG, LONG
        file["torque"].attrs["MATLAB_class"] = np.int64(1 << 33)
    path.write_bytes(b"MATLAB 7.3 MAT-file".ljust(512) + path.read_bytes()[512:])


def schema_that_is_no_text(data: bytearray) -> None:
    """The HDF5 library ends the process where a changed byte says that a text is a sequence."""
    at = data.index(b"schema\0\0") + 8
    assert data[at : at + 2] == b"\x19\x01"  # version 1, of free length; a text (1)
    data[at + 1] = 0x42


def bomb(path: Path) -> None:
    """It claims 270 GB."""
    with h5py.File(path, "w") as file:
        for name in ("time", "torque"):
            file.create_dataset(name, (1 << 34,), "f8", chunks=(1 << 20,), compression="gzip", fillvalue=0.0)


LONG, CELL = np.arange(40.0), np.empty((1, 2), dtype=object)
CELL[0, 0] = CELL[0, 1] = np.arange(20.0)
BREAKING: dict[str, Callable[[Path], None]] = {
    "half a complex matrix": changed(mat(time=LONG, torque=LONG), half_a_complex_matrix),
    "a text of no kind": changed(mat(torque=LONG), text_of_no_kind),
    "a part that ends early": changed(mat(c=CELL, t=np.arange(20.0)), part_that_ends_early),
    "a class that is a number": class_that_is_a_number,
    "a schema that is no text": changed(no_dataset, schema_that_is_no_text),
    "a bomb": bomb,
}
BROKE = "(its reader broke down on it); copy or save it again"


@pytest.mark.skipif(sys.platform != "linux", reason="memory is bounded by the kernel, as Linux does it")
def test_what_breaks_a_library_is_refused(tmp_path, monkeypatch):
    """All in one call: what one file does to the process that reads it, the next does not feel."""
    monkeypatch.setattr(formats, "LONGEST_READ_S", 20.0)
    for name, write in BREAKING.items():
        write(tmp_path / name)
    with pytest.raises(DataError) as caught:
        eaid.read([tmp_path / name for name in BREAKING])
    said = {name: one for name in BREAKING for one in caught.value.sentences if one.startswith(f"{tmp_path / name}: ")}
    refusals = ("damaged", "takes longer", "far more memory to unpack", "holds no", "no column", "no table")
    assert set(said) == set(BREAKING) and all(any(word in one for word in refusals) for one in said.values())
    assert BROKE in said["half a complex matrix"]


@pytest.mark.parametrize(
    ("code", "said"),
    [("import os; os.read(0, 1); os.abort()", f"is a damaged MAT file {BROKE}"),
     ("import os, pickle; os.read(0, 1); os.write(1, pickle.dumps([0] * 99))", f"is a damaged MAT file {BROKE}"),
     ("import os; os.read(0, 1); os.write(1, bytes([9, *bytes(7)]) + b'no answer')", f"is a damaged MAT file {BROKE}"),
     ("import time; time.sleep(60)", "takes longer than 0 s to read; export it as CSV")],
)  # fmt: skip
def test_a_reader_that_breaks_down_or_takes_too_long(code, said, read, monkeypatch):
    monkeypatch.setattr(formats, "READER", (sys.executable, "-S", "-c", code))
    monkeypatch.setattr(formats, "LONGEST_READ_S", 0.4 if "sleep" in code else 20.0)
    assert read.refused(b"MATLAB 5.0" + bytes(200)) == [said]


def test_names_in_a_dataset_are_names_only(tmp_path, monkeypatch, run_eaid):
    """Whatever path they look like."""
    inside = tmp_path / "inside"
    inside.mkdir()
    monkeypatch.chdir(inside)
    t, duty, torque = written.step()
    with h5py.File(inside / "d.h5", "w") as file:
        file.attrs.update(schema="eaid/data/1", kind="clutch", input_unit="%")
        for i, name in enumerate(("..%2f..%2fevil", "~", "C:\\x", "a\\..\\..\\b")):
            group = file.create_group("runs/" + name)
            group.update({"time_s": t, "input": duty, "torque_nm": torque})
            group.attrs.update(level=60.0, repeat=i, step_s=1.0, baseline_nm=0.0, source="../../evil", sha256="")
    assert run_eaid("ingest", "d.h5", "-o", "out.h5", "-q").code == 0
    assert sorted(item.name for item in tmp_path.rglob("*")) == ["d.h5", "inside", "out.h5"]


def test_a_column_that_is_read_later_leaves_no_process(tmp_path, monkeypatch):
    """What is beside the columns of a log is read when somebody asks, by a process that ends with the answer."""
    started: list[Any] = []
    popen = formats.subprocess.Popen
    monkeypatch.setattr(formats.subprocess, "Popen", lambda *a, **k: started.append(popen(*a, **k)) or started[-1])
    duty = np.repeat([0.0, 30.0, 60.0, 20.0, 80.0, 0.0], 100)
    np.savez(tmp_path / "log.npz", time=np.arange(600) / 50, duty_pct=duty, torque_nm=duty / 20, temp=np.sin(duty))
    (run,) = eaid.read(tmp_path / "log.npz", logs_as="recorded").recorded
    assert [name for name, _ in run.others()] == ["temp"]
    assert len(started) == 2 and all(one.poll() is not None for one in started)
