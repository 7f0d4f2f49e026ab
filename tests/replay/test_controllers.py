"""The PI on top of the linear model's duty: exact where the model is, within the limits, no windup at them."""

import numpy as np
import pytest

from eaid.control.pi import PIState
from eaid.models.parameters import REFERENCE_PLANT, Linear
from eaid.replay.controllers import CONTROLLERS, FeedforwardGains, Knowledge, feedforward_step

GAINS = FeedforwardGains(K_P=21.0, K_I=360.0, a0=1.8, b0=0.08, c0=-0.4)
DT = 1e-3


def largest_error(gains: FeedforwardGains) -> float:
    """On the linear plant T' = −a0 T + b0 u + c0 with a0 and b0 as in GAINS, updated exactly, along 2 + sin 2πt."""
    state, torque, errors = PIState(0.0), 2.0, []
    decay = np.exp(-GAINS.a0 * DT)
    for t in np.arange(3000) * DT:
        reference, rate = 2.0 + np.sin(2 * np.pi * t), 2 * np.pi * np.cos(2 * np.pi * t)
        state, duty = feedforward_step(gains, state, reference, rate, torque, DT)
        errors.append(abs(reference - torque))
        torque = decay * torque + (1 - decay) / GAINS.a0 * (GAINS.b0 * duty + GAINS.c0)
    return max(errors)


def test_the_exact_model_leaves_no_error_but_that_of_sampling():
    wide = GAINS._replace(duty_min=-1e3, duty_max=1e3)
    half = 2 * np.pi**2 * DT * 2  # half a sample of the reference's curvature, and its decay through the loop
    assert largest_error(wide) < half
    assert largest_error(wide._replace(a0=0.0, c0=0.0, b0=1e9)) > 10 * half  # the PI alone


def test_the_duty_stays_within_its_limits_and_the_integral_does_not_wind_up():
    state, duty = feedforward_step(GAINS, PIState(0.1), 40.0, 0.0, 0.0, DT)
    assert duty == 100.0 and state == PIState(0.1)
    state, duty = feedforward_step(GAINS, PIState(0.1), 0.0, -50.0, 5.0, DT)
    assert duty == pytest.approx(0.0, abs=1e-9) and state == PIState(0.1)


def test_feedforward_is_the_model_alone_and_hears_no_torque():
    known = Knowledge(REFERENCE_PLANT, Linear(GAINS.a0, GAINS.b0, GAINS.c0), None, None, limits=(0.0, 90.0))
    law = CONTROLLERS["feedforward"](known)
    duties = [law.step(law.gains, law.start, 2.0, 0.5, torque, DT)[1] for torque in (0.0, 2.0, 9.0)]
    assert duties == pytest.approx([(0.5 + GAINS.a0 * 2.0 - GAINS.c0) / GAINS.b0] * 3)
    assert law.step(law.gains, law.start, 40.0, 0.0, 0.0, DT)[1] == 90.0
