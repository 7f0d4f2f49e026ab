"""The commands on logs that are fitted as they were recorded: synth → fit → plan → synth."""

import json
from pathlib import Path

import numpy as np
import pytest

from eaid.cli import main


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("recorded") / "rec"
    shape = "duration_s=90,hold_s=0.5:8,rest_s=5"
    assert main.run(["synth", "--excitation", "random", "--shape", shape, "--rate-hz", "100", "-o", str(folder)]) == 0
    return folder


def test_a_log_of_random_steps_is_fitted_whole(log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "fit.json"
    assert main.run(["fit", str(log), "-o", str(out), "--tables"]) == 0
    told = capsys.readouterr()
    assert "Logs fitted as recorded" in told.out and "free-run fit (%)" in told.out
    fit = json.loads(out.read_text(encoding="utf-8"))
    assert fit["converged"] is True and fit["recorded"]["logs"][0]["fit_pct"] > 90
    assert fit["recorded"]["logs"][0]["sha256"] and len(fit["nonlinear"]["tau1"]) == 3
    assert {"release-alike"} <= {one["code"] for one in fit["findings"]}
    assert fit["linear"]["bounds"]["B_m"] < fit["linear"]["bounds"]["B_M"]
    assert main.run(["tune-rc", str(out), "-o", str(tmp_path / "gains.json")]) in (0, 5)
    other = tmp_path / "other.json"
    assert main.run(["fit", str(log), "--logs-as", "steps", "-o", str(other)]) in (0, 3, 4)
    assert not other.exists() or "recorded" not in json.loads(other.read_text(encoding="utf-8"))


def test_a_plan_of_one_recording_can_be_played(log: Path, tmp_path: Path) -> None:
    out, csv = tmp_path / "fit.json", tmp_path / "next.csv"
    assert main.run(["fit", str(log), "-o", str(out), "--ci", "robust", "-q"]) == 0
    limits = "duty=20:90,hold=0.5:10,rest=3,engagements=2"
    asked = ["--want", "tau1=15,tau2=40", "--limits", limits, "--no-check"]
    assert main.run(["plan", str(out), "--excitation", *asked, "-o", str(csv), "-q"]) == 0
    rows = np.loadtxt(csv, delimiter=",", skiprows=1)
    assert csv.read_text(encoding="utf-8").startswith("time_s,duty_pct\n")
    assert (np.diff(rows[:, 0]) > 0).all() and rows[:, 1].max() <= 90
    played = tmp_path / "played"
    assert main.run(["synth", "--duty-file", str(csv), "--rate-hz", "50", "--repeats", "1", "-o", str(played)]) == 0
    assert main.run(["fit", str(played), "-o", str(tmp_path / "again.json"), "-q"]) in (0, 4)
    assert "recorded" in json.loads((tmp_path / "again.json").read_text(encoding="utf-8"))


def test_a_closed_loop_has_its_reference_and_its_law(tmp_path: Path) -> None:
    folder, out = tmp_path / "loop", tmp_path / "fit.json"
    shape = "duration_s=60,gains=15:200,hold_s=0.5:5"
    assert (
        main.run(["synth", "--excitation", "closed-loop", "--shape", shape, "--rate-hz", "200", "-o", str(folder)]) == 0
    )
    (csv,) = folder.glob("*.csv")
    assert csv.read_text(encoding="utf-8").splitlines()[1] == "time_s,duty_pct,torque_nm,reference_nm"
    assert main.run(["fit", str(folder), "--instrument", "--duty", "10:100", "-o", str(out)]) in (0, 4)
    (loop,) = json.loads(out.read_text(encoding="utf-8"))["recorded"]["loops"]
    assert loop["K_P"] == pytest.approx(15, rel=0.02)


def test_wrong_words_are_refused(log: Path, tmp_path: Path) -> None:
    out = str(tmp_path / "x")
    for words in (
        ["synth", "--excitation", "sawtooth", "-o", out],
        ["synth", "--excitation", "random", "--shape", "colour=3", "-o", out],
        ["synth", "--excitation", "random", "--shape", "hold_s=3", "-o", out],
        ["synth", "--excitation", "random", "-o", f"{out}.h5"],
        ["fit", str(log), "--logs-as", "waves", "-o", out],
        ["fit", str(log), "--loss", "huber", "-o", out],
        ["fit", str(log), "--duty", "10", "-o", out],
    ):
        assert main.run(words) == 2, words
    assert not list(tmp_path.glob("x*"))
