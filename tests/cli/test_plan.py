"""`eaid plan` through its runner: exit codes, files, sentences, and the planned experiment keeping its promise."""

import csv
import json
from pathlib import Path

import pytest

from eaid.cli import main
from eaid.models.parameters import REFERENCE_PLANT as P
from eaid.store import stamped, write_json

NOISE = {"noise": {"sensor_nm2_s": 2e-7, "ripple_s": 3e-5, "scatter": {"Ts": 0.03, "tau1": 0.05, "tau2": 0.0}}}


@pytest.fixture
def fit(tmp_path: Path) -> Path:
    model = {"C": P.C, "tau1": P.tau1, "tau2": P.tau2, "Ts": P.Ts, "u_range": P.u_range}
    path = tmp_path / "fit.json"
    write_json(path, stamped("eaid/fit/1", {"nonlinear": model, "uncertainty": NOISE}))
    return path


def test_plan_and_its_duty_file(fit: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output = tmp_path / "plan.csv"
    arguments = ["plan", str(fit), "--want", "tau2=12,Ts=4", "-o", str(output), "--json"]
    assert main.run(arguments) == 0
    told = capsys.readouterr()
    result = json.loads(told.out)
    assert result["schema"] == "eaid/plan/1" and result["met"] is True
    assert result["half_width_pct"]["tau2"] <= 12 and result["half_width_pct"]["Ts"] <= 4
    # one synthesised experiment: its scatter is known to √(2/20), so its widths to about a quarter
    for name, width in result["half_width_pct"].items():
        assert result["measured_half_width_pct"][name] == pytest.approx(width, rel=0.4), name
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


def test_an_existing_plan_is_left_alone(fit: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "plan.duty.csv").write_text("mine")
    assert main.run(["plan", str(fit), "-o", str(tmp_path / "plan.csv"), "--no-check"]) == 2
    assert "exists already" in capsys.readouterr().err
    assert (tmp_path / "plan.duty.csv").read_text() == "mine"


def test_out_of_reach_is_a_warning(fit: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main.run(["plan", str(fit), "--want", "Ts=0.2", "-o", str(tmp_path / "p.csv"), "--no-check"]) == 0
    told = capsys.readouterr()
    assert "warning: Ts comes to" in told.err and "runs differ by 3 %" in told.err
    assert "What to record" in told.out


def test_a_fit_without_noise_says_what_is_assumed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "fit.json"
    write_json(
        path, stamped("eaid/fit/1", {"nonlinear": {"tau1": P.tau1, "tau2": P.tau2, "Ts": P.Ts, "u_range": [10, 90]}})
    )
    assert main.run(["plan", str(path), "-o", str(tmp_path / "p.csv"), "--no-check", "--want", "Ts=5"]) == 0
    assert "does not say how noisy the rig is" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "code", "sentence"),
    [
        (["--want", "tau9=3"], 2, "--want tau9=3: write"),
        (["--idle", "-1"], 2, "--idle -1: give 0 or more"),
        (["--most-levels", "2"], 2, "--most-levels 2: give 4 or more"),
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
    write_json(path, stamped("eaid/fit/1", {"linear": {"a0": 1.0}}))
    assert main.run(["plan", str(path), "-o", str(tmp_path / "p.csv")]) == 3
    assert "holds neither a nonlinear nor a friction model to plan with" in capsys.readouterr().err
