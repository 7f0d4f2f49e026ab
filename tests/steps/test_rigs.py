"""Logs as other rigs record them, by the command line: every truth lies within a percent, or within its interval."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

Command = Callable[..., dict[str, Any]]


@pytest.fixture
def fitted(rigs: Path, tmp_path: Path, run_eaid: Callable[..., Any]) -> Command:
    """The fit.json of a recording."""

    def run(name: str, *words: str) -> dict[str, Any]:
        ran = run_eaid("fit", rigs / name, *words, "-o", tmp_path / "fit.json", "--force")
        assert ran.code == 0, ran.err
        found: dict[str, Any] = json.loads((tmp_path / "fit.json").read_text(encoding="utf-8"))
        return found

    return run


HEATER = ("--columns", "input=Q1,output=T1", "--units", "input=%,output=°C", "--repair", "--model", "linear")


def test_heaters(fitted: Command) -> None:
    (step,) = fitted("heater_dead.csv", *HEATER, "--step-at", "0")["steps"]
    assert step["shape"] == "one" and step["start"] == pytest.approx(21.2, abs=0.5)
    for name, true in (("change", 35.4), ("tau1", 150.0)):
        low, high = step["ci95"][name]
        assert step[name] == pytest.approx(true, rel=0.01) and low < step[name] < high < 1.5 * low
    assert step["dead_time_s"] == pytest.approx(15.0, abs=0.5)
    (step,) = fitted("heater_on.csv", *HEATER)["steps"]  # on from its first row, which is where it starts
    assert step["start"] == pytest.approx(20.6, abs=0.3) and step["dead_time_s"] == pytest.approx(14.0, abs=0.5)


def test_a_lamp_on_a_staircase(fitted: Command) -> None:
    lamp = fitted("lamp.csv", "--columns", "time=2,input=3,output=1", "--units", "time=us,input=/255,output=mV")
    up = [row for row in lamp["steps"] if row["edge"] == "up"]
    assert [row["change"] for row in up] == pytest.approx([1.84, 0.66, 0.37, 0.24], rel=0.01)
    assert lamp["nonlinear"]["fit_pct"] > 99
    first = min(lamp["parameters"], key=lambda row: (row["name"] != "tau1", row["level"] or 1e9))
    assert first["value"] == pytest.approx(0.0185, rel=0.02)


def test_seals(fitted: Command) -> None:
    fit = fitted("seals")
    assert [row["Ts"] for row in fit["friction"]["levels"]] == pytest.approx([14.5, 17, 19.5, 24.5], rel=0.05)
    (share,) = [one["values"] for one in fit["findings"] if one["code"] == "runs-reject-the-share"]
    assert share["low"] < share["estimate"] < share["high"] and share["estimate"] == pytest.approx(0.6, abs=0.03)


def test_strokes_to_and_fro(fitted: Command) -> None:
    """Each turn of the position is a step of friction, from the force at the turn."""
    columns, units = "time=1,position=2,input=3,output=4", "time=ms,position=mm,input=bar,output=N"
    fit = fitted("to_and_fro.tsv", "--columns", columns, "--units", units)
    rows = fit["data"]["sources"]
    assert [row["step_s"] for row in rows] == pytest.approx([1.5 + 3 * k for k in range(len(rows))], abs=0.06)
    assert [row["Ts"] for row in fit["friction"]["levels"]] == pytest.approx([34.0], rel=0.15)
