"""The numbers that each doubt of a run names, worked out by hand."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from eaid.arrays import Array, read_only
from eaid.findings import Finding
from eaid.logs.run import Run
from eaid.steps.build import build_stepset
from eaid.steps.cut import StepOptions, settled_steps

sys.path.insert(0, str(Path(__file__).parent))
from make import curve, log

PLAN = [(0.0, 4.0), (50.0, 8.0)]
RUN = log(PLAN)
SWING = 2.0 * float(curve(np.arange(760, 800) / 100).mean())
"""The mean of the last of twenty blocks."""


def said(run: Run, code: str, name: str = "a") -> Finding:
    (row,) = (row for row in build_stepset([run]).runs if row.name == name)
    (one,) = (one for one in row.findings if one.code == code)
    return one


def moved(change: Array, run: Run = RUN) -> Run:
    return replace(run, output=read_only(run.output + change))


def test_a_step_in_a_gap() -> None:
    """0.41 s are missing about the step at 4 s; behind them the output has risen for 0.2 s."""
    keep = (RUN.time_s < 3.795) | (RUN.time_s > 4.195)
    run = replace(
        RUN, time_s=read_only(RUN.time_s[keep]), input=read_only(RUN.input[keep]), output=read_only(RUN.output[keep])
    )
    found = said(run, "step-in-gap").values
    assert found["at_s"] == pytest.approx(3.79) and found["gap_s"] == pytest.approx(0.41)
    assert found["moved_pct"] == pytest.approx(100 * 2 * float(curve(np.array([0.2])).item()) / SWING, rel=1e-3)


def test_a_gap_behind_the_step() -> None:
    late = replace(RUN, time_s=read_only(RUN.time_s + np.where(np.arange(1200) >= 900, 0.25, 0.0)))
    assert said(late, "gap").values == pytest.approx({"gap_s": 0.26, "at_s": 8.99, "sample_s": 0.01})


def test_a_clock_in_milliseconds() -> None:
    slow = replace(RUN, time_s=read_only(RUN.time_s * 1000))
    assert said(slow, "slow-clock").values == pytest.approx({"sample_s": 10.0})


def test_an_idle_that_drifts() -> None:
    """0.1 over the 4 s before the step, 0.2 more by the end of the 8 s behind it; counted from its last half."""
    run = moved(np.where(RUN.time_s < 4, 0.025 * (RUN.time_s - 4), 0.0))
    found = said(run, "idle-drifts").values
    assert found["drift"] == pytest.approx(0.1, rel=1e-9) and found["grown"] == pytest.approx(0.2, rel=1e-9)
    assert found["share_pct"] == pytest.approx(100 * 0.1 / (SWING + 0.025), rel=1e-3)
    assert found["by_end_pct"] == pytest.approx(100 * 0.2 / (SWING + 0.025), rel=1e-3)
    down = moved(-np.where(RUN.time_s < 4, 0.025 * (RUN.time_s - 4), 0.0))
    assert said(down, "idle-drifts").values["drift"] == pytest.approx(-0.1, rel=1e-9)
    assert said(down, "idle-drifts").values["share_pct"] == pytest.approx(100 * 0.1 / (SWING - 0.025), rel=1e-3)


def test_a_level_said_otherwise() -> None:
    found = said(replace(RUN, level=55.0, step_s=4.0), "level-contradicts-input")
    assert found.values == {"said": 55.0, "held": 50.0, "unit": "%"}


def test_a_spike_and_the_largest_of_two() -> None:
    y = np.zeros(1200)
    y[600], y[700] = 5.0, 7.0
    found = said(moved(y), "spikes").values
    top = 7.0 + 2 * float(curve(np.array([3.0])).item())
    assert found == {"samples": 2, "value": pytest.approx(top), "unit": "N·m", "at_s": pytest.approx(7.0)}


def test_a_coarse_output() -> None:
    found = said(replace(RUN, output=read_only(np.round(RUN.output / 0.125) * 0.125)), "coarse-output").values
    assert found == {"resolution": 0.125, "unit": "N·m", "steps": pytest.approx(16.0)}


def test_a_sensor_that_stands_still() -> None:
    run = log(PLAN, noise=0.01)
    y = run.output.copy()
    y[700:900] = 1.75
    found = said(replace(run, output=read_only(y)), "sensor-stuck").values
    assert found == {"for_s": pytest.approx(1.99), "at_s": pytest.approx(7.0), "value": 1.75, "unit": "N·m"}


def test_a_saturated_output_from_above_and_below() -> None:
    clipped = replace(RUN, output=read_only(np.minimum(RUN.output, 1.5)))
    found = said(clipped, "saturated").values
    assert found == {"samples": int((RUN.output >= 1.5).sum()), "limit": 1.5, "unit": "N·m"}
    below = replace(clipped, output=read_only(-clipped.output))
    assert said(below, "saturated").values == found | {"limit": -1.5}


def test_a_fall_under_hold_and_what_is_left_behind_it() -> None:
    """By 0.05 a second from 8 s on, 0.19 in the last of twenty blocks; the peak is the block before 8 s."""
    run = log([(0, 4), (50, 8), (0, 8)])
    y = np.where(run.time_s < 12, -0.05 * np.maximum(run.time_s - 8, 0), 0.2)
    rising = said(moved(y, run), "decays-under-hold")
    peak = 2 * float(curve(np.arange(360, 400) / 100).mean())
    assert rising.values["lost_pct"] == pytest.approx(100 * (peak - (SWING - 0.18975)) / peak, rel=1e-3)
    assert rising.levels == (50.0,)
    left = said(moved(y, run), "left-after-release", "a-release")
    assert left.values["after_s"] == pytest.approx(7.99) and left.levels == (50.0,)
    assert left.values["left_pct"] == pytest.approx(100 * 0.2 / 1.8, rel=0.02)


# an input on its way


def ramped(run: Run, *ramps: tuple[int, int, float, float]) -> Run:
    """An input that goes from sample a to sample b straight from one value to another."""
    u = run.input.copy()
    for a, b, before, after in ramps:
        u[a:b] = before + (after - before) * np.arange(b - a) / (b - a)
    return replace(run, input=read_only(u))


STAIRS = log([(0, 4), (30, 4), (60, 4), (0, 4)], tau1=0.05, tau2=0.05, input_unit="V")


@pytest.mark.parametrize(
    ("ramp", "name", "ramp_s"),
    [
        ((400, 410, 0.0, 30.0), "a", 0.1),
        ((800, 820, 30.0, 60.0), "a-2", 0.19),  # the last sample of the hold before belongs to the step before
        ((1200, 1230, 60.0, 0.0), "a-release", 0.29),
    ],
)
def test_how_long_an_input_was_on_its_way(ramp: tuple[int, int, float, float], name: str, ramp_s: float) -> None:
    """The output answers to where the ramp begins; within 1 % of its range the input is at its ends only."""
    found = said(ramped(STAIRS, ramp), "input-ramps-on", name).values
    assert found["ramp_s"] == pytest.approx(ramp_s)
    assert found["moved_pct"] == pytest.approx(100 * -np.expm1(-(ramp[1] - ramp[0]) / 100 / 0.05), rel=0.01)
    assert "input-ramps-on" not in [one.code for row in build_stepset([STAIRS]).runs for one in row.findings]


def test_how_long_an_input_was_on_its_way_to_an_instant_that_is_given() -> None:
    """From the last sample of the hold at 30 V, at 8 s."""
    run = replace(ramped(STAIRS, (800, 820, 30.0, 60.0)), step_s=8.2)
    assert said(run, "input-ramps-on").values["ramp_s"] == pytest.approx(0.2)


def test_a_ramp_of_one_sample_between_two_holds_is_told_too() -> None:
    """A sample half-way belongs to the step that it leads to; 1 − e^(−1) of that has gone when the input is there."""
    found = said(ramped(replace(STAIRS, output=quick()), (800, 801, 45.0, 45.0)), "input-ramps-on", "a-2").values
    assert found["ramp_s"] == pytest.approx(0.01)
    assert found["moved_pct"] == pytest.approx(100 * -np.expm1(-1), rel=0.01)


def quick() -> Array:
    """The same stairs with 0.01 s."""
    return log([(0, 4), (30, 4), (60, 4), (0, 4)], tau1=0.01, tau2=0.01, input_unit="V").output


@pytest.mark.parametrize(("samples", "count"), [(9, 1), (10, 2)])
def test_ten_samples_are_a_settled_step(samples: int, count: int) -> None:
    run = log([(0, 4), (30, 4), (60, samples / 100)], input_unit="V")
    assert len(settled_steps([run], StepOptions())) == count
