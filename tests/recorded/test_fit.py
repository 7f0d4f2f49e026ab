"""Recovery of the truth, agreement with the step fits and with an independent least squares."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy.signal import lfilter

import eaid
from eaid.estimate.recorded_log import RecordedLog, recorded_log
from eaid.logs.run import Run
from eaid.options import InputOptions
from eaid.plant.dynamics import REFERENCE_PLANT
from eaid.recorded.fit import fit_recorded
from eaid.synth.excitation import synthesise_excitation
from eaid.synth.logs import NONE
from eaid.synth.plants import clutch

NOISE = replace(NONE, white_nm=0.006, coloured=0.01, coloured_s=0.3)
PLAIN = eaid.FitOptions(model=("nonlinear",), ci="none")


def coefficients(p: object) -> np.ndarray:
    return np.concatenate([p.tau1, p.tau2, p.Ts])  # type: ignore[attr-defined]


def test_several_logs_with_idle_outputs_and_starts_of_their_own() -> None:
    e = InputOptions(kind="random", duration_s=90.0, rate_hz=100.0, hold_s=(0.5, 8.0))
    one = recorded_log(synthesise_excitation(clutch(), e, replace(NONE, offset_nm=0.3), 1)[0])
    two = recorded_log(synthesise_excitation(clutch(), e, replace(NONE, offset_nm=-0.1), 2)[0])
    cut = slice(2500, None)  # begins loaded, in the middle of a hold
    two = RecordedLog("two", two.time_s[cut], two.input[cut], two.output[cut])
    steps = eaid.synth(
        levels=(30.0, 80.0), repeats=2, idle_s=1.0, hold_s=10.0, release_s=0.0, rate_hz=100.0, clean=True, seed=3
    )
    found = fit_recorded([one, two], PLAIN, steps)
    assert found.nonlinear is not None and found.recorded is not None
    np.testing.assert_allclose(coefficients(found.nonlinear), coefficients(REFERENCE_PLANT), rtol=1e-6)
    first, second = found.recorded.logs
    assert (first.idle, second.idle) == (pytest.approx(0.3), pytest.approx(-0.1))
    assert first.start == (0.0, 0.0) and min(second.start) > 0.0
    assert (first.fit_pct, second.fit_pct, first.one_step_pct) == pytest.approx((100.0, 100.0, 100.0))


def test_an_input_that_never_moves_is_told() -> None:
    t = np.arange(400) / 100
    y = 0.7 + 0.5 * np.exp(-t / 0.3) + 0.01 * np.random.default_rng(0).standard_normal(400)
    found = fit_recorded([RecordedLog("log", t, np.full(400, 40.0), y)], replace(PLAIN, ci="robust"))
    told = {one.code for one in found.findings}
    assert {"input-never-moves", "idle-not-seen", "one-input-only"} <= told and "dead-time" not in told


def test_what_cannot_be_fitted_is_refused_in_a_sentence() -> None:
    t = np.arange(200) / 100
    y = 1 - np.exp(-t)
    for u, said in ((np.zeros(200), "never leaves rest"), (np.where(t > 1, np.nan, 20.0), "not known at every row")):
        with pytest.raises(eaid.DataError, match=said):
            fit_recorded([RecordedLog("log", t, u, y, source="a.csv")])
    with pytest.raises(eaid.DataError, match="never changes"):
        fit_recorded([RecordedLog("log", t, np.where(t > 1, 20.0, 30.0), np.ones(200))])


@pytest.mark.slow
def test_a_log_can_be_drawn_from_the_fit_alone() -> None:
    e = InputOptions(kind="random", duration_s=60.0, rate_hz=100.0, hold_s=(0.5, 6.0))
    run = synthesise_excitation(clutch(), e, NOISE, 1)[0]
    spiked = run.output.copy()
    spiked[4321] += 3.0  # one row of 6000
    found = fit_recorded([replace(run, output=spiked)], replace(PLAIN, duty=(10.0, 100.0)))
    assert found.recorded is not None
    curve = found.recorded.logs[0].curve
    assert len(curve.time_s) == len(curve.input) == len(curve.measured) == len(curve.model) == len(curve.residual)
    assert 300 < len(curve.time_s) < 1000
    at = np.searchsorted(run.time_s, curve.time_s)
    np.testing.assert_allclose(curve.measured, spiked[at], rtol=1e-5)
    np.testing.assert_allclose(curve.input, run.input[at], rtol=1e-5)
    np.testing.assert_allclose(np.subtract(curve.measured, curve.model), curve.residual, atol=2e-5)
    assert 4321 in at and max(curve.measured) == pytest.approx(spiked.max(), rel=1e-5)
    changes = np.flatnonzero(np.diff(run.input))
    assert {run.input[k] for k in changes} == set(curve.input)


def frame(run: Run) -> pd.DataFrame:
    return pd.DataFrame({"time_s": run.time_s, "duty_pct": run.input, "torque_nm": run.output})


def test_what_a_fit_of_a_recorded_log_knows_and_refuses() -> None:
    e = InputOptions(kind="chirp", duration_s=60.0, rate_hz=20.0, duty=(20.0, 80.0))
    steps = eaid.read(frame(synthesise_excitation(clutch(), e, NOISE, 1)[0]), apparatus="surfaces=4")
    fit = eaid.fit(steps, ci="none")
    assert fit.recorded is not None and fit.data.apparatus.surfaces == 4
    with pytest.raises(eaid.UsageError, match="bootstrap: logs fitted as recorded take robust or none"):
        eaid.fit(steps, ci="bootstrap")
    with pytest.raises(eaid.UsageError, match="duty= 1000: the fit knows"):
        fit.predict(1000, [1.0])
    assert len(fit.plot().lines) == 5
    stairs = InputOptions(kind="staircase", duration_s=60.0, rate_hz=20.0, duty=(20.0, 80.0), hold_s=(2.0, 3.0))
    logs = frame(synthesise_excitation(clutch(), stairs, NOISE, 1)[0])
    known = eaid.fit(logs, ci="none", bounds_levels="40:80", shape="one")
    assert min(known.linear.bounds.levels) >= 40


@pytest.mark.slow
def test_two_holds_are_a_step_whatever_their_size_and_give_a_plant() -> None:
    t = np.arange(1000) / 100
    for before, after in ((5.0, 5.4), (30.0, 70.0)):
        y = 0.2 * before + 0.2 * (after - before) * (t >= 4) * (1 - np.exp(-np.maximum(t - 4, 0) / 0.3))
        y += 0.001 * np.random.default_rng(0).standard_normal(1000)
        log = pd.DataFrame({"time_s": t, "duty_pct": np.where(t < 4, before, after), "torque_nm": y})
        fit = eaid.fit(log, ci="none")
        (step,) = fit.steps
        assert step.tau1 == pytest.approx(0.3, rel=0.05)
        assert fit.plant.kind == "lag" and fit.plant_.plant.Ts[1] == pytest.approx(0.2, rel=0.05)


def test_a_linear_rig_gives_its_three_numbers_and_no_second_time_constant() -> None:
    rng = np.random.default_rng(4)
    holds = rng.integers(60, 300, 24)
    duty = np.append(np.zeros(50), np.repeat(rng.choice([20.0, 45.0, 70.0, 95.0], 24), holds))
    clean = lfilter([0.0, -np.expm1(-0.03)], [1.0, -np.exp(-0.03)], (0.1 * duty + 0.5) / 3.0 * (duty > 0))
    noisy = clean + 0.002 * rng.standard_normal(len(duty))
    log = RecordedLog("log", np.arange(len(duty)) / 100, duty, noisy, baseline=0.0)
    found = fit_recorded([log], replace(PLAIN, model=("nonlinear", "linear"), ci="robust"), falls=False)
    assert found.linear is not None and found.nonlinear is not None
    assert (found.linear.a0, found.linear.b0, found.linear.c0) == pytest.approx((3.0, 0.1, 0.5), rel=0.01)
    assert found.plant.kind == "lag" and "falls-differ" not in {one.code for one in found.findings}
    for row in found.nonlinear.curves:
        assert row.tau1 == pytest.approx(1 / 3, rel=0.03) and row.ci95.tau1 is not None
        assert row.tau2 is None and row.ci95.tau2 is None


@pytest.mark.slow
def test_a_chirp_with_little_noise_ends_where_the_noise_is_all_that_is_left() -> None:
    """On averages, with which the search begins, another end looks better: every one is followed to all samples."""
    shape = {"duration_s": 240.0}
    logs = eaid.synth(excitation="chirp", shape=shape, rate_hz=200.0, clean=True, seed=1005, white_nm=0.006)
    found = fit_recorded(logs.recorded, replace(PLAIN, duty=(10.0, 100.0)), falls=False)
    assert found.nonlinear is not None and found.nonlinear.rmse == pytest.approx(0.006, rel=0.02)


@pytest.mark.slow
def test_an_interval_beside_a_limit_does_not_hang_on_rounding() -> None:
    """One exponential under slow noise: τ2 meets τ1, two columns of derivatives are one, and T_s keeps its ends."""
    t = np.arange(900.0)
    u = np.where(t >= 20.0, 50.0, 0.0)
    clean = 20.0 + 35.0 * (1 - np.exp(-np.maximum(t - 20.0, 0.0) / 150.0))
    # noise of standard deviation 1, correlated over 20 s
    y = clean + lfilter([0.3], [1.0, -0.95], np.random.default_rng(0).standard_normal(len(t)))
    logs = [RecordedLog("log", t, u, scale * y) for scale in (1.0, 1 + 1e-13)]
    level, shaken = (fit_recorded([log], replace(PLAIN, ci="robust"), falls=False).nonlinear.curves[-1] for log in logs)  # type: ignore[union-attr]
    assert level.ci95.Ts[0] < 35.0 < level.ci95.Ts[1] and level.ci95.tau1 is not None
    assert shaken.ci95.Ts == pytest.approx(level.ci95.Ts, rel=1e-3)
    assert shaken.ci95.tau1 == pytest.approx(level.ci95.tau1, rel=1e-3)
