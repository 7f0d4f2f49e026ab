"""The one plant against closed forms worked by hand, python-control, SciPy's matrix exponential, and differences in
sixty digits."""

import math
from dataclasses import replace
from decimal import Decimal, localcontext

import numpy as np
import pytest
from scipy.linalg import expm

from eaid.plant import derivatives as kernel
from eaid.plant.drive import Drive, Tables, delayed
from eaid.plant.dynamics import REFERENCE_PLANT, Plant, Step, plant_numbers, plant_terms, swing
from eaid.plant.operating import around
from eaid.plant.respond import respond, unit_step
from eaid.plant.steps import step_response


def plant(**of: float) -> Plant:
    """A plant with T_s(u) = u."""
    tau1, tau2 = of.pop("tau1", 0.5), of.pop("tau2", 8.0)
    return Plant((tau1,), (tau2,), (0.0, 1.0), (0.0, 1.0), floor_s=0.0, **of)  # type: ignore[arg-type]


@pytest.mark.parametrize("zeta", [0.0, 0.3, 1.0, 1 + 1e-9, 1.7, 400.0])
@pytest.mark.parametrize("s", [1e-6, 0.03, 2.0, 60.0])
def test_one_closed_form_for_all_roots(zeta: float, s: float) -> None:
    c, n = swing(zeta, s)
    flow = np.array([[c + zeta * n, n], [-n, c - zeta * n]])
    np.testing.assert_allclose(flow, expm(s * np.array([[0.0, 1.0], [-1.0, -2 * zeta]])), rtol=1e-10, atol=1e-13)


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
REST_SHARES = np.array([0.3, 1.0, 1.0])


def drive_of(rows: int = 40) -> Drive:
    """Random steps among three inputs, at uneven instants."""
    random = np.random.default_rng(3)
    which = np.repeat(random.integers(0, 3, rows // 4), 4)
    rising = np.where((which == 1) & (np.roll(which, 4) == 2), -1, 1)
    dt = np.append(random.uniform(0.05, 0.4, rows - 1), 0.0)
    return Drive(
        dt, which, LEVELS, LEVELS, rising, random.normal(size=rows), random.uniform(0.5, 2.0, rows), False, False
    )


def tables_of(x: np.ndarray) -> Tables:
    """T_s = x0 u + x1 u², τ1 = x2 + x3 u, τ2 = x4 + x5 u."""
    by_steady = np.column_stack([LEVELS, LEVELS**2])
    by_tau = np.column_stack([np.ones(3), LEVELS])
    return Tables(by_steady @ x[:2], by_tau @ x[2:4], by_tau @ x[4:6], REST_SHARES, by_steady, by_tau, by_tau)


def flow(A: list[list[Decimal]], dt: Decimal) -> list[list[Decimal]]:
    """e^(A dt), (2, 2), by its series at a 2^−12th of the time, squared twelve times."""

    def times(P: list[list[Decimal]], Q: list[list[Decimal]]) -> list[list[Decimal]]:
        return [[P[i][0] * Q[0][j] + P[i][1] * Q[1][j] for j in (0, 1)] for i in (0, 1)]

    small = [[one * dt / 4096 for one in row] for row in A]
    one, zero = Decimal(1), Decimal(0)
    total, term = [[one, zero], [zero, one]], [[one, zero], [zero, one]]
    for k in range(1, 25):
        term = [[each / k for each in row] for row in times(term, small)]
        total = [[total[i][j] + term[i][j] for j in (0, 1)] for i in (0, 1)]
    for _ in range(12):
        total = times(total, total)
    return total


def in_sixty_digits(drive: Drive, swings: bool, x: list[Decimal]) -> list[Decimal]:
    """The response of a drive by the equations of `eaid.plant.dynamics`, of T_s, τ1, τ2 as `tables_of` has them."""
    C, rests, falls, excess, theta, idle = x[6], x[7:9], x[9:11], x[11], x[12], x[13]
    time, state, now, output = Decimal(0), x[14:16], Decimal(0), []
    events: list[tuple[Decimal, int]] = []
    for k, dt in enumerate(drive.dt_s.tolist()):
        events.append((time, -1))
        if k and (drive.which[k], drive.rising[k]) != (drive.which[k - 1], drive.rising[k - 1]):
            events.append((time + theta, k))
        time += Decimal(dt)
    row = 0
    for at, k in sorted(events):
        u, dt = Decimal(float(LEVELS[drive.which[row]])), at - now
        steady, tau1, tau2 = x[0] * u + x[1] * u * u, x[2] + x[3] * u, x[4] + x[5] * u
        fell, near = drive.rising[row] < 0, Decimal(float(REST_SHARES[drive.which[row]]))
        if swings:
            E = flow([[Decimal(0), 1 / tau1], [-1 / tau1, -2 * tau2 / tau1]], dt)
            off = [state[0] - steady, state[1]]
            state = [steady + E[0][0] * off[0] + E[0][1] * off[1], E[1][0] * off[0] + E[1][1] * off[1]]
        else:
            steady *= 1 + excess if fell else 1
            for s, (part, tau) in enumerate(((C, tau1), (1 - C, tau2))):
                off1 = state[s] - part * steady
                goes_down = off1 > 0 if s == 0 or Decimal("1.001") > C else off1 < 0  # as the output does
                if goes_down and near >= 1:
                    tau *= falls[s]
                elif goes_down and rests[s] > 0:
                    tau = near * tau + (1 - near) * rests[s]
                state = [*state[:s], part * steady + (-dt / tau).exp() * off1, *state[s + 1 :]]
        now = at
        if k < 0:
            output.append(idle + state[0] + (C if swings else 1) * state[1])
        else:
            row = k
    return output


PLACES = np.arange(6, 16)
# T_s, τ1, τ2 (of those that swing 1/ω, ζ) over the input; C (z); τ of falls to rest, factors of others; excess; θ;
# idle; both states at the start
PARALLEL = (1.0, 0.3, 0.3, 0.1, 1.5, 0.4, 0.8, 0.5, 2.5, 0.8, 1.3, 0.1, 0.13, 0.05, 0.2, -0.1)
SWINGS = (1.0, 0.3, 0.3, 0.1, 0.4, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.13, 0.05, 0.2, -0.1)
KINDS = {
    "two in parallel": (kernel.derivatives, PARALLEL),
    "overshoot": (kernel.derivatives, (*PARALLEL[:6], 1.6, *PARALLEL[7:])),
    "one lag": (kernel.derivatives, (*PARALLEL[:6], 1.0, *PARALLEL[7:])),
    "late by more than a hold": (kernel.derivatives, (*PARALLEL[:12], 1.37, *PARALLEL[13:])),
    "with a zero": (kernel.swinging, (*SWINGS[:4], 0.4, 0.9, 0.3, *SWINGS[7:])),
    **{
        f"two, ζ {zeta!r}": (kernel.swinging, (*SWINGS[:4], zeta, *SWINGS[5:]))
        for zeta in (0.02, 0.4, 0.995, 1.0, 1.0 + 1e-9, 1.0 + 1e-7, 1.01, 1.6, 40.0)
    },
}


@pytest.mark.parametrize("kind", KINDS)
def test_derivatives_are_those_of_differences_in_sixty_digits(kind: str) -> None:
    """Of every unknown, the dead time among them: central differences of a response that shares no line with ours."""
    drive, (law, x) = drive_of(), KINDS[kind]
    swings = law is kernel.swinging
    tables, late = tables_of(np.array(x)), delayed(drive, x[12])
    scalars = np.array(x[6:])
    state = kernel.at_first(scalars, PLACES, 16)
    found = law(late, tables, scalars, PLACES, state, 0, len(late.w)) / np.sqrt(drive.w)[:, None]
    with localcontext() as context:
        context.prec = 60
        exact, h = [Decimal(one) for one in x], Decimal("1e-18")
        y = [float(one) for one in in_sixty_digits(drive, swings, exact)]
        np.testing.assert_allclose(found[:, 16] + drive.y, y, rtol=0, atol=1e-12)
        unknowns = (*range(7), *range(12, 16)) if swings else range(16)
        for k in unknowns:
            above, below = (in_sixty_digits(drive, swings, [*exact[:k], exact[k] + s * h, *exact[k + 1 :]])
                            for s in (1, -1))  # fmt: skip
            slope = [float((a - b) / (2 * h)) for a, b in zip(above, below, strict=True)]
            np.testing.assert_allclose(found[:, k], slope, rtol=0, atol=1e-10, err_msg=str(k))


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
        late, none = delayed(flat, 0.13), np.full(10, -1)
        found = law(late, tables_of(x), scalars, none, kernel.at_first(scalars, none, 6), 0, len(late.w))[:, 6]
        np.testing.assert_allclose(respond(one, t, LEVELS[drive.which], t), found, atol=1e-12)


def test_a_change_that_falls_on_a_sample_acts_after_it() -> None:
    drive = Drive(
        np.array([1.0, 1.0, 1.0, 0.0]), np.array([0, 1, 1, 1]), np.array([0.0, 1.0]), np.array([0.0, 1.0]),
        np.ones(4, dtype=np.int64),
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


def test_a_step_has_the_floors_that_its_replay_has() -> None:
    """τ2(50) would be −0.5 s, which the loops take for τ1."""
    falling = Plant((0.02,), (0.5, -0.02), (0.0, 1.0), (10.0, 50.0))
    step, (tau1, tau2, steady) = falling.at(50.0), plant_terms(plant_numbers(falling), 50.0)
    assert (step.tau1, step.tau2, step.Ts) == (tau1, tau2, steady) == (0.02, 0.02, 50.0)
