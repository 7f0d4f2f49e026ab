"""`eaid fit`: from logs to fit.json: what it says, options that reach the result, fits that must not be used."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

import eaid


def result():
    return json.loads(Path("f.json").read_text(encoding="utf-8"))


@pytest.fixture
def fitted(rig, run_eaid):
    """The fit.json that these words make, without intervals."""

    def fitted(words):
        assert run_eaid(f"fit {words} --ci none -q --force -o f.json").code == 0
        return result()

    return fitted


def test_the_answer_comes_first_in_ten_lines(rig, run_eaid):
    ran = run_eaid("fit data.h5 -o f.json")
    lines = ran.out.splitlines()
    assert ran.code == 0 and len(lines) <= 10 and all(len(line) <= 80 for line in lines[:6])
    assert lines[0].startswith("fit    nonlinear 9") and "10 logs played again" in lines[1]
    assert lines[2].split()[:2] == ["level", "[%]"]
    assert all(symbol in lines[2] for symbol in ("T_s [N·m]", "τ1 [s]", "τ2 [s]"))
    assert sum(" (" in line and " … " in line for line in lines[3:6]) == 3
    assert lines[-1] == "next   eaid tune-rc f.json"
    told = ran.err.splitlines()
    assert len([line for line in told if line.startswith(("stop", "warning", "note"))]) <= 3
    assert told[-1] == "f.json: friction, nonlinear, linear, release of 10 clutch runs, synthetic"


def test_options_reach_the_fit(fitted, run_eaid):
    fit = fitted("data.h5 --model nonlinear,linear --share 0.8 --loss huber --hold-out 60 --bounds-levels 40:100")
    assert "friction" not in fit and fit["nonlinear"]["C"] == 0.8 and fit["options"]["loss"] == "huber"
    assert [row["level"] for row in fit["nonlinear"]["hold_out"]["levels"]] == [60.0]
    assert fit["linear"]["bounds"]["levels"] == [40.0, 80.0, 100.0]
    assert run_eaid("fit", *fit["command"], "-q", "-o", "b.json").code == 0  # the words that it keeps make it again
    assert Path("f.json").read_bytes() == Path("b.json").read_bytes()
    fit = fitted("data.h5 --share free --levels 40:100")
    assert fit["nonlinear"]["C_free"] is True and fit["friction"]["C"] is None and "hold_out" not in fit["nonlinear"]
    assert fit["nonlinear"]["u_range"] == fit["data"]["levels"][::3] == [40.0, 100.0]


def test_reading_options_reach_the_runs(fitted):
    """The synthetic sensor has an offset, which `none` leaves in."""
    by_rest, left = (fitted(f"logs --model friction{more}") for more in ("", " --baseline none"))
    assert {row["baseline_nm"] for row in left["data"]["sources"]} == {0.0}
    assert 0.0 not in {row["baseline_nm"] for row in by_rest["data"]["sources"]}
    assert left["friction"]["levels"][-1]["Ts"] != by_rest["friction"]["levels"][-1]["Ts"]
    short = fitted("logs --model friction --until 7")
    longest, cut = (max(row["samples"] for row in fit["data"]["sources"]) for fit in (by_rest, short))
    assert cut < longest


def table(text, title):
    """The cells of one printed table, its head first."""
    lines = text.splitlines()
    start = next(i for i, line in enumerate(lines) if line.startswith(f"{title}. "))
    return [re.split(r" {2,}", line) for line in lines[start + 1 : start + 12]]


def test_the_tables_hold_the_numbers_of_the_file(rig, run_eaid):
    ran = run_eaid("fit data.h5 --estimator joint --hold-out 60 -v -o f.json")
    assert "unseen 60 %, held out: RMSE" in ran.out
    part, rows = result()["nonlinear"], table(ran.out, "Table III")
    assert rows[0][2:4] == ["published", "ours, joint"]
    assert "B_m = " in ran.out and "Release. How the output falls" in ran.out
    shown = {row[0]: row[3] for row in rows[1:] if len(row) > 3}
    for k, exact in enumerate(part["tau2"]):
        assert float(shown[f"b_{k}"].replace("−", "-")) == pytest.approx(exact, rel=2e-3)
    held = next(row for row in table(ran.out, "Levels held out") if row[0] == "nonlinear")
    assert held[1] == "60" and float(held[2]) == pytest.approx(part["hold_out"]["levels"][0]["rmse"], rel=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_the_tracking_error_of_a_noisy_fit_is_that_of_its_plant(seed, tmp_path, monkeypatch, run_eaid):
    """On the plant itself RC's largest multisine error is 0.087 … 0.102 N·m; the joint estimate gives 0.11 to 0.47."""
    monkeypatch.chdir(tmp_path)
    for line in (
        f"synth --seed {seed} --release 0 --rate-hz 250 -o data.h5 -q",
        "fit data.h5 -o fit.json -q",
        "tune-rc fit.json -o gains.json -q",
    ):
        assert run_eaid(line).code == 0
    ran = run_eaid("simulate fit.json --gains gains.json --scenario multisine --controller rc --json")
    assert 0.95 * 0.087 < json.loads(ran.out)["controllers"]["rc"]["max_abs_error_nm"] < 1.05 * 0.102


@pytest.mark.slow
def test_a_verdict_names_options_as_they_are_typed(tmp_path, monkeypatch, run_eaid):
    """Torque in counts: terminal, gains and page say --units, a notebook units=."""
    monkeypatch.chdir(tmp_path)
    assert run_eaid("synth --levels 40,70,100 --repeats 1 --hold 8 --idle 1 --rate-hz 50 -q -o logs").code == 0
    for log in Path("logs").glob("*.csv"):
        rows = [line.split(",") for line in log.read_text().splitlines()]
        scaled = [[*row[:-1], f"{1e9 * float(row[-1])}"] if row[0][:1].isdigit() else row for row in rows]
        log.write_text("\n".join(map(",".join, scaled)) + "\n")
    ran = run_eaid("fit logs --ci none -o f.json")
    assert ran.code == 4 and ran.out.startswith("NOT USABLE: ") and "say --units output=UNIT" in ran.out
    ran = run_eaid("tune-rc f.json -o g.json")
    assert ran.code == 3 and "say --units output=UNIT" in ran.err
    ran = run_eaid("tune-rc f.json --anyway --verbose -o g.json")
    assert "say --units output=UNIT" in ran.err and "units=" not in ran.err
    assert run_eaid("report f.json g.json --figures fig07 -o r -q").code == 0
    page = Path("r/report.html").read_text(encoding="utf-8")
    assert "say --units output=UNIT" in page and "«" not in page
    assert 'say units="output=UNIT"' in eaid.load("f.json").verdict.why


@pytest.mark.parametrize("loaded", [False, True])
def test_the_first_screen_of_three_logs_says_whose_the_rise_is_and_what_to_do(loaded, tmp_path, run_eaid):
    """T_s = 3.2 (u/100)^1.4; C = 0.78, or a stand that loads the output by 0.9 a second."""
    t, rng = np.arange(0, 10, 0.02), np.random.default_rng(11)
    s = np.maximum(t - 1.5, 0)
    for u in (40, 60, 80):
        top = 3.2 * (u / 100) ** 1.4
        y = np.minimum(0.9 * s, top) if loaded else top * (1 - 0.78 * np.exp(-s / 0.18) - 0.22 * np.exp(-s / 2.2))
        rows = zip(t, np.where(t < 1.5, 0, u), y + 0.01 * rng.standard_normal(len(t)), strict=True)
        table = "".join(f"{a:.2f},{b:g},{c:.5f}\n" for a, b, c in rows)
        (tmp_path / f"test_duty{u}.csv").write_text("time,duty,torque_nm\n" + table)
    ran = run_eaid("fit", tmp_path, "-o", tmp_path / "fit.json")
    (usable,) = [line for line in ran.out.splitlines() if line.startswith("usable")]
    told = [line for line in ran.err.splitlines() if line.startswith("warning: ")]
    assert ("rise of the rig (τ1 and τ2 are the stand's loading)" in usable) is loaded
    assert "single runs few levels" in usable and "asks for another C" not in ran.out + ran.err
    assert any(one.startswith("warning: the rise is the rig's") for one in told) is loaded
    if not loaded:  # a C that the runs tell needs no word
        assert abs(eaid.load(tmp_path / "fit.json").plant.C - 0.78) < 0.01
    advice = "record steps on a stand that moves already" if loaded else "repeat each level three times"
    assert ran.out.splitlines()[-1] == f"next   {advice}; as it is: eaid tune-rc {tmp_path / 'fit.json'}"
