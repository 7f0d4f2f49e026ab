"""What the page tells of replays and walls: errors, the guarantee, drawn plants, steps, tones, modes; made again."""

import json
import shlex
from pathlib import Path

import h5py
import numpy as np
import pytest

import eaid

RC = {
    "rms_error_nm": 0.3,
    "steps": [{"from_nm": 0.0, "to_nm": 1.0, "rise_time_s": 0.1, "overshoot_pct": 2.0, "settling_s": 0.3}],
    "plants": {"count": 9, "metrics": {
        "max_abs_error_nm": {"worst": {"value": 0.5, "plant": 7, "tau1": [0.1], "tau2": [4.0], "Ts": [2.0]},
                             "p2.5": 0.1, "median": 0.2, "p97.5": 0.4}}},
}  # fmt: skip


def test_numbers_of_a_replay_by_hand(tmp_path, report, replay_file):
    page = report(replay_file(tmp_path / "r.h5", {"rc": RC, "other": {}}, plants=9), "--figures", "own_reference")
    assert page.tables["Errors of each controller"][0][5] == "mean input step (%)"
    rc, other = page.rows("Errors of each controller")
    # What the file does not say is that of the trace: errors 1, 0.5, 0.25.
    assert rc[:2] == ["steps", "RC"] and rc[2:5] == ["1.00", "0.300", f"{1.75 / 3:.3f}"] and other[1] == "other"
    assert page.rows("Each step") == [["RC", "0 → 1", "0.100", "2.00", "0.300"]]
    drawn = page.rows("Over drawn plants: steps")
    assert drawn == [["RC: largest |error| (N·m)", "0.100", "0.200", "0.400", "0.500", "7"]]
    assert "9 plants drawn" in page.text and "Each frequency" not in page.tables


def test_tables_say_what_the_replays_hold(whole, files):
    def metrics(name):
        with h5py.File(files[f"{name}.h5"]) as file:
            return json.loads(file["rc"].attrs["metrics"])

    gains_db = [one["gain_db"] for one in metrics("sweep")["frequencies"]]
    shown = [float(row[2].replace("−", "-")) for row in whole.rows("Each frequency") if row[0] == "RC"]
    assert shown == pytest.approx(gains_db, rel=0.01, abs=1e-3)
    modes = metrics("rehab")["modes"]
    by_mode = {row[1]: row for row in whole.rows("Errors by mode") if row[0] == "RC"}
    for name, one in modes.items():
        assert float(by_mode[name][2]) == pytest.approx(one["abs_position_error_deg"]["median"], rel=0.01)
    x, y = whole.lines("fig12_multisine")["RC"]
    trace = eaid.load(files["multisine.h5"]).records["rc"].columns
    assert np.interp(x, trace["time_s"], trace["duty_pct"]) == pytest.approx(y, abs=1e-2)  # the last panel's


@pytest.mark.slow
def test_drawn_plants_a_log_and_a_reference_have_their_figures(files, tmp_path, report, run_eaid):
    (tmp_path / "mine.csv").write_text("time_s,reference_nm\n0,0\n1,1\n3,1\n")
    runs = {"plants": ("--scenario", "multisine", "--duration", 6, "--plants", 3), "log": ("--log", files["clutch.h5"]),
            "own": ("--reference", tmp_path / "mine.csv")}  # fmt: skip
    for name, more in runs.items():
        words = ["simulate", files["clutch.json"], "--gains", files["gains.json"], *more, "-o", tmp_path / f"{name}.h5"]
        assert run_eaid(*words, "-q").code == 0
    page = report(files["clutch.json"], *(tmp_path / f"{name}.h5" for name in runs))
    assert {"fig12_multisine", "log_replay", "own_reference"} <= set(page.captions)
    with h5py.File(tmp_path / "plants.h5") as file:
        known = json.loads(file["rc"].attrs["metrics"])["plants"]["metrics"]["max_abs_error_nm"]
    row = page.rows("Over drawn plants: multisine")[0]
    assert row[0] == "RC: largest |error| (N·m)" and float(row[2]) == pytest.approx(known["median"], rel=0.01)
    replay = eaid.load(tmp_path / "log.h5")
    rms = sorted(np.sqrt(np.mean((one.columns["reference_nm"] - one.columns["torque_nm"]) ** 2))
                 for one in replay.records.values())  # fmt: skip
    rows = page.rows("Recorded input through the model")
    assert sorted(float(row[1]) for row in rows) == pytest.approx(rms, rel=0.01)
    assert f"--reference {tmp_path / 'mine.csv'}" in page.text


TUNED = ["--b-hat", "minimax", "--kp", "5", "--phi", "0.02", "--pi-overshoot", "1", "--pi-settling", "0.3",
         "--duty-limits", "5,95", "--reference", "multisine", "--pwm-hz", "0"]  # fmt: skip
REPLAYED = ["--controller", "pi,inverse", "--scenario", "steps", "--duration", "9", "--rate-hz", "500",
            "--noise-nm", "0.01", "--delay-samples", "1", "--seed", "5"]  # fmt: skip


@pytest.mark.slow
def test_gains_and_replay_are_made_again_by_what_the_page_says(files, tmp_path, monkeypatch, report, run_eaid):
    monkeypatch.chdir(tmp_path)
    fit = files["clutch.json"]
    assert run_eaid("tune-rc", fit, "-o", "g.json", "-q", *TUNED).code == 0
    assert run_eaid("simulate", fit, "--gains", "g.json", "-o", "r.h5", "-q", *REPLAYED).code == 0
    page = report(fit, "g.json", "r.h5", "--figures", "own_reference")
    lines = "".join(page.of("pre")[0].itertext()).splitlines()
    tune, replay = (next(line for line in lines if line.startswith(f"eaid {name}")) for name in ("tune-rc", "simulate"))
    for line, name in ((tune, "g.json"), (replay, "r.h5")):
        before = Path(name).read_bytes()
        assert run_eaid(*shlex.split(line)[1:], "--force", "-q").code == 0 and Path(name).read_bytes() == before
    assert "--duration 9" in replay and "--rate-hz 500" in replay
