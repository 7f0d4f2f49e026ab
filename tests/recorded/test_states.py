"""The response and its derivatives, against the replay's plant and differences."""

import numpy as np
import pytest

from eaid.estimate import forms
from eaid.estimate.recorded_log import RecordedLog
from eaid.plant.dynamics import REFERENCE_PLANT, plant_numbers, plant_step
from eaid.plant.forms import Proportional
from eaid.plant.sums import lagged
from eaid.recorded.few_rows import Copies
from eaid.recorded.from_logs import Setup
from eaid.steps.noise import correlation_s


def log_of(draw: np.random.Generator, n: int = 600, moving: bool = False) -> RecordedLog:
    t = np.cumsum(draw.uniform(0.002, 0.05, n))
    duty = np.repeat(draw.choice([0.0, 4.0, 10.0, 35.0, 60.0, 100.0], n // 20), 20)
    duty[:12] = 0.0
    if moving:
        duty = np.clip(duty + draw.normal(0, 3, n), 0, 100)
    return RecordedLog("log", t, duty, draw.normal(1, 0.3, n), idle_start=False)


@pytest.mark.parametrize("moving", [False, pytest.param(True, marks=pytest.mark.slow)])
@pytest.mark.parametrize(
    "kind", ["nonlinear", *(pytest.param(one, marks=pytest.mark.slow) for one in ("free", "linear", "friction"))]
)
def test_derivatives_are_those_of_differences(kind: str, moving: bool) -> None:
    draw = np.random.default_rng(3)
    log = log_of(draw, moving=moving)
    levels = np.array([10.0, 35.0, 60.0, 100.0])
    one = {
        "nonlinear": forms.nonlinear(levels, 0.85),
        "free": forms.nonlinear(levels, None),
        "linear": forms.linear(levels),
        "friction": forms.friction(levels, 0.85),
    }[kind]
    drive = log.drive
    setup = Setup(one, (drive,), ("rest", "fall", "excess"))
    if kind in ("nonlinear", "free"):
        x0 = np.append(forms.nonlinear(levels, 0.85).unknowns(REFERENCE_PLANT), [0.8] * (kind == "free"))
    elif kind == "linear":
        x0 = np.array([2.0, 1.8, 0.4])
    else:
        x0 = np.array([0.2, 0.7, 1.6, 4.4, 0.2, 0.5, 0.6, 0.3, 5.0, 11.0, 15.0, 14.0])
    x = np.concatenate([x0, [0.3, 7.0, 1.3, 0.8, 0.05, 0.02, 0.4], [0.1] * (kind != "linear")])
    J, _ = setup.jacobian(x, 0)
    for j, step in enumerate(1e-6 * np.eye(len(x))):
        slope = (setup.jacobian(x + step, 0)[1] - setup.jacobian(x - step, 0)[1]) / 2e-6
        assert np.abs(slope - J[:, j]).max() <= 1e-7 * max(1.0, np.abs(slope).max()), j


def test_the_model_moves_as_the_replays_plant_does() -> None:
    draw = np.random.default_rng(5)
    log = log_of(draw, moving=True)
    plant = plant_numbers(REFERENCE_PLANT)._replace(release=(0.4, 6.0))
    x1 = x2 = 0.0
    expected = []
    for u, dt in zip(log.input, log.dt_s, strict=True):
        expected.append(x1 + x2)
        x1, x2 = plant_step(plant, x1, x2, float(u), float(dt))
    one = forms.nonlinear(np.array([10.0, 35.0, 60.0, 100.0]), 0.85)
    drive = log.drive
    x = np.append(one.unknowns(REFERENCE_PLANT), [0.4, 6.0, 0.0, 0.0, 0.0])  # the release, idle output, both states
    found = Setup(one, (drive,), ("rest",)).jacobian(x, 0)[1] + drive.y
    np.testing.assert_allclose(found, expected, rtol=1e-11, atol=1e-12)


@pytest.mark.parametrize("moving", [False, True])
def test_a_coarse_copy_costs_what_the_log_costs_but_for_a_constant(moving: bool) -> None:
    draw = np.random.default_rng(6)
    n = 60_000
    duty = np.repeat(draw.choice([10.0, 40.0, 100.0], n // 3000), 3000)
    if moving:
        duty = 55 + 45 * np.sin(np.arange(n) / 4000)
    log = RecordedLog("log", np.arange(n) / 1000, duty, np.zeros(n), baseline=0.0, idle_start=True)
    one = forms.nonlinear(np.array([10.0, 40.0, 70.0, 100.0]), 0.85)
    x = one.unknowns(REFERENCE_PLANT)
    clean = Setup(one, (log.drive,)).jacobian(x, 0)[1]
    log = RecordedLog("log", log.time_s, duty, clean + draw.normal(0, 0.05, n), baseline=0.0, idle_start=True)
    whole = Setup(one, (log.drive,))
    copy, rel = Copies(log).small, 0.02 if moving else 1e-7
    assert len(copy.dt_s) < n / 4
    assert copy.w.sum() == pytest.approx(n)
    rough = Setup(one, (copy,))
    moved = x * (1 + 0.05 * draw.normal(size=len(x)))
    exact = whole.together(moved)[0] - whole.together(x)[0]
    assert rough.together(moved)[0] - rough.together(x)[0] == pytest.approx(exact, rel=rel)
    if not moving:  # the sum of squares itself, and its gradient
        assert rough.together(x)[0] == pytest.approx(whole.together(x)[0], rel=rel)
        size = np.sqrt(np.diagonal(whole.together(x)[2]) * whole.together(x)[0])
        assert np.abs((rough.together(x)[1] - whole.together(x)[1]) / size).max() < rel


@pytest.mark.parametrize("kind", ["nonlinear", "swing"])
def test_a_log_of_many_rows_is_gone_through_in_pieces(kind: str) -> None:
    """Every piece goes on where the one before ended, behind a dead time, too; and the residuals need no unknowns."""
    log = log_of(np.random.default_rng(8))
    if kind == "nonlinear":
        one = forms.nonlinear(np.array([10.0, 35.0, 60.0, 100.0]), 0.85)
        x = np.append(one.unknowns(REFERENCE_PLANT), [0.1, 0.2, 0.3, 0.4])  # θ, idle output, both states
    else:
        one = forms.of_kind("swing", Proportional(0.0, 100.0), 0.0, 100.0, 0.01, None, False, 0)
        x = np.array([0.04, 0.3, 0.4, 0.7, 0.1, 0.2, 0.3, 0.4])
    setup = Setup(one, (log.drive,), ("dead",))
    whole = np.concatenate([*setup.derivatives(x, 0)])
    assert whole.shape == (600, len(x) + 1)
    for rows in (1, 7, 100):
        np.testing.assert_array_equal(np.concatenate([*setup.derivatives(x, 0, rows=rows)]), whole)
    np.testing.assert_array_equal(setup.residuals(x, 0), whole[:, -1])


def test_the_correlation_of_a_long_residual_is_seen_in_fewer_rows() -> None:
    """Of a first-order one with τ = 0.5 s, sampled 10⁶ times and more: τ, and half a sample of white noise."""
    white = np.random.default_rng(1).normal(size=2**21)
    slow = lagged(white[:, None], 0.01, 0.5)[:, 0]
    for n in (2**17, 2**21):
        assert correlation_s(slow[-n:], 0.01) == pytest.approx(0.5, rel=0.1)
        assert correlation_s(white[-n:], 0.01) == pytest.approx(0.005, rel=0.01)
