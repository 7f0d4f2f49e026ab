"""The PI on the linear model: overshoot and settling time by python-control and closed forms; their inverse."""

import math

import pytest
from hypothesis import Phase, assume, example, given, settings
from hypothesis import strategies as st

import eaid

QUICK = {"rate_hz": 1e4, "pwm_hz": 0.0}
"""Sampled so fast that every loop of these tests is stable."""


def reached(tuned, K_P, K_I, a0=1.36, b0=0.08):
    linear = {"a0": a0, "b0": b0, "c0": 0.0, "bounds": {"B_m": 1 / b0, "B_M": 1 / b0}}
    pi = tuned(linear=linear, pi_gains=(K_P, K_I), **QUICK).pi
    return pi.overshoot_pct, pi.settling_s


@pytest.mark.parametrize(
    ("K_P", "K_I"),
    [(21, 360), (156.6, 252.9), (5, 100), (300, 206), (17, 85), (17, 23.12), (60, 90), (0, 40),
     *((30.0, 44.18 * (1 + k)) for k in (0.0, 1e-12, -1e-6, 1e-6))],  # roots that meet: ((a0 + b0 K_P)/2)²/b0
)  # fmt: skip
def test_metrics_agree_with_python_control(tuned, K_P, K_I):
    import control
    import numpy as np

    loop = control.feedback(control.tf([0.08], [1, 1.36]) * control.tf([K_P, K_I], [1, 0]))
    info = control.step_info(loop, T=np.linspace(0, 12, 40001), SettlingTimeThreshold=0.02)
    overshoot, settling = reached(tuned, K_P, K_I)
    assert overshoot == pytest.approx(info["Overshoot"], abs=5e-3)
    assert settling == pytest.approx(info["SettlingTime"], abs=5e-3)


def test_closed_forms(tuned):
    """Zero and pole cancel at K_I = a0 K_P: e = e^(−b0 K_P t). Without integral e ends at a0/(a0 + b0 K_P)."""
    assert reached(tuned, 8.0, 16.0, 2.0, 0.5) == pytest.approx((0.0, math.log(50) / 4), abs=1e-9)
    rest = 1.36 / 161.36
    assert reached(tuned, 2000.0, 0.0) == pytest.approx((0.0, math.log((1 - rest) / (0.02 - rest)) / 161.36))
    assert reached(tuned, 21.0, 0.0) == (0.0, None)
    assert reached(tuned, 97.9, 0.0, 1.0, 0.5)[1] is None  # 2 % at b0 K_P = 49
    assert reached(tuned, 98.1, 0.0, 1.0, 0.5)[1] is not None


def test_check_values_and_the_first_order_loop(tuned):
    found = tuned(pi_overshoot=1.0, pi_settling=0.27).pi
    assert pytest.approx((156.6, 252.9), abs=0.1) == (found.K_P, found.K_I)
    assert (found.asked.overshoot_pct, found.asked.settling_s) == (1.0, 0.27)
    gain = math.log(50) / 0.5 / 0.08
    first = tuned(pi_overshoot=0.0, pi_settling=0.5).pi
    assert pytest.approx((gain, 1.36 * gain)) == (first.K_P, first.K_I)


@settings(max_examples=15, deadline=None, phases=(Phase.explicit, Phase.generate))
@given(st.floats(0.0, 60.0, allow_subnormal=False), st.floats(0.05, 0.7), st.floats(0.3, 5.0), st.floats(0.01, 1.0))
@example(31.876777872693925, 0.27239660221813167, 4.651323593216634, 0.3200085481200855)  # the time jumps at the gain
@example(2.0, 0.671422276728012, 2.0, 0.5)  # a lobe that touches the band: rounding once made it 0.93 s
@example(1.99999999999999, 0.6751688762038743, 0.33245572043992144, 1.0)
def test_gains_give_what_was_asked(tuned, overshoot, settling, a0, b0):
    linear = {"a0": a0, "b0": b0, "c0": 0.0, "bounds": {"B_m": 1 / b0, "B_M": 1 / b0}}
    try:
        pi = tuned(linear=linear, pi_overshoot=overshoot, pi_settling=settling, **QUICK).pi
    except eaid.GainsError as refusal:
        assert "integral control alone settles in" in str(refusal)  # noqa: PT017
        assume(False)
    assert pi.K_P >= 0 and pi.K_I >= 0 and pi.overshoot_pct == pytest.approx(overshoot, abs=1e-6)
    # A lobe that dips out of the band makes the settling time jump: then the next shorter one is given.
    assert pi.settling_s <= settling * (1 + 1e-9)
    if overshoot < 2:
        assert pi.settling_s == pytest.approx(settling, rel=1e-9)


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        ({"pi_overshoot": 95.5, "pi_settling": 0.3}, "an overshoot of 95.5 % is out of reach; give one from 0 to 95 %"),
        ({"pi_overshoot": -1.0, "pi_settling": 0.3}, "overshoot of -1 %"),
        ({"pi_overshoot": 1.0, "pi_settling": 0.0}, "settling time of 0 s"),
        ({"pi_overshoot": 1.0, "pi_settling": 20.0}, "integral control alone settles in"),
        ({"pi_gains": (-0.01, 360.0)}, "PI gains -0.01 and 360: neither may be negative, nor both 0"),
        ({"pi_gains": (5.0, -0.01)}, "neither may be negative"),
        ({"pi_gains": (0.0, 0.0)}, "nor both 0"),
        (
            {"pi_gains": (21000.0, 360.0)},
            "the PI loop is unstable on the fitted model around 50 %, at 1000 Hz with the",
        ),
    ],
)
def test_what_is_out_of_reach_is_refused(tuned, asked, words):
    with pytest.raises(eaid.GainsError) as refusal:
        tuned(**asked)
    assert words in str(refusal.value) and refusal.value.exit_code == 5


def test_the_papers_pi_stands_beside_the_designed_one_on_the_papers_rig_alone(tuned, told):
    found = tuned(nonlinear=True)
    beside = told(found)["paper-pi"]
    assert (beside["overshoot_pct"], beside["settling_s"]) == pytest.approx((41.7, 2.52), rel=2e-3)
    assert pytest.approx(156.6, abs=0.1) == found.pi.K_P and found.replayed.pi.max_abs_error_nm < 0.4
    assert beside["error"] == found.replayed.paper_pi.max_abs_error_nm == pytest.approx(0.797, abs=5e-4)
    papers = tuned(nonlinear=True, pi_gains=(21.0, 360.0))
    assert papers.replayed.pi == found.replayed.paper_pi and papers.replayed.paper_pi is None
    for other in (papers, tuned(), tuned(nonlinear=True, data={"input_unit": "V", "levels": [10.0, 100.0]})):
        assert "paper-pi" not in told(other)
