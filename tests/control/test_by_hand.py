"""What φ the data show, and where; bounds, operating points and verdicts at their edges; each worked out by hand."""

import math
from dataclasses import replace

import numpy as np
import pytest

from eaid.apparatus import Apparatus
from eaid.control.bounds import Bounds, LevelB, bounds_of, physical
from eaid.control.design import shown_by_levels, shown_by_logs, shown_by_model
from eaid.control.gains import paper_gains
from eaid.control.operating import actuator, operating_points
from eaid.errors import GainsError, UsageError
from eaid.models.parameters import Linear, Nonlinear
from eaid.results.codec import from_plain
from eaid.results.fit import Fit
from eaid.steps.stepset import Level, StepSet

HALF = Linear(2.0, 0.08, 0.0)
"""Held by half the duty that the plant below takes."""
PLANT = Nonlinear(tau1=(0.5,), tau2=(0.5,), Ts=(0.0, 0.02), u_range=(10.0, 100.0))


# φ from data


@pytest.mark.parametrize(
    ("B", "signed", "where"),
    [
        (10.0, 60.0, "0 s after a step from rest to 100 V"),
        (100.0, 320.0, "0 s after a step from 100 V to 10 V"),
        (20.0, -80.0, None),
    ],
)
def test_where_a_model_departs_most(B: float, signed: float, where: str | None) -> None:
    """A step from s to u: u/2 + (u − s)(1/2 − B/25) e^(−2t), by T = 0.02 (u + (s − u) e^(−2t))."""
    found = shown_by_model(PLANT, HALF, B, B, "V")
    each = [
        u / 2 + (u - s) * (0.5 - B / 25) for u in np.linspace(10, 100, 19) for s in (0.0, *np.linspace(10, 100, 19))
    ]
    assert found.signed_pct == pytest.approx(max(each, key=abs), rel=1e-12) and found.pct == abs(found.signed_pct)
    if where is not None:
        assert found.signed_pct == pytest.approx(signed) and found.where == where


def test_a_model_is_followed_until_its_slow_part_has_settled() -> None:
    """Parts of 1 N·m with 0.1 and 100 s: 75 (1 − e^(−10 t)) less what the slow one gains, most at ln(3000)/10 s."""
    slow = Nonlinear(tau1=(0.1,), tau2=(100.0,), Ts=(0.0, 0.02), C=0.5, u_range=(100.0, 100.0))
    found = shown_by_model(slow, HALF, 10.0, 10.0)
    at = math.log(3000) / 10
    wanted = 75 - 75 / 3000 - 25 * -math.expm1(-at / 100) - 0.1 * math.exp(-at / 100)
    assert found.signed_pct == pytest.approx(wanted, abs=0.01)  # steps of 7 % in time
    assert float(found.where.split()[0]) == pytest.approx(at, rel=0.07)
    assert found.where.endswith(" s after a step from rest to 100 %")


def test_a_range_of_B_takes_what_lies_within_it() -> None:
    """From rest to 100 V the plant's slope is 4 N·m/s: left over are 100 − 4 B, nothing for a B of 25."""
    lag = Nonlinear(tau1=(0.5,), tau2=(0.5,), Ts=(0.0, 0.02), u_range=(100.0, 100.0))
    exact = Linear(2.0, 0.04, 0.0)
    assert shown_by_model(lag, exact, 20.0, 30.0).pct == pytest.approx(0.0, abs=1e-9)
    low = shown_by_model(lag, exact, 10.0, 20.0)
    assert (low.signed_pct, low.where) == (pytest.approx(20.0), "0 s after a step from rest to 100 %")
    assert shown_by_model(lag, exact, 30.0, 40.0).signed_pct == pytest.approx(-20.0)


def ramps(dt_s: float, *levels: float, slope: float = 1.0) -> StepSet:
    time = np.arange(100) * dt_s
    return StepSet("clutch", "V", "N", Apparatus(), tuple(Level(u, time, slope * time[None], ("r",)) for u in levels))


@pytest.mark.parametrize(("dt_s", "first"), [(0.01, 0.045), (0.02, 0.04), (0.04, 0.04), (0.05, 0.05), (1.0, 1.0)])
def test_slopes_of_logs_are_lines_through_a_tenth_of_a_second_or_three_samples(dt_s: float, first: float) -> None:
    """T = t on 1/10 s⁻¹: u − T − 10 by a B of 10, largest in the first window, whose middle is t."""
    found = shown_by_logs(ramps(dt_s, 300.0), Linear(0.1, 0.1, 0.0), 10.0, 10.0)
    assert found.signed_pct == pytest.approx(290.0 - first, rel=1e-9)
    assert found.where == f"{first:.3g} s after the step to 300 V"


def test_a_window_of_two_samples_or_one_has_no_slope() -> None:
    """Ten windows of ten samples, then one of two across which the output leaps by 50, and one alone."""
    time = np.append(np.arange(100) * 0.01, [1.04, 1.05, 1.15])
    torque = np.append(time[:100], [1.0, 51.0, 51.0])
    steps = replace(ramps(0.01), levels=(Level(300.0, time, torque[None], ("r",)),))
    found = shown_by_logs(steps, Linear(0.1, 0.1, 0.0), 10.0, 10.0)
    assert (found.signed_pct, found.where) == (pytest.approx(289.955), "0.045 s after the step to 300 V")


def test_the_worst_of_the_levels_is_told() -> None:
    """u − T − 5: from −1.845 to −2.745 at 3.2 V, from 1.955 down to 1.055 at 7 V."""
    for levels in ((3.2, 7.0), (7.0, 3.2)):
        found = shown_by_logs(ramps(0.01, *levels), Linear(0.1, 0.1, 0.5), 10.0, 10.0)
        assert (found.signed_pct, found.where) == (pytest.approx(-2.745), "0.945 s after the step to 3.2 V")


def test_single_levels_depart_most_at_an_end() -> None:
    """η = 2 T B, η̂ = 2 T/0.08: at rest 0, at 3 N·m 6 B − 75."""
    rows = [LevelB(20.0, 2.0, 1.0, 12.0), LevelB(40.0, 2.0, 2.0, 20.0)]
    found = shown_by_levels(rows, HALF, 3.0, "V")
    assert (found.signed_pct, found.where) == (pytest.approx(45.0), "at an output of 3 on the model of 40 V alone")
    first = shown_by_levels(rows[:1], HALF, 3.0)
    assert (first.signed_pct, first.pct) == (pytest.approx(-3.0), pytest.approx(3.0))
    nothing = shown_by_levels([], HALF, 3.0)
    assert (nothing.pct, nothing.where) == (0.0, "")


# what is physical


@pytest.mark.parametrize(
    ("model", "said"),
    [
        (Linear(1e-6, 1.0, 0.0), None),
        (Linear(1e6, 1.0, 0.0), None),
        (Linear(0.9e-6, 1.0, 0.0), "time constant of 1.11e+06 s is none that samples control (1e-06 to 1e+06 s)"),
        (Linear(1.1e6, 1.0, 0.0), "a0 is 1.1e+06 1/s; a plant with a time constant of 9.09e-07 s"),
        (Linear(1.0, 1e15, 0.0), None),
        (Linear(1.0, 1.1e15, 0.0), "b0 is 1.1e+15"),
        (Linear(1.0, 0.9e-15, 0.0), "b0 is 9e-16 and its c0 0, which no rig has"),
        (Linear(1.0, 1.0, -1e15), None),
        (Linear(1.0, 1.0, -1.1e15), "its c0 -1.1e+15, which no rig has"),
        (Linear(0.0, 1.0, 0.0), "a0 is 0 1/s; a clutch whose torque does not settle"),
    ],
)
def test_a_linear_model_that_a_rig_may_have(model: Linear, said: str | None) -> None:
    if said is None:
        assert physical(model) is model
        return
    with pytest.raises(GainsError) as refusal:
        physical(model)
    assert said in str(refusal.value)


# the range of B


def rows(*levels: tuple[float, float, float]) -> list[dict[str, object]]:
    """Level, a0 and gain; b0 without an offset."""
    return [
        {"level": u, "a0": a, "gain": g, "c0": 0.0, "b0": a * g / u if u else 0.0, "B": u / (a * g)}
        for u, a, g in levels
    ]


def fit(linear: dict[str, object], **more: object) -> Fit:
    return from_plain({"linear": {"a0": 2.0, "b0": 0.1, "c0": -1.0, **linear}, **more}, Fit, "f")


LEVELS = rows((0.0, 1.0, 1.0), (10.0, 2.0, 1.0), (40.0, 2.0, 2.0), (90.0, 3.0, 9.0))


def test_b_by_hand() -> None:
    """B is u/(a g): 5, 10, 3.33; 0 tells none."""
    known = fit({"per_level": LEVELS})
    zero = bounds_of(known)
    assert [row.B for row in zero.rows] == pytest.approx([5.0, 10.0, 10 / 3])
    assert (zero.levels, zero.B_m, zero.B_M, zero.widened) == ((10.0, 40.0, 90.0), pytest.approx(10 / 3), 10.0, False)
    some = bounds_of(known, "10:40")
    assert (some.levels, some.B_m, some.B_M) == ((10.0, 40.0), 5.0, 10.0)


def test_the_levels_that_the_fit_kept_are_kept() -> None:
    kept = {"convention": "zero-offset", "levels": [10.0, 90.0], "B_m": 3.0, "B_M": 6.0}
    known = fit({"per_level": LEVELS, "bounds": kept})
    stored = bounds_of(known)
    assert (stored.levels, stored.B_m, stored.B_M) == ((10.0, 90.0), 3.0, 6.0)
    assert [row.level for row in stored.rows] == [10.0, 90.0]
    assert bounds_of(known, "40").levels == (40.0,)


def test_a_range_of_one_value_is_a_range_and_one_that_falls_is_none() -> None:
    one = {"convention": "zero-offset", "B_m": 6.0, "B_M": 6.0}
    assert bounds_of(fit({"bounds": one})).B_m == 6.0
    with pytest.raises(GainsError, match="B_m 6.1 lies above B_M 6"):
        bounds_of(fit({"bounds": one | {"B_m": 6.1}}))


def test_widened_ends_are_those_of_the_levels() -> None:
    with_ends = [{**row, "ci95": {"B": [0.5 * row["B"], 2.0 * row["B"]]}} for row in LEVELS[1:]]
    wide = bounds_of(fit({"per_level": with_ends}), None, True)
    assert (wide.B_m, wide.B_M, wide.widened) == (pytest.approx(5 / 3), pytest.approx(20.0), True)
    with pytest.raises(UsageError, match="level 40 has no interval of B"):
        bounds_of(fit({"per_level": [with_ends[0], LEVELS[2]]}), None, True)


@pytest.mark.parametrize("gain", [0.0, -0.5])
def test_a_level_that_gains_nothing_touches_zero(gain: float) -> None:
    flat = {**LEVELS[1], "gain": gain, "b0": gain / 5, "B": None}
    with pytest.raises(GainsError, match="touches 0"):
        bounds_of(fit({"per_level": [flat, LEVELS[2]]}))


# where the loop stands


NO_ROWS = Bounds((), 10.0, 20.0, ())
SOME = replace(NO_ROWS, rows=(LevelB(20.0, 2.0, 1.5, 5.0), LevelB(60.0, 3.0, 2.5, 8.0)))


def test_operating_points_by_hand() -> None:
    curved = Nonlinear(tau1=(0.1, 0.01), tau2=(5.0,), Ts=(0.5, 0.02, 1e-4), C=0.8, u_range=(20.0, 60.0))
    known = from_plain({"data": {"levels": [10.0, 20.0, 50.0, 60.0, 70.0]}}, Fit, "f")
    points = operating_points(known, HALF, curved, SOME)
    assert [duty for duty, _, _ in points] == [20.0, 50.0, 60.0]
    duty, torque, lags = points[1]
    assert torque == pytest.approx(0.5 + 1.0 + 0.25)  # the slope there is 0.02 + 0.01
    assert lags == (pytest.approx((0.8 * 0.03, 0.6)), pytest.approx((0.2 * 0.03, 5.0)))
    assert [p[0] for p in operating_points(Fit(), HALF, curved, SOME)] == pytest.approx(np.linspace(20, 60, 10))
    flat = replace(curved, Ts=(0.5, 0.0, 0.0))
    of_levels = [(20.0, 1.5, ((0.1, 0.5),)), (60.0, 2.5, ((1 / 24, 1 / 3),))]
    for plant in (None, flat):
        for found, wanted in zip(operating_points(known, HALF, plant, SOME), of_levels, strict=True):
            assert found[:2] == wanted[:2] and found[2][0] == pytest.approx(wanted[2][0])
    ((duty, torque, lags),) = operating_points(known, Linear(2.0, 0.08, -1.0), None, NO_ROWS, (10.0, 90.0))
    assert (duty, torque, lags[0]) == (50.0, pytest.approx(1.5), pytest.approx((0.04, 0.5)))


def test_how_high_the_torque_is_that_the_actuator_is_judged_at() -> None:
    rc = paper_gains()[0]._replace(duty_min=10.0, duty_max=60.0)
    tops = {
        2.0: actuator(HALF, rc, PLANT, SOME),  # the plant's at 100
        2.5: actuator(HALF, rc, None, SOME),  # the highest level's
        2.4: actuator(HALF, rc, None, NO_ROWS),  # the model's at 60
    }
    for top, found in tops.items():
        assert [row.torque_nm for row in found.points] == pytest.approx([0.1 * top, 0.5 * top, 0.9 * top])
        assert found.span_pct == 50.0 and found.robust_term_pct == pytest.approx(12.5 * rc.rho_constant)
    far = actuator(HALF, rc._replace(B_hat=1.0, rho_constant=40.0), None, NO_ROWS)
    # held by 6, 30, 54: up to 60 and down to 10 there are 54, 30, 6 and none, 20, 44, of the 40 that are asked for
    assert [row.eta_hat_pct for row in far.points] == pytest.approx([6.0, 30.0, 54.0])
    assert [row.share_up for row in far.points] == pytest.approx([1.0, 0.75, 0.15])
    assert [row.share_down for row in far.points] == pytest.approx([0.0, 0.5, 1.0])
