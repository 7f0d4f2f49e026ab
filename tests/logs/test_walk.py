"""The walk through an HDF5 file gives what h5py gives, and columns unpacked by hand are those of the library."""

import h5py
import numpy as np
import pytest

from eaid.apparatus import Apparatus
from eaid.errors import DataError
from eaid.logs.dataset import read_dataset, write_dataset
from eaid.logs.run import Run
from eaid.logs.walk import unpacked, walk


def packed(group, name, values, **changes):
    settings = {"chunks": (len(values),), "compression": "gzip", "shuffle": True} | changes
    return group.create_dataset(name, data=values, **settings)


def test_facts_and_shapes_are_those_of_h5py(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        group = file.create_group("runs/größe")
        facts = {
            "text": "N·m", "bytes": np.bytes_(b"abc"), "double": 1e22, "long": -3, "single": np.float32(0.1),
            "list": [1.0, 2.0], "words": ["a", "b"], "yes": True, "empty": "", "wide": np.uint64(2**63),
            "big": np.array(1.5, ">f8"),
            "nothing": h5py.Empty("f8"), "ascii": np.array("x", h5py.string_dtype("ascii")),
        }  # fmt: skip
        for key, value in facts.items():
            group.attrs[key] = value
        group["matrix"] = np.zeros((2, 3))
        group["scalar"] = 4.0
        group["void"] = h5py.Empty("f8")
        file["type"] = np.dtype("f4")
    with h5py.File(tmp_path / "a.h5") as file:
        seen = []
        file.visititems(lambda name, item: seen.append((name, item)))
        items = walk(file)
        assert [item.name for item in items] == ["", *(name for name, _ in seen)]
        for item, (_, other) in zip(items[1:], seen, strict=True):
            assert item.shape == getattr(other, "shape", None)
            assert item.is_array == isinstance(other, h5py.Dataset)
            assert {k: repr(v) for k, v in item.facts.items()} == {k: repr(v) for k, v in other.attrs.items()}
        assert len(next(item for item in items if item.name == "runs/größe").facts) == len(facts)


@pytest.mark.parametrize(("count", "chunk"), [(1, 1), (1000, 1000), (1000, 300), (900, 300)])
def test_unpacked_columns_are_those_of_the_library(tmp_path, count, chunk):
    values = np.random.default_rng(0).standard_normal(count)
    values[: count // 2] = [np.nan, np.inf, -0.0, 5e-324, 1.8e308][: count // 2] + [0.0] * max(0, count // 2 - 5)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        packed(file, "x", values, chunks=(chunk,))
        found = unpacked(file["x"].id, {})
    assert found is not None
    assert found.tobytes() == values.tobytes()
    assert found.dtype == np.float64
    assert not found.flags.writeable


def test_equal_columns_are_unpacked_once(tmp_path):
    time = np.arange(100) / 1000
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for name in "ab":
            packed(file, name, time)
        packed(file, "c", 2 * time)
        known = {}
        a, b, c = (unpacked(file[name].id, known) for name in "abc")
    assert a is b
    np.testing.assert_array_equal(c, 2 * a)


@pytest.mark.parametrize(
    "changes",
    [
        {"compression": None}, {"shuffle": False}, {"fletcher32": True}, {"compression": "lzf"}, {"dtype": "f4"},
        {"dtype": ">f8"}, {"dtype": "i8"}, {"shuffle": False, "compression": None, "chunks": None},
    ],
)  # fmt: skip
def test_columns_packed_otherwise_are_left_to_the_library(tmp_path, changes):
    values = np.arange(100.0)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        packed(file, "x", values, **changes)
        assert unpacked(file["x"].id, {}) is None


def test_matrices_and_columns_never_written_are_left_to_the_library(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        packed(file, "matrix", np.zeros((4, 4)), chunks=(4, 4))
        file.create_dataset("unwritten", (100,), "f8", chunks=(100,), compression="gzip", shuffle=True)
        packed(file, "empty", np.zeros(0), chunks=(10,), maxshape=(None,))
        assert [unpacked(file[name].id, {}) for name in ("matrix", "unwritten", "empty")] == [None] * 3


def run(name, **changes):
    time = np.arange(500) / 1000
    torque = np.where(time > 0.1, 1 - np.exp(-(time - 0.1)), 0.0) + 1e-3 * np.random.default_rng(0).standard_normal(500)
    facts = {"level": 30.0, "repeat": 1, "step_s": 0.1, "baseline": 0.0, "cut": True} | changes
    return Run(name, time, np.where(time >= 0.1, 30.0, 0.0), torque, "%", "N·m", "a.csv", "0" * 64, **facts)


def chunk_of(path, column):
    """Where the only chunk of a column stands in its file."""
    with h5py.File(path) as file:
        info = file[column].id.get_chunk_info(0)
    return info.byte_offset, info.size


@pytest.mark.parametrize("where", [0.0, 0.3, 0.999])
def test_a_damaged_column_is_told_and_the_other_runs_are_read(tmp_path, where):
    path = tmp_path / "data.h5"
    write_dataset(path, [run("a"), run("b", repeat=2)], kind="clutch", apparatus=Apparatus())
    start, size = chunk_of(path, "runs/a/torque_nm")
    data = bytearray(path.read_bytes())
    data[start + int(where * size)] ^= 0x55
    path.write_bytes(data)
    runs, faults = read_dataset(path, "data.h5", "")
    assert faults == ["data.h5: run a is damaged and cannot be read; ingest the logs again"]
    assert [found.name for found in runs] == ["b"]


def test_a_chunk_that_unpacks_to_more_than_it_claims_is_not_taken(tmp_path):
    import zlib

    with h5py.File(tmp_path / "a.h5", "w") as file:
        stored = packed(file, "x", np.arange(100.0))
        for size in (0, 799, 801, 1 << 24):
            stored.id.write_direct_chunk((0,), zlib.compress(bytes(size)))
            assert unpacked(stored.id, {}) is None
        stored.id.write_direct_chunk((0,), zlib.compress(bytes(800)))
        assert not unpacked(stored.id, {}).any()
        stored.id.write_direct_chunk((0,), zlib.compress(bytes(800))[:-1])  # without its checksum
        assert unpacked(stored.id, {}) is None
        stored.id.write_direct_chunk((0,), bytes(800), filter_mask=3)  # stored as it is
        assert unpacked(stored.id, {}) is None


def test_a_column_with_two_names_is_read_under_both(tmp_path):
    path = tmp_path / "data.h5"
    with h5py.File(path, "w") as file:
        file.attrs["schema"] = "eaid/data/1"
        for name in "ab":
            group = file.create_group(f"runs/{name}")
            given = run(name)
            packed(group, "input", given.input)
            packed(group, "torque_nm", given.output)
        packed(file["runs/a"], "time_s", given.time_s)
        file["runs/b/time_s"] = file["runs/a/time_s"]
        file["runs/c"] = h5py.SoftLink("/runs/a")
    runs, faults = read_dataset(path, "data.h5", "")
    assert not faults
    assert [found.name for found in runs] == ["a", "b", "c"]
    for found in runs:
        np.testing.assert_array_equal(found.time_s, given.time_s)


def test_a_group_in_place_of_a_column_is_told(tmp_path):
    path = tmp_path / "data.h5"
    write_dataset(path, [run("a")], kind="clutch", apparatus=Apparatus())
    with h5py.File(path, "r+") as file:
        del file["runs/a/input"]
        del file.attrs["digest"]
        file.create_group("runs/a/input")
    assert read_dataset(path, "data.h5", "")[1] == ["data.h5: run a has no input; ingest the logs again"]


def test_links_to_other_files_and_what_claims_too_much_are_refused(tmp_path):
    path = tmp_path / "data.h5"
    write_dataset(path, [run("a")], kind="clutch", apparatus=Apparatus())
    with h5py.File(path, "r+") as file:
        file["runs/b"] = h5py.ExternalLink("other.h5", "/x")
        file.create_dataset("runs/a/huge", (1 << 40,), "f8", chunks=(1000,))
    with pytest.raises(DataError) as fault:
        read_dataset(path, "data.h5", "")
    assert "runs/b is a link to another file" in str(fault.value)
    assert "runs/a/huge claims 1.1e+12 values" in str(fault.value)
