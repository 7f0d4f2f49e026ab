"""Steps between levels: every shape returns, the evidence chooses, dead times, quality by hand, real rigs."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import eaid
from eaid.apparatus import Apparatus
from eaid.errors import UsageError
from eaid.shapes.curves import slopes, step_curve
from eaid.steps.stepset import LevelStep, StepSet

T = np.arange(2000) / 100.0
TRUTHS = {
    "one": (3.0, 0.8, 2.0, 1.0),
    "two": (3.0, 0.3, 4.0, 0.85),
    "free": (3.0, 0.4, 4.0, 0.5),
    "overshoot": (3.0, 0.4, 4.0, 1.4),
}


def response(t: Any, change: Any, tau1: Any, tau2: Any, share: Any, dead: Any = 0.0) -> Any:
    after = np.where(t > np.real(dead), t - dead, 0.0)
    return change * (1 - share * np.exp(-after / tau1) - (1 - share) * np.exp(-after / tau2))


def step(name: str, dead: float = 0.0, noise: float = 0.0, seed: int = 0) -> LevelStep:
    y = 1.5 + response(T, *TRUTHS[name], dead) + noise * np.random.default_rng(seed).normal(size=len(T))
    return LevelStep("a", "a.csv", 20.0, 50.0, 1.5, T, y, np.full(len(T), 50.0))


def fitted(*steps: LevelStep, **options: Any) -> eaid.Fit:
    return eaid.fit(StepSet("clutch", "%", "N·m", Apparatus(), (), level_steps=steps), **{"ci": "none"} | options)


@pytest.mark.parametrize("name", TRUTHS)
@pytest.mark.parametrize("dead", [0.0, 0.503])
def test_slopes_by_complex_steps(name: str, dead: float) -> None:
    change, tau1, tau2, share = TRUTHS[name]
    p, t = np.array([change, math.log(tau1), math.log(tau2 / tau1), share, dead]), T[::37] + 1e-3
    assert step_curve(p, t) == pytest.approx(response(t, change, tau1, tau2, share, dead), rel=1e-12)
    for k in range(5):
        c, a, b, s, d = p + 1e-30j * np.eye(5)[k]
        exact = response(t, c, np.exp(a), np.exp(a + b), s, d).imag / 1e-30
        assert slopes(p, t)[:, k] == pytest.approx(exact, rel=1e-12, abs=1e-14)


@pytest.mark.parametrize("dead", [0.0, 0.5])
@pytest.mark.parametrize("name", TRUTHS)
def test_every_shape_returns_without_noise(name: str, dead: float) -> None:
    found = fitted(step(name, dead))
    (row,) = found.steps
    change, tau1, tau2, share = TRUTHS[name]
    assert (row.shape, row.from_, row.level, row.edge, row.start) == (name, 20.0, 50.0, "up", 1.5)
    assert (row.change, row.tau1, row.dead_time_s) == pytest.approx((change, tau1, dead), rel=1e-5, abs=1e-6)
    assert row.gain == pytest.approx(change / 30.0, rel=1e-6) and row.rmse < 1e-7
    peak = np.max(response(np.linspace(dead, 20, 10**6), *TRUTHS[name], dead))
    assert row.peak == (pytest.approx(peak, rel=1e-5) if name == "overshoot" else None)
    if name != "one":
        assert (row.tau2, row.C) == pytest.approx((tau2, share), rel=1e-4)
    (level,) = found.friction.levels
    assert (level.from_, level.level, level.shape, level.delay_s) == (20.0, 50.0, name, row.dead_time_s)
    assert found.converged and found.linear is None and found.nonlinear is None
    told = [one for one in found.findings if one.code == "other-shape-fits-better"]
    assert bool(told) == (name in ("free", "overshoot") or dead > 0)


@pytest.mark.slow
@pytest.mark.parametrize("name", TRUTHS)
@pytest.mark.parametrize("dead", [0.0, 0.5])
def test_the_right_shape_is_chosen_under_noise(name: str, dead: float) -> None:
    rows = [fitted(step(name, dead, 0.03, seed)).steps[0] for seed in range(10)]
    assert [(one.shape, one.dead_time_s > 0) for one in rows].count((name, dead > 0)) >= 9
    assert np.mean([one.change for one in rows]) == pytest.approx(3.0, abs=0.03)
    assert np.mean([one.rmse for one in rows]) == pytest.approx(0.03, rel=0.03)


def answers(scatter: float = 0.0) -> dict[str, dict[str, float]]:
    """Chosen shape → RMSE and differences of AICc of noisy steps, their samples scattered by a part of themselves."""
    rng, steps = np.random.default_rng(9), []
    for name, dead in (("one", 0.0), ("two", 0.503), ("free", 0.0), ("overshoot", 0.0)):
        one = step(name, dead, 0.03, 7)
        steps.append(replace(one, name=name, output=one.output * (1 + scatter * rng.normal(size=len(T)))))
    return {row.shape: {"rmse": row.rmse, **row.evidence} for row in fitted(*steps).steps}


def test_the_last_digits_of_the_samples_decide_nothing() -> None:
    plain, scattered = answers(), answers(1e-12)
    assert list(plain) == list(scattered) == list(TRUTHS)
    for name, row in plain.items():
        assert scattered[name] == pytest.approx(row, rel=1e-8, abs=1e-6)
        # a shape leaves no more than a simpler one that it contains: worse by the price of one unknown at most
        for simple, wider in (("one", "two"), ("two", "free"), ("one", "one+dead"), ("overshoot", "overshoot+dead")):
            assert simple not in row or row[wider] < row[simple] + 2.1


def test_quality_by_hand() -> None:
    one = step("two", noise=0.1)
    (row,) = fitted(one).steps
    y, left = one.output, one.output - row.predict(T)
    assert row.rmse == pytest.approx(math.sqrt(float(left @ left) / len(y)))
    assert row.fit_pct == pytest.approx(100 * (1 - np.linalg.norm(left) / np.linalg.norm(y - y.mean())))
    assert pytest.approx(1 - float(left @ left) / float(((y - y.mean()) ** 2).sum())) == row.R2


def test_shape_share_and_dead_time_that_are_given_are_held() -> None:
    one = step("overshoot", noise=0.03)
    (held,) = fitted(one, shape="two", dead_time=0.0, share=0.7).steps
    assert (held.shape, held.C, held.dead_time_s) == ("two", 0.7, 0.0)
    assert held.rmse > 2 * fitted(one).steps[0].rmse
    assert fitted(step("one"), shape="one", dead_time=0.25).steps[0].dead_time_s == 0.25


def test_slow_noise_does_not_make_a_shape_and_a_wave_is_no_step() -> None:
    """Noise with a memory of a fifth of a second counts for fewer samples."""
    rng, chosen = np.random.default_rng(3), []
    for _ in range(5):
        slow = np.zeros(len(T))
        for k, push in enumerate(0.03 * np.sqrt(1 - 0.95**2) * rng.normal(size=len(T) - 1), 1):
            slow[k] = 0.95 * slow[k - 1] + push
        clean = step("two")
        chosen.append(fitted(LevelStep("a", "", 0.0, 50.0, 1.5, T, clean.output + slow, clean.input)).steps[0].shape)
    assert chosen.count("two") >= 4
    wave = fitted(LevelStep("w", "", 0.0, 50.0, 0.0, T, np.sin(2 * np.pi * T / 7), np.full(len(T), 50.0)))
    assert ("shape-explains-little", "caution") in [(one.code, one.severity) for one in wave.findings]
    assert [one.code for one in wave.verdict.reasons] == ["no-step-has-a-shape"]  # nothing else was fitted


def test_a_staircase_is_fitted_step_by_step_and_reads_back(tmp_path: Path) -> None:
    rng, steps = np.random.default_rng(0), []
    truth = ((20.0, 50.0, 0.4, (1.2, 0.3, 4.0, 0.85)), (50.0, 30.0, 1.6, (-0.7, 0.2, 3.0, 0.85)))
    for before, after, start, p in truth:
        y = start + response(T, *p) + 0.002 * rng.standard_normal(len(T))
        steps.append(LevelStep("run", "", before, after, start, T, y, np.full(len(T), after)))
    found = fitted(*steps, shape="two", ci="robust")
    for row, (before, after, start, p) in zip(found.friction.levels, truth, strict=True):
        assert (row.from_, row.level, row.start, row.shape) == (before, after, start, "two")
        assert (row.Ts, row.tau1, row.tau2) == pytest.approx(p[:3], rel=0.03) and row.fit_pct > 95
    found.save(tmp_path / "fit.json")
    assert eaid.load(tmp_path / "fit.json").friction == found.friction


def test_a_dead_time_longer_than_the_record_is_refused(small_steps: Any) -> None:
    with pytest.raises(UsageError, match=r"dead_time=10000 s: the step of .* is recorded for"):
        eaid.fit(small_steps, dead_time=1e4)
