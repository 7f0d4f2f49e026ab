"""The exported laws in plain Python, which the other languages repeat to the bit: the libm, the replay, and faults.

On NaN, a jump, a takeover a user gets what the export's README.md says.
"""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from .conftest import DT, LAWS, fit_of, gains_of, laws_of, replayed


@pytest.mark.parametrize(("precision", "bound"), [("double", 6e-16), ("single", 3e-7)])
def test_one_minus_e_to_the_minus_x_and_tanh_are_those_of_the_libm(laws, precision, bound):
    made = laws(precision)
    series = made.constants["rc"].series
    for x in np.concatenate([np.geomspace(1e-12, 80.0, 2001), [0.5, 1.0, 2.0, 64.0]]):
        held = made.number(x)
        assert made.law.loss(series, held) == pytest.approx(-math.expm1(-float(held)), rel=bound)
        assert made.law.tanh(series, -held) == pytest.approx(-math.tanh(float(held)), rel=2 * bound)
    assert made.law.loss(series, made.number(0.0)) == 0.0


SOFT = {"gamma": 2.0, "epsilon": 0.4}
"""A switch that is never 0 nor 1."""


@pytest.mark.parametrize(
    ("law", "changes"),
    [("pi", {}), ("pi", {"duty_limits_pct": [5.0, 95.0]}), ("rc", {}),
     ("rc", {"rc": SOFT, "duty_limits_pct": [5.0, 95.0]}), ("pi-feedforward", {}), ("inverse", {})],
)  # fmt: skip
def test_the_laws_are_the_replays(tmp_path, law, changes):
    """On a reference that meets both limits."""
    t = np.arange(3000) * DT
    rows = [f"{at!r},{wanted!r}" for at, wanted in zip(t.tolist(), (1.5 + 6 * np.sin(4 * t)).tolist(), strict=True)]
    (tmp_path / "reference.csv").write_text("\n".join(["time_s,reference_nm", *rows]))
    run = replayed(law, None, fit_of(), gains_of(**changes), reference=tmp_path / "reference.csv")
    duty, torque = np.array(list(laws_of(gains_of(**changes), fit_of()).closed_loop(run))).T
    assert np.abs(torque - run.torque).max() <= 1e-12 and np.abs(duty - run.duty).max() <= 1e-7
    low, high = changes.get("duty_limits_pct", (0.0, 100.0))
    assert (duty.min(), duty.max()) == (low, high)


@pytest.fixture
def strict():
    """Laws of an export with a duty on fault."""
    return laws_of(gains_of(), fit_of(), duty_on_fault=7.0)


def state_of(control):
    """What a controller remembers, without the status."""
    return {name: value for name, value in vars(control).items() if name not in ("c", "status")}


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("place", [0, 1, 2])
def test_an_input_that_is_no_number_gives_the_duty_on_fault_and_leaves_the_state_alone(strict, name, place):
    control = strict.init(name)
    for k in range(50):
        control.step(1.0, 0.0, 0.01 * k)
    for bad in (math.nan, math.inf, -math.inf, 1e10):
        inputs = [1.0, 0.0, 0.5]
        inputs[place] = bad
        before = state_of(control)
        duty = control.step(*inputs)
        if name == "pi" and place == 1:  # a PI reads no rate
            assert control.status == 0
            continue
        assert duty == 7.0 and control.status == strict.law.BAD_INPUT
        assert state_of(control) == before


@pytest.mark.parametrize("name", LAWS)
def test_the_limits_are_told_and_the_law_goes_on(strict, name):
    law = strict.law
    for wanted, torque, duty, bit in ((9.0, 0.0, 100.0, law.AT_MAX), (0.0, 9.0, 0.0, law.AT_MIN)):
        control = strict.init(name)
        assert control.step(wanted, 0.0, torque) == duty and control.status == bit


@pytest.mark.parametrize("name", ["pi", "rc", "pi-feedforward"])
@pytest.mark.parametrize("duty", [0.0, 12.5, 60.0, 99.0])
@pytest.mark.parametrize(("reference", "torque"), [(1.0, 1.0), (1.0, 0.97), (0.2, 0.3)])
def test_a_takeover_has_no_bump(laws, name, duty, reference, torque):
    control = laws().init(name)
    control.start(reference, 0.4, torque, duty)
    assert control.step(reference, 0.4, torque) == pytest.approx(duty, abs=1e-9)


def test_a_takeover_of_the_inverse_begins_at_the_torque_that_is_there_and_one_on_bad_inputs_is_a_reset(laws):
    made = laws()
    control = made.init("inverse")
    control.start(1.2, 0.0, 1.2, 45.0)
    x1, x2 = control.x1, control.x2
    assert x1 + x2 == pytest.approx(1.2) and control.duty == 45.0
    held = made.law.plant_change(made.constants["plant"], x1, x2, control.step(1.2, 0.0, 1.2), DT)
    assert sum(held) == pytest.approx(0.0, abs=1e-12)
    for name in LAWS:
        control = made.init(name)
        control.step(1.0, 0.0, 0.5)
        control.start(math.nan, 0.0, math.nan, 50.0)
        assert vars(control) == vars(made.init(name))


def test_the_filtered_slope_of_a_jump_and_of_a_sine_are_those_that_the_readme_tells(laws):
    made = laws()
    c, law = made.constants["rate"], made.law

    def slopes(values):
        rate = law.Rate(c)
        return np.array([rate.step(value) for value in values]), rate

    rates, _ = slopes([0.0] * 100 + [1.0] * 100)
    assert rates[99] == 0.0 and rates[100] == pytest.approx(c.gain) and c.gain == pytest.approx(145.4, rel=1e-3)
    assert rates[100 + 19] < 0.06 * rates[100]  # e^-3 after 3/(2π 25 Hz) = 0.019 s
    assert rates.sum() * DT == pytest.approx(1.0, rel=1e-3)
    t = np.arange(3000) * DT
    rates, rate = slopes(np.sin(2 * np.pi * t))
    expected = 2 * np.pi * np.cos(2 * np.pi * (t - 1 / (2 * np.pi * 25)))
    assert np.abs(rates - expected)[100:].max() < 0.03
    assert rate.step(math.nan) == 0.0 and rate.step(5.0) == 0.0  # begins anew


def test_the_filtered_slope_serves_the_robust_controller_as_well_as_the_replays_central_differences(laws):
    """docs/export.md: largest error on the multisine, after 5 s."""
    made = laws()
    plant = SimpleNamespace(**vars(made.constants["plant"]) | {"release1": 0.0, "release2": 0.0})
    run = replayed("rc", "multisine", fit_of(release=None), gains_of())
    filter_ = made.law.Rate(made.constants["rate"])
    filtered = [filter_.step(wanted) for wanted in run.reference]
    none = [0.0] * len(run.rate)
    assert np.abs(run.reference - run.torque)[5000:].max() == pytest.approx(0.1157, rel=0.01)
    for rate, expected in ((filtered, 0.1112), (none, 0.2332)):
        _, torque = np.array(list(made.closed_loop(replace(run, rate=rate), plant))).T
        assert np.abs(run.reference - torque)[5000:].max() == pytest.approx(expected, rel=0.01)
