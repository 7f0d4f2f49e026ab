"""The sums behind every fit: gradient and curvature against complex steps, full data against plain sums."""

import numpy as np
import pytest

from eaid.fitting.sums import (
    Points,
    Record,
    by_log,
    by_tau,
    decay,
    full_sums,
    level_costs,
    level_normal,
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


ALIKE = Points(np.tile(TIMES, (3, 1)), POINTS.y, np.tile(POINTS.w, (3, 1)))


def _curve(theta: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Eq. (3) in plain words, of complex θ too."""
    Ts, tau1, tau2, share = theta[:, :, None]
    return np.asarray(Ts * (1 - share * np.exp(-t / tau1) - (1 - share) * np.exp(-t / tau2)))


def _cost(theta: np.ndarray, points: Points = POINTS) -> np.ndarray:
    return np.asarray((points.w * (_curve(theta, points.t_s) - points.y) ** 2).sum(axis=1))


def _slopes(theta: np.ndarray, points: Points = POINTS) -> np.ndarray:
    """∂f/∂θ at the points by complex steps, (L, 4, P)."""
    steps = [_curve(theta + 1e-30j * np.eye(4)[k][:, None], points.t_s).imag / 1e-30 for k in range(4)]
    return np.stack(steps, axis=1)


def test_cost_by_hand() -> None:
    points = Points(np.array([[0.0, 1.0]]), np.array([[0.5, 1.0]]), np.array([[2.0, 3.0]]))
    cost, *_ = level_normal(np.array([[2.0], [1.0], [2.0], [0.5]]), points)
    curve = 2 * (1 - 0.5 * np.exp(-1) - 0.5 * np.exp(-0.5))
    assert cost[0] == pytest.approx(2 * 0.25 + 3 * (curve - 1) ** 2, rel=1e-14)


@pytest.mark.parametrize("points", [POINTS, ALIKE])
def test_cost_gradient_and_gauss_newton(points: Points) -> None:
    cost, gradient, curvature = level_normal(THETA, points)
    J, left = _slopes(THETA, points), _curve(THETA, points.t_s) - points.y
    assert cost == pytest.approx(_cost(THETA, points), rel=1e-13)
    assert gradient == pytest.approx(2 * np.einsum("lkp,lp->kl", J, points.w * left), rel=1e-11)
    assert curvature == pytest.approx(2 * (J * points.w[:, None]) @ J.transpose(0, 2, 1), rel=1e-12)


@pytest.mark.parametrize("points", [POINTS, ALIKE])
def test_sums_in_ln_tau_are_those_by_tau(points: Points) -> None:
    products, want = log_products(THETA, weighted_shares(THETA[3], points), points), level_normal(THETA, points)
    for (cost, gradient, curvature), scale in ((by_tau(THETA, products), 1.0), (by_log(THETA, products), THETA[1:3])):
        by = np.concatenate([np.ones((1, 3)), scale * np.ones((2, 3))])
        assert cost == pytest.approx(want[0], rel=1e-12)
        assert gradient == pytest.approx(want[1][:3] * by, rel=1e-11)
        assert curvature == pytest.approx(want[2][:, :3, :3] * (by.T[:, :, None] * by.T[:, None, :]), rel=1e-12)


def test_curvature_in_ln_tau_by_complex_steps() -> None:
    slope, H = log_curvature(THETA, weighted_shares(THETA[3], POINTS), POINTS)
    for k in range(3):
        shifted = THETA.astype(complex)
        shifted[k] = shifted[k] + 1e-30j if k == 0 else shifted[k] * np.exp(1e-30j)
        assert slope[:, k] == pytest.approx(_cost(shifted).imag / 1e-30, rel=1e-10)
        curve = _curve(shifted, TIMES)  # the gradient by T_s, ln τ1, ln τ2 at the shifted place
        e = np.exp(-TIMES / shifted[1:3, :, None]) * TIMES / shifted[1:3, :, None] * shifted[0, :, None]
        by = (curve / shifted[0, :, None], -shifted[3, :, None] * e[0], -(1 - shifted[3, :, None]) * e[1])
        want = [2 * (POINTS.w * (curve - POINTS.y) * one).sum(axis=1).imag / 1e-30 for one in by]
        assert pytest.approx(np.array(want), rel=1e-9, abs=1e-9) == H[:, :, k].T


def test_costs_alone() -> None:
    two = np.stack([THETA, 1.1 * THETA], axis=1)
    want = [_cost(theta) for theta in (THETA, 1.1 * THETA)]
    assert level_costs(two, POINTS) == pytest.approx(np.array(want), rel=1e-12)


@pytest.mark.parametrize("n", [300, 5000, 5003, 70_003])
def test_full_sums_are_the_plain_sums(n: int) -> None:
    t = 0.002 + np.arange(n) / 500
    y = RNG.normal(1, 0.3, (3, n))
    records = [Record(t, row, True) for row in y]
    want = level_normal(THETA, Points(t[None], y, np.ones((1, n))))
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
