"""The friction curve of one level: truth returned, C held or free, what the data cannot tell."""

import numpy as np
import pytest
from numpy.typing import NDArray

from eaid.fitting.data import Data
from eaid.fitting.levels import fit_level, fit_levels, free_problem, grid_bowls, level_problem, non_negative, refine
from eaid.fitting.solver import Problem
from eaid.fitting.sums import Points, Record
from eaid.models import friction
from eaid.models.parameters import Friction

TRUTH = Friction(1.7, 0.35, 6.0)


def _data(curve: Friction, duration_s: float = 20.0, rate_hz: float = 200.0, noise: float = 0.0, seed: int = 0) -> Data:
    t = np.arange(round(duration_s * rate_hz)) / rate_hz
    y = friction.step_response(curve, t) + noise * np.random.default_rng(seed).normal(size=len(t))
    return Data(np.array([50.0]), (Record(t, y, True),))


@pytest.mark.parametrize(
    "truth",
    [
        TRUTH,
        Friction(0.05, 0.02, 0.9),
        Friction(300.0, 1.5, 25.0),
        Friction(2.0, 0.1, 0.12),
        Friction(1.0, 0.5, 9.0, 0.4),
    ],
)
def test_truth_returns(truth: Friction) -> None:
    found = fit_level(_data(truth), truth.C)
    assert found.solver.converged
    assert (found.curve.Ts, found.curve.tau1, found.curve.tau2) == pytest.approx(
        (truth.Ts, truth.tau1, truth.tau2), rel=1e-6
    )


@pytest.mark.parametrize("share", [0.5, 0.85])
def test_a_free_share_returns(share: float) -> None:
    truth = Friction(1.7, 0.35, 6.0, share)
    found = fit_level(_data(truth), None)
    assert pytest.approx(share, rel=1e-6) == found.curve.C and found.curve.tau2 == pytest.approx(6.0, rel=1e-6)
    assert len(found.solver.starts) == 3


def _by_differences(problem: Problem, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    slopes, curvatures = [], []
    for k in range(len(x)):
        (above, up), (below, down) = (problem.value(x + sign * 1e-6 * np.eye(len(x))[k]) for sign in (1, -1))
        slopes.append((above - below) / 2e-6)
        curvatures.append((up - down) / 2e-6)
    return np.array(slopes), np.array(curvatures)


def test_gradient_and_curvature_in_the_fit_s_own_unknowns() -> None:
    problem = level_problem(_data(TRUTH, duration_s=1.0, noise=0.05), 0.8, 100.0)
    x = np.array([1.5, np.log(0.3), np.log(4.0)])
    slopes, curvatures = _by_differences(problem, x)
    assert problem.exact is not None
    assert problem.value(x)[1] == pytest.approx(slopes, rel=1e-6, abs=1e-6)
    assert problem.exact(x) == pytest.approx(curvatures, rel=1e-5, abs=1e-5)


def test_gradient_and_curvature_with_the_share_free() -> None:
    problem = free_problem(_data(TRUTH), 1e4)
    x = np.log([0.3, 4.0])
    assert problem.value(x)[1] == pytest.approx(_by_differences(problem, x)[0], rel=1e-5)
    truth = np.log([TRUTH.tau1, TRUTH.tau2])  # nothing left: Gauss–Newton is exact
    assert problem.normal(truth)[2] == pytest.approx(_by_differences(problem, truth)[1], rel=1e-4)


@pytest.mark.parametrize(
    ("y", "want"), [((1.0, 2.0), (1.0, 2.0)), ((1.0, -2.0), (0.2, 0.0)), ((-2.0, 1.0), (0.0, 0.2))]
)
def test_amplitudes_are_never_negative(y: tuple[float, float], want: tuple[float, float]) -> None:
    gram = np.array([[2.0, 0.8], [0.8, 2.0]])
    assert non_negative(gram, gram @ np.array(y)) == pytest.approx(want)


def test_a_free_share_settles_where_the_record_is_too_short() -> None:
    found = fit_level(_data(Friction(1.2, 0.5, 15.0), duration_s=4.0, noise=0.03), None)
    assert found.solver.converged and found.solver.evaluations < 500


def test_metrics_by_hand() -> None:
    # Three samples that no curve meets: T_s = 0 is best for a falling output, so what is left is the data.
    t = np.array([0.0, 1.0, 2.0])
    y = np.array([0.0, -3.0, -4.0])
    found = fit_level(Data(np.array([1.0]), (Record(t, y, True),)), 0.85)
    assert found.curve.Ts == pytest.approx(0, abs=1e-12)
    assert found.sse == pytest.approx(25.0) and found.rmse == pytest.approx(np.sqrt(25 / 3)) and found.samples == 3
    assert "Ts-zero" in found.solver.at_bounds


def test_a_single_exponential_is_held_where_both_constants_meet() -> None:
    t = np.arange(2000) / 200
    y = 1 - np.exp(-2 * t) * (np.cos(6 * t) + np.sin(6 * t) / 3)  # an overshoot: no such curve falls again
    found = fit_level(Data(np.array([1.0]), (Record(t, y, True),)), 0.85)
    assert "tau2-meets-tau1" in found.solver.at_bounds and found.solver.converged
    assert found.curve.tau1 == pytest.approx(found.curve.tau2, rel=1e-9)


@pytest.mark.parametrize("seed", range(8))
def test_no_start_of_many_does_better(seed: int) -> None:
    rng = np.random.default_rng(seed)
    truth = Friction(rng.uniform(0.1, 4), np.exp(rng.uniform(-3, 0)), np.exp(rng.uniform(0.2, 3.5)))
    data = _data(truth, duration_s=rng.uniform(3, 20), rate_hz=50, noise=0.02, seed=seed)
    found = fit_level(data, 0.85)
    best = min(
        fit_level(data, 0.85, np.array([[1.0, tau1, tau1 * ratio, 0.85]]).T).sse
        for tau1 in (0.03, 0.2, 1)
        for ratio in (1.5, 20)
    )
    assert found.sse <= best * (1 + 1e-6)


@pytest.mark.parametrize("seed", range(40))
def test_rates_that_meet_keep_their_step(seed: int) -> None:
    """A single exponential: τ1 and τ2 run into each other, and the curvature by them becomes singular."""
    rng = np.random.default_rng(seed)
    t = np.linspace(0.0, 3.0, 10)
    points = Points(t[None], -np.expm1(-t / 0.5)[None], np.ones((1, 10)))
    tau1 = rng.uniform(0.05, 0.5)
    start = np.array([[rng.uniform(0.3, 2.0)], [tau1], [tau1 * rng.uniform(1.0, 1.5)], [0.85]])
    end = refine(start, points, limit=100.0, steps=200, enough=-1.0)
    assert end.cost[0] < 1e-3 * points.y.size and np.isfinite(end.x).all()


def test_starts_are_the_bowls_of_the_grid() -> None:
    cost = np.full((1, 6, 6), 5.0)
    cost[0, 1, 2], cost[0, 0, 5], cost[0, 3, 4], cost[0, 2, 2] = 1.0, 2.0, 3.0, 0.0  # the last is no pair
    gain = 6.0 - cost
    level, first, second = grid_bowls(np.sqrt(gain), np.ones_like(gain), 2)
    assert level.tolist() == [0, 0] and first.tolist() == [1, 0] and second.tolist() == [2, 5]
    level, first, second = grid_bowls(np.sqrt(gain), np.ones_like(gain), 1)
    assert (level[0], first[0], second[0]) == (0, 1, 2)


@pytest.mark.parametrize("seed", range(5))
def test_bowls_are_those_of_a_plain_search(seed: int) -> None:
    gain = np.random.default_rng(seed).integers(1, 9, (3, 7, 7)).astype(float)  # with plateaus
    wanted = [
        sorted((-gain[level, i, j], i, j) for i in range(7) for j in range(i + 1, 7) if _highest(gain[level], i, j))[:4]
        for level in range(3)
    ]
    level, first, second = grid_bowls(np.sqrt(gain), np.ones_like(gain), 4)
    for one in range(3):
        found = list(zip(first[level == one].tolist(), second[level == one].tolist(), strict=True))
        assert found == [(i, j) for _, i, j in wanted[one]]


def _highest(gain: NDArray[np.float64], i: int, j: int) -> bool:
    """Whether no neighbour of a pair that is a pair itself gains more."""
    beside = [(i + a, j + b) for a in (-1, 0, 1) for b in (-1, 0, 1)]
    return all(gain[i, j] >= gain[k, m] for k, m in beside if 0 <= k < m < len(gain))


def test_levels_where_nothing_rises() -> None:
    t = np.arange(600) / 100
    data = Data(np.arange(2.0), (Record(t, -np.ones(600), True), Record(t, np.zeros(600), True)))
    for found in fit_levels(data, 0.85):
        assert found.curve.Ts == pytest.approx(0.0, abs=1e-9)


def test_levels_fitted_together_are_those_fitted_alone() -> None:
    t = np.arange(2000) / 100
    curves = [Friction(0.3, 0.1, 4.0), Friction(2.0, 0.6, 12.0), Friction(1.0, 0.4, 0.45), Friction(1.0, 0.5, 500.0)]
    rng = np.random.default_rng(2)
    records = tuple(Record(t, friction.step_response(c, t) + 0.02 * rng.normal(size=len(t)), True) for c in curves)
    data = Data(np.arange(4.0), records)
    for one, together in enumerate(fit_levels(data, 0.85)):
        alone = fit_level(data.one(one), 0.85)
        assert together.solver.converged and together.sse <= alone.sse * (1 + 1e-9)


def test_a_start_still_on_its_way_down_is_a_rival() -> None:
    truth = Friction(3.5, 4.0, 1e6)
    t = np.sort(np.arange(1000) / 10 + 0.03 * np.random.default_rng(0).random(1000))
    data = Data(np.ones(1), (Record(t, friction.step_response(truth, t), False),))
    (found,) = fit_levels(data, 0.85)
    assert found.sse < 1e-20 * data.energy
    assert (found.curve.Ts, found.curve.tau1, found.curve.tau2) == pytest.approx((3.5, 4.0, 1e6), rel=1e-6)


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
def test_levels_that_fall_have_no_torque_in_any_unit(unit: float) -> None:
    t = np.arange(30) / 1000
    y = -friction.step_response(Friction(1.5, 0.0009, 0.01), t) * unit
    (found,) = fit_levels(Data(np.ones(1), (Record(t, y, True),)), 0.85)
    assert found.solver.converged and found.curve.Ts == 0.0


@pytest.mark.parametrize("share", [0.85, None])
@pytest.mark.parametrize("step_s", [1e-6, 1e-5, 1e-4])
def test_a_record_shorter_than_the_fastest_rate_has_a_fit(step_s: float, share: float | None) -> None:
    t = np.arange(10) * step_s
    y = friction.step_response(Friction(2.0, 3 * step_s, 30 * step_s), t)
    (found,) = fit_levels(Data(np.ones(1), (Record(t, y, True),)), share)
    assert found.curve.tau1 >= 1e-3 - 1e-10 and found.sse <= y @ y
