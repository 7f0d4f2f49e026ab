"""A drive that reaches no further than some level: the plant ends there, and what was recorded beyond are repeats."""

from dataclasses import replace

import numpy as np
import pytest

import eaid
from eaid.apparatus import Apparatus
from eaid.findings import say
from eaid.levels.drive_limit import join_beyond
from eaid.plant.dynamics import REFERENCE_PLANT
from eaid.plant.steps import step_response
from eaid.results.fit import Fit
from eaid.steps.stepset import Level, StepSet

from ..conftest import codes, made_once

LEVELS, KNEE = np.arange(10.0, 101.0, 10.0), 70.0


def clipped(seed: int) -> StepSet:
    """Steps of the reference plant behind a drive that clips at the knee; its gain and τ1 scatter from run to run."""
    random, t, made = np.random.default_rng(seed), np.arange(0.0, 20.0, 0.02), []
    for u in LEVELS.tolist():
        true, runs = REFERENCE_PLANT.at(min(u, KNEE)), []
        for _ in range(3):
            gain, slower = 1 + 0.02 * random.standard_normal(), np.exp(0.03 * random.standard_normal())
            one = replace(true, Ts=gain * true.Ts, tau1=slower * true.tau1)
            runs.append(step_response(one, t) + 0.01 * random.standard_normal(len(t)))
        made.append(Level(u, t, np.array(runs), tuple(f"{u:g}-{k}" for k in range(3))))
    return StepSet("clutch", "%", "N·m", Apparatus(), tuple(made))


@made_once
def fitted(seed: int, **options: str) -> Fit:
    """A fit of such steps."""
    return eaid.fit(clipped(seed), model=("friction", "nonlinear"), **options)


def test_levels_beyond_it_are_repeats_of_where_it_ends() -> None:
    fit = fitted(0)
    assert fit.data.levels == (10, 20, 30, 40, 50, 60, 70) and fit.data.repeats == (3, 3, 3, 3, 3, 3, 12)
    assert fit.plant.u_range == (10.0, KNEE) and float(fit.plant.steady(100.0)) == float(fit.plant.steady(KNEE))
    (told,) = [one for one in fit.findings if one.code == "output-levels-off"]
    assert "inputs beyond 70 act as it does" in say(told)
    assert "polynomials-too-low" not in codes(fit) and "polynomials-too-low" in codes(fitted(0, curve="cubic"))


@pytest.mark.slow
def test_its_values_hold_the_truth_where_curves_over_all_levels_miss_it() -> None:
    """Quadratics over inputs that never acted: τ1 of the plant was 7 to 11 % off at half of the levels."""
    inside, worst = [], {"auto": 0.0, "cubic": 0.0}
    for seed in range(4):
        for row in fitted(seed).friction_levels:
            true = REFERENCE_PLANT.at(min(row.level, KNEE))
            for name in ("Ts", "tau1", "tau2"):
                low, high = getattr(row.ci95, name)
                inside.append(low < getattr(true, name) < high)
        for curve in worst:
            found = fitted(seed, curve=curve).plant
            off = [found.at(u).tau1 / REFERENCE_PLANT.at(min(u, KNEE)).tau1 - 1 for u in LEVELS.tolist()]
            worst[curve] = max(worst[curve], *np.abs(off))
    assert np.mean(inside) > 0.88 and worst["auto"] < 0.05 < 0.08 < worst["cubic"]


def test_a_controller_is_designed_on_the_plant_that_is_there() -> None:
    """The gain of the loop goes with dT_s/du, which a cubic over all levels has a third too small below the knee."""
    true = [float(REFERENCE_PLANT.slope(u)) for u in (40.0, 60.0)]
    own, cubic = ([float(fitted(0, curve=how).plant.slope(u)) for u in (40.0, 60.0)] for how in ("auto", "cubic"))
    assert own == pytest.approx(true, rel=0.06)
    assert min(c / t for c, t in zip(cubic, true, strict=True)) < 0.8


def test_samples_at_other_times_are_not_joined() -> None:
    levels = clipped(0).levels
    assert join_beyond(levels, 200.0) == levels
    slower = replace(levels[-1], time_s=1.5 * levels[-1].time_s)
    assert join_beyond((*levels[:-1], slower), KNEE) is None


def test_levels_that_are_named_stay_levels() -> None:
    """Of a level beyond the knee that is held out, or has bounds: the curve goes through the others."""
    fit = eaid.fit(clipped(0), model=("nonlinear", "linear"), hold_out=(80.0,), bounds_levels="30:100")
    assert fit.plant.u_range == (10.0, 100.0) and fit.plant.Ts_through and 100.0 in fit.linear.bounds.levels
    assert [row.level for row in fit.nonlinear.hold_out.levels] == [80.0]
