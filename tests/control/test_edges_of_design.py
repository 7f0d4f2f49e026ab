"""What a design takes, refuses and tells at the edges of its numbers; each worked out by hand."""

import math
from dataclasses import replace

import numpy as np
import pytest

from eaid.control import robust
from eaid.control.bounds import Bounds
from eaid.control.defaults import PAPER_TOP, design_options, is_duty, scales_of, timing_of, with_own_pi
from eaid.control.design import condition, design, guarantee, least_phi, mismatches
from eaid.control.gains import paper_gains, pi_gains, plant_of, rc_gains
from eaid.control.margins import (
    Feedback,
    LoopMargins,
    Timing,
    hold_response,
    is_stable,
    latch_response,
    margins,
    phase_margin,
    rc_feedback,
)
from eaid.control.operating import actuator, enough, keeps_margins, known
from eaid.control.options import DesignOptions, PIOptions
from eaid.control.pi import error, step_metrics
from eaid.control.pi import pi_gains as asked_pi
from eaid.control.rc import TANH_IS_ONE, RCState, rc_step, rc_terms
from eaid.control.rc_design import Disturbance, error_bound, law_of, solve_Q, ultimate_level
from eaid.errors import DataError, GainsError
from eaid.models.parameters import PAPER_LINEAR, Linear
from eaid.options import TuneOptions
from eaid.results.codec import from_plain
from eaid.results.fit import Fit
from eaid.results.gains import Gains, Mismatch

RC, PI = paper_gains()
LINEAR = {"a0": 1.36, "b0": 0.08, "c0": -2.42, "bounds": {"B_m": 12.4, "B_M": 42.6}}
NO_ROWS = Bounds((), 12.4, 42.6, ())


def fit(linear: dict[str, object] | None = None, **data: object) -> Fit:
    told = {"input_unit": "%", "output_unit": "N·m", "levels": [20.0, 100.0], "sample_rate_hz": 500.0, **data}
    return from_plain({"data": told, "linear": LINEAR | (linear or {})}, Fit, "f")


OWN = fit({"a0": 2.72}, input_unit="V", output_unit="N", levels=[1.0, 5.0])
"""A rig of twice the paper's pace; no level tells its top."""


# what a design takes


def test_a_rig_of_its_own_is_scaled_and_takes_phi_from_its_data() -> None:
    scales = scales_of(OWN)
    assert scales == (False, 2.0, 1.0)
    taken = design_options(OWN, TuneOptions(), scales, 4.0, 0.7)
    assert (taken.phi, taken.phi_honest_pct, taken.Q_M) == (0.05, 0.7, 4.0)
    assert (taken.K_P, taken.K_D) == (18.0, 6.0)
    Q22 = (5 + 5 / 18) / 12  # ε = 0.11 y Q22 and γε = 25
    assert taken.epsilon == pytest.approx(0.11 * PAPER_TOP * Q22) and taken.gamma == pytest.approx(25 / taken.epsilon)
    assert taken.duty_limits_pct == (0.0, 5.0) and taken.timing == Timing(500.0, None)
    said = design_options(OWN, TuneOptions(phi=0.2, epsilon=0.4, gamma=9.0, q_max=3.0, kp=2.0), scales, 4.0, 0.7)
    assert (said.phi, said.phi_honest_pct, said.epsilon, said.gamma, said.Q_M) == (0.2, None, 0.4, 9.0, 3.0)
    assert (said.K_P, said.K_D) == (2.0, 6.0)
    assert design_options(OWN, TuneOptions(epsilon=0.5), scales, 4.0, 0.7).gamma == 50.0
    with pytest.raises(DataError, match="nothing to take φ from"):
        design_options(OWN, TuneOptions(), scales, 4.0, None)
    assert design_options(OWN, TuneOptions(phi=0.1), scales, None, None).Q_M == 5.0


def test_a_plant_says_how_high_its_output_goes() -> None:
    part = {"tau1": [0.3, 0, 0], "tau2": [3.0, 0, 0], "Ts": [1.0, 2.0, 0, 0], "u_range": [1.0, 4.0]}
    own = from_plain({"data": {"input_unit": "V"}, "nonlinear": part}, Fit, "f")
    assert scales_of(own, own.plant) == (False, 1.0, pytest.approx(9.0 / PAPER_TOP))
    assert design_options(own, TuneOptions(phi=0.1), scales_of(own, own.plant), None, None).duty_limits_pct == (
        0.0,
        4.0,
    )


@pytest.mark.parametrize(("unit", "paper"), [("N·m", True), ("Nm", True), ("N", False)])
def test_the_papers_units_are_percent_and_newton_metres(unit: str, paper: bool) -> None:
    assert scales_of(fit(output_unit=unit)).paper is paper


@pytest.mark.parametrize(("highest", "duty"), [(1.0, False), (1.01, True), (100.0, True), (100.1, False)])
def test_a_duty_ends_between_one_and_a_hundred(highest: float, duty: bool) -> None:
    assert is_duty(fit(levels=[0.5, highest])) is duty


def test_a_loop_in_volts_has_no_pwm_unless_it_is_told() -> None:
    assert timing_of(OWN, TuneOptions(pwm_hz=50.0)) == Timing(500.0, 50.0)
    assert timing_of(fit(), TuneOptions(rate_hz=2000.0)) == Timing(2000.0, 300.0)


def test_a_pi_is_slowed_down_by_half_until_its_loop_runs() -> None:
    scales = scales_of(OWN)
    quick = design_options(OWN, TuneOptions(), scales, 4.0, 0.7)
    assert with_own_pi(OWN, quick, scales).pi == PIOptions(None, 1.0, 0.135)
    slow = with_own_pi(OWN, replace(quick, timing=Timing(10.0)), scales).pi
    times = np.log(slow.settling_s / 0.135) / np.log(1.5)
    assert times == pytest.approx(round(times)) and times >= 1

    def runs(settling_s: float) -> bool:
        K_P, K_I = asked_pi(Linear(2.72, 0.08, -2.42), 1.0, settling_s)
        return is_stable(Feedback(K_P, K_I), ((0.08 / 2.72, 1 / 2.72),), Timing(10.0))

    assert runs(slow.settling_s) and not runs(slow.settling_s / 1.5)


# what a design tells


@pytest.mark.parametrize(("K_P", "K_I", "taken"), [(0.0, 0.0, False), (0.0, 0.01, True), (1.0, 0.0, True),
                                                   (-0.01, 5.0, False), (5.0, -0.01, False)])  # fmt: skip
def test_gains_of_a_pi_that_may_be(K_P: float, K_I: float, taken: bool) -> None:
    options = DesignOptions(pi=PIOptions(gains=(K_P, K_I)))
    if taken:
        assert (design(fit(), options).pi.K_P, design(fit(), options).pi.K_I) == (K_P, K_I)
    else:
        with pytest.raises(GainsError, match="neither may be negative, nor both 0"):
            design(fit(), options)


def test_a_layer_is_too_thin_where_the_loop_about_its_middle_is_unstable() -> None:
    """1 N·m is held by (1.36 + 2.42)/0.08 = 47.25 % there; the slope is nearly that of the layer, as 1/ε."""
    made = law_of(PAPER_LINEAR, NO_ROWS, DesignOptions(epsilon=0.02, gamma=100.0)).gains
    left = margins(rc_feedback(made, 1.0, 47.25), ((0.08 / 1.36, 1 / 1.36),), DesignOptions().timing).gain_db
    thinnest = 0.02 / 10 ** (left / 20)
    design(fit(), DesignOptions(epsilon=1.02 * thinnest, gamma=2 / thinnest))
    with pytest.raises(
        GainsError, match="the RC loop is unstable on the linear model at 1000 Hz with the duty latched"
    ):
        design(fit(), DesignOptions(epsilon=0.98 * thinnest, gamma=2 / thinnest))


@pytest.mark.parametrize(("how", "K_P", "gain"), [("conditional", 20.0, 0.0), ("back-calculation", 20.0, 0.05),
                                                  ("back-calculation", 0.0, 0.0)])  # fmt: skip
def test_the_gain_of_the_anti_windup(how: str, K_P: float, gain: float) -> None:
    made = design(fit(), DesignOptions(anti_windup=how, pi=PIOptions(gains=(K_P, 30.0))))  # type: ignore[arg-type]
    assert (made.pi.anti_windup.method, made.pi.anti_windup.gain) == (how, gain)
    assert (made.rc.anti_windup.gain > 0) is (how == "back-calculation")
    assert made.rc.anti_windup.gain in (0.0, pytest.approx(1 / made.rc.equal_pi.K_P))


def told(**options: object) -> dict[str, dict[str, object]]:
    slope = options.pop("slope_nm_s", None)
    made = design(fit(), DesignOptions(**options), slope_nm_s=slope)  # type: ignore[arg-type]
    return {one.code: dict(one.values) for one in made.findings}


def test_the_papers_pi_is_told_where_it_misses_and_one_that_was_asked_for_is_not() -> None:
    assert told()["paper-pi-misses"]["overshoot_pct"] == pytest.approx(41.7, abs=0.05)
    assert told()["paper-pi-misses"]["settling_s"] == pytest.approx(2.52, abs=0.005)
    for pi in (PIOptions(gains=(21.0, 360.0)), PIOptions(None, 40.0, 2.0)):
        assert "paper-pi-misses" not in told(pi=pi)


def test_a_slope_of_just_Q_M_is_no_more_than_that() -> None:
    assert "slope-above-q-max" not in told(Q_M=4.0, slope_nm_s=4.0)
    assert told(Q_M=4.0, slope_nm_s=4.001)["slope-above-q-max"] == {
        "slope": 4.001,
        "Q_M": 4.0,
        "reference": "reference",
    }


@pytest.mark.parametrize(("gamma", "said"), [(9.9, True), (10.0, False)])
def test_a_switch_is_sharp_from_five_on(gamma: float, said: bool) -> None:
    assert ("switch-jumps" in told(gamma=gamma)) is said


def test_what_rho_was_made_with_and_what_is_reached() -> None:
    pooled = told()["rho-not-covered"]
    assert pooled["B_hat"] == pytest.approx(12.5) and pooled["made"] == pytest.approx(30.2 / 55)
    assert pooled["reached"] == pytest.approx(1 - 12.5 / 42.6)
    assert "rho-not-covered" not in told(B_hat="minimax")
    asked = told()["robust-term-beyond-actuator"]
    assert (asked["span"], asked["asked"]) == (100.0, pytest.approx(12.5 * 10.8125))


def test_the_larger_of_model_and_logs_counts_and_the_levels_where_there_is_neither() -> None:
    one, two, three = (Mismatch(pct, pct, "") for pct in (1.0, 2.0, 3.0))
    assert least_phi({"model": one, "logs": two, "levels": three}) is two
    assert least_phi({"model": one, "levels": three}) is one and least_phi({"levels": three}) is three
    assert least_phi({}) is None and mismatches(PAPER_LINEAR, NO_ROWS, None, None) == {}


@pytest.mark.parametrize(
    ("needed", "available", "holds"),
    [(1.0, 1.0, True), (1.0 + 1e-8, 1.0, False), (1.0, 2.0, True), (None, 1.0, None), (1.0, None, None)],
)
def test_a_condition(needed: float | None, available: float | None, holds: bool | None) -> None:
    assert condition("x", needed, available, "V").holds is holds


def test_a_guarantee_needs_every_condition() -> None:
    yes, no, open_end = (condition("x", need, 1.0, "V") for need in (0.5, 2.0, None))
    assert [guarantee(each).holds for each in ([yes], [yes, no], [yes, open_end], [no, open_end], [])] == [
        True, False, None, False, True,
    ]  # fmt: skip


def test_the_actuator_is_asked_for_less_than_one_percent() -> None:
    rc = RC._replace(B_hat=1.0, rho_constant=0.5, a0=2.0, b0=0.08, c0=0.0, duty_min=0.0, duty_max=90.25)
    found = actuator(Linear(2.0, 0.08, 0.0), rc, None, NO_ROWS)  # its top is held by 90.25, so 81.225 at nine tenths
    assert [row.share_up for row in found.points] == [1.0, 1.0, 1.0]
    low = actuator(Linear(2.0, 0.08, 0.0), rc._replace(duty_max=2.5), None, NO_ROWS)
    assert [row.share_up for row in low.points] == pytest.approx([1.0, 1.0, 0.5])  # 0.25 of the 0.5 are left
    assert [row.share_down for row in low.points] == pytest.approx([0.5, 1.0, 1.0])


# margins


@pytest.mark.parametrize(("db", "deg", "yes"), [(6.0, 45.0, True), (5.99, 60.0, False), (9.0, 44.9, False)])
def test_six_decibels_and_forty_five_degrees_are_enough(db: float, deg: float, yes: bool) -> None:
    assert enough(LoopMargins(True, db, 0.1, deg, 1.0)) is yes
    assert known(db) == db and known(math.inf) is None


def test_a_loop_below_one_everywhere_has_no_crossover() -> None:
    """A gain of 0.5 around a lag: no crossover, margins without end, and a loop opened at once has none to lose."""
    found = margins(Feedback(0.5, 0.0), ((1.0, 0.2),), Timing(1000.0))
    assert (found.stable, found.phase_deg, found.crossover_hz, found.delay_s) == (True, math.inf, 0.0, math.inf)
    late = margins(Feedback(0.5, 0.0), ((1.0, 0.2),), Timing(1000.0, delay_samples=40))
    assert (late.stable, late.phase_deg, late.delay_s) == (True, math.inf, math.inf) and 6.0 < late.gain_db < 60.0


def test_an_integrator_crosses_where_its_gain_is_one() -> None:
    """k/s with the hold's half sample: a crossover at k, 90° less k h/2, less the dead time's k τ."""
    lags, feedback = ((1e4, 1e4),), Feedback(5.0, 0.0)
    left, crossover = phase_margin(feedback, lags, Timing(1000.0))
    assert crossover == pytest.approx(5 / (2 * math.pi), rel=1e-4)
    assert left == pytest.approx(90 - math.degrees(5 * 0.5e-3), abs=0.01)
    late, _ = phase_margin(feedback, lags, Timing(1000.0, delay_samples=100))
    assert late == pytest.approx(90 - math.degrees(5 * 0.1005), abs=0.01)


def test_a_loop_that_is_stable_at_its_gain_and_not_at_half_as_much_again_keeps_no_margins() -> None:
    """An integrator nearly, unstable at k h = 2 at 100 Hz: 1.6 has 1.9 dB, 1.01 has 5.9, 0.985 has 6.2, 0.5 has 12."""
    law = RC._replace(rho_constant=0.0, rho_slope=0.0, K_P=1e-6, B_hat=1.0, a0=0.0, b0=1.0, c0=0.0)
    for gain, kept in ((160.0, False), (101.0, False), (98.5, True), (50.0, True)):
        assert keeps_margins(law._replace(K_D=gain), [(50.0, 1.0, ((1000.0, 1000.0),))], Timing(100.0)) is kept
    both = [(50.0, 1.0, ((1000.0, 1000.0),)), (50.0, 1.0, ((3000.0, 1000.0),))]
    assert not keeps_margins(law._replace(K_D=50.0), both, Timing(100.0))


def test_a_latch_of_the_control_rate_is_no_latch() -> None:
    omega = np.array([1.0, 50.0, 300.0])
    assert latch_response(Timing(1000.0, 1000.0), omega) == pytest.approx(np.ones(3), rel=1e-12)
    assert latch_response(Timing(1000.0), omega) == pytest.approx(np.ones(3), rel=1e-12)
    assert hold_response(omega, 1e-2) == pytest.approx((1 - np.exp(-1e-2j * omega)) / (1e-2j * omega), rel=1e-12)
    half = latch_response(Timing(1000.0, 500.0), omega)
    assert half == pytest.approx(hold_response(omega, 2e-3) / hold_response(omega, 1e-3), rel=1e-12)


# the PI on the linear model


def test_a_loop_without_damping_or_with_a_wrong_sign_does_not_settle() -> None:
    one = Linear(1.0, 0.5, 0.0)
    for K_P, K_I in ((-2.0, 1.0), (-2.5, 1.0), (1.0, -0.5)):
        assert step_metrics(one, K_P, K_I).settling_s == step_metrics(one, K_P, K_I).overshoot_pct == math.inf


@pytest.mark.parametrize(("K_P", "settles"), [(97.9, False), (98.1, True)])
def test_a_proportional_loop_settles_where_it_ends_within_the_band(K_P: float, settles: bool) -> None:
    """It ends at a0/(a0 + b0 K_P): 2 % at b0 K_P = 49."""
    found = step_metrics(Linear(1.0, 0.5, 0.0), K_P, 0.0)
    assert math.isfinite(found.settling_s) is settles and found.overshoot_pct == 0.0


def test_a_first_order_loop_by_hand() -> None:
    """Zero and pole cancel at K_I = a0 K_P: e = e^(−b0 K_P t)."""
    found = step_metrics(Linear(2.0, 0.5, 0.0), 8.0, 16.0)
    assert found.settling_s == pytest.approx(math.log(50) / 4) and found.overshoot_pct == pytest.approx(0.0, abs=1e-9)
    assert error(2.0, 6.0, 8.0, 0.3) == pytest.approx(math.exp(-1.2))


def test_overshoot_and_settling_that_may_be_asked_for() -> None:
    for overshoot in (0.0, 95.0):
        K_P, K_I = asked_pi(PAPER_LINEAR, overshoot, 0.5)
        assert step_metrics(PAPER_LINEAR, K_P, K_I).overshoot_pct == pytest.approx(overshoot, abs=1e-6)
    with pytest.raises(GainsError, match="an overshoot of 95.5 % is out of reach; give one from 0 to 95 %"):
        asked_pi(PAPER_LINEAR, 95.5, 0.5)


# the law


def test_omega_by_hand_within_the_layer_at_its_edge_and_beyond() -> None:
    """Q12 = 0: z = Q22 e. S of Eq. (13) is 0 in the middle, 1/2 at the edge, 1 beyond, where γ(|z| − ε) is 19.1."""
    law = RC._replace(Q12=0.0, Q22=1.0, rho_constant=4.0, rho_slope=0.0, epsilon=0.5, gamma=50.0)
    assert rc_terms(law, 0.0, 0.05).omega == pytest.approx(0.4, rel=1e-12)
    assert rc_terms(law, 0.0, -0.5).omega == -4.0
    share = (math.tanh(50 * 0.02) + 1) / 2
    assert rc_terms(law, 0.0, 0.52).omega == pytest.approx(4 * share + (1 - share) * 4 * 1.04, rel=1e-12)
    far = 0.5 + 1.01 * TANH_IS_ONE / 50
    assert rc_terms(law, 0.0, far).omega == 4.0 and rc_terms(law, 0.0, -far).omega == -4.0


def test_the_duty_by_hand_and_what_winds_up() -> None:
    """e = 0.5: u = 2 (3 + 3·0.5 + 4.5·0.2) + (1.36·1.5 − 0.5)/0.1 = 26.2."""
    law = RC._replace(K_P=4.5, K_D=3.0, B_hat=2.0, a0=1.36, b0=0.1, c0=0.5, rho_constant=0.0, rho_slope=0.0)
    state, duty = rc_step(law, RCState(0.2), 2.0, 3.0, 1.5, 0.01)
    assert duty == pytest.approx(26.2) and state.integral == pytest.approx(0.205)
    at_limit = law._replace(duty_max=20.0)
    assert rc_step(at_limit, RCState(0.2), 2.0, 3.0, 1.5, 0.01) == (RCState(0.2), 20.0)
    back = rc_step(at_limit._replace(back_calculation=0.1), RCState(0.2), 2.0, 3.0, 1.5, 0.01)[0].integral
    assert back == pytest.approx(0.2 + 0.01 * (0.5 - 0.1 * 6.2))


@pytest.mark.parametrize(("short", "yes"), [(0.0, True), (1e-10, True), (1e-8, False)])
def test_rho_covers_to_a_billionth(short: float, yes: bool) -> None:
    need = robust.rho(0.5, 4.0, 3.0, 1.0)
    assert (need.constant, need.slope) == (6.0, 3.0)
    for less in (replace(need, phi_term=need.phi_term - short), replace(need, slope=need.slope - short)):
        assert robust.covers(less, 0.5, 4.0, 3.0, 1.0) is yes


@pytest.mark.parametrize("alpha", [0.5, 1.0, 1.2])
def test_the_ultimate_level_also_where_alpha_is_one_or_more(alpha: float) -> None:
    """Against V on a grid of the plane: the largest where ξᵀPξ is no more than what the disturbance may add."""
    P = 5 * np.eye(2)
    Q = solve_Q(4.5, 3.0, P)
    d = Disturbance(alpha, 1.0, 0.4, 2.0, 0.5, 0.5)
    level = ultimate_level(d, P, Q)
    reach = 1.5 * math.sqrt(level / np.linalg.eigvalsh(Q).min())
    q, e = np.meshgrid(np.linspace(-reach, reach, 801), np.linspace(-reach, reach, 801))
    size, z = np.hypot(q, e), np.abs(Q[1, 0] * q + Q[1, 1] * e)
    push = d.n0 + d.n1 * size - (1 - alpha) * (d.rho0 + d.rho1 * size) * np.minimum(1, z / d.epsilon)
    V = Q[0, 0] * q * q + 2 * Q[0, 1] * q * e + Q[1, 1] * e * e
    assert level == pytest.approx(V[5 * size * size <= 2 * z * push].max(), rel=0.03)
    assert error_bound(level, Q) == pytest.approx(math.sqrt(level * np.linalg.inv(Q)[1, 1]))


# what no rig has


@pytest.mark.parametrize(
    ("part", "said"),
    [
        ({"tau1": [5.1e-4, 0, 0]}, None),
        ({"tau1": [4.9e-4, 0, 0]}, "tau1 is 0.00049 s"),
        ({"tau1": [0.9e9, 0, 0], "tau2": [1e9, 0, 0]}, None),
        ({"tau2": [1.1e9, 0, 0]}, r"tau2 is 1.1e\+09 s"),
        ({"tau1": [3.002, 0, 0]}, None),  # within a thousandth of the largest τ2
        ({"tau1": [3.004, 0, 0]}, "tau2 is 3 s at an input of 10, below tau1"),
        ({"Ts": [-0.43, 0.043, 0, 0]}, None),
        ({"Ts": [-0.44, 0.04, 0, 0]}, r"Ts is -0.04 at an input of 10,"),
        ({"Ts": [0.0, 0, 0, 0]}, "Ts is 0 at"),
        ({"Ts": [0.9e-15, 0, 0, 0]}, "Ts is 9e-16 at"),
        ({"Ts": [1.1e-15, 0, 0, 0]}, None),
        ({"u_range": [50.0, 50.0]}, None),
        ({"u_range": [51.0, 50.0]}, r"u_range is \[51, 50\]; it has to rise"),
    ],
)
def test_a_plant_that_a_rig_may_be(part: dict[str, object], said: str | None) -> None:
    plain = {"tau1": [0.3, 0, 0], "tau2": [3.0, 0, 0], "Ts": [0.0, 0.04, 0, 0], "u_range": [10, 100], "C": 0.85, **part}
    read = from_plain({"nonlinear": plain}, Fit, "f")
    if said is None:
        assert plant_of(read) == read.plant
    else:
        with pytest.raises(DataError, match=said):
            plant_of(read)
    assert plant_of(Fit()) is None


@pytest.mark.parametrize(("value", "taken"), [(1e30, True), (1.1e30, False), (1e-30, True), (0.9e-30, False)])
def test_gains_that_a_loop_may_have(value: float, taken: bool) -> None:
    made = design(fit())
    changed = replace_rc(made, value)
    if taken:
        assert rc_gains(changed).gamma == value  # type: ignore[union-attr]
    else:
        with pytest.raises(DataError, match="gamma is .*, which no loop of a rig has"):
            rc_gains(changed)
    small = replace_pi(made, value)
    if value < 1 or taken:
        assert value == pi_gains(small).K_I  # type: ignore[union-attr]
    else:
        with pytest.raises(DataError, match="pi.K_I is"):
            pi_gains(small)


def replace_rc(made: Gains, gamma: float) -> Gains:
    import msgspec

    return msgspec.structs.replace(made, rc=msgspec.structs.replace(made.rc, gamma=gamma))


def replace_pi(made: Gains, K_I: float) -> Gains:
    import msgspec

    return msgspec.structs.replace(made, pi=msgspec.structs.replace(made.pi, K_I=K_I))
