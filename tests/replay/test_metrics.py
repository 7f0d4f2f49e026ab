"""Metrics on traces worked out by hand."""

import math

import msgspec
import numpy as np
import pytest

from eaid.replay import metrics
from eaid.results.gains import Tracking


def test_tracking_by_hand():
    found = metrics.tracking(
        np.array([1.0, 1.0, 1.0, 1.0]), np.array([0.0, 1.0, 2.0, 3.0]), np.array([0.0, 100.0, 40.0, 30.0]), 0.5
    )
    assert found == Tracking(
        max_abs_error_nm=2.0,
        rms_error_nm=math.sqrt(6 / 4),
        mean_abs_error_nm=1.0,
        iae_nm_s=2.0,
        mean_abs_duty_step_pct=pytest.approx((100 + 60 + 10) / 3),
        saturated_fraction=0.5,
    )
    assert {type(value) for value in msgspec.structs.astuple(found)} == {float}


def test_a_controller_with_narrower_limits_saturates_at_them():
    found = metrics.tracking(np.ones(3), np.ones(3), np.array([5.0, 80.0, 50.0]), 0.1, (5.0, 80.0))
    assert found.saturated_fraction == pytest.approx(2 / 3)


def test_one_sample_has_no_step_of_its_duty():
    assert metrics.tracking(np.ones(1), np.zeros(1), np.array([50.0]), 0.1).mean_abs_duty_step_pct == 0.0


def test_a_rise_that_begins_above_10_percent_is_counted_from_its_first_sample():
    found = metrics.step(np.array([0.5, 0.8, 1.0, 1.0, 1.0]), 0.0, 1.0, 0.1)
    assert found.rise_time_s == pytest.approx(0.15, rel=1e-12)


@pytest.mark.parametrize("turn", [1.0, -1.0])
def test_a_first_order_step_has_its_textbook_times(turn):
    dt, tau = 1e-3, 0.2
    t = np.arange(4000) * dt
    torque = 2.0 + turn * (1 - np.exp(-t / tau))
    found = metrics.step(torque, 2.0, 2.0 + turn, dt)
    assert found.rise_time_s == pytest.approx(tau * math.log(9), abs=1e-5)
    assert found.settling_s == pytest.approx(tau * math.log(50), abs=1.01e-3)
    assert found.settling_5pct_s == pytest.approx(tau * math.log(20), abs=1.01e-3)
    assert found.overshoot_pct == 0.0


def test_a_second_order_step_overshoots_as_the_formula_says():
    zeta, wn, dt = 0.4, 5.0, 1e-4
    t = np.arange(60_000) * dt
    wd = wn * math.sqrt(1 - zeta**2)
    y = 1 - np.exp(-zeta * wn * t) * (np.cos(wd * t) + zeta * wn / wd * np.sin(wd * t))
    found = metrics.step(3 * y, 0.0, 3.0, dt)
    assert found.overshoot_pct == pytest.approx(100 * math.exp(-math.pi * zeta / math.sqrt(1 - zeta**2)), rel=1e-5)
    last = t[np.abs(y - 1) > 0.02][-1]
    assert found.settling_s == pytest.approx(last, abs=1.1 * dt)


def test_what_is_never_reached_is_none():
    found = metrics.step(np.linspace(0, 0.5, 100), 0.0, 1.0, 0.01)
    assert found.rise_time_s is None and found.settling_s is None and found.settling_5pct_s is None


def test_a_step_that_is_there_at_once():
    found = metrics.step(np.ones(10), 0.0, 1.0, 0.01)
    assert (found.rise_time_s, found.settling_s) == (0.0, 0.0)


def test_a_tone_has_the_gain_and_phase_that_made_it():
    dt, f = 1e-3, 1.5
    t = np.arange(2000) * dt
    reference = 2 + np.sin(2 * np.pi * f * t)
    torque = 1.9 + 0.5 * np.sin(2 * np.pi * f * t - 0.7) + 0.1 * np.sin(2 * np.pi * 3 * f * t)
    found = metrics.tone(reference, torque, f, dt)
    assert found.gain_db == pytest.approx(20 * math.log10(0.5), abs=1e-9)
    assert found.phase_deg == pytest.approx(-math.degrees(0.7), abs=1e-9)
    assert found.mean_abs_error_nm == pytest.approx(np.abs(reference - torque).mean())


@pytest.mark.parametrize("samples", [300, 1300])
def test_a_tone_is_found_beside_a_constant_also_where_the_periods_are_not_whole(samples):
    angle = 2 * np.pi * np.arange(samples) * 1e-3
    values = 40.0 + 0.5 * np.sin(angle - 0.7)
    assert metrics.fundamental(values, 1.0, 1e-3) == pytest.approx(0.5 * np.exp(-0.7j), abs=1e-10)


def test_a_torque_that_does_not_answer_has_no_gain():
    reference = 2 + np.sin(2 * np.pi * np.arange(1000) * 1e-3)
    assert metrics.tone(reference, np.zeros(1000), 1.0, 1e-3).gain_db is None
