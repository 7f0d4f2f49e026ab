"""Margins against python-control where nothing is latched, and against brute simulation where the duty is."""

import math
from dataclasses import replace

import numpy as np
import pytest

from eaid.control.gains import paper_gains
from eaid.control.margins import (
    Feedback,
    Timing,
    is_stable,
    linear_lags,
    loop_response,
    margins,
    pi_feedback,
    rc_feedback,
    spectral_radius,
)
from eaid.control.pi import PIGains, PIState, pi_step
from eaid.errors import UsageError

PLAIN, LATCHED = Timing(1000.0, None), Timing(1000.0, 300.0)
LAGS = ((0.0772, 0.2673), (0.0136, 15.53))  # around 100 % duty of the reference plant
RC, PI = paper_gains()


@pytest.mark.parametrize("feedback", [pi_feedback(PI), Feedback(156.6, 252.9), Feedback(299.5, 210.4)])
def test_phase_margin_agrees_with_python_control(feedback):
    import control

    h = 1e-3
    plant = sum((control.tf([g], [tau, 1]) for g, tau in LAGS[1:]), control.tf([LAGS[0][0]], [LAGS[0][1], 1]))
    loop = (feedback.k_T + feedback.k_q * control.tf([h], [1, -1], h)) * control.c2d(plant, h, "zoh")
    omega = np.geomspace(0.1, 2000, 200)
    assert loop_response(feedback, LAGS, PLAIN, omega) == pytest.approx(loop(np.exp(1j * omega * h)), rel=1e-4)
    found = margins(feedback, LAGS, PLAIN)
    dense = np.geomspace(1.0, 500.0, 2000)
    response = control.frequency_response(loop, dense)
    crossover = np.exp(np.interp(0.0, -np.log(response.magnitude), np.log(dense)))
    phase = np.interp(np.log(crossover), np.log(dense), np.unwrap(response.phase))
    assert found.phase_deg == pytest.approx((180 + math.degrees(phase)) % 360, abs=0.02)
    assert found.crossover_hz * 2 * math.pi == pytest.approx(crossover, rel=1e-3)


def test_gain_margin_agrees_with_python_control_at_a_sampled_pole():
    """With K_I = 0 and one lag the loop leaves the unit circle at −1: a closed form, and python-control's poles."""
    import control

    h, tau, g, k = 1e-3, 0.27, 0.08, 300.0
    a = math.exp(-h / tau)
    limit = (1 + a) / (g * (1 - a) * k)
    found = margins(Feedback(k, 0.0), ((g, tau),), PLAIN)
    assert found.gain_db == pytest.approx(20 * math.log10(limit), abs=1e-3)
    loop = control.tf([k * limit * g * (1 - a)], [1, -a], h)
    assert np.abs(control.feedback(loop).poles()).max() == pytest.approx(1.0, abs=1e-6)


def latched_growth(feedback, lags, pwm_hz, factor, late_s, seconds=3.0):
    """Growth per second of the loop by brute force in steps of 1/300 ms: nothing shared with the map."""
    substep = 1 / 30000
    rate, n = 1000, int(seconds / substep)
    x, q, u = [1.0, 0.3], 0.0, 0.0
    queue, latest, size = [], 0.0, []
    per_sample, per_latch = 30, round(30000 / pwm_hz)
    wait = round(late_s / substep)
    for k in range(n):
        if k % per_sample == 0:
            torque = sum(x)
            latest = factor * (feedback.k_q * q - feedback.k_T * torque)
            q -= torque / rate
            size.append(abs(torque) + abs(q))
        if k % per_latch == 0:
            queue.append((k + wait, latest))
        while queue and queue[0][0] <= k:
            u = queue.pop(0)[1]
        x = [xi - math.expm1(-substep / tau) * (g * u - xi) for (g, tau), xi in zip(lags, x, strict=True)]
        if size[-1] > 1e12:
            break
    half = len(size) // 2
    return max(size[half:]) / max(size[: half or 1])


@pytest.mark.parametrize("late_s", [0.0, 0.004])
def test_latched_gain_margin_is_where_the_simulation_turns(late_s):
    feedback, lags = Feedback(299.5, 210.4), LAGS
    low, high = 1.0, 200.0
    for _ in range(40):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if spectral_radius(feedback, lags, LATCHED, middle, late_s) < 1 else (low, middle)
    assert latched_growth(feedback, lags, 300, 0.97 * low, late_s) < 0.5
    assert latched_growth(feedback, lags, 300, 1.03 * low, late_s) > 2
    if late_s == 0:
        assert margins(feedback, lags, LATCHED).gain_db == pytest.approx(20 * math.log10(low), abs=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize(("feedback", "seconds"), [(Feedback(299.5, 210.4), 3.0), (pi_feedback(PI), 16.0)])
def test_delay_margin_is_where_the_simulation_turns(feedback, seconds):
    found = margins(feedback, LAGS, LATCHED)
    assert latched_growth(feedback, LAGS, 300, 1.0, 0.94 * found.delay_s, seconds) < 0.7
    assert latched_growth(feedback, LAGS, 300, 1.0, 1.06 * found.delay_s, seconds) > 1.5
    # The usual rule from the frequency response agrees within a hold of the PWM.
    assert found.delay_s == pytest.approx(math.radians(found.phase_deg) / (2 * math.pi * found.crossover_hz), rel=0.1)


def test_latching_costs_margin():
    for feedback in (Feedback(299.5, 210.4), pi_feedback(PI)):
        with_latch, without = margins(feedback, LAGS, LATCHED), margins(feedback, LAGS, PLAIN)
        assert with_latch.gain_db < without.gain_db - 3 and with_latch.phase_deg < without.phase_deg


def test_latch_costs_the_phase_of_its_age_and_its_longer_hold():
    """Duties latched at 0, 3.33, 6.67 ms are 0, 0.33, 0.67 ms old; a hold of 3.33 ms lasts half of 2.33 ms longer."""
    omega = np.array([10.0, 40.0, 80.0])
    feedback = Feedback(299.5, 210.4)
    ratio = loop_response(feedback, LAGS, LATCHED, omega) / loop_response(feedback, LAGS, PLAIN, omega)
    assert -np.angle(ratio) == pytest.approx(omega * (1e-3 / 3 + 7e-3 / 6), rel=1e-4)


def test_unstable_is_said():
    found = margins(Feedback(30000.0, 0.0), LAGS, LATCHED)
    assert not found.stable and found.gain_db == -math.inf and found.delay_s == 0
    assert not is_stable(Feedback(0.0, -1.0), LAGS, LATCHED)


def test_rc_is_a_pi_near_the_middle_of_the_layer():
    """At a torque where η̂ is the duty held, the integral rests at 0: slopes of equal_pi, less the fed-forward a0/b0."""
    torque = 1.5
    held = (RC.a0 * torque - RC.c0) / RC.b0
    found = rc_feedback(RC, torque, held)
    assert found.k_T == pytest.approx(312.818 - 1.36 / 0.08, abs=0.01) and found.k_q == pytest.approx(206.42, abs=0.01)
    far = rc_feedback(RC, torque, held + 600)  # so far out that ω only grows with ρ
    assert far.k_T < 0.25 * found.k_T


def test_pi_feedback_is_what_the_step_does():
    gains = PIGains(21.0, 360.0)
    feedback = pi_feedback(gains)
    _, duty = pi_step(gains, PIState(0.1), 0.0, 0.0, -0.2, 1e-3)
    assert duty == pytest.approx(feedback.k_q * 0.1 + feedback.k_T * 0.2)


def test_an_odd_pwm_is_refused_in_words():
    with pytest.raises(UsageError, match="outside what margins are worked out for"):
        spectral_radius(pi_feedback(PI), linear_lags(0.08, 1.36), Timing(1000.0, 1.0), 1.0, 0.0)


@pytest.mark.slow
@pytest.mark.parametrize("timing", [PLAIN, LATCHED, Timing(100.0, None)])
@pytest.mark.parametrize("dead_s", [0.03, 0.12])
@pytest.mark.parametrize("feedback", [Feedback(20.0, 40.0), Feedback(60.0, 90.0), Feedback(4.0, 30.0)])
def test_margins_behind_a_dead_time_are_where_the_sampled_loop_ends(
    timing: Timing, dead_s: float, feedback: Feedback
) -> None:
    """Nyquist's margins against the exact map of the loop with the dead time among its states."""
    found = margins(feedback, LAGS, replace(timing, delay_samples=round(dead_s * timing.rate_hz)))
    assert found.stable is (spectral_radius(feedback, LAGS, timing, 1.0, dead_s) < 1)
    assert found.stable is is_stable(feedback, LAGS, replace(timing, delay_samples=round(dead_s * timing.rate_hz)))
    if not found.stable:
        return
    for share, stable in ((0.97, True), (1.03, False)):
        factor = 10 ** (found.gain_db / 20) * share
        assert (spectral_radius(feedback, LAGS, timing, factor, dead_s) < 1) is stable
        late = dead_s + found.delay_s * share
        assert (spectral_radius(feedback, LAGS, timing, 1.0, late) < 1) is stable
