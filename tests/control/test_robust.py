"""α, B̂, ρ, Q, guarantee and ultimate bound, against Table IV, closed forms, SciPy and a grid of the plane."""

import math

import numpy as np
import pytest
from hypothesis import Phase, assume, given, settings
from hypothesis import strategies as st
from scipy.linalg import solve_continuous_lyapunov

import eaid

positive = st.floats(0.3, 10)


def test_table_iv_to_its_digits(tuned, told):
    found = tuned()
    rc = found.rc
    assert (rc.K_P, rc.K_D, rc.B_hat, rc.Q_M, rc.phi, rc.epsilon, rc.gamma) == (4.5, 3.0, 12.5, 5.0, 0.05, 0.5, 50.0)
    assert (f"{rc.alpha:.6f}", f"{rc.rho.constant:.4f}", f"{rc.rho.slope:.5f}") == ("0.549091", "10.8125", "6.58595")
    poles = tuned(natural_frequency=2.12132, damping=0.707107).rc
    assert abs(poles.K_P - 4.5) < 1e-5 > abs(poles.K_D - 3.0)
    assert rc.Q[0][1] == rc.Q[1][0] == pytest.approx(5 / 9) and rc.Q[1][1] == pytest.approx((5 + 10 / 9) / 6)
    assert (round(rc.equal_pi.K_P), round(rc.equal_pi.K_I)) == (313, 206)
    assert rc.phi_honest_pct == pytest.approx(26.4, abs=0.05) and rc.rho.convention == "paper"
    textbook = tuned(rho="textbook").rc
    assert textbook.phi_honest_pct == pytest.approx(0.05) and textbook.rho.constant == pytest.approx(6.09765, abs=5e-6)
    asked = told(found)
    told_of_rho = {"B_hat": 12.5, "reached": 1 - 12.5 / 42.6, "made": 30.2 / 55}
    assert {key: asked["rho-not-covered"][key] for key in told_of_rho} == pytest.approx(told_of_rho)


@settings(max_examples=30, deadline=None, phases=(Phase.generate,))
@given(positive, positive, st.floats(0.5, 8), st.floats(0.5, 8), st.floats(0, 9), st.floats(0, 0.2), positive,
       st.sampled_from(["paper", "textbook"]), st.sampled_from(["pooled", "minimax", 11.0]))  # fmt: skip
def test_every_number_of_the_law_by_its_formula(tuned, one, other, K_P, K_D, Q_M, phi, p, rho, B_hat):
    """Eqs. (11) to (16) and the Lyapunov equation written once more, with both ends of b and SciPy's solver."""
    B_m, B_M = sorted((4 * one + 4, 4 * other + 4))
    try:
        rc = tuned(
            linear={"bounds": {"B_m": B_m, "B_M": B_M}}, kp=K_P, kd=K_D, q_max=Q_M, phi=phi, p_scale=p, rho=rho,
            b_hat=B_hat, rate_hz=1e4, pwm_hz=0.0,
        ).rc  # fmt: skip
    except eaid.GainsError:
        assume(False)
    taken = {"pooled": 12.5, "minimax": 2 * B_m * B_M / (B_m + B_M)}.get(B_hat, B_hat)
    reached = np.abs(1 - taken * np.linspace(1 / B_M, 1 / B_m, 101)).max()
    made = (B_M - B_m) / (B_M + B_m)
    assert (rc.B_hat, rc.alpha_reached, rc.alpha) == pytest.approx((taken, reached, made), abs=1e-12)
    norm, term = math.hypot(K_P, K_D), B_M * phi if rho == "paper" else phi / B_m
    line = [(a * Q_M + term) / (1 - a) for a in (made, reached)] + [a * norm / (1 - a) for a in (made, reached)]
    assert (rc.rho.constant, rc.rho.slope) == pytest.approx((line[0], line[2]), abs=1e-9)
    if reached < 1:
        assert (rc.rho.needed.constant, rc.rho.needed.slope) == pytest.approx((line[1], line[3]), abs=1e-9)
    assert rc.rho_covers == (reached < 1 and line[0] >= line[1] - 1e-9 and line[2] >= line[3] - 1e-9)
    assert rc.phi_honest_pct == pytest.approx(phi * B_m * B_M if rho == "paper" else phi)
    A, P, Q = np.array([[0.0, 1.0], [-K_P, -K_D]]), np.array(rc.P), np.array(rc.Q)
    assert (p * np.eye(2) == P).all() and np.linalg.eigvalsh(Q).min() > 0
    assert solve_continuous_lyapunov(A.T, -P) == pytest.approx(Q, rel=1e-6, abs=1e-7)
    slopes = taken * (K_D + line[0] * Q[1, 1] / 0.5), taken * (K_P + line[0] * Q[0, 1] / 0.5)
    assert pytest.approx(slopes) == (rc.equal_pi.K_P, rc.equal_pi.K_I)


def test_a_pooled_b0_that_no_rho_is_enough_for_gives_way_to_the_middle(tuned, told):
    """As staircases have it, whose one slope over all levels is none of any level."""
    far = {"a0": 0.12, "b0": 1 / 181}
    found, asked = tuned(linear=far), tuned(linear=far, b_hat="pooled")
    minimax = 2 * 12.4 * 42.6 / 55
    assert found.rc.B_hat == pytest.approx(minimax) and found.rc.alpha_reached < 1
    assert told(found)["b-hat-between-levels"] == pytest.approx({"pooled": 181.0, "B_hat": minimax, "B_m": 12.4})
    assert asked.rc.B_hat == pytest.approx(181.0) and asked.rc.rho.needed is None
    assert not {"b-hat-between-levels"} & {*told(asked), *told(tuned()), *told(tuned(linear={"b0": 1 / 24.7}))}
    assert tuned(linear={"b0": 1 / 24.9}).rc.B_hat == pytest.approx(minimax)


def test_no_rho_is_enough_where_the_alpha_reached_is_1(tuned):
    edge = tuned(b_hat=24.8).rc
    assert tuned(b_hat=30.0).rc.ultimate_bound_nm is None
    assert edge.alpha_reached == 1.0 and edge.rho.needed is None and edge.rho_covers is False


def largest_error(rc, phi_term):
    """The largest |e| on the largest V with ξᵀPξ ≤ 2|z|(n − (1 − α) ρ min(1, |z|/ε)), over a fine grid."""
    Q, a, norm = np.array(rc.Q), rc.alpha_reached, math.hypot(rc.K_P, rc.K_D)
    reach = 1.5 * rc.ultimate_bound_nm * math.sqrt(np.linalg.cond(Q))
    side = np.linspace(-reach, reach, 1501)
    q, e = np.meshgrid(side, side)
    size, z = np.hypot(q, e), np.abs(Q[1, 0] * q + Q[1, 1] * e)
    have = (1 - a) * (rc.rho.constant + rc.rho.slope * size) * np.minimum(1, z / rc.epsilon)
    rises = rc.P[0][0] * size**2 <= 2 * z * (a * rc.Q_M + phi_term + a * norm * size - have)
    V = Q[0, 0] * q * q + 2 * Q[0, 1] * q * e + Q[1, 1] * e * e
    return math.sqrt(V[rises].max() * np.linalg.inv(Q)[1, 1])


@pytest.mark.parametrize(
    ("options", "phi_term"),
    [
        ({"b_hat": "minimax"}, 2.13),
        ({"b_hat": "minimax", "epsilon": 0.05, "gamma": 500.0}, 2.13),
        ({"b_hat": "minimax", "rho": "textbook", "epsilon": 0.2, "p_scale": 2.0}, 0.05 / 12.4),
        ({}, 2.13),
        ({"b_hat": 16.0, "q_max": 1.0}, 2.13),
    ],
)
def test_the_ultimate_bound_is_what_a_grid_of_the_plane_has(tuned, options, phi_term):
    rc = tuned(**options, rate_hz=1e4, pwm_hz=0.0).rc
    assert rc.ultimate_bound_nm == pytest.approx(largest_error(rc, phi_term), rel=0.02)


@pytest.mark.parametrize(("gamma", "jump"), [(2.0, 1 - math.tanh(1.0)), (9.9, 1 - math.tanh(4.95)), (10.0, None)])
def test_below_a_sharpness_of_five_the_jump_is_told(tuned, told, gamma, jump):
    found = told(tuned(gamma=gamma)).get("switch-jumps")
    assert found is None if jump is None else found["jump"] == pytest.approx(jump)
