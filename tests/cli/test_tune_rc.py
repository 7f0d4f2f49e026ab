"""`eaid tune-rc` as users call it: files, tables, JSON, warnings, exit codes."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from eaid.cli.main import run
from eaid.control.gains import pi_from_json, rc_from_json
from eaid.models.parameters import REFERENCE_PLANT

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
    assert rc_from_json(gains).B_hat == 12.5 and pi_from_json(gains) == (21.0, 360.0, 0.0, 100.0, 0.0)
    assert out.splitlines()[0] == "Robust controller" and "Margins around held duties" in out
    assert "10.8125 + 6.58595·‖ξ‖" in out and "means 26.41 % duty" in out
    assert "warning: ρ does not cover the uncertainty: with B̂ = 12.5 the α really reached is 0.7066" in err
    assert "21 and 360, gives 41.7 % overshoot and 2.52 s" in err
    assert err.splitlines()[-1] == "wrote g.json"


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
    assert back["duty_limits_pct"] == [5.0, 90.0] and rc_from_json(back).back_calculation > 0
    assert made("--pwm-hz", "0", "--rate-hz", "500")["margins"]["timing"] == {"rate_hz": 500.0, "pwm_hz": None}


def test_replayed_error_beside_the_bound():
    gains = made(nonlinear=PLANT)
    assert gains["replayed"]["reference"] == "multisine"
    assert gains["rc"]["ultimate_bound"]["replayed_nm"] == pytest.approx(0.1157, abs=1e-3)
    assert gains["replayed"]["pi"]["max_abs_error_nm"] == pytest.approx(0.80, abs=0.01)
    assert any("Q_M does not hold for the multisine" in warning for warning in gains["warnings"])
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
        ({"b0": -0.08}, [], "fit.json: b0 is -0.08"),
        ({"a0": 0.0}, [], "fit.json: a0 is 0 "),
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
        (["--phi", "much"], 2, "--phi much: is no number"),
        (["--kp", "4", "--damping", "1"], 2, "not both"),
        (["--damping", "0.7"], 2, "belong together"),
        (["--levels", "30:100"], 2, "no fits of single levels"),
        (["--bounds", "x"], 2, "--bounds x: must be one of"),
        (["--epsilon", "0"], 2, "--epsilon 0: must be above 0"),
        (["--reference", "none.csv"], 3, "none.csv: no such file"),
        (["--optimize"], 3, "holds no nonlinear model"),
        (["--optimize-also", "colour"], 2, "--optimize-also colour: must be of"),
        (["--optimize", "--noise-nm", "-1"], 2, "--noise-nm -1"),
        (["--optimize", "--evaluations", "0"], 2, "--evaluations 0"),
        (["--rate-hz", "0"], 2, "--rate-hz 0"),
        (["--duty-limits", "0,120"], 2, "a duty ends at 100 %"),
        (["--duty-limits", "50,20"], 2, "--duty-limits 50,20: must rise"),
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
    linear = {**PAPER, "identifiable": False, "not_identifiable_because": ["one level only"]}
    assert run(["tune-rc", fit_file(linear=linear)]) == 3
    assert "is not identifiable (one level only); --allow-unidentified uses it, marked" in capsys.readouterr().err
    gains = made("--allow-unidentified", linear=linear)
    assert gains["unidentified"] == "one level only" and "not identifiable: one level only" in gains["warnings"][0]


def test_another_input_and_output_are_told(capsys):
    data = {"input_unit": "V", "output_unit": "N", "levels": [100.0, 300.0]}
    weak = {**PLANT, "Ts": [0.0, 2e-3, 0.0, 0.0], "u_range": [100.0, 300.0], "tau1": [0.3, 0.0, 0.0]}
    weak["tau2"] = [5.0, 0.0, 0.0]
    gains = made(data=data, nonlinear=weak)
    assert gains["duty_limits_pct"] == [0.0, 300.0]
    assert gains["warnings"][0] == "input in V, output in N: read them wherever this says % duty and N·m"
    assert any("the fitted plant makes 0.6 N·m at most" in warning for warning in gains["warnings"])
    beyond = made(data={"levels": [100.0, 300.0]}, nonlinear=weak)
    assert beyond["duty_limits_pct"] == [0.0, 300.0]
    assert made("--duty-limits", "0,250", data=data)["duty_limits_pct"] == [0.0, 250.0]


def test_noise_is_what_the_logs_show():
    from eaid.cli.inputs import stepset_from
    from eaid.cli.tune_search import noise_of
    from eaid.control.noise import white_noise_nm
    from eaid.synth.datasets import shipped

    shown = white_noise_nm(stepset_from([shipped()["clutch"]]))  # made with 0.01 N·m of white noise
    assert shown == pytest.approx(0.01, rel=0.05)
    told = {"uncertainty": {"noise": {"sensor_nm2_s": 1e-7}}, "data": {"sample_rate_hz": 1000.0}}
    assert noise_of(told, None) == (pytest.approx(0.01), "as the fit tells it")
    assert noise_of({}, None) == (0.01, "supposed")


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
    assert "Optimised on the short.csv, 1 plants, noise 0.01 N·m (given)" in out
    assert "candidates: 61 to do" in err and "every drawn plant is the fitted one" in err
    assert run([*arguments, "-o", "b.json", "-q"]) == 0
    assert Path("b.json").read_bytes() == Path("a.json").read_bytes()


def test_on_a_real_fit(capsys):
    """The shipped logs: bounds over levels, by another convention, widened; plants drawn from the fit's uncertainty."""
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
    assert bounds("--levels", "30:90") == pytest.approx((min(kept), max(kept)))
    assert bounds("--widen-bounds") == pytest.approx((stored["ci95"]["B_m"][0], stored["ci95"]["B_M"][1]), rel=1e-6)
    for convention in ("pooled-offset", "pooled-dynamics"):
        told = fit["linear"]["conventions"][convention]
        assert bounds("--bounds", convention) == pytest.approx((told["B_m"], told["B_M"]))
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
