"""The range of B, and how far η is from η̂ by model, logs and levels: closed forms and windows fitted by NumPy."""

import numpy as np
import pytest

import eaid

HALF = {"a0": 2.0, "b0": 0.08, "c0": 0.0}
QUICK = {"rate_hz": 100.0, "pwm_hz": 0.0, "reference": "ramp", "phi": 0.01, "q_max": 0.5, "pi_gains": (5.0, 10.0)}


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


@pytest.mark.parametrize("rate_hz", [100.0, 50.0, 20.0, 4.0])
def test_logs_show_lines_through_a_tenth_of_a_second_or_three_samples(tuned, clutch_set, rate_hz):
    """u − η̂(T) less the nearest of B Ṫ, over windows that NumPy fits; the last one may be short."""
    levels = (20.0, 70.0, 100.0)
    logs = clutch_set(levels=levels, duration_s=6.0, rate_hz=rate_hz, noise_nm=0.01, seed=3)
    made = tuned(nonlinear=True, logs=logs, **QUICK)
    count = max(round(0.1 * rate_hz), 3)
    each = []
    for level in logs.levels:
        t, y = level.time_s, level.runs.mean(axis=0)
        for a in range(0, len(t) - 2, count):
            slope = np.polyfit(t[a : a + count], y[a : a + count], 1)[0]
            left = level.level - (1.36 * y[a : a + count].mean() + 2.42) / 0.08
            low, high = sorted((12.4 * slope, 42.6 * slope))
            each.append((max(left - high, 0.0) + min(left - low, 0.0), t[a : a + count].mean(), level.level))
    signed, at, duty = max(each, key=lambda one: abs(one[0]))
    found = made.phi_from_data.logs
    assert found.signed_pct == pytest.approx(signed, rel=1e-6)
    assert found.where == f"{at:.3g} s after the step to {duty:g} %"
    assert made.rc.phi_needed_pct == max(found.pct, made.phi_from_data.model.pct)


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
    assert rest.rc.phi_needed_pct == pytest.approx(30.25)  # with neither model nor logs the levels' counts


LEVELS = [row(10.0, 2.0, 1.0), row(40.0, 2.0, 2.0), row(90.0, 3.0, 9.0)]


def test_the_range_of_B_by_hand(tuned):
    """B is u/(a g): 5, 10, 3.33; what the fit kept stands unless other levels are named."""

    def bounds(stored, levels=LEVELS, **options):
        rc = tuned(linear={**HALF, "per_level": levels, "bounds": stored}, **QUICK, **options).rc
        return rc.bounds.levels, rc.B_m, rc.B_M, rc.bounds.widened

    kept = {"levels": [10.0, 90.0], "B_m": 3.0, "B_M": 6.0}
    assert bounds(None) == ((10.0, 40.0, 90.0), pytest.approx(10 / 3), 10.0, False)
    assert bounds(kept) == ((10.0, 90.0), 3.0, 6.0, False)
    assert bounds(kept, bounds_levels="10:40") == ((10.0, 40.0), 5.0, 10.0, False)
    assert bounds(kept, bounds_levels="40") == ((40.0,), 10.0, 10.0, False)
    wide = [{**one, "ci95": {"B": [0.5 * one["B"], 2.0 * one["B"]]}} for one in LEVELS]
    widened = (10.0, 40.0, 90.0), pytest.approx(5 / 3), pytest.approx(20.0), True
    assert bounds(None, wide, widen_bounds=True) == widened
    with pytest.raises(eaid.UsageError, match="level 40 has no interval of B"):
        bounds(None, [wide[0], LEVELS[1]], widen_bounds=True)
    with pytest.raises(eaid.DataError, match="no log holds 35"):
        bounds(kept, bounds_levels="35")
    with pytest.raises(eaid.UsageError, match="no fits of single levels"):
        tuned(bounds_levels="30:100")


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
