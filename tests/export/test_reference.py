"""The plain Python of the exports: its functions against the libm, its laws against the replay's."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eaid.control.rc import RCState, rc_step
from eaid.export import reference as law
from eaid.export.constants import SEARCHES, Timing, plant_constants, rc_constants, rounded, series
from eaid.replay.inverse import InverseState, inverse_gains, inverse_step
from eaid.replay.plant import plant_parameters, plant_step

from .conftest import DT, KNOWN, LAWS, PLANT, STRANGE, closed_loop, constants


@pytest.mark.parametrize(("precision", "bound"), [("double", 6e-16), ("single", 3e-7)])
def test_one_minus_e_to_the_minus_x(precision, bound):
    p = rounded(series(precision), precision)
    cast = np.float32 if precision == "single" else float
    x = np.concatenate([np.geomspace(1e-12, 80.0, 4001), [0.5, 1.0, 2.0, 64.0]])
    for value in x:
        held = cast(value)
        assert law.loss(p, held) == pytest.approx(-math.expm1(-float(held)), rel=bound)
    assert law.loss(p, cast(0.0)) == 0.0


def test_tanh_is_that_of_the_libm_and_odd():
    p = series("double")
    for x in np.concatenate([np.geomspace(1e-9, 30.0, 2001), [19.1]]):
        assert law.tanh(p, x) == pytest.approx(math.tanh(x), rel=1e-15)
        assert law.tanh(p, -x) == -law.tanh(p, x)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["steps", "multisine", "sweep", "rehab"])
@pytest.mark.parametrize("law_name", LAWS)
def test_the_laws_are_the_replays_over_every_scenario(played, name, law_name):
    run = played(name, law_name)
    torque = np.array([torque for _, torque in closed_loop(run)])
    assert np.abs(torque - run.torque).max() <= 1e-12


@pytest.mark.slow
@pytest.mark.parametrize("name", ["steps", "multisine", "rehab"])
@pytest.mark.parametrize("law_name", LAWS)
def test_single_precision_keeps_within_a_hundred_thousandth(played, name, law_name):
    run = played(name, law_name)
    torque = np.array([float(torque) for _, torque in closed_loop(run, "single")])
    assert np.abs(torque - run.torque).max() <= 1e-5


def test_without_what_rounding_leaves_out_single_precision_would_not_hold(played, monkeypatch):
    """That the sums keep their carry is what the bound of the test above rests on."""
    monkeypatch.setattr(law, "added", lambda value, carry, change: (value + change, carry))
    run = played("steps", "pi")
    torque = np.array([float(torque) for _, torque in closed_loop(run, "single")])
    assert np.abs(torque - run.torque).max() > 1e-5


@pytest.mark.slow
def test_the_search_of_the_inverse_ends_well_before_its_limit(played, monkeypatch):
    most = 0
    own = law.miss_of

    def counted(*arguments):
        nonlocal tries
        tries += 1
        return own(*arguments)

    monkeypatch.setattr(law, "miss_of", counted)
    for name in ("steps", "multisine"):
        tries = 0
        for _ in closed_loop(played(name, "inverse")):
            most, tries = max(most, tries), 0
    assert 5 < most <= SEARCHES + 3 - 2


def test_back_calculation_is_the_replays():
    gains = KNOWN.rc._replace(back_calculation=0.02)
    c = constants()["rc"]._replace(back_calculation=0.02)
    state, mine = RCState(0.0), law.integral_init(c, DT)
    for reference, torque in zip(np.linspace(0, 9, 400), np.linspace(0, 2, 400), strict=True):
        state, duty = rc_step(gains, state, reference, 1.0, torque, DT)
        mine, own = law.rc_step(c, mine, reference, 1.0, torque)
        assert own == pytest.approx(duty, abs=1e-10)
    assert mine.integral == pytest.approx(state.integral, abs=1e-13)
    assert duty == 100.0


def test_the_observer_learns_what_the_replays_learns():
    gains, c = inverse_gains(PLANT), constants()["inverse"]
    theirs, mine = InverseState(), law.inverse_init(c, DT)
    for k in range(2000):
        torque = 1.0 - math.exp(-k * DT)
        theirs, duty = inverse_step(gains, theirs, 0.5, 0.0, torque, DT)
        mine, own = law.inverse_step(c, mine, 0.5, 0.0, torque)
        assert own == pytest.approx(duty, abs=1e-8)
    assert mine.lack == pytest.approx(theirs.lack, abs=1e-12)


NUMBERS = st.floats(-5.0, 5.0)


@pytest.mark.slow
@settings(max_examples=150, deadline=None)
@given(
    st.floats(0.01, 50), st.floats(0.01, 20), st.floats(0.1, 50), st.floats(0.01, 2), st.floats(0.1, 100),
    st.floats(0, 20), st.floats(0, 20), NUMBERS, NUMBERS, NUMBERS, NUMBERS, st.floats(1e-4, 0.1), st.booleans(),
)  # fmt: skip
def test_any_gains_at_any_rate_give_the_replays_duty(
    K_P, K_D, B_hat, epsilon, gamma, rho0, rho1, integral, reference, rate, torque, dt, back
):
    gains = KNOWN.rc._replace(
        K_P=K_P, K_D=K_D, B_hat=B_hat, epsilon=epsilon, gamma=gamma, rho_constant=rho0, rho_slope=rho1,
        back_calculation=0.02 if back else 0.0,
    )  # fmt: skip
    c = rc_constants(gains, Timing(dt))
    theirs, duty = rc_step(gains, RCState(integral), reference, rate, torque, dt)
    state = law.integral_init(c, dt)._replace(integral=integral)
    mine, own = law.rc_step(c, state, reference, rate, torque)
    scale = abs(law.rc_wanted(c, integral, reference, rate, torque)) + 100.0
    assert own == pytest.approx(duty, abs=1e-13 * scale)
    assert mine.integral == pytest.approx(theirs.integral, abs=1e-13 * scale)


@pytest.mark.slow
@settings(max_examples=150, deadline=None)
@given(
    st.sampled_from([PLANT, STRANGE]), st.floats(-20, 130), st.floats(0, 4), st.floats(0, 1), st.floats(1e-5, 1.0)
)  # fmt: skip
def test_any_plant_step_is_the_replays(plant, duty, x1, x2, dt):
    theirs = plant_step(plant_parameters(plant), x1, x2, duty, dt)
    change = law.plant_change(plant_constants(plant, Timing(dt)), x1, x2, duty)
    assert (x1 + change[0], x2 + change[1]) == pytest.approx(theirs, abs=1e-14)
