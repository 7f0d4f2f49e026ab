"""How stiff a wall: closed forms, published check values, python-control as a second way, replays, many limbs."""

import numpy as np
import pytest

import eaid

from ..conftest import GAINS, PLANT, loaded


def couple(plant=PLANT, gains=GAINS, steps=(), **options):
    """`eaid.couple` on a plant and gains; walls alone, unless told otherwise."""
    fit = loaded({"schema": "eaid/fit/2", "nonlinear": plant, "steps": steps})
    return eaid.couple(fit, loaded(gains), **{"replay": False, **options})


def lag(tau: float) -> dict:
    """A first-order lag τ of unit gain: both lags of the plant alike."""
    return {"C": 0.5, "tau1": [tau, 0, 0], "tau2": [tau, 0, 0], "Ts": [0, 0.05, 0, 0], "u_range": [10.0, 100.0]}


CHECKED = {
    "open-loop": ((0.300, 0.263, 0.270), (8.82, 8.84, 9.22)),
    "pi": ((1.946, 2.385, 3.403), (1.947, 2.410, 3.468)),
    "rc-no-rate": ((11.17, 18.5, 29.3), (18.5, 24.1, 34.5)),
    "rc": ((11.9,), ()),
}
"""Loop → K_passive and K_stable at 1, 2, 3 N·m, of an independent continuous analysis."""


def test_walls_are_those_of_an_independent_analysis_and_one_sample_late_costs_the_reference_rate_a_quarter():
    found = couple(torque=(1.0, 2.0, 3.0))
    walls = {(wall.loop, wall.torque_nm): wall for wall in found.walls}
    assert "wall-by-rate" in {one.code for one in found.findings}
    for loop, (passive, stable) in CHECKED.items():
        for torque, expected in enumerate(passive, 1):
            assert walls[loop, torque].K_passive == pytest.approx(expected, rel=0.02)
        for torque, expected in enumerate(stable, 1):
            assert walls[loop, torque].K_stable == pytest.approx(expected, rel=0.02)
    for wall in couple(torque=(1.0,), loops=("rc", "rc-no-rate"), delay_samples=1).walls:
        least, most = (0.6, 0.8) if wall.loop == "rc" else (0.97, 1.0)
        assert least < wall.K_stable / walls[wall.loop, 1.0].K_stable < most
    for slower in ({"pwm_hz": 300.0}, {"delay_samples": 10}):
        (wall,) = couple(torque=(2.0,), loops=("pi",), **slower).walls
        assert wall.K_stable < walls["pi", 2.0].K_stable


@pytest.mark.slow
def test_replays_agree_with_linear_theory_and_with_an_independent_replay():
    found = couple(torque=(1.0,), loops=("open-loop", "pi", "rc-no-rate", "rc"), replay=True)
    replayed = {wall.loop: wall.K_replayed for wall in found.walls}
    for loop, expected in (("open-loop", 8.79), ("pi", 1.93), ("rc-no-rate", 18.4)):
        assert replayed[loop] == pytest.approx(expected, rel=0.05)
    # The reference rate's wall rests on fractions of a sample: 185 in another replay, 170 by the exact sampled loop.
    assert 160 < replayed["rc"] < 200


@pytest.mark.parametrize(
    ("tau", "rate_hz", "delay", "virtual", "rel"),
    [(0.01, 1000, 0, 0, 2e-3), (0.1, 1000, 0, 0, 2e-3), (1.0, 1000, 0, 0, 2e-3), (0.01, 1000, 5, 0, 5e-3),
     (0.001, 10, 0, 0, 0.01), (0.001, 10, 0, 0.3, 0.04), (0.001, 10, 4, 0, 0.01)],
)  # fmt: skip
def test_a_first_order_lag_leaves_b_over_its_time(tau, rate_hz, delay, virtual, rel):
    """K = (b − B_v)/(τ + h/2 + delay); without a lag, τ ≪ h, that is Colgate and Schenkel's b > K h/2 + B_v."""
    (wall,) = couple(
        lag(tau), torque=(2.0,), loops=("open-loop",), rate_hz=rate_hz, delay_samples=delay, virtual_damping=virtual
    ).walls
    late = 0 if virtual else tau
    assert wall.K_passive == pytest.approx((0.8 - virtual) / (late + (0.5 + delay) / rate_hz), rel=rel)


def test_more_virtual_damping_than_the_limb_has_leaves_no_passive_wall():
    (wall,) = couple(lag(1e-3), torque=(2.0,), loops=("open-loop",), rate_hz=10.0, virtual_damping=0.85).walls
    assert wall.K_passive == 0.0


@pytest.mark.parametrize("loop", ["open-loop", "pi"])
def test_python_control_finds_the_same_sampled_wall(loop):
    """Angle over wanted torque by python-control: plant and limb behind a zero-order hold, the PI in feedback."""
    import control

    (wall,), h = couple(torque=(2.0,), loops=(loop,)).walls, 1e-3
    u, z = wall.duty, control.tf([1, 0], [1], 1e-3)
    tau1, tau2, _ = (np.polyval(PLANT[name][::-1], u) for name in ("tau1", "tau2", "Ts"))
    slope = np.polyval(np.polyder(PLANT["Ts"][::-1]), u)
    lags = [control.ss(control.tf([C * slope], [tau, 1])) for C, tau in ((0.85, tau1), (0.15, tau2))]
    plant, limb = lags[0] + lags[1], control.ss(control.tf([1], [0.1, 0.8, 0]))
    law = 21.0 + 360.0 * h / (z - 1)
    duty = control.tf([1 / slope], [1], h) if loop == "open-loop" else control.feedback(law, control.c2d(plant, h))
    omega = np.geomspace(0.1, 3000.0, 60_000)
    angle = control.frequency_response(control.ss(duty) * control.c2d(limb * plant, h), omega).complex
    turns = np.flatnonzero(((1 / angle).imag[:-1] < 0) != ((1 / angle).imag[1:] < 0))
    stiffest = min(K for K in -(1 / angle).real[turns] if K > 0)
    assert wall.K_stable == pytest.approx(stiffest, rel=1e-3)


@pytest.mark.slow
def test_a_wall_that_cannot_be_held_is_told():
    found = couple(torque=(1.0, 2.0), wall=3.0)
    told = {(one.subject, one.values["torque_nm"]) for one in found.findings if one.code == "wall-beyond-stable"}
    assert told == {("pi", 1.0), ("pi", 2.0)}


def test_what_else_limits_a_wall_by_hand():
    found = couple(torque=(1.0, 2.0), loops=("open-loop",), encoder_counts=4096, idle_drag_nm=0.02, rotor_rpm=6.0,
                   limb_speed_rad_s=0.7)  # fmt: skip
    limits, (low, high) = found.impedance, found.walls
    assert limits.encoder_K == pytest.approx(2 * 0.02 / (2 * np.pi / 4096))
    assert limits.slip_margin_rad_s == pytest.approx(6 * 2 * np.pi / 60 - 0.7)
    assert 0 < limits.residual_nm < high.torque_nm and limits.turn_step_nm == pytest.approx(2 * limits.residual_nm)
    chatter = next(one for one in found.findings if one.code == "clutch-cannot-turn")
    assert chatter.values["needed_rpm"] == pytest.approx(0.7 * 60 / (2 * np.pi)) and low.K_stable < limits.encoder_K


def test_an_unstable_loop_is_refused():
    gains = {**GAINS, "pi": {**GAINS["pi"], "K_P": 1e6, "K_I": 1e6}}
    with pytest.raises(eaid.GainsError, match="unstable at 2 without any wall"):
        couple(gains=gains, torque=(2.0,), loops=("pi",))


def test_a_dead_time_that_the_steps_show_counts_as_delay():
    rise = {"run": "a", "from": 0.0, "level": 10.0, "edge": "up", "start": 0.0, "change": 1.0, "gain": 0.1,
            "shape": "one", "tau1": 1.0, "tau2": None, "C": 1.0, "rmse": 0.0, "fit_pct": 99.0, "R2": 1.0,
            "samples": 9}  # fmt: skip
    options = {"loops": ("open-loop",), "torque": (1.0,)}
    late = couple(steps=[{**rise, "dead_time_s": 0.02}], **options)
    assert late.options.delay_samples == 0 and "dead-time-replayed" in {one.code for one in late.findings}
    assert late.walls == couple(**options, delay_samples=20).walls != couple(**options).walls
    both = couple(steps=[{**rise, "dead_time_s": 0.015}], **options, delay_samples=5)
    assert both.walls == late.walls  # one adds to the other
    (far,) = couple(steps=[{**rise, "dead_time_s": 1.5}], **options).walls  # b over lag, half a sample and delay
    (near,) = couple(**options).walls
    assert 0.8 / far.K_passive == pytest.approx(0.8 / near.K_passive + 1.5, rel=0.02) and far.K_stable < near.K_stable
    with pytest.raises(eaid.GainsError, match="the loop pi is unstable at 1 without any wall, at 1000 Hz behind"):
        couple(steps=[{**rise, "dead_time_s": 1.5}], torque=(1.0,), loops=("pi",))


@pytest.mark.slow
def test_walls_do_not_depend_on_the_unit_of_the_input():
    """The reference plant driven by 0 … 300 V in place of 0 … 100 %: the same torque, the same walls."""
    volts = {name: [c / 3.0**k for k, c in enumerate(PLANT[name])] for name in ("tau1", "tau2", "Ts")}
    options = {"torque": (1.0, 3.0), "loops": ("open-loop",)}
    stretched = couple({**PLANT, **volts, "u_range": [30.0, 300.0]}, **options)
    for wall, same in zip(couple(**options).walls, stretched.walls, strict=True):
        assert same.duty == pytest.approx(3 * wall.duty)
        assert (same.K_passive, same.K_stable) == pytest.approx((wall.K_passive, wall.K_stable), rel=1e-5)


def test_a_slow_rig_is_sampled_at_its_own_pace_and_its_replay_swings_as_theory_says():
    slow = {**PLANT, **{name: [100 * c for c in PLANT[name]] for name in ("tau1", "tau2")}}
    found = couple(slow, torque=(2.0,), loops=("open-loop",), replay=True)
    assert found.options.rate_hz == 160.0  # twenty samples in J/b = 0.125 s
    assert found.walls[0].K_replayed == pytest.approx(found.walls[0].K_stable, rel=0.01)
    assert couple(slow, {**GAINS, "margins": {"timing": {"rate_hz": 500.0}}}, loops=("pi",)).options.rate_hz == 500.0
