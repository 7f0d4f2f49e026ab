"""MAT-files and HDF5 in every shape that rigs write, against the arrays that went in; and what is refused."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from eaid.logs.options import ReadOptions
from scipy.io import savemat

from eaid.errors import DataError
from eaid.logs.read import read_runs
from eaid.logs.run import Run

T = np.arange(500) / 100.0 + 25.0
U = np.where(T >= 26.0, 40.0, 0.0)
Y = np.where(T >= 26.0, 1.5 * -np.expm1(-(T - 26.0) / 0.3), 0.0)


def structure(labels: list[Any], values: list[np.ndarray]) -> dict[str, Any]:
    """What Simulink's To Workspace writes as structure with time."""
    signals = np.empty(len(labels), dtype=[("values", "O"), ("dimensions", "O"), ("label", "O"), ("title", "O")])
    for k, (label, value) in enumerate(zip(labels, values, strict=True)):
        signals[k] = (value, 1, label, "")
    return {"time": T[:, np.newaxis], "signals": signals, "blockName": "clutch/To Workspace"}


def labels_of_columns(*texts: str) -> np.ndarray:
    cell = np.empty((1, len(texts)), dtype=object)
    cell[0, :] = texts
    return cell


SHAPES: dict[str, tuple[Callable[[Path], None], dict[str, Any]]] = {
    "QuaRC matrix, samples in columns": (lambda p: savemat(p, {"data": np.stack([T, U, Y])}), {}),
    "matrix, samples in rows": (lambda p: savemat(p, {"data": np.stack([T, U, Y], axis=1)}), {}),
    "matrix and other variables": (
        lambda p: savemat(p, {"data": np.stack([T, U, Y]), "Kp": 3.0, "name": "rig", "gains": np.eye(2)}), {},
    ),
    "MAT v4 matrix": (lambda p: savemat(p, {"data": np.stack([T, U, Y])}, format="4"), {}),
    "compressed": (lambda p: savemat(p, {"data": np.stack([T, U, Y])}, do_compression=True), {}),
    "wide matrix by number": (
        lambda p: savemat(p, {"log": np.stack([T, 0 * T, Y, 0 * T, U])}),
        {"columns": {"time": "1", "input": "5", "output": "3"}},
    ),
    "vectors": (lambda p: savemat(p, {"time": T, "duty": U, "torque": Y, "note": "x"}), {}),
    "column vectors": (lambda p: savemat(p, {"t": T[:, None], "u": U[:, None], "Torque_Nm": Y[:, None]}), {}),
    "two matrices, one named": (
        lambda p: savemat(p, {"a": np.stack([T, U, Y]), "b": np.stack([T, U, 2 * Y])}), {"variable": "a"},
    ),
    "structure of vectors": (lambda p: savemat(p, {"log": {"time_s": T, "duty_pct": U, "torque_nm": Y}}), {}),
    "structure with time": (
        lambda p: savemat(p, {"out": structure(["duty (%)", "torque (Nm)"], [U[:, None], Y[:, None]])}), {},
    ),
    "structure with time, one signal of two columns": (
        lambda p: savemat(p, {"out": structure([labels_of_columns("duty", "torque")], [np.stack([U, Y], axis=1)])}), {},
    ),
    "structure with time, no labels": (
        lambda p: savemat(p, {"out": structure(["", ""], [U[:, None], Y[:, None]])}),
        {"columns": {"input": "signal1", "output": "signal2"}, "units": {"output": "Nm"}},
    ),
}  # fmt: skip


def v73(path: Path, build: Callable[[Any], None]) -> None:
    """A file as MATLAB writes with -v7.3: HDF5 behind 512 bytes of text."""
    with h5py.File(path, "w", userblock_size=512) as file:
        build(file)
    with path.open("r+b") as file:
        file.write(
            b"MATLAB 7.3 MAT-file, Platform: GLNXA64, Created on: Mon Jan  1 00:00:00 2024 HDF5 schema 1.00 .".ljust(
                512
            )
        )


def matlab(file: Any, name: str, values: np.ndarray) -> None:
    file[name] = values
    file[name].attrs["MATLAB_class"] = np.bytes_(b"double")


def vectors73(file: Any) -> None:
    for name, values in (("time", T), ("duty", U), ("torque", Y)):
        matlab(file, name, values[np.newaxis])
    file["note"] = np.array([[104], [105]], dtype="u2")
    file["note"].attrs["MATLAB_class"] = np.bytes_(b"char")


def struct73(file: Any) -> None:
    for name, values in (("time", T), ("duty", U), ("torque", Y)):
        matlab(file, f"log/{name}", values[np.newaxis])
    file["log"].attrs["MATLAB_class"] = np.bytes_(b"struct")


HDF5: dict[str, tuple[Callable[[Path], None], dict[str, Any]]] = {
    "v7.3 vectors": (lambda p: v73(p, vectors73), {}),
    "v7.3 structure": (lambda p: v73(p, struct73), {}),
    "v7.3 matrix": (lambda p: v73(p, lambda f: matlab(f, "data", np.stack([T, U, Y]))), {}),
    "v7.3 matrix the other way": (lambda p: v73(p, lambda f: matlab(f, "data", np.stack([T, U, Y], axis=1))), {}),
}


def plain(path: Path, **columns: np.ndarray) -> None:
    with h5py.File(path, "w") as file:
        for name, values in columns.items():
            file[name.replace("__", "/")] = values


def compound(path: Path) -> None:
    table = np.zeros(len(T), dtype=[("time_s", "f8"), ("duty_pct", "f4"), ("torque_nm", "f8"), ("note", "S3")])
    table["time_s"], table["duty_pct"], table["torque_nm"] = T, U, Y
    with h5py.File(path, "w") as file:
        file["log/table"] = table


def named_columns(path: Path) -> None:
    with h5py.File(path, "w") as file:
        file["log"] = np.stack([Y, T, U], axis=1)
        file["log"].attrs["columns"] = ["torque_nm", "time_s", "duty_pct"]


HDF5 |= {
    "vectors": (lambda p: plain(p, time_s=T, duty_pct=U, torque_nm=Y), {}),
    "vectors in a group": (
        lambda p: plain(p, rig__time_s=T, rig__duty_pct=U, rig__torque_nm=Y, rig__gain=np.eye(3)), {},
    ),
    "one of two groups": (
        lambda p: plain(p, a__time=T, a__duty=U, a__torque=Y, b__time=T, b__duty=U, b__torque=2 * Y), {"variable": "a"},
    ),
    "compound table": (compound, {}),
    "matrix with named columns": (named_columns, {}),
    "single precision": (
        lambda p: plain(p, time_s=T, duty_pct=U.astype("f4"), torque_nm=Y), {},
    ),
}  # fmt: skip


def read_one(path: Path, **options: Any) -> Run:
    (run,) = read_runs([path], ReadOptions(**options))
    return run


@pytest.mark.parametrize("name", [*SHAPES, *HDF5])
def test_shape(name: str, tmp_path: Path) -> None:
    write, options = (SHAPES | HDF5)[name]
    path = tmp_path / "log.mat"
    write(path)
    path.rename(tmp_path / "log.odd")  # found by content, not by ending
    run = read_one(tmp_path / "log.odd", **options)
    np.testing.assert_array_equal(run.time_s, T - 25.0)
    assert run.start_s == 25.0
    np.testing.assert_array_equal(run.input, U)
    np.testing.assert_array_equal(run.output, Y)
    assert run.output_unit in ("", "N·m")


def opaque(file: Any) -> None:
    file["#refs#/a"] = np.zeros(3)
    file["data"] = np.zeros((1, 6), dtype="u4")
    file["data"].attrs["MATLAB_class"] = np.bytes_(b"Simulink.SimulationData.Dataset")


def external(path: Path) -> None:
    with h5py.File(path, "w") as file:
        file["time"] = T
        file["torque"] = h5py.ExternalLink("/etc/passwd", "/x")


def outside(path: Path) -> None:
    (path.parent / "raw").write_bytes(Y.tobytes())
    with h5py.File(path, "w") as file:
        file["time"] = T
        file.create_dataset("torque", (len(T),), "f8", external=[(str(path.parent / "raw"), 0, Y.nbytes)])


def absurd(path: Path) -> None:
    with h5py.File(path, "w") as file:
        file["time"] = T
        file.create_dataset("torque", (10**13,), "f8", chunks=(1024,))


REFUSED: dict[str, tuple[Callable[[Path], None], str]] = {
    "opaque Dataset": (
        lambda p: v73(p, opaque),
        r"holds MATLAB objects \(a Simulink Dataset or timeseries\) only; in MATLAB, save it as",
    ),
    "external link": (external, "torque is a link to another file; copy the data into this one"),
    "external storage": (outside, "torque keeps its data in another file; copy the data into this one"),
    "absurd size": (absurd, "no table in it has columns of time and torque"),
    "no numbers in HDF5": (lambda p: plain(p, note=np.bytes_(b"x")), "holds no table of numbers"),
    "no numbers in MAT": (lambda p: savemat(p, {"note": "x", "Kp": 2.0}), "holds no table of numbers"),
    "two tables": (
        lambda p: savemat(p, {"a": np.stack([T, U, Y]), "b": np.stack([T, U, 2 * Y])}),
        r"holds several tables that may be the log \(a, b\); choose one with variable= NAME",
    ),
    "no table matches": (
        lambda p: savemat(p, {"a": np.stack([T, U, Y, Y]), "b": np.ones((4, 90))}),
        "no table in it has columns of time and torque",
    ),
    "complex numbers": (lambda p: savemat(p, {"time": T, "torque": Y * 1j}), "no column is called torque"),
    "unequal lengths": (lambda p: plain(p, time_s=T, torque_nm=Y[:-1]), "no table in it has columns of time"),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_refused(name: str, tmp_path: Path) -> None:
    write, sentence = REFUSED[name]
    write(tmp_path / "log.mat")
    with pytest.raises(DataError, match=sentence) as caught:
        read_one(tmp_path / "log.mat")
    assert all(said.startswith(f"{tmp_path / 'log.mat'}: ") for said in caught.value.sentences)


def test_a_variable_that_is_not_there(tmp_path: Path) -> None:
    savemat(tmp_path / "a.mat", {"a": np.stack([T, U, Y])})
    with pytest.raises(DataError, match="holds no table c for variable=; it holds a"):
        read_one(tmp_path / "a.mat", variable="c")


def test_cut_off_files_are_refused(tmp_path: Path) -> None:
    """Every file cut short anywhere gives a sentence, or the whole of what it holds; never another error."""
    savemat(tmp_path / "a.mat", {"data": np.stack([T, U, Y])})
    plain(tmp_path / "a.h5", time_s=T, duty_pct=U, torque_nm=Y)
    for name in ("a.mat", "a.h5"):
        whole = (tmp_path / name).read_bytes()
        for size in (1, 60, 127, 130, 200, 600, 2000, len(whole) // 2, len(whole) - 1):
            (tmp_path / "cut").write_bytes(whole[:size])
            with pytest.raises(DataError) as caught:
                read_one(tmp_path / "cut")
            assert "\n" not in caught.value.sentences[0]
