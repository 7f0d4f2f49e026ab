"""The two pure steps: the law, its symmetry, its limits, and that numba takes them as they stand."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from eaid.control.gains import paper_gains
from eaid.control.pi import PIGains, PIState, pi_step
from eaid.control.rc import RCState, rc_step, rc_terms

RC, PI = paper_gains()
FREE = RC._replace(duty_min=-1e9, duty_max=1e9)
small = st.floats(-3, 3, allow_subnormal=False)


def law(gains, integral, reference, rate, torque):
    """Eqs. (11)-(14) written once more, straight from the page, with |z|."""
    e = reference - torque
    z = gains.Q12 * integral + gains.Q22 * e
    rho = gains.rho_constant + gains.rho_slope * math.hypot(integral, e)
    S = (math.tanh(gains.gamma * (abs(z) - gains.epsilon)) + 1) / 2
    omega = S * rho * (math.copysign(1, z) if z else 0) + (1 - S) * rho / gains.epsilon * z
    y = rate + gains.K_D * e + gains.K_P * integral + omega
    return gains.B_hat * y + (gains.a0 * torque - gains.c0) / gains.b0


@given(small, small, st.floats(-10, 10), small)
def test_rc_is_the_printed_law(integral, reference, rate, torque):
    _, duty = rc_step(FREE, RCState(integral), reference, rate, torque, 1e-3)
    assert duty == pytest.approx(law(FREE, integral, reference, rate, torque), rel=1e-12, abs=1e-9)


@pytest.mark.parametrize("gamma", [2.0, 10.0, 50.0])
@given(small, small)
def test_omega_is_odd_and_has_no_jump(gamma, integral, error):
    gains = RC._replace(gamma=gamma)
    there, back = rc_terms(gains, integral, error), rc_terms(gains, -integral, -error)
    assert back.omega == -there.omega and back.z == -there.z and back.rho == there.rho
    assert abs(there.omega) <= 1.3 * there.rho


@pytest.mark.parametrize("gamma", [0.5, 2.0, 50.0])
def test_omega_goes_to_zero_with_z(gamma):
    gains = RC._replace(gamma=gamma)
    assert rc_terms(gains, 0.0, 0.0).omega == 0.0
    for error in (1e-6, 1e-9, 1e-12):
        assert abs(rc_terms(gains, 0.0, error).omega) < 100 * error


def test_omega_exceeds_rho_by_six_in_a_thousand_at_the_edge_of_the_layer():
    shares = []
    for k in range(20001):
        error = 0.4 + 0.2 * k / 20000
        terms = rc_terms(RC, 0.0, error)
        shares.append(terms.omega / terms.rho)
    assert max(shares) == pytest.approx(1.006, abs=1e-3)


@given(small, small, st.floats(-10, 10), small)
def test_duty_stays_inside_its_limits(integral, reference, rate, torque):
    gains = RC._replace(duty_min=10.0, duty_max=80.0)
    assert 10.0 <= rc_step(gains, RCState(integral), reference, rate, torque, 1e-3)[1] <= 80.0
    limited = PI._replace(duty_min=10.0, duty_max=80.0)
    assert 10.0 <= pi_step(limited, PIState(integral), reference, rate, torque, 1e-3)[1] <= 80.0


@pytest.mark.parametrize(("step", "gains", "start"), [(rc_step, RC, RCState), (pi_step, PI, PIState)], ids=["rc", "pi"])
def test_integral_stands_still_only_while_it_would_wind_up(step, gains, start):
    state, duty = step(gains, start(), 8.0, 0.0, 0.0, 1e-3)
    assert duty == 100.0 and state == start()  # beyond the upper limit, the error drives it further
    high = type(start())(50.0)
    state, duty = step(gains, high, 1.9, 0.0, 2.0, 1e-3)
    assert duty == 100.0 and state.integral == pytest.approx(50.0 - 1e-4)  # still above, but the error leads back
    low = type(start())(-50.0)
    state, duty = step(gains, low, 1.9, 0.0, 2.0, 1e-3)
    assert duty == 0.0 and state == low
    state, duty = step(gains, low, 2.1, 0.0, 2.0, 1e-3)
    assert duty == 0.0 and state.integral > -50.0


def test_back_calculation_pulls_the_integral_back():
    gains = PIGains(21.0, 360.0, back_calculation=1 / 21)
    state = PIState(1.0)
    for _ in range(5000):
        state, duty = pi_step(gains, state, 8.0, 0.0, 0.0, 1e-3)
    assert duty == 100.0
    # Steady state of q̃˙ = e + k (100 − K_P e − K_I q̃): K_I q̃ = 100 at k = 1/K_P.
    assert 360 * state.integral == pytest.approx(100.0, rel=1e-9)
    state = RCState(1.0)
    rc = RC._replace(back_calculation=1 / 313)
    for _ in range(40000):
        state, duty = rc_step(rc, state, 8.0, 0.0, 0.0, 1e-3)
    held, _ = rc_step(rc, state, 8.0, 0.0, 0.0, 1e-3)
    assert duty == 100.0 and held.integral == pytest.approx(state.integral, abs=1e-9)


def test_pi_is_proportional_plus_integral():
    state = PIState()
    for k in range(3):
        state, duty = pi_step(PI, state, 1.0, 5.0, 0.5, 1e-3)
        assert duty == pytest.approx(21 * 0.5 + 360 * 0.5e-3 * k)
