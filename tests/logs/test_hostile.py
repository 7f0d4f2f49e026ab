"""Files made to do harm: code in them is never run, bombs are refused by size first, memory stays bounded."""

import builtins
import gzip
import importlib.util
import json
import os
import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from eaid.cli.main import run
from eaid.errors import DataError
from eaid.logs.read import read_runs

sys.path.insert(0, str(Path(__file__).parent))
import logs_written as written


class Payload:
    """A pickle that leaves a file behind where it is loaded."""

    def __init__(self, marker: Path) -> None:
        self.marker = marker

    def __reduce__(self):
        return os.system, (f"touch {self.marker}",)


def _pickled(path, payload):
    path.write_bytes(pickle.dumps(payload))


def _npy(path, payload):
    with path.open("wb") as file:
        np.save(file, np.array([payload], dtype=object), allow_pickle=True)


def _npz(path, payload):
    with path.open("wb") as file:
        np.savez(file, time=np.arange(3.0), torque=np.array([payload], dtype=object))


def _hdf5(path, payload):
    import h5py

    with h5py.File(path, "w") as file:
        file["time"] = np.arange(50.0)
        file["torque"] = np.void(pickle.dumps(payload))
        file.attrs["schema"] = np.void(pickle.dumps(payload))


def _mat(path, payload):
    from scipy.io import savemat

    savemat(path, {"code": "delete('*')", "torque": np.array([pickle.dumps(payload)])}, appendmat=False)


def _parquet(path, payload):
    pa = pytest.importorskip("pyarrow")
    import pyarrow.parquet as pq

    schema = pa.schema([pa.field("torque", pa.binary())], metadata={b"pandas": pickle.dumps(payload)})
    pq.write_table(pa.table([[pickle.dumps(payload)] * 20], schema=schema), path)


@pytest.mark.parametrize("make", [_pickled, _npy, _npz, _hdf5, _mat, _parquet])
def test_code_in_a_log_is_never_run(tmp_path, make):
    marker, path = tmp_path / "it-was-run", tmp_path / "log.csv"
    make(path, Payload(marker))
    with pytest.raises(DataError):
        read_runs([path])
    assert not marker.exists()
    if make is _pickled:  # the payload works
        pickle.loads(path.read_bytes())
        assert marker.exists()


@pytest.mark.parametrize("which", ["ros1", "ros2"])
def test_message_definitions_are_never_compiled(tmp_path, monkeypatch, which):
    pytest.importorskip("rosbags")
    data = written.step(60)
    path = getattr(written, which)(tmp_path / "log", *data)

    def load():
        for table in written.tables(path):
            table.load(range(len(table.columns)))

    load()  # all that is imported is

    def refuse(*_):
        raise AssertionError("code was run")

    monkeypatch.setattr(builtins, "exec", refuse)
    monkeypatch.setattr(builtins, "eval", refuse)
    load()


def _bomb_gzip(path):
    path.write_bytes(gzip.compress(b"time_s,torque_nm\n" + b"0,0\n" * 30_000_000))


def _bomb_hdf5(path):
    import h5py

    with h5py.File(path, "w") as file:
        for name in ("time", "torque"):
            file.create_dataset(name, (1 << 34,), "f8", chunks=(1 << 20,), compression="gzip", fillvalue=0.0)


BOMBS = {
    "gzip": (_bomb_gzip, "unpacks to more than 200 times its size"),
    "hdf5": (_bomb_hdf5, "takes far more memory to unpack than its size accounts for|damaged HDF5"),
}


@pytest.mark.skipif(sys.platform != "linux", reason="memory is bounded by the kernel, as Linux does it")
@pytest.mark.parametrize("name", BOMBS)
def test_a_bomb_is_refused(tmp_path, name):
    """They unpack to 120 MB, and claim 270 GB."""
    make, sentence = BOMBS[name]
    path = tmp_path / "log"
    make(path)
    assert path.stat().st_size < 2_000_000
    with pytest.raises(DataError, match=sentence):
        read_runs([path])


MEASURED = """
import json, os, resource, sys
from pathlib import Path
import pandas
sys.path.insert(0, sys.argv.pop(1))
from logs_written import tables

def load(path):
    for table in tables(path):
        table.load(range(len(table.columns)))

found = {}
for small, large in zip(sys.argv[1::2], sys.argv[2::2]):
    load(Path(small))
    out, into = os.pipe()
    if not os.fork():  # the high-water mark of a new process begins at what it has now
        before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        load(Path(large))
        after = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        os.write(into, str(after - before).encode())
        os._exit(0)
    os.close(into)
    os.wait()
    found[Path(large).name] = int(os.read(out, 100) or -1) * 1024
print(json.dumps(found))
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
def test_memory_is_a_few_times_the_file(tmp_path):
    """Of files that are not packed; 16 MB are allowed for buffers."""
    names = ["text", "hdf5", "mat"]
    names += ["tdms"] if importlib.util.find_spec("nptdms") else []
    given = []
    for name in names:
        for count in (500, 400_000):
            path = tmp_path / f"{name}-{count}"
            _plain(name, path, *written.step(count))  # the small one warms up whatever the reader imports
            given.append(str(path))
    done = subprocess.run(
        [sys.executable, "-c", MEASURED, str(Path(__file__).parent), *given],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    for name, taken in json.loads(done.stdout).items():
        size = (tmp_path / name).stat().st_size
        assert 0 <= taken <= 4 * size + (16 << 20), (name, taken / size)


def _plain(name, path, t, duty, torque):
    if name == "text":
        rows = "".join(f"{a:.9f},{b:.9f},{c:.9f}\n" for a, b, c in zip(*written.step(500), strict=True))
        path.write_text("time_s,duty_pct,torque_nm\n" + rows * (len(t) // 500))
    elif name == "hdf5":
        import h5py

        with h5py.File(path, "w") as file:
            file.update({"time": t, "duty": duty, "torque": torque})
    elif name == "mat":
        from scipy.io import savemat

        savemat(path, {"time": t, "duty": duty, "torque": torque}, appendmat=False)
    else:
        getattr(written, name)(path, t, duty, torque)


def test_a_hostile_log_leaves_no_trace_outside(tmp_path, monkeypatch, capsys):
    """Names in a dataset are names only, whatever path they look like."""
    import h5py

    inside = tmp_path / "inside"
    inside.mkdir()
    monkeypatch.chdir(inside)
    t, duty, torque = written.step()
    with h5py.File(inside / "d.h5", "w") as file:
        file.attrs.update(schema="eaid/data/1", kind="clutch", input_unit="%")
        for i, name in enumerate(("..", "~", "C:\\x", "a\\..\\..\\b")):
            group = file.create_group("runs/" + name if name != ".." else "runs/..%2f..%2fevil")
            group.update({"time_s": t, "input": duty, "torque_nm": torque})
            group.attrs.update(level=60.0, repeat=i, step_s=1.0, baseline_nm=0.0, source="../../evil", sha256="")
    assert run(["ingest", "d.h5", "-o", "out.h5", "-q"]) == 0
    assert sorted(item.name for item in tmp_path.rglob("*")) == ["d.h5", "inside", "out.h5"]
