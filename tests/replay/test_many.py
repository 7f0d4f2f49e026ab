"""Machine code and plain Python are one law: equal to each other, and to a long-double loop, to 1e-12."""

import _thread
import dataclasses
import time

import numpy as np
import pytest

from eaid.models.parameters import REFERENCE_PLANT
from eaid.replay import references
from eaid.replay.controllers import CONTROLLERS
from eaid.replay.loop import reference_rate, replay
from eaid.replay.many import replay_many
from eaid.replay.plant import plant_parameters
from eaid.replay.rig import Rig

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


def gathered(plants, controller, rig, threads=None, reference=REFERENCE):
    torque, duty = (np.empty((len(plants), len(reference))) for _ in range(2))

    def visit(index, *columns):
        torque[index], duty[index] = columns

    replay_many(plants, controller, reference, rig, DT, visit, 3, threads)
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
def test_both_forms_equal_a_long_double_loop(law):
    plants = drawn(3)
    many, _ = gathered(plants, law("rc"), Rig())
    for i, plant in enumerate(plants):
        exact = long_double(plant, law("rc").gains)
        assert float(np.abs(many[i] - exact).max()) < 1e-12
        assert float(np.abs(replay(plant, law("rc"), REFERENCE, Rig(), DT).torque_nm - exact).max()) < 1e-12


@pytest.mark.parametrize("rig", [Rig(noise_nm=0.02), EVERYTHING], ids=["noise", "everything"])
@pytest.mark.parametrize("name", CONTROLLERS)
def test_many_plants_are_each_plant_alone_under_every_controller(law, name, rig):
    """On a reference that needs the soft switch of the robust law, tanh, and falls with constants of their own."""
    released = dataclasses.replace(REFERENCE_PLANT, release=(0.3, 4.0))
    plants = [*drawn(2), *(plant_parameters(dataclasses.replace(released, falls_as_release=f)) for f in (True, False))]
    reference = np.concatenate([REFERENCE, np.repeat([1.0, 0.0], 500)])
    torque, duty = gathered(plants, law(name), rig, None, reference)
    for i, plant in enumerate(plants):
        alone = replay(plant, law(name), reference, rig, DT, 3)
        assert np.abs(torque[i] - alone.torque_nm).max() < 1e-12
        assert np.abs(duty[i] - alone.duty_pct).max() < 1e-9


def test_one_thread_and_many_give_the_same_bytes(law):
    plants = drawn(50)
    one, many = (gathered(plants, law("rc"), Rig(noise_nm=0.01), threads) for threads in (1, 4))
    assert one[0].tobytes() == many[0].tobytes() and one[1].tobytes() == many[1].tobytes()


@pytest.mark.parametrize("seen_as", [ValueError, KeyboardInterrupt])
def test_a_plant_that_fails_ends_the_work_of_all_threads_and_is_told(law, seen_as):
    seen = []

    def visit(index, _torque, _duty):
        if index == 3:
            if seen_as is ValueError:
                raise ValueError
            _thread.interrupt_main()
        seen.append(index)
        time.sleep(0.005)

    with pytest.raises(seen_as):
        replay_many(drawn(1) * 125, law("rc"), REFERENCE[:10], Rig(), DT, visit, 0, 2)
    assert 1 <= len(seen) < 120
