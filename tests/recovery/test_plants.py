"""Make data, fit, and the truth returns: noise-free, from other plants, under noise, and whatever the units."""

from collections.abc import Callable
from dataclasses import replace
from types import ModuleType

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eaid.fitting.data import Data, data_of
from eaid.fitting.fit import fit
from eaid.fitting.nonlinear import fit_nonlinear
from eaid.fitting.sums import Record
from eaid.models import friction
from eaid.models.nonlinear import steady_torque, time_constants
from eaid.models.parameters import REFERENCE_PLANT, Friction, Nonlinear
from eaid.options import FitOptions
from eaid.results import codec
from eaid.steps.stepset import Level, StepSet

Maker = Callable[..., StepSet]


def _same(found: Nonlinear, truth: Nonlinear, rel: float) -> None:
    for name in ("tau1", "tau2", "Ts"):
        assert getattr(found, name) == pytest.approx(getattr(truth, name), rel=rel)


@pytest.mark.parametrize(("duration_s", "rate_hz"), [(20.0, 1000.0), (60.0, 1000.0), (20.0, 25.0)])
def test_ten_coefficients_of_the_reference_plant(duration_s: float, rate_hz: float, clutch_set: Maker) -> None:
    found = fit_nonlinear(data_of(clutch_set(duration_s=duration_s, rate_hz=rate_hz).levels), 0.85)
    assert found.solver.converged
    _same(found.parameters, REFERENCE_PLANT, 1e-6)


def test_a_free_share_returns_with_the_ten(clutch_set: Maker) -> None:
    plant = replace(REFERENCE_PLANT, C=0.7)
    found = fit_nonlinear(data_of(clutch_set(plant, rate_hz=50.0).levels), None).parameters
    assert pytest.approx(0.7, rel=1e-6) == found.C
    _same(found, plant, 1e-6)


@pytest.mark.parametrize("seed", range(8))
def test_other_plants_return(seed: int, fit_quality: ModuleType) -> None:
    truth = fit_quality.random_plant(np.random.default_rng(seed))
    t = np.arange(2000) / 100
    records = tuple(Record(t, y, True) for y in fit_quality.curves(t, fit_quality.levels_of(truth)))
    found = fit_nonlinear(Data(fit_quality.LEVELS, records), 0.85).parameters
    values = np.concatenate([c * 100.0 ** np.arange(len(c)) for c in (found.tau1, found.tau2, found.Ts)])
    assert values == pytest.approx(truth, rel=1e-6, abs=1e-7)


@pytest.mark.parametrize("seed", range(8))
def test_the_cost_is_that_of_the_best_of_an_independent_multi_start(seed: int, fit_quality: ModuleType) -> None:
    case = fit_quality.make(seed)
    mine, converged = fit_quality.ours(case)
    assert converged
    assert mine <= (1 + 1e-6) * fit_quality.best_of_others(case, starts=2)


def test_under_noise_the_truth_is_within_a_few_standard_errors(clutch_set: Maker) -> None:
    found = fit_nonlinear(data_of(clutch_set(noise_nm=0.01, repeats=3, seed=5).levels), 0.85).parameters
    u = np.arange(10.0, 101.0, 10.0)
    for got, want, rel in zip(
        (*time_constants(found, u), steady_torque(found, u)),
        (*time_constants(REFERENCE_PLANT, u), steady_torque(REFERENCE_PLANT, u)),
        (0.01, 0.04, 0.004),
        strict=True,
    ):
        assert got == pytest.approx(want, rel=rel)


def test_tables_one_and_two_return(friction_set: Maker) -> None:
    forces = {float(f): f / 6.283185307e-3 / 1e3 for f in range(17, 171, 17)}
    curves = {
        f: Friction(
            0.0944 * x - 0.0896,
            6.01 * np.exp(-0.431 * x) + 0.11 * np.exp(0.0492 * x),
            40.25 * np.exp(-0.219 * x) + 1.37 * np.exp(0.0476 * x),
        )
        for f, x in forces.items()
    }
    found = fit(friction_set("friction-force", "N", curves, duration_s=60.0)).friction
    assert found and found.over == "stress_kpa"
    assert found.trends["Ts"].coefficients == pytest.approx((0.0944, -0.0896), rel=1e-6)
    assert found.trends["tau1"].coefficients == pytest.approx((0.11, 0.0492, 6.01, -0.431), rel=1e-5)
    assert found.trends["tau2"].coefficients == pytest.approx((1.37, 0.0476, 40.25, -0.219), rel=1e-5)
    speeds = {
        float(s): Friction(
            0.349 * np.exp(-0.230 * s) + 1.042 * np.exp(0.00608 * s),
            0.425 * np.exp(-0.310 * s) + 0.0498 * np.exp(-0.0150 * s),
            5.4 * np.exp(-0.0101 * s),
        )
        for s in range(5, 41, 5)
    }
    found = fit(friction_set("friction-speed", "RPM", speeds)).friction
    assert found and found.over == "speed_rpm" and "C_f" not in found.trends
    assert found.trends["Ts"].coefficients == pytest.approx((1.042, 0.00608, 0.349, -0.230), rel=1e-5)
    assert found.trends["tau1"].coefficients == pytest.approx((0.0498, -0.0150, 0.425, -0.310), rel=1e-5)


def test_the_same_input_gives_the_same_bytes(clutch_set: Maker) -> None:
    made = [clutch_set(duration_s=4.0, rate_hz=100.0, noise_nm=0.05, repeats=2) for _ in range(2)]
    first, second = (codec.dumps(fit(steps), "fit") for steps in made)
    assert first == second


CURVES = st.tuples(st.floats(0.05, 5.0), st.floats(0.03, 1.0), st.floats(3.0, 30.0)).map(lambda v: Friction(*v))
QUICK = settings(max_examples=12, deadline=None, derandomize=True)


def _one_level(curve: Friction, rate_hz: float = 100.0, scale: float = 1.0, stretch: float = 1.0) -> StepSet:
    from eaid.apparatus import Apparatus

    t = np.arange(round(10 * rate_hz)) / rate_hz
    rng = np.random.default_rng(0)
    y = np.stack([friction.step_response(curve, t) + 0.01 * curve.Ts * rng.normal(size=len(t)) for _ in range(3)])
    level = Level(50.0, t * stretch, y * scale, ("a", "b", "c"))
    return StepSet("clutch", "%", "N·m", Apparatus(), (level,))


def _friction(steps: StepSet) -> Friction:
    found = fit(steps, FitOptions(model=("friction",))).friction
    assert found and found.levels[0].solver.converged
    return found.levels[0].curve


@QUICK
@given(CURVES, st.floats(1e-3, 1e4))
def test_torque_scaled_scales_only_the_torque(curve: Friction, scale: float) -> None:
    plain, scaled = _friction(_one_level(curve)), _friction(_one_level(curve, scale=scale))
    assert scaled.Ts == pytest.approx(scale * plain.Ts, rel=1e-5)
    assert (scaled.tau1, scaled.tau2) == pytest.approx((plain.tau1, plain.tau2), rel=1e-4)


@QUICK
@given(CURVES, st.floats(0.5, 20.0))
def test_time_stretched_stretches_the_time_constants(curve: Friction, stretch: float) -> None:
    plain, slow = _friction(_one_level(curve)), _friction(_one_level(curve, stretch=stretch))
    assert (slow.tau1, slow.tau2) == pytest.approx((stretch * plain.tau1, stretch * plain.tau2), rel=1e-4)
    assert slow.Ts == pytest.approx(plain.Ts, rel=1e-5)


@QUICK
@given(CURVES, st.permutations([0, 1, 2]))
def test_repeats_may_come_in_any_order(curve: Friction, order: list[int]) -> None:
    steps = _one_level(curve)
    (level,) = steps.levels
    shuffled = replace(steps, levels=(replace(level, runs=level.runs[order]),))
    assert _friction(shuffled).tau2 == pytest.approx(_friction(steps).tau2, rel=1e-6)


@pytest.mark.parametrize("rate_hz", [100.0, 1000.0, 10_000.0])
def test_the_sample_rate_does_not_matter_without_noise(rate_hz: float) -> None:
    t = np.arange(round(10 * rate_hz)) / rate_hz
    y = friction.step_response(Friction(1.0, 0.2, 5.0), t)[None]
    steps = replace(_one_level(Friction(1, 1, 1)), levels=(Level(50.0, t, y, ("a",)),))
    found = _friction(steps)
    assert (found.Ts, found.tau1, found.tau2) == pytest.approx((1.0, 0.2, 5.0), rel=1e-6)
