"""The least error: closed forms, and bounds that hold for every duty that was tried."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eaid.arrays import read_only
from eaid.control.gains import paper_gains
from eaid.errors import UsageError
from eaid.models.nonlinear import step_response
from eaid.models.parameters import PAPER_LINEAR, REFERENCE_PLANT, Nonlinear
from eaid.replay import references
from eaid.replay.adjoint import cost_and_gradient
from eaid.replay.best import Best, best
from eaid.replay.controllers import CONTROLLERS, Knowledge, controller
from eaid.replay.inverse import follow
from eaid.replay.loop import replay
from eaid.replay.plant import PlantParameters, plant_parameters, plant_step
from eaid.replay.references import Reference
from eaid.replay.rig import Rig

PLANT = plant_parameters(REFERENCE_PLANT)
DT = 1e-3


def played(plant: PlantParameters, duty: np.ndarray, dt: float = DT) -> np.ndarray:
    x1 = x2 = 0.0
    torque = []
    for u in duty.tolist():
        torque.append(x1 + x2)
        x1, x2 = plant_step(plant, x1, x2, u, dt)
    return np.array(torque)


def rms(reference: Reference, torque: np.ndarray) -> float:
    begin = round(reference.counted_from_s / reference.dt_s)
    return float(np.sqrt(np.mean((torque - reference.torque_nm)[begin:] ** 2)))


def of(torque: np.ndarray, counted_from_s: float = 0.0, dt: float = DT) -> Reference:
    return Reference(read_only(torque), dt, counted_from_s)


@pytest.fixture(scope="module")
def multisine() -> tuple[Reference, Best]:
    reference = references.multisine(DT, 12.0)
    return reference, best(PLANT, reference)


def test_a_reference_within_reach_costs_nothing() -> None:
    duty = 50 + 20 * np.sin(np.arange(4000) * 4e-3)
    found = best(PLANT, of(played(PLANT, duty)))
    assert found.rms_error_nm < 1e-9 and found.bound_nm < 1e-9
    np.testing.assert_allclose(found.trace.duty_pct[:-1], duty[:-1], atol=1e-5)


@pytest.mark.parametrize(("low", "high"), [(0.0, 100.0), (0.0, 60.0), (20.0, 80.0)])
def test_beyond_reach_the_duty_stays_at_its_limit(low: float, high: float) -> None:
    reference = of(np.full(3000, 9.0))
    found = best(PLANT, reference, (low, high))
    expected = 9.0 - step_response(REFERENCE_PLANT, reference.dt_s * np.arange(3000), high)
    assert found.rms_error_nm == pytest.approx(np.sqrt(np.mean(expected**2)), rel=1e-12)
    np.testing.assert_allclose(found.trace.duty_pct, high, atol=1e-6)
    # no duty rises faster than the highest here: the bound meets what was found
    assert found.bound_nm == pytest.approx(found.rms_error_nm, rel=1e-6)
    assert found.bound_nm <= found.rms_error_nm


def test_a_step_is_met_half_way_as_by_hand() -> None:
    # an integrator nearly: slope s = T_s/τ = 2 N·m/s up; a step of h = 1 begins h/2s early and ends as late: h³/12s
    plant = plant_parameters(Nonlinear((1e5,), (1e5,), (0.0, 2000.0), (1.0, 100.0)))
    dt = 1e-4
    reference = of(np.repeat([0.0, 1.0], 10_000), dt=dt)
    found = best(plant, reference)
    by_hand = 1.0**3 / (12 * 2.0)
    assert found.rms_error_nm**2 * 20_000 * dt == pytest.approx(by_hand, rel=1e-3)
    assert found.bound_nm == pytest.approx(found.rms_error_nm, rel=1e-6)
    assert np.flatnonzero(found.trace.torque_nm > 1e-9)[0] == pytest.approx(10_000 - 2500, abs=3)


def test_with_one_time_constant_found_and_bound_are_the_same() -> None:
    plant = plant_parameters(replace(REFERENCE_PLANT, tau1=(0.3,), tau2=(0.3,), C=0.999999))
    found = best(plant, references.steps(2e-3, 7.5, levels_nm=(0.0, 2.0, 1.0, 3.5, 0.5)))
    assert found.rms_error_nm > 0.05
    assert found.bound_nm == pytest.approx(found.rms_error_nm, rel=1e-4)


def test_no_controller_does_better_on_the_multisine(multisine: tuple[Reference, Best]) -> None:
    reference, found = multisine
    known = Knowledge(REFERENCE_PLANT, PAPER_LINEAR, *paper_gains())
    errors = {
        name: rms(reference, replay(PLANT, controller(name, known), reference.torque_nm, Rig(), DT).torque_nm)
        for name in CONTROLLERS
    }
    assert all(error > found.rms_error_nm for error in errors.values())
    # the exact inverse does not look beyond a sample; the best begins before the duty runs out
    assert errors["inverse"] > 1.5 * found.rms_error_nm
    assert found.bound_nm > 0.6 * found.rms_error_nm
    assert found.bound_nm == pytest.approx(0.004877, abs=5e-7)


def test_the_error_is_that_of_the_duty_given(multisine: tuple[Reference, Best]) -> None:
    reference, found = multisine
    torque = played(PLANT, found.trace.duty_pct)
    np.testing.assert_allclose(torque, found.trace.torque_nm, atol=1e-12)
    assert rms(reference, torque) == pytest.approx(found.rms_error_nm, rel=1e-12)
    assert found.steady_rms_nm >= found.rms_error_nm
    # the fixed point of the steady search alone, with the right line for the slow part
    assert found.steady_rms_nm == pytest.approx(0.00716033, rel=1e-5)


def test_switching_duty_beats_the_best_steady_one_on_steps() -> None:
    found = best(PLANT, references.steps(DT, 18.0))
    assert found.bound_nm < found.rms_error_nm < 0.98 * found.steady_rms_nm


@pytest.mark.parametrize("release", [None, (0.03, 2.0), (0.9, 1.1)])
@pytest.mark.parametrize("limits", [(0.0, 100.0), (20.0, 80.0)])
def test_the_gradient_is_that_of_the_cost(release: tuple[float, float] | None, limits: tuple[float, float]) -> None:
    plant = plant_parameters(replace(REFERENCE_PLANT, release=release))
    draw = np.random.default_rng(3)
    n, dt = 60, 0.01
    # falls to below the lowest identified duty, rises, and samples at both limits
    duty = np.clip(draw.uniform(-20, 120, n), *limits)
    reference, weight = draw.normal(2, 1, n), draw.choice([0.0, 1.0, 2.0], n)
    torque, work, gradient = np.empty(n), np.empty((4, n)), np.empty(n)

    def cost(u: np.ndarray, into: np.ndarray) -> float:
        return cost_and_gradient(plant, reference, weight, dt, limits, u, torque, work, into)

    whole = cost(duty, gradient)
    np.testing.assert_allclose(torque, played(plant, duty, dt), rtol=1e-13, atol=1e-15)
    assert whole == pytest.approx(float(weight @ (torque - reference) ** 2), rel=1e-12)
    steps = 1e-4 * np.eye(n)
    apart = []
    for k in range(n):
        up, down = np.clip(duty + steps[k], *limits), np.clip(duty - steps[k], *limits)
        scrap = np.empty(n)
        apart.append((cost(up, scrap) - cost(down, scrap)) / (up - down)[k])
    np.testing.assert_allclose(gradient, apart, rtol=1e-4, atol=1e-7)
    assert gradient[-1] == 0.0


def test_no_small_change_of_the_duty_lowers_the_error_found(multisine: tuple[Reference, Best]) -> None:
    reference, found = multisine
    draw = np.random.default_rng(5)
    for width in (1, 30, 1000):
        change = np.repeat(draw.normal(0, 0.05, 12_000 // width + 1), width)[:12_000]
        assert rms(reference, played(PLANT, np.clip(found.trace.duty_pct + change, 0, 100))) > found.rms_error_nm


def test_the_search_does_not_depend_on_how_many_threads_add_up() -> None:
    from threadpoolctl import threadpool_limits

    reference = references.steps(2e-3, 9.0)
    first = best(PLANT, reference)
    with threadpool_limits(2, user_api="blas"):
        again = best(PLANT, reference)
    np.testing.assert_array_equal(first.trace.duty_pct, again.trace.duty_pct)


@given(st.integers(0, 10_000))
@settings(max_examples=15, deadline=None)
def test_no_duty_undercuts_the_bound(seed: int) -> None:
    draw = np.random.default_rng(seed)
    model = Nonlinear(
        tau1=(draw.uniform(0.05, 0.3), draw.uniform(0, 0.01), 0.0),
        tau2=(draw.uniform(1, 3), draw.uniform(0, 0.1), 0.0),
        Ts=(0.0, draw.uniform(0.01, 0.04), draw.uniform(-1e-4, 3e-4), 0.0),
        u_range=(10.0, 100.0),
        release=(draw.uniform(0.02, 1.0), draw.uniform(0.5, 6.0)) if seed % 2 else None,
    )
    plant = plant_parameters(model)
    dt, n = 0.01, 400
    knots = draw.uniform(0, 100, 20)
    duty = np.repeat(knots, 20) if seed % 3 else np.interp(np.arange(n), np.arange(20) * 21, knots)
    near = played(plant, duty, dt)
    reference = of(near + draw.uniform(0, 0.3) * draw.standard_normal(n), counted_from_s=draw.choice([0.0, 1.0]), dt=dt)
    found = best(plant, reference)
    assert found.bound_nm <= found.rms_error_nm * (1 + 1e-9)
    for other in (duty, np.clip(duty + draw.normal(0, 5, n), 0, 100), found.trace.duty_pct):
        assert rms(reference, played(plant, other, dt)) >= found.bound_nm * (1 - 1e-9)


def test_follow_lands_on_the_path_or_plays_the_limit() -> None:
    path = np.minimum(np.arange(500) * 2e-3, 0.5)
    path[300:] = -1.0
    duty, fast, slow = np.zeros(500), np.zeros(500), np.zeros(500)
    follow(PLANT, path, DT, (0.0, 100.0), duty, fast, slow)
    torque = fast + slow
    np.testing.assert_allclose(torque[20:300], path[20:300], atol=1e-13)
    assert np.all(duty[300:] == 0.0)


def test_limits_that_do_not_rise_are_refused() -> None:
    with pytest.raises(UsageError, match="duty limits 50 to 50 do not rise"):
        best(PLANT, of(np.ones(10)), (50.0, 50.0))
