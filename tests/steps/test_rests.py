"""The value from which a step starts: rests that are flat, wander, slope, end early or are missing."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from eaid.arrays import read_only
from eaid.errors import DataError, UsageError
from eaid.logs.run import Run
from eaid.steps.baseline import BaselineRule, Rest, baseline_rule, first_samples, last_rest, left_early
from eaid.steps.build import build_stepset
from eaid.steps.cut import StepOptions, cut

sys.path.insert(0, str(Path(__file__).parent))
from make import curve, log

T = np.arange(800) * 0.01
STEP = log([(0, 4), (50, 4)])


def with_idle(idle: np.ndarray, run: Run = STEP, noise: float = 0.0) -> Run:
    """The step of 2 N·m at 4 s, on top of an idle output that goes on."""
    return replace(run, output=read_only(run.output + idle + noise * np.random.default_rng(0).normal(size=len(T))))


def codes(run: Run) -> list[str]:
    return [one.code for one in build_stepset([run]).runs[0].findings]


@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_a_flat_idle_is_taken_whole(noise: float) -> None:
    run = with_idle(0.3 + 0 * T, noise=noise)
    (step,) = cut(run)
    assert step.baseline == float(run.output[:400].mean())
    assert codes(run) == []


@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_an_idle_that_wandered_is_taken_where_it_rests(noise: float) -> None:
    """As a motor's: 0, then 1.3 for the last half of the idle time."""
    (step,) = cut(with_idle(np.where(T < 1.5, 0.0, np.minimum(1.3 * (T - 1.5) / 0.3, 1.3)), noise=noise))
    assert step.baseline == pytest.approx(1.3, abs=0.005)
    stepset = build_stepset([with_idle(np.where(T < 1.5, 0.0, 1.3), noise=noise)])
    assert stepset.levels[0].mean[-1] == pytest.approx(2.0, abs=0.03 + 3 * noise)


@pytest.mark.parametrize("noise", [0.0, 0.005])
def test_a_sloping_idle_is_followed_to_the_step(noise: float) -> None:
    run = with_idle(0.2 * T, noise=noise)
    (step,) = cut(run)
    assert step.baseline == pytest.approx(0.8, abs=0.015)  # the mean of the whole is 0.4
    said = build_stepset([run]).runs[0].findings
    assert "idle-drifts" in [one.code for one in said]
    assert not [one for one in said if one.severity == "stop"]


@pytest.mark.parametrize("late_s", [0.05, 0.1, 0.3])
@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_an_input_logged_late_is_a_stop(late_s: float, noise: float) -> None:
    u = np.where(4 + late_s - 1e-9 <= T, 50.0, 0.0)
    run = replace(with_idle(0 * T, noise=noise), input=read_only(u))
    (step,) = cut(run)
    assert step.baseline == pytest.approx(0.0, abs=0.01)
    (said,) = (one for one in build_stepset([run]).runs[0].findings if one.code == "not-at-rest")
    assert said.severity == "stop"
    assert said.values["off"] == pytest.approx(2 * float(curve(np.array([late_s])).item()), abs=0.15)


def test_a_step_given_late_is_a_stop_too() -> None:
    run = replace(with_idle(0 * T), input=read_only(np.full(800, np.nan)), level=50.0)
    assert "not-at-rest" in codes(replace(run, step_s=4.3))
    assert codes(replace(run, step_s=4.0)) == []


def test_a_log_that_starts_at_its_step() -> None:
    """20.63 °C at first, 31.1 more at the end: what comes before is not known to be 0."""
    t = np.arange(600.0)
    y = np.round(20.63 - 31.1 * np.expm1(-t / 150), 2)
    run = log([(50, 6)], rate_hz=100.0)
    run = replace(run, time_s=read_only(t), output=read_only(y), input=read_only(np.full(600, 50.0)))
    stepset = build_stepset([run])
    (record,) = stepset.runs
    assert record.baseline_nm == pytest.approx(20.63, abs=1e-9)
    assert stepset.levels[0].mean[-1] == pytest.approx(31.1, abs=0.6)
    assert "step-at-first-sample" in [one.code for one in record.findings]


def test_first_samples_of_a_noisy_record() -> None:
    t = np.arange(5000) / 1000
    y = 3.0 - 2 * np.expm1(-t / 1.0)
    found = [first_samples(y + 0.05 * np.random.default_rng(k).normal(size=5000)) for k in range(50)]
    assert first_samples(y) == 3.0
    assert np.mean(found) == pytest.approx(3.0, abs=0.01)
    assert np.std(found) < 0.025


def test_each_step_has_its_own_rest() -> None:
    run = log([(0, 3), (30, 4), (0, 9), (60, 4), (0, 9)])
    moved = replace(run, output=read_only(run.output + np.where(run.time_s > 9, 0.5, 0.0)))
    rising = [step for step in cut(moved) if step.edge == "rising"]
    assert [step.baseline for step in rising] == pytest.approx([0.0, 0.5], abs=0.002)
    falling = [step for step in cut(moved) if step.edge == "falling"]
    assert falling[1].baseline == rising[1].baseline


def test_spikes_in_the_idle_are_left_out() -> None:
    y = STEP.output.copy()
    y[150] = 1000.0
    run = replace(STEP, output=read_only(y))
    (step,) = cut(run)
    assert step.baseline == 0.0
    assert codes(run) == ["spikes-before-step"]
    stepset = build_stepset([run, *(replace(STEP, name=f"b{k}") for k in range(2))])
    assert stepset.findings == ()
    assert stepset.levels[0].mean[-1] == pytest.approx(2.0, abs=0.03)


@pytest.mark.parametrize(
    ("text", "rule"),
    [
        ("auto", BaselineRule()),
        ("FIRST", BaselineRule("first")),
        ("none", BaselineRule("value", 0.0)),
        ("-0.5", BaselineRule("value", -0.5)),
        ("-2:-0.5", BaselineRule("window", window_s=(-2.0, -0.5))),
    ],
)
def test_rules(text: str, rule: BaselineRule) -> None:
    assert baseline_rule(text) == rule


@pytest.mark.parametrize("text", ["", "last", "1:2:3", "2:1", "nan", "1:inf", "0:"])
def test_rules_that_are_none(text: str) -> None:
    with pytest.raises(UsageError):
        baseline_rule(text)


def test_rules_applied() -> None:
    run = with_idle(0.1 * T)

    def baseline(text: str) -> float | None:
        (step,) = cut(run, baseline_rule(text))
        return step.baseline

    assert baseline("none") == 0.0
    assert baseline("0.25") == 0.25
    assert baseline("first") == pytest.approx(0.4, abs=1e-9)
    assert baseline("-2:-1") == pytest.approx(0.25, abs=1e-9)
    with pytest.raises(DataError, match="holds no sample"):
        baseline("-20:-10")
    stored = cut(run)[0]
    assert cut(stored, baseline_rule("0.25"))[0].baseline == 0.25
    assert build_stepset([run], StepOptions(baseline=BaselineRule("value", 0.25))).runs[0].baseline_nm == 0.25


def test_a_release_is_counted_from_the_rise_before_it() -> None:
    run = log([(0, 3), (30, 4), (0, 9)])
    rising, falling = cut(run, baseline_rule("first"))
    assert falling.baseline == rising.baseline


def test_what_the_last_rest_says() -> None:
    flat = np.full(100, 2.0)
    assert last_rest(flat, 1.0) == Rest(2.0, 2.0, count=100)
    assert last_rest(flat[:3], 1.0) == Rest(2.0, 2.0, count=3)
    early = np.where(np.arange(100) < 90, 2.0, 2.0 + 0.05 * (np.arange(100) - 89))
    rest = last_rest(early, 1.0)
    assert (rest.rests, rest.value) == (False, pytest.approx(2.0, abs=5e-3))
    assert rest.lead == pytest.approx(10, abs=1)


@pytest.mark.parametrize(("late_s", "told"), [(0.0, 0), (0.03, 1), (0.2, 1)])
def test_an_input_logged_late_on_a_staircase(late_s: float, told: int) -> None:
    """0.03 s are 4 % of the step before the input says so."""
    run = log([(20, 8), (50, 8)], noise=0.002, tau1=0.6, tau2=1.5)
    u = np.where(run.time_s >= 8 + late_s - 1e-9, 50.0, 20.0)
    (step,) = cut(replace(run, input=read_only(u)))
    assert [one.code for one in step.findings].count("unsettled-before-step") == told


GROUP_SIZES = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 256, 512, 1024)


def left_early_plainly(hold: np.ndarray, change: float) -> int:
    """The t test of `left_early` on a rest that lasts until the step, one group size after the other."""
    tried = [k for k in GROUP_SIZES if 8 * k <= len(hold)]
    best, size = 1.0, 0
    for k in tried:
        first = (len(hold) - 2 * k) % k
        means = [float(np.mean(hold[a : a + k])) for a in range(first, len(hold) - 2 * k, k)]
        spread = np.std(means, ddof=1) * np.sqrt(1 + 1 / len(means))
        limit = spread * stats.t.ppf(1 - 1e-5 / 2 / len(tried), len(means) - 1)
        limit = max(limit, 1.2 * np.abs(np.array(means) - np.mean(means)).max(), 0.02 * abs(change))
        off = abs(float(np.mean(hold[-k:])) - np.mean(means))
        if off > best * limit:
            best, size = off / limit, k
    if not size:
        return 0
    middle = np.median(hold)
    within = max(4 * 1.4826 * np.median(np.abs(hold - middle)), 0.02 * abs(change))
    return max(size, len(hold) - 1 - int(np.flatnonzero(np.abs(hold - middle) <= within)[-1]))


@pytest.mark.parametrize("size", GROUP_SIZES)
def test_how_long_a_rest_was_left_by_a_second_way(size: int) -> None:
    random = np.random.default_rng(size)
    seen = 0
    for count in (8 * size - 1, 8 * size, 8 * size + 1, 9 * size + 3):
        for off in (0.5, 2.0, 8.0, 20.0):
            hold = 0.01 * random.normal(size=max(count, 10))
            hold[-size:] += 0.01 * off / np.sqrt(size)
            assert left_early(hold, hold, 0.1) == left_early_plainly(hold, 0.1)
            seen += left_early(hold, hold, 0.1) > 0
    assert seen > 0 or size < 4
