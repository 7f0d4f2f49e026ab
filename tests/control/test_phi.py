"""The range of B, and how far η is from η̂ by the model, or without one by the levels: closed forms."""

import numpy as np
import pandas as pd
import pytest

import eaid

HALF = {"a0": 2.0, "b0": 0.08, "c0": 0.0}
QUICK = {"rate_hz": 100.0, "pwm_hz": 0.0, "phi": 0.01, "q_max": 0.5, "pi_gains": (5.0, 10.0)}


def apart(gains):
    """The largest |η − η̂|, as the guarantee needs it."""
    return gains.guarantee.conditions[1].needed


def lag(tau=0.5, slope=0.02, low=10.0, **more):
    plain = {"C": 0.85, "tau1": [tau, 0, 0], "tau2": [tau, 0, 0], "Ts": [0, slope, 0, 0], "u_range": [low, 100.0]}
    return plain | more


@pytest.mark.parametrize("B", [10.0, 11.0, 20.0])
def test_where_a_model_departs_most(tuned, B):
    """A step from s to u: u/2 + (u − s)(1/2 − B/25) e^(−2t), by T = 0.02 (u + (s − u) e^(−2t))."""
    pct = apart(tuned(linear={**HALF, "bounds": {"B_m": B, "B_M": B}}, nonlinear=lag(), **QUICK))
    duties = np.linspace(10, 100, 19)
    each = [u / 2 + (u - s) * (0.5 - B / 25) for u in duties for s in (0.0, *duties)]
    assert pct == pytest.approx(max(map(abs, each)), rel=1e-12)


def test_a_model_is_followed_until_its_slow_part_has_settled(tuned):
    """Parts of 1 N·m with 0.1 and 100 s: 75 (1 − e^(−10 t)) less what the slow one gains, most at ln(3000)/10 s."""
    slow = lag(tau2=[100.0, 0, 0], tau1=[0.1, 0, 0], C=0.5, u_range=[100.0, 100.0])
    pct = apart(tuned(linear={**HALF, "bounds": {"B_m": 10.0, "B_M": 10.0}}, nonlinear=slow, **QUICK))
    at = np.log(3000) / 10
    wanted = 75 - 75 / 3000 - 25 * -np.expm1(-at / 100) - 0.1 * np.exp(-at / 100)
    assert pct == pytest.approx(wanted, abs=0.01)  # steps of 7 % in time


@pytest.mark.parametrize(("ends", "left"), [((20.0, 30.0), 0.0), ((10.0, 20.0), 20.0), ((30.0, 40.0), 20.0)])
def test_a_range_of_B_takes_what_lies_within_it(tuned, ends, left):
    """From rest to 100 % the plant's slope is 4 N·m/s: left over are 100 − 4 B, nothing for a B of 25."""
    linear = {"a0": 2.0, "b0": 0.04, "c0": 0.0, "bounds": {"B_m": ends[0], "B_M": ends[1]}}
    pct = apart(tuned(linear=linear, nonlinear=lag(low=100.0), **QUICK))
    assert pct == pytest.approx(left, abs=1e-9)


def row(level, a0, gain, **more):
    b0 = a0 * gain / level
    return {"level": level, "a0": a0, "gain": gain, "c0": 0.0, "b0": b0, "B": 1 / b0, **more}


def test_single_levels_depart_most_at_an_end(tuned):
    """η = a T B, η̂ = 2 T/0.08 from 0 to the highest level's 3 N·m: 6 B − 75, and with c0 = −2.42 −30.25 at rest."""
    levels = [row(24.0, 2.0, 1.0), row(60.0, 2.0, 3.0), row(40.0, 2.0, 1.0)]
    found = apart(tuned(linear={**HALF, "per_level": levels}, **QUICK))
    assert found == pytest.approx(45.0)
    first = apart(tuned(linear={**HALF, "per_level": [row(37.2, 2.0, 1.5)]}, **QUICK))
    assert first == pytest.approx(0.3)
    rest = apart(tuned(linear={"per_level": [row(40.0, 1.36, 40 / 17)]}, **QUICK))
    assert rest == pytest.approx(30.25)  # specification 4.7


LEVELS = [row(10.0, 2.0, 1.0), row(40.0, 2.0, 2.0), row(90.0, 3.0, 9.0)]


@pytest.mark.parametrize(
    ("linear", "words"),
    [
        ({"bounds": {"B_m": 0.0, "B_M": 42.6}}, "B_m is 0, so the range of B touches 0"),
        ({"bounds": {"B_m": None, "B_M": None}}, "B_m is missing"),
        ({"bounds": {"B_m": 50.0, "B_M": 42.6}}, "B_m 50 lies above B_M 42.6"),
        ({"per_level": [{**LEVELS[0], "gain": 0.0, "b0": 0.0, "B": None}]}, "touches 0"),
        ({"per_level": [{**LEVELS[0], "gain": -0.5, "b0": -0.1, "B": None}]}, "touches 0"),
    ],
)
def test_a_range_of_B_that_is_none_is_refused(tuned, linear, words):
    with pytest.raises(eaid.GainsError, match=words) as refusal:
        tuned(linear=linear)
    assert refusal.value.exit_code == 5


def test_no_guarantee_rests_on_a_single_level_and_a_reference_that_begins_off_rest_is_no_error():
    t, random, logs = np.arange(0.0, 8.0, 0.01), np.random.default_rng(2), []
    for _ in range(3):
        rise = 1 - np.exp(-np.maximum(t - 1.0, 0.0) / 0.8)
        torque = 3.2 * (1 + 0.03 * random.standard_normal()) * rise + 0.01 * random.standard_normal(len(t))
        logs.append(pd.DataFrame({"time_s": t, "duty_pct": np.where(t < 1.0, 0.0, 80.0), "torque_Nm": torque}))
    at = np.arange(0.0, 30.0, 0.01)
    wanted = (at, 1.6 + 0.5 * np.cos(0.2 * np.pi * at))
    gains = eaid.tune_rc(eaid.fit(logs), reference=wanted, b_hat="minimax", phi="data")
    held = {one.name: one.holds for one in gains.guarantee.conditions}
    assert gains.guarantee.holds is not True and held["phi"] is None and held["range"] is None
    assert held["rho"] is True  # B of one level is one number, to all its digits
    assert gains.replayed.rc.max_abs_error_nm < 0.2  # the reference jumps to 2.1 N·m at 0
