"""Steps between levels stand in the fit with what they go from, and a set of nothing else is a fit all the same."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from eaid.apparatus import Apparatus
from eaid.arrays import Array
from eaid.findings import finding, ranked
from eaid.models import friction
from eaid.models.parameters import Friction
from eaid.options import FitOptions
from eaid.results import codec
from eaid.results.fit import Fit, FrictionLevel, LevelIntervals
from eaid.steps.stepset import Level, LevelStep, StepSet
from eaid.uncertainty.workflow import fit_steps, quotable

TIME = np.arange(2000) * 0.01
TRUTH = ((20.0, 50.0, 0.4, 1.6, Friction(1.2, 0.3, 4.0)), (50.0, 30.0, 1.6, 0.9, Friction(-0.7, 0.2, 3.0)))


def staircase() -> StepSet:
    random = np.random.default_rng(0)
    steps = []
    for i, (before, after, start, _, curve) in enumerate(TRUTH):
        y = start + friction.step_response(curve, TIME) + 0.002 * random.standard_normal(len(TIME))
        steps.append(LevelStep(f"run{i}", "", before, after, start, TIME, y, np.full(len(TIME), after)))
    return StepSet("clutch", "%", "N·m", Apparatus(), (), level_steps=tuple(steps))


def test_a_staircase_without_rest_is_fitted_step_by_step(tmp_path: Path) -> None:
    found = fit_steps(staircase(), FitOptions(shape="two"))
    assert found.friction is not None and found.nonlinear is None and found.converged
    for row, (before, after, start, _, curve) in zip(found.friction.levels, TRUTH, strict=True):
        assert (row.from_, row.level, row.start, row.shape) == (before, after, start, "two")
        assert (row.Ts, row.tau1, row.tau2) == pytest.approx((curve.Ts, curve.tau1, curve.tau2), rel=0.03)
        assert row.fit_pct is not None and row.fit_pct > 95
    codec.write(tmp_path / "fit.json", found, "fit")
    rows = json.loads((tmp_path / "fit.json").read_text())["friction"]["levels"]
    assert [(row["from"], row["level"]) for row in rows] == [(20.0, 50.0), (50.0, 30.0)]
    assert codec.read(tmp_path / "fit.json", "fit", Fit)[0].friction == found.friction


def test_what_no_file_can_hold_is_left_out_and_named() -> None:
    kept, keys = quotable(FrictionLevel(10.0, 1.0, 0.1, 1.0, rmse=float("nan")))
    assert kept.rmse is None and kept.Ts == 1.0 and keys == ("rmse",)


@pytest.mark.parametrize("end", [float("inf"), 1e257, float("nan")])
def test_an_interval_without_an_end_is_none(end: float) -> None:
    kept, keys = quotable(LevelIntervals(Ts=(1.0, 2.0), tau2=(1.0, end)))
    assert kept == LevelIntervals(Ts=(1.0, 2.0)) and keys == ("tau2",)


def test_what_decides_whether_a_model_is_of_use_comes_first_among_alike() -> None:
    codes = ("fast-rise-not-resolved", "output-decays-under-hold", "starts-end-apart", "curve-explains-little")
    values = {"unit": "%", "worst": 1.0, "lost_pct": 9.0, "of": 1, "higher": 1, "starts": 2}
    found = ranked(finding(code, "friction", (1.0,), **values) for code in codes)
    order = ["curve-explains-little", "output-decays-under-hold", "fast-rise-not-resolved", "starts-end-apart"]
    assert [one.code for one in found] == order


def from_rest(response: Callable[[float], Array], levels: int = 5) -> StepSet:
    """Steps from rest, one a level, of a response of unit gain by level, with their noise."""
    random, steps, whole = np.random.default_rng(1), [], []
    for k in range(1, levels + 1):
        u = 20.0 * k
        y = 0.02 * u * response(u) + 0.002 * random.standard_normal(len(TIME))
        steps.append(LevelStep(f"run{k}", "", 0.0, u, 0.0, TIME, y, np.full(len(TIME), u)))
        whole.append(Level(u, TIME, y[None], (f"run{k}",)))
    return StepSet("clutch", "%", "N·m", Apparatus(), tuple(whole), level_steps=tuple(steps))


def late(_: float) -> Array:
    return np.where(TIME > 0.4, 1 - np.exp(-(TIME - 0.4) / 0.8), 0.0)


def overshooting(_: float) -> Array:
    return 1 - 1.2 * np.exp(-TIME / 0.3) + 0.2 * np.exp(-TIME / 3.0)


def papers(_: float) -> Array:
    return 1 - 0.85 * np.exp(-TIME / 0.3) - 0.15 * np.exp(-TIME / 3.0)


@pytest.mark.slow
def test_many_levels_from_rest_show_the_shape_that_they_ask_for() -> None:
    """A dead time, or an overshoot, at every level of a set that the paper's form is fitted to."""
    behind = fit_steps(from_rest(late), FitOptions(ci="white"))
    assert [one.level for one in behind.steps] == [20.0, 40.0, 60.0, 80.0, 100.0]
    for one in behind.steps:
        assert (one.shape, one.dead_time_s, one.tau1) == ("one", pytest.approx(0.4, abs=0.02), pytest.approx(0.8, 0.02))
        assert one.ci95.tau1 is not None
    over = fit_steps(from_rest(overshooting), FitOptions(ci="none")).steps
    assert {one.shape for one in over} == {"overshoot"} and len(over) == 5
    assert np.mean([one.C for one in over]) == pytest.approx(1.2, abs=0.02)
    said = [one for one in behind.findings if one.code == "other-shape-fits-better"]
    assert len(said) == 1 and said[0].values["others"] == 4
    assert fit_steps(from_rest(papers), FitOptions(ci="none")).steps == ()
