"""Recorded runs against the model: a model's own run is explained whole; idle, releases and odd clocks."""

import dataclasses

import numpy as np
import pytest

from eaid.errors import DataError
from eaid.logs.run import Run
from eaid.models.nonlinear import step_response
from eaid.models.parameters import REFERENCE_PLANT
from eaid.replay import references
from eaid.replay.compare import compared, driven
from eaid.replay.loop import replay
from eaid.replay.rig import Rig

DT = 1e-3


def run(time_s, duty, torque, **further):
    settings = {"input_unit": "%", "output_unit": "N·m", "source": "x.csv", "sha256": "", **further}
    return Run(name="x", time_s=time_s, input=duty, output=torque, **settings)


def idle_then_step(offset=0.03):
    t = np.arange(3000) * DT
    duty = np.where(t >= 0.999, 60.0, 0.0)
    torque = step_response(REFERENCE_PLANT, np.maximum(t - t[1000 - 1], 0.0), 60.0) + offset
    return run(t + 7.0, duty, torque)


def test_the_models_own_step_is_explained_and_idle_torque_is_taken_off(plant):
    found = compared(idle_then_step(), plant).difference().metrics
    assert found.idle_nm == pytest.approx(0.03)
    assert found.max_abs_difference_nm < 1e-12
    assert pytest.approx(1.0) == found.R2
    assert found.fit_pct == pytest.approx(100.0) and found.one_step_pct == pytest.approx(100.0)
    kept = compared(idle_then_step(), plant, keep_baseline=True).difference().metrics
    assert kept.mean_difference_nm == pytest.approx(0.03) and kept.rms_difference_nm == pytest.approx(0.03)
    assert kept.one_step_pct == pytest.approx(100.0) and kept.fit_pct is not None and kept.fit_pct < 99.0


def test_any_clock_is_exact(plant):
    t = np.cumsum(np.random.default_rng(1).uniform(1e-4, 0.1, 200))
    torque = driven(plant, t, np.full(200, 45.0))
    assert torque == pytest.approx(step_response(REFERENCE_PLANT, t - t[0], 45.0), abs=1e-12)


def test_a_release_starts_loaded(plant):
    t = np.arange(2000) * DT
    tau1, tau2 = (6.74e-3 + 0.239 - 0.0213), (0.93 + 4.1 - 0.264)
    torque = 2.0 * (0.85 * np.exp(-t / tau1) + 0.15 * np.exp(-t / tau2))
    found = compared(run(t, np.zeros(2000), torque, edge="falling"), plant).difference().metrics
    assert found.R2 > 1 - 1e-12 and found.idle_nm == 0.0 and found.start_nm == pytest.approx(2.0)


def loaded(plant, noise_nm, start=(1.4, 0.5), hold=20.0, seed=4):
    """A run that begins with its two parts at any place, its duty held for 6 s and then at 70 %."""
    t = np.arange(9000) * DT
    duty = np.where(t < 6.0, hold, 70.0)
    torque = driven(plant, t, duty, start) + noise_nm * np.random.default_rng(seed).standard_normal(t.size)
    return run(t, duty, torque)


@pytest.mark.parametrize("hold", [20.0, 80.0, 5.0])
def test_a_run_that_begins_under_duty_starts_at_its_own_two_parts(plant, hold):
    """Falling and rising parts alike, with release constants of their own below the lowest identified duty."""
    for model in (plant, plant._replace(release1=0.6, release2=3.0)):
        found = compared(loaded(model, 0.0, hold=hold), model).difference().metrics
        assert found.max_abs_difference_nm < 1e-9 and found.start_nm == pytest.approx(1.9, abs=1e-9)


def test_a_part_that_rises_beside_one_that_falls_is_found_by_its_own_constant(plant):
    model = plant._replace(release1=0.6, release2=3.0)
    for start in ((0.0, 0.9), (0.9, 0.0), (0.3, 0.01)):
        again = compared(loaded(model, 0.0, start=start, hold=5.0), model)
        assert again.difference().metrics.max_abs_difference_nm < 1e-9
    found = compared(loaded(model, 0.0, start=(0.0, 0.9), hold=5.0), model)
    assert found.difference().metrics.max_abs_difference_nm < 1e-9


def test_a_noisy_first_sample_does_not_decide_where_a_run_starts(plant):
    starts = [compared(loaded(plant, 0.1, seed=k), plant).start_nm for k in range(20)]
    assert abs(np.mean(starts) - 1.9) < 0.01 and np.std(starts) < 0.03  # the first sample alone: 0.1


def test_a_stretch_too_short_for_two_parts_starts_as_after_a_long_hold(plant):
    t = np.arange(400) * DT
    duty = np.where(t < 0.02, 60.0, 30.0)
    torque = driven(plant, t, duty, (0.85 * 1.5, 0.15 * 1.5))
    found = compared(run(t, duty, torque), plant)
    assert found.start_nm == pytest.approx(1.5, rel=1e-6)
    assert found.difference().metrics.max_abs_difference_nm < 1e-6


def test_a_closed_loop_run_is_measured_and_laid_over(plant, law):
    reference = references.multisine(DT, 3.0).torque_nm
    rig = replay(plant, law("rc"), reference, Rig(), DT)
    log = run(rig.time_s, rig.duty_pct, rig.torque_nm, reference_nm=np.array(reference))
    kept = compared(log, plant)
    assert kept.difference().metrics.max_abs_difference_nm < 1e-12
    found = kept.closed_loop(plant, [law("rc")], Rig(), (0.0, 100.0))
    assert found["recorded"].metrics.max_abs_error_nm == pytest.approx(np.abs(rig.reference_nm - rig.torque_nm).max())
    # the clock's own rounding moves the reference by 1e-13; the loop is the same
    assert found["rc"].metrics.rms_from_recorded_nm < 1e-9
    assert found["rc"].metrics.rms_duty_from_recorded_pct < 1e-6


def test_a_run_without_duty_or_torque_is_refused(plant):
    t = np.arange(100) * DT
    with pytest.raises(DataError, match="no input in %, which the fit has"):
        compared(run(t, np.full(100, np.nan), t), plant)
    with pytest.raises(DataError, match="no input in %, which the fit has"):
        compared(run(t, t, t, input_unit="N"), plant)
    with pytest.raises(DataError, match="an output in N, the fit one in N·m"):
        compared(run(t, t, t, output_unit="N"), plant)


def test_how_far_the_model_is_by_hand(plant):
    t = np.arange(4) * 0.5
    found = compared(run(t, np.zeros(4), np.array([1.0, -1.0, 3.0, 1.0])), plant, keep_baseline=True)
    kept = dataclasses.replace(found, model_nm=np.array([0.0, 1.0, 3.0, 1.0]))
    told = kept.difference().metrics  # apart: 1, −2, 0, 0; recorded − its mean: 0, −2, 2, 0
    assert (told.max_abs_difference_nm, told.mean_difference_nm) == (2.0, -0.25)
    assert told.rms_difference_nm == pytest.approx(np.sqrt(5 / 4))
    assert pytest.approx(1 - 5 / 8) == told.R2 and told.fit_pct == pytest.approx(100 * (1 - np.sqrt(5 / 8)))
    assert told.one_step_pct == pytest.approx(100 * (1 - np.sqrt((9 + 4) / 8)))
    assert kept.dt_s == 0.5 and told.reference_is == "recorded torque"
    columns = kept.difference().columns
    assert columns["reference_nm"] is kept.recorded_nm and columns["torque_nm"] is kept.model_nm


def test_nine_rows_at_rest_make_no_idle_value(plant):
    for rows, idle in ((9, 0.0), (10, 0.5)):
        duty = np.r_[np.zeros(rows), np.full(20, 40.0)]
        torque = np.r_[np.full(rows, 0.5), np.ones(20)]
        found = compared(run(np.arange(rows + 20) * DT, duty, torque), plant)
        assert found.idle_nm == idle
    assert compared(run(np.arange(30) * DT, duty, torque, edge="falling"), plant).idle_nm == 0.0


def test_a_constant_torque_has_no_variance_to_explain(plant):
    found = compared(run(np.arange(50) * DT, np.zeros(50), np.ones(50)), plant).difference().metrics
    assert found.R2 is None
