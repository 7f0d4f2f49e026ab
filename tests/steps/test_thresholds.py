"""Both sides of each threshold: what lies just below says nothing, what lies just above does."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from eaid.apparatus import Apparatus
from eaid.arrays import read_only
from eaid.errors import DataError
from eaid.findings import Finding
from eaid.logs.run import Run
from eaid.steps.baseline import BaselineRule
from eaid.steps.build import build_stepset, direction
from eaid.steps.cut import StepOptions, cut
from eaid.steps.edges import edges, moving, several_edges, turns
from eaid.steps.levels import common
from eaid.steps.plateaus import bridge, plateaus, stands_still, tolerance
from eaid.steps.step import Step, clock_of, uniform_step

sys.path.insert(0, str(Path(__file__).parent))
from make import curve, log

PLAN = [(0.0, 4.0), (50.0, 8.0)]


def codes(run: Run, rule: BaselineRule | None = None) -> list[str]:
    stepset = build_stepset([run], StepOptions(baseline=rule or BaselineRule()))
    return [one.code for one in stepset.runs[0].findings]


@pytest.mark.parametrize(("share", "said"), [(0.019, None), (0.021, "not-at-rest")])
def test_how_far_from_rest(share: float, said: str | None) -> None:
    """The last 0.1 s before the step are off by a share of the swing."""
    run = log(PLAN)
    swing = 2.0 * float(curve(np.array([7.8])).item())
    y = run.output + np.where((run.time_s >= 3.9) & (run.time_s < 4), share * swing, 0.0)
    found = [code for code in codes(replace(run, output=read_only(y))) if code.endswith("at-rest")]
    assert found == ([] if said is None else [said])


@pytest.mark.parametrize(("sample_s", "said"), [(0.9, False), (1.1, True)])
def test_slow_clock(sample_s: float, said: bool) -> None:
    run = log(PLAN)
    assert ("slow-clock" in codes(replace(run, time_s=read_only(np.arange(1200) * sample_s)))) is said


@pytest.mark.parametrize(("gap_s", "said"), [(0.045, False), (0.055, True)])
def test_gap(gap_s: float, said: bool) -> None:
    run = log(PLAN)
    time = np.where(np.arange(1200) >= 900, run.time_s + gap_s - 0.01, run.time_s)
    assert ("gap" in codes(replace(run, time_s=read_only(time)))) is said


@pytest.mark.parametrize(("off", "uniform"), [(1.8e-3, True), (2.2e-3, False)])
def test_uniform_within_two_thousandths(off: float, uniform: bool) -> None:
    time = np.arange(100) * 0.01
    time[50] += off * 0.01
    assert (uniform_step(time) is not None) is uniform


@pytest.mark.parametrize(("spread", "said"), [(0.19, False), (0.24, True)])
def test_jitter(spread: float, said: bool) -> None:
    gaps = 1e-3 * (1 + spread * np.tile([0.0, 1.0, 0.5, 0.5], 500))
    assert (clock_of(np.cumsum(gaps)).spread_s is not None) is said


@pytest.mark.parametrize(("drift", "said"), [(0.036, False), (0.048, True)])
def test_idle_drift(drift: float, said: bool) -> None:
    run = log(PLAN)
    y = run.output + np.where(run.time_s < 4, drift * (run.time_s / 4 - 1), 0.0)
    assert ("idle-drifts" in codes(replace(run, output=read_only(y)))) is said


@pytest.mark.parametrize(("wiggle", "count"), [(0.9, 2), (1.1, 3)])
def test_plateaus_within_one_percent_of_the_range(wiggle: float, count: int) -> None:
    u = np.concatenate([np.zeros(100), np.full(100, 100.0), np.full(100, 100.0 - wiggle)])
    assert tolerance(u) == 1.0
    assert len(plateaus(u)) == count


def test_tolerance_is_six_times_the_noise() -> None:
    u = np.where(np.arange(4000) < 2000, 0.0, 1.0) + 0.05 * np.random.default_rng(0).normal(size=4000)
    assert tolerance(u) == pytest.approx(0.3, rel=0.1)


@pytest.mark.parametrize(("samples", "passed"), [(3, 3), (4, 0)])
def test_glitches_up_to_three_samples(samples: int, passed: int) -> None:
    u = np.full(300, 50.0)
    u[100 : 100 + samples] = 0.0
    assert bridge(plateaus(u))[1] == passed


def test_a_ramp_with_noise_stands_not_still() -> None:
    u = np.linspace(0, 100, 20_000) + np.random.default_rng(0).normal(size=20_000)
    assert not stands_still(plateaus(u), u)
    held = np.repeat([0.0, 50.0], 10_000) + np.random.default_rng(0).normal(size=20_000)
    assert stands_still(plateaus(held), held)


def test_behind_a_hold_the_last_quarter_and_one_sample_is_the_rest() -> None:
    run = log([(0, 3), (30, 4), (0, 8), (60, 4)])
    late = replace(run, output=read_only(run.output + np.where(run.time_s < 12.9, 0.004 * (run.time_s > 7), 0.0)))
    rising = [step for step in cut(late) if step.edge == "rising"]
    assert rising[1].baseline == pytest.approx(float(late.output[1500 - 201 : 1500].mean()), abs=1e-15)


def test_the_grid_ends_with_the_shortest_record() -> None:
    """Its last sample is the last that all records reach, and it has no more samples than the longest record."""
    runs = [log([(0, 2), (50, 6)], rate_hz=rate, name=f"r{rate}") for rate in (100.0, 250.0)]
    way = direction([step for run in runs for step in cut(run)])
    level = common([Step(step, way.of(step)) for run in runs for step in cut(run)])
    assert level.time_s[-1] == pytest.approx(5.988, abs=1e-9)  # 0.004 s · 1497 ≤ 5.99 s < 0.004 s · 1498
    assert len(level.time_s) == 1498
    uneven = log([(0, 2), (50, 6)])
    time = uneven.time_s.copy()
    time[300:] = np.linspace(3.0, 3000.0, 500)  # most of it slow: its usual sample time fits it badly
    other = replace(uneven, name="b", time_s=read_only(time))
    both = [Step(step) for run in (replace(uneven, name="a"), other) for step in cut(run)]
    assert len(common(both).time_s) <= 600


@pytest.mark.parametrize(("back", "count"), [(0.13, 1), (0.2, 2), (0.6, 2)])
def test_an_edge_that_comes_back(back: float, count: int) -> None:
    t = np.arange(2000) / 100
    y = np.where(t < 2, 0.0, 1.0) - np.where(t > 12, back, 0.0)
    assert len(edges(t, y)) == count


def test_edges_by_hand() -> None:
    t = np.arange(8000) / 1000
    up = np.where(t >= 2, 1 - np.exp(-(t - 2).clip(0) / 0.1) * np.cos(20 * (t - 2).clip(0)), 0.0)
    down = np.where(t >= 5, 1 - np.exp(-(t - 5).clip(0) / 0.05), 0.0)
    first, second = edges(t, up - down)
    assert (first.before, first.after) == pytest.approx((0.0, 1.0), abs=1e-3)
    assert first.overshoot_pct == pytest.approx(100 * np.exp(-0.1345 / 0.1) * -np.cos(20 * 0.1345), abs=2)
    assert second.rise_s == pytest.approx(0.05 * np.log(9), abs=0.025)
    assert second.settling_s == pytest.approx(0.05 * np.log(0.9 / 0.05), abs=0.025)
    assert second.at_s == pytest.approx(5.0, abs=0.03)


@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_a_swing_by_more_than_half_is_an_overshoot_of_one_edge(noise: float) -> None:
    """From 2.2 down to 0.75 and back up to 1.5, as a loop whose integrator wound up: 107 % beyond its end."""
    t = np.arange(3500) / 1000
    y = 1.5 + 0.7 * (1 + np.tanh((1.45 - t) / 0.03)) / 2 - 0.75 * np.exp(-(((t - 1.55) / 0.05) ** 2))
    (one,) = edges(t, y + noise * np.random.default_rng(0).normal(size=len(t)))
    assert (one.before, one.after, one.swings) == (pytest.approx(2.2, abs=0.02), pytest.approx(1.5, abs=0.02), 2)
    assert one.overshoot_pct == pytest.approx(100 * 0.75 / 0.7, abs=6)
    assert one.settling_s == pytest.approx(1.55 + 0.05 * np.sqrt(np.log(0.75 / 0.035)) - 1.41, abs=0.04)
    assert several_edges("a", t, y) is not None


def test_a_wave_that_never_rests_is_no_overshoot() -> None:
    t = np.arange(4000) / 1000
    assert len(edges(t, np.sin(2 * np.pi * t))) >= 6


def test_turns() -> None:
    values = np.array([0.0, 3.0, 1.0, 4.0, 0.0, 0.5, 0.0, 4.0])
    assert turns(values, 2.5) == [0, 3, 4, 7]
    assert turns(values, 1.5) == [0, 1, 2, 3, 4, 7]
    assert turns(np.array([0.0, 1.0, 2.0]), 1.0) == [0, 2]
    assert turns(np.array([0.0, 2.0, 1.0, 2.0, 0.0]), 1.0) == [0, 1, 2, 3, 4]  # as much as is wanted is enough
    assert turns(np.array([0.0, 2.0, 1.0, 2.0, 0.0]), 1.01) == [0, 1, 4]


@pytest.mark.parametrize(("value", "said"), [(100.5, "above 100"), (-0.5, "below 0")])
def test_a_duty_beyond_its_range_is_refused(value: float, said: str) -> None:
    run = log(PLAN)
    duty = run.input.copy()
    duty[700] = value
    with pytest.raises(DataError, match=said):
        cut(replace(run, input=read_only(duty)))
    assert cut(replace(run, input=read_only(np.where(run.input > 0, 100.0, 0.0))))[0].level == 100.0


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
def test_a_window_that_is_too_short_whatever_the_unit(size: float) -> None:
    """τ2 of 8 s in a window of 8 s; it is named where the record tells it to five windows."""
    run = log(PLAN, tau2=8.0, noise=1e-4)
    (said,) = (one for one in _findings(run, size) if one.code == "window-too-short")
    assert said.values["window_s"] == pytest.approx(7.99, abs=0.02)
    assert said.values["tau2_s"] == pytest.approx(8.0, rel=0.25)
    run = log(PLAN, tau1=0.1, tau2=0.1)
    straight = replace(run, output=read_only(run.output + 0.05 * np.clip(run.time_s - 4, 0, None)))
    (said,) = (one for one in _findings(straight, size) if one.code == "window-too-short")
    assert said.values["tau2_s"] is None
    assert not [one for one in _findings(log(PLAN), size) if one.code == "window-too-short"]


def _findings(run: Run, size: float) -> tuple[Finding, ...]:
    return build_stepset([replace(run, output=read_only(size * run.output))]).runs[0].findings


@pytest.mark.parametrize(("kind", "surfaces"), [("clutch", 2), ("friction-force", 1), ("friction-speed", 1)])
def test_a_clutch_has_two_surfaces_and_a_friction_rig_one(kind: str, surfaces: int) -> None:
    run = log(PLAN, kind=kind, input_unit="V")
    assert build_stepset([run]).apparatus.surfaces == surfaces


@pytest.mark.parametrize(("left", "releases"), [(0.985, 1), (0.995, 0)])
def test_a_release_behind_a_given_window_comes_back_by_a_hundredth(left: float, releases: int) -> None:
    """A log that begins at its step, its window ended by hand: the idle is 0."""
    time = np.arange(400) * 0.01
    output = np.where(time < 2.0, 1 - np.exp(-(time + 0.01) / 0.05), left)
    run = Run("a", read_only(time), read_only(np.full(400, np.nan)), read_only(output), "%", "N·m", "a.csv", "",
              level=50.0, step_s=0.0, until_s=2.0, kind="clutch")  # fmt: skip
    assert [step.edge for step in cut(run)].count("falling") == releases


def test_two_rigs_are_not_fitted_together() -> None:
    runs = [replace(log(PLAN), name=f"r{k}", apparatus=Apparatus(surfaces=k)) for k in (1, 2)]
    with pytest.raises(DataError, match="the datasets are of different rigs"):
        build_stepset(runs)
    assert build_stepset(runs, StepOptions(apparatus=Apparatus())).apparatus == Apparatus()


def test_an_input_that_turns_by_unequal_halves_is_periodic() -> None:
    time = np.arange(6000) * 0.01
    phase = time % 5.0
    lopsided = 50 - 40 * np.where(phase < 1.5, np.cos(np.pi * phase / 1.5), -np.cos(np.pi * (phase - 1.5) / 3.5))
    found = moving("a", time, lopsided)
    assert found.code == "input-is-periodic" and found.values["hz"] == pytest.approx(0.2, rel=0.02)


def test_a_window_ends_where_the_input_leaves_its_level_also_where_it_is_reached_late() -> None:
    time = np.arange(600) * 0.01
    duty = np.where((time >= 1.0) & (time < 3.0), 50.0, 0.0)
    output = 0.02 * duty
    run = Run("a", read_only(time), read_only(duty), read_only(output), "%", "N·m", "a.csv", "", level=50.0,
              step_s=0.9, kind="clutch")  # fmt: skip
    rise = next(step for step in cut(run) if step.edge == "rising")
    assert rise.time_s[-1] == pytest.approx(2.99)


@pytest.mark.parametrize(
    ("at", "code"), [(38, "reverses"), (42, "is-periodic"), (358, "is-periodic"), (362, "reverses")]
)
def test_the_outer_tenths_of_a_stroke_may_be_curved(at: int, code: str) -> None:
    """A sample off the straight line by 0.1 of the range, in every stroke of 400."""
    places = np.arange(4000)
    strokes = np.abs((places / 400) % 2 - 1) + 0.1 * (places % 400 == at)
    assert moving("a", places / 100, strokes).code == f"input-{code}"


@pytest.mark.parametrize(("share", "sign"), [(0.98, 1.0), (1.02, -1.0)])
def test_what_the_idle_slope_explains_is_no_direction(share: float, sign: float) -> None:
    """Twenty idle samples fall by 1; from their middle, the window's middle is 0.5 + 0.5 · 8/0.19 times as far."""
    output = np.concatenate((-(np.arange(20) + 0.5) / 20, np.full(801, -1.5 * share * (0.5 + 0.5 * 8 / 0.19))))
    time = np.arange(821) / 100
    run = replace(log(PLAN).part(slice(821)), time_s=read_only(time), output=read_only(output))
    run = replace(run, step_s=0.2, level=50.0, baseline=0.0, cut=True)
    assert direction([run]).signs[False] == sign
