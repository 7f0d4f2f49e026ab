"""The plant: Eq. (4) from rest, the edges of specification 4.2, exact holds, and what it refuses."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from eaid.errors import DataError, UsageError
from eaid.models.nonlinear import step_response
from eaid.models.parameters import REFERENCE_PLANT, Nonlinear
from eaid.options import SimulateOptions
from eaid.replay.compare import driven
from eaid.replay.plant import (
    Held,
    falling_taus,
    hold_step,
    perturbed,
    plant_parameters,
    plant_slope,
    plant_step,
    plant_terms,
)

PLANT = plant_parameters(REFERENCE_PLANT)
DUTY = st.floats(0.0, 100.0)
STATE = st.floats(0.0, 4.0)


def roll(parameters, duty, dt, n, x1=0.0, x2=0.0):
    torque = [x1 + x2]
    for _ in range(n):
        x1, x2 = plant_step(parameters, x1, x2, duty, dt)
        torque.append(x1 + x2)
    return np.array(torque)


@pytest.mark.parametrize("duty", [10.0, 37.0, 56.0, 100.0])
def test_a_step_from_rest_is_equation_4(duty):
    torque = roll(PLANT, duty, 1e-3, 20_000)
    expected = step_response(REFERENCE_PLANT, np.arange(20_001) * 1e-3, duty)
    assert np.abs(torque - expected).max() < 1e-12


def test_zero_duty_gives_zero_torque_and_a_held_duty_its_steady_torque():
    assert roll(PLANT, 0.0, 1e-3, 100).tolist() == [0.0] * 101
    for duty in (5.0, 50.0, 100.0):
        assert roll(PLANT, duty, 1.0, 1000)[-1] == pytest.approx(plant_terms(PLANT, duty)[2], rel=1e-12)


def test_the_torque_never_rises_above_the_steady_torque_nor_falls_below_zero():
    random = np.random.default_rng(3)
    x1 = x2 = 0.0
    for duty in random.uniform(0, 100, 2000):
        x1, x2 = plant_step(PLANT, x1, x2, duty, 0.01)
        assert 0.0 <= x1 + x2 <= plant_terms(PLANT, 100.0)[2]


@given(duty=DUTY, x1=STATE, x2=STATE, dt=st.floats(1e-5, 1.0))
def test_two_half_holds_are_one_hold(duty, x1, x2, dt):
    once = plant_step(PLANT, x1, x2, duty, dt)
    twice = plant_step(PLANT, *plant_step(PLANT, x1, x2, duty, dt / 2), duty, dt / 2)
    assert once == pytest.approx(twice, rel=1e-12, abs=1e-14)


@given(duty=DUTY, x1=STATE, x2=STATE)
def test_the_slope_is_the_derivative_of_the_hold(duty, x1, x2):
    dt = 1e-6
    y1, y2 = plant_step(PLANT, x1, x2, duty, dt)
    assert (y1 + y2 - x1 - x2) / dt == pytest.approx(plant_slope(PLANT, x1, x2, duty), rel=1e-4, abs=1e-4)


def test_below_the_identified_duties_time_constants_stay_and_torque_goes_straight_to_zero():
    at_edge = plant_terms(PLANT, 10.0)
    assert plant_terms(PLANT, 2.5) == pytest.approx((at_edge[0], at_edge[1], 0.25 * at_edge[2]))
    assert plant_terms(PLANT, 0.0)[2] == 0.0
    assert plant_terms(PLANT, -5.0)[2] == 0.0
    assert at_edge[0] == pytest.approx(6.74e-3 + 0.239 - 0.0213)


def test_above_the_identified_duties_all_keep_their_edge_value():
    assert plant_parameters(replace(REFERENCE_PLANT, u_range=(0.0, 80.0))).u_low == 0.0
    narrow = plant_parameters(replace(REFERENCE_PLANT, u_range=(20.0, 80.0)))
    assert plant_terms(narrow, 100.0) == plant_terms(narrow, 80.0)
    assert plant_terms(narrow, 80.0) == plant_terms(PLANT, 80.0)


def test_floors_hold_for_a_plant_that_breaks_them():
    broken = plant_parameters(Nonlinear(tau1=(-1.0,), tau2=(-2.0,), Ts=(-0.5,), u_range=(10.0, 100.0)))
    assert plant_terms(broken, 50.0) == (1e-3, 1e-3, 0.0)


def test_release_constants_are_used_only_where_the_target_lies_below_the_state_and_at_rest():
    releasing = plant_parameters(replace(REFERENCE_PLANT, release=(1.5, 9.0)))
    assert plant_step(releasing, 0.0, 0.0, 50.0, 0.01) == plant_step(PLANT, 0.0, 0.0, 50.0, 0.01)
    x1, x2 = plant_step(releasing, 2.0, 0.4, 0.0, 0.3)
    assert x1 == pytest.approx(2.0 * np.exp(-0.3 / 1.5)) and x2 == pytest.approx(0.4 * np.exp(-0.3 / 9.0))


def test_perturbed_multiplies_the_polynomials_and_the_release():
    changed = perturbed(replace(REFERENCE_PLANT, release=(1.0, 5.0)), {"tau1": 2.0, "Ts": 0.5})
    assert changed.tau1 == tuple(2 * c for c in REFERENCE_PLANT.tau1)
    assert changed.tau2 == REFERENCE_PLANT.tau2
    assert changed.Ts == tuple(0.5 * c for c in REFERENCE_PLANT.Ts)
    assert changed.release == (2.0, 5.0)


@pytest.mark.parametrize(
    ("factors", "said"),
    [
        ({"C": 1.0}, "no 'C' in the plant"),
    ],
)
def test_perturbed_refuses(factors, said):
    with pytest.raises(UsageError, match=said):
        perturbed(REFERENCE_PLANT, SimulateOptions(perturb=factors).perturb)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"tau1": (1.0, 2.0, 3.0, 4.0)}, "nonlinear.tau1 has 4 coefficients"),
        ({"u_range": (80.0, 20.0)}, "must rise from 0"),
    ],
)
def test_a_plant_that_cannot_be_replayed_is_refused(changes, said):
    with pytest.raises(DataError, match=said):
        plant_parameters(replace(REFERENCE_PLANT, **changes))


def test_a_fall_between_identified_duties_has_the_time_constants_of_the_duty_it_falls_to():
    releasing = plant_parameters(replace(REFERENCE_PLANT, release=(1.5, 9.0)))
    assert plant_step(releasing, 3.0, 0.6, 50.0, 0.3) == plant_step(PLANT, 3.0, 0.6, 50.0, 0.3)
    assert plant_step(releasing, 3.0, 0.6, 10.0, 0.3) == plant_step(PLANT, 3.0, 0.6, 10.0, 0.3)


def test_below_the_lowest_duty_a_fall_goes_over_to_the_release_along_the_line_of_the_torque():
    releasing = plant_parameters(replace(REFERENCE_PLANT, release=(1.5, 9.0)))
    tau1, tau2, steady = plant_terms(PLANT, 2.5)
    tau1, tau2 = 0.25 * tau1 + 0.75 * 1.5, 0.25 * tau2 + 0.75 * 9.0
    assert falling_taus(releasing, 2.5) == pytest.approx((tau1, tau2), rel=1e-14)
    fast, slow = 0.85 * steady, 0.15 * steady
    x1, x2 = plant_step(releasing, 2.0, 0.4, 2.5, 0.3)
    assert x1 == pytest.approx(fast + (2.0 - fast) * np.exp(-0.3 / tau1), rel=1e-13)
    assert x2 == pytest.approx(slow + (0.4 - slow) * np.exp(-0.3 / tau2), rel=1e-13)
    # rising parts know nothing of it
    assert plant_step(releasing, 0.0, 0.0, 2.5, 0.3) == plant_step(PLANT, 0.0, 0.0, 2.5, 0.3)


def staircase(p: Nonlinear, holds: list[tuple[float, float]], dt: float) -> np.ndarray:
    """Torque under held duties, by the closed form from each change; written apart from the package."""
    u_low, torque, fast, slow = p.u_range[0], [], 0.0, 0.0
    for duty, seconds in holds:
        u = max(duty, u_low)
        share = min(duty / u_low, 1.0)
        steady = share * sum(c * u**k for k, c in enumerate(p.Ts))
        taus = [sum(c * u**k for k, c in enumerate(part)) for part in (p.tau1, p.tau2)]
        ends = []
        for k, (state, end) in enumerate([(fast, p.C * steady), (slow, (1 - p.C) * steady)]):
            tau = taus[k]
            if p.release is not None and end < state:
                tau = share * tau + (1 - share) * p.release[k]
            ends.append(end + (state - end) * np.exp(-np.arange(round(seconds / dt) + 1) * dt / tau))
        torque.append((ends[0] + ends[1])[:-1])
        fast, slow = ends[0][-1], ends[1][-1]
    return np.concatenate(torque)


@pytest.mark.parametrize("release", [None, (0.6, 7.0)])
def test_a_staircase_of_the_plant_is_replayed_to_the_last_digits(release):
    holds = [(80.0, 3.0), (50.0, 2.0), (90.0, 1.0), (20.0, 2.5), (4.0, 2.0), (60.0, 1.0), (0.0, 3.0)]
    model, dt = replace(REFERENCE_PLANT, release=release), 1e-3
    expected = staircase(model, holds, dt)
    time_s = np.arange(len(expected)) * dt
    duty = np.concatenate([np.full(round(seconds / dt), u) for u, seconds in holds])
    assert np.abs(driven(plant_parameters(model), time_s, duty) - expected).max() < 1e-12


def test_the_mean_duty_of_a_sample_in_which_the_pwm_latches() -> None:
    # a period of 1.5 samples: its second pulse begins half-way from sample 1 to sample 2
    held, mean = hold_step(plant_parameters(REFERENCE_PLANT), 1.5, 1e-3, 1, 60.0, Held(0.0, 0.0, 20.0, 1))
    assert mean == 40.0 and held.latched == 60.0 and held.pulse == 2
