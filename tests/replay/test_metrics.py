"""Metrics on traces worked out by hand, and by closed forms."""

import math

import numpy as np
import pytest

from eaid.replay import metrics


def test_tracking_by_hand():
    def tracking(reference, torque, duty, limits=(0.0, 100.0)):
        columns = {"reference_nm": reference, "torque_nm": torque, "duty_pct": duty}
        return metrics.tracking_errors({name: np.array(column) for name, column in columns.items()}, limits)

    found = tracking([1.0, 1.0, 1.0, 1.0], [0.0, 1.0, 2.0, 3.0], [0.0, 100.0, 40.0, 30.0])
    assert (found.max_abs_error_nm, found.rms_error_nm) == (2.0, math.sqrt(6 / 4))
    assert (found.mean_abs_error_nm, found.saturated_fraction) == (1.0, 0.5)
    assert found.mean_abs_duty_step_pct == pytest.approx((100 + 60 + 10) / 3)
    narrow = tracking([1.0] * 3, [1.0] * 3, [5.0, 80.0, 50.0], (5.0, 80.0))
    assert narrow.saturated_fraction == pytest.approx(2 / 3)


@pytest.mark.parametrize(
    ("torque", "top", "dt", "rise", "overshoot", "settling"),
    [
        # 0.1 and 0.9 of 8 lie at 0.8 and 7.2: two tenths of the way from 0 to 4, and of that from 7 to 8
        ([0.0, 4.0, 7.0, 8.0, 6.0, 8.0], 8.0, 0.5, 1.0, 0.0, 2.5),
        ([0.94, 0.99, 1.03, 1.0], 1.0, 0.1, 0.0, 3.0, 0.3),  # starts above nine tenths
        ([0.5, 0.8, 1.0, 1.0, 1.0], 1.0, 0.1, 0.15, 0.0, 0.2),
        ([0.0, 1.0, 1.0, 9.0, 9.0, 10.0], 10.0, 0.5, 1.0, 0.0, 2.5),  # stands at a tenth and at nine of them
        ([0.0, 0.5, 0.85], 1.0, 0.1, None, 0.0, None),
        ([0.0, 1.0, 1.0, 1.03], 1.0, 0.1, 0.08, 3.0, None),  # leaves its band at the end
        ([0.0, 0.5, 0.97, 1.03, 0.979, 0.981, 1.0, 1.019], 1.0, 0.1, 0.1 * (1 + 0.4 / 0.47 - 0.2), 3.0, 0.5),
        ([1.0] * 5, 1.0, 0.01, 0.0, 0.0, 0.0),
    ],
)
def test_a_step_by_hand(torque, top, dt, rise, overshoot, settling):
    for start, turn in ((0.0, 1.0), (4.0, -1.0)):  # also downwards
        found = metrics.step(start + turn * np.array(torque), start, start + turn * top, dt)
        told = (found.rise_time_s, found.overshoot_pct, found.settling_s)
        assert [None if x is None else round(x, 9) for x in told] == [
            None if x is None else round(x, 9) for x in (rise, overshoot, settling)
        ]


def test_steps_of_first_and_second_order_by_their_formulas():
    t, tau, dt = np.arange(4000) * 1e-3, 0.3, 1e-3
    found = metrics.step(2.0 + (1 - np.exp(-t / tau)), 2.0, 3.0, dt)
    assert found.rise_time_s == pytest.approx(tau * math.log(9), abs=1e-5) and found.overshoot_pct == 0.0
    assert found.settling_s == pytest.approx(tau * math.log(50), abs=1.01e-3)
    zeta, wn, dt = 0.4, 5.0, 1e-4
    t, wd = np.arange(60_000) * dt, wn * math.sqrt(1 - zeta**2)
    y = 1 - np.exp(-zeta * wn * t) * (np.cos(wd * t) + zeta * wn / wd * np.sin(wd * t))
    found = metrics.step(3 * y, 0.0, 3.0, dt)
    assert found.overshoot_pct == pytest.approx(100 * math.exp(-math.pi * zeta / math.sqrt(1 - zeta**2)), rel=1e-5)
    assert found.settling_s == pytest.approx(t[np.abs(y - 1) > 0.02][-1], abs=1.1 * dt)


@pytest.mark.parametrize("samples", [1000, 1300])
def test_a_tone_has_the_gain_and_phase_that_made_it(samples):
    """Beside a constant; a half a radian ahead and 0.7 behind; also where the periods are not whole."""
    angle = 2 * np.pi * np.arange(samples) * 1e-3
    reference = 2 + np.sin(angle)
    for size, phase in ((0.5, -0.7), (2.0, 0.5), (3.0, -math.pi / 2)):
        torque = 40.0 + size * np.sin(angle + phase)
        found = metrics.tone(reference, torque, 1.0, 1e-3)
        assert found.gain_db == pytest.approx(20 * math.log10(size), abs=1e-9)
        assert found.phase_deg == pytest.approx(math.degrees(phase), abs=1e-8)
        assert found.mean_abs_error_nm == pytest.approx(np.abs(reference - torque).mean())
    assert metrics.tone(reference, np.zeros(samples), 1.0, 1e-3).gain_db is None
