"""The models' closed forms, their derivatives against complex steps, the edges of the duties, trends; Eq. (1)."""

from dataclasses import astuple, replace

import numpy as np
import pytest

import eaid
from eaid.plant import trends
from eaid.plant.dynamics import REFERENCE_PLANT, Step
from eaid.plant.linear import PAPER_LINEAR
from eaid.plant.steps import step_response, step_slopes

STEP = 1e-30
CURVE = Step(Ts=2.0, tau1=0.3, tau2=4.0)
PLANT, PAPER = REFERENCE_PLANT, PAPER_LINEAR
TIME = np.linspace(0, 12, 50)
X = np.linspace(2.7, 27.0, 10)
TRENDS = {
    "linear": (0.0944, -0.0896),
    "double-exponential": (6.01, -0.431, 0.11, 0.0492),
    "merged-exponential": (1.5, 0.4, -0.05),
}


def test_outside_the_identified_duties() -> None:
    """Below the lowest, torque is a line to zero and the time constants stay; above the highest, all stay."""
    edge, duties = PLANT.steady(10.0).item(), np.array([0.0, 5.0, 10.0])
    assert PLANT.steady(duties) == pytest.approx([0, edge / 2, edge])
    tau1, tau2 = PLANT.time_constants(duties)
    assert tau1 == pytest.approx([0.22444] * 3) and tau2 == pytest.approx([4.766] * 3)
    upto80 = replace(PLANT, u_range=(10.0, 80.0))
    assert upto80.steady(95.0) == upto80.steady(80.0)
    assert upto80.time_constants(95.0) == upto80.time_constants(80.0)


def test_derivatives_are_those_of_a_complex_step() -> None:
    slopes = step_slopes(CURVE, TIME)
    for k, values in enumerate(np.eye(4)):
        moved = Step(*(np.array(astuple(CURVE)) + 1j * STEP * values).tolist())
        assert slopes[k] == pytest.approx(step_response(moved, TIME).imag / STEP, rel=1e-12, abs=1e-15)


@pytest.mark.parametrize("form", TRENDS)
def test_derivatives_of_trends_are_their_differences(form: str) -> None:
    c = np.array(TRENDS[form])
    for slope, one in zip(trends.gradient(form, c, X), 1e-6 * np.eye(len(c)), strict=True):
        up, down = (trends.evaluate(form, tuple(c + side * one), X) for side in (1, -1))
        assert slope == pytest.approx((up - down) / 2e-6, rel=1e-6, abs=1e-9)


def test_trends_of_table_one_and_the_merged_limit_of_two_rates() -> None:
    assert set(TRENDS) == set(trends.FORMS)
    assert trends.evaluate("double-exponential", TRENDS["double-exponential"], X)[0] == pytest.approx(2.003, abs=1e-3)
    assert trends.evaluate("linear", TRENDS["linear"], X)[-1] == pytest.approx(2.4592)
    rate, gap = -0.05, 1e-6
    pair = (0.5 * (1.5 + 0.4 / gap), rate + gap, 0.5 * (1.5 - 0.4 / gap), rate - gap)
    merged = trends.evaluate("merged-exponential", TRENDS["merged-exponential"], X)
    assert trends.evaluate("double-exponential", pair, X) == pytest.approx(merged, rel=1e-7)


def test_area_stress_shear_field_and_friction_coefficient(small_steps: "eaid.StepSet") -> None:
    """Eq. (1), and the numbers that specification 1 gives for it."""
    rig = small_steps.apparatus
    assert rig.area_m2 == pytest.approx(6.283e-3, abs=5e-7)
    assert (rig.stress_kpa(17), rig.stress_kpa(170)) == pytest.approx((2.706, 27.06), rel=2e-4)
    assert (rig.shear_kpa(4.37), rig.field_v_per_um) == pytest.approx((6.86, 3.16), abs=5e-3)
    one = replace(rig, surfaces=1)
    assert one.friction_coefficient(0.0944 * 27 - 0.0896, 27) == pytest.approx(0.286, abs=5e-4)
