"""Odd rigs of known truth, each as a new user would type it: right to a few percent, or told, or refused."""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from eaid.arrays import Array
from eaid.cli import main

RANDOM = np.random.default_rng(11)


@dataclass(frozen=True)
class Rig:
    """A log, the options that a user types, the truth of its first step, or the codes of which one has to be said."""

    columns: Mapping[str, Array]
    options: tuple[str, ...] = ()
    truth: Mapping[str, float] = field(default_factory=dict)
    said: tuple[str, ...] = ()
    name: str = "rig.csv"
    header: bool = True


def clock(duration_s: float, rate_hz: float = 100.0) -> Array:
    return np.arange(round(duration_s * rate_hz)) / rate_hz


def rise(t: Array, tau1: float = 0.3, tau2: float = 2.0, share: float = 0.85) -> Array:
    s = np.maximum(t, 0.0)
    return np.asarray(1 - share * np.exp(-s / tau1) - (1 - share) * np.exp(-s / tau2))


def noise(count: int, size: float) -> Array:
    return size * RANDOM.normal(size=count)


def motor() -> Rig:
    """Idle speed that wanders before the step."""
    t = clock(30)
    speed = np.where(t < 4, 0, 1340 * np.clip((t - 4) / 1.0, 0, 1)) + 782 * rise(t - 12) + noise(len(t), 3)
    return Rig(
        {"time_s": t, "pwm_pct": np.where(t >= 12, 60.0, 0.0), "speed_out": speed},
        ("--columns", "input=pwm_pct,output=speed_out", "--units", "output=rpm"), {"change": 782, "tau1": 0.3},
    )  # fmt: skip


def heater(dead: float = 15.0) -> Rig:
    t = clock(900, 1)
    y = 21 + 35 * -np.expm1(-np.maximum(t - 1 - dead, 0) / 150) + noise(900, 0.1)
    return Rig(
        {"Time": t, "Q1": np.where(t >= 1, 50.0, 0.0), "T1": y},
        ("--columns", "input=Q1,output=T1", "--units", "output=°C"), {"change": 35, "tau1": 150, "dead_time_s": dead},
    )  # fmt: skip


def heater_from_the_first_row() -> Rig:
    t = clock(900, 1)
    y = np.round(20.6 - 31 * np.expm1(-t / 140), 2)
    return Rig(
        {"Time": t, "Q1": np.full(900, 50.0), "T1": y},
        ("--columns", "input=Q1,output=T1", "--units", "input=%,output=°C"), {"change": 31, "tau1": 140, "start": 20.6},
    )  # fmt: skip


def lamp() -> Rig:
    t = clock(20, 200)
    u = np.select([t < 4, t < 9, t < 14], [0, 50, 100], 200).astype(float)
    y = 1.5 * rise(t - 4, 0.05, 0.4) + 0.5 * rise(t - 9, 0.05, 0.4) + 0.7 * rise(t - 14, 0.05, 0.4)
    return Rig(
        {"t": t, "pwm": u, "volt_out": y + noise(len(t), 0.003)},
        ("--columns", "time=t,input=pwm,output=volt_out", "--units", "input=/255,output=V"),
        {"change": 1.5, "tau1": 0.05, "level": 50 / 2.55},
    )  # fmt: skip


def cooling() -> Rig:
    """A fan that cools: the output falls at the step, and stays lower."""
    t = clock(600, 2)
    y = 60 - 25 * rise(t - 60, 40, 200) + noise(len(t), 0.05)
    return Rig(
        {"time_s": t, "fan_pct": np.where(t >= 60, 80.0, 0.0), "temp": y},
        ("--columns", "input=fan_pct,output=temp", "--units", "output=°C"), {"change": -25, "tau1": 40},
    )  # fmt: skip


def propeller() -> Rig:
    t = clock(12, 500)
    y = 4.2 * rise(t - 3, 0.15, 0.9) * (1 + 0.05 * np.sin(2 * np.pi * 60 * t))
    return Rig(
        {"time_ms": 1000 * t, "throttle_pct": np.where(t >= 3, 70.0, 0.0), "thrust_N": y + noise(len(t), 0.05)},
        ("--columns", "input=throttle_pct,output=thrust_N"), {"change": 4.2, "tau1": 0.15},
    )  # fmt: skip


def trigger_and_name() -> Rig:
    t = clock(12)
    y = 2.0 * rise(t - 3) + noise(len(t), 0.01)
    return Rig(
        {"time_s": t, "trigger": np.where(t >= 3, 1.0, 0.0), "torque_Nm": y}, ("--name-pattern", "_{level}V"),
        {"change": 2.0, "tau1": 0.3, "level": 150}, name="run_150V.csv",
    )  # fmt: skip


def constant_third_column() -> Rig:
    t = clock(12)
    return Rig(
        {"time_s": t, "current_A": np.where(t >= 3, 0.8, 0.0), "speed_rpm": np.full(len(t), 15.0),
         "torque_Nm": 1.2 * rise(t - 3) + noise(len(t), 0.005)}, (), {"change": 1.2, "tau1": 0.3, "level": 0.8},
    )  # fmt: skip


def adc_counts() -> Rig:
    t = clock(12)
    y = np.round(512 + 300 * rise(t - 3) + noise(len(t), 1.0))
    return Rig(
        {"time_s": t, "pwm": np.where(t >= 3, 128.0, 0.0), "adc": y},
        ("--columns", "input=pwm,output=adc", "--units", "input=/255"), {"change": 300, "tau1": 0.3},
    )  # fmt: skip


def grams() -> Rig:
    t = clock(12)
    return Rig(
        {"time_s": t, "voltage_V": np.where(t >= 3, 200.0, 0.0), "Load Cell [g]": 500 * rise(t - 3) + noise(len(t), 1)},
        (), {"change": 0.5 * 9.80665, "tau1": 0.3},
    )  # fmt: skip


def clock_in(factor: float, unit: str) -> Rig:
    t = clock(12)
    y = 2 * rise(t - 3) + noise(1200, 0.01)
    return Rig(
        {"t": np.round(t * factor), "duty_pct": np.where(t >= 3, 40.0, 0.0), "torque_Nm": y},
        ("--units", f"time={unit}"), {"change": 2.0, "tau1": 0.3},
    )  # fmt: skip


def no_names() -> Rig:
    t = clock(12)
    return Rig(
        {"a": t, "b": np.full(1200, 7.0), "c": 2 * rise(t - 3) + noise(1200, 0.01), "d": np.where(t >= 3, 5.0, 0.0)},
        ("--columns", "time=1,input=4,output=3"), {"change": 2.0, "tau1": 0.3, "level": 5.0}, header=False,
    )  # fmt: skip


def falling_only() -> Rig:
    """It begins under load and is let go."""
    t = clock(15)
    y = 2.0 * (1 - rise(t - 5, 0.1, 0.8)) + noise(1500, 0.01)
    return Rig({"time_s": t, "duty_pct": np.where(t < 5, 60.0, 0.0), "torque_Nm": y}, (), {"change": -2.0, "tau1": 0.1})


def drift() -> Rig:
    t = clock(30)
    y = 2 * rise(t - 15) + 0.05 * t + noise(3000, 0.01)
    return Rig(
        {"time_s": t, "duty_pct": np.where(t >= 15, 60.0, 0.0), "torque_Nm": y},
        (), said=("idle-drifts", "other-shape-fits-better"),
    )  # fmt: skip


def saturated() -> Rig:
    t = clock(12)
    y = np.minimum(2 * rise(t - 3, 0.6, 2.0) + noise(1200, 0.01), 1.2)
    return Rig({"time_s": t, "duty_pct": np.where(t >= 3, 60.0, 0.0), "torque_Nm": y}, (), said=("saturated",))


def saturated_behind_noise() -> Rig:
    t = clock(12)
    y = np.minimum(2 * rise(t - 3, 0.6, 2.0), 1.2) + noise(1200, 0.01)
    return Rig({"time_s": t, "duty_pct": np.where(t >= 3, 60.0, 0.0), "torque_Nm": y}, (), said=("flat-topped",))


def quantised(steps: float) -> Rig:
    t = clock(12)
    y = np.round(2 * rise(t - 3) * steps / 2) * 2 / steps
    columns = {"time_s": t, "duty_pct": np.where(t >= 3, 60.0, 0.0), "torque_Nm": y}
    if steps < 20:
        return Rig(columns, (), said=("coarse-output",))
    return Rig(columns, (), {"change": 2.0, "tau1": 0.3})


def input_late(late_s: float) -> Rig:
    t = clock(12)
    u = np.where(t >= 3 + late_s - 1e-9, 60.0, 0.0)
    return Rig(
        {"time_s": t, "duty_pct": u, "torque_Nm": 2 * rise(t - 3) + noise(1200, 0.005)},
        (),
        said=("not-at-rest", "nearly-at-rest"),
    )


def output_late() -> Rig:
    """A transport delay of 0.4 s."""
    t = clock(14)
    return Rig(
        {"time_s": t, "duty_pct": np.where(t >= 3, 60.0, 0.0), "torque_Nm": 2 * rise(t - 3.4) + noise(1400, 0.005)},
        (), {"change": 2.0, "tau1": 0.3, "dead_time_s": 0.4},
    )  # fmt: skip


def underdamped() -> Rig:
    t = clock(14)
    s = np.maximum(t - 3, 0)
    y = 1 - np.exp(-s) * (np.cos(4 * s) + 0.25 * np.sin(4 * s))
    return Rig(
        {"time_s": t, "duty_pct": np.where(t >= 3, 60.0, 0.0), "torque_Nm": y + noise(1400, 0.005)}, (),
        said=("shape-misses", "several-edges"),
    )  # fmt: skip


def staircase_down() -> Rig:
    t = clock(32)
    u = np.select([t < 8, t < 16, t < 24], [80.0, 50.0, 30.0], 10.0)
    y = 3.2 - 1.2 * rise(t - 8) - 0.8 * rise(t - 16) - 0.8 * rise(t - 24)
    return Rig(
        {"time_s": t, "duty_pct": u, "torque_Nm": y + noise(3200, 0.005)},
        ("--logs-as", "steps"),
        {"change": -1.2, "tau1": 0.3, "from": 80.0},
    )


def inverted_wiring() -> Rig:
    t = clock(12)
    return Rig(
        {"time_s": t, "duty_pct": np.where(t >= 3, 60.0, 0.0), "torque_Nm": 0.4 - 2 * rise(t - 3) + noise(1200, 0.01)},
        (), {"change": -2.0, "tau1": 0.3}, ("signs-turned",),
    )  # fmt: skip


def offset_input() -> Rig:
    """Rest at 1 V, steps from there to 5 V."""
    t = clock(14)
    y = 1 + 2 * rise(t - 4) + noise(1400, 0.01)
    return Rig(
        {"time_s": t, "voltage_V": np.where(t >= 4, 5.0, 1.0), "torque_Nm": y}, (),
        {"change": 2.0, "tau1": 0.3, "from": 1.0, "gain": 0.5},
    )  # fmt: skip


def hum() -> Rig:
    t = clock(12, 1000)
    y = 2 * rise(t - 3) + 0.1 * np.sin(2 * np.pi * 50 * t) + noise(12000, 0.005)
    return Rig({"time_s": t, "duty_pct": np.where(t >= 3, 60.0, 0.0), "torque_Nm": y}, (), {"change": 2.0, "tau1": 0.3})


def nothing_happens() -> Rig:
    t = clock(12)
    return Rig(
        {"time_s": t, "duty_pct": np.where(t >= 3, 60.0, 0.0), "torque_Nm": noise(1200, 0.01)}, (),
        said=("shape-explains-little", "curve-explains-little", "refused"),
    )  # fmt: skip


def two_loads() -> Rig:
    """Somebody bumps the rig twice under hold."""
    t = clock(20)
    y = (
        2 * rise(t - 3)
        + np.where((t > 8) & (t < 9), 1.5, 0)
        + np.where((t > 13) & (t < 14), -1.5, 0)
        + noise(2000, 0.01)
    )
    return Rig({"time_s": t, "duty_pct": np.where(t >= 3, 60.0, 0.0), "torque_Nm": y}, (), said=("several-edges",))


RIGS: dict[str, Callable[[], Rig]] = {
    "motor whose idle wanders": motor,
    "heater with a dead time": heater,
    "heater on from its first row": heater_from_the_first_row,
    "lamp on a staircase": lamp,
    "cooling fan": cooling,
    "propeller with ripple, ms": propeller,
    "trigger column, level in the name": trigger_and_name,
    "constant third column": constant_third_column,
    "ADC counts": adc_counts,
    "load cell in grams": grams,
    "clock in ms": lambda: clock_in(1e3, "ms"),
    "clock in µs": lambda: clock_in(1e6, "us"),
    "matrix without names": no_names,
    "falling only": falling_only,
    "drift": drift,
    "saturated": saturated,
    "saturated behind noise": saturated_behind_noise,
    "12 steps of the sensor": lambda: quantised(12),
    "80 steps of the sensor": lambda: quantised(80),
    "input 20 ms late": lambda: input_late(0.02),
    "input 0.1 s late": lambda: input_late(0.1),
    "output 0.4 s late": output_late,
    "underdamped": underdamped,
    "staircase down": staircase_down,
    "inverted wiring": inverted_wiring,
    "rest at 1 V": offset_input,
    "hum of 50 Hz": hum,
    "an output that does not move": nothing_happens,
    "bumped twice": two_loads,
}


def fitted(rig: Rig, folder: Path, capsys: pytest.CaptureFixture[str]) -> tuple[int, dict[str, Any], str]:
    path = folder / rig.name
    head = ",".join(rig.columns) if rig.header else ""
    np.savetxt(path, np.stack([*rig.columns.values()], axis=1), fmt="%.9g", delimiter=",", header=head, comments="")
    code = main.run(["fit", str(path), *rig.options, "-o", str(folder / "fit.json")])
    told = capsys.readouterr()
    out = folder / "fit.json"
    return code, json.loads(out.read_text()) if out.exists() else {}, told.out + told.err


@pytest.mark.parametrize("name", RIGS)
def test_no_wrong_number_in_silence(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rig = RIGS[name]()
    code, fit, told = fitted(rig, tmp_path, capsys)
    codes = {one["code"] for one in fit.get("findings", ())} | ({"refused"} if code == 3 else set())
    if rig.said:
        assert codes & set(rig.said), told
    if rig.truth:
        assert code == 0, told
        step = next(one for one in fit["steps"] if one["from"] == rig.truth.get("from", one["from"]))
        for key, value in rig.truth.items():
            assert step[key] == pytest.approx(value, rel=0.06), (key, step)
        for key in ("change", "tau1"):
            if step["ci95"][key] is not None and key in rig.truth:
                low, high = step["ci95"][key]
                assert low - 0.5 * (high - low) <= rig.truth[key] <= high + 0.5 * (high - low), key
