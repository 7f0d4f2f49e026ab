"""What a design takes where nothing is said, on the paper's rig and on others; fits and gains that are refused."""

import json
from dataclasses import replace

import numpy as np
import pandas
import pytest

import eaid
from eaid.control.margins import enough
from eaid.plant.dynamics import Plant
from eaid.plant.respond import respond
from eaid.results.verdict import judged

from ..conftest import GAINS, codes

VOLTS = {"input_unit": "V", "output_unit": "N", "levels": [1.0, 5.0], "sample_rate_hz": 500.0}
ONE = {
    "b0": 1.6, "bounds": {"B_m": 0.62, "B_M": 2.13},
    "per_level": [{"level": 5.0, "a0": 1.5, "gain": 4.0, "b0": 1.2, "c0": 0.0, "B": 5 / 6}],
}  # fmt: skip


def settled(gains):
    """Settling time [s] that the PI was designed for."""
    return gains.pi.asked.settling_s


def test_the_paper_s_numbers_stand_in_percent_and_newton_metres_alone(tuned, told):
    for unit in ("N·m", "Nm"):
        data = {"input_unit": "%", "output_unit": unit, "levels": [20.0, 100.0], "sample_rate_hz": 500.0}
        found = tuned(data=data)
        assert (found.rc.epsilon, found.rc.gamma, found.rc.phi, settled(found)) == (0.5, 50.0, 0.05, 0.27)
        assert (found.margins.timing.rate_hz, found.margins.timing.pwm_hz) == (1000.0, 300.0)
        assert not {"designed-for-rig", "rc-slowed"} & set(told(found)) and found.duty_limits_pct == (0.0, 100.0)
    for other in ({"output_unit": "N"}, {"levels": [0.2, 1.0]}, {"levels": [120.0]}):
        assert "designed-for-rig" in told(tuned(data={**data, **other}, phi=0.01))
    with pytest.raises(eaid.UsageError, match="duty_limits= 0,100.5: a duty ends at 100 %"):
        tuned(duty_limits=(0.0, 100.5))
    with pytest.raises(eaid.DataError, match="neither a nonlinear model nor fits of single levels"):
        tuned(phi="data")


def test_another_rig_is_designed_for_its_own_pace_and_output(tuned, told):
    """Twice the paper's pace: K_P·4, K_D·2, P11·4, ε = 0.11 y Q22, γε = 25, a PI for 1 % in 0.135 s, to the highest."""
    row = {"level": 5.0, "a0": 2.72, "gain": 8.744, "b0": 4.757, "c0": 0.0, "B": 5 / (2.72 * 8.744)}
    linear = {"a0": 2.72, "b0": 1.6, "c0": -2.42, "bounds": {"B_m": 0.4, "B_M": 1.3}, "per_level": [row]}
    found = tuned(linear=linear, data=VOLTS)
    Q22 = (5 + 20 / 18) / 12
    assert (found.rc.K_P, found.rc.K_D, found.duty_limits_pct) == (18.0, 6.0, (0.0, 5.0))
    assert found.rc.epsilon == pytest.approx(0.11 * 8.744 * Q22) and found.rc.gamma * found.rc.epsilon == 25.0
    assert found.rc.phi_honest_pct == pytest.approx(found.guarantee.conditions[1].needed) and found.rc.phi_holds
    assert pytest.approx(9.284 * 2 * 2, rel=2e-3) == found.rc.Q_M and found.replayed is None
    assert (found.margins.timing.rate_hz, found.margins.timing.pwm_hz) == (1000.0, None)  # not the logger's rate
    assert found.pi.overshoot_pct == pytest.approx(1.0) and settled(found) == pytest.approx(0.135)
    said = told(found)["designed-for-rig"]
    assert (said["pace"], said["highest"], said["overshoot_pct"]) == (pytest.approx(2.0), 5.0, 1.0)
    given = tuned(linear=linear, data=VOLTS, phi=0.2, epsilon=0.4, gamma=9.0, q_max=3.0, kp=2.0, pwm_hz=50.0)
    assert (given.rc.phi, given.rc.epsilon, given.rc.gamma, given.rc.Q_M) == (0.2, 0.4, 9.0, 3.0)
    assert (given.rc.K_P, given.rc.K_D, given.margins.timing.pwm_hz) == (2.0, 6.0, 50.0)
    for asked in ({"pi_gains": (3.0, 4.0)}, {"pi_overshoot": 5.0, "pi_settling": 1.0}):
        pi = tuned(linear=linear, data=VOLTS, **asked).pi
        assert (pi.K_P, pi.K_I) == (3.0, 4.0) if "pi_gains" in asked else pi.asked.settling_s == 1.0
    with pytest.raises(eaid.UsageError, match="tells no highest input in V"):
        tuned(linear=linear, data={**VOLTS, "levels": []})


@pytest.mark.parametrize("times", [1 / 30, 200.0])
def test_a_rig_far_quicker_or_slower_has_its_own_loop_in_the_papers_units_too(small_steps, times):
    """With the paper's K_P of 4.5 an RC had 0.84 dB where τ is 30 ms, and was unstable, PI and all, where it is min."""
    levels = tuple(replace(one, time_s=times * one.time_s) for one in small_steps.levels)
    fit = eaid.fit(replace(small_steps, levels=levels, level_steps=(), logs=()), ci="none")
    gains = eaid.tune_rc(fit)
    assert fit.linear.a0 * times == pytest.approx(2.5, rel=0.1) and "designed-for-rig" in codes(gains)
    assert (gains.rc.K_P > 20 * 4.5) if times < 1 else (gains.rc.K_P < 4.5 / 20)
    assert gains.margins.timing.rate_hz == 1000.0 if times < 1 else gains.margins.timing.rate_hz < 20.0
    for name in ("rc", "pi"):
        assert enough(gains.margins.worst[name])


def test_a_rig_of_a_millisecond_is_sampled_as_quickly_and_says_so():
    """At 1 kHz its multisine went to 2.9 kHz: 16 samples of an aliased reference told which controller was better."""
    u = np.repeat(np.random.default_rng(0).uniform(1.0, 10.0, 60), 80)
    t, y = np.arange(len(u)) * 1e-4, np.zeros(len(u))
    for k in range(1, len(u)):
        y[k] = y[k - 1] + (1 - np.exp(-0.1)) * (0.5 * u[k - 1] - y[k - 1])
    fit = eaid.fit(t, u, y + np.random.default_rng(1).normal(0, 0.005, len(u)))
    gains, slow = (eaid.tune_rc(fit, rate_hz=hz) for hz in (None, 1000.0))
    assert gains.margins.timing.rate_hz == pytest.approx(12 * fit.linear.a0, rel=0.05)
    assert ("control-rate-raised" in codes(gains), "control-rate-raised" in codes(slow)) == (True, False)
    quick, aliased = (
        eaid.simulate(fit, one, "multisine").records["rc"].columns["reference_nm"] for one in (gains, slow)
    )
    for one in (quick, aliased):
        assert len(one) > 150 and np.abs(np.diff(one)).max() < 0.7 * np.ptp(one)


def test_a_plant_says_how_high_its_output_and_its_input_go(tuned):
    own = {"C": 0.85, "tau1": [0.3, 0, 0], "tau2": [3.0, 0, 0], "Ts": [1.0, 2.0, 0, 0], "u_range": [1.0, 4.0]}
    linear = {"b0": 3.0, "c0": 0.0, "bounds": {"B_m": 0.3, "B_M": 0.4}}
    found = tuned(linear=linear, nonlinear=own, data={"input_unit": "V"})
    Q22 = (5 + 5 / 4.5) / 6
    assert found.rc.epsilon == pytest.approx(0.11 * 9.0 * Q22) and found.duty_limits_pct == (0.0, 4.0)
    assert found.rc.Q_M == pytest.approx(9.284 * 9.0 / 4.372, rel=1e-3) == found.replayed.slope_nm_s


def test_a_loop_that_is_sampled_slowly_gets_a_thicker_layer_and_a_slower_pi(tuned):
    """Both grow by half until the loop runs, and no further; γε stays."""
    quick, slow = (tuned(linear=ONE, data=VOLTS, rate_hz=rate) for rate in (500.0, 4.0))
    assert settled(quick) == pytest.approx(0.27)
    for grown, own in ((settled(slow), settled(quick)), (slow.rc.epsilon, quick.rc.epsilon)):
        steps = np.log(grown / own) / np.log(1.5)
        assert steps == pytest.approx(round(steps)) and steps >= 1
    assert slow.rc.epsilon * slow.rc.gamma == pytest.approx(25.0)
    for worst in (slow.margins.worst["rc"], slow.margins.worst["pi"]):
        assert worst.gain_db >= 6 and worst.phase_deg >= 45
    once = {"epsilon": slow.rc.epsilon / 1.5, "gamma": slow.rc.gamma * 1.5, "phi": slow.rc.phi}
    before = tuned(linear=ONE, data=VOLTS, rate_hz=4.0, pi_gains=(0.1, 0.1), **once).margins.worst["rc"]
    assert before.gain_db < 6 or before.phase_deg < 45


def test_a_dead_time_slows_both_controllers_down_and_ends_the_guarantee(tuned, told, fit_of, rises):
    at_once, late = (tuned(linear=ONE, data=VOLTS, steps=steps) for steps in ([], rises(0.15)))
    assert fit_of(steps=rises(0.15)).dead_time_s == 0.15 and late.margins.timing.delay_samples == 150
    assert late.rc.epsilon > at_once.rc.epsilon and settled(late) > 2 * settled(at_once)
    assert "dead-time" not in [one.name for one in at_once.guarantee.conditions]
    assert "dead-time" in late.guarantee.missing and late.guarantee.holds is False
    with pytest.raises(eaid.GainsError, match="PI loop is .* around 5 V, at 1000 Hz behind a dead time of 0.15 s; ask"):
        tuned(linear=ONE, data=VOLTS, steps=rises(0.15), phi=0.1, pi_gains=(at_once.pi.K_P, 9 * at_once.pi.K_I))


def test_a_level_at_which_the_output_falls_leaves_no_pi(fit_of):
    own = {"C": 0.85, "tau1": [0.3, 0, 0], "tau2": [3.0, 0, 0], "Ts": [0.0, 0.08, -0.0005, 0], "u_range": [20.0, 100.0]}
    data = {"input_unit": "%", "output_unit": "N·m", "levels": [20.0, 60.0, 100.0]}
    with pytest.raises(eaid.GainsError, match="no PI has 6 dB and 45° .* does not rise with the input around 100 %"):
        eaid.tune_rc(fit_of(nonlinear=own, data=data))


@pytest.mark.parametrize(
    ("options", "words"),
    [({"kp": 0.0}, "K_P 0 and K_D 3 make the error dynamics"), ({"kd": -3.0}, "both have to be positive"),
     ({"b_hat": -0.5}, "B̂ is -0.5")],
)  # fmt: skip
def test_gains_that_no_loop_takes_are_refused(tuned, options, words):
    with pytest.raises(eaid.GainsError, match=words):
        tuned(**options)


def changed(*path, value):
    def copy(part, keys):
        return {**part, keys[0]: copy(part.get(keys[0], {}), keys[1:])} if keys else value

    return copy(GAINS, list(path))


@pytest.mark.parametrize(
    ("gains", "words"),
    [
        ({"rc": {}, "pi": {}}, "its content has no model"),
        (changed("rc", value=3), "its rc is 3"),
        (changed("rc", "K_P", value="4.5"), 'its rc.K_P is "4.5"'),
        (changed("rc", "epsilon", value=0), "its rc.epsilon is 0"),
        (changed("model", "b0", value=-0.1), "b0 is -0.1, it has to be positive"),
        (changed("rc", "Q", value=[[1, 2], [2, -1]]), "Q22 is -1, it has to be positive"),
        (changed("model", "b0", value=1e-300), "b0 is 1e-300, which no loop of a rig has"),
        (changed("rc", "K_P", value=-1e5), "K_P is -100000, it has to be positive"),
        (changed("rc", "rho", "slope", value=1e50), "rho_slope is 1e+50, which no loop of a rig has"),
        (changed("pi", "K_I", value=1e50), "pi: K_I is 1e+50, which no loop of a rig has"),
        ({**GAINS, "duty_limits_pct": [90, 5]}, "duty_limits_pct 90 to 5"),
        ({**GAINS, "duty_limits_pct": 90}, "duty_limits_pct is 90"),
    ],
)
def test_gains_json_by_another_hand_is_held_to_what_a_loop_takes(fit_of, tmp_path, gains, words):
    file = tmp_path / "gains.json"
    file.write_text(json.dumps(gains))
    with pytest.raises(eaid.DataError) as refusal:
        eaid.simulate(fit_of(nonlinear=True), eaid.load(file), duration=1.0)
    assert words in str(refusal.value)


@pytest.mark.slow
@pytest.mark.parametrize("plant", [
    pytest.param(Plant((0.55,), (0.55,), (0.0, 0.04), (20.0, 100.0), C=1.0, zeta=1.2), marks=pytest.mark.slow),
    Plant((0.2,), (0.2,), (0.0, 0.04), (20.0, 100.0), C=1.0, zeta=0.3),
    pytest.param(Plant((0.2,), (1.5,), (0.0, 0.04), (20.0, 100.0), C=1.5), marks=pytest.mark.slow),
])  # fmt: skip
def test_rc_has_its_margins_on_kinds_that_the_papers_numbers_are_not_for(plant):
    """In % and N·m, as the paper's clutch: K_P and K_D of its pace leave 34°, 5 dB and 1 dB."""
    t, random = np.arange(3000) * 0.02, np.random.default_rng(1)
    u = np.repeat(np.append(0.0, random.choice([0.0, 20.0, 40.0, 60.0, 80.0, 100.0], 29)), 100)
    torque = respond(plant, t, u, t) + 0.02 * random.standard_normal(3000)
    log = pandas.DataFrame({"time_s": t, "duty_pct": u, "torque_nm": torque})
    worst = eaid.tune_rc(eaid.fit(log, ci="none", shape="one"), reference=[0.0, 0.0]).margins.worst
    assert all(one.gain_db >= 6 and one.phase_deg >= 45 for one in worst.values()) and "rc" in worst


def test_gains_of_a_plant_that_must_not_be_used_are_refused(fit_of):
    """Only the linear model was asked, while margins and replays are of the plant."""
    little = {"code": "model-explains-little", "subject": "nonlinear", "severity": "stop", "R2": 0.1, "fit_pct": 5.0}
    fit = judged(fit_of(nonlinear=True, findings=[little]))
    assert fit.verdict.of("linear").usable and not fit.verdict.usable
    with pytest.raises(eaid.DataError, match="NOT USABLE: the nonlinear model explains little"):
        eaid.tune_rc(fit)
    assert eaid.tune_rc(fit, anyway=True).not_usable
