"""`eaid tune-rc` as users call it: files, tables, JSON, warnings, exit codes."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

from eaid.cli.main import run
from eaid.control.gains import pi_gains, rc_gains
from eaid.models.parameters import REFERENCE_PLANT
from eaid.results.codec import from_plain
from eaid.results.fit import Fit
from eaid.results.gains import Gains
from eaid.results.tuning import TuneOptions

PAPER = {"a0": 1.36, "b0": 0.08, "c0": -2.42, "bounds": {"convention": "zero-offset", "B_m": 12.4, "B_M": 42.6}}
PLANT = {
    "C": 0.85, "tau1": list(REFERENCE_PLANT.tau1), "tau2": list(REFERENCE_PLANT.tau2), "Ts": list(REFERENCE_PLANT.Ts),
    "u_range": [10.0, 100.0],
}  # fmt: skip


@pytest.fixture(autouse=True)
def _here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def fit_file(name="fit.json", **parts):
    path = Path(name)
    path.write_text(json.dumps({"schema": "eaid/fit/1", "linear": PAPER, **parts}))
    return str(path)


def made(*arguments, **parts):
    """The gains.json that these arguments make."""
    assert run(["tune-rc", fit_file(**parts), "-q", "--force", *arguments]) == 0
    return json.loads(Path("gains.json").read_text())


def typed(gains) -> Gains:
    return from_plain(gains, Gains, "gains.json")


def codes(gains):
    return [one["code"] for one in gains["findings"]]


def test_gains_file_of_a_minimal_fit(capsys):
    assert run(["tune-rc", fit_file(), "-o", "g.json"]) == 0
    out, err = capsys.readouterr()
    gains = json.loads(Path("g.json").read_text())
    assert gains["schema"] == "eaid/gains/1" and gains["inputs"]["fit"]["path"] == "fit.json"
    assert len(gains["inputs"]["fit"]["sha256"]) == 64
    assert f"{gains['rc']['alpha']:.6f}" == "0.549091" and f"{gains['rc']['rho']['constant']:.4f}" == "10.8125"
    contract = "K_P K_D B_hat B_m B_M alpha alpha_reached guaranteed phi_holds Q_M phi rho epsilon gamma P Q"
    assert set(contract.split()) <= set(gains["rc"])
    assert {"K_P", "K_I", "overshoot_pct", "settling_s"} <= set(gains["pi"])
    assert rc_gains(typed(gains)).B_hat == 12.5 and pi_gains(typed(gains)) == (21.0, 360.0, 0.0, 100.0, 0.0)
    assert out.splitlines()[0] == "guarantee: NO (ρ, duty limit)"
    assert re.search(r"^ρ, constant +10\.81 ", out, re.M) and re.search(r"^ρ, slope +6\.586 ", out, re.M)
    assert "Margins" not in out and "published" not in out and len(out.splitlines()) <= 36
    assert re.search(r"^phase margin +[0-9.]+ +° ", out, re.M)
    assert err.splitlines()[-1] == "g.json: gains of rc and pi; next: eaid simulate fit.json --gains g.json"
    assert set(codes(gains)) == {
        "rho-not-covered", "robust-term-beyond-actuator", "paper-pi-misses", "nothing-to-replay-on", "margin-missed",
    }  # fmt: skip
    assert gains["guarantee"]["holds"] is False
    assert {one["name"]: one["holds"] for one in gains["guarantee"]["conditions"]} == {
        "rho": False, "phi": None, "Q_M": None, "duty-limit": False,
    }  # fmt: skip


def test_verbose_shows_what_they_were_made_of(capsys):
    assert run(["tune-rc", fit_file(nonlinear=PLANT), "-v"]) == 0
    out, err = capsys.readouterr()
    assert "sampled at 1000 Hz, the input latched at 300 Hz" in out and re.search(r"^textbook ", out, re.M)
    assert "and 3 more" not in err


def test_json_is_the_file(capsys):
    assert run(["tune-rc", fit_file(), "--json", "-q"]) == 0
    out, err = capsys.readouterr()
    assert out == Path("gains.json").read_text() and err == ""


def test_the_same_call_gives_the_same_bytes():
    made("--pi-overshoot", "1", "--pi-settling", "0.27", nonlinear=PLANT)
    first = Path("gains.json").read_bytes()
    made("--pi-overshoot", "1", "--pi-settling", "0.27", nonlinear=PLANT)
    assert Path("gains.json").read_bytes() == first


def test_an_earlier_result_is_left_alone(capsys):
    Path("gains.json").write_text("mine")
    assert run(["tune-rc", fit_file()]) == 2
    assert Path("gains.json").read_text() == "mine"
    assert "give --force" in capsys.readouterr().err


def test_every_option_reaches_the_gains():
    rc = made("--kp", "9", "--kd", "4", "--epsilon", "0.3", "--gamma", "60", "--p-scale", "3", "--q-max", "7",
              "--phi", "0.02", "--b-hat", "minimax")["rc"]  # fmt: skip
    assert (rc["K_P"], rc["K_D"], rc["epsilon"], rc["gamma"], rc["Q_M"], rc["phi"]) == (9, 4, 0.3, 60, 7, 0.02)
    assert rc["P"] == [[3.0, 0.0], [0.0, 3.0]] and rc["B_hat"] == pytest.approx(19.209, abs=1e-3) and rc["guaranteed"]
    assert made("--b-hat", "15")["rc"]["B_hat"] == 15.0
    assert made("--rho", "textbook")["rc"]["rho"]["constant"] == pytest.approx(6.0977, abs=1e-4)
    assert made("--alpha", "reached")["rc"]["guaranteed"] is True
    damped = made("--natural-frequency", "2.1213203", "--damping", "0.70710678")["rc"]
    assert (damped["K_P"], damped["K_D"]) == pytest.approx((4.5, 3.0), rel=1e-6)
    pi = made("--pi-overshoot", "1", "--pi-settling", "0.27")["pi"]
    assert (pi["K_P"], pi["K_I"]) == pytest.approx((156.6, 252.9), abs=0.1)
    assert made("--pi-gains", "30,100")["pi"]["K_I"] == 100.0
    back = made("--anti-windup", "back-calculation", "--duty-limits", "5,90")
    assert back["duty_limits_pct"] == [5.0, 90.0] and rc_gains(typed(back)).back_calculation > 0
    assert made("--pwm-hz", "0", "--rate-hz", "500")["margins"]["timing"] == {
        "rate_hz": 500.0,
        "pwm_hz": None,
        "delay_samples": 0,
    }


def test_replayed_error_beside_the_bound():
    gains = made(nonlinear=PLANT)
    assert gains["replayed"]["reference"] == "multisine"
    assert gains["rc"]["ultimate_bound"]["replayed_nm"] == pytest.approx(0.1157, abs=1e-3)
    assert gains["replayed"]["pi"]["max_abs_error_nm"] == pytest.approx(0.80, abs=0.01)
    assert "slope-above-q-max" in codes(gains)
    needs = {one["name"]: one for one in gains["guarantee"]["conditions"]}
    assert needs["Q_M"]["needed"] == pytest.approx(9.28, abs=0.01) and needs["Q_M"]["available"] == 5.0
    assert gains["rc"]["phi_holds"] is False


def test_Q_M_from_a_reference_file():
    Path("ramp.csv").write_text("time_s,reference_nm\n0,1\n1,3.5\n2,3.5\n")
    gains = made("--reference", "ramp.csv", nonlinear=PLANT)
    assert gains["rc"]["Q_M"] == pytest.approx(2.5) and gains["rc"]["Q_M_holds"] is True
    assert gains["inputs"]["reference"]["path"] == "ramp.csv"
    judged = made("--reference", "ramp.csv", "--q-max", "2", nonlinear=PLANT)
    assert judged["rc"]["Q_M"] == 2.0 and judged["rc"]["Q_M_holds"] is False
    assert made("--reference", "multisine", nonlinear=PLANT)["rc"]["Q_M"] == pytest.approx(9.28, abs=0.01)


def test_phi_from_data(capsys):
    from eaid.synth.datasets import shipped

    clutch = shipped()["clutch"]
    gains = made("--phi", "data", "--data", str(clutch), nonlinear=PLANT)
    rc = gains["rc"]
    assert rc["phi_holds"] is True and {"model", "logs"} <= set(gains["phi_from_data"])
    needed = max(gains["phi_from_data"][name]["pct"] for name in ("model", "logs"))
    assert rc["phi_honest_pct"] == pytest.approx(needed) and rc["phi_needed_pct"] == pytest.approx(needed)
    capsys.readouterr()
    fit = fit_file(nonlinear=PLANT)
    assert run(["tune-rc", fit, "--phi", "data", "--force"]) == 0
    assert "names no logs, so φ cannot be read off them" in capsys.readouterr().err
    assert run(["tune-rc", fit_file(), "--phi", "data", "--force"]) == 3


@pytest.mark.parametrize(
    ("linear", "arguments", "words"),
    [
        ({"b0": -0.08}, [], "the fit's b0 is -0.08"),
        ({"a0": 0.0}, [], "the fit's a0 is 0 "),
        ({"bounds": {"B_m": 0.0, "B_M": 42.6}}, [], "the range of B touches 0"),
        ({}, ["--pi-overshoot", "120", "--pi-settling", "1"], "out of reach"),
        ({}, ["--pi-overshoot", "1", "--pi-settling", "60"], "out of reach"),
        ({}, ["--pi-overshoot", "1", "--pi-settling", "0.001"], "unstable on the linear model"),
        ({}, ["--kd", "0"], "unstable"),
        ({}, ["--b-hat", "-4"], "B̂ is -4"),
        ({}, ["--p-scale", "5000"], "the RC loop is unstable"),
    ],
)
def test_refused_gains_exit_with_5(linear, arguments, words, capsys):
    assert run(["tune-rc", fit_file(linear={**PAPER, **linear}), *arguments]) == 5
    err = capsys.readouterr().err
    assert words in err and err.startswith("error: ") and len(err.splitlines()) == 1
    assert not Path("gains.json").exists()


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["--pi-overshoot", "1"], 2, "belong together"),
        (["--pi-gains", "21"], 2, "write two numbers"),
        (["--pi-gains", "21,x"], 2, "--pi-gains x: is no number"),
        (["--b-hat", "best"], 2, "must be pooled, minimax or a number"),
        (["--rho", "both"], 2, "--rho both: must be one of"),
        (["--alpha", "x"], 2, "--alpha x: must be one of"),
        (["--anti-windup", "none"], 2, "--anti-windup none: must be one of"),
        (["--phi", "much"], 2, "--phi much: must be data or a number"),
        (["--kp", "4", "--damping", "1"], 2, "not both"),
        (["--damping", "0.7"], 2, "belong together"),
        (["--bounds-levels", "30:100"], 2, "no fits of single levels"),
        (["--epsilon", "0"], 2, "--epsilon 0: give a number from 1e-15"),
        (["--reference", "none.csv"], 3, "none.csv: no such file"),
        (["--optimize"], 3, "holds no nonlinear model"),
        (["--optimize-also", "colour"], 2, "--optimize-also colour: must be one of"),
        (["--optimize", "--noise-nm", "-1"], 2, "--noise-nm -1"),
        (["--optimize", "--evaluations", "0"], 2, "--evaluations 0"),
        (["--rate-hz", "0"], 2, "--rate-hz 0"),
        (["--duty-limits", "0,120"], 2, "--duty-limits 0,120: a duty ends at 100 %"),
        (["--duty-limits", "50,20"], 2, "--duty-limits 50,20: must rise"),
        (["--seed", "-1"], 2, "--seed -1: give a whole number from 0"),
        (["--seed", "9" * 26], 2, "--seed 9999"),
        (["--b-hat", "1e400"], 2, "--b-hat inf: give"),
        (["--kp", "inf"], 2, "--kp inf"),
        (["--kd", "nan"], 2, "--kd nan"),
        (["--phi", "1e308"], 2, "--phi 1e+308"),
        (["--q-max", "1e308"], 2, "--q-max 1e+308"),
        (["--pi-gains", "1e300,1"], 2, "--pi-gains 1e+300"),
        (["--natural-frequency", "1e200", "--damping", "1"], 2, "--natural-frequency 1e+200"),
        (["--pwm-hz", "nan"], 2, "--pwm-hz nan"),
        (["--rate-hz", "1e9"], 2, "--rate-hz 1e+09"),
        (["--plants", "20"], 2, "--plants: does nothing without --optimize"),
        (["--noise-nm", "0.1"], 2, "--noise-nm: does nothing without --optimize"),
        (["--optimize", "--plants", "1000000000"], 2, "--plants 1000000000"),
        (["--data", "x.csv"], 2, "--data: does nothing without --phi data or --optimize"),
    ],
)
def test_wrong_usage_gets_its_sentence(arguments, code, words, capsys):
    assert run(["tune-rc", fit_file(), *arguments]) == code
    err = capsys.readouterr().err
    assert words in err and "Traceback" not in err
    assert not Path("gains.json").exists()


def test_a_broken_fit_is_a_data_error(capsys):
    assert run(["tune-rc", "none.json"]) == 3
    Path("fit.json").write_text('{"schema": "eaid/fit/1", "friction": {}}')
    assert run(["tune-rc", "fit.json"]) == 3
    assert "holds no linear model" in capsys.readouterr().err


def test_an_unidentified_fit_needs_a_word(capsys):
    linear = {**PAPER, "identifiable": False}
    why = [{"code": "one level only", "severity": "stop", "subject": "linear"}]  # no row: said by its code
    assert run(["tune-rc", fit_file(linear=linear, findings=why)]) == 3
    assert (
        "the linear model is not identifiable (one level only); --allow-unidentified uses it, marked"
        in capsys.readouterr().err
    )
    gains = made("--allow-unidentified", linear=linear, findings=why)
    assert gains["unidentified"] == "one level only" and "fit-not-identifiable" in codes(gains)


VOLTS = {"input_unit": "V", "output_unit": "N", "levels": [100.0, 300.0]}


def volts(k=3.0, y=0.5, pace=1.0):
    """The paper's fit and the reference plant in V and N: inputs k times, outputs y times, pace times as fast."""
    linear = {
        "a0": 1.36 * pace, "b0": 0.08 * pace * y / k, "c0": -2.42 * pace * y,
        "bounds": {"convention": "zero-offset", "B_m": 12.4 * k / y / pace, "B_M": 42.6 * k / y / pace},
    }  # fmt: skip
    scaled = {name: [c / k**power for power, c in enumerate(PLANT[name])] for name in ("tau1", "tau2", "Ts")}
    plant = {
        **PLANT, "tau1": [c / pace for c in scaled["tau1"]], "tau2": [c / pace for c in scaled["tau2"]],
        "Ts": [c * y for c in scaled["Ts"]], "u_range": [10.0 * k, 100.0 * k],
    }  # fmt: skip
    data = {"input_unit": "V", "output_unit": "N", "levels": [10.0 * k, 100.0 * k], "sample_rate_hz": 1000.0}
    return {"linear": linear, "nonlinear": plant, "data": data}


def test_a_rig_in_other_units_gets_the_same_design_in_its_own(capsys):
    """Nothing but the units differs: the gains are the paper's in them, the errors are the same share."""
    common = ["--phi", "data", "--reference", "multisine", "--pi-overshoot", "1"]
    paper = made(*common, "--pi-settling", "0.27", "--pwm-hz", "0", nonlinear=PLANT)
    k, y, pace = 3.0, 0.5, 1.0
    rig = made("--reference", "multisine", **volts(k, y, pace))
    assert rig["input_unit"] == "V" and rig["output_unit"] == "N" and rig["duty_limits_pct"] == [0.0, 300.0]
    assert (rig["rc"]["K_P"], rig["rc"]["K_D"]) == pytest.approx((paper["rc"]["K_P"], paper["rc"]["K_D"]), rel=1e-12)
    assert rig["rc"]["B_hat"] == pytest.approx(paper["rc"]["B_hat"] * k / y)
    assert rig["rc"]["Q_M"] == pytest.approx(paper["rc"]["Q_M"] * y)
    assert rig["rc"]["phi_honest_pct"] == pytest.approx(paper["rc"]["phi_honest_pct"] * k)
    assert rig["rc"]["phi_holds"] is True and paper["rc"]["phi_holds"] is True
    assert rig["rc"]["rho"]["constant"] == pytest.approx(paper["rc"]["rho"]["constant"] * y)
    assert rig["rc"]["epsilon"] == pytest.approx(paper["rc"]["epsilon"] * y, rel=0.03)
    assert (rig["pi"]["K_P"], rig["pi"]["K_I"]) == pytest.approx(
        (paper["pi"]["K_P"] * k / y, paper["pi"]["K_I"] * k / y), rel=1e-9
    )
    assert rig["replayed"]["pi"]["rms_error_nm"] == pytest.approx(paper["replayed"]["pi"]["rms_error_nm"] * y, rel=1e-9)
    assert rig["replayed"]["rc"]["rms_error_nm"] == pytest.approx(paper["replayed"]["rc"]["rms_error_nm"] * y, rel=0.05)
    assert codes(rig).count("designed-for-rig") == 1 and "designed-for-rig" not in codes(paper)
    capsys.readouterr()
    assert run(["tune-rc", fit_file(**volts()), "--force"]) == 0
    out = capsys.readouterr().out
    assert "V·s/(N)" in out and "%·s" not in out and "N·m" not in out


def test_a_slow_rig_gets_a_slow_design():
    rig = made(**volts(pace=0.01))
    assert rig["rc"]["natural_frequency_rad_s"] == pytest.approx(0.021213, rel=1e-4)
    assert rig["pi"]["settling_s"] == pytest.approx(27.0) and rig["pi"]["overshoot_pct"] == pytest.approx(1.0)
    assert rig["replayed"]["counted_from_s"] == pytest.approx(500.0)


def test_a_loop_that_is_sampled_slowly_gets_a_softer_layer_and_keeps_its_margins():
    given = volts()
    fast = made(**given)
    slow = made(**{**given, "data": {**given["data"], "sample_rate_hz": 60.0}})
    assert slow["margins"]["timing"]["rate_hz"] == 60.0
    assert slow["rc"]["epsilon"] > 1.4 * fast["rc"]["epsilon"]
    assert slow["rc"]["gamma"] * slow["rc"]["epsilon"] == pytest.approx(25.0)
    worst = slow["margins"]["worst"]["rc"]
    assert worst["stable"] and worst["gain_db"] >= 6 and worst["phase_deg"] >= 45
    assert slow["pi"]["settling_s"] >= fast["pi"]["settling_s"]


def test_limits_of_another_input_are_what_was_identified():
    beyond = made(**{**volts(), "data": {"levels": [100.0, 300.0]}})  # a "duty" above 100 is none
    assert beyond["duty_limits_pct"] == [0.0, 300.0]
    assert made("--duty-limits", "0,250", **volts())["duty_limits_pct"] == [0.0, 250.0]


def test_noise_is_what_the_logs_show():
    from eaid.cli.inputs import runs_from
    from eaid.replay.noise import noise_of, white_noise_nm
    from eaid.synth.datasets import shipped

    shown = white_noise_nm(runs_from([shipped()["clutch"]])[1])  # made with 0.01 N·m of white noise
    assert shown == pytest.approx(0.01, rel=0.05)
    told = {"uncertainty": {"noise": {"sensor_nm2_s": 1e-7}}, "data": {"sample_rate_hz": 1000.0}}
    assert noise_of(from_plain(told, Fit, "f"), TuneOptions(), None) == (pytest.approx(0.01), "fit")
    assert noise_of(Fit(), TuneOptions(), None) == (0.01, "supposed")


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"tau1": [0.5, -0.01, 0.0]}, "nonlinear.tau1 is -0.005 s at an input of 50.5, which"),
        # below 0 only between two of the 101 duties that a fit's constraints hold at
        ({"tau1": [0.1 * 10.45**2 - 1e-6, -2.09, 0.1]}, "nonlinear.tau1 is -1e-06 s at an input of 10.45, which"),
        ({"tau1": [1e-4, 0.0, 0.0]}, "nonlinear.tau1 is 0.0001 s at an input of 10, which"),
        ({"tau2": [0.0, 0.0, 0.0]}, "nonlinear.tau2 is 0 s at an input of 10, which"),
        ({"tau2": [0.05, 0.0, 0.0]}, "nonlinear.tau2 is 0.05 s at an input of 10, below tau1, which"),
        ({"tau2": [0.5, 1e50, 0.0]}, "nonlinear.tau2 is"),
        ({"Ts": [-0.5, 0.02, 0.0, 0.0]}, "nonlinear.Ts is -0.3 at an input of 10, which"),
        ({"Ts": [0.0, 0.0, 0.0, 0.0]}, "nonlinear.Ts is 0 at an input of 10, which"),
        ({"Ts": [1e-300, 1e-300, 0.0, 0.0]}, "nonlinear.Ts is 1.1e-299 at an input of 10, which"),
        ({"Ts": [0.0, 1e50, 0.0, 0.0]}, "nonlinear.Ts is"),
        ({"C": 1.5}, "nonlinear.C is"),
        ({"u_range": [100.0, 10.0]}, "nonlinear.u_range is"),
    ],
)
def test_a_plant_that_cannot_be_is_refused_by_all_that_use_it(changes, words, capsys):
    path = fit_file(nonlinear={**PLANT, **changes})
    for command in (["tune-rc"], ["simulate", "--controller", "inverse"], ["couple"], ["export"]):
        assert run([*command, path]) == 3
        err = capsys.readouterr().err
        assert words in err and err.count("\n") == 1


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"a0": 1e-59}, "a0 is 1e-59 1/s"),
        ({"a0": 1e59}, "a0 is 1e+59 1/s"),
        ({"b0": 0.0}, "b0 is 0; more duty has to give more torque"),
        ({"b0": 1e-300}, "b0 is 1e-300 and its c0 -2.42, which no rig has"),
        ({"b0": 1e50}, "b0 is 1e+50 and"),
        ({"c0": -1e50}, "c0 -1e+50, which no rig has"),
    ],
)
def test_a_linear_model_of_no_rig_is_refused_at_once(changes, words, capsys):
    path = fit_file(linear={**PAPER, **changes}, nonlinear=PLANT)
    for command in (
        ["tune-rc"],
        ["simulate", "--controller", "open-loop"],
        ["simulate", "--controller", "feedforward"],
    ):
        assert run([*command, path]) == 5
        assert words in capsys.readouterr().err


def test_optimize_trades_in_the_open(capsys):
    Path("short.csv").write_text("time_s,reference_nm\n0,1\n1,3\n2,1\n3,3\n")
    arguments = ["tune-rc", fit_file(nonlinear=PLANT), "--optimize-also", "b-hat", "--noise-nm", "0.01", "--reference",
                 "short.csv", "--q-max", "5", "--evaluations", "12"]  # fmt: skip
    assert run([*arguments, "-o", "a.json"]) == 0
    out, err = capsys.readouterr()
    gains = json.loads(Path("a.json").read_text())
    told = gains["optimized"]
    assert told["after"]["rms_error_nm"] < told["before"]["rms_error_nm"]
    assert told["after"]["mean_abs_duty_step_pct"] <= told["limit_pct"] == told["before"]["mean_abs_duty_step_pct"]
    assert gains["rc"]["B_hat"] == told["after"]["B_hat"] and gains["rc"]["epsilon"] == told["after"]["epsilon"]
    assert "Search. On the short.csv, 1 plants, noise 0.0100 N·m (given)" in out
    assert "candidates: 61 to do" in err and "every drawn plant is the fitted one" in err
    assert run([*arguments, "-o", "b.json", "-q"]) == 0
    assert Path("b.json").read_bytes() == Path("a.json").read_bytes()


def test_on_a_real_fit(capsys):
    """The shipped logs: bounds over levels, widened; plants drawn from the fit's uncertainty."""
    from eaid.synth.datasets import shipped

    assert run(["fit", str(shipped()["clutch"]), "-q"]) == 0
    fit = json.loads(Path("fit.json").read_text())

    def bounds(*arguments):
        assert run(["tune-rc", "fit.json", "-q", "--force", *arguments]) == 0
        rc = json.loads(Path("gains.json").read_text())["rc"]
        return rc["B_m"], rc["B_M"]

    stored = fit["linear"]["bounds"]
    assert bounds() == (stored["B_m"], stored["B_M"])
    rows = {row["level"]: row for row in fit["linear"]["per_level"]}
    kept = [rows[level]["B"] for level in rows if 30 <= level <= 90]
    assert bounds("--bounds-levels", "30:90") == pytest.approx((min(kept), max(kept)))
    assert bounds("--widen-bounds") == pytest.approx((stored["ci95"]["B_m"][0], stored["ci95"]["B_M"][1]), rel=1e-6)
    searched = ["tune-rc", "fit.json", "--optimize", "--plants", "3", "--evaluations", "4", "--seed", "5"]
    assert run([*searched, "-o", "a.json"]) == 0
    assert run([*searched, "-o", "b.json", "-q"]) == 0
    assert Path("a.json").read_bytes() == Path("b.json").read_bytes()
    told = json.loads(Path("a.json").read_text())["optimized"]
    assert told["plants"] == 3 and told["noise_nm"] == pytest.approx(0.01, rel=0.05)
    assert told["before"]["worst_plant_rms_error_nm"] > told["before"]["rms_error_nm"]


def test_help_loads_nothing_heavy():
    code = (
        "import sys; from eaid.cli.main import run; run(['tune-rc', '--help']); "
        "print([m for m in ('numpy', 'scipy') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"
