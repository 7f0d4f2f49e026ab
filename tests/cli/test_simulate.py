"""`eaid simulate`: scenarios, options that reach the replay, drawn plants, recorded logs, rigs in other units."""

import json
from pathlib import Path

import h5py
import numpy as np
import pytest


@pytest.fixture(autouse=True)
def _here(by_hand):
    """Every test begins beside the paper's plant and gains, in files written by hand."""


def columns(name, file="replay.h5"):
    with h5py.File(file) as opened:
        return {key: value[...] for key, value in opened[name].items() if isinstance(value, h5py.Dataset)}


def test_the_multisine_is_the_default_and_replay_h5_the_output(run_eaid):
    ran = run_eaid("simulate fit.json --gains gains.json")
    assert ran.code == 0 and "0.116" in ran.out and "0.797" in ran.out
    assert "replay.h5: multisine with pi, rc; next: eaid report fit.json gains.json replay.h5" in ran.err
    assert "warning: the reference is as steep as 9.28 per second; the gains were made for Q_M = 5" in ran.err
    with h5py.File("replay.h5") as file:
        assert list(file) == ["pi", "rc"] and file.attrs["scenario"] == "multisine"
    pi, rc = columns("pi"), columns("rc")
    assert set(pi) == {"time_s", "reference_nm", "torque_nm", "duty_pct"} == set(rc)
    assert len(rc["time_s"]) == 12_000 and np.allclose(np.diff(rc["time_s"]), 1e-3) and rc["torque_nm"][0] == 0
    counted = rc["time_s"] >= 5
    assert np.abs(rc["torque_nm"] - rc["reference_nm"])[counted].max() == pytest.approx(0.116, abs=1e-3)


def test_every_effect_of_the_rig_is_an_option(run_eaid):
    effects = "--noise-nm 0.01 --delay-samples 2 --pwm-hz 300 --controller rc,pi,open-loop,inverse"
    ran = run_eaid(f"simulate fit.json --gains gains.json --duration 2 --json {effects}")
    assert ran.code == 0
    assert json.loads(ran.out)["rig"] == {"noise_nm": 0.01, "delay_samples": 2, "pwm_hz": 300.0}
    assert {"measured_nm", "applied_pct"} <= set(columns("rc"))


def test_a_recorded_duty_through_the_plant(run_eaid):
    words = "simulate fit.json --gains gains.json --duration 4 --controller rc -q --noise-nm 0.01"
    assert run_eaid(words).code == 0
    found = columns("rc")
    rows = np.c_[[found[key] for key in ("time_s", "duty_pct", "measured_nm", "reference_nm")]].T
    np.savetxt("closed.csv", rows, "%.9g", ",", header="time_s,duty_pct,torque_nm,reference_nm", comments="")
    ran = run_eaid("simulate fit.json --gains gains.json --log closed.csv -o log.h5 --json")
    told = json.loads(ran.out)
    assert ran.code == 0 and told["scenario"] == "log" and told["controllers"] == {}
    assert told["log"]["closed"]["rms_difference_nm"] == pytest.approx(0.01, rel=0.1)
    assert told["log"]["closed"]["R2"] > 0.99
    with h5py.File("log.h5") as file:
        assert set(file) == {"closed"}


def test_the_rate_that_a_fit_was_told_is_that_of_a_log_without_a_clock(run_eaid):
    assert run_eaid("synth --levels 20,60,100 --repeats 1 --rate-hz 20 --hold 20 -o made -q").code == 0
    Path("logs").mkdir()
    for log in Path("made").iterdir():
        rows = log.read_text(encoding="utf-8").splitlines()[1:]
        Path("logs", log.name).write_text("\n".join(row.partition(",")[2] for row in rows) + "\n")
    assert run_eaid("fit logs --rate-hz 20 --ci none -o own.json -q").code == 0
    one = min(Path("logs").iterdir())
    ran = run_eaid(["simulate", "own.json", "--log", one, "-o", "log.h5", "--json"])
    ((log,),) = (json.loads(ran.out)["log"].values(),)
    assert ran.code == 0 and log["fit_pct"] > 80
    assert run_eaid(["simulate", "fit.json", "--log", one, "-o", "log.h5", "--force"]).code == 3


def test_gains_of_another_rig_and_logs_in_other_units_are_refused(by_hand, run_eaid, volts):
    by_hand({"data": volts}, k=3, y=0.5)
    ran = run_eaid("simulate fit.json --gains gains.json")
    assert ran.code == 3
    assert "the gains are for an input in % and an output in N·m, the fit has V and N" in ran.err
    rows = "\n".join(f"{0.01 * k},{80.0 * (k > 20)},{0.4 * (k > 20)}" for k in range(200))
    Path("a.csv").write_text("time_s,duty_pct,torque_nm\n" + rows)
    Path("b.csv").write_text("time_s,input (V),output (N)\n" + rows)
    ran = run_eaid("simulate fit.json --log a.csv")
    assert ran.code == 3 and "holds no input in V, which the fit has" in ran.err
    Path("c.csv").write_text("time_s,force_n\n" + "\n".join(f"{0.01 * k},{0.4 * (k > 20)}" for k in range(200)))
    ran = run_eaid("simulate fit.json --log c.csv")
    assert ran.code == 3 and "c has no input in every row, and the input drives the model" in ran.err
    ran = run_eaid("simulate fit.json --log b.csv --json -q")
    assert ran.code == 0 and json.loads(ran.out)["log"]["b"]["R2"] is not None


def test_a_session_of_rehabilitation(run_eaid):
    """Its file, its JSON, and one that diverges, which leaves nothing."""
    gains = json.loads(Path("gains.json").read_text())
    del gains["pi"]
    Path("gains.json").write_text(json.dumps(gains))
    words = "simulate fit.json --gains gains.json --scenario rehab"
    ran = run_eaid(words, "--limb-damping", "0.5", "--seed", "1")
    assert ran.code == 5 and not Path("replay.h5").exists()
    assert ran.err.startswith("error: rehab with rc: the ") and "diverges" in ran.err and ran.err.count("\n") == 1
    told = json.loads(run_eaid(words, "--json", "-q").out)
    exercise = told["exercise"]
    assert told["scenario"] == "rehab" and exercise["uncounted_s"] == 5.0 and exercise["damping_nms"] == 0.8
    rc = told["controllers"]["rc"]
    assert 2 < rc["modes"]["soft"]["abs_position_error_deg"]["median"] < 4
    assert rc["max_abs_error_nm"] >= rc["rms_error_nm"] > 0 and len(rc["tests"]) == 3
    found = columns("rc")
    assert {"angle_deg", "target_deg", "desired_nm", "rendered_nm", "mode", "position_error_deg"} <= set(found)
    np.testing.assert_array_equal(np.abs(found["rendered_nm"]), found["torque_nm"])
    assert len(found["time_s"]) == 90_000 and sorted(set(found["mode"])) == [0, 1, 2]
