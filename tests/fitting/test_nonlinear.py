"""The joint fit: gradients, constraints, starts, levels too few, units that are no duty."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from eaid.fitting.basis import CONSTRAINTS, active_at, basis_of, constraints
from eaid.fitting.data import Data, data_of
from eaid.fitting.nonlinear import (
    VALUES,
    fit_nonlinear,
    level_curves,
    looked_at,
    no_lower_minimum,
    nonlinear_problem,
    polynomial_starts,
    slow_shapes,
    steadied,
)
from eaid.fitting.solver import approach, descend
from eaid.fitting.sums import Record
from eaid.models.nonlinear import steady_torque, time_constants
from eaid.models.parameters import REFERENCE_PLANT, Nonlinear
from eaid.steps.stepset import StepSet

Maker = Callable[..., StepSet]
LEVELS = np.arange(10.0, 101.0, 10.0)


def test_unknowns_and_coefficients_are_one_another() -> None:
    basis = basis_of(np.arange(10.0, 101.0, 10.0), 0.85)
    back = basis.parameters(basis.unknowns(REFERENCE_PLANT))
    for name in ("tau1", "tau2", "Ts"):
        assert getattr(back, name) == pytest.approx(getattr(REFERENCE_PLANT, name), rel=1e-11)


def test_constraints_say_what_they_hold() -> None:
    basis = basis_of(np.arange(10.0, 101.0, 10.0), 0.85)
    A, b, names = constraints(basis, 20.0)
    x = basis.unknowns(REFERENCE_PLANT)
    u = np.linspace(10, 100, 101)
    tau1, tau2 = time_constants(REFERENCE_PLANT, u)
    slack = A @ x - b
    assert slack[:101] == pytest.approx(tau1 - 1e-3) and slack[101:202] == pytest.approx(tau2 - tau1)
    assert slack[202:303] == pytest.approx(steady_torque(REFERENCE_PLANT, u))
    assert [names(i) for i in (0, 201, 202, 303)] == ["tau1-floor", "tau2-meets-tau1", "Ts-zero", "tau2-endless"]
    assert active_at(basis, (0, 201, 101)) == {"tau1-floor": (10.0,), "tau2-meets-tau1": (100.0, 10.0)}
    A, _, names = constraints(basis_of(np.array([35.0]), None), 20.0)
    said = [names(i) for i in range(len(A))]
    assert said == [*CONSTRAINTS, "C-zero", "C-one"]


@pytest.mark.parametrize("share", [0.85, None])
def test_gradient_and_curvatures(share: float | None, clutch_set: Maker) -> None:
    data = data_of(clutch_set(duration_s=2.0, rate_hz=100.0, noise_nm=0.02).levels)
    basis = basis_of(data.u, share)
    problem = nonlinear_problem(data, basis)
    x = basis.unknowns(REFERENCE_PLANT) * 1.03
    _, gradient = problem.value(x)
    exact = problem.exact(x) if problem.exact is not None else None
    assert (exact is None) == (share is None)  # with C free Gauss–Newton has to do
    for k in range(basis.size):
        step = 1e-6 * max(abs(x[k]), 1e-2)
        up, down = x.copy(), x.copy()
        up[k] += step
        down[k] -= step
        (above, slope_above), (below, slope_below) = problem.value(up), problem.value(down)
        assert (above - below) / (2 * step) == pytest.approx(gradient[k], rel=1e-5, abs=1e-5)
        if exact is not None:
            assert (slope_above - slope_below) / (2 * step) == pytest.approx(exact[:, k], rel=1e-4, abs=1e-2)


def test_starts_are_feasible(clutch_set: Maker) -> None:
    for seed in range(5):
        data = data_of(clutch_set(duration_s=2.0, rate_hz=100.0, noise_nm=0.2, seed=seed).levels)
        basis = basis_of(data.u, 0.85)
        problem = nonlinear_problem(data, basis)
        for start in polynomial_starts(level_curves(data, 0.85), basis, problem):
            assert (problem.A @ start - problem.b).min() >= -1e-15


def test_a_descent_goes_down_from_every_shape(clutch_set: Maker) -> None:
    data = data_of(clutch_set(duration_s=5.0, rate_hz=50.0, noise_nm=0.05).levels)
    basis = basis_of(data.u, 0.85)
    problem = nonlinear_problem(data, basis)
    before, shapes = steadied(
        slow_shapes(basis.unknowns(REFERENCE_PLANT), data, basis)[:20], basis, looked_at(data, basis)
    )
    assert before == pytest.approx([problem.value(x)[0] for x in shapes], rel=1e-6)
    end = descend(looked_at(data, basis), shapes, 4, enough=0.0)
    after, ends = end.cost, end.x
    assert (after <= before).all() and np.median(after) < 0.9 * np.median(before)
    assert after == pytest.approx([problem.value(x)[0] for x in ends], rel=1e-9)
    # T_s solved for: nothing is left of the gradient along it
    for x in shapes[:3]:
        cost, gradient = problem.value(x)
        assert np.abs(gradient[basis.slices[0]]).max() < 1e-4 * cost


def _proof(case: Any) -> tuple[bool, float]:
    """Whether the best end of the starts from single levels is proven the lowest, and its cost on the points."""
    data = Data(LEVELS, tuple(Record(case.t_s, y, True) for y in case.y))
    basis = basis_of(data.u, 0.85)
    problem = nonlinear_problem(data, basis)
    own = level_curves(data, 0.85)
    best = min(approach(problem, x).cost for x in list(polynomial_starts(own, basis, problem))[:2])
    return no_lower_minimum(own, best, data, basis, problem), best


@pytest.mark.parametrize("seed", [29, 41, 49, 81, 149])
def test_the_proof_fails_where_a_lower_minimum_lies_elsewhere(seed: int, fit_quality: Any) -> None:
    case = fit_quality.make(seed)
    told, best = _proof(case)
    found = fit_nonlinear(Data(LEVELS, tuple(Record(case.t_s, y, True) for y in case.y)), 0.85)
    least = min(found.solver.costs)
    assert max(found.solver.costs) > 1.001 * least  # the starts from single levels end higher
    assert not told and best > 0


@pytest.mark.parametrize("count", [10, 50, 100])
def test_the_proof_holds_for_many_levels_of_the_right_model(count: int, clutch_set: Maker) -> None:
    levels = np.linspace(10.0, 100.0, count)
    data = data_of(clutch_set(levels=levels, rate_hz=200_000 / count / 20, noise_nm=0.01).levels)
    basis = basis_of(data.u, 0.85)
    problem = nonlinear_problem(data, basis)
    own = level_curves(data, 0.85)
    best = min(approach(problem, x).cost for x in list(polynomial_starts(own, basis, problem))[:2])
    assert no_lower_minimum(own, best, data, basis, problem)
    # a cost far above the levels' own leaves room, and one below them is none of these data's
    assert not no_lower_minimum(own, 3 * best, data, basis, problem)
    assert not no_lower_minimum(own, 0.9 * float(own.cost.sum()), data, basis, problem)


def test_where_data_leave_room_more_starts_are_tried(clutch_set: Maker) -> None:
    clear = fit_nonlinear(data_of(clutch_set(rate_hz=100.0, noise_nm=0.005).levels), 0.85)
    vague = fit_nonlinear(data_of(clutch_set(duration_s=2.0, rate_hz=100.0, noise_nm=0.1).levels), 0.85)
    assert len(clear.solver.starts) == 1 and len(vague.solver.starts) > 3


def test_a_constraint_that_holds_is_named_and_kept(fit_quality: object) -> None:
    from types import ModuleType

    assert isinstance(fit_quality, ModuleType)
    held = 0
    for seed in (2, 3, 6, 7, 10, 11):
        _, p, at_bounds, converged, _, _ = fit_quality.ours(fit_quality.make(seed))
        u = np.linspace(10, 100, 101)
        tau1, tau2 = time_constants(p, u)
        assert tau1.min() >= 1e-3 - 1e-9 and (tau2 - tau1).min() >= -1e-9 and steady_torque(p, u).min() >= -1e-9
        assert converged
        held += bool(at_bounds)
    assert held


@pytest.mark.parametrize(("levels", "zeros"), [([50], 3), ([40, 80], 2), ([30, 60, 90], 1)])
def test_few_levels_leave_the_high_coefficients_at_zero(levels: list[float], zeros: int, clutch_set: Maker) -> None:
    found = fit_nonlinear(data_of(clutch_set(levels=levels, rate_hz=50.0).levels), 0.85)
    p = found.parameters
    assert len(p.Ts) == 4 and p.Ts[4 - zeros :] == (0.0,) * zeros and len(p.tau1) == 3
    assert found.solver.converged
    for u in levels:
        assert steady_torque(p, u) == pytest.approx(steady_torque(REFERENCE_PLANT, u), rel=1e-6)


def test_levels_in_volts_fit_as_well_as_duties(clutch_set: Maker) -> None:
    volts = Nonlinear(
        tuple(c / 3**k for k, c in enumerate(REFERENCE_PLANT.tau1)),
        tuple(c / 3**k for k, c in enumerate(REFERENCE_PLANT.tau2)),
        tuple(c / 3**k for k, c in enumerate(REFERENCE_PLANT.Ts)),
        (30.0, 300.0),
    )
    found = fit_nonlinear(data_of(clutch_set(volts, levels=range(30, 301, 30), rate_hz=50.0).levels), 0.85).parameters
    assert found.Ts == pytest.approx(volts.Ts, rel=1e-6) and found.tau2 == pytest.approx(volts.tau2, rel=1e-6)


def test_a_given_start_counts_among_the_starts(clutch_set: Maker) -> None:
    data = data_of(clutch_set(rate_hz=50.0, noise_nm=0.005).levels)
    assert len(fit_nonlinear(data, 0.85, [REFERENCE_PLANT]).solver.starts) == 3


@pytest.mark.parametrize("unit", [0.0, 1.0, 1e9])
@pytest.mark.parametrize("share", [0.85, None])
def test_levels_without_torque_are_fitted_in_any_unit(unit: float, share: float | None) -> None:
    t = np.arange(100) / 100
    noise = np.random.default_rng(3).normal(size=(2, 100))
    records = tuple(Record(t, unit * (0.05 * row - 1 + np.exp(-t / 0.1)), True) for row in noise)
    found = fit_nonlinear(Data(np.array([20.0, 60.0]), records), share)
    assert steady_torque(found.parameters, np.array([20.0, 60.0])) == pytest.approx(0.0, abs=1e-6 * unit + 1e-12)


def test_steep_parabolas_touch_the_fast_constant_at_each_level(clutch_set: Maker) -> None:
    data = data_of(clutch_set(duration_s=5.0, rate_hz=50.0, noise_nm=0.05).levels)
    basis = basis_of(data.u, 0.85)
    x = basis.unknowns(REFERENCE_PLANT)
    touching = slow_shapes(x, data, basis)[VALUES**3 :]
    rows = basis.rows(data.u)
    middle = basis.rows(np.array([basis.lowest, 0.5 * (basis.lowest + basis.highest), basis.highest]))
    tau2, least = rows[2] @ touching.T, 3 * np.median(middle[1] @ x)
    assert tau2.min(axis=0) == pytest.approx(least, rel=1e-6) and tau2.shape == (10, 30)
    assert (tau2.argmin(axis=0).reshape(10, 3) == np.arange(10)[:, None]).all()
