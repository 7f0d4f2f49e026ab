"""`eaid plan` through its runner: exit codes, files, sentences, and the planned experiment keeping its promise."""

import contextlib
import csv
import io
import json
from pathlib import Path

import pytest

from eaid.cli import main
from eaid.models.parameters import REFERENCE_PLANT as P
from eaid.results.codec import text_of

NOISE = {"noise": {"sensor_nm2_s": 2e-7, "ripple_s": 3e-5, "scatter": {"Ts": 0.03, "tau1": 0.05, "tau2": 0.0}}}


def written(path: Path, content: dict) -> None:
    path.write_text(text_of({"schema": "eaid/fit/1", **content}), encoding="utf-8")


@pytest.fixture
def fit(tmp_path: Path) -> Path:
    model = {"C": P.C, "tau1": P.tau1, "tau2": P.tau2, "Ts": P.Ts, "u_range": P.u_range}
    path = tmp_path / "fit.json"
    written(path, {"nonlinear": model, "uncertainty": NOISE})
    return path


def test_plan_and_its_duty_file(fit: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output = tmp_path / "plan.csv"
    arguments = ["plan", str(fit), "--want", "tau2=12,Ts=4", "-o", str(output), "--json"]
    assert main.run(arguments) == 0
    told = capsys.readouterr()
    result = json.loads(told.out)
    assert result["schema"] == "eaid/plan/1" and result["met"] is True
    assert result["half_width_pct"]["tau2"] <= 12 and result["half_width_pct"]["Ts"] <= 4
    # what four of five recordings keep whose scatter is known to √(2/20) each, over all plans that were tried
    for name, width in result["half_width_pct"].items():
        assert 0.8 < result["measured_half_width_pct"][name] / width < 1.8, name
    assert result["measured_half_width_pct"]["tau2"] <= 12 and result["measured_half_width_pct"]["Ts"] <= 4
    rows = list(csv.DictReader(output.open()))
    assert len(rows) == len(result["levels"]) * result["repeats"]
    assert {float(row["level"]) for row in rows} == set(result["levels"])
    assert all(float(row["release_s"]) == 10 for row in rows)
    breaks = list(csv.DictReader((tmp_path / "plan.duty.csv").open()))
    assert float(breaks[-1]["time_s"]) == pytest.approx(result["time_on_rig_s"]) and breaks[-1]["duty_pct"] == "0"
    assert f"{output}, {tmp_path / 'plan.duty.csv'}: {len(rows)} runs" in told.err
    first = output.read_bytes()
    assert main.run([*arguments, "--force", "-q"]) == 0
    assert output.read_bytes() == first


def test_the_synthesised_widths_keep_what_was_wanted(fit: Path, tmp_path: Path) -> None:
    """By prediction alone τ1 comes out too wide in one synthesis of two; the checked plan keeps it."""
    out = ["-o", str(tmp_path / "p.csv"), "-q", "--json"]
    with contextlib.redirect_stdout(io.StringIO()) as told:
        assert main.run(["plan", str(fit), "--want", "tau1=5,Ts=3", *out]) == 0
    result = json.loads(told.getvalue())
    assert result["met"] is True
    assert result["measured_half_width_pct"]["tau1"] <= 5 and result["measured_half_width_pct"]["Ts"] <= 3


def test_levels_in_volts_are_planned_in_volts(fit: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Three volts a percent: the same rig, the same widths; the fit's own doubts go along."""
    source = json.loads(fit.read_text())
    part = source["nonlinear"]
    for name in ("tau1", "tau2", "Ts"):
        part[name] = [c / 3**k for k, c in enumerate(part[name])]
    part |= {
        "u_range": [3 * u for u in part["u_range"]],
        "identifiable": False,
    }
    source["data"] = {"kind": "clutch", "input_unit": "V", "output_unit": "N"}
    decays = {"code": "output-decays-under-hold", "severity": "caution", "subject": "friction", "levels": [300.0]}
    source["findings"] = [{**decays, "values": {}}]
    volts = tmp_path / "volts.json"
    written(volts, {key: source[key] for key in ("data", "nonlinear", "uncertainty", "findings")})
    found = []
    for path in (fit, volts):
        out = tmp_path / f"{path.stem}.csv"
        assert (
            main.run(
                ["plan", str(path), "--want", "Ts=4", "--most-levels", "10", "--no-check", "-o", str(out), "--json"]
            )
            == 0
        )
        told = capsys.readouterr()
        found.append(json.loads(told.out))
    assert found[1]["levels"][-1] == pytest.approx(3 * found[0]["levels"][-1])
    assert found[1]["repeats"] == found[0]["repeats"]
    assert found[1]["half_width_pct"]["Ts"] == pytest.approx(found[0]["half_width_pct"]["Ts"], rel=0.05)
    assert (tmp_path / "volts.duty.csv").read_text().startswith("time_s,input (V)\n0,0\n10,")
    codes = [one["code"] for one in found[1]["findings"]]
    assert codes == ["plan-of-decaying-output", "plan-rests-on-a-guess"]
    assert "the plan rests on a guess" in told.err and "decays under hold at 300" in told.err


def test_an_existing_plan_is_left_alone(fit: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "plan.duty.csv").write_text("mine")
    assert main.run(["plan", str(fit), "-o", str(tmp_path / "plan.csv"), "--no-check"]) == 2
    assert "exists already" in capsys.readouterr().err
    assert (tmp_path / "plan.duty.csv").read_text() == "mine"


def test_out_of_reach_is_a_warning(fit: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main.run(["plan", str(fit), "--want", "Ts=0.2", "-o", str(tmp_path / "p.csv"), "--no-check"]) == 0
    told = capsys.readouterr()
    assert "warning: T_s comes to" in told.err and "runs differ by 3 %" in told.err
    assert "What to record" in told.out


def test_a_fit_without_noise_says_what_is_assumed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "fit.json"
    written(path, {"nonlinear": {"tau1": P.tau1, "tau2": P.tau2, "Ts": P.Ts, "u_range": [10, 90]}})
    assert main.run(["plan", str(path), "-o", str(tmp_path / "p.csv"), "--no-check", "--want", "Ts=5"]) == 0
    assert "does not say how noisy the rig is" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "code", "sentence"),
    [
        (["--want", "tau9=3"], 2, "--want tau9: give a parameter of Ts, tau1, tau2"),
        (["--want", "tau2"], 2, "--want tau2: 'tau2' is no name=number"),
        (["--want", "Ts=150"], 2, "--want Ts: give"),
        (["--idle", "-1"], 2, "--idle -1: give a number from 0"),
        (["--most-levels", "2"], 2, "--most-levels 2: give a whole number from 4 to 100"),
    ],
)
def test_wrong_usage(
    fit: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], options: list[str], code: int, sentence: str
) -> None:
    assert main.run(["plan", str(fit), "-o", str(tmp_path / "p.csv"), *options]) == code
    assert sentence in capsys.readouterr().err
    assert not (tmp_path / "p.csv").exists()


def test_a_fit_with_nothing_to_plan_with_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "fit.json"
    written(path, {"linear": {"a0": 1.0}})
    assert main.run(["plan", str(path), "-o", str(tmp_path / "p.csv")]) == 3
    assert "holds neither a nonlinear nor a friction model to plan with" in capsys.readouterr().err
