"""Contacts that slip: peak, level after it, stiffness; positions that go to and fro, stroke by stroke."""

from typing import Any

import numpy as np
import pandas as pd
import pytest

from eaid.errors import DataError

from .make import log, read, told, white

T = np.arange(6000) / 2000
LOADED = np.where(T < 0.5, 0.8 * T, 0.3 + 0.1 * np.exp(-(T - 0.5) / 0.2))
"""0.8 per s up to 0.4 at 0.5 s, then down to 0.3 with 0.2 s."""


def slip_of(rise: Any, noise: float = 0.0, seed: int = 0) -> Any:
    """The slip of a contact that is loaded at 60 V from 1 s on."""
    frame = log([(0, 1), (60, 3)], "V", rate_hz=2000.0)
    y = np.concatenate((np.zeros(2000), rise))
    (run,) = read(frame.assign(torque_nm=y + white(8000, noise, seed))).runs
    return run.slip


@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_peak_level_and_stiffness(noise: float) -> None:
    slip = slip_of(LOADED, noise)
    assert (slip.peak, slip.after, slip.stiffness_per_s) == pytest.approx((0.4, 0.3, 0.8), rel=0.03)
    assert slip.peak_s == pytest.approx(0.5, abs=0.03)
    assert (slip.moved, slip.stiffness) == (None, None)


@pytest.mark.parametrize(("over", "slips"), [(0.03, False), (0.12, True)])
def test_a_slip_is_five_percent(over: float, slips: bool) -> None:
    y = np.where(T < 1, T * (1 + over), 1 + over * np.exp(-(T - 1) / 0.3))
    assert (slip_of(y) is not None) is slips


def test_a_settling_step_does_not_slip() -> None:
    assert all(slip_of(1 - np.exp(-T / 0.2), 0.02, seed) is None for seed in range(5))


# strokes

RATE, STROKE_S, SPEED = 200.0, 3.0, 10.0


def strokes(count: int = 7, noise: float = 0.0, peak: float = 0.0) -> pd.DataFrame:
    """Friction of ±5 N at 10 mm/s that turns over within 0.1 s of each reversal, and peaks after 0.6 s; offset 30 N."""
    time = np.arange(round(count * STROKE_S * RATE)) / RATE
    since, way = time % STROKE_S, np.where((time // STROKE_S) % 2 == 0, 1.0, -1.0)
    speed = SPEED * way * np.minimum(1.0, np.minimum(since, STROKE_S - since) / 0.2 + 1e-6)
    position = np.concatenate(([0.0], np.cumsum(speed)[:-1])) / RATE
    force = way * (5.0 - 10.0 * np.exp(-since / 0.1) + peak * np.exp(-((since - 0.6) ** 2) / 0.02))
    force = 30.0 + force + white(len(time), noise)
    return pd.DataFrame({"time_s": time, "pressure_bar": 3.0, "force": force, "position_mm": position})


def cut(frame: pd.DataFrame, name: str = "a", **more: Any) -> Any:
    columns = {"position": "position_mm", "output": "force", "input": "pressure_bar"}
    there = {role: column for role, column in columns.items() if column in frame}
    return read({name: frame}, columns=there, units={"output": "N", "position": "mm"}, kind="friction-force", **more)


@pytest.mark.parametrize("noise", [0.0, 0.05])
def test_each_stroke_is_a_step_of_its_own(noise: float) -> None:
    steps = cut(strokes(noise=noise, peak=2.0))
    assert [run.step_s for run in steps.runs] == pytest.approx([3.0, 6.0, 9.0, 12.0, 15.0, 18.0], abs=0.02)
    assert [run.baseline_nm for run in steps.runs] == pytest.approx([35, 25, 35, 25, 35, 25], abs=0.7)
    assert [run.name for run in steps.runs] == [f"a-{k}" for k in range(1, 7)]
    assert [step.level for step in steps.level_steps] == [3.0] * 3 + [-3.0] * 3
    (level,) = steps.levels
    assert (level.level, len(level.names)) == (3.0, 6)
    assert float(level.mean[-50:].mean()) == pytest.approx(10.0, abs=0.6)
    assert level.time_s[-1] == pytest.approx(STROKE_S - 0.14, abs=0.04)  # until it slows down
    assert told(steps) == ["signs-turned", "cut-at-reversals"]
    assert steps.runs[0].findings[0].values == {"reversals": 6}
    for run in steps.runs:
        assert (run.slip.peak, run.slip.after) == pytest.approx((12.0, 10.0), rel=0.06)
        assert run.slip.moved == pytest.approx(10.0 * (0.6 - 0.1), abs=0.4)  # 0.2 s to its speed
        # 20 to 80 % of the peak in 0.03 to 0.32 s, while it moves by 25 t² mm up to 0.2 s and at 10 mm/s from there
        assert run.slip.stiffness == pytest.approx(7.2 / (1 - 0.02 + 1.2), rel=0.1 if not noise else 0.4)
        assert run.slip.unit == "mm"


@pytest.mark.parametrize("noise", [0.0, 1e-3])
def test_positions_that_do_not_turn(noise: float) -> None:
    frame = strokes()
    still = frame.time_s if noise == 0 else 1.0 + white(len(frame), noise, 1)
    with pytest.raises(DataError, match="its position never turns; leave columns= position out"):
        cut(frame.assign(position_mm=still))


def test_turns_behind_noise() -> None:
    frame = strokes(11)
    steps = cut(frame.assign(position_mm=frame.position_mm + white(len(frame), 0.2, 1)))
    assert [run.step_s for run in steps.runs] == pytest.approx(3.0 * np.arange(1, 11), abs=0.12)
