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
from eaid.replay.best import Best, best
from eaid.replay.controllers import CONTROLLERS, Knowledge, controller
from eaid.replay.descent import follow
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
    np.testing.assert_allclose(found.duty_pct[:-1], duty[:-1], atol=1e-5)


@pytest.mark.parametrize(("low", "high"), [(0.0, 100.0), (0.0, 60.0), (20.0, 80.0)])
def test_beyond_reach_the_duty_stays_at_its_limit(low: float, high: float) -> None:
    reference = of(np.full(3000, 9.0))
    found = best(PLANT, reference, (low, high))
    expected = 9.0 - step_response(REFERENCE_PLANT, reference.dt_s * np.arange(3000), high)
    assert found.rms_error_nm == pytest.approx(np.sqrt(np.mean(expected**2)), rel=1e-12)
    np.testing.assert_allclose(found.duty_pct, high, atol=1e-6)
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
    assert np.flatnonzero(found.torque_nm > 1e-9)[0] == pytest.approx(10_000 - 2500, abs=3)


def test_with_one_time_constant_found_and_bound_are_the_same() -> None:
    plant = plant_parameters(replace(REFERENCE_PLANT, tau1=(0.3,), tau2=(0.3,), C=0.999999))
    found = best(plant, references.steps(2e-3, (0.0, 2.0, 1.0, 3.5, 0.5), 1.5))
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
    torque = played(PLANT, found.duty_pct)
    np.testing.assert_allclose(torque, found.torque_nm, atol=1e-12)
    assert rms(reference, torque) == pytest.approx(found.rms_error_nm, rel=1e-12)
    counted = np.abs(torque - reference.torque_nm)[5000:]
    assert found.max_abs_error_nm == pytest.approx(counted.max(), rel=1e-12)
    assert found.steady_rms_nm >= found.rms_error_nm
    # the fixed point of the steady search alone, with the right line for the slow part
    assert found.steady_rms_nm == pytest.approx(0.00716033, rel=1e-5)


def test_other_beginnings_end_at_nearly_the_same_error(multisine: tuple[Reference, Best]) -> None:
    reference, found = multisine
    rough = best(PLANT, reference, starts=[found.duty_pct])
    assert rough.rms_error_nm == pytest.approx(found.rms_error_nm, rel=5e-3)


def test_switching_duty_beats_the_best_steady_one_on_steps() -> None:
    found = best(PLANT, references.steps(DT, hold_s=2.0))
    assert found.bound_nm < found.rms_error_nm < 0.98 * found.steady_rms_nm


def test_start_duties_are_never_made_worse() -> None:
    duty = np.where(np.arange(2000) % 2 == 0, 100.0, 0.0)
    reference = of(played(PLANT, duty))
    found = best(PLANT, reference, starts=[duty])
    assert found.rms_error_nm == pytest.approx(0.0, abs=1e-12)


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
    for other in (duty, np.clip(duty + draw.normal(0, 5, n), 0, 100), found.duty_pct):
        assert rms(reference, played(plant, other, dt)) >= found.bound_nm * (1 - 1e-9)


def test_follow_lands_on_the_path_or_plays_the_limit() -> None:
    path = np.minimum(np.arange(500) * 2e-3, 0.5)
    path[300:] = -1.0
    duty, fast, slow = np.zeros(500), np.zeros(500), np.zeros(500)
    follow(PLANT, path, DT, 0.0, 100.0, duty, fast, slow)
    torque = fast + slow
    np.testing.assert_allclose(torque[20:300], path[20:300], atol=1e-13)
    assert np.all(duty[300:] == 0.0)


def test_limits_that_do_not_rise_are_refused() -> None:
    with pytest.raises(UsageError, match="duty limits 50 to 50 do not rise"):
        best(PLANT, of(np.ones(10)), (50.0, 50.0))
