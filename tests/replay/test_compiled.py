"""Machine code and plain Python are one law: equal to each other, and to a long-double loop, to 1e-12."""

import _thread
import dataclasses
import time

import numpy as np
import pytest

from eaid.models.parameters import REFERENCE_PLANT
from eaid.replay import compiled, lanes, references
from eaid.replay.controllers import CONTROLLERS
from eaid.replay.loop import inputs_of, reference_rate, replay
from eaid.replay.many import replay_many
from eaid.replay.plant import plant_parameters
from eaid.replay.rig import Rig, rig_numbers

DT = 1e-3
REFERENCE = references.multisine(DT, 3.0).torque_nm
EVERYTHING = Rig(
    noise_nm=0.02, noise_correlation_s=0.05, noise_coloured_share=0.5, ripple_pct=2.0, ripple_hz=3.0, sensor_hz=80.0,
    delay_samples=2, pwm_hz=300.0, duty_bits=8,
)  # fmt: skip


def drawn(count: int) -> list:
    random = np.random.default_rng(8)
    plants = []
    for _ in range(count):
        a, b, c = 1 + 0.05 * random.standard_normal(3)
        plants.append(
            plant_parameters(
                dataclasses.replace(
                    REFERENCE_PLANT,
                    tau1=tuple(a * v for v in REFERENCE_PLANT.tau1),
                    tau2=tuple(b * v for v in REFERENCE_PLANT.tau2),
                    Ts=tuple(c * v for v in REFERENCE_PLANT.Ts),
                )
            )
        )
    return plants


def gathered(plants, controller, rig, threads=None, seed=3):
    torque, duty = (np.empty((len(plants), len(REFERENCE))) for _ in range(2))

    def visit(first, torques, duties):
        torque[first : first + torques.shape[1]] = torques.T
        duty[first : first + torques.shape[1]] = duties.T

    replay_many(plants, controller, REFERENCE, rig, DT, visit, seed, threads)
    return torque, duty


def long_double(plant, gains) -> np.ndarray:
    """The robust loop written again, in 64-bit mantissas."""
    L = np.longdouble
    p, g, dt = [L(v) for v in plant], gains, L(DT)
    rate = reference_rate(np.array(REFERENCE), DT, False)
    x1 = x2 = q = L(0)
    torque = []
    for r, v in zip(REFERENCE, rate, strict=True):
        T = x1 + x2
        torque.append(T)
        e = L(r) - T
        z = g.Q12 * q + g.Q22 * e
        rho = g.rho_constant + g.rho_slope * np.sqrt(q * q + e * e)
        S = (np.tanh(L(g.gamma) * (abs(z) - L(g.epsilon))) + 1) / 2
        S = L(0) if S < 1e-17 else S
        omega = S * np.copysign(rho, z) + (1 - S) * rho * z / L(g.epsilon)
        wanted = L(g.B_hat) * (L(v) + L(g.K_D) * e + L(g.K_P) * q + omega) + (L(g.a0) * T - L(g.c0)) / L(g.b0)
        u = min(max(wanted, L(0)), L(100))
        if not (wanted - u) * e > 0:
            q = q + dt * e
        share = u / p[11] if u < p[11] else L(1)
        u = max(u, p[11])
        t1, t2 = p[1] + u * (p[2] + u * p[3]), p[4] + u * (p[5] + u * p[6])
        s = share * (p[7] + u * (p[8] + u * (p[9] + u * p[10])))
        x1 = x1 - np.expm1(-dt / t1) * (p[0] * s - x1)
        x2 = x2 - np.expm1(-dt / t2) * (s - p[0] * s - x2)
    return np.array(torque, dtype=np.longdouble)


@pytest.mark.skipif(np.finfo(np.longdouble).eps > 1e-18, reason="this machine's long double is no longer than a double")
def test_all_three_forms_equal_a_long_double_loop(law):
    plants = drawn(3)
    many, _ = gathered(plants, law("rc"), Rig())
    for i, plant in enumerate(plants):
        exact = long_double(plant, law("rc").gains)
        assert float(np.abs(many[i] - exact).max()) < 1e-12
        assert float(np.abs(replay(plant, law("rc"), REFERENCE, Rig(), DT).torque_nm - exact).max()) < 1e-12


@pytest.mark.parametrize("rig", [Rig(), EVERYTHING], ids=["bare", "everything"])
@pytest.mark.parametrize("name", CONTROLLERS)
def test_every_controller_is_the_same_in_machine_code(law, plant, name, rig):
    controller = law(name)
    plain = replay(plant, controller, REFERENCE, rig, DT, 3)
    n = len(REFERENCE)
    torque, _, duty, *_ = filled = tuple(np.empty((6, n)))
    gains = controller.gains._make(float(v) if isinstance(v, int) else v for v in controller.gains)
    compiled.loop_alone(controller.step)(
        gains, controller.start, plant, rig_numbers(rig, DT), DT,
        inputs_of(controller, np.array(REFERENCE), rig, DT, 3), filled,
    )  # fmt: skip
    if (
        rig.duty_bits
    ):  # a last bit may round a duty to the next step: only the first second is compared sample by sample
        assert np.abs(duty - plain.duty_pct).max() < 101 / 255
    else:
        assert np.abs(torque - plain.torque_nm).max() < 1e-12
        assert np.abs(duty - plain.duty_pct).max() < 1e-9


@pytest.mark.parametrize("name", ["rc", "pi", "open-loop"])
def test_sixteen_plants_at_once_are_sixteen_plants_alone(law, name):
    plants = drawn(19)
    rig = Rig(noise_nm=0.02, ripple_pct=2.0, ripple_hz=3.0, sensor_hz=80.0)
    assert compiled.fits_lanes(law(name), plants, rig_numbers(rig, DT), DT)
    torque, duty = gathered(plants, law(name), rig)
    for i in (0, 7, 15, 16, 18):
        alone = replay(plants[i], law(name), REFERENCE, rig, DT, 3)
        assert np.abs(torque[i] - alone.torque_nm).max() < 1e-12
        assert np.abs(duty[i] - alone.duty_pct).max() < 1e-9


@pytest.mark.parametrize("rig", [Rig(noise_nm=0.02, pwm_hz=300.0), Rig(delay_samples=3, sensor_hz=80.0)])
def test_plants_behind_a_latch_or_a_delay_are_the_same_alone_and_among_many(law, rig):
    plants = drawn(18)
    torque, duty = gathered(plants, law("pi"), rig)
    for i in (0, 15, 16, 17):
        alone = replay(plants[i], law("pi"), REFERENCE, rig, DT, 3)
        assert np.abs(torque[i] - alone.torque_nm).max() < 1e-12
        assert np.abs(duty[i] - alone.duty_pct).max() < 1e-9


def test_falls_have_their_release_constants_in_the_lanes(law):
    plants = [
        plant_parameters(
            dataclasses.replace(REFERENCE_PLANT, release=(0.3 + 0.1 * k, 4.0 + k), falls_as_release=k % 2 == 1)
        )
        for k in range(4)
    ]
    reference = np.repeat([3.0, 1.0, 0.0], 700)
    torque = np.empty((4, len(reference)))
    replay_many(plants, law("pi"), reference, Rig(), DT, lambda i, t, _u: torque.__setitem__(slice(i, i + 4), t.T))
    for k in range(4):
        alone = replay(plants[k], law("pi"), reference, Rig(), DT)
        assert np.abs(torque[k] - alone.torque_nm).max() < 1e-12
    assert np.ptp(torque[:, -1]) > 0.05


def test_the_soft_switch_is_reached_in_the_lanes(law):
    """The rare tanh is really needed on this reference; else the lanes' second try would go untested."""
    done = replay(drawn(1)[0], law("rc"), REFERENCE, Rig(noise_nm=0.02), DT, 3)
    gains = law("rc").gains
    distance = gains.gamma * (gains.Q22 * np.abs(done.reference_nm - done.measured_nm) - gains.epsilon)
    assert (np.abs(distance) < 15).sum() > 20


def test_one_thread_and_many_give_the_same_bytes(law):
    plants = drawn(50)
    one, many = (gathered(plants, law("rc"), Rig(noise_nm=0.01), threads) for threads in (1, 4))
    assert one[0].tobytes() == many[0].tobytes() and one[1].tobytes() == many[1].tobytes()


@pytest.mark.parametrize(("wrong", "seen_as"), [("a block fails", ValueError), ("Ctrl-C", KeyboardInterrupt)])
def test_a_block_that_fails_ends_the_work_of_all_threads_and_is_told(law, wrong, seen_as):
    seen = []

    def visit(first, _torques, _duties):
        if first == 32:
            if seen_as is ValueError:
                raise ValueError
            _thread.interrupt_main()
        seen.append(first)
        time.sleep(0.005)

    with pytest.raises(seen_as):
        replay_many(drawn(50) * 40, law("rc"), REFERENCE[:10], Rig(), DT, visit, 0, 2)
    assert 1 <= len(seen) < 120, wrong  # of 125


def test_no_plants_are_no_work(law):
    replay_many([], law("rc"), REFERENCE[:10], Rig(), DT, lambda *_: pytest.fail("nothing to see"))


@pytest.mark.parametrize(
    ("name", "rig", "dt"),
    [("inverse", Rig(), DT), ("rc", Rig(delay_samples=1), DT), ("rc", Rig(pwm_hz=300), DT), ("rc", Rig(), 0.01)],
)
def test_what_does_not_fit_the_lanes_goes_one_by_one(law, plant, name, rig, dt):
    assert not compiled.fits_lanes(law(name), [plant], rig_numbers(rig, dt), dt)


def test_the_polynomial_is_good_to_the_last_bit():
    y = -np.concatenate([np.linspace(0, 1, 20_001), np.geomspace(1e-12, 1, 2001)])
    ours = np.array([lanes.expm1_to_minus_one(v) for v in y])
    assert np.abs(ours / np.where(y == 0, 1, np.expm1(y)) - (y != 0)).max() < 5e-16


def test_tanh_without_a_call_is_good_to_the_last_digits():
    x = np.concatenate([np.linspace(-32, 32, 20_001), np.geomspace(1e-12, 1, 2001)])
    ours = np.array([lanes.tanh_within(v) for v in x])
    assert np.abs(ours - np.tanh(x)).max() < 1e-14
