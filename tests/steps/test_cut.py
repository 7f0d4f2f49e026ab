"""Where the steps of a log are: instants, levels, edges, windows, baselines; by formula."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eaid.arrays import read_only
from eaid.errors import DataError
from eaid.logs.run import Run
from eaid.steps.baseline import baseline_rule
from eaid.steps.build import build_stepset
from eaid.steps.cut import StepOptions, cut, onset
from eaid.steps.plateaus import plateaus
from eaid.steps.stepset import RunRecord

sys.path.insert(0, str(Path(__file__).parent))
from make import curve, log


def facts(steps: list[Run]) -> list[tuple[str, float | None, str, float | None, int]]:
    return [(s.name, s.level, s.edge, s.step_s, len(s.time_s)) for s in steps]


def codes(run: Run | RunRecord) -> list[str]:
    return [one.code for one in run.findings]


def test_one_step() -> None:
    (step,) = cut(log([(0, 2), (50, 5)], start_s=25.0, offset=0.3))
    assert (step.level, step.step_s, step.edge, step.from_level) == (50.0, 27.0, "rising", 0.0)
    assert step.baseline == pytest.approx(0.3, abs=1e-12)
    assert len(step.time_s) == 700


def test_release_is_a_run_of_its_own_and_no_sample_comes_twice() -> None:
    run = log([(0, 2), (50, 5), (0, 4)], offset=0.1)
    rising, falling = cut(run)
    assert facts([rising, falling]) == [("a", 50.0, "rising", 2.0, 700), ("a-release", 50.0, "falling", 7.0, 400)]
    assert falling.baseline == rising.baseline
    assert falling.held == pytest.approx(0.1 + 0.04 * 50 * float(curve(np.array([4.87])).item()), rel=1e-3)
    joined = np.concatenate([rising.output, falling.output])
    np.testing.assert_array_equal(joined, run.output)


def test_staircase() -> None:
    steps = cut(log([(0, 1), (20, 2), (60, 2), (100, 2), (0, 2)]))
    assert [(s.level, s.edge, s.from_level) for s in steps] == [
        (20.0, "rising", 0.0),
        (60.0, "rising", 20.0),
        (100.0, "rising", 60.0),
        (100.0, "falling", 0.0),
    ]
    stepset = build_stepset([log([(0, 1), (20, 2), (60, 2), (100, 2), (0, 2)])])
    assert [level.level for level in stepset.levels] == [20.0]  # the others do not start from rest
    (said,) = stepset.findings
    assert (said.code, said.values) == ("level-to-level", {"steps": 2, "of": 4})
    down = build_stepset([log([(0, 1), (60, 4), (20, 4), (0, 4)])])
    assert [(level.level, len(level.names)) for level in (*down.levels, *down.releases)] == [(60.0, 1), (20.0, 1)]
    assert {run.name: codes(run) for run in down.runs}["a-release"] == []  # what is left of it is meant to be left


def test_several_steps_from_rest() -> None:
    plan = [(0, 2), (30, 4), (0, 8), (60, 4), (0, 8), (90, 4)]
    steps = cut(log(plan))
    assert [(s.name, s.level) for s in steps] == [
        ("a", 30.0), ("a-release", 30.0), ("a-2", 60.0), ("a-release-2", 60.0), ("a-3", 90.0),
    ]  # fmt: skip
    stepset = build_stepset([log(plan)])
    assert [level.level for level in stepset.levels] == [30.0, 60.0, 90.0]
    assert [level.level for level in stepset.releases] == [30.0, 60.0]


def test_rest_too_short_is_told() -> None:
    stepset = build_stepset([log([(0, 2), (50, 3), (0, 0.5), (50, 3)], tau1=1.0)])
    (said,) = (one for one in stepset.runs[-1].findings if one.code == "not-at-rest")
    assert (said.severity, said.values["off"]) == ("stop", pytest.approx(1.17, abs=0.03))


def test_both_signs_and_inverted() -> None:
    run = log([(0, 2), (50, 4), (0, 9), (-50, 4), (0, 4)], input_unit="V")
    stepset = build_stepset([run])
    (level,) = stepset.levels
    assert (level.level, len(level.names)) == (50.0, 2)
    np.testing.assert_allclose(level.runs[0], level.runs[1], atol=1e-3)
    assert "input-negative" in [code for run_ in stepset.runs for code in codes(run_)]
    (said,) = stepset.findings
    assert (said.code, said.values) == ("signs-turned", {"runs": 1})


def test_inverted_output_alone() -> None:
    runs = [log([(0, 2), (u, 4)], gain=-0.04, offset=0.2, noise=0.01, name=f"u{u}") for u in (0.1, 50, 80)]
    stepset = build_stepset(runs)
    assert [float(level.mean[-1]) for level in stepset.levels] == pytest.approx([0, 2.0, 3.2], abs=0.1)


def test_ramped_input_begins_at_its_level() -> None:
    run = log([(0, 2), (50, 5)])
    u = run.input.copy()
    u[200:206] = [8, 16, 25, 33, 41, 49]
    (step,) = cut(replace(run, input=read_only(u)))
    assert step.step_s == pytest.approx(2.06)
    assert step.level == pytest.approx(50.0)


def test_slow_ramp_begins_at_its_level() -> None:
    run = log([(0, 2), (50, 8), (0, 3)])
    u = run.input.copy()
    u[200:500] = np.linspace(0, 50, 300)
    rising, falling = cut(replace(run, input=read_only(u)))
    assert rising.step_s == pytest.approx(4.97, abs=0.011)  # within 1 % of the level
    assert (rising.level, falling.step_s) == (50.0, 10.0)


def test_an_input_that_never_stands_still() -> None:
    run = log([(0, 2), (50, 8)])
    wave = replace(run, input=read_only(50 + 40 * np.sin(run.time_s)))
    with pytest.raises(DataError, match="turns 3 times at 0.159 Hz: a periodic excitation holds no steps"):
        cut(wave)


def test_measured_input_with_noise() -> None:
    rng = np.random.default_rng(3)
    run = log([(0, 2), (50, 5), (0, 3)], input_unit="N", kind="friction-force")
    rising, falling = cut(replace(run, input=read_only(run.input + 0.3 * rng.normal(size=len(run.input)))))
    assert (rising.step_s, falling.step_s) == (2.0, 7.0)
    assert rising.level == pytest.approx(50.0, abs=0.1)


def test_glitch_is_passed_over_and_told() -> None:
    run = log([(0, 2), (50, 5)])
    u = run.input.copy()
    u[400:402] = 0
    (step,) = cut(replace(run, input=read_only(u)))
    assert len(step.time_s) == 700
    assert [(one.code, one.values) for one in step.findings] == [("input-glitch", {"samples": 2})]


def test_log_that_begins_high() -> None:
    steps = cut(log([(50, 5), (0, 6), (80, 4)]))
    assert [(s.level, s.edge) for s in steps] == [(50.0, "falling"), (80.0, "rising")]
    assert steps[0].baseline == pytest.approx(0.0, abs=0.01)


def test_step_at_and_until() -> None:
    run = replace(log([(0, 2), (50, 3), (0, 2)]), input=read_only(np.full(700, np.nan)), level=50.0)
    steps = cut(replace(run, step_s=2.0, until_s=5.0))
    assert facts(steps) == [("a", 50.0, "rising", 2.0, 500), ("a-release", 50.0, "falling", 5.0, 200)]
    (whole,) = cut(replace(run, step_s=2.0))
    assert len(whole.time_s) == 700
    (shorter,) = cut(replace(run, step_s=2.0, until_s=4.0, output=log([(0, 2), (50, 5)]).output))
    assert (shorter.edge, len(shorter.time_s)) == ("rising", 400)  # the output stays up: no release behind the window


def test_until_ends_the_window_of_a_log_with_an_input_too() -> None:
    (step,) = cut(replace(log([(0, 2), (50, 5), (0, 2)]), until_s=6.0))
    assert len(step.time_s) == 600
    with pytest.raises(DataError, match="the window ends at -3 s, before the log has begun; mend until="):
        cut(replace(log([(0, 2), (50, 5)]), until_s=-3.0))


def test_release_behind_a_step_found_from_the_output() -> None:
    run = replace(log([(0, 2), (50, 5), (0, 2)]), input=read_only(np.full(900, np.nan)), level=50.0, until_s=7.0)
    rising, falling = cut(run)
    assert rising.step_s == pytest.approx(2.0, abs=0.03)
    assert (falling.step_s, falling.edge) == (7.0, "falling")


def test_a_duty_that_may_be_a_fraction_is_told() -> None:
    stepset = build_stepset([log([(0, 2), (u, 5)], gain=4.0, name=f"u{u}") for u in (0.2, 0.9)])
    assert [one.code for one in stepset.findings] == ["duty-may-be-fraction"]


def test_a_release_that_stands_still_is_read_again() -> None:
    """What is constant in one stored piece was checked with its log."""
    run = log([(0, 2), (50, 5), (0, 2)])
    y = run.output.copy()
    y[700:] = 0.0
    steps = cut(replace(run, output=read_only(y)))
    assert [cut(step)[0].edge for step in steps] == ["rising", "falling"]


def test_dataset_of_a_users_own_script() -> None:
    """Level, step and baseline given, the release still inside: found by the input."""
    run = replace(log([(0, 2), (50, 3), (0, 2)]), level=50.0, step_s=2.0, baseline=0.01)
    steps = cut(run)
    assert facts(steps) == [("a", 50.0, "rising", 2.0, 500), ("a-release", 50.0, "falling", 5.0, 200)]
    assert [s.baseline for s in steps] == [0.01, 0.01]


def test_short_pieces_beside_good_steps() -> None:
    stepset = build_stepset([log([(0, 2), (50, 5), (0, 0.05)])])
    assert len(stepset.runs) == 1
    assert codes(stepset.runs[0]) == ["short-pieces"]


def test_onset_from_the_output_alone() -> None:
    for noise, late in ((0.0, 2), (0.01, 8)):
        run = log([(0, 3), (50, 6)], noise=noise, offset=0.5)
        found = onset(run.output)
        assert found is not None
        assert 300 <= found <= 300 + late
    assert onset(np.random.default_rng(1).normal(size=1000)) is None


def test_friction_with_constant_input() -> None:
    run = log([(86, 60)], kind="friction-speed", input_unit="RPM")
    y = 0.02 + 2.0 * curve(run.time_s - 10.0)
    (step,) = cut(replace(run, output=read_only(y)))
    assert step.level == 86.0
    assert step.step_s == pytest.approx(10.0, abs=0.03)
    assert codes(step) == ["step-from-output"]


@settings(max_examples=60, deadline=None)
@given(
    levels=st.lists(st.sampled_from([10.0, 25.0, 50.0, 75.0, 100.0]), min_size=1, max_size=5),
    holds=st.lists(st.integers(12, 90), min_size=10, max_size=10),
    shift=st.floats(-1e4, 1e4),
)
def test_any_on_off_plan_is_found(levels: list[float], holds: list[int], shift: float) -> None:
    plan: list[tuple[float, float]] = []
    for i, level in enumerate(levels):
        plan += [(0.0, holds[2 * i] / 100), (level, holds[2 * i + 1] / 100)]
    steps = [s for s in cut(log(plan, start_s=shift)) if s.edge == "rising"]
    assert [s.level for s in steps] == levels
    starts = np.cumsum([0.0] + [seconds for _, seconds in plan])[1::2]
    np.testing.assert_allclose([(s.step_s or 0.0) - shift for s in steps], starts, atol=1e-6)


def test_plateaus_of_a_constant() -> None:
    assert [(p.start, p.stop, p.level) for p in plateaus(np.full(5, 3.0))] == [(0, 5, 3.0)]


def test_levels_option_and_its_sentence() -> None:
    runs = [log([(0, 2), (u, 4)], name=f"u{u}") for u in (30, 60, 90)]
    assert [x.level for x in build_stepset(runs, StepOptions(levels="50:100")).levels] == [60.0, 90.0]
    assert [x.level for x in build_stepset(runs, StepOptions(levels="30,90")).levels] == [30.0, 90.0]
    with pytest.raises(DataError, match="no log holds 45; levels found: 30, 60, 90"):
        build_stepset(runs, StepOptions(levels="45"))


def test_baseline_kept() -> None:
    (kept,) = build_stepset([log([(0, 2), (50, 4)], offset=0.3)], StepOptions(baseline=baseline_rule("none"))).levels
    (gone,) = build_stepset([log([(0, 2), (50, 4)], offset=0.3)]).levels
    np.testing.assert_allclose(kept.mean - gone.mean, 0.3, atol=1e-12)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("tau1", "tau2"), [(0.05, 5.0), (0.3, 4.0), (2.0, 20.0)])
@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_a_log_that_begins_at_its_speed_needs_no_step_instant(tau1, tau2, noise, sign):
    t = np.arange(60_000) / 1000 + 3
    curve = 0.85 * -np.expm1(-(t - 3) / tau1) + 0.15 * -np.expm1(-(t - 3) / tau2)
    output = sign * curve + noise * np.random.default_rng(0).standard_normal(len(t))
    (step,) = cut(_speed_log(t, output))
    assert step.step_s == 3.0
    assert step.level == 20
    assert codes(step) == ["step-at-first-sample"]


@pytest.mark.parametrize("idle", [2_000, 10_000])
def test_an_idle_stretch_before_the_step_is_still_seen(idle):
    t = np.arange(60_000) / 1000
    rise = np.maximum(t - t[idle], 0)
    output = (
        0.85 * -np.expm1(-rise / 0.1)
        + 0.15 * -np.expm1(-rise / 5)
        + 0.003 * np.random.default_rng(0).standard_normal(len(t))
    )
    (step,) = cut(_speed_log(t, output))
    assert step.step_s == pytest.approx(t[idle], abs=0.01)
    assert codes(step) == ["step-from-output"]


def test_a_log_that_begins_in_the_middle_of_a_hold_has_no_step():
    t = np.arange(20_000) / 1000
    with pytest.raises(DataError, match="no step stands out"):
        cut(_speed_log(t, 1.0 + 0.01 * np.random.default_rng(0).standard_normal(len(t))))


def _speed_log(t, output):
    facts = {"source": "a.csv", "sha256": "", "kind": "friction-speed"}
    return Run("a", t, np.full(len(t), 20.0), output, "RPM", "N·m", **facts)
