"""Metrics on traces worked out by hand, and by closed forms."""

import math

import numpy as np
import pytest

from eaid.replay import metrics


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
