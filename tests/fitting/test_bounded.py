"""Least squares between bounds, against SciPy's, closed forms, and a kink."""

import numpy as np
import pytest
from scipy.optimize import least_squares, lsq_linear

from eaid.arrays import Array
from eaid.fitting.bounded import least_squares_between


@pytest.mark.parametrize("seed", range(20))
def test_a_linear_problem_ends_where_scipys_active_set_does(seed: int) -> None:
    random = np.random.default_rng(seed)
    A, b = random.standard_normal((12, 5)), random.standard_normal(12)
    low, high = -random.uniform(0, 0.3, 5), random.uniform(0, 0.3, 5)
    x, cost = least_squares_between(lambda x: (A @ x - b, A), np.zeros(5), low, high, 1e-14)
    best = lsq_linear(A, b, (low, high), method="bvls", tol=1e-14)
    assert x == pytest.approx(best.x, abs=1e-6)
    assert cost == pytest.approx(2 * best.cost, rel=1e-12)
    assert (best.active_mask != 0).any()


def rosenbrock(x: Array) -> tuple[Array, Array]:
    return np.array([10 * (x[1] - x[0] ** 2), 1 - x[0]]), np.array([[-20 * x[0], 10.0], [-1.0, 0.0]])


def test_a_bent_valley_is_followed_to_its_end_and_to_a_bound_across_it() -> None:
    start, low = np.array([-1.2, 1.0]), np.array([-2.0, -2.0])
    x, cost = least_squares_between(rosenbrock, start, low, np.array([2.0, 2.0]), 1e-14)
    assert x == pytest.approx([1.0, 1.0], abs=1e-6) and cost < 1e-12
    x, cost = least_squares_between(rosenbrock, start, low, np.array([0.5, 2.0]), 1e-14)
    assert x == pytest.approx([0.5, 0.25]) and cost == pytest.approx(0.25)


def test_a_start_outside_is_taken_to_the_bound() -> None:
    x, cost = least_squares_between(rosenbrock, np.array([9.0, 9.0]), np.array([2.0, 0.0]), np.array([3.0, 3.0]), 1e-14)
    assert x == pytest.approx([2.0, 3.0]) and cost == pytest.approx(101.0)


@pytest.mark.parametrize("seed", range(10))
def test_exponentials_end_no_higher_than_with_scipys_trust_region(seed: int) -> None:
    random = np.random.default_rng(seed)
    t = np.linspace(0, 3, 200)
    y = 1 - np.exp(-t / random.uniform(0.2, 2.0)) + 0.05 * random.standard_normal(200)

    def model(x: Array) -> tuple[Array, Array]:
        fall = np.exp(-t / np.exp(x[1]))
        return x[0] * (1 - fall) - y, np.stack([1 - fall, -x[0] * fall * t / np.exp(x[1])], axis=1)

    low, high = np.array([0.0, -3.0]), np.array([0.95, 3.0])
    start = np.array([0.5, -1.0])
    x, cost = least_squares_between(model, start, low, high, 1e-13)
    theirs = least_squares(lambda x: model(x)[0], start, lambda x: model(x)[1], (low, high), ftol=1e-13, xtol=1e-13)
    assert cost <= 2 * theirs.cost * (1 + 1e-10)
    assert x == pytest.approx(theirs.x, abs=1e-4)


def test_a_kink_ends_it() -> None:
    """|x| + 1 as one residual: no step from 0 lowers it, and each promises to."""
    looked_at = []

    def model(x: Array) -> tuple[Array, Array]:
        looked_at.append(x)
        return np.abs(x) + 1, np.array([[1.0 if x[0] >= 0 else -1.0]])

    x, cost = least_squares_between(model, np.array([0.7]), np.array([-1.0]), np.array([1.0]), 1e-12)
    assert abs(x[0]) < 1e-6 and cost == pytest.approx(1.0)
    assert len(looked_at) < 100


def test_an_unknown_that_no_residual_tells_stays_where_it_is() -> None:
    def model(x: Array) -> tuple[Array, Array]:
        return np.array([x[0] - 3, x[0] + 1]), np.array([[1.0, 0.0], [1.0, 0.0]])

    x, cost = least_squares_between(model, np.array([0.0, 0.4]), np.full(2, -5.0), np.full(2, 5.0), 1e-14)
    assert x == pytest.approx([1.0, 0.4]) and cost == pytest.approx(8.0)
