"""The whole rig written again: absolute instants, matrix exponentials, a controller of its own; and metrics by hand."""

import math
from fractions import Fraction

import numpy as np
import pytest
from scipy.linalg import expm

from eaid.control.pi import PIGains
from eaid.control.rc import RCState, rc_step
from eaid.models.parameters import REFERENCE_PLANT
from eaid.replay import metrics, references
from eaid.replay.controllers import pi_controller, rc_controller
from eaid.replay.loop import replay
from eaid.replay.plant import plant_parameters
from eaid.replay.rehab import box
from eaid.replay.rig import Rig, noise, ripple

DT = 1e-3


def held(duty: float, seconds: float, x: np.ndarray) -> np.ndarray:
    """Both parts after a held duty, by the exponential of the system's matrix with its input as a third state."""
    p, u = REFERENCE_PLANT, max(duty, 10.0)
    tau1, tau2, steady = (sum(c * u**k for k, c in enumerate(part)) for part in (p.tau1, p.tau2, p.Ts))
    steady *= min(duty / 10.0, 1.0)
    system = np.array([[-1 / tau1, 0, p.C * steady / tau1], [0, -1 / tau2, (1 - p.C) * steady / tau2], [0, 0, 0]])
    return (expm(system * seconds) @ np.append(x, 1.0))[:2]


class PI:
    """u = K_P e + K_I ∫ e, kept within its limits, the integral led back by the duty that was lost."""

    def __init__(self, K_P: float, K_I: float, back: float) -> None:
        self.K_P, self.K_I, self.back, self.integral = K_P, K_I, back, 0.0

    def __call__(self, error: float) -> float:
        wanted = self.K_P * error + self.K_I * self.integral
        duty = float(np.clip(wanted, 0.0, 100.0))
        stands = self.back == 0.0 and (wanted - duty) * error > 0
        self.integral += 0.0 if stands else DT * (error + self.back * (duty - wanted))
        return duty


def second_way(law: PI, reference: np.ndarray, rig: Rig, added: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """True torque and duty given at each sample: events on one absolute clock, in fractions of a second."""
    x, acting, given, torque = np.zeros(2), 0.0, [], []
    h = Fraction(1, 1000)
    seen = 0.0
    pulses = (Fraction(j) / Fraction(round(rig.pwm_hz)) for j in range(10**6)) if rig.pwm_hz else None
    pulse = next(pulses) if pulses else None
    for k, wanted in enumerate(reference):
        now, end = k * h, (k + 1) * h
        wave = 1 + rig.ripple_pct / 100 * math.sin(2 * math.pi * rig.ripple_hz * float(now))
        torque.append(float(x.sum()) * wave)
        if rig.sensor_hz:  # the low-pass of the sensor, exact for a torque that is held over the sample before
            seen += (1 - math.exp(-2 * math.pi * rig.sensor_hz * DT)) * (torque[-1] - seen)
        else:
            seen = torque[-1]
        duty = law(wanted - seen - added[k])
        if rig.duty_bits:
            counts = 2**rig.duty_bits - 1
            duty = math.floor(duty / 100 * counts + 0.5) / counts * 100
        given.append(duty)
        ready = given[k - rig.delay_samples] if k >= rig.delay_samples else 0.0
        if pulse is None:
            x = held(ready, DT, x)
            continue
        while pulse < end:
            x, now, acting = held(acting, float(pulse - now), x), pulse, ready
            pulse = next(pulses)
        x = held(acting, float(end - now), x)
    return np.array(torque), np.array(given)


EFFECTS = {
    "bare": Rig(),
    "noise": Rig(noise_nm=0.03),
    "coloured noise": Rig(noise_nm=0.03, noise_correlation_s=0.02, noise_coloured_share=0.6),
    "ripple": Rig(ripple_pct=4.0, ripple_hz=7.0),
    "sensor": Rig(sensor_hz=15.0),
    "delay": Rig(delay_samples=5),
    "quantiser": Rig(duty_bits=6),
    "latch": Rig(pwm_hz=300.0),
    "fast latch": Rig(pwm_hz=1700.0),
    "all": Rig(
        noise_nm=0.02, ripple_pct=2.0, ripple_hz=7.0, sensor_hz=40.0, delay_samples=2, pwm_hz=300.0, duty_bits=8
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("back", [0.0, 1 / 21])
@pytest.mark.parametrize("name", EFFECTS)
def test_every_effect_of_the_rig_is_what_a_second_way_gives(name: str, back: float) -> None:
    rig, n = EFFECTS[name], 700
    reference = references.steps(DT, n * DT, levels_nm=(4.0, 0.5, 2.0)).torque_nm[:n]
    controller = pi_controller(PIGains(21.0, 360.0, back_calculation=back))
    done = replay(plant_parameters(REFERENCE_PLANT), controller, reference, rig, DT, 11)
    torque, duty = second_way(PI(21.0, 360.0, back), np.asarray(reference), rig, noise(rig, len(reference), DT, 11))
    assert np.abs(done.torque_nm - torque).max() < 1e-10
    assert np.abs(done.duty_pct - duty).max() < 1e-7
    assert np.ptp(done.duty_pct) > 50  # the loop was at work, and at its limits
    assert ripple(rig, 3, DT)[0] == 1.0


def test_back_calculation_of_the_robust_controller_is_its_formula(law) -> None:
    """q̃_{k+1} = q̃_k + dt (e + k (u − u_unlimited)), u_unlimited from the same gains without limits."""
    gains = law("rc").gains._replace(back_calculation=0.004)
    free = gains._replace(duty_min=-1e9, duty_max=1e9)
    reference = references.steps(DT, 0.8, levels_nm=(4.0, 0.2)).torque_nm
    done = replay(plant_parameters(REFERENCE_PLANT), rc_controller(gains), reference, Rig(), DT)
    rate = np.gradient(reference, DT)
    at_limit = 0
    for k in range(len(reference) - 1):
        wanted = rc_step(free, RCState(done.state[k]), reference[k], rate[k], done.torque_nm[k], DT)[1]
        at_limit += not 0 <= wanted <= 100
        led = DT * (reference[k] - done.torque_nm[k] + 0.004 * (done.duty_pct[k] - wanted))
        assert done.state[k + 1] == pytest.approx(done.state[k] + led, abs=1e-12)
    assert at_limit > 50


def test_settling_is_the_time_of_the_first_sample_that_stays() -> None:
    torque = np.array([0.0, 0.5, 0.97, 1.03, 0.979, 0.981, 1.0, 1.019, 1.0])  # from index 5 on within 2 %
    found = metrics.step(torque, 0.0, 1.0, 0.1)
    assert found.settling_s == pytest.approx(0.5, abs=1e-12)
    assert found.settling_5pct_s == pytest.approx(0.2, abs=1e-12)
    assert found.rise_time_s == pytest.approx((1 + 0.4 / 0.47 - 0.2) * 0.1, abs=1e-12)
    assert found.overshoot_pct == pytest.approx(3.0)


def test_a_box_has_the_sd_of_a_sample_and_whiskers_at_just_one_and_a_half() -> None:
    values = np.array([2.0, 3.0, 4.0, 5.0, 6.0])  # quartiles 3 and 5: whiskers reach from 0 to 8
    assert box(values).sd == pytest.approx(math.sqrt(2.5), rel=1e-15)
    far = np.array([0.0, 3.0, 3.0, 4.0, 5.0, 5.0, 8.0])
    assert (box(far).whisker_low, box(far).whisker_high, box(far).outliers) == (0.0, 8.0, 0)
    beyond = np.array([-0.01, 3.0, 3.0, 4.0, 5.0, 5.0, 8.01])
    assert (box(beyond).whisker_low, box(beyond).whisker_high, box(beyond).outliers) == (3.0, 5.0, 2)
