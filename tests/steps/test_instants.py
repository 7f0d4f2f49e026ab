"""Steps whose instant is given or shows in the output alone, at the edges of what is taken; each by hand."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from eaid.arrays import read_only
from eaid.errors import DataError
from eaid.logs.run import Run
from eaid.steps.build import build_stepset, direction
from eaid.steps.cut import StepOptions, cut_at, cut_by_output, no_level, onset, rises_at_once

sys.path.insert(0, str(Path(__file__).parent))
from make import log

THREE = log([(0, 2), (80, 3), (30, 3)], input_unit="V")
NO_INPUT = replace(THREE, input=read_only(np.full(800, np.nan)), level=80.0)


def shifted(run: Run, start_s: float) -> Run:
    return replace(run, time_s=read_only(run.time_s + start_s))


def test_a_release_behind_the_window_goes_to_where_its_input_goes() -> None:
    """80 → 30 V: the release ends at 30 V, and it is held at the mean of the last twentieth before it."""
    rising, falling = cut_at(THREE, 2.0)
    assert (rising.level, rising.from_level, rising.edge, len(rising.time_s)) == (80.0, 0.0, "rising", 500)
    assert (falling.level, falling.from_level, falling.edge, len(falling.time_s)) == (80.0, 30.0, "falling", 300)
    assert (falling.step_s, falling.name, falling.findings) == (5.0, "a-release", ())
    assert falling.held == pytest.approx(float(THREE.output[485:500].mean()), rel=1e-12)
    (lower,) = (step for step in build_stepset([replace(THREE, step_s=2.0)]).level_steps if step.edge == "down")
    assert (lower.from_level, lower.level) == (80.0, 30.0)


@pytest.mark.parametrize(("left", "to"), [(3.9, 0.0), (4.1, 4.1), (-4.1, -4.1)])
def test_a_release_to_within_a_twentieth_of_the_input_goes_to_rest(left: float, to: float) -> None:
    run = log([(0, 2), (80, 3), (left, 3)], input_unit="V")
    assert cut_at(run, 2.0)[1].from_level == to


@pytest.mark.parametrize(("behind", "edges"), [(-81.0, 1), (81.0, 1), (-79.0, 2), (79.0, 2)])
def test_an_input_that_grows_behind_the_window_is_no_release(behind: float, edges: int) -> None:
    assert len(cut_at(log([(0, 2), (80, 3), (behind, 3)], input_unit="V"), 2.0)) == edges


@pytest.mark.parametrize(("samples", "edges"), [(9, 1), (10, 2)])
def test_a_release_has_ten_samples(samples: int, edges: int) -> None:
    assert len(cut_at(log([(0, 2), (80, 3), (0, samples / 100)]), 2.0)) == edges
    blind = NO_INPUT.part(slice(500 + samples))
    assert len(cut_at(replace(blind, step_s=2.0, until_s=5.0), 2.0)) == edges


def test_the_windows_end_is_a_release_only_where_the_user_says_it_or_the_input_falls() -> None:
    assert [step.edge for step in cut_at(NO_INPUT, 2.0)] == ["rising"]
    assert [step.edge for step in cut_at(replace(NO_INPUT, until_s=5.0), 2.0)] == ["rising", "falling"]
    down = replace(NO_INPUT, output=read_only(-NO_INPUT.output), until_s=5.0)  # the way it goes plays no part
    assert [step.edge for step in cut_at(down, 2.0)] == ["rising", "falling"]


@pytest.mark.parametrize(("start_s", "inside"), [(5e-10, True), (2e-9, False)])
def test_an_instant_is_within_the_log_to_a_billionth_of_a_second(start_s: float, inside: bool) -> None:
    run = shifted(NO_INPUT, start_s)
    if inside:
        assert cut_at(run, 0.0)[0].step_s == start_s
    else:
        with pytest.raises(DataError, match="lies outside the log"):
            cut_at(run, 0.0)


def test_an_instant_is_within_the_log_to_a_billionth_of_itself() -> None:
    run = shifted(NO_INPUT, 1e4)
    last = float(run.time_s[-1])
    assert len(cut_at(run, 1e4 - 9e-6)[0].time_s) == 800
    assert cut_at(run, last)[0].step_s == last
    for at in (1e4 - 1.1e-5, last + 1e-6):
        with pytest.raises(DataError, match=r"outside the log \(10000 to 10008 s\); mend step_at="):
            cut_at(run, at)


@pytest.mark.parametrize("until", [1.5, 2.0])
def test_a_window_ends_behind_its_begin(until: float) -> None:
    with pytest.raises(DataError, match=rf"window ends \({until:g} s\) before it begins \(2 s\); mend until="):
        cut_at(replace(NO_INPUT, until_s=until), 2.0)


def test_the_level_is_that_of_the_first_hold_of_ten_samples_in_the_window() -> None:
    u = THREE.input.copy()
    u[200:209] = 60.0  # nine samples on the way up
    run = replace(THREE, input=read_only(u))
    assert cut_at(run, 2.0)[0].level == 80.0
    assert [len(step.time_s) for step in cut_at(run, 2.0)] == [500, 300]
    u[200:210] = 60.0
    first = cut_at(replace(THREE, input=read_only(u)), 2.0)[0]
    assert (first.level, len(first.time_s)) == (60.0, 210)


@pytest.mark.parametrize(("off", "samples"), [(0.9, 500), (1.1, 800)])
def test_a_window_whose_input_never_comes_within_a_hundredth_of_its_level_stays_whole(off: float, samples: int) -> None:
    """A level of 200 V said of an input of 200 ± 2 V: a hundredth of the level, twice that of the range."""
    run = log([(101.0, 2), (200.0 + 2 * off, 3), (101.0, 3)], input_unit="V", level=200.0)
    assert len(cut_at(run, 2.0)[0].time_s) == samples


def test_a_step_given_behind_a_hold_comes_from_that_hold() -> None:
    run = log([(0, 2), (30, 3), (80, 3)], input_unit="V")
    (step,) = cut_at(run, 5.0)
    assert (step.from_level, step.level, step.edge) == (30.0, 80.0, "rising")
    assert step.baseline == pytest.approx(float(run.output[424:500].mean()), rel=1e-12)
    short = run.part(slice(191, None))  # nine samples of rest before 30 V are no hold: the one behind them is
    assert cut_at(short, 5.0)[0].from_level == 30.0
    only = run.part(slice(491, None))  # nine samples of 30 V and nothing before
    assert cut_at(only, 5.0)[0].from_level == 0.0


def test_a_stored_baseline_is_kept() -> None:
    assert cut_at(replace(NO_INPUT, baseline=0.125), 2.0)[0].baseline == 0.125
    found = cut_at(replace(NO_INPUT, output=read_only(NO_INPUT.output + 0.25)), 2.0)[0]
    assert (found.baseline, found.held, found.rest_s, found.rest_moved) == (0.25, None, pytest.approx(2.0), 0.0)


def test_a_step_at_the_first_sample_has_no_rest() -> None:
    step = cut_at(NO_INPUT, 0.0)[0]
    assert (step.baseline, step.rest_s, step.step_s) == (None, None, 0.0)


@pytest.mark.parametrize(
    ("name", "hint"),
    [
        ("a50V", '"a{level}V", if 50 is the level'),
        ("run_12.5%_3", '"_{level}%", if 12.5 is the level'),
        ("u=8", '"={level}", if 8 is the level'),
        ("7", '"{level}", if 7 is the level'),
        ("blank", "with {level}"),
    ],
)
def test_a_log_without_a_level_is_told_what_its_name_may_say(name: str, hint: str) -> None:
    assert str(no_level(replace(NO_INPUT, name=name))).endswith(f"give the input column, or name_pattern= {hint}")


# from the output alone


@pytest.mark.parametrize(("count", "seen"), [(19, False), (20, True)])
def test_twenty_samples_show_an_onset_or_a_rise_at_once(count: int, seen: bool) -> None:
    late = np.where(np.arange(count) >= 12, 1.0, 0.0)
    assert onset(late) == (12 if seen else None)
    assert rises_at_once(np.array([0.0, 0.2, 0.35, 0.45, 0.6, 0.8, *[1.0] * (count - 6)])) is seen


@pytest.mark.parametrize(("head", "at"), [(10, 30), (300, 30)])
def test_an_onset_is_where_the_output_last_leaves_its_idle_band(head: int, at: int) -> None:
    """A touch of 30 % long before the step is no step: the output is back in its band behind it."""
    y = np.where(np.arange(600) >= head + at, 1.0, 0.0)
    y[head + 5 : head + 9] = 0.3
    assert onset(y) == head + at


@pytest.mark.parametrize(("start", "at_once"), [(0.19, True), (0.21, False)])
def test_a_rise_at_once_begins_within_a_fifth_of_its_start(start: float, at_once: bool) -> None:
    y = np.maximum(-np.expm1(-np.arange(1000) / 100), start)
    assert rises_at_once(y) is at_once and rises_at_once(-y) is at_once


@pytest.mark.parametrize(("size", "at_once"), [(7.5, False), (9.0, True)])
def test_a_rise_at_once_ends_eight_deviations_away(size: float, at_once: bool) -> None:
    """Noise of 1 by its median difference: samples that go to and fro by 1/1.4826·√2."""
    to_and_fro = np.tile([0.5, -0.5], 500) * np.sqrt(2) / 1.4826
    y = size * np.sqrt(np.minimum(np.arange(1000) / 400, 1.0)) + to_and_fro
    y[900:] = size  # the end is the median of the last tenth
    assert rises_at_once(y) is at_once


def test_a_constant_input_that_is_no_load_refuses_a_step_in_the_output() -> None:
    held = replace(THREE, input=read_only(np.full(800, 80.0)), output=log([(0, 2), (80, 6)]).output)
    with pytest.raises(DataError, match="the input stays at 80 V: no step"):
        cut_by_output(held)
    (load,) = cut_by_output(replace(held, kind="friction-force"))
    assert (load.level, load.step_s) == (80.0, pytest.approx(2.0, abs=0.02))
    (said,) = load.findings
    assert said.code == "step-from-output" and said.values["step_s"] == load.step_s


# signs


def test_a_level_of_zero_is_turned_with_the_positive_ones() -> None:
    down = cut_at(replace(NO_INPUT, output=read_only(-NO_INPUT.output)), 2.0)[0]
    none = replace(down, level=0.0, name="zero", output=read_only(0.0 * down.output))
    unknown = replace(down, level=None, name="unknown")
    way = direction([down, none])
    assert [way.of(step) for step in (down, none, unknown)] == [-1.0, -1.0, -1.0]
    assert way.of(replace(down, level=-80.0)) == 1.0


def backwards(run: Run) -> Run:
    return replace(run, output=read_only(-run.output))


RISE = log([(0, 4), (50, 8)])
RAMPED = replace(RISE, input=read_only(50.0 * -np.expm1(-np.maximum(RISE.time_s - 3.99, 0) / 0.08)), input_unit="V")


@pytest.mark.parametrize(
    ("run", "said"),
    [
        (replace(RISE, output=read_only(np.round(RISE.output / 0.15) * 0.15)), "coarse-output"),
        (RAMPED, "input-ramps-on"),
        (log([(0, 4), (50, 8)], tau2=12.0, noise=1e-4), "window-too-short"),
        (replace(RISE, output=read_only(np.minimum(np.maximum(RISE.time_s - 4, 0), 1.0)
                                        + 1e-3 * np.random.default_rng(0).normal(size=1200))), "flat-topped"),
    ],
)  # fmt: skip
def test_what_is_told_by_the_swing_is_not_told_of_an_output_that_goes_the_other_way(run: Run, said: str) -> None:
    """Its sign is kept, as the user asked: the swing is 0, and no share of it is anything."""
    assert said in [one.code for one in build_stepset([run]).runs[0].findings]
    kept = build_stepset([backwards(run)], StepOptions(keep_sign=True))
    assert said not in [one.code for one in kept.runs[0].findings]
    assert kept.runs[0].lost_pct == 0.0
