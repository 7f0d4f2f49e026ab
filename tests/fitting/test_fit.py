"""StepSet → Fit: what each kind allows, held-out levels, loss, warnings in words, fit.json."""

import json
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from eaid.errors import DataError, UsageError
from eaid.fitting.data import errors, explains_little, quality
from eaid.fitting.fit import fit
from eaid.models.parameters import REFERENCE_PLANT, Friction
from eaid.options import FitOptions
from eaid.results import codec
from eaid.results.fit import Fit
from eaid.steps.stepset import Level, StepSet

Maker = Callable[..., StepSet]


def test_metrics_by_hand() -> None:
    y, r = np.array([1.0, 3.0, 5.0, 7.0]), np.array([3.0, -4.0, 0.0, 0.0])
    found = errors([y], [r])
    assert found.sse == 25 and found.rmse == 2.5 and found.abs_error.mean == 1.75
    assert found.abs_error.sd == pytest.approx(np.std([3, 4, 0, 0]))
    assert pytest.approx(1 - 25 / 20) == found.R2 and found.fit_pct == pytest.approx(100 * (1 - np.sqrt(25 / 20)))
    both = [np.array([1.0, 1.0]), np.array([4.0])]  # their common mean is 2, Σ(y − 2)² is 6
    total = errors(both, [np.array([1.0, -1.0]), np.array([1.0])])
    assert total.sse == 3 and total.abs_error.mean == pytest.approx(1.0) and pytest.approx(0.5) == total.R2
    assert quality(1.0, [np.ones(4)]) == (None, None)


def test_little_is_explained_of_a_wave_much_of_a_flat_or_noisy_step() -> None:
    t = np.linspace(0, 10, 2000)
    noise = np.random.default_rng(0).normal(size=len(t))
    step = 1 - np.exp(-t)
    assert not explains_little([step + 0.5 * noise], [-0.5 * noise])  # R² is 0.1, and all that is missed is noise
    assert not explains_little([np.ones_like(t) + 0.1 * np.sin(t)], [-0.1 * np.sin(t)])  # no R² either, but close
    wave = 1 + np.sin(2 * np.pi * t / 5)
    assert explains_little([wave], [np.ones_like(t) - wave])


def test_a_closed_loop_is_not_explained(clutch_set: Maker) -> None:
    """A square wave under a level that was taken for one step: converged, and of severity stop."""
    steps = clutch_set(levels=[40], duration_s=20.0, rate_hz=50.0)
    (level,) = steps.levels
    wave = 1.0 + np.sign(np.sin(2 * np.pi * level.time_s / 8.0))
    found = fit(replace(steps, levels=(replace(level, runs=wave[None]),)))
    assert found.converged
    stops = {(one.code, one.subject) for one in found.findings if one.severity == "stop"}
    assert ("curve-explains-little", "friction") in stops and ("model-explains-little", "nonlinear") in stops


def test_a_clutch_set_gets_all_three_models_and_its_metrics_are_those_of_its_curves(clutch_set: Maker) -> None:
    steps = clutch_set(duration_s=8.0, rate_hz=100.0, noise_nm=0.02, repeats=3)
    found = fit(steps)
    assert found.friction and found.nonlinear and found.linear and not found.release and found.converged
    left = np.concatenate(
        [
            level.runs.mean(axis=0) - _curve(found.nonlinear.parameters, level.time_s, level.level)
            for level in steps.levels
        ]
    )
    assert found.nonlinear.sse == pytest.approx(left @ left, rel=1e-9)
    assert found.nonlinear.rmse == pytest.approx(np.sqrt(np.mean(left**2)), rel=1e-9)
    assert found.nonlinear.abs_error is not None
    assert (found.nonlinear.abs_error.mean, found.nonlinear.abs_error.sd) == pytest.approx(
        (np.abs(left).mean(), np.abs(left).std()), rel=1e-9
    )
    y = np.concatenate([level.mean for level in steps.levels])
    assert pytest.approx(1 - left @ left / ((y - y.mean()) ** 2).sum(), rel=1e-9) == found.nonlinear.R2
    for part in (found.friction.levels, found.nonlinear.per_level, found.linear.per_level):
        assert all(one.fit_pct is not None and 0 < one.fit_pct <= 100 for one in part[3:])
    assert sum(one.sse for one in found.nonlinear.per_level) == pytest.approx(found.nonlinear.sse)


def _curve(p: object, t: np.ndarray, u: float) -> np.ndarray:
    from eaid.models.nonlinear import step_response

    return step_response(p, t, u)  # type: ignore[arg-type]


def test_kinds_and_models_that_do_not_go_together(clutch_set: Maker, friction_set: Maker) -> None:
    with pytest.raises(UsageError, match="friction-force logs can be fitted with friction"):
        fit(friction_set("friction-force", "N", {17.0: Friction(1, 0.2, 3)}), FitOptions(model=("linear",)))
    assert fit(clutch_set(rate_hz=20.0), FitOptions(model=("linear",))).nonlinear is None


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (FitOptions(loss="l1"), "loss= l1: must be one of squares, huber"),
        (FitOptions(share=1.5), "share= 1.5: the share of the fast part lies between 0 and 1; or say free"),
        (FitOptions(share=None), "share= None: the share of the fast part lies between 0 and 1; or say free"),
        (
            FitOptions(hold_out=(45.0,)),
            "hold_out= 45: no such level; there are 10, 20, 30, 40, 50, 60, 70, 80, 90, 100",
        ),
        (
            FitOptions(hold_out=tuple(range(10, 101, 10))),
            "hold_out=: every level is held out; leave some to be fitted",
        ),
    ],
)
def test_choices_that_are_refused(options: FitOptions, sentence: str, clutch_set: Maker) -> None:
    with pytest.raises(UsageError) as caught:
        fit(clutch_set(rate_hz=10.0), options)
    assert str(caught.value) == sentence


def test_no_step_no_fit(clutch_set: Maker) -> None:
    with pytest.raises(DataError, match="no rising step was found"):
        fit(replace(clutch_set(rate_hz=10.0), levels=()))


def test_held_out_levels_are_predicted_not_fitted(clutch_set: Maker) -> None:
    steps = clutch_set(rate_hz=50.0, noise_nm=0.01)
    # A level that follows no model of the rest: were it fitted, the rest would suffer.
    odd = replace(steps.levels[3], runs=steps.levels[3].runs * 1.5)
    steps = replace(steps, levels=(*steps.levels[:3], odd, *steps.levels[4:]))
    found = fit(steps, FitOptions(hold_out=(40.0, 70.0)))
    assert found.nonlinear and found.linear and found.nonlinear.hold_out and found.linear.hold_out
    assert found.nonlinear.rmse == pytest.approx(0.01, rel=0.05)
    rows = {row.level: row.rmse for row in found.nonlinear.hold_out.levels}
    assert rows.keys() == {40.0, 70.0} and rows[70.0] == pytest.approx(0.01, rel=0.1) and rows[40.0] > 0.2
    assert [one.level for one in found.nonlinear.per_level] == [10, 20, 30, 50, 60, 80, 90, 100]


def test_held_out_friction_levels_are_predicted_by_the_trends(friction_set: Maker) -> None:
    curves = {
        f: Friction(0.015 * f, 0.1 + 2 * np.exp(-f / 30), 1 + 20 * np.exp(-f / 40)) for f in np.arange(20.0, 180, 20)
    }
    found = fit(friction_set("friction-force", "N", curves), FitOptions(hold_out=(100.0,)))
    assert found.friction and found.friction.hold_out
    assert found.friction.hold_out.rmse < 1e-3 * curves[100.0].Ts


@pytest.mark.slow
def test_huber_sees_past_spikes_and_shows_its_weights(clutch_set: Maker) -> None:
    steps = clutch_set(rate_hz=50.0, noise_nm=0.005)
    spiked = steps.levels[6].runs.copy()
    spiked[0, 100:160] = 0.0  # a drop-out
    steps = replace(steps, levels=(*steps.levels[:6], replace(steps.levels[6], runs=spiked), *steps.levels[7:]))
    huber, squares = fit(steps, FitOptions(loss="huber")).nonlinear, fit(steps).nonlinear
    assert huber and squares and huber.robust and squares.robust is None and huber.robust.settled

    def off(p: object) -> float:
        return float(np.abs(_curve(p, TIME, 70.0) - _curve(REFERENCE_PLANT, TIME, 70.0)).max())

    TIME = steps.levels[6].time_s
    assert off(huber.parameters) < 0.1 * off(squares.parameters)
    rows = {row.level: row for row in huber.robust.weights}
    assert rows[70.0].least < 0.01 and rows[70.0].mean < rows[60.0].mean and rows[60.0].least > 0.2
    assert huber.robust.sigma == pytest.approx(0.005, rel=0.05)


def test_huber_is_at_the_minimum_of_its_own_loss(clutch_set: Maker) -> None:
    steps = clutch_set(levels=[60], duration_s=5.0, rate_hz=40.0, noise_nm=0.05)
    y = steps.levels[0].runs.copy()
    y[0, ::17] += 2.0
    steps = replace(steps, levels=(replace(steps.levels[0], runs=y),))
    found = fit(steps, FitOptions(loss="huber", model=("friction",))).friction
    assert found and found.robust
    from eaid.models import friction

    p, cut = found.levels[0].curve, 1.345 * found.robust.sigma
    r = friction.step_response(p, steps.levels[0].time_s) - y[0]
    slope = friction.gradient(p, steps.levels[0].time_s)[:3] @ np.clip(r, -cut, cut)
    size = np.abs(friction.gradient(p, steps.levels[0].time_s)[:3]) @ np.abs(np.clip(r, -cut, cut))
    assert np.abs(slope / size).max() < 1e-5


def codes(found: Fit) -> set[str]:
    return {one.code for one in found.findings}


def test_what_the_data_cannot_tell_is_found(clutch_set: Maker) -> None:
    outside = fit(clutch_set(rate_hz=50.0), FitOptions(hold_out=(100.0,)))
    (one,) = [one for one in outside.findings if one.code == "held-out-beyond-the-levels"]
    assert one.levels == (100.0,) and one.subject == "nonlinear"
    low = fit(clutch_set(rate_hz=50.0))
    (one,) = [one for one in low.findings if one.code == "linear-output-negative"]
    assert one.levels == (10.0,) and one.severity == "caution"


def test_trends_need_levels_and_units(friction_set: Maker) -> None:
    curves = {p: Friction(10.0 + p, 0.1, 1.0) for p in (1.0, 3.0, 5.0, 7.0)}
    whole = fit(friction_set("friction-force", "bar", curves))
    found = whole.friction
    assert found and found.over == "stress_kpa" and found.x == (100.0, 300.0, 500.0, 700.0)
    assert found.trends.keys() == {"Ts"} and found.trends["Ts"].coefficients == pytest.approx((0.01, 10.0))
    (one,) = [one for one in whole.findings if one.code == "trend-needs-levels" and one.values["parameter"] == "tau1"]
    assert one.values["over"] == "stress_kpa" and one.values["count"] == 4
    told = fit(friction_set("friction-force", "V", curves))
    assert told.friction and told.friction.over == "level_V" and all(one.C_f is None for one in told.friction.levels)
    assert "level-is-no-stress" in codes(told)


def test_coefficient_of_friction_by_hand(friction_set: Maker) -> None:
    # T_s = 2.459 N·m at 170 N with one surface: C_f = 0.286, specification 1
    found = fit(friction_set("friction-force", "N", {170.0: Friction(2.459, 0.3, 4.0)})).friction
    assert found and found.levels[0].C_f == pytest.approx(0.2855, abs=5e-4)


def test_fit_json_has_the_contract_s_keys_and_reads_back(clutch_set: Maker) -> None:
    steps = clutch_set(duration_s=5.0, rate_hz=50.0, noise_nm=0.01)
    fitted = fit(steps)
    result = json.loads(codec.dumps(fitted, "fit"))
    assert result["data"]["kind"] == "clutch" and result["data"]["levels"][0] == 10.0
    keys = "C tau1 tau2 Ts u_range rmse sse fit_pct R2 abs_error per_level solver warnings estimator"
    assert set(keys.split()) <= result["nonlinear"].keys()
    assert {"a0", "b0", "c0", "rmse", "sse", "fit_pct", "R2", "bounds", "solver"} <= result["linear"].keys()
    row = result["linear"]["per_level"][0]
    assert {"level", "a0", "gain", "b0", "c0", "B", "rmse", "sse", "fit_pct", "R2"} <= row.keys()
    assert {"convention", "levels", "B_m", "B_M"} <= result["linear"]["bounds"].keys()
    own = "level Ts tau1 tau2 rmse sse fit_pct R2 from start"
    assert set(own.split()) <= result["friction"]["levels"][0].keys()
    solver = result["nonlinear"]["solver"]
    assert {"method", "converged", "message", "predicted_decrease", "evaluations", "starts"} <= solver.keys()
    assert solver["method"] == "SLSQP" and all(start["cost"] > 0 for start in solver["starts"])
    back = codec.from_plain(result, Fit, "fit.json")
    assert back.plant == fitted.plant and back.linear_model == fitted.linear_model


def test_a_minimal_fit_json_is_enough() -> None:
    part = {"tau1": [0.3, 0, 0], "tau2": [4, 0, 0], "Ts": [0, 0.04, 0, 0], "u_range": [10, 100]}
    p = codec.from_plain({"nonlinear": part}, Fit, "fit.json").plant
    assert p.C == 0.85 and p.Ts == (0.0, 0.04, 0.0, 0.0) and p.release is None
    with pytest.raises(DataError, match="this fit holds no linear model"):
        _ = Fit().linear_model


def test_unequal_levels_are_fitted_as_well(clutch_set: Maker) -> None:
    steps = clutch_set(rate_hz=100.0)
    cut = tuple(
        Level(one.level, one.time_s[: 1000 + 100 * k], one.runs[:, : 1000 + 100 * k], one.names)
        for k, one in enumerate(steps.levels)
    )
    found = fit(replace(steps, levels=cut)).nonlinear
    assert found and found.parameters.tau2 == pytest.approx(REFERENCE_PLANT.tau2, rel=1e-6)


def test_what_was_fitted_is_told(clutch_set: Maker) -> None:
    made = clutch_set(rate_hz=10.0, repeats=2)
    data = fit(made, FitOptions(model=("linear",))).data
    assert data.levels == tuple(level.level for level in made.levels) and set(data.repeats) == {2}
    assert data.record_s == tuple(level.time_s[-1] for level in made.levels)
    assert data.samples == tuple(len(level.time_s) for level in made.levels)
