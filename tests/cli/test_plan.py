"""`eaid plan`: the run table and the duty file, promises that are kept, fits of little content."""

import csv
import json
from pathlib import Path

import pytest

NOISE = {"noise": {"sensor_nm2_s": 2e-7, "ripple_s": 3e-5, "scatter": {"Ts": 0.03, "tau1": 0.05, "tau2": 0.0}}}


def planned(run_eaid, words):
    ran = run_eaid(f"plan fit.json --json --force {words}")
    assert ran.code == 0
    return json.loads(ran.out)


def test_plan_and_its_duty_file(by_hand, run_eaid):
    by_hand({"uncertainty": NOISE})
    ran = run_eaid("plan fit.json --want tau2=12,Ts=4 --no-check --json")
    told, rows = json.loads(ran.out), list(csv.DictReader(Path("plan.csv").read_text().splitlines()))
    assert told["half_width_pct"]["tau2"] <= 12 and told["half_width_pct"]["Ts"] <= 4
    assert len(rows) == len(told["levels"]) * told["repeats"]
    assert [int(row["order"]) for row in rows] == list(range(1, len(rows) + 1))
    assert {float(row["level"]) for row in rows} == set(told["levels"])
    assert {float(row["idle_s"]) for row in rows} == {10.0}
    assert {float(row["release_s"]) for row in rows} == {23.0}  # then the slow part is 0.5 % of the lowest level
    breaks = list(csv.DictReader(Path("plan.duty.csv").read_text().splitlines()))
    assert float(breaks[-1]["time_s"]) == pytest.approx(told["time_on_rig_s"]) and breaks[-1]["duty_pct"] == "0"
    took = sum(float(row[name]) for row in rows for name in ("idle_s", "hold_s", "release_s"))
    assert took == pytest.approx(told["time_on_rig_s"])
    assert f"plan.csv, plan.duty.csv: {len(rows)} runs" in ran.err
    short = planned(run_eaid, "--no-check --want Ts=4 --idle 2 --release 3 --longest-hold 20 --most-levels 5")
    rows = list(csv.DictReader(Path("plan.csv").read_text().splitlines()))
    assert len(short["levels"]) <= 5 and max(float(row["hold_s"]) for row in rows) <= 20
    assert {(row["idle_s"], row["release_s"]) for row in rows} == {("2", "3")}


@pytest.mark.slow
def test_the_synthesised_widths_keep_what_was_wanted(by_hand, run_eaid):
    """By prediction alone τ1 comes out too wide in one synthesis of two; the checked plan keeps it."""
    by_hand({"uncertainty": NOISE})
    assert planned(run_eaid, "--want tau1=5,Ts=3")["met"] is True
    told = planned(run_eaid, "--want tau2=12,Ts=4")
    assert told["met"] is True
    for name, width in told["half_width_pct"].items():
        assert 0.8 < told["measured_half_width_pct"][name] / width < 1.8, name
    assert told["measured_half_width_pct"]["tau2"] <= 12 and told["measured_half_width_pct"]["Ts"] <= 4


ONE_LEVEL = {"code": "one-level-nonlinear", "severity": "caution", "subject": "nonlinear", "levels": [40.0]}


@pytest.mark.parametrize(
    ("parts", "want", "code", "sentence"),
    [
        ({"uncertainty": NOISE}, "Ts=0.2", 0, "warning: T_s comes to … runs differ by 3 %"),
        ({}, "Ts=5", 0, "does not say how noisy the rig is"),
        ({"findings": [ONE_LEVEL]}, "Ts=5", 0, "the plan rests on a guess"),
        ({"nonlinear": None}, "Ts=5", 3, "holds neither a nonlinear nor a friction model to plan with"),
    ],
)
def test_what_is_told_of_a_plan(parts, want, code, sentence, by_hand, run_eaid):
    by_hand(parts)
    ran = run_eaid("plan fit.json --want", want, "--no-check")
    assert ran.code == code and all(part in ran.err for part in sentence.split("…"))
    assert ("What to record" in ran.out) == (code == 0)
