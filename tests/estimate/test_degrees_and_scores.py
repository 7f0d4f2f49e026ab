"""Closed forms that decide: degrees of freedom, quoted intervals, AICc and BIC, sweeps, linear intervals."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from eaid.estimate.scatter import RunStatistics, common_shifts, pool_scatter
from eaid.estimate.spread import Influence, LevelScatter, interval_of, log_interval_of, satterthwaite


def test_a_sum_of_alike_variances_has_all_their_degrees() -> None:
    assert satterthwaite((2.0, 2.0), (3.0, 3.0)) == pytest.approx(6.0)
    assert satterthwaite((3.0, 1.0), (4.0, 2.0)) == pytest.approx(16 / (9 / 4 + 1 / 2))
    assert satterthwaite((np.array([1.0, 0.0]), 1.0), (5.0, 7.0)) == pytest.approx([4 / (1 / 5 + 1 / 7), 7.0])


def test_quoted_intervals_by_hand() -> None:
    from scipy import stats

    t = stats.t.ppf(0.975, 6)
    assert interval_of(5.0, 4.0, 6.0) == pytest.approx((5 - 2 * t, 5 + 2 * t))
    assert log_interval_of(5.0, 0.04, 6.0) == pytest.approx((5 * np.exp(-0.2 * t), 5 * np.exp(0.2 * t)))
    assert log_interval_of(-1.0, 0.04, 6.0) is None and log_interval_of(None, 0.04, 6.0) is None
    assert log_interval_of(5.0, 1e6, 6.0) is None


def alone(variance: list[float], relative: list[float], degrees: list[float], **more: Any) -> LevelScatter:
    """Levels that each show the scatter of their one parameter by themselves."""
    one = np.eye(len(variance))[None]
    found = (np.array(variance)[:, None], np.ones((len(variance), 1, 1)), one, np.array([relative]), np.array(degrees))
    return LevelScatter(*found, np.zeros(1), np.zeros(1), **more)


def test_welch_of_levels_by_hand() -> None:
    """V = Σ g² v, ν = V²/Σ (g² v)²/(R − 1) of levels by themselves; a single run's own part with its degrees."""
    found = Influence(np.array([[[1.0]], [[2.0]]]), alone([9.0, 4.0], [1.0, 1.0], [2.0, 1.0]), np.zeros((0, 1)), 0.0)
    assert found.variance()[0] == pytest.approx(9 + 16) and found.covariance() == pytest.approx(25.0)
    assert found.variance()[1] == pytest.approx(25**2 / (81 / 2 + 16**2))
    single = replace(found, singles=np.array([[4.0]]), single_degrees=5.0)
    assert single.variance()[0] == pytest.approx(41.0)
    assert single.variance()[1] == pytest.approx(41**2 / (25**2 / found.variance()[1][0] + 16**2 / 5))
    assert found.of(np.array([[2.0]])).variance()[0] == pytest.approx(4 * 25.0)
    assert replace(found, gain=0 * found.gain).variance() == (0.0, 3.0)


def runs_of(shifts: np.ndarray) -> list[RunStatistics]:
    """Levels whose runs would move one parameter so, shape (L, R), with hardly any noise within a run."""
    return [RunStatistics(row[:, None] - row.mean(), np.full(1, 1e-12)) for row in shifts]


def test_sweeps_count_as_many_observations_as_there_are_sweeps() -> None:
    """m_r common to L levels: V = Σ m²/(R − 1)/R with R − 1 degrees of freedom beside each level's own."""
    random = np.random.default_rng(2)
    shift = np.array([0.3, -0.1, 0.4, -0.6])
    own = 0.01 * random.standard_normal((8, 4))
    levels = runs_of(shift + own)
    common = common_shifts(levels, 0)
    assert common_shifts(runs_of(shift + 50 * own), 0) is not None  # F = 15.7 of 3 and 21 degrees of freedom
    assert common_shifts(runs_of(own), 0) is None
    assert common == pytest.approx(shift + own.mean(axis=0) - (shift + own).mean(), abs=1e-12)
    found = pool_scatter(levels)
    assert found.common[0] == pytest.approx(common @ common / 3 / 4)
    left = own - own.mean(axis=0) - own.mean(axis=1, keepdims=True) + own.mean()
    assert found.expected[0, 0] == pytest.approx((left**2).sum() / (7 * 3) / 4)
    whole = Influence(
        np.ones((8, 1, 1)) / 8, replace(found, shifts=tuple(one.shift for one in levels)), np.zeros((0, 1)), 0.0
    )
    variance, degrees = whole.variance()
    assert variance == pytest.approx(common @ common / 3 / 4) and degrees == pytest.approx(3.0, rel=0.02)
