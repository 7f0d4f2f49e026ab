"""What a design takes where nothing is said; the plant and the operating points that it is judged on."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from eaid.control.bounds import Bounds, bounds_of
from eaid.control.defaults import (
    design_options,
    input_limits,
    is_duty,
    scales_of,
    timing_of,
    with_own_layer,
    with_own_pi,
)
from eaid.control.design import design, shown_by_levels, shown_by_model
from eaid.control.gains import paper_gains, plant_of, why_not
from eaid.control.margins import Timing, margins, rc_feedback
from eaid.control.operating import actuator, keeps_margins, operating_points
from eaid.control.options import DesignOptions
from eaid.control.rc_design import law_of
from eaid.errors import DataError, GainsError, UsageError
from eaid.models.parameters import PAPER_LINEAR, REFERENCE_PLANT, Linear, Nonlinear
from eaid.options import TuneOptions
from eaid.results.codec import from_plain, to_plain
from eaid.results.fit import Fit

BOUNDS = Bounds((), 12.4, 42.6, ())


def rig(**data: object) -> Fit:
    """The paper's linear model as the fit of a rig in V and N, at 200 Hz."""
    told = {"input_unit": "V", "output_unit": "N", "levels": [1.0, 5.0], "sample_rate_hz": 200.0, **data}
    linear = {
        "a0": 1.36, "b0": 1.6, "c0": -2.42, "bounds": {"B_m": 0.62, "B_M": 2.13},
        "per_level": [{"level": 5.0, "a0": 1.5, "gain": 4.0, "b0": 1.2, "c0": 0.0, "B": 5.0 / 6.0}],
    }  # fmt: skip
    return from_plain({"data": told, "linear": linear}, Fit, "rig")


def test_the_loop_samples_as_the_rig_does() -> None:
    nothing = TuneOptions()
    assert timing_of(rig(), nothing) == Timing(200.0, None)
    assert timing_of(rig(sample_rate_hz=None), nothing) == Timing(1000.0, None)
    assert timing_of(rig(), TuneOptions(rate_hz=500.0, pwm_hz=100.0)) == Timing(500.0, 100.0)
    paper = rig(input_unit="%", output_unit="N·m", levels=[20.0, 80.0])
    assert timing_of(paper, nothing) == Timing(1000.0, 300.0)
    assert timing_of(paper, TuneOptions(pwm_hz=0.0)) == Timing(1000.0, None)


@pytest.mark.parametrize(
    ("unit", "levels", "duty"),
    [
        ("%", [20.0, 100.0], True),
        ("%", [], True),
        ("%", [0.2, 1.0], False),
        ("%", [120.0], False),
        ("V", [20.0], False),
    ],
)
def test_what_is_a_duty(unit: str, levels: list[float], duty: bool) -> None:
    fit = rig(input_unit=unit, output_unit="N·m", levels=levels)
    assert is_duty(fit) is duty and scales_of(fit).paper is duty


def test_another_rig_gets_a_pi_and_a_layer_that_its_sampled_loop_can_have() -> None:
    fit, options = rig(), TuneOptions()
    scales = scales_of(fit)
    start = with_own_pi(fit, design_options(fit, options, scales, 4.0, 0.5), scales)
    assert start.pi.overshoot_pct == 1.0 and start.pi.settling_s == pytest.approx(0.27 / scales.pace)
    bounds = bounds_of(fit)
    points = operating_points(fit, Linear(1.36, 1.6, -2.42), None, bounds, start.duty_limits_pct)

    def keeps(design: object) -> bool:
        return keeps_margins(law_of(Linear(1.36, 1.6, -2.42), bounds, design).gains, points, start.timing)  # type: ignore[arg-type]

    # so thin a layer that no loop at 200 Hz has it: it grows by half until the loop does, and no further
    thin = replace(start, epsilon=start.epsilon / 300, gamma=start.gamma * 300)
    assert keeps(start) and not keeps(thin)
    grown = with_own_layer(fit, thin, scales, bounds, None)
    steps = np.log(grown.epsilon / thin.epsilon) / np.log(1.5)
    assert keeps(grown) and steps == pytest.approx(round(steps)) and steps >= 1
    assert not keeps(replace(grown, epsilon=grown.epsilon / 1.5, gamma=grown.gamma * 1.5))
    assert grown.gamma * grown.epsilon == pytest.approx(thin.gamma * thin.epsilon)
    assert with_own_layer(fit, start, scales, bounds, None) == start
    slow = replace(start, timing=Timing(5.0, None))
    assert (with_own_pi(fit, replace(slow, pi=type(start.pi)()), scales).pi.settling_s or 0) > 0.27 / scales.pace


def test_a_loop_with_enough_phase_and_too_little_gain_margin_does_not_keep_them() -> None:
    # an integrator nearly, at 100 Hz: with k h = 1.2 it has 4.4 dB and 53°
    rc = paper_gains()[0]._replace(rho_constant=0.0, rho_slope=0.0, K_P=1e-6, B_hat=1.0, a0=0.0, b0=1.0, c0=0.0)
    timing, lags = Timing(100.0), ((1000.0, 1000.0),)
    for gain, kept in ((120.0, False), (60.0, True)):
        loop = rc._replace(K_D=gain)
        found = margins(rc_feedback(loop, 1.0, 50.0), lags, timing)
        assert found.phase_deg > 45 and (found.gain_db > 6) is kept
        assert keeps_margins(loop, [(50.0, 1.0, lags)], timing) is kept


def test_what_the_actuator_delivers_by_hand() -> None:
    rc = paper_gains()[0]._replace(B_hat=10.0, rho_constant=4.0)  # the robust term asks for 40 %
    found = actuator(PAPER_LINEAR, rc, REFERENCE_PLANT, BOUNDS)
    assert (found.robust_term_pct, found.span_pct) == (40.0, 100.0)
    for row, share in zip(found.points, (0.1, 0.5, 0.9), strict=True):
        held = (1.36 * share * 4.372 + 2.42) / 0.08
        assert row.torque_nm == pytest.approx(share * 4.372) and row.eta_hat_pct == pytest.approx(held)
        assert row.share_up == pytest.approx(min(1.0, max(0.0, 100 - held) / 40))
        assert row.share_down == pytest.approx(min(1.0, held / 40))
    nothing = actuator(PAPER_LINEAR, rc._replace(rho_constant=0.0), REFERENCE_PLANT, BOUNDS)
    assert all(row.share_up == row.share_down == 1.0 for row in nothing.points)


def test_a_range_of_B_below_one_is_a_range() -> None:
    assert pytest.approx(5.0 / 6.0) == bounds_of(rig()).rows[0].B
    whole = rig()
    assert whole.linear is not None
    broken = from_plain(
        {"linear": {"a0": 1.0, "b0": 1.0, "c0": 9.0, "bounds": {"B_m": 0.1, "B_M": 0.9},
                    "per_level": [{"level": 5.0, "a0": 1.5, "gain": -4.0, "b0": 1.0, "c0": 0.0, "B": 1.0}]}},
        Fit, "rig",
    )  # fmt: skip
    with pytest.raises(GainsError, match="no positive b0"):
        bounds_of(broken)


def test_why_a_model_is_not_identifiable() -> None:
    fit = rig()
    assert why_not(fit, "linear") == "" and why_not(fit, "nonlinear") == ""
    linear = {"a0": 1.36, "b0": 1.6, "c0": -2.42, "identifiable": False}
    assert why_not(from_plain({"linear": linear}, Fit, "f"), "linear") == "most of its parameters have no interval"


@pytest.mark.parametrize(
    ("part", "said"),
    [
        ({"tau1": [-1.0, 0, 0]}, r"nonlinear.tau1 is -1 s at an input of 10"),
        ({"Ts": [2e15, 0, 0, 0]}, r"2e\+15 at an"),
        ({"tau2": [5000 * 50.25**2 - 1.0, -5000 * 100.5, 5000.0]}, r"tau2 is -1 s at an input of 50.25"),
    ],
)
def test_a_plant_that_no_rig_is_is_refused(part: dict[str, object], said: str) -> None:
    plain = {"tau1": [0.3, 0, 0], "tau2": [3.0, 0, 0], "Ts": [0.0, 0.04, 0, 0], "u_range": [10, 100], "C": 0.85, **part}
    with pytest.raises(DataError, match=said):
        plant_of(from_plain({"nonlinear": plain}, Fit, "f"))


def percent(**data: object) -> Fit:
    """The paper's rig with its published fit."""
    told = {"input_unit": "%", "output_unit": "N·m", "levels": [20.0, 100.0], "sample_rate_hz": 1000.0, **data}
    linear = {"a0": 1.36, "b0": 0.08, "c0": -2.42, "bounds": {"B_m": 12.4, "B_M": 42.6}}
    return from_plain({"data": told, "linear": linear}, Fit, "paper")


def test_on_the_papers_rig_the_papers_numbers_stand() -> None:
    fit = percent()
    scales = scales_of(fit)
    assert scales == (True, 1.0, 1.0) and input_limits(fit) == (0.0, 100.0)
    found = design_options(fit, TuneOptions(), scales, None, 30.0)
    assert found == DesignOptions(phi_honest_pct=None, levels=None)
    told = design_options(fit, TuneOptions(phi="data"), scales, 7.5, 30.0)
    assert (told.Q_M, told.phi, told.phi_honest_pct) == (7.5, 0.05, 30.0)
    given = design_options(fit, TuneOptions(phi=0.2, epsilon=0.3, kp=2.0, kd=1.0, q_max=9.0), scales, 7.5, 30.0)
    assert (given.phi, given.phi_honest_pct, given.epsilon, given.gamma) == (0.2, None, 0.3, 50.0)
    assert (given.K_P, given.K_D, given.Q_M) == (2.0, 1.0, 9.0)
    damped = design_options(fit, TuneOptions(natural_frequency=2.0, damping=0.5), scales, None, None)
    assert pytest.approx((4.0, 2.0)) == (damped.K_P, damped.K_D)
    assert with_own_pi(fit, found, scales) == found and with_own_layer(fit, found, scales, BOUNDS, None) == found
    with pytest.raises(DataError, match="nothing to take φ from"):
        design_options(fit, TuneOptions(phi="data"), scales, None, None)
    with pytest.raises(UsageError, match="a duty ends at 100 %"):
        design_options(fit, TuneOptions(duty_limits=(0.0, 100.5)), scales, None, None)
    assert design_options(fit, TuneOptions(duty_limits=(5.0, 100.0)), scales, None, None).duty_limits_pct == (
        5.0,
        100.0,
    )


def test_a_rig_without_an_input_says_so_and_one_without_levels_has_the_papers_top() -> None:
    with pytest.raises(UsageError, match="tells no highest input in V"):
        input_limits(rig(levels=[]))
    assert input_limits(rig()) == (0.0, 5.0)
    assert scales_of(rig()).top == pytest.approx(4.0 / 4.372) and scales_of(rig()).pace == 1.0
    bare = from_plain({"data": {"input_unit": "V", "output_unit": "N"}}, Fit, "f")
    assert scales_of(bare) == (False, 1.0, 1.0)


def test_a_pi_that_is_asked_for_is_left_as_it_is() -> None:
    scales = scales_of(rig())
    for asked in ({"pi_gains": (3.0, 4.0)}, {"pi_overshoot": 5.0, "pi_settling": 1.0}):
        settled = design_options(rig(), TuneOptions(**asked), scales, 8.0, 1.0)
        assert with_own_pi(rig(), settled, scales).pi == settled.pi


def test_the_sensors_filter_keeps_a_share_of_its_old_value() -> None:
    assert Timing(1000.0, sensor_hz=50.0).memory == pytest.approx(np.exp(-2 * np.pi * 0.05))
    assert Timing(1000.0).memory == 0.0 and Timing(500.0).step_s == 0.002 and Timing(500.0, None, 3).delay_s == 0.006


def test_a_latch_slower_than_a_hundred_samples_or_faster_than_a_twentieth_is_refused() -> None:
    assert Timing(1000.0, 10.0).pattern == (100, 1) and Timing(1000.0, 20_000.0).pattern == (1, 20)
    assert Timing(1000.0).pattern == (1, 1) and Timing(1000.0, 300.0).pattern == (10, 3)
    for pwm_hz in (9.95, 1e5):
        with pytest.raises(UsageError, match="outside what margins are worked out for"):
            Timing(1000.0, pwm_hz).pattern  # noqa: B018


def test_models_that_agree_show_no_mismatch() -> None:
    level = SimpleNamespace(level=50.0, a0=1.36, B=12.5)
    found = shown_by_levels([level], Linear(1.36, 0.08, 0.0), 4.0)  # type: ignore[list-item]
    assert found.pct == pytest.approx(0.0, abs=1e-12)
    # one lag, its own linear model: η is η̂ at every instant
    plant = Nonlinear((0.5,), (0.5,), (0.0, 0.04), (10.0, 100.0))
    model = Linear(2.0, 0.08, 0.0)
    assert shown_by_model(plant, model, 12.5, 12.5).pct < 1e-9
    assert shown_by_model(plant, model, 12.0, 12.4).pct > 0.01


def test_a_dead_time_that_the_steps_show_slows_both_controllers_down_and_ends_the_guarantee() -> None:
    """A lag of 0.74 s behind 0.15 s: gains that ask for more than its phase allows are not given in silence."""
    rises = [{"run": f"r{k}", "from": 0.0, "level": k, "edge": "up", "start": 0.0, "change": 1.0, "gain": 1.0,
              "shape": "one", "tau1": 0.74, "tau2": None, "C": 1.0, "dead_time_s": dead, "rmse": 0.0, "fit_pct": 99.0,
              "R2": 1.0, "samples": 9} for k, dead in enumerate((0.14, 0.15, 0.16), 1)]  # fmt: skip
    at_once = rig()
    late = from_plain(to_plain(at_once) | {"steps": rises}, Fit, "rig")
    assert (at_once.dead_time_s, late.dead_time_s) == (0.0, 0.15)
    assert timing_of(late, TuneOptions()).delay_samples == 30
    settled = []
    for fit in (at_once, late):
        scales = scales_of(fit)
        own = with_own_pi(fit, design_options(fit, TuneOptions(), scales, 8.0, 1.0), scales)
        settled.append(with_own_layer(fit, own, scales, BOUNDS, None))
    assert settled[1].epsilon > settled[0].epsilon
    assert settled[1].pi.settling_s > 2 * settled[0].pi.settling_s
    made = [design(fit, one) for fit, one in zip((at_once, late), settled, strict=True)]
    assert "dead-time" not in [one.name for one in made[0].guarantee.conditions]
    assert "dead-time" in made[1].guarantee.missing and made[1].guarantee.holds is False
    assert made[1].margins.worst.pi.phase_deg < made[0].margins.worst.pi.phase_deg
    with pytest.raises(GainsError, match="behind the dead time of 0.15 s"):
        design(late, replace(settled[0], timing=settled[1].timing))


def test_a_rig_a_thousand_times_slower_than_the_paper_s_gets_its_layer_and_pi() -> None:
    """An oven, one level known: T_s has no slope there, so its single level says how the loop turns about it."""
    part = {"Ts": [121.0, 0.0, 0.0, 0.0], "tau1": [599.0, 0.0, 0.0], "tau2": [600.0, 0.0, 0.0], "u_range": [1.0, 1.0]}
    row = {"level": 1.0, "a0": 0.00167, "gain": 121.0, "b0": 0.202, "c0": 0.0, "B": 4.94}
    linear = {"a0": 0.00167, "b0": 0.202, "c0": 0.0, "bounds": {"B_m": 4.9, "B_M": 5.0}, "per_level": [row]}
    data = {"input_unit": "", "output_unit": "°C", "levels": [1.0], "sample_rate_hz": 0.33}
    fit = from_plain({"data": data, "linear": linear, "nonlinear": part}, Fit, "oven")
    scales, bounds = scales_of(fit, fit.plant), bounds_of(fit)
    own = with_own_pi(fit, design_options(fit, TuneOptions(), scales, 1.0, 0.1), scales)
    layered = with_own_layer(fit, own, scales, bounds, fit.plant)
    assert layered.epsilon == own.epsilon and layered.pi.settling_s == pytest.approx(0.27 * 1.36 / 0.00167)
    worst = design(fit, layered).margins.worst
    assert worst.rc.stable and worst.rc.phase_deg > 45 and worst.pi.phase_deg > 45
