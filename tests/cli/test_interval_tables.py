"""The tables of intervals that `eaid fit` prints."""

import pytest

from eaid.cli.interval_tables import interval_tables

RESULT = {
    "uncertainty": {"ci": "robust", "scatter_from": "repeats", "adequacy": {"recommended": "keep it"}},
    "friction": {"levels": [{"level": 10.0, "ci95": {"Ts": [0.9, 1.1], "tau1": [0.1, 0.2], "tau2": None}}]},
    "nonlinear": {
        "curves": [{"level": 10.0, "ci95": {"Ts": [0.8, 1.2], "tau1": [0.1, 0.2], "tau2": [1.0, 9.0]}}],
        "two_stage": {"curves": [{"level": 10.0, "ci95": {"Ts": [0.9, 1.1], "tau1": None, "tau2": [3.0, 4.0]}}]},
    },
    "linear": {"a0": 1.5, "ci95": {"a0": [1.25, 1.75]}, "bounds": {"B_m": None, "ci95": {"B_m": None}}},
}


def test_every_interval_is_shown_and_what_has_none_says_so(capsys: pytest.CaptureFixture[str]) -> None:
    interval_tables(RESULT)
    told = capsys.readouterr().out.splitlines()
    assert told[0] == "95 % intervals (robust; scatter from repeats): each level"
    assert told[2].split() == ["10", "0.9", "…", "1.1", "0.1", "…", "0.2", "not", "determined"]
    assert any("0.8 … 1.2" in line and "0.9 … 1.1" in line and "3 … 4" in line for line in told)
    assert any(line.startswith("a0") and "1.25 … 1.75" in line for line in told)
    assert told[-1] == "keep it"


def test_a_result_without_intervals_prints_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    interval_tables({"linear": {"a0": 1.0}})
    assert capsys.readouterr().out == ""
