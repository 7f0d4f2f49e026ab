"""Table IV to its digits, the two readings, α and what it really reaches, Q, the equal PI."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from eaid.control import robust
from eaid.control.rc_design import solve_Q

B_M_PAPER, B_m_PAPER = 42.6, 12.4
positive = st.floats(0.01, 100)


def test_table_iv_to_its_digits():
    alpha = robust.alpha_formula(12.4, 42.6)
    norm_K = math.hypot(4.5, 3)
    rho = robust.rho(alpha, 5.0, norm_K, robust.uncertainty_term("paper", 0.05, 12.4, 42.6))
    assert f"{alpha:.6f}" == "0.549091"
    assert f"{norm_K:.5f}" == "5.40833"
    assert f"{rho.constant:.4f}" == "10.8125"
    assert f"{rho.slope:.5f}" == "6.58595"
    # B̂ρ(0) = 135 % duty.
    assert f"{12.5 * rho.constant:.0f}" == "135"


def test_each_reading_says_the_phi_it_means():
    assert robust.uncertainty_term("paper", 0.05, 12.4, 42.6) == pytest.approx(2.13)
    assert robust.uncertainty_term("textbook", 0.05, 12.4, 42.6) == pytest.approx(0.004, abs=5e-5)
    assert robust.honest_phi_pct("paper", 0.05, 12.4, 42.6) == pytest.approx(26.4, abs=0.05)
    assert robust.honest_phi_pct("textbook", 0.05, 12.4, 42.6) == pytest.approx(0.05)


@given(st.sampled_from(["paper", "textbook"]), positive, positive, positive)
def test_phi_of_is_the_inverse_of_the_honest_phi(reading, honest, a, b):
    B_m, B_M = min(a, b), max(a, b)
    phi = robust.phi_of(reading, honest, B_m, B_M)
    assert robust.honest_phi_pct(reading, phi, B_m, B_M) == pytest.approx(honest)
    # Both readings then give one and the same ρ.
    assert robust.uncertainty_term(reading, phi, B_m, B_M) == pytest.approx(honest / B_m)


def test_alpha_is_the_same_for_B_and_its_inverse():
    assert robust.alpha_formula(1 / 42.6, 1 / 12.4) == pytest.approx(robust.alpha_formula(12.4, 42.6))


@given(positive, positive)
def test_minimax_reaches_alpha_and_nothing_does_better(a, b):
    B_m, B_M = min(a, b), max(a, b)
    best = robust.minimax_B_hat(B_m, B_M)
    alpha = robust.alpha_formula(B_m, B_M)
    assert robust.alpha_reached(best, B_m, B_M) == pytest.approx(alpha, abs=1e-12)
    for b_true in np.linspace(1 / B_M, 1 / B_m, 51):
        assert abs(1 - b_true * best) <= alpha + 1e-12
    for other in (0.9 * best, 1.1 * best, B_m, B_M):
        assert robust.alpha_reached(other, B_m, B_M) >= alpha - 1e-12


def test_pooled_is_the_counter_example():
    worst = max(abs(1 - b * 12.5) for b in np.linspace(1 / 42.6, 1 / 12.4, 10001))
    assert worst == pytest.approx(0.7066, abs=1e-4) and worst > robust.alpha_formula(12.4, 42.6)
    assert robust.alpha_reached(12.5, 12.4, 42.6) == pytest.approx(worst, abs=1e-9)
    assert f"{robust.minimax_B_hat(12.4, 42.6):.1f}" == "19.2"


def test_covers_only_what_it_covers():
    alpha, reached, norm_K = 0.549091, 0.7066, 5.40833
    rho = robust.rho(alpha, 5.0, norm_K, 2.13)
    assert robust.covers(rho, alpha, 5.0, norm_K, 2.13)
    assert not robust.covers(rho, reached, 5.0, norm_K, 2.13)
    assert not robust.covers(rho, 1.0, 5.0, norm_K, 2.13)
    wide = robust.rho(reached, 5.0, norm_K, 2.13)
    assert robust.covers(wide, reached, 5.0, norm_K, 2.13) and robust.covers(wide, alpha, 5.0, norm_K, 2.13)


def test_shares_add_up():
    rho = robust.rho(0.549091, 5.0, 5.40833, 2.13)
    assert rho.reference_term == pytest.approx(6.0887, abs=1e-4) and rho.phi_term == pytest.approx(4.7238, abs=1e-4)
    assert rho.constant == rho.reference_term + rho.phi_term


@given(positive, positive, positive, positive, st.floats(-0.99, 0.99))
def test_Q_solves_the_lyapunov_equation(K_P, K_D, p11, p22, share):
    from scipy.linalg import solve_continuous_lyapunov

    p12 = share * math.sqrt(p11 * p22)
    P = np.array([[p11, p12], [p12, p22]])
    A = np.array([[0.0, 1.0], [-K_P, -K_D]])
    Q = solve_Q(K_P, K_D, P)
    size = np.abs(Q).max()
    assert np.abs(A.T @ Q + Q @ A + P).max() <= 1e-9 * max(size * max(1, K_P, K_D), np.abs(P).max())
    assert solve_continuous_lyapunov(A.T, -P) == pytest.approx(Q, rel=1e-6, abs=1e-7 * size)
    assert np.linalg.eigvalsh(Q).min() > 0


def test_Q_of_the_paper():
    Q = solve_Q(4.5, 3.0, 5 * np.eye(2))
    assert Q[0, 1] == Q[1, 0] == pytest.approx(5 / 9)
    assert Q[1, 1] == pytest.approx((5 + 10 / 9) / 6)


def test_frequency_and_damping_both_ways():
    assert robust.frequency_and_damping(4.5, 3.0) == pytest.approx((2.1213, 0.7071), abs=1e-4)
    assert robust.damping_gains(*robust.frequency_and_damping(4.5, 3.0)) == pytest.approx((4.5, 3.0))


def test_equal_pi_of_the_paper():
    Q = solve_Q(4.5, 3.0, 5 * np.eye(2))
    K_P, K_I = robust.equal_pi(4.5, 3.0, 12.5, 10.8125, 0.5, Q[0, 1], Q[1, 1])
    assert (round(K_P), round(K_I)) == (313, 206)


@pytest.mark.parametrize("B_hat", [5.0, 12.5, 19.2, 23.0])
def test_alpha_reached_is_the_worst_over_the_range_to_the_last_digits(B_hat):
    worst = max(abs(1 - b * B_hat) for b in (1 / 42.6, 1 / 12.4))  # linear in b: at an end
    assert robust.alpha_reached(B_hat, 12.4, 42.6) == pytest.approx(worst, rel=1e-15)
