"""On a wrong sample rate, NaN, a stuck sensor, a jump, a takeover a user gets what README.md says."""

import math

import numpy as np
import pytest

from eaid.export import reference as law
from eaid.export.constants import Timing, rate_constants
from eaid.replay import references

from .conftest import DT, LAWS, constants

STEP = {"pi": law.pi_step, "rc": law.rc_step, "inverse": law.inverse_step}
START = {"pi": law.pi_start, "rc": law.rc_start, "inverse": law.inverse_start}


def ready(name, c, dt=DT):
    return (law.inverse_init if name == "inverse" else law.integral_init)(c, dt)


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("dt", [2 * DT, 0.99 * DT, math.nan, 0.0, -DT])
def test_another_sample_time_is_refused_and_gives_the_duty_on_fault(name, dt):
    c = constants(duty_on_fault=3.0)[name]
    state = ready(name, c, dt)
    assert state.guard.status == law.WRONG_RATE
    for _ in range(3):
        state, duty = STEP[name](c, state, 1.0, 0.0, 0.5)
        assert duty == 3.0
        assert state.guard.status == law.WRONG_RATE | law.NOT_READY
    assert ready(name, c, DT * 1.0005).guard.ready


def test_the_plant_stands_still_on_another_sample_time():
    c = constants()["plant"]
    state = law.plant_init(c, 2 * DT)
    state, torque = law.plant_step(c, state, 50.0)
    assert torque == 0.0 and state.status == law.NOT_READY | law.WRONG_RATE


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf, 1e10])
@pytest.mark.parametrize("place", [0, 1, 2])
def test_an_input_that_is_no_number_gives_the_duty_on_fault_and_leaves_the_state_alone(name, bad, place):
    c = constants(duty_on_fault=7.0)[name]
    state = ready(name, c)
    for k in range(50):
        state, _ = STEP[name](c, state, 1.0, 0.0, 0.01 * k)
    inputs = [1.0, 0.0, 0.5]
    inputs[place] = bad
    after, duty = STEP[name](c, state, *inputs)
    if name == "pi" and place == 1:  # a PI reads no rate
        assert after.guard.status == 0
        return
    assert duty == 7.0 and after.guard.status == law.BAD_INPUT
    assert after._replace(guard=state.guard) == state
    again, duty = STEP[name](c, after, 1.0, 0.0, 0.5)
    untouched, expected = STEP[name](c, state, 1.0, 0.0, 0.5)
    assert duty == expected and again == untouched


@pytest.mark.parametrize("name", LAWS)
def test_a_stuck_sensor_is_told_after_its_time_and_the_law_goes_on(name):
    c = constants(stuck_s=0.05)[name]
    state = ready(name, c)
    told = []
    for k in range(400):
        torque = 0.01 * min(k, 100)
        state, duty = STEP[name](c, state, 2.0, 0.0, torque)
        told.append(bool(state.guard.status & law.STUCK))
    assert told.index(True) == 150 and all(told[150:])
    assert duty == pytest.approx(100.0)  # the error stays, and nothing in the law can know
    state, _ = STEP[name](c, state, 2.0, 0.0, 1.001)
    assert not state.guard.status & law.STUCK


@pytest.mark.parametrize("name", LAWS)
def test_limits_are_told(name):
    c = constants()[name]
    state, duty = STEP[name](c, ready(name, c), 9.0, 0.0, 0.0)
    assert duty == 100.0 and state.guard.status == law.AT_MAX
    state, duty = STEP[name](c, ready(name, c), 0.0, 0.0, 9.0)
    assert duty == 0.0 and state.guard.status == law.AT_MIN


@pytest.mark.parametrize("name", ["pi", "rc"])
@pytest.mark.parametrize("duty", [0.0, 12.5, 60.0, 99.0])
@pytest.mark.parametrize(("reference", "torque"), [(1.0, 1.0), (1.0, 0.97), (0.2, 0.3)])
def test_a_takeover_has_no_bump(name, duty, reference, torque):
    c = constants()[name]
    state = START[name](c, ready(name, c), reference, 0.4, torque, duty)
    _, given = STEP[name](c, state, reference, 0.4, torque)
    assert given == pytest.approx(duty, abs=1e-9)


def test_a_takeover_of_the_inverse_begins_at_the_torque_that_is_there():
    c = constants()["inverse"]
    state = law.inverse_start(c, law.inverse_init(c, DT), 1.2, 0.0, 1.2, 45.0)
    assert state.x1 + state.x2 == pytest.approx(1.2) and state.duty == 45.0
    _, given = law.inverse_step(c, state, 1.2, 0.0, 1.2)
    held = law.plant_change(c.plant, state.x1, state.x2, given)
    assert sum(held) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("name", LAWS)
def test_a_takeover_on_bad_inputs_is_a_reset(name):
    c = constants()[name]
    state = START[name](c, ready(name, c), math.nan, 0.0, math.nan, 50.0)
    assert state == ready(name, c)


def test_a_jump_of_the_reference_gives_the_peak_that_the_readme_tells():
    c = rate_constants(Timing(DT, rate_filter_hz=25.0))
    state, rates = law.rate_init(), []
    for k in range(200):
        state, rate = law.rate_step(c, state, 1.0 if k >= 100 else 0.0)
        rates.append(rate)
    assert rates[99] == 0.0 and rates[100] == pytest.approx(c.gain) and c.gain == pytest.approx(145.4, rel=1e-3)
    assert rates[100 + 19] < 0.06 * rates[100]  # e^-3 after 3/(2π 25 Hz) = 0.019 s
    assert sum(rates) * DT == pytest.approx(1.0, rel=1e-3)


def test_the_filtered_slope_lags_by_its_time_constant_and_a_reference_that_is_no_number_begins_anew():
    c = rate_constants(Timing(DT, rate_filter_hz=25.0))
    state = law.rate_init()
    t = np.arange(3000) * DT
    slopes = []
    for value in np.sin(2 * np.pi * t):
        state, rate = law.rate_step(c, state, value)
        slopes.append(rate)
    lag = 1 / (2 * np.pi * 25) - DT / 2 + DT / 2
    expected = 2 * np.pi * np.cos(2 * np.pi * (t - lag))
    assert np.abs(np.array(slopes) - expected)[100:].max() < 0.03
    state, rate = law.rate_step(c, state, math.nan)
    assert rate == 0.0 and not state.primed
    assert law.rate_step(c, state, 5.0)[1] == 0.0


def test_the_filtered_slope_serves_the_robust_controller_as_well_as_the_replays_central_differences():
    """docs/export.md: largest error on the multisine, after 5 s."""
    c, reference = constants(), references.multisine(DT).torque_nm
    without = c["plant"]._replace(release1=0.0, release2=0.0)  # the reference plant as it is
    filtered, central = rate_constants(Timing(DT)), np.gradient(reference, DT)
    error = {}
    for kind in ("filtered", "central", "none"):
        state, plant, slope = ready("rc", c["rc"]), law.plant_init(without, DT), law.rate_init()
        torque, errors = 0.0, []
        for k, wanted in enumerate(reference.tolist()):
            slope, rate = law.rate_step(filtered, slope, wanted)
            errors.append(wanted - torque)
            given = {"filtered": rate, "central": central[k], "none": 0.0}[kind]
            state, duty = law.rc_step(c["rc"], state, wanted, given, torque)
            plant, torque = law.plant_step(without, plant, duty)
        error[kind] = np.abs(errors[5000:]).max()
    assert error["central"] == pytest.approx(0.1157, rel=0.01)
    assert error["filtered"] == pytest.approx(0.1112, rel=0.01)
    assert error["none"] == pytest.approx(0.2332, rel=0.01)
