"""The range of B, and how far η is from η̂ by model and levels: closed forms."""

import numpy as np
import pytest

import eaid

HALF = {"a0": 2.0, "b0": 0.08, "c0": 0.0}
QUICK = {"rate_hz": 100.0, "pwm_hz": 0.0, "phi": 0.01, "q_max": 0.5, "pi_gains": (5.0, 10.0)}


def lag(tau=0.5, slope=0.02, low=10.0, **more):
    plain = {"C": 0.85, "tau1": [tau, 0, 0], "tau2": [tau, 0, 0], "Ts": [0, slope, 0, 0], "u_range": [low, 100.0]}
    return plain | more


@pytest.mark.parametrize("B", [10.0, 11.0, 20.0])
def test_where_a_model_departs_most(tuned, B):
    """A step from s to u: u/2 + (u − s)(1/2 − B/25) e^(−2t), by T = 0.02 (u + (s − u) e^(−2t))."""
    found = tuned(linear={**HALF, "bounds": {"B_m": B, "B_M": B}}, nonlinear=lag(), **QUICK).phi_from_data.model
    duties = np.linspace(10, 100, 19)
    each = {(u, s): u / 2 + (u - s) * (0.5 - B / 25) for u in duties for s in (0.0, *duties)}
    (u, s), most = max(each.items(), key=lambda item: abs(item[1]))
    assert found.signed_pct == pytest.approx(most, rel=1e-12) and found.pct == abs(found.signed_pct)
    assert found.where == f"0 s after a step from {f'{s:g} %' if s else 'rest'} to {u:g} %"


def test_a_model_is_followed_until_its_slow_part_has_settled(tuned):
    """Parts of 1 N·m with 0.1 and 100 s: 75 (1 − e^(−10 t)) less what the slow one gains, most at ln(3000)/10 s."""
    slow = lag(tau2=[100.0, 0, 0], tau1=[0.1, 0, 0], C=0.5, u_range=[100.0, 100.0])
    found = tuned(linear={**HALF, "bounds": {"B_m": 10.0, "B_M": 10.0}}, nonlinear=slow, **QUICK).phi_from_data.model
    at = np.log(3000) / 10
    wanted = 75 - 75 / 3000 - 25 * -np.expm1(-at / 100) - 0.1 * np.exp(-at / 100)
    assert found.signed_pct == pytest.approx(wanted, abs=0.01)  # steps of 7 % in time
    assert float(found.where.split()[0]) == pytest.approx(at, rel=0.07)
    assert found.where.endswith(" s after a step from rest to 100 %")


@pytest.mark.parametrize(("ends", "signed"), [((20.0, 30.0), 0.0), ((10.0, 20.0), 20.0), ((30.0, 40.0), -20.0)])
def test_a_range_of_B_takes_what_lies_within_it(tuned, ends, signed):
    """From rest to 100 % the plant's slope is 4 N·m/s: left over are 100 − 4 B, nothing for a B of 25."""
    linear = {"a0": 2.0, "b0": 0.04, "c0": 0.0, "bounds": {"B_m": ends[0], "B_M": ends[1]}}
    found = tuned(linear=linear, nonlinear=lag(low=100.0), **QUICK).phi_from_data.model
    assert found.signed_pct == pytest.approx(signed, abs=1e-9)
    if signed:
        assert found.where == "0 s after a step from rest to 100 %"


def row(level, a0, gain, **more):
    b0 = a0 * gain / level
    return {"level": level, "a0": a0, "gain": gain, "c0": 0.0, "b0": b0, "B": 1 / b0, **more}


def test_single_levels_depart_most_at_an_end(tuned):
    """η = a T B, η̂ = 2 T/0.08 from 0 to the highest level's 3 N·m: 6 B − 75, and with c0 = −2.42 −30.25 at rest."""
    levels = [row(24.0, 2.0, 1.0), row(60.0, 2.0, 3.0), row(40.0, 2.0, 1.0)]
    found = tuned(linear={**HALF, "per_level": levels}, **QUICK).phi_from_data.levels
    assert (found.signed_pct, found.where) == (
        pytest.approx(45.0), "at an output of 3 on the model of 40 % alone")  # fmt: skip
    first = tuned(linear={**HALF, "per_level": [row(37.2, 2.0, 1.5)]}, **QUICK).phi_from_data.levels
    assert (first.signed_pct, first.pct) == (pytest.approx(-0.3), pytest.approx(0.3))
    rest = tuned(linear={"per_level": [row(40.0, 1.36, 40 / 17)]}, **QUICK)
    assert rest.phi_from_data.levels.signed_pct == pytest.approx(-30.25)  # specification 4.7
    assert rest.rc.phi_needed_pct == pytest.approx(30.25)  # without a model the levels' counts


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
