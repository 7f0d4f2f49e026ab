"""A refit finds what the fit itself finds, and resampling has the spread that it stands for."""

from typing import Any

import numpy as np
import pytest

from eaid.fitting.data import data_of
from eaid.fitting.levels import fit_levels
from eaid.fitting.linear import fit_each_level, fit_linear, refit_linear
from eaid.models.parameters import Linear
from eaid.steps.stepset import Level
from eaid.uncertainty.bootstrap import _first_order, _tame_variance, resampled_blocks, resampled_mean
from eaid.uncertainty.level_statistics import free_parameters, log_theta, refit


@pytest.fixture(scope="module")
def levels(sets: Any) -> tuple[Level, ...]:
    return tuple(sets.one_set(2, sets.VARIANTS["base"], samples=500).levels)


def test_refits_end_where_the_fits_do(levels: tuple[Level, ...]) -> None:
    data = data_of(levels)
    own = fit_each_level(data)
    wanted = np.array([[-np.log(one.tau), np.log(one.coefficients[0])] for one in own])
    assert _first_order(data.points, wanted + np.array([0.1, -0.2])) == pytest.approx(wanted, abs=1e-4)
    p = fit_linear(data).parameters
    found = refit_linear(data, Linear(1.2 * p.a0, 0.8 * p.b0, p.c0 + 0.5))
    assert (found.a0, found.b0, found.c0) == pytest.approx((p.a0, p.b0, p.c0), rel=1e-4)
    curves = fit_levels(data, 0.85)
    theta = np.array([log_theta(one.curve, True) for one in curves])
    again = refit(data.points, theta + np.array([0.05, -0.1, 0.1, 0.0]), free_parameters(False)).x
    assert again == pytest.approx(theta, abs=1e-4)


def test_one_level_leaves_c0_as_it_was(levels: tuple[Level, ...]) -> None:
    data = data_of(levels[4:5])
    p = fit_linear(data).parameters
    found = refit_linear(data, Linear(1.1 * p.a0, p.b0, 0.0))
    assert (found.a0, found.b0, found.c0) == pytest.approx((p.a0, p.b0, 0.0), rel=1e-4)


@pytest.mark.slow
def test_means_of_resampled_runs_have_the_variance_of_a_mean() -> None:
    """Σ(x − x̄)²/(R − 1)/R, about the mean itself."""
    random = np.random.default_rng(0)
    runs = np.array([[1.0], [2.0], [6.0]])
    drawn = np.array([resampled_mean(runs, random)[0] for _ in range(20_000)])
    assert drawn.mean() == pytest.approx(3.0, abs=0.05)
    assert drawn.var() == pytest.approx(14 / 2 / 3, rel=0.03)


def test_blocks_keep_the_residuals_and_their_memory() -> None:
    random = np.random.default_rng(1)
    t = np.arange(2000) * 0.01
    level = Level(10.0, t, (5 + np.sin(2 * np.pi * t))[None], ("a",))
    made = resampled_blocks(level, np.full(2000, 5.0), random)
    assert made.shape == (2000,) and set(np.round(made, 9)) <= set(np.round(level.mean, 9))
    steps = np.abs(np.diff(made))
    assert (steps > 0.07).sum() <= 9  # ten blocks of 2 s, nine joints


def test_a_refit_that_runs_away_is_held() -> None:
    values = np.random.default_rng(2).standard_normal((1000, 2))
    values[:10, 1] += 1e4
    variance = _tame_variance(values)
    assert variance[0] == pytest.approx(1.0, rel=0.1) and 1.0 < variance[1] < 3.0
