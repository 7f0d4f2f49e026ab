"""Repeats on one axis: equal, unequal in length, in rate, jittered; and the doubts of one run, each provoked."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from eaid.arrays import read_only
from eaid.findings import Finding
from eaid.logs.run import Run
from eaid.steps.build import build_stepset
from eaid.steps.checks import slow_constant
from eaid.steps.step import uniform_step

sys.path.insert(0, str(Path(__file__).parent))
from make import curve, log

PLAN = [(0.0, 2.0), (50.0, 6.0)]


def codes(run: Run) -> tuple[str, ...]:
    return tuple(one.code for one in build_stepset([run]).runs[0].findings)


def found(run: Run, code: str) -> Finding:
    (one,) = (one for one in build_stepset([run]).runs[0].findings if one.code == code)
    return one


def test_mean_and_spread_of_equal_repeats() -> None:
    runs = [log(PLAN, noise=0.05, seed=k, name=f"r{k}") for k in range(3)]
    (level,) = build_stepset(runs).levels
    assert level.runs.shape == (3, 600)
    assert level.uniform
    stack = np.stack([r.output[200:] - r.output[:200].mean() for r in runs])
    np.testing.assert_allclose(level.mean, stack.mean(axis=0), rtol=1e-14)
    np.testing.assert_allclose(level.sd, stack.std(axis=0, ddof=1), rtol=1e-14)
    np.testing.assert_array_equal(level.time_s, np.arange(600) * 0.01)


def test_the_common_window_is_the_shortest() -> None:
    runs = [log([(0, 2), (50, seconds)], name=f"r{seconds}") for seconds in (6, 4, 5)]
    (level,) = build_stepset(runs).levels
    assert len(level.time_s) == 400


def test_other_rates_are_interpolated_to_the_finest() -> None:
    runs = [log(PLAN, rate_hz=rate, name=f"r{rate}") for rate in (100.0, 1000.0, 250.0)]
    (level,) = build_stepset(runs).levels
    assert level.uniform
    np.testing.assert_allclose(np.diff(level.time_s), 1e-3, rtol=1e-9)
    assert level.time_s[-1] <= 5.99 + 1e-9
    # linear interpolation is off by h²/8 · |f''|: (0.01)² / 8 · 2 · 0.85 / 0.2² = 5.3e-4
    np.testing.assert_allclose(level.runs[0], 2 * curve(level.time_s), atol=6e-4)
    np.testing.assert_allclose(level.runs[1], 2 * curve(level.time_s), atol=1e-12)


def test_order_of_repeats_does_not_matter() -> None:
    runs = [log(PLAN, noise=0.05, seed=k, name=f"r{k}", rate_hz=rate) for k, rate in enumerate((100.0, 200.0, 150.0))]
    (one,) = build_stepset(runs).levels
    (other,) = build_stepset(runs[::-1]).levels
    np.testing.assert_allclose(one.mean, other.mean, rtol=0, atol=1e-13)


def test_rounded_times_are_uniform_and_jittered_ones_are_not() -> None:
    t = np.arange(1000) * 78.125e-6
    assert uniform_step(np.round(t, 7)) == pytest.approx(78.125e-6)
    rng = np.random.default_rng(0)
    assert uniform_step(t + 20e-6 * rng.uniform(size=1000)) is None
    (level,) = build_stepset([replace(log(PLAN), time_s=read_only(np.round(np.arange(800) / 128.0, 5)))]).levels
    assert level.uniform


def test_a_jittered_single_run_keeps_its_own_times() -> None:
    run = log(PLAN)
    rng = np.random.default_rng(5)
    t = read_only(run.time_s + 0.004 * rng.uniform(size=len(run.time_s)))
    stepset = build_stepset([replace(run, time_s=t)])
    (level,) = stepset.levels
    assert not level.uniform
    np.testing.assert_array_equal(level.time_s, t[200:] - t[200])
    (said,) = stepset.runs[0].findings
    assert said.code == "jitter"


def test_nothing_is_doubtful_in_a_good_run() -> None:
    for noise in (0.0, 0.01, 0.05):
        for seed in range(5):
            assert codes(log([(0, 10), (50, 10)], noise=noise, seed=seed)) == ()
    assert codes(log([(0, 10), (50, 30)], tau1=0.5, tau2=8.0, noise=0.02, rate_hz=1000.0)) == ()


def shaped(change: np.ndarray, noise: float = 0.01) -> Run:
    run = log(PLAN, noise=noise)
    return replace(run, output=read_only(run.output + change))


T = np.arange(800) * 0.01
SLOW = log([(0, 2), (50, 8)], tau1=0.5, tau2=16.0, noise=0.01, rate_hz=500.0)


@pytest.mark.parametrize(
    ("run", "code", "values"),
    [
        (replace(shaped(0 * T), time_s=read_only(np.where(T > 5, T + 3, T))), "gap", {"gap_s": 3.01, "at_s": 5.0}),
        (replace(shaped(0 * T), time_s=read_only(T * 1000)), "slow-clock", {"sample_s": 10.0}),
        (shaped(np.where(T < 2, 0.1 * T, 0.2)), "idle-drifts", {"drift": 0.2}),
        (shaped(np.where(T > 2, -0.2 * (T - 2), 0)), "decays-under-hold", {"lost_pct": 51.0}),
        (SLOW, "window-too-short", {"window_s": 8.0}),
    ],
)  # fmt: skip
def test_doubt(run: Run, code: str, values: dict[str, float]) -> None:
    said = found(run, code).values
    assert {name: said[name] for name in values} == pytest.approx(values, rel=0.02)


def test_slow_constant_is_found_and_judged() -> None:
    t = np.arange(20000) / 1000
    rng = np.random.default_rng(2)
    for tau1, tau2, too_short in ((0.3, 4.0, False), (0.6, 9.0, False), (0.3, 16.0, True), (0.2, 60.0, True)):
        found, short = slow_constant(2 * curve(t, tau1, tau2) + 0.01 * rng.normal(size=t.size), 20.0)
        assert short is too_short, (tau1, tau2, found)
        assert found == pytest.approx(tau2, rel=0.35)
    _, short = slow_constant(0.05 * curve(t, 0.3, 16.0) + 0.05 * rng.normal(size=t.size), 20.0)
    assert not short  # in so much noise nobody knows


def test_saturation() -> None:
    run = log(PLAN, noise=0.01)
    clipped = replace(run, output=read_only(np.minimum(run.output, 1.7)))
    assert found(clipped, "saturated").values["limit"] == 1.7
    rounded = replace(run, output=read_only(np.round(log(PLAN).output, 3)))  # settles on one value: no saturation
    assert "saturated" not in codes(rounded)


def test_torque_left_after_release() -> None:
    run = log([(0, 2), (50, 6), (0, 4)], noise=0.005)
    charged = np.where(run.time_s >= 8, 0.4, 0.0)
    stepset = build_stepset([replace(run, output=read_only(run.output + charged))])
    release = stepset.runs[1]
    assert release.edge == "falling"
    assert release.left_pct == pytest.approx(20.0, abs=1.5)
    (said,) = (one for one in release.findings if one.code == "left-after-release")
    assert said.values == pytest.approx({"left_pct": 20.0, "after_s": 3.99}, rel=0.1)
    assert stepset.runs[0].lost_pct == pytest.approx(0.0, abs=1.0)


def test_repeats_that_disagree() -> None:
    runs = [log(PLAN, gain=gain, name=f"g{k}") for k, gain in enumerate((0.04, 0.04, 0.05))]
    stepset = build_stepset(runs)
    for run, own in zip(stepset.runs, (-11.5, -11.5, 23.1), strict=True):
        (said,) = (one for one in run.findings if one.code == "repeats-disagree")
        assert said.values["spread_pct"] == pytest.approx(100 * 0.01 / (0.13 / 3), rel=0.01)
        assert said.values["own_pct"] == pytest.approx(own, rel=0.01)


def test_uneven_repeats_are_told() -> None:
    runs = [log([(0, 2), (u, 6)], name=n) for u, n in ((50.0, "a"), (50.0, "b"), (80.0, "c"))]
    (said,) = build_stepset(runs).findings
    assert (said.code, said.levels, said.values["few"], said.values["most"]) == (
        "repeats-differ-in-number", (80.0,), 1, 2,
    )  # fmt: skip


def test_a_level_judges_its_own_clock() -> None:
    even = np.arange(500) * 0.01
    one = replace(build_stepset([log(PLAN)]).levels[0], time_s=even, runs=np.ones((1, 500)))
    assert one.uniform
    assert replace(one, time_s=even + 0.003).uniform  # a first sample behind the step
    for change in (even**2, even + 1e-7 * (np.arange(500) == 250), np.where(even > 2, even + 1, even)):
        assert not replace(one, time_s=change).uniform
    assert not replace(one, time_s=even[:1], runs=np.ones((1, 1))).uniform
