"""The solver on problems whose minimum is known, and the verdict that does not trust it."""

import numpy as np
import pytest

from eaid.fitting import solver
from eaid.fitting.solver import EndPoint, Problem, approach, ended, newton_step, polish, slsqp, whiten

SCALES = np.array([1.0, 1e-4, 1e5])
CENTRE = np.array([2.0, 3e-4, -4e5])


def _bowl(A: np.ndarray, b: np.ndarray, left: float = 1.0) -> Problem:
    """A badly scaled sum of squares about CENTRE, with something left at its minimum."""

    def normal(x: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
        r = (x - CENTRE) / SCALES
        slope = 2 * r / SCALES + np.array([4 * r[0] ** 3, 0, 0])
        return float(r @ r + r[0] ** 4 + left), slope, np.diag(2 / SCALES**2)

    return Problem(normal, A, b, "row {}".format)


FREE = np.zeros((0, 3)), np.zeros(0)


def test_whitening_factors_the_curvature() -> None:
    J = np.random.default_rng(0).normal(size=(9, 4)) * np.array([1, 1e3, 1e-5, 1])
    L = whiten(J.T @ J)
    assert pytest.approx(J.T @ J, rel=1e-12) == L @ L.T


def test_whitening_survives_a_direction_that_nothing_determines() -> None:
    L = whiten(np.array([[1.0, 1.0], [1.0, 1.0]]))
    assert np.isfinite(np.linalg.inv(L)).all()
    alone = np.diag([4e6, 0.0, 9e-4])  # the units of the others do not matter
    assert pytest.approx(alone, rel=1e-12, abs=1e-250) == whiten(alone) @ whiten(alone).T


def test_badly_scaled_unknowns_are_no_trouble() -> None:
    end = slsqp(_bowl(*FREE), np.zeros(3))
    assert (end.x - CENTRE) / SCALES == pytest.approx(0, abs=1e-6)


def test_a_constraint_holds_where_the_minimum_lies_beyond_it() -> None:
    A, b = np.array([[0.0, 0.0, 1.0]]), np.array([-1e5])
    end = slsqp(_bowl(A, b), np.array([0.0, 0.0, 0.0]))
    assert end.x[2] == pytest.approx(-1e5, rel=1e-9) and end.x[2] >= -1e5
    assert end.x[:2] == pytest.approx(CENTRE[:2], rel=1e-6)


def test_newton_step_is_the_constrained_minimum_of_its_parabola() -> None:
    H, g = np.array([[2.0, 0.5], [0.5, 1.0]]), np.array([-4.0, -3.0])
    A, b = np.array([[-1.0, 0.0], [0.0, -1.0]]), np.array([-1.0, -5.0])  # x ≤ 1, y ≤ 5
    problem = Problem(lambda _: (0.0, g, H), A, b, "row {}".format)
    step = newton_step(problem, np.zeros(2), g, H)
    assert step.d == pytest.approx([1.0, 2.5])  # x held at 1, then y = 3 − 0.5 x
    assert step.decrease == pytest.approx(-(g @ step.d + 0.5 * step.d @ H @ step.d))
    assert step.active == (0,)


def test_the_verdict_sees_a_point_that_is_no_minimum() -> None:
    problem = _bowl(*FREE)
    x = CENTRE + SCALES * np.array([0.0, 0.1, 0.0])
    end, promise, _ = polish(problem, EndPoint(x, problem.value(x)[0], 1), problem.value, steps=0)
    assert promise == pytest.approx(0.01 / 1.01, rel=1e-6)
    end, promise, _ = polish(problem, EndPoint(x, problem.value(x)[0], 1), problem.value)
    assert promise < 1e-12 and end.cost == pytest.approx(1.0)


def test_the_last_step_is_taken_where_the_cost_no_longer_shows_it() -> None:
    problem = _bowl(*FREE)
    x = CENTRE + SCALES * np.array([1e-9, -1e-9, 1e-9])
    assert problem.value(x)[0] == 1.0
    end, _, _ = polish(problem, EndPoint(x, 1.0, 1), problem.value)
    assert (end.x - CENTRE) / SCALES == pytest.approx(0, abs=1e-13)


def test_nothing_left_is_not_divided_by() -> None:
    problem = _bowl(*FREE, left=0.0)
    end = slsqp(problem, CENTRE.copy())
    assert end.cost == 0.0 and polish(problem, end, problem.value)[1] == 0.0


def test_an_approach_ends_next_to_the_minimum_and_the_solver_ends_it() -> None:
    A, b = np.array([[0.0, 0.0, 1.0]]), np.array([-1e5])
    problem = _bowl(A, b)
    near = approach(problem, np.zeros(3))
    assert near.cost == pytest.approx(problem.value(slsqp(problem, np.zeros(3)).x)[0], rel=1e-6)
    (end,) = ended([near], problem)
    assert end.cost <= near.cost and end.x[2] == pytest.approx(-1e5, rel=1e-9)
    assert end.x[:2] == pytest.approx(CENTRE[:2], rel=1e-6)


def test_the_solver_goes_once_into_each_minimum_and_leaves_hopeless_ends_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = _bowl(*FREE)
    places = [CENTRE + SCALES * np.array([0, shift, 0]) for shift in (0.0, 1e-5, 0.05, 3.0)]
    ends = [EndPoint(x, problem.value(x)[0], 1) for x in places]
    went = []
    monkeypatch.setattr(solver, "slsqp", lambda problem, x, _: went.append(x) or EndPoint(x, problem.value(x)[0], 1))
    found = ended(ends, problem)
    assert [end.cost for end in found] == pytest.approx([1.0, 1.0, 1.0025, 10.0])
    assert len(went) == 2 and np.array_equal(went[0], places[0]) and np.array_equal(went[1], places[2])


def test_a_solver_that_stops_at_once_is_not_believed(monkeypatch: pytest.MonkeyPatch) -> None:
    """SLSQP that says success where it began: rounds go on being asked, and the verdict tells what is left."""
    problem = _bowl(*FREE)
    x = CENTRE + SCALES * np.array([0.0, 0.1, 0.0])
    monkeypatch.setattr(solver, "_one_round", lambda problem, x, *_: (x, 1))
    end = slsqp(problem, x)
    assert np.array_equal(end.x, x) and polish(problem, end, problem.value, steps=0)[1] > 1e-3


def test_a_step_stays_inside_where_nothing_determines_it() -> None:
    A, b = np.array([[1.0, 0.0], [-1.0, 1.0]]), np.zeros(2)  # 0 ≤ x ≤ y
    H, g = np.array([[1e-83, 3e-42], [3e-42, 1.0]]), np.array([3e-42, -5.0])
    problem = Problem(lambda _: (1.0, g, H), A, b, "row {}".format)
    step = newton_step(problem, np.zeros(2), g, H)
    assert step.d == pytest.approx([0.0, 5.0]) and step.active == (0,)
    assert step.decrease == pytest.approx(12.5)


def test_a_step_held_short_by_damping_is_not_taken_for_the_end() -> None:
    def normal(x: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
        return float(1 + x[0] ** 2 + 1e9 * x[1] ** 2), np.array([2 * x[0], 2e9 * x[1]]), 2 * np.eye(2)

    problem = Problem(normal, np.zeros((0, 2)), np.zeros(0), "row {}".format)
    near = approach(problem, np.array([1.0, 1e-9]))  # steps along y are 1e9 times too long, and only damping helps
    assert near.cost == pytest.approx(2.0, rel=1e-6) and near.local is None
    (end,) = ended([near], problem)
    assert end.cost == pytest.approx(1.0, rel=1e-9)


@pytest.mark.parametrize("size", [1e-5, 1.0, 1e5])
@pytest.mark.parametrize("g", [(2.0, 1.0), (3.0, -1.0)])
def test_a_held_unknown_that_another_can_stand_in_for(size: float, g: tuple[float, float]) -> None:
    scale = np.diag([1.0, size])
    H, gradient = scale @ np.array([[1.0, 1.0], [1.0, 1.0 + 1e-15]]) @ scale, scale @ np.array(g)
    problem = Problem(lambda _: (1.0, gradient, H), np.array([[1.0, 0.0]]), np.zeros(1), "row {}".format)
    step = newton_step(problem, np.zeros(2), gradient, H)
    assert step.d * [1.0, size] == pytest.approx([0.0, -g[1]], abs=1e-9) and step.active == (0,)
    assert step.decrease == pytest.approx(0.5)
