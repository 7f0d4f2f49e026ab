"""Recorded runs against the model: a model's own run is explained whole; idle, releases and odd clocks."""

import numpy as np
import pytest

from eaid.errors import DataError
from eaid.logs.run import Run
from eaid.models.nonlinear import step_response
from eaid.models.parameters import REFERENCE_PLANT
from eaid.replay import recorded, references
from eaid.replay.loop import replay
from eaid.replay.rig import Rig
from eaid.results.metrics import Metrics

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
    found = recorded.difference(recorded.recorded(idle_then_step(), plant))
    assert found.idle_nm == pytest.approx(0.03)
    assert found.max_abs_difference_nm < 1e-12
    assert pytest.approx(1.0) == found.R2
    assert found.fit_pct == pytest.approx(100.0) and found.one_step_pct == pytest.approx(100.0)
    kept = recorded.difference(recorded.recorded(idle_then_step(), plant, keep_baseline=True))
    assert kept.mean_difference_nm == pytest.approx(0.03) and kept.rms_difference_nm == pytest.approx(0.03)
    assert kept.one_step_pct == pytest.approx(100.0) and kept.fit_pct is not None and kept.fit_pct < 99.0


def test_any_clock_is_exact(plant):
    t = np.cumsum(np.random.default_rng(1).uniform(1e-4, 0.1, 200))
    torque = recorded.driven(plant, t, np.full(200, 45.0))
    assert torque == pytest.approx(step_response(REFERENCE_PLANT, t - t[0], 45.0), abs=1e-12)


def test_a_release_starts_loaded(plant):
    t = np.arange(2000) * DT
    tau1, tau2 = (6.74e-3 + 0.239 - 0.0213), (0.93 + 4.1 - 0.264)
    torque = 2.0 * (0.85 * np.exp(-t / tau1) + 0.15 * np.exp(-t / tau2))
    found = recorded.difference(recorded.recorded(run(t, np.zeros(2000), torque, edge="falling"), plant))
    assert found.R2 > 1 - 1e-12 and found.idle_nm == 0.0 and found.start_nm == pytest.approx(2.0)


def loaded(plant, noise_nm, start=(1.4, 0.5), hold=20.0, seed=4):
    """A run that begins with its two parts at any place, its duty held for 6 s and then at 70 %."""
    t = np.arange(9000) * DT
    duty = np.where(t < 6.0, hold, 70.0)
    torque = recorded.driven(plant, t, duty, start) + noise_nm * np.random.default_rng(seed).standard_normal(t.size)
    return run(t, duty, torque)


@pytest.mark.parametrize("hold", [20.0, 80.0, 5.0])
def test_a_run_that_begins_under_duty_starts_at_its_own_two_parts(plant, hold):
    """Falling and rising parts alike, with release constants of their own below the lowest identified duty."""
    for model in (plant, plant._replace(release1=0.6, release2=3.0)):
        found = recorded.difference(recorded.recorded(loaded(model, 0.0, hold=hold), model))
        assert found.max_abs_difference_nm < 1e-9 and found.start_nm == pytest.approx(1.9, abs=1e-9)


def test_a_part_that_rises_beside_one_that_falls_is_found_by_its_own_constant(plant):
    model = plant._replace(release1=0.6, release2=3.0)
    found = recorded.recorded(loaded(model, 0.0, start=(0.0, 0.9), hold=5.0), model)
    assert recorded.difference(found).max_abs_difference_nm < 1e-9


def test_a_noisy_first_sample_does_not_decide_where_a_run_starts(plant):
    starts = [recorded.recorded(loaded(plant, 0.1, seed=k), plant).start_nm for k in range(20)]
    assert abs(np.mean(starts) - 1.9) < 0.01 and np.std(starts) < 0.03  # the first sample alone: 0.1


def test_a_stretch_too_short_for_two_parts_starts_as_after_a_long_hold(plant):
    t = np.arange(400) * DT
    duty = np.where(t < 0.02, 60.0, 30.0)
    torque = recorded.driven(plant, t, duty, (0.85 * 1.5, 0.15 * 1.5))
    found = recorded.recorded(run(t, duty, torque), plant)
    assert found.start_nm == pytest.approx(1.5, rel=1e-6)
    assert recorded.difference(found).max_abs_difference_nm < 1e-6


def test_a_closed_loop_run_is_measured_and_laid_over(plant, law):
    reference = references.multisine(DT, 3.0).torque_nm
    rig = replay(plant, law("rc"), reference, Rig(), DT)
    log = run(rig.time_s, rig.duty_pct, rig.torque_nm, reference_nm=np.array(reference))
    kept = recorded.recorded(log, plant)
    assert recorded.difference(kept).max_abs_difference_nm < 1e-12
    assert recorded.closed_loop_metrics(kept).max_abs_error_nm == pytest.approx(np.abs(rig.error_nm).max())
    again = recorded.laid_over(kept, plant, law("rc"), Rig())
    # the clock's own rounding moves the reference by 1e-13; the loop is the same
    assert recorded.against(kept, again, Metrics()).rms_from_recorded_nm < 1e-9


def test_a_run_without_duty_or_torque_is_refused(plant):
    t = np.arange(100) * DT
    with pytest.raises(DataError, match="no input in %, which the fit has"):
        recorded.recorded(run(t, np.full(100, np.nan), t), plant)
    with pytest.raises(DataError, match="no input in %, which the fit has"):
        recorded.recorded(run(t, t, t, input_unit="N"), plant)
    with pytest.raises(DataError, match="an output in N, the fit one in N·m"):
        recorded.recorded(run(t, t, t, output_unit="N"), plant)


def test_a_constant_torque_has_no_variance_to_explain(plant):
    found = recorded.difference(recorded.recorded(run(np.arange(50) * DT, np.zeros(50), np.ones(50)), plant))
    assert found.R2 is None
