"""replay.h5: what is written comes back; by another hand or damaged it is refused, or read as it was."""

import h5py
import numpy as np
import pytest

import eaid


@pytest.fixture(scope="module")
def run(fit, gains):
    return eaid.simulate(fit, gains, "steps", duration=0.9, noise_nm=0.01, plants=3, rate_hz=200.0)


@pytest.fixture
def file(run, tmp_path):
    run.save(tmp_path / "r.h5")
    return tmp_path / "r.h5"


def same(found, run):
    assert found.head == run.head and list(found.records) == sorted(run.records)
    for name, one in run.records.items():
        other = found.records[name]
        assert (other.metrics, other.role) == (one.metrics, one.role)
        for kept, read in ((one.columns, other.columns), (one.tables, other.tables)):
            assert set(kept) == set(read)
            for key, values in kept.items():
                np.testing.assert_array_equal(read[key], values)


def test_what_is_written_comes_back(run, file, tmp_path):
    same(eaid.load(file), run)
    frame = eaid.load(file).to_frame()
    assert len(frame) == 2 * 180 and list(frame["name"].unique()) == ["pi", "rc"]
    run.save(tmp_path / "again.h5")
    assert (tmp_path / "again.h5").read_bytes() == file.read_bytes()
    with pytest.raises(eaid.UsageError, match="exists already"):
        run.save(file)
    with h5py.File(file) as held:
        assert held.attrs["schema"] == "eaid/replay/1" and held.attrs["noise_nm" if "noise_nm" in held.attrs else "rig"]
        assert "band_quantiles" in held.attrs and "not_usable" not in held.attrs  # what holds nothing is left out
        assert '"settling_s":null' in held["rc"].attrs["metrics"] and "R2" not in held["rc"].attrs["metrics"]


def test_what_is_no_replay_is_refused(tmp_path, file):
    with pytest.raises(eaid.DataError, match="no such file"):
        eaid.load(tmp_path / "none.h5")
    with h5py.File(file, "a") as held:
        held.attrs["schema"] = "eaid/replay/0"
    with pytest.raises(eaid.DataError):
        eaid.load(file)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda one: one.__delitem__("time_s") or one.create_dataset("time_s", data=np.ones(1)), "no column of two"),
        (lambda one: one.create_dataset("more", data=np.full(180, 1e31)), "its more holds what is no number"),
        (lambda one: one.create_dataset("more", data=np.full(180, np.nan)), "its more holds what is no number"),
        (lambda one: one.create_dataset("more", data=np.full(180, b"a")), "its more holds what is no number"),
        (lambda one: one.attrs.__setitem__("metrics", "{no json"), "its metrics is no JSON"),
        (lambda one: one.attrs.__setitem__("metrics", '{"R2": NaN}'), "its metrics is no JSON"),
    ],
)
def test_a_replay_by_another_hand_is_held_to_its_shape(file, change, said):
    with h5py.File(file, "a") as held:
        change(held["rc"])
    with pytest.raises(eaid.DataError, match=said):
        eaid.load(file)


def test_what_is_no_group_of_a_controller_is_passed_over_and_other_lengths_are_tables(file):
    with h5py.File(file, "a") as held:
        del held["pi"]
        held.create_dataset("notes", data=np.ones(3))
        held.create_group("empty")
        held["rc"].create_dataset("large", data=np.full(180, 9e29))
        held["rc"].create_dataset("longer", data=np.ones(4))
        del held["rc"].attrs["role"]
    ((name, one),) = eaid.load(file).records.items()
    assert name == "rc" and one.role == "controller" and one.columns["large"].max() == 9e29
    assert one.tables["longer"].shape == (4,)


def test_a_damaged_replay_is_refused_or_read_as_it_was(run, file):
    """One byte changed anywhere: a sentence with the file's name, or the same numbers."""
    whole, refused = file.read_bytes(), 0
    for at in np.random.default_rng(5).integers(0, len(whole), 150).tolist():
        damaged = bytearray(whole)
        damaged[at] ^= 0x55
        file.write_bytes(damaged)
        try:
            found = eaid.load(file)
        except eaid.DataError as refusal:
            refused += 1
            assert str(file) in str(refusal)  # noqa: PT017
            continue
        same(found, run)
    assert refused > 50
