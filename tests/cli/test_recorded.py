"""The commands on logs that are fitted as they were recorded: synth → fit → plan → synth."""

import json
from pathlib import Path

import numpy as np
import pytest

RANDOM = "synth --excitation random --shape duration_s=90,hold_s=0.5:8,rest_s=5 --rate-hz 100 -q -o rec"


@pytest.fixture(autouse=True)
def _here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.mark.slow
def test_a_log_of_random_steps_is_fitted_whole_and_followed_by_a_sequence_that_can_be_played(run_eaid):
    assert run_eaid(RANDOM).code == 0
    ran = run_eaid("fit rec --verbose")
    assert ran.code == 0 and "Logs fitted as recorded" in ran.out and "free-run fit (%)" in ran.out
    fit = json.loads(Path("fit.json").read_text(encoding="utf-8"))
    assert fit["converged"] is True and fit["recorded"]["logs"][0]["fit_pct"] > 90
    assert fit["recorded"]["logs"][0]["sha256"] and len(fit["nonlinear"]["tau1"]) == 3
    assert "release-alike" in {one["code"] for one in fit["findings"]}
    assert fit["linear"]["bounds"]["B_m"] < fit["linear"]["bounds"]["B_M"]
    assert run_eaid("tune-rc fit.json").code in (0, 5)
    limits = "--want tau1=15,tau2=40 --limits duty=20:90,hold_s=0.5:10,rest_s=3,engagements=2 --no-check"
    assert run_eaid(f"plan fit.json --excitation {limits} -o next.csv -q").code == 0
    assert Path("next.csv").read_text(encoding="utf-8").startswith("time_s,duty_pct\n")
    rows = np.loadtxt("next.csv", delimiter=",", skiprows=1)
    assert (np.diff(rows[:, 0]) > 0).all() and rows[:, 1].max() <= 90
    assert run_eaid("synth --duty-file next.csv --rate-hz 50 --repeats 1 -o played").code == 0
    assert run_eaid("fit played -o again.json -q").code in (0, 4)
    assert "recorded" in json.loads(Path("again.json").read_text(encoding="utf-8"))
    assert run_eaid("fit rec --logs-as steps -o other.json").code in (0, 3, 4)
    assert not Path("other.json").exists() or "recorded" not in json.loads(Path("other.json").read_text("utf-8"))
