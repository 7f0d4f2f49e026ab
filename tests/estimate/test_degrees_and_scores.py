"""Closed forms that decide: degrees of freedom, quoted intervals, AICc and BIC, sweeps, linear intervals."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from eaid.estimate.adequacy import effective_samples
from eaid.estimate.runs import (
    RunStatistics,
    common_shifts,
    interval_of,
    log_interval_of,
    pooled_scatter,
    satterthwaite,
    t_quantile,
)
from eaid.estimate.spread import Influence


def test_t_is_that_of_scipy_stats() -> None:
    degrees = np.array([1.0, 2.5, 20.0, 1e7])
    assert t_quantile(degrees) == pytest.approx(stats.t.ppf(0.975, degrees), rel=1e-9)
    assert t_quantile(7.0, 0.999) == pytest.approx(stats.t.ppf(0.9995, 7.0))
    assert t_quantile(0.0) == np.inf and t_quantile(np.inf) == pytest.approx(1.959964, abs=1e-6)


def test_a_sum_of_alike_variances_has_all_their_degrees() -> None:
    assert satterthwaite((2.0, 2.0), (3.0, 3.0)) == pytest.approx(6.0)
    assert satterthwaite((3.0, 1.0), (4.0, 2.0)) == pytest.approx(16 / (9 / 4 + 1 / 2))
    assert satterthwaite((np.array([1.0, 0.0]), 1.0), (5.0, 7.0)) == pytest.approx([4 / (1 / 5 + 1 / 7), 7.0])


def test_quoted_intervals_by_hand() -> None:
    t = stats.t.ppf(0.975, 6)
    assert interval_of(5.0, 4.0, 6.0) == pytest.approx((5 - 2 * t, 5 + 2 * t))
    assert log_interval_of(5.0, 0.04, 6.0) == pytest.approx((5 * np.exp(-0.2 * t), 5 * np.exp(0.2 * t)))
    assert log_interval_of(-1.0, 0.04, 6.0) is None and log_interval_of(None, 0.04, 6.0) is None
    assert log_interval_of(5.0, 1e6, 6.0) is None


def test_welch_of_levels_by_hand() -> None:
    """Three runs and two: V = 3/2 Σψ² + 2 Σψ², ν = V²/(v₁²/2 + v₂²/1); a single run's own part with its degrees."""
    psi = np.array([[1.0], [-2.0], [1.0], [3.0], [-3.0]])
    found = Influence(psi, np.array([3, 2]), np.zeros((0, 1)), 0.0)
    variance, degrees = found.variance()
    assert variance == pytest.approx(1.5 * 6 + 2 * 18) and found.covariance() == pytest.approx(45.0)
    assert degrees == pytest.approx(45**2 / (81 / 2 + 36**2))
    assert replace(found, runs=0 * psi).variance() == (0.0, 3.0)
    single = replace(found, singles=np.array([[4.0]]), single_degrees=5.0)
    assert single.variance()[0] == pytest.approx(61.0)
    assert single.variance()[1] == pytest.approx(61**2 / (81 / 2 + 36**2 + 16**2 / 5))
    assert found.of(np.array([[2.0]])).variance()[0] == pytest.approx(4 * 45.0)


def test_levels_of_a_sweep_move_together() -> None:
    """ψ alike at two levels of two runs: runs alone give 4 times 2·1², the sweeps twice as much, with one degree."""
    psi = np.array([[1.0], [-1.0], [1.0], [-1.0]])
    apart = Influence(psi, np.array([2, 2]), np.zeros((0, 1)), 0.0)
    swept = replace(apart, swept=True)
    assert apart.variance()[0] == pytest.approx(8.0) and swept.variance()[0] == pytest.approx(16.0)
    assert swept.covariance() == pytest.approx(16.0)
    assert swept.variance()[1] == pytest.approx(16**2 / (16 + 16 + 64))


def runs_of(influence: np.ndarray) -> list[RunStatistics]:
    """Levels whose runs would move one parameter so, shape (L, R), with hardly any noise within a run."""
    return [
        RunStatistics(float(i), np.zeros(1), np.eye(1), row[:, None] - row.mean(), np.full(1, 1e-12), 20.0)
        for i, row in enumerate(influence)
    ]


def test_sweeps_count_as_many_observations_as_there_are_sweeps() -> None:
    """m_r common to L levels: V = Σ m²/(R − 1)/R with R − 1 degrees of freedom beside each level's own."""
    random = np.random.default_rng(2)
    shift = np.array([0.3, -0.1, 0.4, -0.6])
    own = 0.01 * random.standard_normal((8, 4))
    levels = runs_of(shift + own)
    common = common_shifts(levels, 0)
    assert common == pytest.approx(shift + own.mean(axis=0) - (shift + own).mean(), abs=1e-12)
    found = pooled_scatter(levels)
    assert found.common[0] == pytest.approx(common @ common / 3 / 4) and found.common_degrees == 3
    assert found.degrees[:, 0] == pytest.approx(np.full(8, 3.0), rel=0.02)
    left = own - own.mean(axis=0) - own.mean(axis=1, keepdims=True) + own.mean()
    pooled = (left**2).sum() / (7 * 3) / 4
    assert found.own[:, 0].mean() == pytest.approx(pooled, rel=0.3) and found.pooled[0, 0] == pytest.approx(pooled)


def test_white_noise_has_as_many_samples_as_it_has_and_a_memory_fewer() -> None:
    """AR(1) of φ leaves n (1 − φ)/(1 + φ)."""
    random = np.random.default_rng(0)
    e = random.standard_normal(20_000)
    for k in range(1, len(e)):
        e[k] += 0.8 * e[k - 1]
    count, first = effective_samples(e)
    assert count == pytest.approx(20_000 * 0.2 / 1.8, rel=0.15) and first == pytest.approx(0.8, abs=0.02)
