"""T_s(u) through the levels: one number a level, from the table to the exported code."""

import json
from dataclasses import replace

import msgspec
import numpy as np
import pandas as pd
import pytest

import eaid
from eaid.errors import UsageError
from eaid.plant.dynamics import Plant
from eaid.plant.operating import around
from eaid.plant.respond import respond

from .test_level_values import OFF, fitted

POINTS = ((10.0, 0.1), (40.0, 0.2), (55.0, 1.7), (100.0, 1.9))
BENT = Plant((0.1,), (2.0,), (0.0, 0.02), (10.0, 100.0), Ts_through=POINTS)


def test_values_are_met_and_nothing_overshoots_between() -> None:
    u = np.linspace(10, 100, 901)
    for at, value in POINTS:
        assert BENT.steady(at) == pytest.approx(value, rel=1e-14)
    assert (np.diff(BENT.steady(u)) >= 0).all()
    assert BENT.steady(5.0) == pytest.approx(0.05) and BENT.steady(120.0) == BENT.steady(100.0)


def test_what_is_controlled_is_what_is_replayed() -> None:
    h = 1e-5
    for u in (25.0, 47.0, 70.0):
        slope = (BENT.steady(u + h) - BENT.steady(u - h)) / (2 * h)
        assert around(BENT, u).gain == pytest.approx(float(slope), rel=1e-7)
    assert around(BENT, 5.0).gain == pytest.approx(0.01)  # on the line to rest
    t = np.arange(0.0, 60.0, 0.01)
    assert respond(BENT, [0.0], [47.0], t)[-1] == pytest.approx(float(BENT.steady(47.0)), rel=1e-6)


def test_every_surface_has_the_levels_own_value(tmp_path) -> None:
    cubic, fit = (fitted(20.0, 3, off=OFF, curve=name) for name in ("cubic", "levels"))
    assert "levels-scatter" in {one.code for one in cubic.findings} - {one.code for one in fit.findings}
    assert fit.nonlinear.fit_pct > cubic.nonlinear.fit_pct + 1
    for u in OFF:
        (row,) = [one for one in fit.friction_levels if one.level == u]
        assert fit.plant.steady(u) == pytest.approx(row.Ts, rel=1e-12)
        assert abs(float(cubic.plant.steady(u)) / row.Ts - 1) > 0.03
        assert next(one for one in fit.nonlinear.curves if one.level == u).ci95.Ts == row.ci95.Ts
    assert not any(name.startswith("Ts[") for _, name in fit.params.index)
    fit.save(tmp_path / "fit.json")
    again = eaid.load(tmp_path / "fit.json")
    assert again.plant == fit.plant and json.loads((tmp_path / "fit.json").read_text())["plant"]["Ts_through"]
    unseen = fit.nonlinear.left_out
    assert unseen.worst in OFF and "hold-out-fails" not in {one.code for one in fit.findings}


def test_drawn_plants_go_about_it() -> None:
    from eaid.estimate.draw import draw

    fit = fitted(20.0, 3, off=OFF, curve="levels")
    drawn = np.array([[float(p.steady(u)) for u in (30.0, 50.0, 70.0)] for p in draw(fit, 200, 1).plants])
    centre = np.array([float(fit.plant.steady(u)) for u in (30.0, 50.0, 70.0)])
    assert np.abs(np.median(drawn, axis=0) / centre - 1).max() < 0.02
    assert (drawn.std(axis=0) / centre > 0.005).all()


def test_one_level_is_its_value_and_inputs_have_to_rise() -> None:
    fit = fitted(8.0, 3, levels=np.array([60.0]), curve="levels")
    assert fit.plant.steady(60.0) == pytest.approx(fit.friction_levels[0].Ts) and not fit.plant.sloped
    fit = fitted(8.0, 3, off=OFF, curve="levels")
    with pytest.raises(ValueError, match="have to rise"):
        msgspec.structs.replace(fit.plant_, Ts_through=POINTS[::-1])


def test_it_is_refused_where_no_curve_of_levels_is_fitted() -> None:
    t = np.arange(800) * 0.05
    u = 50 + 40 * np.sin(0.3 * t) * np.sin(t)
    log = pd.DataFrame({"time_s": t, "duty_pct": u, "torque_Nm": respond(BENT, t, u, t)})
    with pytest.raises(UsageError, match="hold no levels"):
        eaid.fit(eaid.read(log, logs_as="recorded"), curve="levels", ci="none", shape="one")
    with pytest.raises(UsageError, match="nonlinear model, which is not fitted"):
        eaid.fit("datasets/friction-force.h5", curve="levels", ci="none")


@pytest.mark.parametrize(("runs", "options", "said"), [(1, {}, "needs repeats"), (3, {"estimator": "joint"}, "joint")])
def test_it_is_refused_where_no_level_has_its_own(runs, options, said) -> None:
    with pytest.raises(UsageError, match=said):
        fitted(8.0, runs, curve="levels", **options)


def test_a_spline_that_is_held_follows_what_no_cubic_does() -> None:
    inputs = np.linspace(10, 100, 46)
    steep = replace(BENT, Ts_through=tuple(zip(inputs, 2 + 1.8 * np.tanh((inputs - 55) / 22), strict=True)))
    t = np.arange(3000) * 0.05
    u = np.repeat(np.random.default_rng(4).uniform(10, 100, 75), 40) * (t > 2)
    noise = 0.02 * np.random.default_rng(5).standard_normal(len(t))
    log = pd.DataFrame({"time_s": t, "duty_pct": u, "torque_Nm": respond(steep, t, u, t) + noise})
    fit = eaid.fit(eaid.read(log, logs_as="recorded"), curve="spline", ci="none", model=("nonlinear",))
    at = np.linspace(20, 90, 15)
    assert np.abs(fit.plant.steady(at) - steep.steady(at)).max() < 0.03 * 3.8  # a cubic is 0.12 off
    (replayed,) = eaid.simulate(fit, log=log).records.values()
    assert replayed.metrics.fit_pct == pytest.approx(fit.logs[0].fit_pct, abs=0.01)
    steps = fitted(20.0, 3, off=OFF, curve="spline")
    assert steps.nonlinear.Ts_through and not steps.nonlinear.through_levels
    assert steps.nonlinear.left_out.fit_pct > 90
