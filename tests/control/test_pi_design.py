"""PI gains: the check values, the inverse of the metrics, python-control as the oracle, refusals."""

import math

import numpy as np
import pytest
from hypothesis import Phase, example, given, settings
from hypothesis import strategies as st

from eaid.control.pi import error, pi_gains, step_metrics
from eaid.errors import GainsError
from eaid.models.parameters import PAPER_LINEAR, Linear


def test_check_values():
    assert pi_gains(PAPER_LINEAR, 1.0, 0.27) == pytest.approx((156.6, 252.9), abs=0.1)
    found = step_metrics(PAPER_LINEAR, 21.0, 360.0)
    assert f"{found.overshoot_pct:.1f}" == "41.7" and f"{found.settling_s:.2f}" == "2.52"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("K_P", "K_I"), [(21, 360), (156.6, 252.9), (5, 100), (300, 206), (17, 85), (17, 23.12), (60, 90), (0, 40)]
)
def test_metrics_agree_with_python_control(K_P, K_I):
    import control

    plant = control.tf([0.08], [1, 1.36])
    loop = control.feedback(plant * control.tf([K_P, K_I], [1, 0]))
    T = np.linspace(0, 12, 120001)
    info = control.step_info(loop, T=T, SettlingTimeThreshold=0.02)
    found = step_metrics(PAPER_LINEAR, K_P, K_I)
    assert found.overshoot_pct == pytest.approx(info["Overshoot"], abs=2e-3)
    assert found.settling_s == pytest.approx(info["SettlingTime"], abs=2e-3)


def slow_metrics(model, K_P, K_I, end=40.0, n=400001):
    p, q = model.a0 + model.b0 * K_P, model.b0 * K_I
    t = np.linspace(0, end, n)
    e = np.array([error(model.a0, p, q, float(x)) for x in t])
    outside = np.flatnonzero(np.abs(e) > 0.02)
    return max(0.0, -100 * e.min()), float(t[outside[-1]])


@pytest.mark.slow
def test_metrics_agree_with_the_sampled_curve_where_roots_meet():
    K_P = 30.0
    p = PAPER_LINEAR.a0 + PAPER_LINEAR.b0 * K_P
    K_I = (p / 2) ** 2 / PAPER_LINEAR.b0  # a double root
    for change in (0.0, 1e-12, -1e-12, 1e-6, -1e-6):
        found = step_metrics(PAPER_LINEAR, K_P, K_I * (1 + change))
        overshoot, settling = slow_metrics(PAPER_LINEAR, K_P, K_I)
        assert found.overshoot_pct == pytest.approx(overshoot, abs=1e-3)
        assert found.settling_s == pytest.approx(settling, abs=2e-4)


def test_error_solves_its_equation():
    a0, p, q = 1.36, 3.04, 28.8
    h = 1e-4
    for t in (0.01, 0.3, 1.0, 2.7):
        e0, e1, e2 = (error(a0, p, q, t + k * h) for k in (-1, 0, 1))
        assert (e2 - 2 * e1 + e0) / h**2 + p * (e2 - e0) / (2 * h) + q * e1 == pytest.approx(0, abs=1e-4)
    assert error(a0, p, q, 0.0) == 1.0
    assert (error(a0, p, q, h) - 1) / h == pytest.approx(a0 - p, rel=1e-3)


@settings(max_examples=12, deadline=None, phases=(Phase.explicit, Phase.generate))
@given(st.floats(0.0, 60.0, allow_subnormal=False), st.floats(0.05, 0.7), st.floats(0.3, 5.0), st.floats(0.01, 1.0))
@example(31.876777872693925, 0.27239660221813167, 4.651323593216634, 0.3200085481200855)  # the time jumps at the gain
def test_gains_give_what_was_asked(overshoot, settling, a0, b0):
    model = Linear(a0, b0, 0.0)
    K_P, K_I = pi_gains(model, overshoot, settling)
    found = step_metrics(model, K_P, K_I)
    assert K_P >= 0 and K_I >= 0
    assert found.overshoot_pct == pytest.approx(overshoot, abs=1e-6)
    # A lobe that dips out of the band makes the settling time jump: then the next shorter one is given.
    assert found.settling_s <= settling * (1 + 1e-9)
    if overshoot < 2:
        assert found.settling_s == pytest.approx(settling, rel=1e-9)


def test_no_overshoot_is_the_first_order_loop():
    gain = math.log(50) / 0.5 / 0.08
    assert pi_gains(PAPER_LINEAR, 0.0, 0.5) == pytest.approx((gain, 1.36 * gain))


@pytest.mark.parametrize(
    ("overshoot", "settling", "words"),
    [
        (100.0, 0.3, "overshoot of 100 %"),
        (-1.0, 0.3, "overshoot of -1 %"),
        (1.0, 0.0, "settling time of 0 s"),
        (1.0, 20.0, "integral control alone settles in"),
        (float("nan"), 0.3, "out of reach"),
    ],
)
def test_what_is_out_of_reach_is_refused(overshoot, settling, words):
    with pytest.raises(GainsError) as refusal:
        pi_gains(PAPER_LINEAR, overshoot, settling)
    assert words in str(refusal.value)


def test_without_integral_the_loop_never_arrives():
    assert step_metrics(PAPER_LINEAR, 21.0, 0.0).settling_s == math.inf
    found = step_metrics(PAPER_LINEAR, 2000.0, 0.0)  # offset 1.36/161.36 = 0.8 %: inside the band
    rest = 1.36 / 161.36
    assert found.settling_s == pytest.approx(math.log((1 - rest) / (0.02 - rest)) / 161.36)
    assert step_metrics(PAPER_LINEAR, -100.0, 1.0).settling_s == math.inf
