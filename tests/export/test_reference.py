"""The plain Python of the exports: its functions against the libm, its laws against the replay's."""

import math

import numpy as np
import pytest

from eaid.control.rc import RCState, rc_step
from eaid.export import reference as law
from eaid.export.constants import SEARCHES
from eaid.export.series import rounded, series
from eaid.replay.inverse import inverse_gains, inverse_start, inverse_step

from .conftest import DT, KNOWN, LAWS, PLANT, closed_loop, constants


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


@pytest.mark.parametrize("name", ["steps", "multisine", "sweep", "rehab"])
@pytest.mark.parametrize("law_name", LAWS)
def test_the_laws_are_the_replays_over_every_scenario(played, name, law_name):
    run = played(name, law_name)
    torque = np.array([torque for _, torque in closed_loop(run)])
    assert np.abs(torque - run.torque).max() <= 1e-12


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
    theirs, mine = inverse_start(), law.inverse_init(c, DT)
    for k in range(2000):
        torque = 1.0 - math.exp(-k * DT)
        theirs, duty = inverse_step(gains, theirs, 0.5, 0.0, torque, DT)
        mine, own = law.inverse_step(c, mine, 0.5, 0.0, torque)
        assert own == pytest.approx(duty, abs=1e-8)
    assert mine.lack == pytest.approx(theirs.lack, abs=1e-12)
