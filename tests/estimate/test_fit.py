"""Steps → fit: certified and published values, metrics by hand, what each kind allows, held-out levels, release."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import eaid
from benchmarks import fit_quality
from eaid.apparatus import Apparatus
from eaid.errors import DataError, UsageError
from eaid.plant import linear
from eaid.plant.dynamics import REFERENCE_PLANT, Step
from eaid.plant.linear import PAPER_LINEAR, LinearPlant
from eaid.plant.respond import from_rest
from eaid.plant.steps import step_response, step_slopes
from eaid.steps.stepset import Level, StepSet

from ..conftest import codes

Maker = Callable[..., StepSet]
T = np.arange(2000) / 100


def steps_of(*rows: tuple[float, Any, Any], releases: tuple[Level, ...] = (), kind: str = "clutch") -> StepSet:
    """A set of (level, times, output of one run)."""
    levels = tuple(Level(u, np.asarray(t, float), np.asarray(y, float)[None], (f"{u}",)) for u, t, y in rows)
    return StepSet(kind, "%", "N·m", Apparatus(), levels, releases)


def quick(steps: StepSet, **options: Any) -> eaid.Fit:
    return eaid.fit(steps, ci="none", **options)


# NIST StRD, public domain: y = b1 (1 − e^(−b2 x)), which is one level of the linear model; certified b1, b2, their
# standard deviations and the residual sum of squares.
NIST = {
    "BoxBOD": (
        [1, 2, 3, 5, 7, 10],
        [109, 149, 149, 191, 213, 224],
        (2.1380940889e02, 5.4723748542e-01, 1.2354515176e01, 1.0455993237e-01, 1.1680088766e03),
        2.7764451052,
    ),
    "Misra1a": (
        [77.6, 114.9, 141.1, 190.8, 239.9, 289.0, 332.8, 378.4, 434.8, 477.3, 536.8, 593.1, 689.1, 760.0],
        [10.07, 14.73, 17.94, 23.93, 29.61, 35.18, 40.02, 44.82, 50.76, 55.05, 61.01, 66.40, 75.47, 81.78],
        (2.3894212918e02, 5.5015643181e-04, 2.7070075241e00, 7.2668688436e-06, 1.2455138894e-01),
        2.1788128297,
    ),
}


@pytest.mark.parametrize("name", NIST)
def test_nist_certified_values_and_standard_deviations(name: str) -> None:
    x, y, (b1, b2, sd1, sd2, squares), t = NIST[name]
    (row,) = eaid.fit(steps_of((1.0, x, y)), model=("linear",), ci="white").linear.per_level
    assert (row.gain, row.a0) == (pytest.approx(b1, rel=1e-8), pytest.approx(b2, rel=1e-8))
    assert row.sse == pytest.approx(squares, rel=1e-9)
    for (low, high), sd in ((row.ci95.gain, sd1), (row.ci95.a0, sd2)):
        assert (high - low) / 2 / t == pytest.approx(sd, rel=1e-6)


@pytest.mark.parametrize(
    ("levels", "duration_s", "published", "rmse", "each", "bounds"),
    [
        (
            range(10, 101, 10), 20.0, (1.84393, 0.0782825, -1.343124), 0.300604,
            [23.044, 36.505, 41.142, 40.831, 37.706, 32.974, 27.340, 21.221, 14.854, 8.349], (8.349, 41.142),
        ),
        (range(30, 101, 10), 60.0, (1.55135, 0.0814392, -2.113226), None, None, (9.597, 45.875)),
    ],
)  # fmt: skip
def test_linear_model_of_the_reference_plant(
    levels: Any, duration_s: float, published: Any, rmse: Any, each: Any, bounds: Any, clutch_set: Maker
) -> None:
    found = quick(clutch_set(levels=levels, duration_s=duration_s), model=("linear",)).linear
    assert (round(found.a0, 5), round(found.b0, 7), round(found.c0, 6)) == published
    assert (found.bounds.B_m, found.bounds.B_M) == pytest.approx(bounds, abs=5e-4)
    if rmse is not None:
        assert found.rmse == pytest.approx(rmse, abs=5e-7)
        assert [row.B for row in found.per_level] == pytest.approx(each, abs=5e-4)


@pytest.mark.parametrize(
    ("p", "levels"), [(PAPER_LINEAR, (40.0, 70.0, 100.0)), (LinearPlant(0.5, 3, 0.4), (0.2, 0.5, 0.8))]
)
def test_a_linear_plant_returns_and_each_level_has_its_offset_in_b0(p: LinearPlant, levels: tuple[float, ...]) -> None:
    steps = steps_of(*((u, T, linear.linear_response(p, T, u)) for u in levels))
    found = quick(steps, model=("linear",), bounds_levels=f"{levels[1]},{levels[2]}").linear
    assert (found.a0, found.b0, found.c0) == pytest.approx((p.a0, p.b0, p.c0), rel=1e-8)
    assert [row.b0 for row in found.per_level] == pytest.approx([p.b0 + p.c0 / u for u in levels], rel=1e-8)
    assert all(row.c0 == 0 for row in found.per_level) and found.bounds.levels == levels[1:]
    ends = sorted(1 / (p.b0 + p.c0 / u) for u in levels[1:])
    assert [found.bounds.B_m, found.bounds.B_M] == pytest.approx(ends, rel=1e-8)


def test_a_level_that_falls_has_no_b_and_one_level_no_offset(clutch_set: Maker) -> None:
    fallen = quick(steps_of((50.0, T, np.exp(-T) - 1)), model=("linear",)).linear
    assert fallen.per_level[0].b0 == pytest.approx(-1 / 50, rel=1e-6)
    assert fallen.per_level[0].B is None and fallen.bounds.B_m is None
    one = quick(clutch_set(levels=[60], duration_s=5.0, rate_hz=100.0), model=("linear",)).linear
    assert one.c0 == 0.0 and one.b0 > 0


@pytest.mark.parametrize("share", [0.85, "free"])
@pytest.mark.parametrize(
    "truth", [Step(1.7, 0.35, 6.0), Step(0.05, 0.02, 0.9), Step(300.0, 1.5, 25.0), Step(2.0, 0.1, 1.2, 0.5)]
)
def test_one_level_returns(truth: Step, share: Any) -> None:
    held = truth.C if share == 0.85 else share
    found = quick(steps_of((50.0, T, step_response(truth, T))), model=("friction",), share=held).friction
    row = found.levels[0]
    assert (row.Ts, row.tau1, row.tau2, row.C) == pytest.approx((truth.Ts, truth.tau1, truth.tau2, truth.C), rel=1e-6)


def test_what_a_constraint_holds_is_named() -> None:
    overshoot = 1 - np.exp(-2 * T) * (np.cos(6 * T) + np.sin(6 * T) / 3)  # no such curve falls again
    row = quick(steps_of((50.0, T, overshoot)), model=("friction",)).friction.levels[0]
    assert "tau2-meets-tau1" in row.solver.at_bounds and row.tau1 == pytest.approx(row.tau2, rel=1e-9)
    y = np.array([0.0, -3.0, -4.0])  # T_s = 0 is best for a falling output: what is left is the data
    found = quick(steps_of((50.0, [0.0, 1.0, 2.0], y)), model=("friction",))
    row = found.friction.levels[0]
    assert row.Ts == 0 and "output-does-not-rise" in {one.code for one in found.findings}
    assert row.sse == pytest.approx(25.0) and row.rmse == pytest.approx(np.sqrt(25 / 3))


@pytest.mark.parametrize("seed", range(4))
def test_a_level_has_the_cost_of_the_best_of_a_fine_grid(seed: int) -> None:
    """T_s solved for at each pair of time constants."""
    rng = np.random.default_rng(seed)
    t = np.arange(500) / 50
    truth = Step(rng.uniform(0.1, 4), np.exp(rng.uniform(-2, 0)), np.exp(rng.uniform(0.2, 3.0)))
    y = step_response(truth, t) + 0.02 * rng.normal(size=len(t))
    found = quick(steps_of((50.0, t, y)), model=("friction",)).friction.levels[0]
    rises = -np.expm1(-t / np.geomspace(0.02, 300, 80)[:, None])
    pairs = 0.85 * rises[:, None] + 0.15 * rises[None]
    gain = np.maximum(pairs @ y, 0) ** 2 / (pairs**2).sum(axis=2)
    ordered = np.triu(np.ones((80, 80), dtype=bool))
    assert found.sse <= float(y @ y - gain[ordered].max()) * (1 + 1e-9)


def test_metrics_are_those_of_the_curves(clutch_set: Maker) -> None:
    steps = clutch_set(duration_s=8.0, rate_hz=100.0, noise_nm=0.02, repeats=3)
    found = quick(steps, estimator="joint")
    part = found.nonlinear
    assert found.friction and found.linear and not found.release and found.converged
    left = [from_rest(part.parameters, one.time_s, one.level) - one.mean for one in steps.levels]
    for row, r, level in zip(part.per_level, left, steps.levels, strict=True):
        about = level.mean - level.mean.mean()
        assert row.sse == pytest.approx(r @ r, rel=1e-9) and row.rmse == pytest.approx(np.sqrt(np.mean(r**2)))
        assert pytest.approx(1 - (r @ r) / (about @ about)) == row.R2
        assert row.fit_pct == pytest.approx(100 * (1 - np.sqrt((r @ r) / (about @ about))))
    r, y = np.concatenate(left), np.concatenate([one.mean for one in steps.levels])
    assert part.sse == pytest.approx(r @ r, rel=1e-9) and part.rmse == pytest.approx(np.sqrt(np.mean(r**2)))
    assert (part.abs_error.mean, part.abs_error.sd) == pytest.approx((np.abs(r).mean(), np.abs(r).std()))
    assert pytest.approx(1 - (r @ r) / ((y - y.mean()) ** 2).sum()) == part.R2
    assert found.data.levels == tuple(one.level for one in steps.levels) and set(found.data.repeats) == {3}
    assert set(found.data.samples) == {800} and set(found.data.record_s) == {7.99}


def test_a_closed_loop_is_not_explained(clutch_set: Maker) -> None:
    """A square wave under a level that was taken for one step: converged, and of severity stop."""
    steps = clutch_set(levels=[40], duration_s=20.0, rate_hz=50.0)
    wave = 1.0 + np.sign(np.sin(2 * np.pi * steps.levels[0].time_s / 8.0))
    found = quick(replace(steps, levels=(replace(steps.levels[0], runs=wave[None]),)), shape="one")
    stops = {(one.code, one.subject) for one in found.findings if one.severity == "stop"}
    assert found.converged
    assert {("curve-explains-little", "friction"), ("model-explains-little", "nonlinear")} <= stops


def test_levels_at_which_the_input_does_not_act_yet_are_named_and_left_out() -> None:
    random = np.random.default_rng(1)
    rows = [
        (u, T, step_response(Step(max(u - 20, 0) / 20, 0.3, 6.0), T)) for u in (10.0, 20.0, 40.0, 60.0, 80.0, 100.0)
    ]
    found = quick(steps_of(*((u, t, y + 0.02 * random.standard_normal(len(t))) for u, t, y in rows)))
    told = {one.code: one for one in found.findings}
    assert told["output-stays-at-rest"].levels == (10.0, 20.0) and "curve-explains-little" not in told
    assert found.data.levels == (40.0, 60.0, 80.0, 100.0) and found.plant.u_range[0] == 40.0


def judged(t: Any, y: Any) -> bool:
    return "curve-explains-little" in codes(quick(steps_of((50.0, t, y)), model=("friction",)))


def test_noise_and_a_wave_on_a_step_are_no_alarm() -> None:
    rng, t = np.random.default_rng(0), np.linspace(0, 10, 2000)
    assert not judged(t, 1 - np.exp(-t) + 0.5 * rng.normal(size=len(t)))
    assert not judged(t, 1 + 0.1 * np.sin(t))
    assert judged(t, 1 + np.sin(2 * np.pi * t / 5))


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"loss": "l1"}, "loss"),
        ({"share": 1.5}, "share"),
        ({"hold_out": (45.0,)}, "no such level; there are 10, 20, 30, 40, 50, 60, 70, 80, 90, 100"),
        ({"hold_out": tuple(range(10, 101, 10))}, "every level is held out; leave some to be fitted"),
        ({"shape": "three"}, "shape"),
        ({"dead_time": -1.0}, "dead_time"),
        ({"duty": (10.0, 100.0)}, "these are steps; leave it out"),
    ],
)
def test_options_that_are_refused(options: dict[str, Any], sentence: str, clutch_set: Maker) -> None:
    with pytest.raises(UsageError, match=sentence):
        quick(clutch_set(rate_hz=10.0), **options)


def test_what_cannot_be_fitted_is_refused(clutch_set: Maker, friction_set: Maker) -> None:
    with pytest.raises(UsageError, match="friction-force logs can be fitted with friction"):
        quick(friction_set("friction-force", "N", {17.0: Step(1, 0.2, 3)}), model=("linear",))
    with pytest.raises(DataError, match="no rising step was found"):
        quick(replace(clutch_set(rate_hz=10.0), levels=()))


def test_a_solver_that_ends_away_from_the_minimum_is_exit_four(
    monkeypatch: pytest.MonkeyPatch, run_eaid: Any, tmp_path: Path, small_steps: StepSet
) -> None:
    monkeypatch.setattr("eaid.levels.from_steps.polish", lambda _problem, end, *_, **__: (end, 1e-3, ()))
    small_steps.save(tmp_path / "data.h5")
    ran = run_eaid("fit", tmp_path / "data.h5", "-o", tmp_path / "fit.json", "--estimator", "joint", "--ci", "none")
    assert ran.code == 4 and not eaid.load(tmp_path / "fit.json").converged


def test_held_out_levels_are_predicted_not_fitted(clutch_set: Maker) -> None:
    steps = clutch_set(rate_hz=50.0, noise_nm=0.01)
    odd = replace(steps.levels[3], runs=steps.levels[3].runs * 1.5)  # were it fitted, the rest would suffer
    steps = replace(steps, levels=(*steps.levels[:3], odd, *steps.levels[4:]))
    found = quick(steps, hold_out=(40.0, 70.0), estimator="joint")
    part = found.nonlinear
    assert found.linear.hold_out and part.rmse == pytest.approx(0.01, rel=0.05)
    rows = {row.level: row.rmse for row in part.hold_out.levels}
    assert rows.keys() == {40.0, 70.0} and rows[70.0] == pytest.approx(0.01, rel=0.1) and rows[40.0] > 0.2
    assert [one.level for one in part.per_level] == [10, 20, 30, 50, 60, 80, 90, 100]
    beyond = codes(quick(clutch_set(rate_hz=50.0), hold_out=(100.0,)))["held-out-beyond-the-levels"]
    assert beyond.levels == (100.0,) and beyond.subject == "nonlinear"


@pytest.mark.slow
def test_held_out_friction_levels_are_predicted_by_the_trends(friction_set: Maker) -> None:
    curves = {f: Step(0.015 * f, 0.1 + 2 * np.exp(-f / 30), 1 + 20 * np.exp(-f / 40)) for f in np.arange(20.0, 180, 20)}
    found = quick(friction_set("friction-force", "N", curves), hold_out=(100.0,)).friction
    assert found.hold_out.rmse < 1e-3 * curves[100.0].Ts


def test_huber_sees_past_spikes_and_is_at_the_minimum_of_its_own_loss(clutch_set: Maker) -> None:
    steps = clutch_set(levels=[60], duration_s=5.0, rate_hz=40.0, noise_nm=0.05)
    t, y = steps.levels[0].time_s, steps.levels[0].runs.copy()
    y[0, ::17] += 2.0
    steps = replace(steps, levels=(replace(steps.levels[0], runs=y),))
    found = quick(steps, loss="huber", model=("friction",)).friction
    squares = quick(steps, model=("friction",)).friction
    true = step_response(REFERENCE_PLANT.at(60.0), t)
    off = [np.abs(step_response(one.levels[0].curve, t) - true).max() for one in (found, squares)]
    assert off[0] < 0.5 * off[1]
    p = found.levels[0].curve
    missed = step_response(p, t) - y[0]
    cut = 1.345 * 1.4826 * np.median(np.abs(missed))
    pulls = np.clip(missed, -cut, cut)
    slopes = step_slopes(p, t)[:3]
    assert np.abs((slopes @ pulls) / (np.abs(slopes) @ np.abs(pulls))).max() < 1e-5
    assert cut < 0.1 * np.abs(missed).max()


@pytest.mark.slow
def test_trends_need_levels_and_units(friction_set: Maker) -> None:
    curves = {p: Step(10.0 + p, 0.1, 1.0) for p in (1.0, 3.0, 5.0, 7.0)}
    found = quick(friction_set("friction-force", "bar", curves))
    part = found.friction
    assert part.over == "stress_kpa" and [one.stress_kpa for one in part.levels] == [100.0, 300.0, 500.0, 700.0]
    assert part.trends.keys() == {"Ts"} and part.trends["Ts"].coefficients == pytest.approx((0.01, 10.0))
    told = [one.values for one in found.findings if one.code == "trend-needs-levels"]
    assert ("tau1", "stress_kpa", 4) in [(one["parameter"], one["over"], one["count"]) for one in told]
    volts = quick(friction_set("friction-force", "V", curves))
    assert volts.friction.over == "level_V" and all(one.C_f is None for one in volts.friction.levels)
    assert "level-is-no-stress" in codes(volts)


def test_coefficient_of_friction_by_hand(friction_set: Maker) -> None:
    """T_s = 2.459 N·m at 170 N with one surface: C_f = 0.286."""
    found = quick(friction_set("friction-force", "N", {170.0: Step(2.459, 0.3, 4.0)})).friction
    assert found.levels[0].C_f == pytest.approx(0.2855, abs=5e-4)


@pytest.mark.parametrize(("levels", "zeros"), [([50], 3), ([40, 80], 2), ([30, 60, 90], 1)])
def test_few_levels_leave_the_high_coefficients_at_zero(levels: list[float], zeros: int, clutch_set: Maker) -> None:
    p = quick(clutch_set(levels=levels, rate_hz=50.0), model=("nonlinear",), estimator="joint").plant
    assert len(p.Ts) == 4 and p.Ts[4 - zeros :] == (0.0,) * zeros and len(p.tau1) == 3
    for u in levels:
        assert p.steady(u) == pytest.approx(REFERENCE_PLANT.steady(u), rel=1e-6)


@pytest.mark.slow
def test_constraints_hold_between_the_levels_too() -> None:
    held = 0
    for seed in (3, 7, 15):
        case = fit_quality.make(seed)
        rows = ((float(u), case.t_s, y) for u, y in zip(fit_quality.LEVELS, case.y, strict=True))
        found = quick(steps_of(*rows), model=("nonlinear",), estimator="joint")
        u = np.linspace(10, 100, 101)
        tau1, tau2 = found.plant.time_constants(u)
        assert tau1.min() >= 1e-3 - 1e-9 and (tau2 - tau1).min() >= -1e-9
        assert found.plant.steady(u).min() >= -1e-9 and found.converged
        held += bool(found.nonlinear.solver.at_bounds)
    assert held


HELD_S, RISES = 20.0, {40.0: Step(0.8, 0.6, 12.0), 80.0: Step(2.8, 0.55, 17.0)}


def released(tau1: float, tau2: float, left: float = 0.0) -> StepSet:
    """Both states after HELD_S at the level, let go to zero, or to a share of T_s."""
    falls = []
    for u, rise in RISES.items():
        x1, x2 = (share * rise.Ts * -np.expm1(-HELD_S / tau) for share, tau in ((0.85, rise.tau1), (0.15, rise.tau2)))
        y = left * rise.Ts + x1 * np.exp(-T / tau1) + x2 * np.exp(-T / tau2)
        falls.append(Level(u, T, y[None], (f"{u}",)))
    rows = ((u, T, step_response(rise, T)) for u, rise in RISES.items())
    return steps_of(*rows, releases=tuple(falls))


def test_a_release_of_one_lag_has_one_time_constant() -> None:
    """A slow part that never comes, and an output that falls below rest by it, explain noise as well."""
    falls = [
        replace(one, runs=one.runs + 0.005 * np.random.default_rng(seed).standard_normal(one.runs.shape))
        for seed, one in enumerate(released(0.4, 0.4).releases, 2)
    ]
    found = quick(replace(released(0.4, 0.4), releases=tuple(falls)))
    assert (found.release.tau1, found.release.tau2) == pytest.approx((0.4, 0.4), rel=0.1)


def test_a_slow_part_that_never_comes_is_weighed_as_the_levels_are() -> None:
    """One lag behind a dead time that is known to a part of a sample: T_s is not what an endless τ2 makes of it."""
    t, random = np.arange(0.0, 14.0, 0.01), np.random.default_rng(1)
    logs: dict[str, pd.DataFrame] = {}
    for u in (2.0, 4.0, 6.0, 8.0, 10.0) * 3:
        y = 3 * u * -np.expm1(-np.maximum(t - 1.15, 0) / 0.4) * (1 + 0.01 * random.standard_normal())
        noisy = y + 0.15 * random.standard_normal(len(t))
        logs[f"r{len(logs)}"] = pd.DataFrame({"time_s": t, "input_V": np.where(t >= 1, u, 0.0), "force_N": noisy})
    found = quick(eaid.read(logs, input="input_V", output="force_N"))
    assert found.plant.steady(np.array([2.0, 10.0])) == pytest.approx([6.0, 30.0], rel=0.03)


def test_output_that_is_left_and_a_release_beyond_its_record_are_told() -> None:
    found = quick(released(0.2, 1.0, left=0.3))
    assert codes(found)["release-leaves-output"].levels == (40.0, 80.0)
    assert "release-beyond-record" in codes(quick(released(0.25, 120.0)))
