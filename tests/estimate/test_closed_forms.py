"""Closed forms that decide: degrees of freedom, sweeps, values that scatter about a line, trends over the levels."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy import stats

from eaid.estimate.mixed import MixedLine, MixedValues, fit_restricted
from eaid.estimate.scatter import RunStatistics, common_shifts, pool_scatter
from eaid.estimate.spread import Influence, LevelScatter, interval_of, log_interval_of, satterthwaite
from eaid.estimate.trends import fit_trend
from eaid.plant.trends import evaluate


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


DYESTUFF = np.array([  # Davies (1947), as in lme4: six batches of five yields [g]
    [1545, 1440, 1440, 1520, 1580], [1540, 1555, 1490, 1560, 1495], [1595, 1550, 1605, 1510, 1560],
    [1445, 1440, 1595, 1465, 1545], [1595, 1630, 1515, 1635, 1625], [1520, 1455, 1450, 1480, 1445],
], dtype=float)  # fmt: skip
T_S = (0.175, 0.325, 0.934, 0.111, 0.4, 1.312, 0.12, 0.264, 0.642, 0.095, 0.21, 0.5, 0.15, 0.33, 0.9)
RUN = 0.11**2  # variance of a single run's logarithm


def ahead(line: MixedLine, x: np.ndarray, known: float = np.inf) -> tuple[float, float, float]:
    """Mean, variance and degrees of freedom of a further value that has nothing in common with the others."""
    found = line.further(x[None], np.zeros((1, len(line.values.y), 1)), np.ones((1, 1, 1)))
    return found.mean.item(), found.covariance.item(), found.degrees(np.ones((1, 1)), known).item()


def test_dyestuff_as_lme4_has_it():
    batch = np.repeat(np.arange(6), 5)
    same = (batch[:, None] == batch).astype(float)
    line = fit_restricted(MixedValues(DYESTUFF.ravel(), np.ones((30, 1)), np.zeros((30, 30)), (same, np.eye(30))))
    np.testing.assert_allclose(line.v, [1764.0504, 2451.25], rtol=1e-5)
    np.testing.assert_allclose([line.beta[0], line.covariance[0, 0]], [1527.5, 375.7167], rtol=1e-5)


def test_the_next_batch_has_the_interval_of_a_further_mean():
    line = fit_restricted(MixedValues(DYESTUFF.mean(axis=1), np.ones((6, 1)), np.zeros((6, 6)), (np.eye(6),)))
    mean, variance, degrees = ahead(line, np.ones(1))
    assert (mean, degrees) == pytest.approx((1527.5, 5.0), rel=1e-5)
    assert stats.t.ppf(0.975, degrees) * np.sqrt(variance) == pytest.approx(131.829, rel=1e-5)


def sessions() -> MixedValues:
    """Five sessions at 150, 200 and 300 V."""
    x, session = np.tile(np.log(np.array([150, 200, 300]) / 200), 5), np.repeat(np.arange(5), 3)
    same = (session[:, None] == session).astype(float)
    G = (same, same * np.outer(x, x), np.eye(15))
    return MixedValues(np.log(T_S), np.c_[np.ones(15), x], RUN / 5 * np.eye(15), G)


@pytest.fixture(scope="module")
def line() -> MixedLine:
    return fit_restricted(sessions())


def test_the_variances_are_those_of_statsmodels_mixedlm():
    """statsmodels 0.15: `y ~ x`, groups of sessions, re_formula 1, vc_formula 0 + x, REML; no variance known."""
    plain = replace(sessions(), W=np.zeros((15, 15)))
    found = fit_restricted(plain)
    np.testing.assert_allclose(found.v, [0.0553075, 0.1906696, 0.01213644], rtol=1e-6)
    np.testing.assert_allclose(np.sqrt(np.diag(found.covariance)), [0.1090230, 0.2194123], rtol=1e-6)


def test_sessions_scatter_in_gain_tilt_and_level(line):
    np.testing.assert_allclose(np.sqrt(line.v), [0.2352, 0.4367, 0.0986], rtol=1e-3)
    np.testing.assert_allclose(line.beta, [-1.2640, 2.6623], rtol=1e-4)
    np.testing.assert_allclose(np.sqrt(np.diag(line.covariance)), [0.1090, 0.2194], rtol=1e-3)
    assert line.cost == pytest.approx(-12.20916, abs=1e-5)


def test_slope_and_curvature_are_those_of_the_likelihood(line):
    v, step = np.array([0.03, 0.1, 0.02]), 1e-6
    values = line.values
    ways = step * np.eye(3)
    slope = [(values.at(v + d).cost - values.at(v - d).cost) / (2 * step) for d in ways]
    curvature = [(values.likelihood(v + d)[1] - values.likelihood(v - d)[1]) / (2 * step) for d in ways]
    np.testing.assert_allclose(values.likelihood(v)[1], slope, rtol=1e-6)
    np.testing.assert_allclose(values.at(v).curvature, curvature, rtol=1e-5)


def test_values_that_scatter_less_than_they_are_known_have_no_component():
    x = np.linspace(0, 1, 8)
    off = 0.1 * np.array([1, -1, -1, 1, 1, -1, -1, 1])  # neither shifts nor tilts a line
    line = fit_restricted(MixedValues(2 + x + off, np.c_[np.ones(8), x], np.eye(8), (np.eye(8),)))
    assert line.v[0] == 0
    assert ahead(line, np.array([1, 0.5]), 6.0) == pytest.approx((2.5, 0.125, 6.0))


STRESS = np.array([17, 34, 51, 68, 85, 102, 119, 136, 153, 170]) / 6.283e-3 / 1e3
SPEED = np.arange(5.0, 41.0, 5.0)


def test_rmse_by_hand() -> None:
    found = fit_trend(np.array([0.0, 1.0, 2.0]), np.array([0.0, 3.0, 0.0]), "stress_kpa", "linear")
    assert found.coefficients == pytest.approx((0.0, 1.0), abs=1e-12) and found.rmse == pytest.approx(np.sqrt(2))


@pytest.mark.parametrize("truth", [(2.0, 0.3, -0.06), (100.0, 0.0, -0.0507), (5.0, -0.1, 0.01)])
def test_merged_rates_are_reported_as_their_limit(truth: tuple[float, float, float]) -> None:
    found = fit_trend(SPEED, evaluate("merged-exponential", truth, SPEED), "speed_rpm", "double-exponential")
    if truth[1] == 0:  # one exponential: any second rate does, but never two huge weights
        assert max(abs(c) for c in found.coefficients) < 1e3 * truth[0]
    else:
        assert found.form == "merged-exponential"
        assert found.coefficients == pytest.approx(truth, rel=1e-4)
    assert found.rmse < 1e-6


def test_a_rate_as_steep_as_is_looked_for_is_said() -> None:
    y = np.where(SPEED[0] == SPEED, 5.0, 1.0 + 0.01 * SPEED)  # one odd point
    found = fit_trend(SPEED, y, "speed_rpm", "double-exponential")
    assert found.at_bounds


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_no_start_of_many_does_better(seed: int) -> None:
    rng = np.random.default_rng(seed)
    y = evaluate("double-exponential", (1.37, 0.0476, 40.25, -0.219), STRESS) * np.exp(0.05 * rng.normal(size=10))
    found = fit_trend(STRESS, y, "stress_kpa", "double-exponential")
    rates = np.linspace(-1.2, 0.4, 161)
    best = np.inf
    for i, r1 in enumerate(rates):
        for r2 in rates[i + 2 :]:
            design = np.exp(np.multiply.outer(STRESS, [r1, r2]))
            left = design @ np.linalg.lstsq(design, y, rcond=None)[0] - y
            best = min(best, float(left @ left))
    assert found.rmse**2 * 10 <= best * (1 + 1e-6)
