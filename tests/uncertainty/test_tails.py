"""Tails and quantiles of F and t against SciPy, against closed forms and against each other."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import special

from eaid.uncertainty.tails import chi2_quantile, f_quantile, f_tail, log_beta, t_reach, trigamma

few = st.floats(0.5, 3000.0)
share = st.floats(1e-4, 1 - 1e-4)


@given(few, few, share)
def test_quantiles_are_those_of_scipy(d1, d2, p):
    assert f_quantile(d1, d2, p) == pytest.approx(special.fdtri(d1, d2, p), rel=1e-9)


@given(few, few, st.floats(1e-3, 1e3))
def test_tails_are_those_of_scipy(d1, d2, x):
    assert f_tail(d1, d2, x) == pytest.approx(special.fdtrc(d1, d2, x), rel=1e-9, abs=1e-290)


@given(st.floats(0.1, 1e6), share)
def test_reaches_are_those_of_scipy(degrees, nominal):
    # at many degrees of freedom the logarithms of gamma cancel
    assert t_reach(degrees, nominal) == pytest.approx(special.stdtrit(degrees, 0.5 + nominal / 2), rel=1e-9)


def test_closed_forms():
    assert t_reach(1.0, 0.95) == pytest.approx(math.tan(0.475 * math.pi), rel=1e-13)  # Cauchy
    assert t_reach(2.0, 0.5) == pytest.approx(math.sqrt(2 / 3), rel=1e-13)
    assert f_tail(2.0, 6.0, 4.0) == pytest.approx((1 + 2 * 4 / 6) ** -3, rel=1e-13)
    assert f_tail(2.0, 8.0, 0.5) == pytest.approx((1 + 1 / 8) ** -4, rel=1e-13)
    assert t_reach(1e6, 0.95) == pytest.approx(1.959966356, abs=1e-8)
    assert log_beta(3, 4) == pytest.approx(-math.log(60), rel=1e-14)


@pytest.mark.parametrize("b", [0.5, 3.0, 9.99, 10.0, 300.0])
@pytest.mark.parametrize("a", [0.01, 9.99, 10.0, 57.0, 5e5])
def test_log_beta(a, b):
    assert log_beta(a, b) == pytest.approx(special.betaln(a, b), rel=1e-13, abs=1e-13 + 1e-14 * a)  # SciPy cancels
    assert log_beta(a, b) == log_beta(b, a)


@given(st.floats(0.1, 1e4), st.floats(0.1, 1e4), st.floats(0.01, 0.99))
def test_the_quantile_is_the_inverse_of_the_tail(d1, d2, p):
    x = f_quantile(d1, d2, p)
    if 1e-300 < x < 1e300:
        assert 1 - f_tail(d1, d2, x) == pytest.approx(p, rel=1e-9)


def test_the_ends_of_the_domain():
    assert f_tail(3, 4, 0.0) == 1.0 and f_tail(3, 4, math.inf) == 0.0
    assert f_quantile(3, 4, 0.0) == 0.0 and f_quantile(3, 4, 1.0) == math.inf
    assert t_reach(5.0, 0.0) == 0.0 and t_reach(1e-3, 0.95) == math.inf
    outside = [f_tail(0, 4, 1.0), f_tail(3, -1, 1.0), f_tail(3, 4, -1.0), f_tail(3, 4, math.nan), f_quantile(3, 4, 1.1),
               f_quantile(math.nan, 4, 0.5), t_reach(-1.0, 0.5)]  # fmt: skip
    assert all(math.isnan(value) for value in outside)


def test_arrays_go_entry_by_entry():
    found = f_tail(np.array([1.0, 2.0]), 3.0, np.array([[2.0], [4.0]]))
    assert found.shape == (2, 2)
    assert found[1, 0] == f_tail(1.0, 3.0, 4.0)
    assert t_reach(np.array([2.0, 5.0]), 0.95).tolist() == [t_reach(2.0, 0.95), t_reach(5.0, 0.95)]


@pytest.mark.parametrize("p", [0.025, 0.5, 0.975])
@pytest.mark.parametrize("degrees", [1.0, 2.0, 9.0, 100.0])
def test_chi_squared(degrees, p):
    assert chi2_quantile(degrees, p) == pytest.approx(special.chdtri(degrees, 1 - p), rel=1e-6)


def test_trigamma():
    x = np.array([0.05, 0.5, 1.0, 3.3, 40.0, 1e4])
    assert trigamma(x) == pytest.approx(special.polygamma(1, x), rel=1e-13)
    assert trigamma(np.array([1.0])) == pytest.approx([math.pi**2 / 6], rel=1e-13)
    assert x[0] == 0.05
