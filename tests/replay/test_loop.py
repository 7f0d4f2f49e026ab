"""The loop: specification 6's figures, the order of first-order time, each effect of the rig, the exact PWM latch."""

import numpy as np
import pytest

from eaid.control.pi import PIGains
from eaid.errors import UsageError
from eaid.replay import references
from eaid.replay.controllers import Controller, pi_controller
from eaid.replay.loop import reference_rate, replay
from eaid.replay.plant import plant_step
from eaid.replay.references import measure
from eaid.replay.rig import Rig

DT = 1e-3


def test_the_multisine_of_spec_6(plant, law):
    reference = references.multisine(DT)
    error = {}
    for name in ("rc", "pi"):
        for noise in (0.0, 0.01):
            done = replay(plant, law(name), reference.torque_nm, Rig(noise_nm=noise), DT, 1)
            error[name, noise] = measure(done, reference).max_abs_error_nm
    assert error["rc", 0.0] == pytest.approx(0.116, rel=0.01)
    assert error["pi", 0.0] == pytest.approx(0.797, rel=0.01)
    assert 1 - error["rc", 0.0] / error["pi", 0.0] == pytest.approx(0.85, abs=0.01)
    assert error["rc", 0.01] == pytest.approx(0.13, rel=0.15)
    assert error["pi", 0.01] == pytest.approx(0.82, rel=0.03)


def test_against_a_pi_that_meets_its_specification_the_gap_is_smaller(plant, law):
    """Specification 5: with 156.6 and 252.9 the robust controller is 69 % better, not 83 %."""
    reference = references.multisine(DT)
    proper = pi_controller(PIGains(156.6, 252.9))
    error = [
        measure(replay(plant, each, reference.torque_nm, Rig(), DT), reference).max_abs_error_nm
        for each in (law("rc"), proper)
    ]
    assert 1 - error[0] / error[1] == pytest.approx(0.69, abs=0.01)


@pytest.mark.slow
def test_the_sweep_of_spec_6(plant, law):
    reference = references.sweep(DT)
    gain = {}
    for name in ("rc", "pi", "open-loop"):
        done = replay(plant, law(name), reference.torque_nm, Rig(), DT)
        for tone in measure(done, reference).frequencies:
            gain[name, tone.frequency_hz] = tone.gain_db
    assert all(abs(gain["rc", f]) <= 0.105 for f in (0.2, 0.3, 0.4, 0.6, 0.8, 1.0))
    assert gain["rc", 1.5] == pytest.approx(-0.9, abs=0.05) and gain["rc", 3.0] == pytest.approx(-6, abs=0.1)
    assert gain["pi", 0.6] == pytest.approx(2.1, abs=0.1) and gain["pi", 3.0] == pytest.approx(-17, abs=0.5)
    assert gain["open-loop", 0.2] == pytest.approx(-4.4, abs=0.1)
    assert gain["open-loop", 3.0] == pytest.approx(-24, abs=0.5)


def test_the_inverse_follows_exactly_what_the_duty_can_reach(plant, law):
    t = np.arange(8000) * DT
    reachable = 1.5 * (1 - np.cos(2 * np.pi * 0.1 * np.maximum(t - 1, 0))) + 0.05 * np.minimum(t, 1)
    done = replay(plant, law("inverse"), reachable, Rig(), DT)
    inside = (done.duty_pct > 0) & (done.duty_pct < 100)
    settled = inside & (t > 1)
    assert settled.mean() > 0.8
    assert np.abs((done.reference_nm - done.torque_nm)[1:][settled[:-1]]).max() < 1e-10


def test_the_inverse_leaves_no_steady_error_on_a_plant_it_does_not_know(plant, law):
    other = plant._replace(Ts_1=0.9 * plant.Ts_1, tau1_1=1.3 * plant.tau1_1)
    done = replay(other, law("inverse"), np.full(6000, 2.0), Rig(), DT)
    assert abs(done.reference_nm[-1] - done.torque_nm[-1]) < 1e-4


def test_one_and_ten_kilohertz_agree_to_first_order(plant, law):
    apart = {}
    for rate in (1000, 2000, 10_000):
        reference = references.multisine(1 / rate, 6.0)
        done = replay(plant, law("pi"), reference.torque_nm, Rig(), 1 / rate)
        apart[rate] = done.torque_nm[:: rate // 1000]
    far = np.abs(apart[1000] - apart[10_000]).max()
    half = np.abs(apart[2000] - apart[10_000]).max()
    assert far < 0.02
    # errors c/rate: (1/1000 − 1/10000) against (1/2000 − 1/10000), 2.25 to first order
    assert far / half == pytest.approx(2.25, rel=0.05)


def test_noise_ripple_and_sensor_are_seen_where_they_act(plant, law):
    reference = np.full(3000, 2.0)
    clean = replay(plant, law("pi"), reference, Rig(), DT)
    assert clean.measured_nm is None and clean.applied_pct is None
    noisy = replay(plant, law("pi"), reference, Rig(noise_nm=0.02), DT, 4)
    assert np.std(noisy.measured_nm - noisy.torque_nm) == pytest.approx(0.02, rel=0.05)
    assert np.array_equal(noisy.torque_nm, replay(plant, law("pi"), reference, Rig(noise_nm=0.02), DT, 4).torque_nm)
    rippled = replay(plant, law("open-loop"), reference, Rig(ripple_pct=3.0, ripple_hz=5.0), DT)
    smooth = replay(plant, law("open-loop"), reference, Rig(), DT)
    wave = rippled.torque_nm / np.where(smooth.torque_nm > 0, smooth.torque_nm, 1.0)
    assert wave[1:] == pytest.approx(1 + 0.03 * np.sin(2 * np.pi * 5 * clean.time_s[1:]), rel=1e-12)
    slow = replay(plant, law("pi"), reference, Rig(sensor_hz=2.0), DT)
    lag = np.zeros(3000)
    for k in range(3000):
        before = lag[k - 1] if k else 0.0
        lag[k] = before + (1 - np.exp(-2 * np.pi * 2.0 * DT)) * (slow.torque_nm[k] - before)
    assert slow.measured_nm == pytest.approx(lag, abs=1e-12)


def test_a_delay_moves_the_duty_and_resolution_rounds_it(plant, law):
    reference = references.multisine(DT, 2.0).torque_nm
    late = replay(plant, law("rc"), reference, Rig(delay_samples=3), DT)
    assert late.applied_pct[:3].tolist() == [0.0, 0.0, 0.0]
    assert np.array_equal(late.applied_pct[3:], late.duty_pct[:-3])
    coarse = replay(plant, law("rc"), reference, Rig(duty_bits=8), DT)
    counts = coarse.duty_pct * 255 / 100
    assert counts == pytest.approx(np.round(counts), abs=1e-9)
    assert len(np.unique(np.round(counts))) > 20


def test_without_saturation_the_duty_leaves_its_range(plant, law):
    reference = np.full(100, 4.0)
    assert replay(plant, law("rc"), reference, Rig(), DT).duty_pct.max() == 100.0
    assert replay(plant, law("rc"), reference, Rig(saturation=False), DT).duty_pct.max() > 200.0


def test_the_pwm_latches_once_a_period_and_the_plant_is_exact_between(plant):
    """Against a fine grid of a microsecond on which 300 Hz falls within rounding."""

    def ramp(_gains, state, _reference, _rate, _torque, _dt):
        return (state[0] + 1.0,), min(0.9 * state[0], 100.0)

    gains = PIGains(0.0, 0.0)
    done = replay(plant, Controller("ramp", ramp, gains, (0.0,)), np.zeros(60), Rig(pwm_hz=300.0), DT)
    latches = np.ceil(np.arange(0, 18) / 300 / DT - 1e-9)
    x1 = x2 = 0.0
    torque = [0.0]
    duty = 0.0
    boundary = 0
    for fine in range(60_000):
        if boundary < 18 and fine >= boundary / 300 * 1e6 - 0.5:
            duty = 0.9 * (fine // 1000)
            boundary += 1
        x1, x2 = plant_step(plant, x1, x2, duty, 1e-6)
        if fine % 1000 == 999:
            torque.append(x1 + x2)
    assert done.torque_nm == pytest.approx(np.array(torque[:60]), abs=1e-6)
    assert len(np.unique(done.applied_pct[latches[latches < 60].astype(int)])) == 18


def test_latching_at_the_control_rate_changes_nothing(plant, law):
    reference = references.multisine(DT, 2.0).torque_nm
    plain = replay(plant, law("rc"), reference, Rig(), DT)
    latched = replay(plant, law("rc"), reference, Rig(pwm_hz=1000.0), DT)
    assert np.array_equal(plain.torque_nm, latched.torque_nm)


def test_the_duty_acts_until_the_next_sample(plant):
    done = replay(plant, pi_controller(PIGains(21.0, 360.0)), np.full(3, 1.0), Rig(), DT)
    x1, x2 = plant_step(plant, 0.0, 0.0, done.duty_pct[0], DT)
    assert done.torque_nm[0] == 0.0 and done.torque_nm[1] == x1 + x2
    assert done.duty_pct[0] == 21.0
    assert done.duty_pct[1] == pytest.approx(21.0 * (1 - x1 - x2) + 360 * 1e-3)


def test_reference_rates():
    values = np.array([0.0, 1.0, 4.0, 9.0])
    assert reference_rate(values, 0.5, False).tolist() == [2.0, 4.0, 8.0, 10.0]
    assert reference_rate(values, 0.5, True).tolist() == [2.0, 6.0, 10.0, 0.0]


def test_references_that_cannot_be_followed_are_refused(plant, law):
    with pytest.raises(UsageError, match="two samples or more"):
        replay(plant, law("pi"), np.array([1.0]), Rig(), DT)
    with pytest.raises(UsageError, match="finite"):
        replay(plant, law("pi"), np.array([1.0, np.nan]), Rig(), DT)


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"noise_nm": -1.0}, "noise_nm= -1: give"),
        ({"delay_samples": -1}, "delay_samples= -1: give"),
        ({"duty_bits": 40}, "duty_bits= 40: give"),
        ({"pwm_hz": float("nan")}, "pwm_hz= nan: give"),
        ({"noise_coloured_share": 2.0}, "noise_coloured_share= 2: give"),
    ],
)
def test_a_rig_that_cannot_be_is_refused(settings, said):
    with pytest.raises(UsageError, match=said):
        Rig(**settings)
