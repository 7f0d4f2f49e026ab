"""How stiff a wall: closed forms, published check values, python-control as a second way, replays, random limbs."""

import dataclasses
import math

import control
import msgspec
import numpy as np
import pytest

import eaid
from eaid.control.gains import paper_gains
from eaid.control.margins import Timing
from eaid.control.pi import PIGains
from eaid.coupling.couple import couple
from eaid.coupling.stiffness import (
    Channel,
    Coupled,
    Law,
    Limb,
    Point,
    linearised,
    needed_damping,
    operating_point,
    passive_stiffness,
    stable_stiffness,
    step_of,
)
from eaid.errors import DataError, GainsError, UsageError
from eaid.models.parameters import REFERENCE_PLANT
from eaid.options import LOOPS, CoupleOptions
from eaid.results.fit import StepShape

RC, PI = paper_gains()
LIMB, TIMING = Limb(0.1, 0.8), Timing()


def channel(loop: str, torque: float, timing: Timing = TIMING) -> Channel:
    point = operating_point(REFERENCE_PLANT, torque)
    return Channel(point, linearised(*step_of(loop, REFERENCE_PLANT, point, RC, PI, timing.step_s), point))


def lag(tau: float, step_s: float = 1e-3) -> Channel:
    """A first-order lag τ of unit gain, fed with the reference as it is; both lags of the plant alike."""
    nothing = np.empty((0, 0)), np.empty((0, 3)), np.empty(0)
    return Channel(Point(1.0, 50.0, ((0.5, tau), (0.5, tau))), Law(*nothing, np.array([1.0, 0.0, 0.0])))


PASSIVE = [
    (1, "open-loop", 0.300), (1, "pi", 1.946), (1, "rc-no-rate", 11.17), (1, "rc", 11.9),
    (2, "open-loop", 0.263), (2, "pi", 2.385), (2, "rc-no-rate", 18.5),
    (3, "open-loop", 0.270), (3, "pi", 3.403), (3, "rc-no-rate", 29.3),
]  # fmt: skip
STABLE = [
    (1, "open-loop", 8.82), (1, "pi", 1.947), (1, "rc-no-rate", 18.5),
    (2, "open-loop", 8.84), (2, "pi", 2.410), (2, "rc-no-rate", 24.1),
    (3, "open-loop", 9.22), (3, "pi", 3.468), (3, "rc-no-rate", 34.5),
]  # fmt: skip
"""Of an independent continuous analysis (reference plant, published gains)."""


@pytest.mark.parametrize(("torque", "loop", "expected"), PASSIVE)
def test_passive_walls_are_those_of_an_independent_analysis(torque: float, loop: str, expected: float):
    found, _ = passive_stiffness(needed_damping([channel(loop, torque)], TIMING), LIMB.damping_nms)
    assert found == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize(("torque", "loop", "expected"), STABLE)
def test_stable_walls_are_those_of_an_independent_analysis(torque: float, loop: str, expected: float):
    assert stable_stiffness(Coupled([channel(loop, torque)], LIMB, TIMING)) == pytest.approx(expected, rel=0.02)


@pytest.mark.slow
def test_replays_agree_with_linear_theory_and_with_an_independent_replay():
    found = couple(REFERENCE_PLANT, RC, PI, CoupleOptions(torque=(1.0,), loops=("open-loop", "pi", "rc-no-rate", "rc")))
    replayed = {wall.loop: wall.K_replayed for wall in found.walls}
    for loop, expected in (("open-loop", 8.79), ("pi", 1.93), ("rc-no-rate", 18.4)):
        assert replayed[loop] == pytest.approx(expected, rel=0.05)
    # The reference rate's wall rests on fractions of a sample: 185 in another replay, 170 by the exact sampled loop.
    assert 160 < (replayed["rc"] or 0) < 200


def test_one_sample_of_delay_costs_a_quarter_of_the_wall_that_rests_on_the_reference_rate():
    late = Timing(delay_samples=1)
    for loop, least, most in (("rc", 0.6, 0.8), ("rc-no-rate", 0.97, 1.0)):
        walls = [stable_stiffness(Coupled([channel(loop, 1.0, timing)], LIMB, timing)) for timing in (TIMING, late)]
        assert least < walls[1] / walls[0] < most


@pytest.mark.parametrize("tau", [0.01, 0.1, 1.0])
def test_a_first_order_lag_leaves_b_over_tau(tau: float):
    """The closed form is b/τ; sampling takes half a step, b/(τ + h/2), from it."""
    found, _ = passive_stiffness(needed_damping([lag(tau)], TIMING), 0.8)
    assert found == pytest.approx(0.8 / (tau + 0.5e-3), rel=2e-3)


def test_colgate_and_schenkel():
    """No lag at all: b > K h/2, and with a virtual damping b > K h/2 + B_v; the bare hold's aliases end slowly."""
    fast = needed_damping([lag(1e-7)], TIMING)
    found, omega = passive_stiffness(fast, 0.8)
    assert found == pytest.approx(2 * 0.8 / 1e-3, rel=0.01)
    found, omega = passive_stiffness(fast, 0.8, virtual_damping=0.3)
    assert found == pytest.approx(2 * (0.8 - 0.3) / 1e-3, rel=0.03)
    assert omega > 0.9 * math.pi / 1e-3  # at the Nyquist frequency
    assert passive_stiffness(fast, 0.8, virtual_damping=0.81)[0] == 0.0


@pytest.mark.parametrize("delay", [1, 5, 20])
def test_a_pure_delay_costs_its_time(delay: int):
    late = Timing(delay_samples=delay)
    found, _ = passive_stiffness(needed_damping([lag(1e-7)], late), 0.8)
    assert found == pytest.approx(0.8 / ((delay + 0.5) * 1e-3), rel=0.02)


@pytest.mark.parametrize("loop", ["open-loop", "pi", "rc-no-rate"])
def test_python_control_finds_the_same_sampled_loop(loop: str):
    """G by python-control (zero-order hold, feedback of the linearised law) at the loop's samples."""
    h = TIMING.step_s
    one = channel(loop, 2.0)
    plant = sum(control.c2d(control.tf([g], [tau, 1]), h, "zoh") for g, tau in one.point.lags)
    law = one.law
    omega = np.geomspace(0.1, 60, 40)
    z = np.exp(1j * omega * h)
    ways = [
        control.ss(law.A, law.B[:, [i]], law.c[None], law.d[[i]][None], h)(z) if len(law.A) else law.d[i]
        for i in (0, 2)
    ]
    expected = ways[0] * plant(z) / (1 - ways[1] * plant(z))
    needed = needed_damping([one], TIMING)
    real, imaginary = (np.interp(omega, needed.omega, part) for part in (needed.response.real, needed.response.imag))
    # What the limb feels between the samples differs from what is seen at them by the aliases alone: ωh/2 at most.
    assert np.abs(real + 1j * imaginary - expected).max() < 0.01 * np.abs(expected).max()


@pytest.mark.slow
@pytest.mark.parametrize("loop", LOOPS[:4])
def test_no_limb_is_unstable_inside_the_passive_region(loop: str):
    """1,000 random limbs of at least the damping that the wall asks for."""
    random = np.random.default_rng(LOOPS.index(loop))
    one = channel(loop, 2.0)
    needed = needed_damping([one], TIMING)
    for _ in range(250):
        damping = 10 ** random.uniform(-1, 1)
        virtual = random.uniform(0, 0.3) * damping
        passive, _ = passive_stiffness(needed, damping, virtual)
        limb = Limb(10 ** random.uniform(-3, 1), damping * random.uniform(1, 3))
        assert passive == 0 or Coupled([one], limb, TIMING).is_stable(
            random.uniform(0.05, 0.999) * min(passive, 1e5), virtual
        )


def test_latch_delay_and_sensor_cost_stiffness():
    plain = stable_stiffness(Coupled([channel("pi", 2.0)], LIMB, TIMING))
    for timing in (Timing(pwm_hz=300.0), Timing(delay_samples=10), Timing(sensor_hz=5.0)):
        assert stable_stiffness(Coupled([channel("pi", 2.0, timing)], LIMB, timing)) < plain


def test_a_pair_is_worked_out_beside_the_single_clutch():
    found = couple(REFERENCE_PLANT, RC, PI, CoupleOptions(torque=(1.0, 4.0), replay=False, pair_bias_nm=1.5))
    assert {wall.torque_nm for wall in found.pair} == {1.0}
    assert "pair-bias-cut" in {one.code for one in found.findings}


@pytest.mark.slow
def test_a_wall_that_cannot_be_held_is_told():
    found = couple(REFERENCE_PLANT, RC, PI, CoupleOptions(torque=(1.0, 2.0), wall=3.0, replay=False))
    told = {(one.subject, one.values["torque_nm"]) for one in found.findings if one.code == "wall-beyond-stable"}
    assert told == {("pi", 1.0), ("pi", 2.0)}


def test_what_ninety_five_in_a_hundred_keep_is_less_than_what_the_fit_keeps():
    plants = [REFERENCE_PLANT] * 30
    found = couple(REFERENCE_PLANT, RC, PI, CoupleOptions(torque=(2.0,), loops=("pi",), replay=False), drawn=plants)
    (kept,), (wall,) = found.kept, found.walls
    assert kept.K_passive_95 is not None
    assert wall.K_passive is not None
    assert 0.65 * wall.K_passive < kept.K_passive_95 < wall.K_passive


@pytest.mark.parametrize(
    "options",
    [{"torque": (9.0,)}, {"torque": (0.01,)}, {"limb_damping": 0.0}, {"limb_inertia": -1.0}, {"wall": 0.0},
     {"loops": ("pid",)}, {"pwm_hz": math.nan}, {"delay_samples": -1}, {"plants": 10**9}, {"pair_bias_nm": 99.0}],
)  # fmt: skip
def test_what_means_nothing_is_refused(options: dict):
    with pytest.raises(UsageError):
        couple(REFERENCE_PLANT, RC, PI, CoupleOptions(**{"replay": False, "torque": (1.0,), **options}))


def test_an_unstable_loop_is_refused():
    with pytest.raises(GainsError, match="unstable at 2 without any wall"):
        couple(REFERENCE_PLANT, None, PIGains(1e6, 1e6), CoupleOptions(torque=(2.0,), loops=("pi",), replay=False))


@pytest.mark.slow
def test_a_dead_time_that_the_steps_show_counts_as_delay():
    fit = eaid.fit(eaid.synth(levels=(10.0, 40.0, 70.0, 100.0), repeats=2, rate_hz=50.0, clean=True))
    rise = StepShape("a", 0.0, 10.0, "up", 0.0, 1.0, 0.1, "one", 1.0, None, 1.0, 0.02, 0.0, 99.0, 1.0, 9)
    asked = {"loops": ("inverse",), "torque": (1.0,), "replay": False}
    late = eaid.couple(msgspec.structs.replace(fit, steps=(rise,)), **asked)
    assert late.options.delay_samples == 20
    assert late.walls == eaid.couple(fit, **asked, delay_samples=20).walls != eaid.couple(fit, **asked).walls
    with pytest.raises(DataError, match="150 samples; walls are worked out for 100 at most"):
        eaid.couple(msgspec.structs.replace(fit, steps=(msgspec.structs.replace(rise, dead_time_s=0.15),)), **asked)


@pytest.mark.slow
def test_walls_do_not_depend_on_the_unit_of_the_input():
    """The reference plant driven by 0 … 300 V in place of 0 … 100 %: the same torque, the same walls."""
    p = REFERENCE_PLANT

    def stretched(coefficients: tuple[float, ...]) -> tuple[float, ...]:
        return tuple(c / 3.0**k for k, c in enumerate(coefficients))

    volts = dataclasses.replace(
        p,
        tau1=stretched(p.tau1),
        tau2=stretched(p.tau2),
        Ts=stretched(p.Ts),
        u_range=(3 * p.u_range[0], 3 * p.u_range[1]),
    )
    options = CoupleOptions(torque=(1.0, 3.0), loops=("open-loop", "inverse"), replay=False)
    for wall, same in zip(couple(p, None, None, options).walls, couple(volts, None, None, options).walls, strict=True):
        assert same.duty == pytest.approx(3 * wall.duty)
        assert (same.K_passive, same.K_stable) == pytest.approx((wall.K_passive, wall.K_stable), rel=1e-5)
