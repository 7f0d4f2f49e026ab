"""Noise coloured as residuals are, and replay.h5: what is written comes back, whole or not at all, the same bytes."""

import math

import numpy as np
import pytest

from eaid.errors import DataError, UsageError
from eaid.replay.files import Record, read_replay, write_replay
from eaid.replay.residual_noise import residual_noise
from eaid.replay.rig import Rig, noise


def fitted(rho=0.5, effective=500.0, repeats=3):
    levels = [{"level": level, "sse": 1e4 * s**2, "rmse": s} for level, s in ((30.0, 0.01), (60.0, 0.02))]
    sources = [{"level": level} for level in (30.0, 60.0) for _ in range(repeats)]
    return {
        "data": {"sample_rate_hz": 1000.0, "sources": sources},
        "friction": {"levels": levels},
        "uncertainty": {"adequacy": {"residual_autocorrelation": rho, "effective_samples": effective}},
    }


def test_the_noise_has_both_numbers_of_the_residuals():
    made = residual_noise(fitted())
    assert made["noise_nm"] == pytest.approx(math.sqrt(3 * (0.01**2 + 0.02**2) / 2))
    phi, share = math.exp(-1e-3 / made["noise_correlation_s"]), made["noise_coloured_share"]
    assert share * phi == pytest.approx(0.5)
    assert 1 + 2 * share * phi / (1 - phi) == pytest.approx(20_000 / 500)
    values = noise(Rig(**made), 400_000, 1e-3, 2)
    assert values.std() == pytest.approx(made["noise_nm"], rel=0.02)
    assert np.corrcoef(values[1:], values[:-1])[0, 1] == pytest.approx(0.5, abs=0.01)
    assert np.corrcoef(values[20:], values[:-20])[0, 1] == pytest.approx(share * phi**20, abs=0.02)


def test_white_residuals_make_white_noise_and_a_short_tail_one_process():
    assert residual_noise(fitted(rho=0.0, effective=20_000.0))["noise_correlation_s"] == 0.0
    assert residual_noise(fitted(rho=0.8, effective=19_000.0))["noise_coloured_share"] == 1.0


def test_a_fit_that_does_not_say_is_told_so():
    assert "fit again with --ci robust" in residual_noise({"nonlinear": {}})
    silent = fitted()
    for level in silent["friction"]["levels"]:
        level["sse"] = level["rmse"] = 0.0
    assert "residuals are zero" in residual_noise(silent)


def test_first_order_noise_keeps_its_variance():
    values = noise(Rig(noise_nm=0.1, noise_correlation_s=0.02), 200_000, 1e-3, 5)
    assert values.std() == pytest.approx(0.1, rel=0.03)
    assert np.corrcoef(values[20:], values[:-20])[0, 1] == pytest.approx(math.exp(-1), abs=0.03)


RECORD = Record(
    {"time_s": np.arange(3) * 0.1, "torque_nm": np.ones(3)},
    {"steps": [{"settling_s": None}], "rms_error_nm": 0.5},
    {"plants/band_nm": np.ones((2, 3)), "plants/metrics/steps[1].rise_time_s": np.ones(3)},
)


def test_what_is_written_comes_back(tmp_path):
    path = tmp_path / "r.h5"
    write_replay(path, {"rc": RECORD}, {"scenario": "steps", "seed": 3, "rig": {"noise_nm": 0.1}, "list": [1.5]})
    records, head = read_replay(path)
    assert head["scenario"] == "steps" and head["seed"] == 3 and head["rig"] == {"noise_nm": 0.1}
    assert head["schema"] == "eaid/replay/1" and head["list"] == [1.5]
    assert records["rc"].metrics == RECORD.metrics
    assert set(records["rc"].columns) == {"time_s", "torque_nm"}
    assert set(records["rc"].tables) == {"plants/band_nm", "plants/metrics/steps[1].rise_time_s"}
    assert records["rc"].columns["time_s"].tolist() == [0.0, 0.1, 0.2]


def test_the_same_record_gives_the_same_bytes(tmp_path):
    for name in ("a", "b"):
        write_replay(tmp_path / name, {"rc": RECORD}, {"scenario": "steps"})
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_an_earlier_replay_is_left_alone(tmp_path):
    path = tmp_path / "r.h5"
    path.write_text("mine")
    with pytest.raises(UsageError, match="--force"):
        write_replay(path, {"rc": RECORD}, {})
    assert path.read_text() == "mine" and len(list(tmp_path.iterdir())) == 1
    with pytest.raises(TypeError):
        write_replay(path, {"rc": Record({"time_s": np.ones(1)}, {"bad": object()})}, {}, force=True)
    assert path.read_text() == "mine" and len(list(tmp_path.iterdir())) == 1


def test_what_is_no_replay_is_refused(tmp_path):
    import h5py

    with pytest.raises(DataError, match="no such file"):
        read_replay(tmp_path / "none.h5")
    (tmp_path / "text.h5").write_text("hello")
    with pytest.raises(DataError, match="is no HDF5 file"):
        read_replay(tmp_path / "text.h5")
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file.attrs["schema"] = "eaid/data/1"
    with pytest.raises(DataError, match="is no eaid/replay/1 file"):
        read_replay(tmp_path / "other.h5")


def test_a_damaged_replay_is_refused_or_read_as_it_was(tmp_path):
    """One byte changed anywhere: a sentence with the file's name, or the same numbers."""
    path = tmp_path / "replay.h5"
    t = np.arange(500) / 1000
    record = Record({"time_s": t, "torque_nm": np.sin(t), "duty_pct": np.cos(t)}, {"max_abs_error_nm": 0.125})
    write_replay(path, {"rc": record}, {"scenario": "steps", "seed": 3, "options": {"a": [1, 2]}})
    whole, wanted = path.read_bytes(), read_replay(path)
    refused = 0
    for at in np.random.default_rng(5).integers(0, len(whole), 150).tolist():
        damaged = bytearray(whole)
        damaged[at] ^= 0x55
        path.write_bytes(damaged)
        try:
            records, options = read_replay(path)
        except DataError as refusal:
            refused += 1
            assert str(path) in str(refusal)  # noqa: PT017
            continue
        assert options == wanted[1] and records["rc"].metrics == record.metrics
        for name, values in record.columns.items():
            np.testing.assert_array_equal(records["rc"].columns[name], values)
    assert refused > 50
