"""Recorded runs against the model: a model's own run is explained whole; idle, releases, odd clocks, closed loops."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import eaid
from eaid.logs.run import Run
from eaid.replay.simulate import simulate

from ..conftest import PLANT
from .test_second_way import Plant

DT = 1e-3


def run(time_s, duty, torque, **further):
    settings = {"input_unit": "%", "output_unit": "N·m", "source": "x.csv", "sha256": "", "name": "x", **further}
    return Run(time_s=np.asarray(time_s), input=np.asarray(duty), output=np.asarray(torque), **settings)


def laid(fit, *runs, gains=None, **options):
    return simulate(fit, gains, eaid.SimulateOptions(**options), runs=runs)


def driven(time_s, duty, start=(0.0, 0.0), release=None):
    """Torque of the reference plant under held duties, by its closed form from row to row."""
    plant, torque = Plant(SimpleNamespace(**PLANT), release), []
    plant.x = start
    for u, step in zip(duty, np.append(np.diff(time_s), 0.0), strict=True):
        torque.append(sum(plant.x))
        plant.hold(u, step)
    return np.array(torque)


def idle_then_step(offset=0.03, rows=1000, edge="rising"):
    t = np.arange(rows + 2000) * DT
    duty = np.r_[np.zeros(rows), np.full(2000, 60.0)]
    return run(t + 7.0, duty, driven(t, duty) + offset, edge=edge)


def metrics(fit, one, **options):
    return laid(fit, one, **options).records["x"].metrics


def test_the_models_own_step_is_explained_and_idle_torque_is_taken_off(fit):
    found = metrics(fit, idle_then_step())
    assert found.idle_nm == pytest.approx(0.03) and found.max_abs_difference_nm < 1e-12
    assert (found.R2, found.fit_pct, found.one_step_pct) == pytest.approx((1.0, 100.0, 100.0))
    assert metrics(fit, idle_then_step(rows=10)).idle_nm == pytest.approx(0.03)
    assert metrics(fit, idle_then_step(rows=2)).idle_nm == pytest.approx(0.03)
    assert metrics(fit, idle_then_step(edge="falling")).idle_nm == 0.0
    assert metrics(fit, replace(idle_then_step(), baseline=0.02)).idle_nm == 0.02


def test_any_clock_is_exact(fit):
    t = np.cumsum(np.random.default_rng(1).uniform(1e-4, 0.1, 200))
    duty = np.repeat([0.0, 45.0, 80.0, 4.0, 30.0], 40)
    assert metrics(fit, run(t, duty, driven(t, duty))).max_abs_difference_nm < 1e-12


@pytest.mark.parametrize("release", [None, (0.6, 3.0)])
@pytest.mark.parametrize(
    ("hold", "start"),
    [(20.0, (1.4, 0.5)), (80.0, (1.4, 0.5)), (5.0, (1.4, 0.5)), (5.0, (0.0, 0.9)), (5.0, (0.9, 0.0)),
     (0.0, (1.7, 0.3))],
)  # fmt: skip
def test_a_run_that_begins_loaded_starts_at_its_own_two_parts(fit_of, hold, start, release):
    """Each part by its own constant, whether it rises or falls."""
    fit = fit_of(release={"tau1": release[0], "tau2": release[1]} if release else None)
    t = np.arange(9000) * DT
    duty = np.where(t < 6.0, hold, 70.0)
    found = metrics(fit, run(t, duty, driven(t, duty, start, release), edge="falling"))
    assert found.max_abs_difference_nm < 1e-9 and found.start_nm == pytest.approx(sum(start), abs=1e-9)


def test_noise_and_short_stretches(fit):
    t = np.arange(3000) * DT
    duty, random = np.full(3000, 20.0), np.random.default_rng(4)
    torque = driven(t, duty, (1.4, 0.5))
    starts = [metrics(fit, run(t, duty, torque + 0.1 * random.standard_normal(3000))).start_nm for _ in range(20)]
    assert abs(np.mean(starts) - 1.9) < 0.01 and np.std(starts) < 0.03  # the first sample alone: 0.1
    # too short to tell two parts apart: as after a long hold
    t = np.arange(400) * DT
    duty = np.where(t < 0.02, 60.0, 30.0)
    found = metrics(fit, run(t, duty, driven(t, duty, (0.85 * 1.5, 0.15 * 1.5))))
    assert found.start_nm == pytest.approx(1.5, rel=1e-6) and found.max_abs_difference_nm < 1e-6


def test_how_far_the_model_is_by_hand(fit):
    """At rest the model gives nothing: apart are the recorded 1, −1, 3, 1 themselves; less their mean 0, −2, 2, 0."""
    one = run(np.arange(4) * 0.5, np.zeros(4), [1.0, -1.0, 3.0, 1.0])
    record = laid(fit, one).records["x"]
    told = record.metrics
    assert (told.max_abs_difference_nm, told.mean_difference_nm, told.start_nm) == (3.0, 1.0, 0.0)
    assert told.rms_difference_nm == pytest.approx(np.sqrt(12 / 4))
    assert (told.R2, told.fit_pct) == pytest.approx((1 - 12 / 8, 100 * (1 - np.sqrt(12 / 8))))
    assert told.one_step_pct == pytest.approx(100 * (1 - np.sqrt((4 + 16 + 4) / 8)))
    assert record.columns["reference_nm"].tolist() == [1.0, -1.0, 3.0, 1.0] and record.role == "recorded-input"
    assert metrics(fit, run(np.arange(50) * DT, np.zeros(50), np.ones(50))).R2 is None  # nothing to explain


def test_behind_a_dead_time_a_recorded_duty_acts_later(fit_of):
    """On any clock, also between its rows."""
    rise = {"run": "r", "from": 0.0, "level": 9.0, "edge": "up", "start": 0.0, "change": 1.0, "gain": 1.0,
            "shape": "one", "tau1": 1.0, "tau2": None, "C": 1.0, "dead_time_s": 0.135, "rmse": 0.0, "fit_pct": 9.0,
            "R2": 1.0, "samples": 9}  # fmt: skip
    late = fit_of(steps=[rise])
    t = np.cumsum(np.random.default_rng(1).uniform(0.01, 0.09, 300))
    duty, clock = np.repeat([0.0, 45.0, 80.0, 4.0, 30.0], 60), np.union1d(t, t + 0.135)
    acting = np.searchsorted(t + 0.135, clock, side="right") - 1
    torque = driven(clock, np.where(acting < 0, 0.0, duty[acting]))[np.searchsorted(clock, t)]
    assert metrics(late, run(t, duty, torque)).max_abs_difference_nm < 1e-12


def test_what_does_nothing_or_does_not_fit_is_refused(fit, gains):
    one = idle_then_step()
    assert set(laid(fit, one).records) == {"x"}
    n = len(one.input)
    for other, said in (
        ({"input": np.full(n, np.nan)}, "x has no input in every row, and the input drives the model"),
        ({"input_unit": "N"}, "no input in %, which the fit has"),
        ({"output_unit": "N"}, "an output in N, the fit one in N·m"),
    ):
        with pytest.raises(eaid.DataError, match=said):
            laid(fit, replace(one, **other))
