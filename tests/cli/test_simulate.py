"""`eaid simulate` through its runner: exit code, messages, file, and the same bytes for the same seed."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from eaid.cli import main
from eaid.results.replay import RigRecord

sys.path.insert(0, str(Path(__file__).parent))
from plain_files import FIT, GAINS, read_replay

SD = np.array([0.005, 0.05, 0.01, 0.05, 0.5, 0.1, 0.001, 0.02, 0.05, 0.02])
UNCERTAIN = {**FIT["nonlinear"], "covariance": {"matrix": np.diag(SD**2).tolist()}}


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    Path("fit.json").write_text(json.dumps(FIT))
    Path("gains.json").write_text(json.dumps(GAINS))
    return tmp_path


def call(*arguments: str) -> int:
    return main.run(["simulate", "fit.json", *arguments])


def test_the_multisine_is_the_default_and_replay_h5_the_output(capsys):
    assert call("--gains", "gains.json") == 0
    out, err = capsys.readouterr()
    assert "0.116" in out and "0.797" in out and "Guarantee along this replay" in out
    assert "replay.h5: multisine with pi, rc; next: eaid report " in err
    assert "warning: the reference is as steep as 9.28 per second; the gains were made for Q_M = 5" in err
    records, head = read_replay(Path("replay.h5"))
    assert list(records) == ["pi", "rc"]
    assert set(records["pi"].columns) == {"time_s", "reference_nm", "torque_nm", "duty_pct"}
    assert set(records["rc"].columns) == {"time_s", "reference_nm", "torque_nm", "duty_pct", "chi_nm_s", "rho_nm_s"}
    assert head.scenario == "multisine" and head.inputs.fit.path == "fit.json"
    assert len(records["rc"].columns["time_s"]) == 12_000


def test_json_is_the_contracts(capsys):
    assert call("--gains", "gains.json", "--scenario", "steps", "--duration", "9", "--json", "-q") == 0
    out, err = capsys.readouterr()
    told = json.loads(out)
    assert err == "" and told["scenario"] == "steps"
    rc = told["controllers"]["rc"]
    for key in ("max_abs_error_nm", "rms_error_nm", "mean_abs_duty_step_pct", "saturated_fraction"):
        assert isinstance(rc[key], float)
    assert {"rise_time_s", "overshoot_pct", "settling_s"} <= set(rc["steps"][0])
    assert len(rc["steps"]) == 8 and rc["steps"][-1]["settling_s"] is None


def test_the_sweep_adds_open_loop(capsys):
    assert call("--gains", "gains.json", "--scenario", "sweep", "--rate-hz", "500", "--json") == 0
    told = json.loads(capsys.readouterr().out)["controllers"]
    assert list(told) == ["rc", "pi", "open-loop"]
    assert {"gain_db", "phase_deg", "mean_abs_error_nm"} <= set(told["open-loop"]["frequencies"][0])


def test_without_gains_the_controllers_that_need_none_are_replayed(capsys):
    assert call("--duration", "6") == 0
    out, err = capsys.readouterr()
    assert "note: no --gains, so rc and pi are left out" in err and "inverse" in out


def test_a_reference_of_the_users_own(capsys):
    Path("r.csv").write_text("time_s,reference_nm\n0,0\n1,1\n2,5\n")
    assert call("--gains", "gains.json", "--reference", "r.csv", "--controller", "pi", "--noise-nm", "0.02") == 0
    assert "warning: the reference goes to 5 N·m, the plant at its highest input to 4.37 N·m" in capsys.readouterr().err
    records, head = read_replay(Path("replay.h5"))
    assert head.scenario == "reference" and head.inputs.reference.path == "r.csv"
    assert records["pi"].columns["reference_nm"][1500] == pytest.approx(3.0)
    assert np.std(records["pi"].columns["measured_nm"] - records["pi"].columns["torque_nm"]) == pytest.approx(0.02, 0.1)


def test_drawn_plants_give_the_same_bytes_on_one_thread_and_on_many(capsys):
    Path("fit.json").write_text(json.dumps({**FIT, "nonlinear": UNCERTAIN}))
    for threads in ("1", "3"):
        arguments = (
            "--gains",
            "gains.json",
            "--duration",
            "3",
            "--plants",
            "1000",
            "--seed",
            "4",
            "--threads",
            threads,
        )
        assert call(*arguments, "-o", f"{threads}.h5", "--json") == 0
    err = capsys.readouterr().err
    assert "rc on drawn plants: 1000 to do" in err
    assert Path("1.h5").read_bytes() == Path("3.h5").read_bytes()
    records, head = read_replay(Path("1.h5"))
    assert head.plants == 1000 and head.plants_from == "covariance" and len(head.band_quantiles) == 7
    assert records["rc"].tables["plants/parameters/Ts"].shape == (1000, 4)
    worst = records["rc"].metrics.plants.metrics["rms_error_nm"].worst
    values = records["rc"].tables["plants/metrics/rms_error_nm"]
    assert values.argmax() == worst.plant and values.max() == worst.value and values.std() > 1e-4
    assert list(worst.Ts) == records["rc"].tables["plants/parameters/Ts"][worst.plant].tolist()


def test_plants_of_a_fit_without_uncertainty_are_a_word(capsys):
    assert call("--gains", "gains.json", "--duration", "2", "--plants", "3") == 0
    out, err = capsys.readouterr()
    assert "warning: this fit holds no covariance" in err and "3 plants drawn" in out


def test_quiet_is_quiet(capsys):
    arguments = ("--controller", "open-loop", "--duration", "2", "--rate-hz", "100", "--plants", "3")
    assert call(*arguments, "-q") == 0
    assert capsys.readouterr() == ("", "")
    assert call(*arguments, "--force") == 0
    out, _ = capsys.readouterr()
    assert "Largest error of open loop on plant 0: τ1 [" in out


def test_a_recorded_duty_through_the_plant_and_a_closed_loop_run_laid_over(capsys):
    arguments = ("--gains", "gains.json", "--duration", "4", "--controller", "rc", "-q")
    assert call(*arguments, "--noise-nm", "0.01") == 0
    columns = read_replay(Path("replay.h5"))[0]["rc"].columns
    rows = zip(*(columns[key] for key in ("time_s", "duty_pct", "measured_nm", "reference_nm")), strict=True)
    text = "\n".join(",".join(f"{value:.9g}" for value in row) for row in rows)
    Path("closed.csv").write_text("time_s,duty_pct,torque_nm,reference_nm\n" + text)
    capsys.readouterr()
    assert call("--gains", "gains.json", "--log", "closed.csv", "-o", "log.h5", "--json") == 0
    told = json.loads(capsys.readouterr().out)
    assert told["log"]["closed"]["rms_difference_nm"] == pytest.approx(0.01, rel=0.1)
    assert told["log"]["closed"]["R2"] > 0.99
    assert set(told["controllers"]) == {"recorded", "rc", "pi"}
    recorded, replayed = told["controllers"]["recorded"], told["controllers"]["rc"]
    assert replayed["rms_error_nm"] == pytest.approx(recorded["rms_error_nm"], rel=0.01)
    assert replayed["rms_from_recorded_nm"] == pytest.approx(0.01, rel=0.3)
    records, head = read_replay(Path("log.h5"))
    assert set(records) == {"closed", "recorded", "rc", "pi"} and head.scenario == "log"
    assert head.inputs.log[0].path == "closed.csv"


def test_noise_as_the_residuals(capsys):
    levels = [{"level": 50.0, "Ts": 1.0, "tau1": 0.5, "tau2": 5.0, "sse": 10_000 * 0.02**2, "rmse": 0.02}]
    adequacy = {"residual_autocorrelation": 0.6, "effective_samples": 100.0}
    more = {
        "data": {"sample_rate_hz": 1000.0, "sources": [{"level": 50.0}]},
        "friction": {"levels": levels},
        "uncertainty": {"adequacy": adequacy},
    }
    Path("fit.json").write_text(json.dumps({**FIT, **more}))
    assert call("--gains", "gains.json", "--duration", "3", "--noise", "residuals") == 0
    rig = read_replay(Path("replay.h5"))[1].rig
    assert rig.noise_nm == pytest.approx(0.02) and rig.noise_correlation_s > 0.05


def test_every_effect_of_the_rig_is_an_option(capsys):
    effects = (
        "--noise-nm 0.01 --noise-correlation-s 0.05 --ripple-pct 2 --ripple-hz 3 --sensor-hz 100 --delay-samples 2 "
        "--pwm-hz 300 --duty-bits 8 --perturb Ts=0.9,tau1=1.2 --no-saturation --controller rc,pi,open-loop,inverse"
    )
    assert call("--gains", "gains.json", "--duration", "2", *effects.split()) == 0
    records, head = read_replay(Path("replay.h5"))
    assert head.rig == RigRecord(0.01, 0.05, 1.0, 2.0, 3.0, 100.0, 2, 300.0, 8, False)
    assert head.perturb == {"Ts": 0.9, "tau1": 1.2}
    assert {"measured_nm", "applied_pct"} <= set(records["rc"].columns)


def test_open_loop_needs_no_more_than_the_nonlinear_model(capsys):
    Path("fit.json").write_text(json.dumps({"nonlinear": FIT["nonlinear"]}))
    assert call("--controller", "open-loop", "--json") == 0
    _, err = capsys.readouterr()
    assert "note: no linear model, so open-loop takes the straight line through the plant's steady torque" in err
    duty = np.linspace(10, 100, 101)
    slope, offset = np.polyfit(duty, np.polyval(FIT["nonlinear"]["Ts"][::-1], duty), 1)
    columns = read_replay(Path("replay.h5"))[0]["open-loop"].columns
    wanted = np.clip((columns["reference_nm"] - offset) / slope, 0, 100)
    np.testing.assert_allclose(columns["duty_pct"], wanted, atol=1e-9)


@pytest.mark.parametrize(
    ("arguments", "code", "said"),
    [
        (["--scenario", "jumps"], 2, "--scenario jumps: must be one of steps, multisine, sweep, ramp, rehab"),
        (
            ["--controller", "pid"],
            2,
            "--controller pid: must be one of rc, pi, pi-feedforward, feedforward, open-loop, inverse; did",
        ),
        (["--controller", "rc"], 2, "controller rc needs gains: give --gains"),
        (["--controller", "pi,pi", "--gains", "gains.json"], 2, "--controller pi,pi: name each once"),
        (["--scenario", "steps", "--reference", "r.csv"], 2, "exclude each other"),
        (["--scenario", "sweep", "--duration", "3"], 2, "leave --duration out"),
        (["--reference", "none.csv"], 3, "none.csv: no such file"),
        (["--gains", "none.json"], 3, "none.json: no such file"),
        (["--rate-hz", "0"], 2, "--rate-hz 0: give a number from 0.001"),
        (["--perturb", "Ts"], 2, "write it as Ts=0.9,tau1=1.2"),
        (["--duty-bits", "-1"], 2, "--duty-bits -1: give"),
        (["--noise", "pink"], 2, "--noise pink: must be one of residuals"),
        (["--noise", "residuals"], 3, "the fit does not say how its residuals are coloured"),
        (["--noise", "residuals", "--noise-nm", "1"], 2, "leave out --noise-nm"),
        (["--plants", "0"], 2, "--plants 0: give a whole number from 1"),
        (["--plants", "5", "--threads", "-1"], 2, "--threads -1: give a whole number from 1"),
        (["--plants", "5", "--scenario", "rehab"], 2, "--plants: goes with steps, multisine, sweep"),
        (["--limb-damping", "1"], 2, "belong to --scenario rehab"),
        (["--log", "none.csv"], 3, "none.csv"),
        (["--seed", "-1"], 2, "--seed -1: give a whole number from 0"),
        (["--seed", "1" * 26], 2, "--seed 1111"),
        (["--pwm-hz", "nan"], 2, "--pwm-hz nan: give a number from 0"),
        (["--duration", "nan"], 2, "--duration nan"),
        (["--duration", "inf"], 2, "--duration inf"),
        (["--duration", "1e12"], 2, "--duration 1e+12"),
        (["--duration", "1e6"], 2, "give a shorter --duration or a lower --rate-hz"),
        (["--rate-hz", "inf"], 2, "--rate-hz inf"),
        (["--rate-hz", "1e9"], 2, "--rate-hz 1e+09"),
        (["--noise-nm", "1e308"], 2, "--noise-nm 1e+308"),
        (["--plants", "1000000000"], 2, "--plants 1000000000: give a whole number from 1 to 100000"),
        (["--plants", "100000", "--duration", "100"], 2, "ask for 10,000 at most"),
        (["--threads", "2"], 2, "--threads: does nothing without --plants"),
        (["--noise-correlation-s", "2"], 2, "--noise-correlation-s: does nothing without --noise-nm"),
        (["--ripple-hz", "2"], 2, "--ripple-hz: does nothing without --ripple-pct"),
        (["--columns", "time=t"], 2, "belong to --log"),
        (["--keep-baseline"], 2, "--keep-baseline: belongs to --log"),
        (["--perturb", "Ts=1,Ts=2"], 2, "says Ts twice"),
        (["--limb-inertia", "0", "--scenario", "rehab"], 2, "--limb-inertia 0: give"),
        (["--scenario", "rehab", "--duration", "1e6"], 2, "give a shorter --duration or a lower --rate-hz"),
    ],
)
def test_what_is_refused(capsys, arguments, code, said):
    assert call(*arguments) == code
    err = capsys.readouterr().err
    assert said in err and "Traceback" not in err
    assert not Path("replay.h5").exists()


def test_an_earlier_replay_is_left_alone(capsys):
    Path("replay.h5").write_text("mine")
    assert call("--gains", "gains.json") == 2
    assert "--force" in capsys.readouterr().err and Path("replay.h5").read_text() == "mine"


def test_a_fit_without_a_plant_is_refused(capsys):
    Path("fit.json").write_text(json.dumps({"schema": "eaid/fit/1", "friction": {}}))
    assert call("--gains", "gains.json") == 3
    assert "the fit holds no nonlinear model" in capsys.readouterr().err


def volts(k=3.0, y=0.5):
    """The same plant with its input in V and its output in N."""
    n = FIT["nonlinear"]
    scaled = {name: [c / k**power for power, c in enumerate(n[name])] for name in ("tau1", "tau2", "Ts")}
    plant = {**n, **scaled, "Ts": [c * y for c in scaled["Ts"]], "u_range": [10 * k, 100 * k]}
    linear = {"a0": 1.36, "b0": 0.08 * y / k, "c0": -2.42 * y}
    data = {"input_unit": "V", "output_unit": "N", "levels": [10 * k, 100 * k], "sample_rate_hz": 1000.0}
    return {"schema": "eaid/fit/1", "nonlinear": plant, "linear": linear, "data": data}


def test_in_volts_every_controller_uses_the_whole_range(capsys):
    """Nothing but the units differs: duties are three times those in %, errors half as large."""
    linear = {"a0": 1.36, "b0": 0.08, "c0": -2.42}
    Path("fit.json").write_text(json.dumps({**FIT, "linear": linear}))
    options = ("--controller", "open-loop,inverse", "--json", "-q", "--force")
    Path("high.csv").write_text("time_s,reference_nm\n0,0\n2,4.2\n3,4.2\n4,2\n")
    Path("half.csv").write_text("time_s,reference_nm\n0,0\n2,2.1\n3,2.1\n4,1\n")
    assert call(*options, "--reference", "high.csv") == 0
    percent = json.loads(capsys.readouterr().out)
    in_percent = {name: dict(one.columns) for name, one in read_replay(Path("replay.h5"))[0].items()}
    Path("fit.json").write_text(json.dumps(volts()))
    assert call(*options, "--reference", "half.csv") == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["input_unit"], told["output_unit"]) == ("V", "N")
    groups, _ = read_replay(Path("replay.h5"))
    for name in ("open-loop", "inverse"):
        assert groups[name].columns["duty_pct"].max() > 250
        np.testing.assert_allclose(groups[name].columns["duty_pct"], 3 * in_percent[name]["duty_pct"], atol=1e-5)
        now, then = told["controllers"][name], percent["controllers"][name]
        assert now["rms_error_nm"] == pytest.approx(then["rms_error_nm"] / 2, rel=1e-9)
        assert now["saturated_fraction"] == pytest.approx(then["saturated_fraction"], abs=1e-3)


def test_in_volts_scenarios_are_as_large_as_the_range_and_bits_divide_it(capsys):
    Path("fit.json").write_text(json.dumps(volts()))
    assert call("--controller", "inverse", "--duty-bits", "6", "--scenario", "steps", "--duration", "9", "-q") == 0
    (one,) = read_replay(Path("replay.h5"))[0].values()
    assert one.columns["reference_nm"].max() == pytest.approx(2.0, rel=1e-3)  # 4 N·m of 4.372, for 2.186 N
    counts = one.columns["duty_pct"] * 63 / 300
    assert np.abs(counts - np.round(counts)).max() < 1e-9 and counts.max() == 63
    capsys.readouterr()
    assert call("--controller", "inverse", "--duration", "2", "--force") == 0
    assert "(N)" in capsys.readouterr().out


def test_gains_of_another_rig_and_logs_in_other_units_are_refused(capsys):
    Path("fit.json").write_text(json.dumps(volts()))
    assert call("--gains", "gains.json") == 3
    assert "the gains are for an input in % and an output in N·m, the fit has V and N" in capsys.readouterr().err
    rows = "\n".join(f"{0.01 * k},{80.0 * (k > 20)},{0.4 * (k > 20)}" for k in range(200))
    Path("a.csv").write_text("time_s,duty_pct,torque_nm\n" + rows)
    assert call("--log", "a.csv") == 3
    assert "holds no input in V, which the fit has" in capsys.readouterr().err
    Path("b.csv").write_text("time_s,input (V),output (N)\n" + rows)
    assert call("--log", "b.csv", "--json", "-q") == 0
    assert json.loads(capsys.readouterr().out)["log"]["b"]["R2"] is not None


def test_a_plant_whose_time_constant_crosses_zero_is_refused(capsys):
    broken = {**FIT["nonlinear"], "tau1": [0.5, -0.01, 0.0]}
    Path("fit.json").write_text(json.dumps({**FIT, "nonlinear": broken}))
    assert call("--controller", "inverse") == 3
    assert "nonlinear.tau1 is" in capsys.readouterr().err


def test_what_no_log_showed_is_told(capsys):
    assert call("--controller", "inverse", "--duration", "6", "--json") == 0
    told = json.loads(capsys.readouterr().out)
    (found,) = (one for one in told["findings"] if one["code"] == "replay-leaves-identified")
    assert found["values"]["falling_pct"] > 10 and found["values"]["low"] == 10
    recorded = [{"level": 50.0, "from": 80.0, "Ts": -1.0, "tau1": 0.3, "tau2": 5.0}]
    Path("fit.json").write_text(json.dumps({**FIT, "friction": {"levels": recorded}}))
    assert call("--controller", "inverse", "--duration", "6", "--json", "--force") == 0
    again = json.loads(capsys.readouterr().out).get("findings", [])
    assert all(one["values"].get("falling_pct") is None for one in again)


@pytest.mark.parametrize(("tau1", "as_release"), [(0.21, True), (0.61, False)])
def test_recorded_falls_between_levels_say_which_constants_they_have(tau1, as_release):
    from eaid.control.gains import plant_of
    from eaid.export.job import source_of
    from eaid.results.codec import from_plain
    from eaid.results.fit import Fit
    from eaid.uncertainty.draw import draw

    falls = [{"level": 50.0, "from": 80.0, "Ts": -1.0, "tau1": tau1, "tau2": 5.0 if as_release else 14.0}]
    fit = {**FIT, "friction": {"levels": falls}, "release": {"tau1": 0.2, "tau2": 4.8}}
    read = from_plain(fit, Fit, "f")
    assert plant_of(read).falls_as_release is as_release
    # one plant, whoever asks for it: planning and drawing take the fit's, export its source's
    assert plant_of(read) == read.plant == source_of(None, read).plant == draw(read, 2, 0).plants[1]
