"""Margins against python-control, closed forms and brute simulation of the loop as it runs; what is told of them."""

import math

import pytest

import eaid
from eaid.control.margins import may_be_steeper, operating_points
from eaid.plant.dynamics import Plant
from eaid.plant.linear import PAPER_LINEAR
from eaid.results.codec import to_plain
from eaid.results.plant import FittedPlant

from .test_dead_time import slopes as slopes_of

LAGS = ((0.0772, 0.2673), (0.0136, 15.53))
"""Gain [N·m/%] and time constant [s] of two lags, as around 100 % duty of the reference plant."""
PI = (21.0, 360.0)
MILD = {"kp": 0.3, "kd": 1.36, "q_max": 0.1, "phi": 0.001, "epsilon": 1e6, "gamma": 1.0, "reference": [0.0, 0.0]}
"""An RC so slow that it stands beside any PI; nothing that is replayed."""


def plant_of(lags):
    """A nonlinear model that is these two lags at every duty; one operating point, 50 %, is looked at."""
    (g1, tau1), (g2, tau2) = lags
    return {"C": g1 / (g1 + g2), "tau1": [tau1, 0, 0], "tau2": [tau2, 0, 0], "Ts": [0, g1 + g2, 0, 0],
            "u_range": [10.0, 100.0]}  # fmt: skip


@pytest.fixture(scope="session")
def point(tuned):
    """Margins of RC and PI around 50 % of a plant of lags."""

    def point(lags, pi, linear=None, **options):
        data = {"input_unit": "%", "output_unit": "N·m", "levels": [50.0]}
        found = tuned(nonlinear=plant_of(lags), data=data, linear=linear, pi_gains=pi, **MILD | options)
        (one,) = found.margins.points
        assert one.duty_pct == 50.0 and one.torque_nm == pytest.approx(50 * (lags[0][0] + lags[1][0]))
        return one

    return point


def test_a_loop_below_one_everywhere_has_no_crossover(point):
    found = point(((0.5, 0.2), (0.5, 0.2)), (0.5, 0.0), pwm_hz=0.0).loops["pi"]
    assert (found.stable, found.phase_deg, found.crossover_hz) == (True, None, 0.0)


def growth(slopes, lags, pwm_hz, factor, late_s, seconds=3.0):
    """How the loop δu = −k_T δT + k_q δq grows, by brute force in steps of 1/30 ms: nothing shared with the map."""
    k_T, k_q = slopes
    substep, per_latch = 1 / 30000, round(30000 / pwm_hz) if pwm_hz else 30
    x, q, u, latest, queue, size = [1.0, 0.3], 0.0, 0.0, 0.0, [], []
    keep = [math.exp(-substep / tau) for _, tau in lags]
    wait = round(late_s / substep)
    for k in range(int(seconds / substep)):
        if k % 30 == 0:
            torque = sum(x)
            latest = factor * (k_q * q - k_T * torque)
            q -= torque / 1000
            size.append(abs(torque) + abs(q))
        if k % per_latch == 0:
            queue.append((k + wait, latest))
        while queue and queue[0][0] <= k:
            u = queue.pop(0)[1]
        x = [a * xi + (1 - a) * g * u for a, (g, _), xi in zip(keep, lags, x, strict=True)]
        if size[-1] > 1e12:
            break
    half = len(size) // 2
    return max(size[half:]) / max(size[: half or 1])


@pytest.mark.parametrize("pwm_hz", [0.0, 300.0])
@pytest.mark.parametrize(("pi", "seconds"), [((299.5, 210.4), 3.0), pytest.param(PI, 16.0, marks=pytest.mark.slow)])
def test_gain_and_phase_margins_are_where_the_simulation_turns(point, pi, seconds, pwm_hz):
    found = point(LAGS, pi, pwm_hz=pwm_hz).loops["pi"]
    factor = 10 ** (found.gain_db / 20)
    assert growth(pi, LAGS, pwm_hz, 0.97 * factor, 0.0) < 0.5 < 2 < growth(pi, LAGS, pwm_hz, 1.03 * factor, 0.0)
    assert growth(pi, LAGS, pwm_hz, 1.0, 0.85 * late_of(found), seconds) < 0.7
    assert growth(pi, LAGS, pwm_hz, 1.0, 1.15 * late_of(found), seconds) > 1.5


def late_of(found):
    """The delay that takes the phase margin away [s]."""
    return math.radians(found.phase_deg) / (2 * math.pi * found.crossover_hz)


@pytest.mark.parametrize("c0", [-0.676, -2.42])
def test_margins_of_the_robust_law_are_where_the_simulation_turns(tuned, point, c0):
    """In the middle of the layer (c0 = 1.36·4.54 − 4, where η̂ is the duty held) it is the PI of equal slope."""
    c0 = c0 if c0 == -2.42 else 1.36 * 50 * 0.0908 - 0.08 * 50
    rc = {"kp": 4.5, "kd": 3.0, "q_max": 5.0, "phi": 0.05, "epsilon": 0.5, "gamma": 50.0, "linear": {"c0": c0}}
    found = point(LAGS, PI, pwm_hz=300.0, **rc).loops["rc"]
    made = tuned(linear={"c0": c0})
    slopes = slopes_of(made, "rc", 50 * 0.0908, 50.0)
    if c0 != -2.42:
        assert slopes == pytest.approx((made.rc.equal_pi.K_P - 17.0, made.rc.equal_pi.K_I), rel=1e-4)
        assert slopes == pytest.approx((312.818 - 17.0, 206.42), abs=0.01)
    else:
        assert slopes[0] > 330
    factor = 10 ** (found.gain_db / 20)
    assert growth(slopes, LAGS, 300.0, 0.97 * factor, 0.0) < 0.5 < 2 < growth(slopes, LAGS, 300.0, 1.03 * factor, 0.0)
    assert growth(slopes, LAGS, 300.0, 1.0, 0.85 * late_of(found)) < 0.7
    assert growth(slopes, LAGS, 300.0, 1.0, 1.15 * late_of(found)) > 1.5


def test_margins_of_the_reference_plant(tuned, told):
    levels = [{"level": float(u), "a0": 1.5, "gain": 2.0, "b0": 3 / u, "c0": 0.0, "B": u / 3} for u in (30, 90)]
    found = tuned(nonlinear=True, pi_gains=PI)
    points = found.margins.points
    assert [point.duty_pct for point in points] == pytest.approx([10 * k for k in range(1, 11)])
    for law in ("rc", "pi"):
        worst = found.margins.worst[law]
        for name in ("gain_db", "phase_deg"):
            assert getattr(worst, name) == min(getattr(point.loops[law], name) for point in points)
    missed = [one for one in found.findings if one.code == "margin-missed"]
    assert [one.subject for one in missed] == ["pi"] and list(missed[0].levels) == [30, 40, 50, 60, 70, 80, 90]
    assert missed[0].values["phase_deg"] < 45 == missed[0].values["enough_deg"]
    assert found.margins.timing.rate_hz == 1000.0 and found.margins.timing.pwm_hz == 300.0
    # with neither model each level's own lag, or else the pooled one at half the actuator
    alone = tuned(linear={"per_level": levels}).margins.points
    assert [(one.duty_pct, one.torque_nm) for one in alone] == [(30.0, 2.0), (90.0, 2.0)]
    (pooled,) = tuned(duty_limits=(10.0, 90.0)).margins.points
    assert (pooled.duty_pct, pooled.torque_nm) == (50.0, pytest.approx((0.08 * 50 - 2.42) / 1.36))
    own = tuned(nonlinear=True)
    assert not [one for one in own.findings if one.code == "margin-missed"] and own.margins.worst["pi"].phase_deg > 45
    sharp = tuned(nonlinear=True, epsilon=0.08, gamma=300.0)
    assert {one.subject for one in sharp.findings if one.code == "margin-missed"} == {"rc"}
    with pytest.raises(eaid.GainsError, match="RC loop is unstable on the fitted model around 100 %, at 1000 Hz"):
        tuned(nonlinear=True, epsilon=0.05, gamma=500.0)


@pytest.mark.parametrize(("width", "rises"), [(None, False), (0.01, False), (0.2, True)])
def test_a_fall_that_the_levels_bear_out_stays(width, rises):
    """T_s of 1.36, 2.64 and 2 N·m with such intervals, its slope at the highest −0.04."""
    plant, levels = Plant((0.3,), (3.0,), (0.0, 0.08, -0.0006), (20.0, 100.0)), (20.0, 60.0, 100.0)
    points = operating_points(plant, PAPER_LINEAR, (), levels, (0.0, 100.0))
    ends = {one.duty_pct: width and (one.torque_nm * (1 - width), one.torque_nm * (1 + width)) for one in points}
    low, middle, high = may_be_steeper(points, plant, ends, 0.05)
    assert (high.plant.gain > 0) is rises and high.times == 1.0 and (rises or high.plant.gain == pytest.approx(-0.04))
    # T_s is the parabola through rest and two levels itself; beside the middle it is steepest at 20 %
    assert low.times == pytest.approx(1.1 + (width or 0.0))
    assert middle.steepest.plant.gain == pytest.approx((1.1 + (width or 0.0)) * 0.056)


def test_loops_that_are_unstable_and_latches_that_are_none(tuned):
    said = "the RC loop is unstable on the fitted model around 50 %, at 1000 Hz with the duty la"
    with pytest.raises(eaid.GainsError, match=said):
        tuned(epsilon=0.001, gamma=1e4)
    for pwm_hz in (9.95, 1e5):
        with pytest.raises(eaid.UsageError, match="outside what margins are worked out for"):
            tuned(pwm_hz=pwm_hz)
    plain = tuned(pwm_hz=0.0).margins
    assert plain.timing.pwm_hz is None and plain.points == tuned(pwm_hz=1000.0).margins.points
    quick = [tuned(pwm_hz=0.0, rate_hz=rate, pi_gains=PI).margins.worst["pi"] for rate in (400.0, 8000.0)]
    assert quick[1].phase_deg == pytest.approx(quick[0].phase_deg, rel=0.05)  # by the map, and by the response
    # two rates without a short common period: the margins of the nearest that have one
    near, far = (tuned(pwm_hz=pwm_hz, pi_gains=PI).margins.worst["pi"] for pwm_hz in (250.0, 250.37))
    assert far.gain_db == pytest.approx(near.gain_db, rel=0.02) and far.phase_deg == pytest.approx(near.phase_deg)


def test_behind_a_dead_time_the_map_of_the_state_and_the_response_say_the_same(fit_of, rises):
    """Twenty holds of dead time are taken by the map, twenty-one by the response: one hold apart, and no more."""
    data = {"input_unit": "%", "output_unit": "N·m", "levels": [50.0]}
    found = []
    for holds in (19, 20, 21, 22):
        fit = fit_of(nonlinear=plant_of(LAGS), data=data, steps=rises(holds / 250))
        options = {**MILD, "pi_gains": (30.0, 40.0), "rate_hz": 250.0, "pwm_hz": 0.0}
        found.append(eaid.tune_rc(fit, **options).margins.worst["pi"])
    for name in ("gain_db", "phase_deg"):
        first, second, third, fourth = (getattr(one, name) for one in found)
        assert third - second == pytest.approx(0.5 * (second - first + fourth - third), rel=0.03)


@pytest.mark.parametrize("unit", ["V", "%"])
def test_a_rig_and_its_mirror_have_one_margin(fit_of, unit):
    """An input of both signs is held on both sides of rest: the steeper one decides, whichever it is."""
    least = []
    for up, down in ((0.05, 0.03), (0.03, 0.05)):
        plant = Plant((0.5,), (0.5,), (0.0, up), (10.0, 100.0), C=1.0, Ts_below=(0.0, -down))
        data = {"input_unit": unit, "output_unit": "N·m", "levels": [10.0, 50.0, 100.0]}
        fit = fit_of(plant=to_plain(FittedPlant.of(plant, (unit, "N·m"))), data=data)
        made = eaid.tune_rc(fit, pi_gains=(10.0, 20.0), anyway=True)
        assert made.duty_limits_pct == (-100.0, 100.0)
        points = made.margins.points
        assert [one.duty_pct for one in points] == [-100, -50, -10, 10, 50, 100]
        gains = {one.duty_pct > 0: one.loops["pi"].gain_db for one in points}
        least.append(gains[up > down])
        assert least[-1] == min(gains.values())
        assert least[-1] == pytest.approx(max(gains.values()) - 20 * math.log10(5 / 3), abs=0.3)
    assert least[0] == pytest.approx(least[1], rel=1e-9)


def test_a_flat_top_has_the_slope_that_its_intervals_allow():
    """A clutch that saturates: a level 1 % below the one before, each known to 2.6 %, let no controller be designed."""
    through = ((70.0, 3.1), (80.0, 3.35), (90.0, 3.47), (100.0, 3.44))
    plant = Plant((0.4,), (6.0,), (0.0, 0.04), (70.0, 100.0), Ts_through=through)
    points = operating_points(plant, PAPER_LINEAR, (), [u for u, _ in through], (0.0, 100.0))
    ends = {u: (Ts * 0.974, Ts * 1.026) for u, Ts in through}
    top = may_be_steeper(points, plant, ends, 0.0)[-1]
    assert points[-1].plant.gain < 0 and top.plant.gain == pytest.approx((3.44 * 1.026 - 3.47 * 0.974) / 10)
    ends[100.0] = (3.0, 3.1)  # that falls for certain
    assert may_be_steeper(points, plant, ends, 0.0)[-1].plant.gain < 0


@pytest.mark.slow
def test_gains_of_a_ringing_plant_keep_their_margins_where_its_gain_ends(fit_of):
    """Its T_s is known by levels of the plant, as the clutch's is by its own: a phase margin of 49° was one of 35°."""
    plant = {"kind": "ringing", "Ts": [0.0, 0.5], "tau1": [0.05], "tau2": [], "zeta": 0.25, "u_range": [2.0, 10.0]}

    def made(wide, gain=0.5, **options):
        ends = [[u, gain * u * (1 - wide), gain * u * (1 + wide)] for u in (2.0, 10.0)]
        known = {**plant, "Ts": [0.0, gain], "ci95": {"levels": {"Ts": ends}}}
        return eaid.tune_rc(fit_of(plant=known, linear={"a0": 15.0, "b0": 7.5, "c0": 0.0}), **options)

    for wide, holds in ((0.0, False), (0.25, True)):
        designed = made(wide).pi
        steeper = made(0.0, 0.5 * 1.25, pi_gains=(designed.K_P, designed.K_I), anyway=True).margins.worst["pi"]
        assert (steeper.gain_db > 6 and steeper.phase_deg > 45) is holds, steeper


@pytest.mark.parametrize("b_hat", [-1, -1.0, 0])
def test_a_b_hat_that_turns_the_loop_round_is_refused_as_a_whole_number_too(fit_of, b_hat):
    """-1 in Python was looked for a boundary layer without end."""
    with pytest.raises(eaid.GainsError, match="it has to be positive, or the loop is turned round"):
        eaid.tune_rc(fit_of(), b_hat=b_hat)
