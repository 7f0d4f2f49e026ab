"""Odd rigs of known truth, each as a new user would type it: right to a few percent, or told, or refused."""

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy.signal import lfilter

import eaid

from .make import curve, white


def clock(duration_s: float, rate_hz: float = 100.0) -> Any:
    return np.arange(round(duration_s * rate_hz)) / rate_hz


def rise(t: Any, tau1: float = 0.3, tau2: float = 2.0) -> Any:
    return curve(t, tau1, tau2)


def on(at_s: float, level: float, t: Any) -> Any:
    return np.where(t >= at_s - 1e-9, level, 0.0)


T = clock(12)
STEP = 2 * rise(T - 3)
ON = {"time_s": T, "duty_pct": on(3, 60, T)}
TRUTH = {"change": 2.0, "tau1": 0.3}


def plain(torque: Any, noise: float = 0.01) -> dict[str, Any]:
    """60 % at 3 s, and a torque."""
    return {**ON, "torque_Nm": torque + white(1200, noise)}


def named(**columns: str) -> tuple[str, ...]:
    return ("--columns", ",".join(f"{role}={column}" for role, column in columns.items()))


T14, T30, HEAT = clock(14), clock(30), clock(900, 1)
QUICK = clock(12, 500)
S = np.maximum(T14 - 3, 0)
RIGHT: dict[str, tuple[Mapping[str, Any], tuple[str, ...], dict[str, float]]] = {
    "a motor whose idle wanders": (
        {"time_s": T30, "pwm_pct": on(12, 60, T30),
         "speed_out": 1340 * np.clip(T30 - 4, 0, 1) + 782 * rise(T30 - 12) + white(3000, 3)},
        (*named(input="pwm_pct", output="speed_out"), "--units", "output=rpm"), {"change": 782, "tau1": 0.3}),
    "a heater with a dead time": (
        {"Time": HEAT, "Q1": on(1, 50, HEAT),
         "T1": 21 - 35 * np.expm1(-np.maximum(HEAT - 16, 0) / 150) + white(900, 0.1)},
        (*named(input="Q1", output="T1"), "--units", "output=°C"), {"change": 35, "tau1": 150, "dead_time_s": 15}),
    "a heater that is on from the first row": (
        {"Time": HEAT, "Q1": 50 + 0 * HEAT, "T1": np.round(20.6 - 31 * np.expm1(-HEAT / 140), 2)},
        (*named(input="Q1", output="T1"), "--units", "input=%,output=°C"), {"change": 31, "tau1": 140, "start": 20.6}),
    "a trigger, the level in the name run_150V.csv": (
        {"time_s": T, "trigger": on(3, 1, T), "torque_Nm": STEP + white(1200, 0.01)}, ("--name-pattern", "_{level}V"),
        TRUTH | {"level": 150}),
    "it begins under load and is let go": (
        {"time_s": T, "duty_pct": 60 - on(5, 60, T), "torque_Nm": 2 - 2 * rise(T - 5, 0.1, 0.8) + white(1200, 0.01)},
        (), {"change": -2.0, "tau1": 0.1}),

    "hum of 50 Hz": (
        {"time_s": QUICK, "duty_pct": on(3, 60, QUICK),
         "torque_Nm": 2 * rise(QUICK - 3) + 0.1 * np.sin(100 * np.pi * QUICK + 0.5) + white(6000, 0.005)}, (), TRUTH),
    "a rest at 1 V": (
        {"time_s": T14, "voltage_V": 1 + on(4, 4, T14), "torque_Nm": 1 + 2 * rise(T14 - 4) + white(1400, 0.01)}, (),
        TRUTH | {"from": 1.0, "gain": 0.5}),
}  # fmt: skip
TOLD: dict[str, tuple[Mapping[str, Any], set[str]]] = {
    "a second order that swings": (
        {"time_s": T14, "duty_pct": on(3, 60, T14),
         "torque_Nm": 1 - np.exp(-S) * (np.cos(4 * S) + 0.25 * np.sin(4 * S)) + white(1400, 0.005)},
        {"kind-by-evidence"}),
    "an output that does not move": (plain(0 * T), {"curve-explains-little"}),
    "an output of its own": (plain(np.sin(1.9 * T), 0.05), {"shape-explains-little"}),
}  # fmt: skip


def fitted(columns: Mapping[str, Any], options: tuple[str, ...], folder: Path, run: Callable[..., Any]) -> Any:
    pd.DataFrame(columns).to_csv(path := folder / "run_150V.csv", index=False)
    ran = run("fit", path, *options, "-o", folder / "fit.json")
    return ran, json.loads((folder / "fit.json").read_text(encoding="utf-8"))


@pytest.mark.parametrize("name", RIGHT)
def test_a_rig_whose_numbers_are_right(name: str, tmp_path: Path, run_eaid: Callable[..., Any]) -> None:
    columns, options, truth = RIGHT[name]
    ran, fit = fitted(columns, options, tmp_path, run_eaid)
    assert ran.code == 0, ran.err
    step = next(one for one in fit["steps"] if one["from"] == truth.get("from", one["from"]))
    assert {key: step[key] for key in truth} == {key: pytest.approx(value, rel=0.06) for key, value in truth.items()}
    for key in ("change", "tau1"):
        if step["ci95"][key] is not None:
            low, high = step["ci95"][key]
            assert low - 0.5 * (high - low) <= truth[key] <= high + 0.5 * (high - low), key


@pytest.mark.parametrize("name", TOLD)
def test_a_rig_that_is_told_what_is_wrong(name: str, tmp_path: Path, run_eaid: Callable[..., Any]) -> None:
    columns, codes = TOLD[name]
    ran, fit = fitted(columns, (), tmp_path, run_eaid)
    found = {one["code"]: one["severity"] for one in fit["findings"]}
    assert codes <= set(found), found
    assert ran.code == (4 if "stop" in found.values() else 0)


def slow(y: Any, tau_s: float, rate_hz: float = 100.0) -> Any:
    """Behind a filter of first order."""
    return lfilter([1 - np.exp(-1 / rate_hz / tau_s)], [1, -np.exp(-1 / rate_hz / tau_s)], y)


REPEATS: dict[str, tuple[Callable[..., Any], int | None, str]] = {
    # (level, repeat, time since the step) → time and output; in which repeat; what is told
    "all alike": (lambda u, s: (s, u * rise(s)), None, ""),
    "late by a row in all": (lambda u, s: (s, u * rise(s - 0.01)), None, "dead-time"),
    "late by 3 rows in one": (lambda u, s: (s, u * rise(s - 0.03)), 1, "starts-apart"),
    "filtered in one": (lambda u, s: (s, slow(u * rise(s), 0.05)), 1, "repeat-is-off"),
    "another rate in one": (lambda u, s: (1.1 * s, u * rise(s)), 1, "repeat-is-off"),
    "early by 3 rows in one": (lambda u, s: (s, u * rise(s + 0.03)), 1, "runs-left-out"),
}  # fmt: skip


@pytest.mark.parametrize("name", REPEATS)
def test_what_one_repeat_has_of_its_own_is_told(name: str) -> None:
    """Three repeats of four levels that scatter by 2 %; what moves τ1 by 4 % or more is told, and of which repeat."""
    change, which, code = REPEATS[name]
    rng, since, logs = np.random.default_rng(3), T - 3, {}
    for level in (20, 45, 70, 95):
        for k in range(3):
            of_run = 0.03 * level * np.exp(0.02 * rng.normal())
            stretch = np.exp(0.02 * rng.normal())
            s, y = change(of_run, since / stretch) if which in (None, k) else (since, of_run * rise(since / stretch))
            time = 3 + s * (stretch if which in (None, k) else 1)
            columns = {"time_s": time - time[0], "duty_pct": on(3, level, T), "torque_nm": y + white(1200, 0.01, k)}
            logs[f"u{level}_{k}"] = pd.DataFrame(columns)
    fit = eaid.fit(eaid.read(logs))
    told = {one.code: one.values for one in fit.findings}
    assert code in told if code else not {"repeat-is-off", "other-shape-fits-better"} & set(told)
    if code == "repeat-is-off":
        assert {run[-1] for run in told[code]["runs"]} == {"1"}
    elif code == "starts-apart":  # 30 ms later than the two others, and 20 than all in the mean
        assert told[code]["run"][-1] == "1" and told[code]["off_ms"] == pytest.approx(20, abs=4)


def test_a_command_and_what_answers_it_are_no_input_and_output():
    """Once T_s 60 (56.6 … 63.6) N·m, τ1 1 ms, "usable yes, next eaid tune-rc"."""
    t = clock(20.0)
    answer = 1.5 * (1 - np.exp(-np.maximum(t - 2, 0.0) / 0.4)) + white(len(t), 0.01, 0)
    logs = {"a": pd.DataFrame({"time_s": t, "duty_pct": answer, "torque_nm": np.where(t >= 2, 60.0, 0.0)})}
    fit = eaid.fit(eaid.read(logs))
    assert not fit.verdict.usable and "columns exchanged" in fit.verdict.sentence
