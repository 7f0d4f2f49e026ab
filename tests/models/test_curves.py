"""The three models: closed forms, gradients against complex steps, the edges of specification 4.2, first guesses."""

from dataclasses import astuple, replace

import numpy as np
import pytest

from eaid.models import friction, linear, nonlinear
from eaid.models.parameters import PAPER_LINEAR, REFERENCE_PLANT, Friction, Linear

STEP = 1e-30
CURVE = Friction(Ts=2.0, tau1=0.3, tau2=4.0)
TIME = np.linspace(0, 12, 50)


def test_friction_at_zero_at_tau_and_in_the_end() -> None:
    one = Friction(Ts=2.0, tau1=0.5, tau2=0.5, C=0.6)
    values = friction.step_response(one, np.array([0.0, 0.5, 10.0]))
    assert values == pytest.approx([0.0, 2 * (1 - np.exp(-1)), 2 * (1 - np.exp(-20))], rel=1e-15)


def test_friction_is_the_sum_of_its_two_parts() -> None:
    fast = -np.expm1(-TIME / 0.3)
    slow = -np.expm1(-TIME / 4.0)
    assert friction.step_response(CURVE, TIME) == pytest.approx(2 * (0.85 * fast + 0.15 * slow), rel=1e-14)


def test_friction_keeps_precision_just_after_the_step() -> None:
    t = np.array([1e-12])
    assert friction.step_response(CURVE, t)[0] == pytest.approx(2 * 1e-12 * (0.85 / 0.3 + 0.15 / 4), rel=1e-10)


@pytest.mark.parametrize("k", range(4))
def test_friction_gradient(k: int) -> None:
    values = list(astuple(CURVE))
    values[k] = values[k] + 1j * STEP
    by_complex_step = friction.step_response(Friction(*values), TIME).imag / STEP
    assert friction.gradient(CURVE, TIME)[k] == pytest.approx(by_complex_step, rel=1e-12, abs=1e-15)


def test_nonlinear_is_the_friction_curve_of_its_polynomials() -> None:
    u = 40.0
    Ts = 0.032 + 9.2e-3 * u + 2.1e-4 * u**2 + 1.32e-6 * u**3
    tau1, tau2 = 6.74e-3 + 2.39e-2 * u - 2.13e-4 * u**2, 0.93 + 0.41 * u - 2.64e-3 * u**2
    want = friction.step_response(Friction(Ts, tau1, tau2), TIME)
    assert nonlinear.step_response(REFERENCE_PLANT, TIME, u) == pytest.approx(want, rel=1e-13)


def test_reference_plant_reaches_its_torque() -> None:
    assert nonlinear.steady_torque(REFERENCE_PLANT, 100.0) == pytest.approx(4.372, abs=1e-12)


def test_below_the_lowest_duty_torque_is_a_line_to_zero_and_time_constants_stay() -> None:
    edge = nonlinear.steady_torque(REFERENCE_PLANT, 10.0).item()
    duties = np.array([0.0, 5.0, 10.0])
    assert nonlinear.steady_torque(REFERENCE_PLANT, duties) == pytest.approx([0, edge / 2, edge])
    tau1, tau2 = nonlinear.time_constants(REFERENCE_PLANT, duties)
    assert tau1 == pytest.approx([0.22444] * 3) and tau2 == pytest.approx([4.766] * 3)


def test_above_the_highest_duty_all_stay() -> None:
    p = replace(REFERENCE_PLANT, u_range=(10.0, 80.0))
    assert nonlinear.steady_torque(p, 95.0) == nonlinear.steady_torque(p, 80.0)
    assert nonlinear.time_constants(p, 95.0) == nonlinear.time_constants(p, 80.0)


def test_linear_closed_form() -> None:
    drive = 0.08 * 50 - 2.42
    values = linear.step_response(PAPER_LINEAR, np.array([0.0, 1 / 1.36, 20.0]), 50.0)
    assert values == pytest.approx([0, drive / 1.36 * (1 - np.exp(-1)), drive / 1.36], rel=1e-9)
    assert linear.steady_torque(PAPER_LINEAR, 50.0) == pytest.approx(drive / 1.36)


def test_published_linear_model_is_negative_below_30_percent() -> None:
    assert linear.steady_torque(PAPER_LINEAR, 30.24) < 0 < linear.steady_torque(PAPER_LINEAR, 30.26)


@pytest.mark.parametrize("k", range(3))
def test_linear_gradient(k: int) -> None:
    values = list(astuple(PAPER_LINEAR))
    values[k] = values[k] + 1j * STEP
    by_complex_step = linear.step_response(Linear(*values), TIME, 60.0).imag / STEP
    assert linear.gradient(PAPER_LINEAR, TIME, 60.0)[k] == pytest.approx(by_complex_step, rel=1e-12, abs=1e-15)
