"""Values that scatter about a line: certified variance components, and the next value of a set of sessions."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import stdtrit

from eaid.estimate.mixed import MixedLine, MixedValues, fit_restricted

DYESTUFF = np.array(  # Davies (1947), as in lme4: six batches of five yields [g]
    [
        [1545, 1440, 1440, 1520, 1580],
        [1540, 1555, 1490, 1560, 1495],
        [1595, 1550, 1605, 1510, 1560],
        [1445, 1440, 1595, 1465, 1545],
        [1595, 1630, 1515, 1635, 1625],
        [1520, 1455, 1450, 1480, 1445],
    ],
    dtype=float,
)
T_S = [
    [0.175, 0.325, 0.934],
    [0.111, 0.400, 1.312],
    [0.120, 0.264, 0.642],
    [0.095, 0.210, 0.500],
    [0.150, 0.330, 0.900],
]
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
    assert stdtrit(degrees, 0.975) * np.sqrt(variance) == pytest.approx(131.829, rel=1e-5)


def sessions() -> MixedValues:
    """Five sessions at 150, 200 and 300 V."""
    x, session = np.tile(np.log(np.array([150, 200, 300]) / 200), 5), np.repeat(np.arange(5), 3)
    same = (session[:, None] == session).astype(float)
    G = (same, same * np.outer(x, x), np.eye(15))
    return MixedValues(np.log(np.ravel(T_S)), np.c_[np.ones(15), x], RUN / 5 * np.eye(15), G)


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
