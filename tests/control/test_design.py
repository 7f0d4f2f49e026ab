"""fit.json → gains.json: the paper's design, each verdict and warning, and what is refused."""

import math

import numpy as np
import pytest

from eaid.apparatus import Apparatus
from eaid.control.bounds import LevelB, bounds_of
from eaid.control.design import design as typed_design
from eaid.control.design import distance, shown_by_levels, shown_by_logs, shown_by_model
from eaid.control.gains import paper_gains, pi_gains, rc_gains
from eaid.control.margins import Timing
from eaid.control.options import DesignOptions, PIOptions
from eaid.errors import DataError, GainsError, UsageError
from eaid.models.nonlinear import step_response
from eaid.models.parameters import PAPER_LINEAR, REFERENCE_PLANT, Linear, Nonlinear
from eaid.options import TuneOptions
from eaid.results.codec import from_plain, to_plain
from eaid.results.fit import Fit
from eaid.results.gains import Gains
from eaid.steps.stepset import Level, StepSet


def fit_of(plain):
    return from_plain(plain, Fit, "f")


def gains_of(plain, *options, **more) -> Gains:
    return typed_design(fit_of(plain), *options, **more)


def design(plain, *options, **more):
    return to_plain(gains_of(plain, *options, **more))


def codes(found):
    return [one["code"] for one in found["findings"]]


PAPER_FIT = {"linear": {"a0": 1.36, "b0": 0.08, "c0": -2.42, "bounds": {"B_m": 12.4, "B_M": 42.6}}}
B = {10: 23.044, 20: 36.505, 30: 41.142, 40: 40.831, 50: 37.706, 60: 32.974, 70: 27.340, 80: 21.221, 90: 14.854}
B[100] = 8.349
PLANT = {
    "C": REFERENCE_PLANT.C,
    "tau1": list(REFERENCE_PLANT.tau1),
    "tau2": list(REFERENCE_PLANT.tau2),
    "Ts": list(REFERENCE_PLANT.Ts),
    "u_range": [10.0, 100.0],
}


def level_row(u):
    """A level of the reference plant as a fit has it: its own gain, and the a0 that gives the specification's B."""
    from eaid.models.nonlinear import steady_torque

    gain = float(steady_torque(REFERENCE_PLANT, u)) * 0.97
    return {"level": float(u), "a0": u / (B[u] * gain), "gain": gain, "c0": 0.0, "b0": 1 / B[u], "B": B[u]}


def level_b(u):
    row = level_row(u)
    return LevelB(row["level"], row["a0"], row["gain"], row["B"])


REFERENCE_FIT = {
    "nonlinear": PLANT,
    "linear": {
        "a0": 1.84393,
        "b0": 0.0782825,
        "c0": -1.343124,
        "per_level": [level_row(u) for u in B],
        "bounds": {"convention": "zero-offset", "levels": [float(u) for u in B], "B_m": 8.349, "B_M": 41.142},
    },
}


def with_linear(**changes):
    return {"linear": {**PAPER_FIT["linear"], **changes}}


def test_the_papers_fit_gives_table_iv():
    found = design(PAPER_FIT)
    rc = found["rc"]
    assert rc_gains(gains_of(PAPER_FIT)) == pytest.approx(paper_gains()[0])
    assert pi_gains(gains_of(PAPER_FIT)) == paper_gains()[1]
    assert f"{rc['alpha']:.6f}" == "0.549091" and f"{rc['rho']['constant']:.4f}" == "10.8125"
    assert f"{rc['rho']['slope']:.5f}" == "6.58595" and rc["rho"]["convention"] == "paper"
    assert rc["natural_frequency_rad_s"] == pytest.approx(2.1213, abs=5e-5)
    assert rc["damping"] == pytest.approx(0.7071, abs=5e-5)
    assert rc["phi_honest_pct"] == pytest.approx(26.4, abs=0.05)
    assert rc["rho"]["readings"]["textbook"]["phi_honest_pct"] == pytest.approx(0.05)
    assert found["actuator"]["robust_term_pct"] == pytest.approx(135, abs=0.5)
    # with neither plant nor levels the highest torque is the linear model's at 100 %
    torques = [point["torque_nm"] for point in found["actuator"]["points"]]
    assert torques == pytest.approx([share * (0.08 * 100 - 2.42) / 1.36 for share in (0.1, 0.5, 0.9)])
    assert "robust-term-beyond-actuator" in codes(found)
    assert "robust-term-beyond-actuator" not in codes(design(PAPER_FIT, DesignOptions(Q_M=0.5, phi=0.01)))
    assert (round(rc["equal_pi"]["K_P"]), round(rc["equal_pi"]["K_I"])) == (313, 206)
    assert found["pi"]["overshoot_pct"] == pytest.approx(41.7, abs=0.05)
    assert found["pi"]["settling_s"] == pytest.approx(2.52, abs=0.005)


def test_no_rho_is_enough_where_the_alpha_reached_is_1():
    edge = design(PAPER_FIT, DesignOptions(B_hat=2 * 12.4))["rc"]
    assert edge["alpha_reached"] == 1.0 and "needed" not in edge["rho"] and not edge["guaranteed"]
    with pytest.raises(GainsError, match="α is 1 with"):
        design(PAPER_FIT, DesignOptions(B_hat=2 * 12.4, alpha="reached"))


def test_a_pure_integral_control_is_a_pi():
    alone = design(PAPER_FIT, DesignOptions(pi=PIOptions(gains=(0.0, 10.0))))["pi"]
    assert (alone["K_P"], alone["K_I"]) == (0.0, 10.0)


def test_pooled_is_not_guaranteed_and_minimax_is():
    pooled, minimax = design(PAPER_FIT)["rc"], design(PAPER_FIT, DesignOptions(B_hat="minimax"))["rc"]
    assert not pooled["guaranteed"] and pooled["alpha_reached"] == pytest.approx(0.7066, abs=1e-4)
    assert pooled["rho"]["needed"]["constant"] > pooled["rho"]["constant"]
    assert minimax["guaranteed"] and minimax["B_hat"] == pytest.approx(19.2, abs=0.05)
    assert minimax["alpha_reached"] == pytest.approx(minimax["alpha"])
    made_with_it = design(PAPER_FIT, DesignOptions(alpha="reached"))["rc"]
    assert made_with_it["guaranteed"] and made_with_it["rho"]["alpha"] == pytest.approx(0.7066, abs=1e-4)
    assert made_with_it["alpha"] == pytest.approx(0.549091, abs=1e-6)


@pytest.mark.parametrize("reading", ["paper", "textbook"])
def test_one_honest_phi_gives_one_rho_in_both_readings(reading):
    rc = design(PAPER_FIT, DesignOptions(reading=reading, phi_honest_pct=20.0))["rc"]
    assert rc["phi_honest_pct"] == pytest.approx(20.0)
    assert rc["rho"]["terms"]["phi_nm_s"] == pytest.approx(20.0 / 12.4 / (1 - rc["alpha"]))
    assert rc["phi"] == pytest.approx(20.0 if reading == "textbook" else 20.0 / (12.4 * 42.6))


def test_phi_is_held_against_the_data():
    found = design(REFERENCE_FIT)
    assert found["rc"]["phi_holds"] is False
    assert "phi-exceeded" in codes(found)
    enough = design(REFERENCE_FIT, DesignOptions(phi_honest_pct=found["rc"]["phi_needed_pct"]))
    assert enough["rc"]["phi_holds"] is True
    assert design(PAPER_FIT)["rc"]["phi_holds"] is None


def test_with_single_levels_alone_phi_holds_in_no_reading():
    fit = {"linear": REFERENCE_FIT["linear"]}
    for reading in ("paper", "textbook"):
        found = design(fit, DesignOptions(reading=reading))
        assert found["rc"]["phi_holds"] is False and found["rc"]["phi_needed_pct"] > 100
    # specification 4.7: −30 % already at T = 0 on the published model.
    at_rest = shown_by_levels([level_b(40)], PAPER_LINEAR, 0.0)
    assert at_rest.signed_pct == pytest.approx(-30.25)


def test_Q_M_is_held_against_the_reference():
    assert design(PAPER_FIT)["rc"]["Q_M_holds"] is None
    steep = design(PAPER_FIT, slope_nm_s=9.3)
    assert steep["rc"]["Q_M_holds"] is False and "slope-above-q-max" in codes(steep)
    assert design(PAPER_FIT, slope_nm_s=4.9)["rc"]["Q_M_holds"] is True


def test_margins_of_the_reference_plant():
    found = design(REFERENCE_FIT)
    points = found["margins"]["points"]
    assert [point["duty_pct"] for point in points] == pytest.approx([10 * k for k in range(1, 11)])
    assert found["margins"]["worst"]["rc"]["gain_db"] == min(point["rc"]["gain_db"] for point in points)
    missed = [one for one in found["findings"] if one["code"] == "margin-missed"]
    assert [one["subject"] for one in missed] == ["pi"] and list(missed[0]["levels"]) == [30, 40, 50, 60, 70, 80, 90]
    assert missed[0]["values"]["phase_deg"] < 45 <= missed[0]["values"]["enough_deg"]
    sharp = design(REFERENCE_FIT, DesignOptions(epsilon=0.06, gamma=400.0))
    assert {"rc"} & {
        one["subject"] for one in sharp["findings"] if one["code"] in ("margin-missed", "loop-unstable-on-plant")
    }


def test_below_sharpness_five_the_jump_is_told():
    (jump,) = (one for one in design(PAPER_FIT, DesignOptions(gamma=2.0))["findings"] if one["code"] == "switch-jumps")
    assert jump["values"]["jump"] == pytest.approx(1 - math.tanh(1.0))
    assert "switch-jumps" not in codes(design(PAPER_FIT, DesignOptions(gamma=10.0)))


def test_back_calculation_gains_are_the_inverse_of_the_slopes():
    found = gains_of(PAPER_FIT, DesignOptions(anti_windup="back-calculation"))
    assert rc_gains(found).back_calculation == pytest.approx(1 / 312.818, rel=1e-5)
    assert pi_gains(found).back_calculation == pytest.approx(1 / 21)


def test_pi_from_wishes():
    found = design(PAPER_FIT, DesignOptions(pi=PIOptions(overshoot_pct=1.0, settling_s=0.27)))["pi"]
    assert (found["K_P"], found["K_I"]) == pytest.approx((156.6, 252.9), abs=0.1)
    assert (found["overshoot_pct"], found["settling_s"]) == pytest.approx((1.0, 0.27))


@pytest.mark.parametrize(
    ("fit", "options", "words"),
    [
        (with_linear(b0=-0.08), {}, "b0 is -0.08"),
        (with_linear(b0=0.0), {}, "b0 is 0;"),
        (with_linear(a0=-1.0), {}, "a0 is -1"),
        (with_linear(bounds={"B_m": 0.0, "B_M": 42.6}), {}, "B_m is 0, so the range of B touches 0"),
        (with_linear(bounds={"B_m": None, "B_M": None}), {}, "B_m is missing"),
        (with_linear(bounds={"B_m": 50.0, "B_M": 42.6}), {}, "lies above B_M"),
        (PAPER_FIT, {"K_P": 0.0}, "unstable"),
        (PAPER_FIT, {"K_D": -3.0}, "unstable"),
        (PAPER_FIT, {"K_D": 0.0}, "make the error dynamics"),
        (PAPER_FIT, {"K_D": -0.5}, "make the error dynamics"),
        (PAPER_FIT, {"K_P": -0.5}, "make the error dynamics"),
        (PAPER_FIT, {"B_hat": -0.5}, "B̂ is -0.5"),
        (PAPER_FIT, {"B_hat": -12.5}, "B̂ is -12.5"),
        (PAPER_FIT, {"B_hat": 30.0, "alpha": "reached"}, "no ρ covers that"),
        (PAPER_FIT, {"pi": PIOptions(overshoot_pct=100.0, settling_s=0.27)}, "out of reach"),
        (PAPER_FIT, {"pi": PIOptions(overshoot_pct=1.0, settling_s=30.0)}, "out of reach"),
        (PAPER_FIT, {"pi": PIOptions(gains=(-21.0, 360.0))}, "neither may be negative"),
        (PAPER_FIT, {"pi": PIOptions(gains=(21000.0, 360.0))}, "PI loop is unstable on the linear model"),
        (PAPER_FIT, {"epsilon": 0.001, "gamma": 1e4}, "RC loop is unstable on the linear model"),
    ],
)
def test_what_is_not_physical_is_refused(fit, options, words):
    with pytest.raises(GainsError) as refusal:
        design(fit, DesignOptions(**options))
    assert words in str(refusal.value) and refusal.value.exit_code == 5


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"pi_overshoot": 1.0}, "belong together"),
        ({"pi_gains": (1.0, 2.0), "pi_overshoot": 1.0, "pi_settling": 0.3}, "not both"),
        ({"duty_limits": (80.0, 20.0)}, "duty_limits= 80,20: must rise"),
        ({"natural_frequency": 2.0}, "belong together"),
        ({"natural_frequency": 2.0, "damping": 1.0, "kp": 3.0}, "not both"),
        ({"rho": "other"}, "must be one of paper, textbook"),
        ({"phi": "much"}, "must be data or a number"),
        ({"seed": -1}, "seed= -1: give a whole number"),
        ({"kp": math.inf}, "kp= inf"),
        ({"q_max": 1e308}, "q_max= 1e"),
        ({"pi_gains": (1e300, 1.0)}, "pi_gains= 1e"),
    ],
)
def test_wishes_that_contradict_each_other_or_any_rig_are_wrong_usage(options, words):
    with pytest.raises(UsageError) as refusal:
        TuneOptions(**options)
    assert words in str(refusal.value)


def test_bounds_over_chosen_levels():
    found = bounds_of(fit_of(REFERENCE_FIT), "30:100")
    assert (found.B_m, found.B_M) == pytest.approx((8.349, 41.142)) and found.levels == tuple(range(30, 101, 10))
    assert bounds_of(fit_of(REFERENCE_FIT), "50,70").B_m == pytest.approx(27.340)
    with pytest.raises(DataError, match="no log holds 35"):
        bounds_of(fit_of(REFERENCE_FIT), "35")
    with pytest.raises(UsageError, match="no fits of single levels"):
        bounds_of(fit_of(PAPER_FIT), "30:100")


def test_widened_bounds_take_the_far_ends():
    rows = [{**row, "ci95": {"B": [0.9 * row["B"], 1.2 * row["B"]]}} for row in REFERENCE_FIT["linear"]["per_level"]]
    fit = {"linear": {**REFERENCE_FIT["linear"], "per_level": rows}}
    found = bounds_of(fit_of(fit), widen=True)
    assert (found.B_m, found.B_M) == pytest.approx((0.9 * 8.349, 1.2 * 41.142))
    with pytest.raises(UsageError, match="no interval of B"):
        bounds_of(fit_of(REFERENCE_FIT), widen=True)


def test_no_linear_model_is_a_data_error():
    with pytest.raises(DataError, match="holds no linear model"):
        design({"nonlinear": PLANT})
    with pytest.raises(DataError, match='linear.a0 is "x"'):
        design(with_linear(a0="x"))


def test_distance_is_to_the_nearest_B():
    left = np.array([50.0, 50.0, 50.0, -5.0, 20.0])
    slope = np.array([2.0, 10.0, 1.0, 0.0, -1.0])
    assert distance(left, slope, 10.0, 40.0) == pytest.approx([0.0, -50.0, 10.0, -5.0, 30.0])


def first_order(model, gain_b, duties):
    """A nonlinear model that is first order with b in the bounds and η = η̂ exactly."""
    tau = 1 / model.a0
    return Nonlinear(tau1=(tau,), tau2=(tau,), Ts=(0.0, gain_b / model.a0), u_range=duties)


def test_phi_is_zero_where_the_model_is_exact():
    model = Linear(1.5, 0.08, 0.0)
    exact = first_order(model, 0.08, (10.0, 100.0))
    assert shown_by_model(exact, model, 12.0, 13.0).pct == pytest.approx(0, abs=1e-9)
    half = first_order(model, 0.04, (10.0, 100.0))  # holds twice the duty for a torque
    assert shown_by_model(half, model, 12.0, 13.0).pct == pytest.approx(50.0, rel=1e-6)


def test_logs_show_what_the_model_behind_them_shows():
    model = Linear(1.84393, 0.0782825, -1.343124)
    t = np.arange(20000) * 1e-3
    random = np.random.default_rng(1)
    levels = tuple(
        Level(float(u), t, step_response(REFERENCE_PLANT, t, u)[None] + 0.01 * random.standard_normal(t.size), ("r",))
        for u in range(10, 101, 10)
    )
    stepset = StepSet("clutch", "%", "N·m", Apparatus(), levels)
    logs, plant = shown_by_logs(stepset, model, 8.349, 41.142), shown_by_model(REFERENCE_PLANT, model, 8.349, 41.142)
    assert plant.pct == pytest.approx(33.8, abs=0.05)
    assert 20 < logs.pct < plant.pct  # a window of 0.1 s has already left the first instant
    assert "after the step to" in logs.where


def test_unlatched_timing_is_reported():
    found = design(PAPER_FIT, DesignOptions(timing=Timing(1000.0, None)))
    assert found["margins"]["timing"] == {"rate_hz": 1000.0, "pwm_hz": None, "delay_samples": 0}


def test_the_alpha_that_rho_is_made_with_is_the_one_reached_to_the_last_digits():
    made = design(PAPER_FIT, DesignOptions(alpha="reached"))["rc"]
    reached = max(abs(1 - 12.5 / 42.6), abs(1 - 12.5 / 12.4))
    assert made["alpha_reached"] == pytest.approx(reached, rel=1e-14) == made["rho"]["alpha"]
    assert made["rho"]["constant"] == pytest.approx((reached * 5.0 + 42.6 * 0.05) / (1 - reached), rel=1e-13)
    assert made["rho"]["needed"] == {"constant": made["rho"]["constant"], "slope": made["rho"]["slope"]}


def test_one_verdict_with_a_row_for_each_thing_it_needs():
    found = gains_of(REFERENCE_FIT, DesignOptions(B_hat="minimax"), slope_nm_s=4.0).guarantee
    rows = {one.name: one for one in found.conditions}
    assert found.holds is False and set(found.missing) == {"phi", "duty-limit"}
    assert rows["rho"].holds is True and rows["Q_M"].holds is True
    assert rows["Q_M"].needed == 4.0 and rows["Q_M"].available == 5.0
    assert rows["phi"].needed > rows["phi"].available > 0
    assert rows["duty-limit"].available == 100.0 and rows["duty-limit"].unit == "%"
    open_end = gains_of(PAPER_FIT, DesignOptions(B_hat="minimax", duty_limits_pct=(0.0, 1e4))).guarantee
    assert open_end.holds is None and open_end.missing == ()
    assert gains_of(PAPER_FIT).guarantee.holds is False  # ρ fails, φ and Q_M cannot be told
    assert gains_of(REFERENCE_FIT, DesignOptions(B_hat="minimax", phi_honest_pct=50.0, duty_limits_pct=(0.0, 1e4)),
                    slope_nm_s=4.0).guarantee.holds is True  # fmt: skip


def test_every_row_of_the_table_of_sentences_can_be_said():
    from eaid.findings import finding, say
    from eaid.findings.sentences.control import GAIN_ROWS as OURS
    from eaid.findings.sentences.control import REPLAY_ROWS as REPLAYS

    numbers = "allowed needed slope Q_M B_hat reached made asked span enough_db enough_deg gain_db overshoot_pct "
    numbers += "dead_time_s settling_s sharpness least jump pace highest noise below_pct above_pct falling_pct low high"
    words = "where reference input_unit output_unit why source wanted"
    values = dict.fromkeys(numbers.split(), 5.0) | dict.fromkeys(words.split(), "there")
    values |= {"unit": "%", "phase_deg": None, "allowed": 1.0, "needed": 2.0, "falling_pct": 40.0}
    for code in [*OURS, *REPLAYS]:
        said = say(finding(code, "rc", (10.0, 20.0), **values))
        assert said and "{" not in said and said != code
    assert say(finding("phi-exceeded", "rc", **values)) == (
        "φ does not hold: ρ allows |η − η̂| up to 1 %, the data ask for 2 % (there); «phi» data takes it from there"
    )
    assert say(finding("replay-leaves-identified", "nonlinear", **values)) == (
        "replays leave what was identified: 5 % of the time below 5 %, 5 % above 5 %, 40 % falling from level to "
        "level with the time constants of rising steps; record steps down to levels there to know"
    )
