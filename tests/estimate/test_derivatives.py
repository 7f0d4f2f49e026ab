"""Derivatives behind every fit, against complex steps and differences; compression; verdicts on known minima."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from eaid.estimate.data import data_of
from eaid.estimate.forms import nonlinear
from eaid.estimate.points import Points, compress, level_normal, log_crossed
from eaid.estimate.solver import EndPoint, Problem, approach, newton_step, polish, slsqp, solve_ends
from eaid.levels.from_steps import StepProblem
from eaid.plant.dynamics import REFERENCE_PLANT

RNG = np.random.default_rng(3)
TIMES = np.sort(RNG.uniform(0, 10, (1, 40)))
POINTS = Points(TIMES, RNG.normal(1, 0.3, (3, 40)), RNG.uniform(0.5, 3, (1, 40)))
THETA = np.array([[1.0, 2.0, 0.5], [0.2, 0.5, 1.0], [4.0, 9.0, 2.0], [0.85, 0.6, 0.9]])


def eq3(theta: Any, t: Any) -> Any:
    """Eq. (3) in plain words, of complex θ too."""
    Ts, tau1, tau2, share = theta[:, :, None]
    return Ts * (1 - share * np.exp(-t / tau1) - (1 - share) * np.exp(-t / tau2))


@pytest.mark.parametrize("rows", [1, 3], ids=["one grid", "a grid each"])
def test_cost_gradient_and_curvature_of_a_level_by_complex_steps(rows: int) -> None:
    points = Points(np.tile(TIMES, (rows, 1)), POINTS.y, np.tile(POINTS.w, (rows, 1)))
    at = level_normal(THETA, points)
    steps = [eq3(THETA + 1e-30j * np.eye(4)[k][:, None], points.t_s).imag / 1e-30 for k in range(4)]
    J, left = np.stack(steps, axis=1), eq3(THETA, points.t_s) - points.y
    assert at.cost == pytest.approx((points.w * left**2).sum(axis=1), rel=1e-13)
    assert at.score == pytest.approx(np.einsum("lkp,lp->lk", J, points.w * left), rel=1e-11)
    assert at.information == pytest.approx((J * points.w[:, None]) @ J.transpose(0, 2, 1), rel=1e-12)
    other = THETA * 1.1
    ways = [eq3(other + 1e-30j * np.eye(4)[k][:, None], points.t_s).imag / 1e-30 for k in range(4)]
    by_log = J * np.array([*THETA[:3], THETA[3] * (1 - THETA[3])]).T[:, :, None]
    mine = log_crossed(THETA, other, points, True)
    assert mine == pytest.approx((by_log * points.w[:, None]) @ np.stack(ways, axis=1).transpose(0, 2, 1), rel=1e-11)


@pytest.mark.parametrize("share", [0.85, None])
def test_gradient_and_curvature_of_the_joint_fit_by_differences(
    share: float | None, clutch_set: Callable[..., Any]
) -> None:
    data = data_of(clutch_set(duration_s=2.0, rate_hz=100.0, noise_nm=0.02).levels)
    model = nonlinear(data.u, share)
    problem = StepProblem(data, model, np.ones(len(data.u))).problem
    x = model.unknowns(REFERENCE_PLANT) * 1.03
    _, gradient = problem.value(x)
    assert problem.exact is not None
    exact = problem.exact(x)
    for k in range(model.size):
        step = 1e-6 * max(abs(x[k]), 1e-2) * np.eye(model.size)[k]
        (above, slope_above), (below, slope_below) = problem.value(x + step), problem.value(x - step)
        assert (above - below) / (2 * step[k]) == pytest.approx(gradient[k], rel=1e-5, abs=1e-5)
        assert (slope_above - slope_below) / (2 * step[k]) == pytest.approx(exact[:, k], rel=1e-4, abs=1e-2)


@pytest.mark.parametrize("jitter", [0.0, 5e-4])
@pytest.mark.parametrize("theta", [(2.0, 0.25, 5.0, 0.85), (4.0, 0.6, 16.0, 0.85), (2.0, 5e-4, 0.02, 0.85)])
def test_compressed_samples_have_the_sum_of_squares_of_all(theta: tuple[float, ...], jitter: float) -> None:
    rng = np.random.default_rng(2)
    t = np.cumsum(rng.uniform(0.001 - jitter, 0.001 + jitter, 20_000)) if jitter else np.arange(30_000) / 1000
    column = np.array(theta)[:, None]
    y = eq3(np.array([[2.1], [0.3], [4.0], [0.85]]), t[None])[0] + 0.01 * rng.normal(size=len(t))
    points = compress([t], [y])
    floor = y @ y - np.sum(points.w * points.y**2)
    short = floor + np.sum(points.w * (points.y - eq3(column, points.t_s)) ** 2)
    assert short == pytest.approx(np.sum((y - eq3(column, t[None])[0]) ** 2), rel=1e-8)
    assert points.w.sum() == pytest.approx(len(t)) and points.y.size < 200


SCALES, CENTRE = np.array([1.0, 1e-4, 1e5]), np.array([2.0, 3e-4, -4e5])


def bowl(third_at_least: float | None = None, left: float = 1.0) -> Problem:
    """A badly scaled sum of squares about CENTRE, with something left at its minimum."""

    def normal(x: Any) -> Any:
        r = (x - CENTRE) / SCALES
        slope = 2 * r / SCALES + np.array([4 * r[0] ** 3, 0, 0])
        return float(r @ r + r[0] ** 4 + left), slope, np.diag(2 / SCALES**2)

    rows = 0 if third_at_least is None else 1
    A, b = np.array([[0.0, 0.0, 1.0]])[:rows], np.array([third_at_least or 0.0])[:rows]
    return Problem(normal, A, b, "row {}".format)


def test_badly_scaled_unknowns_and_a_constraint_are_no_trouble() -> None:
    free, held = (
        polish(problem, solve_ends([approach(problem, np.zeros(3))], problem)[0])[0] for problem in (bowl(), bowl(-1e5))
    )
    assert (free.x - CENTRE) / SCALES == pytest.approx(0, abs=1e-6)
    assert held.x[2] == pytest.approx(-1e5, rel=1e-9) and held.x[2] >= -1e5
    assert held.x[:2] == pytest.approx(CENTRE[:2], rel=1e-6)


def test_newton_step_is_the_constrained_minimum_of_its_parabola() -> None:
    H, g = np.array([[2.0, 0.5], [0.5, 1.0]]), np.array([-4.0, -3.0])
    A, b = np.array([[-1.0, 0.0], [0.0, -1.0]]), np.array([-1.0, -5.0])  # x ≤ 1, y ≤ 5
    step = newton_step(Problem(lambda _: (0.0, g, H), A, b, "row {}".format), np.zeros(2), g, H)
    assert step.d == pytest.approx([1.0, 2.5]) and step.active == (0,)  # x held at 1, then y = 3 − 0.5 x
    assert step.decrease == pytest.approx(-(g @ step.d + 0.5 * step.d @ H @ step.d))


def test_a_newton_step_whose_unknowns_are_1e30_apart_is_one() -> None:
    """LU takes such a factor for singular, and a fit ended in a LinAlgError."""
    sizes = np.array([1e9, 1e-52, 1e-51, 1e-23, 1e8])
    root = np.tril(np.full((5, 5), 0.3)) + 0.7 * np.eye(5)
    H = np.sqrt(np.outer(sizes, sizes)) * (root @ root.T)
    g = -H @ (1 / np.sqrt(sizes))
    none = np.zeros((0, 5))
    step = newton_step(Problem(lambda _: (0.0, g, H), none, np.zeros(0), "row {}".format), np.zeros(5), g, H)
    assert step.d * np.sqrt(sizes) == pytest.approx(np.ones(5), rel=1e-6)


def test_the_verdict_sees_a_point_that_is_no_minimum(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also where SLSQP says success where it began."""
    problem, x = bowl(), CENTRE + SCALES * np.array([0.0, 0.1, 0.0])
    start = EndPoint(x, problem.value(x)[0], 1)
    assert polish(problem, start, steps=0)[1] == pytest.approx(0.01 / 1.01, rel=1e-6)
    end, promise, _ = polish(problem, start)
    assert promise < 1e-12 and end.cost == pytest.approx(1.0)
    monkeypatch.setattr("eaid.estimate.solver.minimize", lambda *_, **__: SimpleNamespace(x=np.zeros(3), nfev=1))
    end = slsqp(problem, start)
    assert np.array_equal(end.x, x) and polish(problem, end, steps=0)[1] > 1e-3


def test_nothing_left_is_not_divided_by() -> None:
    problem = bowl(left=0.0)
    end = slsqp(problem, EndPoint(CENTRE.copy(), 0.0, 1))
    assert end.cost == 0.0 and polish(problem, end)[1] == 0.0


@pytest.mark.parametrize("bend", [0.03, 0.0])
def test_a_bend_of_the_cost_is_an_end(bend: float) -> None:
    """1 + (x − 0.31)²/2 + b |x − 0.3|/2, least at its bend: a good log was refused, as its fit had not converged."""

    def normal(x: Any) -> tuple[float, Any, Any]:
        off = x - 0.31
        slope = off + 0.5 * bend * np.where(x < 0.3, -1.0, 1.0)
        return float(1 + 0.5 * off @ off + 0.5 * bend * np.abs(x - 0.3).sum()), slope, np.eye(1)

    problem = Problem(normal, np.zeros((0, 1)), np.zeros(0), str)
    end, predicted, _ = polish(problem, EndPoint(np.array([0.3 if bend else 0.2]), 2.0, 0))
    assert predicted == 0 and end.x[0] == pytest.approx(0.3 if bend else 0.31, abs=1e-9)
