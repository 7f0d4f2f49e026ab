"""The sums behind every fit: gradient and curvature against complex steps, full data against plain sums."""

import numpy as np
import pytest

from eaid.fitting.compress import Points
from eaid.fitting.kernel import (
    Record,
    by_tau,
    decay,
    full_sums,
    level_costs,
    level_curvature,
    level_normal,
    level_sums,
    log_curvature,
    log_products,
    residuals,
    stretch,
    weighted_shares,
)

RNG = np.random.default_rng(3)
TIMES = np.sort(RNG.uniform(0, 10, (1, 40)))
POINTS = Points(TIMES, RNG.normal(1, 0.3, (3, 40)), RNG.uniform(0.5, 3, (1, 40)))
THETA = np.array([[1.0, 2.0, 0.5], [0.2, 0.5, 1.0], [4.0, 9.0, 2.0], [0.85, 0.6, 0.9]])


def test_cost_by_hand() -> None:
    points = Points(np.array([[0.0, 1.0]]), np.array([[0.5, 1.0]]), np.array([[2.0, 3.0]]))
    cost, _ = level_sums(np.array([[2.0], [1.0], [2.0], [0.5]]), points)
    curve = 2 * (1 - 0.5 * np.exp(-1) - 0.5 * np.exp(-0.5))
    assert cost[0] == pytest.approx(2 * 0.25 + 3 * (curve - 1) ** 2, rel=1e-14)


@pytest.mark.parametrize("k", range(4))
def test_gradient_and_curvature(k: int) -> None:
    shifted = THETA.astype(complex)
    shifted[k] += 1e-30j
    cost, gradient = level_sums(shifted, POINTS)
    assert level_sums(THETA, POINTS)[1][k] == pytest.approx(cost.imag / 1e-30, rel=1e-11)
    exact = level_curvature(THETA, POINTS)
    assert pytest.approx(gradient.imag / 1e-30, rel=1e-10, abs=1e-9) == exact[:, :, k].T


def test_gauss_newton_is_the_exact_curvature_where_nothing_is_left() -> None:
    theta = THETA[:, :1]
    curve = residuals(theta, [Record(TIMES[0], np.zeros(40), False)])[0]
    points = Points(TIMES, curve[None], POINTS.w)
    assert level_normal(theta, points)[2] == pytest.approx(level_curvature(theta, points), rel=1e-12)


@pytest.mark.parametrize("points", [POINTS, Points(np.tile(TIMES, (3, 1)), POINTS.y, np.tile(POINTS.w, (3, 1)))])
def test_one_product_gives_the_same_sums(points: Points) -> None:
    cost, gradient, _ = level_normal(THETA, points)
    assert cost == pytest.approx(level_sums(THETA, points)[0], rel=1e-13)
    assert gradient == pytest.approx(level_sums(THETA, points)[1], rel=1e-11)
    assert level_curvature(THETA, points) == pytest.approx(level_curvature(THETA, POINTS), rel=1e-12)


@pytest.mark.parametrize("points", [POINTS, Points(np.tile(TIMES, (3, 1)), POINTS.y, np.tile(POINTS.w, (3, 1)))])
def test_sums_in_ln_tau_are_those_by_tau(points: Points) -> None:
    cost, gradient, curvature = by_tau(THETA, log_products(THETA, weighted_shares(THETA[3], points), points))
    want = level_normal(THETA, points)
    assert cost == pytest.approx(want[0], rel=1e-12)
    assert gradient == pytest.approx(want[1][:3], rel=1e-11)
    assert curvature == pytest.approx(want[2][:, :3, :3], rel=1e-12)


def test_curvature_in_ln_tau_by_complex_steps() -> None:
    slope, H = log_curvature(THETA, weighted_shares(THETA[3], POINTS), POINTS)
    scale = np.stack([np.ones(3), THETA[0], THETA[0]])  # the steps in ln τ are over T_s
    for k in range(3):
        shifted = THETA.astype(complex)
        shifted[k] = shifted[k] + 1e-30j if k == 0 else shifted[k] * np.exp(1e-30j)
        cost, gradient = level_sums(shifted, POINTS)
        by_log = gradient[:3] * np.stack([np.ones(3), *shifted[1:3]])
        assert 2 * slope[:, k] == pytest.approx(cost.imag / 1e-30 / scale[k], rel=1e-10)
        want = by_log.imag / 1e-30 / scale / scale[k]
        assert pytest.approx(want, rel=1e-9, abs=1e-9) == 2 * H[:, :, k].T


def test_costs_alone() -> None:
    two = np.stack([THETA, 1.1 * THETA], axis=1)
    want = [level_sums(theta, POINTS)[0] for theta in (THETA, 1.1 * THETA)]
    assert level_costs(two, POINTS) == pytest.approx(np.array(want), rel=1e-12)


@pytest.mark.parametrize("n", [300, 5000, 5003, 70_003])
def test_full_sums_are_the_plain_sums(n: int) -> None:
    t = 0.002 + np.arange(n) / 500
    y = RNG.normal(1, 0.3, (3, n))
    records = [Record(t, row, True) for row in y]
    want = level_sums(THETA, Points(t[None], y, np.ones((1, n))))
    for got in (full_sums(THETA, records), full_sums(THETA, records, y)):
        assert got[0] == pytest.approx(want[0], rel=1e-12)
        assert got[1] == pytest.approx(want[1], rel=1e-10, abs=1e-9)
    squares = [r @ r for r in residuals(THETA, records)]
    assert squares == pytest.approx(want[0], rel=1e-12)


def test_a_geometric_sequence_is_the_exponential() -> None:
    t = np.arange(10_000) / 1000
    assert decay(Record(t, t, True), 0.7) == pytest.approx(np.exp(-t / 0.7), rel=2e-15)


@pytest.mark.parametrize(("n", "want"), [(100, 0), (30_000, 200), (20_000, 160)])
def test_stretches_divide_the_record(n: int, want: int) -> None:
    assert stretch(n) == want
