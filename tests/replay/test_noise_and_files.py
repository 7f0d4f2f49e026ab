"""Noise coloured as residuals are, and replay.h5: what is written comes back, whole or not at all, the same bytes."""

import math

import numpy as np
import pytest

from eaid.errors import DataError, UsageError
from eaid.replay.files import as_json, read, write_replay
from eaid.replay.noise import with_residual_noise
from eaid.replay.rig import Rig, noise
from eaid.results.codec import from_plain
from eaid.results.fit import Fit
from eaid.results.replay import Head, Metrics, Record, Replay, RigRecord, StepMetrics


def fit_of(plain):
    return from_plain(plain, Fit, "f")


def fitted(rho=0.5, effective=500.0, repeats=3):
    levels = [
        {"level": level, "Ts": 1, "tau1": 1, "tau2": 1, "sse": 1e4 * s**2, "rmse": s}
        for level, s in ((30.0, 0.01), (60.0, 0.02))
    ]
    sources = [{"level": level} for level in (30.0, 60.0) for _ in range(repeats)]
    return {
        "data": {"sample_rate_hz": 1000.0, "sources": sources},
        "friction": {"levels": levels},
        "uncertainty": {"adequacy": {"residual_autocorrelation": rho, "effective_samples": effective}},
    }


def test_the_noise_has_both_numbers_of_the_residuals():
    made = with_residual_noise(Rig(), fit_of(fitted()))
    assert made.noise_nm == pytest.approx(math.sqrt(3 * (0.01**2 + 0.02**2) / 2))
    phi, share = math.exp(-1e-3 / made.noise_correlation_s), made.noise_coloured_share
    assert share * phi == pytest.approx(0.5)
    assert 1 + 2 * share * phi / (1 - phi) == pytest.approx(20_000 / 500)
    values = noise(made, 400_000, 1e-3, 2)
    assert values.std() == pytest.approx(made.noise_nm, rel=0.02)
    assert np.corrcoef(values[1:], values[:-1])[0, 1] == pytest.approx(0.5, abs=0.01)
    assert np.corrcoef(values[20:], values[:-20])[0, 1] == pytest.approx(share * phi**20, abs=0.02)


def test_white_residuals_make_white_noise_and_a_short_tail_one_process():
    assert with_residual_noise(Rig(), fit_of(fitted(rho=0.0, effective=20_000.0))).noise_correlation_s == 0.0
    assert with_residual_noise(Rig(), fit_of(fitted(rho=0.8, effective=19_000.0))).noise_coloured_share == 1.0


def test_a_fit_that_does_not_say_is_told_so():
    with pytest.raises(DataError, match="fit again with ci= robust"):
        with_residual_noise(Rig(), Fit())
    silent = fitted()
    for level in silent["friction"]["levels"]:
        level["sse"] = level["rmse"] = 0.0
    with pytest.raises(DataError, match="residuals are zero"):
        with_residual_noise(Rig(), fit_of(silent))


def test_first_order_noise_keeps_its_variance():
    values = noise(Rig(noise_nm=0.1, noise_correlation_s=0.02), 200_000, 1e-3, 5)
    assert values.std() == pytest.approx(0.1, rel=0.03)
    assert np.corrcoef(values[20:], values[:-20])[0, 1] == pytest.approx(math.exp(-1), abs=0.03)


RECORD = Record(
    {"time_s": np.arange(3) * 0.1, "torque_nm": np.ones(3)},
    Metrics(rms_error_nm=0.5, steps=(StepMetrics(0.0, 1.0, settling_s=None, overshoot_pct=2.0),)),
    {"plants/band_nm": np.ones((2, 3)), "plants/metrics/steps[1].rise_time_s": np.ones(3)},
)
HEAD = Head("steps", seed=3, input_unit="V", rig=RigRecord(noise_nm=0.1), perturb={"Ts": 0.9}, band_quantiles=(0.5,))


def test_what_is_written_comes_back(tmp_path):
    path = tmp_path / "r.h5"
    write_replay(path, Replay(HEAD, {"rc": RECORD, "log": Record(RECORD.columns, role="recorded-input")}))
    found, left_out = read(path)
    assert found.head == HEAD and left_out == ()
    assert found.records["rc"].metrics == RECORD.metrics and found.records["rc"].role == "controller"
    assert found.records["log"].role == "recorded-input" and list(found.metrics()) == ["rc"]
    assert set(found.records["rc"].columns) == {"time_s", "torque_nm"}
    assert set(found.records["rc"].tables) == {"plants/band_nm", "plants/metrics/steps[1].rise_time_s"}
    assert found.records["rc"].columns["time_s"].tolist() == [0.0, 0.1, 0.2]
    frame = found.to_frame()
    assert list(frame["name"]) == ["log"] * 3 + ["rc"] * 3 and frame["torque_nm"].eq(1.0).all()


def test_a_unit_that_nobody_knows_comes_back_as_none(tmp_path):
    path = tmp_path / "r.h5"
    write_replay(path, Replay(Head("steps", seed=3, input_unit="", rig=RigRecord()), {"rc": RECORD}))
    assert read(path)[0].head.input_unit == ""


def test_json_has_what_is_known_and_null_where_a_step_never_arrives():
    told = as_json(Replay(HEAD, {"rc": RECORD}))
    assert told["controllers"]["rc"]["rms_error_nm"] == 0.5 and "R2" not in told["controllers"]["rc"]
    assert told["controllers"]["rc"]["steps"][0]["settling_s"] is None
    assert told["input_unit"] == "V" and "findings" not in told and "unidentified" not in told


def test_the_same_record_gives_the_same_bytes(tmp_path):
    for name in ("a", "b"):
        write_replay(tmp_path / name, Replay(HEAD, {"rc": RECORD}))
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_an_earlier_replay_is_left_alone(tmp_path):
    path = tmp_path / "r.h5"
    path.write_text("mine")
    with pytest.raises(UsageError, match="exists already"):
        write_replay(path, Replay(HEAD, {}))
    assert path.read_text() == "mine" and len(list(tmp_path.iterdir())) == 1
    with pytest.raises(TypeError):
        broken = Record({"time_s": np.ones(1)}, Metrics(rms_error_nm=object()))
        write_replay(path, Replay(HEAD, {"rc": broken}), force=True)
    assert path.read_text() == "mine" and len(list(tmp_path.iterdir())) == 1


def test_what_is_no_replay_is_refused(tmp_path):
    import h5py

    with pytest.raises(DataError, match="no such file"):
        read(tmp_path / "none.h5")
    (tmp_path / "text.h5").write_text("hello")
    with pytest.raises(DataError, match="is no HDF5 file"):
        read(tmp_path / "text.h5")
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file.attrs["schema"] = "eaid/data/1"
    with pytest.raises(DataError, match="is no eaid/replay/1 file"):
        read(tmp_path / "other.h5")


def short_time(group):
    del group["time_s"]
    group.create_dataset("time_s", data=np.ones(1))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "said"),
    [
        (
            lambda group: group.__delitem__("time_s") or group.create_dataset("time_s", data=np.ones(1)),
            "no column of two",
        ),
        (lambda group: group.create_dataset("more", data=np.full(3, 1e31)), "its more holds what is no number"),
        (lambda group: group.create_dataset("more", data=np.full(3, np.nan)), "its more holds what is no number"),
        (lambda group: group.create_dataset("more", data=np.full(3, b"a")), "its more holds what is no number"),
        (lambda group: group.attrs.__setitem__("metrics", "{no json"), "its metrics is no JSON"),
        (lambda group: group.attrs.__setitem__("metrics", '{"R2": NaN}'), "its metrics is no JSON"),
    ],
)
def test_a_replay_by_another_hand_is_held_to_its_shape(tmp_path, change, said):
    import h5py

    path = tmp_path / "r.h5"
    write_replay(path, Replay(HEAD, {"rc": RECORD}))
    with h5py.File(path, "a") as file:
        del file.attrs["digest"]
        change(file["rc"])
    with pytest.raises(DataError, match=said):
        read(path)


def test_what_is_no_group_of_a_controller_is_passed_over_and_other_lengths_are_tables(tmp_path):
    import h5py

    path = tmp_path / "r.h5"
    write_replay(path, Replay(HEAD, {"rc": RECORD}))
    with h5py.File(path, "a") as file:
        del file.attrs["digest"]
        file.create_dataset("notes", data=np.ones(3))
        file.create_group("empty")
        file["rc"].create_dataset("large", data=np.full(3, 9e29))
        file["rc"].create_dataset("longer", data=np.ones(4))
        del file["rc"].attrs["role"]
    ((name, one),) = read(path)[0].records.items()
    assert name == "rc" and one.role == "controller" and one.columns["large"].max() == 9e29
    assert one.tables["longer"].shape == (4,)


def test_json_has_each_part_under_its_own_name():
    groups = {"rc": RECORD, "a": Record(RECORD.columns, RECORD.metrics, role="recorded-input"),
              "recorded": Record(RECORD.columns, RECORD.metrics, role="recorded-loop")}  # fmt: skip
    told = as_json(Replay(HEAD, groups))
    assert list(told)[:3] == ["schema", "eaid", "digest"] and told["schema"] == "eaid/replay/1"
    assert set(told["controllers"]) == {"rc", "recorded"} and set(told["log"]) == {"a"}
    assert "log" not in as_json(Replay(HEAD, {"rc": RECORD}))
    held = Record(RECORD.columns, Metrics(guarantee_holds_fraction=1.0))
    rc = as_json(Replay(HEAD, {"rc": held}))["controllers"]["rc"]
    assert rc["guarantee_failures_at_limit"] is None and rc["guarantee_failures_by_saturation"] is None


def test_a_damaged_replay_is_refused_or_read_as_it_was(tmp_path):
    """One byte changed anywhere: a sentence with the file's name, or the same numbers."""
    path = tmp_path / "replay.h5"
    t = np.arange(500) / 1000
    record = Record({"time_s": t, "torque_nm": np.sin(t), "duty_pct": np.cos(t)}, Metrics(max_abs_error_nm=0.125))
    write_replay(path, Replay(HEAD, {"rc": record}))
    whole = path.read_bytes()
    refused = 0
    for at in np.random.default_rng(5).integers(0, len(whole), 150).tolist():
        damaged = bytearray(whole)
        damaged[at] ^= 0x55
        path.write_bytes(damaged)
        try:
            found, _ = read(path)
        except DataError as refusal:
            refused += 1
            assert str(path) in str(refusal)  # noqa: PT017
            continue
        assert found.head == HEAD and found.records["rc"].metrics == record.metrics
        for name, values in record.columns.items():
            np.testing.assert_array_equal(found.records["rc"].columns[name], values)
    assert refused > 50
