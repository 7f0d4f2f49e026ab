"""The shipped datasets: small, marked, and made again by one call."""

import runpy
from pathlib import Path

import h5py
import numpy as np
import pytest

from eaid import __version__
from eaid.options import EXPERIMENTS
from eaid.synth import files as datasets


@pytest.fixture(scope="module")
def again(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    script = runpy.run_path(str(Path(__file__).parents[2] / "datasets" / "make.py"))
    made: dict[str, Path] = script["make"](tmp_path_factory.mktemp("datasets"))
    return made


def contents(path: Path) -> dict[str, object]:
    """Everything in a dataset but the version that wrote it."""
    with h5py.File(path) as file:
        found: dict[str, object] = {f"@{name}": value for name, value in file.attrs.items() if name != "eaid"}
        for name, group in file["runs"].items():
            found |= {f"{name}@{key}": value for key, value in group.attrs.items()}
            found |= {f"{name}/{key}": values[()].tobytes() for key, values in group.items()}
    return found


@pytest.mark.slow
@pytest.mark.parametrize("kind", EXPERIMENTS)
def test_remaking_gives_the_same_numbers_and_the_same_bytes(kind: str, again: dict[str, Path]) -> None:
    kept = datasets.shipped()[kind]
    assert contents(kept) == contents(again[kind])
    with h5py.File(kept) as file:
        if file.attrs["eaid"] != __version__:
            pytest.skip("the shipped datasets were made by another version of eaid; run datasets/make.py")
    same = kept.read_bytes() == again[kind].read_bytes()
    if not same and tuple(map(int, h5py.version.hdf5_version_tuple)) != (2, 0, 0):
        pytest.skip("another HDF5 than the one that wrote the shipped datasets: same numbers, other bytes")
    assert same


def test_all_three_are_below_five_megabytes_and_say_that_they_are_synthetic() -> None:
    paths = datasets.shipped()
    assert tuple(paths) == ("clutch", "friction-force", "friction-speed")
    assert sum(path.stat().st_size for path in paths.values()) < 5e6
    for kind, path in paths.items():
        with h5py.File(path) as file:
            assert file.attrs["kind"] == kind and "recorded on no rig" in file.attrs["synthetic"]
            assert file.attrs["surfaces"] == (2 if kind == "clutch" else 1)
            digits = next(iter(file["runs"].values()))["torque_nm"][()] * 1024  # of the sensor
            np.testing.assert_array_equal(digits, np.round(digits))


def test_the_clutch_set_is_the_papers_experiment() -> None:
    with h5py.File(datasets.shipped()["clutch"]) as file:
        runs = {name: group for name, group in file["runs"].items() if group.attrs["edge"] == "rising"}
        assert sorted({group.attrs["level"] for group in runs.values()}) == list(range(10, 101, 10))
        assert len(runs) == 30 and len(file["runs"]) == 60
        for group in runs.values():
            time_s, duty_pct = group["time_s"][()], group["input"][()]
            assert group.attrs["step_s"] == 10.0 and time_s[0] == 0.0 and len(time_s) == 30_000
            np.testing.assert_allclose(np.diff(time_s), 1e-3, rtol=1e-9)
            assert np.all(duty_pct[:10_000] == 0) and np.all(duty_pct[10_000:] == group.attrs["level"])
