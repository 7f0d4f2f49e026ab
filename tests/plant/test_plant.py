"""The one plant against closed forms worked by hand, python-control, SciPy's matrix exponential, and differences."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

from eaid.plant import derivatives as kernel
from eaid.plant.drive import Drive, Tables, delayed
from eaid.plant.dynamics import REFERENCE_PLANT, Plant, Step, plant_numbers, plant_step, swing
from eaid.plant.operating import around
from eaid.plant.respond import respond, unit_step
from eaid.plant.steps import step_response


def plant(**of: float) -> Plant:
    """A plant with T_s(u) = u."""
    tau1, tau2 = of.pop("tau1", 0.5), of.pop("tau2", 8.0)
    return Plant((tau1,), (tau2,), (0.0, 1.0), (0.0, 1.0), floor_s=0.0, **of)  # type: ignore[arg-type]


SQUARE = np.array([0.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0])
GRID = np.arange(8.0)


@pytest.mark.parametrize(
    ("one", "at", "expected"),
    [
        (plant(), 1.0, 0.752590474),
        (plant(tau1=1.0, zeta=1.25, C=1.0), 1.0, 0.236404215),  # τ 0.5 and 2: ω = 1, ζ = 1.25
        (plant(tau1=0.25, zeta=0.3), 1.0, 1.294430843),
        (plant(tau1=0.2, tau2=1.0, C=1.6), 0.647566791, 1.251192433),
        (plant(tau1=0.1, C=1.0, dead_time_s=0.037), 0.04, 0.029554466),
    ],
)
def test_responses_worked_by_hand(one: Plant, at: float, expected: float) -> None:
    assert respond(one, [-1.0, 0.0], [0.0, 1.0], np.array([0.0, at]))[1] == pytest.approx(expected, abs=1e-9)


def test_the_tail_of_a_step_is_carried() -> None:
    found = respond(plant(), [0.0, 1.0], [1.0, 0.4], np.array([0.0, 2.0]))
    assert found[1] == pytest.approx(0.416057305, abs=1e-9)


@pytest.mark.parametrize(
    ("one", "expected"),
    [
        (
            plant(tau1=2.0, C=1.0, dead_time_s=0.5),
            [0, 0, 0.22119922, 0.52763345, 0.7134952, 0.60502684, 0.36696733, 0.22257694],
        ),
        (
            plant(tau1=1.0, zeta=0.5, dead_time_s=0.25),
            [0, 0, 0.21267012, 0.73667118, 1.08269417, 0.94919191, 0.36011359, -0.0661774],
        ),
    ],
)  # fmt: skip
def test_dead_times_between_samples(one: Plant, expected: list[float]) -> None:
    np.testing.assert_allclose(respond(one, GRID, SQUARE, GRID), expected, atol=2e-8)


def test_two_with_a_zero_are_two_in_parallel() -> None:
    with_zero = plant(tau1=2.0, zeta=1.25, zero=1.25)
    parallel = plant(tau1=1.0, tau2=4.0, C=0.5)  # C = (z/ω − τ1)/(τ2 − τ1)
    both = [respond(one, GRID, SQUARE, GRID) for one in (with_zero, parallel)]
    assert both[0][2] == pytest.approx(0.42665989, abs=1e-8)
    np.testing.assert_allclose(*both, atol=1e-14)


@pytest.mark.parametrize("zeta", [0.0, 0.3, 1.0, 1 + 1e-9, 1.7, 400.0])
@pytest.mark.parametrize("s", [1e-6, 0.03, 2.0, 60.0])
def test_one_closed_form_for_all_roots(zeta: float, s: float) -> None:
    c, n = swing(zeta, s)
    flow = np.array([[c + zeta * n, n], [-n, c - zeta * n]])
    np.testing.assert_allclose(flow, expm(s * np.array([[0.0, 1.0], [-1.0, -2 * zeta]])), rtol=1e-10, atol=1e-13)


def test_a_step_of_any_length_is_two_of_its_parts() -> None:
    for one in (REFERENCE_PLANT, plant(tau1=0.3, zeta=0.4, zero=0.2), plant(tau1=0.3, tau2=2.0, C=1.4)):
        numbers = plant_numbers(one)
        whole = plant_step(numbers, 0.1, 0.3, 0.6, 0.7)
        half = plant_step(numbers, *plant_step(numbers, 0.1, 0.3, 0.6, 0.4), 0.6, 0.3)
        assert whole == pytest.approx(half, rel=1e-12)


def test_signed_inputs_have_a_form_on_each_side() -> None:
    one = replace(plant(tau1=0.5, C=1.0), Ts=(0.0, 2.0), Ts_below=(0.0, -1.2), u_range=(0.0, 1.0))
    assert one.steady(np.array([-0.5, 0.0, 0.5])).tolist() == [-0.6, 0.0, 1.0]
    found = respond(one, [0.0, 9.0], [0.5, -0.5], np.array([0.0, 8.9, 30.0]))
    np.testing.assert_allclose(found[1:], [1.0, -0.6], atol=1e-6)
    assert (around(one, 0.5).gain, around(one, -0.5).gain) == (2.0, 1.2)


@pytest.mark.parametrize(
    "one", [plant(), plant(tau1=0.3, C=1.0), plant(tau1=0.2, tau2=1.0, C=1.6), plant(tau1=0.4, zeta=0.3, zero=0.2),
            plant(tau1=0.4, zeta=1.6)],
)  # fmt: skip
def test_the_plant_around_an_input_is_that_of_python_control(one: Plant) -> None:
    control = pytest.importorskip("control")
    point = around(one, 0.5)
    t = np.linspace(0, 5, 51)
    _, y = control.step_response(point.to_control(), t)
    np.testing.assert_allclose(respond(one, [0.0], [1.0], t), y, atol=1e-9)
    w = np.array([0.1, 1.0, 7.0])
    np.testing.assert_allclose(
        point.response(1j * w), control.frequency_response(point.to_control(), w).complex, rtol=1e-10
    )
    held = control.c2d(point.to_control(), 0.05)
    z = np.exp(0.05j * w)
    np.testing.assert_allclose(point.sampled(z, 0.05), [held(one) for one in z], rtol=1e-8)


LEVELS = np.array([0.0, 0.4, 1.0])


def drive_of(rows: int = 40) -> Drive:
    """Random steps among three inputs, at uneven instants."""
    random = np.random.default_rng(3)
    which = np.repeat(random.integers(0, 3, rows // 4), 4)
    rising = np.where((which == 1) & (np.roll(which, 4) == 2), -1, 1)
    dt = np.append(random.uniform(0.05, 0.4, rows - 1), 0.0)
    return Drive(dt, which, LEVELS, rising, random.normal(size=rows), random.uniform(0.5, 2.0, rows), False, False)


def tables_of(x: np.ndarray) -> Tables:
    """T_s = x0 u + x1 u², τ1 = x2 + x3 u, τ2 = x4 + x5 u."""
    by_steady = np.column_stack([LEVELS, LEVELS**2])
    by_tau = np.column_stack([np.ones(3), LEVELS])
    rest = np.array([0.0, 1.0, 1.0])
    return Tables(by_steady @ x[:2], by_tau @ x[2:4], by_tau @ x[4:6], rest, by_steady, by_tau, by_tau)


PLACES = np.arange(6, 16)
PARALLEL = np.array([1.0, 0.3, 0.3, 0.1, 1.5, 0.4, 0.8, 0.5, 2.5, 0.8, 1.3, 0.1, 0.13, 0.05, 0.2, -0.1])
RINGING = np.array([1.0, 0.3, 0.3, 0.1, 0.4, 0.9, 0.3, 0.0, 0.0, 1.0, 1.0, 0.0, 0.13, 0.05, 0.2, -0.1])


@pytest.mark.parametrize(
    ("law", "x", "free"),
    [(kernel.derivatives, PARALLEL, range(16)), (kernel.swinging, RINGING, (*range(7), *range(12, 16)))],
)  # fmt: skip
def test_derivatives_are_those_of_differences(law, x, free) -> None:  # type: ignore[no-untyped-def]
    """Of every unknown, the dead time among them; by differences of fourth order."""
    drive = drive_of()

    def at(x: np.ndarray) -> np.ndarray:
        return np.asarray(law(delayed(drive, x[12]), tables_of(x), x[6:], PLACES, 16))

    exact, h = at(x), 1e-3
    for k in free:
        e = np.zeros(16)
        e[k] = h
        slope = (8 * (at(x + e) - at(x - e)) - (at(x + 2 * e) - at(x - 2 * e)))[:, 16] / (12 * h)
        np.testing.assert_allclose(exact[:, k], slope, atol=3e-9)


def test_the_kernel_responds_as_the_plant_does() -> None:
    drive = drive_of()._replace(y=np.zeros(40), w=np.ones(40))
    t = np.concatenate([[0.0], np.cumsum(drive.dt_s[:-1])])
    for law, one in (
        (kernel.derivatives, Plant((0.3, 0.1), (1.5, 0.4), (0.0, 1.0, 0.3), (0.0, 1.0), 0.8, dead_time_s=0.13)),
        (kernel.swinging, Plant((0.3,), (1.0,), (0.0, 1.0, 0.3), (0.0, 1.0), zeta=0.4, zero=0.3, dead_time_s=0.13)),
    ):
        x = np.array([1.0, 0.3, 0.3, 0.1, 1.5, 0.4]) if one.zeta is None else np.array([1.0, 0.3, 0.3, 0.0, 0.4, 0.0])
        scalars = np.array([0.8 if one.zeta is None else 0.3, 0, 0, 1, 1, 0, 0.13, 0, 0, 0])
        flat = drive._replace(rising=np.ones(40, dtype=np.int64))
        found = law(delayed(flat, 0.13), tables_of(x), scalars, np.full(10, -1), 6)[:, 6]
        np.testing.assert_allclose(respond(one, t, LEVELS[drive.which], t), found, atol=1e-12)


def test_a_change_that_falls_on_a_sample_acts_after_it() -> None:
    drive = Drive(
        np.array([1.0, 1.0, 1.0, 0.0]), np.array([0, 1, 1, 1]), np.array([0.0, 1.0]), np.ones(4, dtype=np.int64),
        np.zeros(4), np.ones(4), True, True,
    )  # fmt: skip
    late = delayed(drive, 1.0)
    acting = late.duty[late.which]
    assert acting[late.w > 0][:2].tolist() == [0.0, 0.0]
    assert late.dt_s.sum() == pytest.approx(3.0)
    assert delayed(drive, 9.0).duty[delayed(drive, 9.0).which].tolist() == [0.0] * 4


def test_eq_3_is_the_plant_held() -> None:
    t = np.linspace(0, 5, 7)
    at = REFERENCE_PLANT.at(60.0)
    np.testing.assert_allclose(step_response(at, t), respond(REFERENCE_PLANT, [0.0], [60.0], t), rtol=1e-13)
    assert step_response(Step(1.0, 0.5, 8.0), np.array([1.0]))[0] == pytest.approx(
        0.85 * (1 - math.exp(-2)) + 0.15 * (1 - math.exp(-0.125)), rel=1e-14
    )


@pytest.mark.parametrize("one", [plant(), plant(tau1=0.2, tau2=1.0, C=1.6), plant(tau1=0.4, zeta=0.3, zero=0.2)])
def test_a_unit_step_and_its_rate(one: Plant) -> None:
    t, h = np.linspace(0.1, 5, 9), 1e-6
    gone, rate = unit_step(one, t, 0.5)
    np.testing.assert_allclose(0.5 * gone, respond(one, [-1.0, 0.0], [0.0, 0.5], np.append(0.0, t))[1:], atol=1e-13)
    np.testing.assert_allclose(
        rate, (unit_step(one, t + h, 0.5)[0] - unit_step(one, t - h, 0.5)[0]) / (2 * h), atol=1e-8
    )
