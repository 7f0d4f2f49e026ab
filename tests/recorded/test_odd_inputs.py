"""Inputs of recorded logs that look like others: ramps in small steps, both signs, ranges without a level."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy.signal import lfilter

import eaid
from eaid.estimate.draw import draw, drawable
from eaid.estimate.recorded_log import RecordedLog, at_limit, hold_measured
from eaid.findings import say
from eaid.options import FitOptions
from eaid.plant.dynamics import REFERENCE_PLANT, Plant
from eaid.plant.respond import respond
from eaid.recorded.fit import fit_recorded
from eaid.recorded.inputs import find_inputs
from eaid.results.plant import number_at
from eaid.results.verdict import judged

from ..conftest import codes
from .loops import loop

LAG = Plant((0.5,), (0.5,), (0.0, 0.02), (1.0, 100.0), C=1.0)


def log(t, u, plant=LAG, noise=0.005, name="log"):
    output = respond(plant, t, u, t) + noise * np.random.default_rng(1).standard_normal(len(t))
    return RecordedLog(name, t, u, output)


@pytest.mark.slow
def test_a_ramp_that_is_held_for_ten_rows_a_value_is_no_staircase():
    t = np.arange(40_000) * 1e-3
    ramp = np.repeat(np.linspace(0, 100, 4000), 10)
    assert log(t, ramp).stepwise
    found = find_inputs([log(t, ramp)], None)
    assert not found.stepwise and found.low < 5 and found.high > 95
    told = fit_recorded([log(t[::10], ramp[::10])], FitOptions(model=("nonlinear",)))
    assert told.plant.steady(50.0) == pytest.approx(1.0, rel=0.02)


def test_levels_that_are_all_but_alike_are_one():
    t = np.arange(4000) * 0.01
    u = np.repeat([0.0, 20.0, 20.004, 60.0, 19.998, 60.003, 100.0, 0.0], 500)
    assert find_inputs([log(t, u)], None).levels == pytest.approx([20, 60, 100], abs=0.01)


def test_an_output_of_fewer_values_than_inputs_is_refused():
    """Its gain was said to be below 0, "exchanged columns"."""
    t = np.arange(3000) * 0.02
    u = np.repeat([0.0, 40.0, 80.0, 40.0, 0.0, 0.0], 500)
    seen = 2.4 * np.round(respond(LAG, t, u, t) / 2.4)
    with pytest.raises(eaid.DataError, match="takes only 2 values at more inputs than that: too coarse"):
        fit_recorded([RecordedLog("log", t, u, seen)], FitOptions(model=("nonlinear",)))


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_sensor_that_is_coarser_than_its_noise_may_lie_anywhere_within_a_step(seed):
    random, count = np.random.default_rng(seed), 0.08
    t = np.arange(9000) * 0.02
    u = np.repeat([0.0, 30.0, 60.0, 90.0, 60.0, 30.0], 1500)
    y = respond(LAG, t, u, t) + random.uniform(0, count) + 0.1 * count * random.standard_normal(len(t))
    seen = count * np.round(y / count)
    found = fit_recorded([RecordedLog("log", t, u, seen)], FitOptions(model=("nonlinear",)))
    low, high = found.plant_.at(60.0)["Ts"][1]
    assert low < LAG.steady(60.0) < high
    assert count / 3 < high - low < 3 * count  # of a thousandth of a count, were each row's rounding its own


@pytest.mark.slow
def test_an_input_that_changes_within_a_gap_is_not_noted_late(tmp_path):
    random = np.random.default_rng(4)
    levels, holds = random.choice([20.0, 40.0, 60.0, 80.0, 100.0], 30), random.uniform(2.0, 10.0, 30)
    u = np.append(np.zeros(300), np.repeat(levels, (holds / 0.02).astype(int)))
    t = np.arange(len(u)) * 0.02
    y = respond(REFERENCE_PLANT, t, u, t)
    y = y + (0.005 + 0.005 * y) * random.standard_normal(len(t))
    change = t[np.flatnonzero(np.diff(u))[12]]
    kept = np.abs(t - change) > 1.5
    path = tmp_path / "log.csv"
    pd.DataFrame({"time_s": t, "duty_pct": u, "torque_nm": y})[kept].to_csv(path, index=False)
    fit = eaid.fit(path, model=("friction", "nonlinear"))
    told = {one.code: one for one in fit.findings}
    assert "input-late" not in told and told["log-in-parts"].values["parts"] == 2
    assert len(fit.logs) == 2 and len(fit.data.sources) == 1
    for u in (40.0, 60.0, 80.0):
        assert fit.at(u).loc["tau1", "value"] == pytest.approx(float(REFERENCE_PLANT.time_constants(u)[0]), rel=0.03)


@pytest.mark.slow
def test_levels_of_a_staircase_have_values_of_their_own(tmp_path):
    """A drive that clips at 70 %: a cubic through it was 6 % off at every level, with intervals of 3 %."""
    random, levels = np.random.default_rng(3), (20.0, 40.0, 60.0, 70.0, 80.0, 90.0, 100.0)
    u = np.append(np.zeros(100), np.repeat(random.choice(levels, 30), random.integers(40, 200, 30)))
    t = np.arange(len(u)) * 0.05
    y = respond(REFERENCE_PLANT, t, np.minimum(u, 70.0), t)
    y = y + (0.005 + 0.005 * y) * random.standard_normal(len(t))
    pd.DataFrame({"time_s": t, "duty_pct": u, "torque_nm": y}).to_csv(path := tmp_path / "log.csv", index=False)
    how = {"model": ("friction", "nonlinear"), "curve": "cubic"}
    fit = eaid.fit(eaid.read(path, logs_as="recorded"), **how)
    for row in fit.friction_levels:
        true = float(REFERENCE_PLANT.steady(min(row.level, 70.0)))
        assert row.Ts == pytest.approx(true, rel=0.02) and row.ci95.Ts[0] < true < row.ci95.Ts[1]
        assert fit.at(row.level).loc["Ts", "value"] == row.Ts
    told = {one.code: one for one in fit.findings}
    assert told["output-levels-off"].levels == (70.0, 80.0, 90.0, 100.0)
    assert max(abs(fit.plant.steady(row.level) / row.Ts - 1) for row in fit.friction_levels) > 0.03
    limited = eaid.fit(eaid.read(path, logs_as="recorded"), model=how["model"])  # by itself
    (told,) = [one for one in limited.findings if one.code == "output-levels-off"]
    assert "inputs beyond 70 act as it does" in say(told) and limited.logs[0].fit_pct > fit.logs[0].fit_pct + 4
    assert limited.plant.u_range == (20.0, 70.0) and "falls-differ" not in codes(limited)
    for row in limited.friction_levels:
        true = REFERENCE_PLANT.at(row.level)
        for name in ("Ts", "tau1", "tau2"):
            low, high = getattr(row.ci95, name)
            assert low < getattr(true, name) < high


def test_an_output_of_the_other_sign_is_refused_by_its_name():
    t = np.arange(6000) * 0.02
    u = np.repeat(np.random.default_rng(2).choice([0.0, 30.0, 60.0, 100.0], 40), 150)
    right = log(t, u, REFERENCE_PLANT, name="right")
    wrong = replace(right, name="wrong", output=-right.output)
    with pytest.raises(eaid.DataError, match="wrong: its output falls where its input rises"):
        fit_recorded([wrong])
    with pytest.raises(eaid.DataError, match="^wrong: its output goes the other way than that of the other logs"):
        fit_recorded([right, wrong, right])


def test_a_range_without_a_level_is_refused_by_its_levels():
    t = np.arange(6000) * 0.01
    columns = {"time_s": t, "duty_pct": np.repeat([0.0, 20.0, 60.0, 80.0, 20.0, 60.0], 1000)}
    columns["torque_Nm"] = respond(LAG, t, columns["duty_pct"], t)
    with pytest.raises(eaid.UsageError, match=r"40:50: no level of the logs lies in it; they hold 20, 60, 80"):
        eaid.fit(eaid.read(pd.DataFrame(columns), logs_as="recorded"), duty=(40, 50))


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["lag", "ringing"])
def test_plants_of_another_kind_are_drawn_by_their_intervals(kind):
    t, random = np.arange(3000) * 0.02, np.random.default_rng(3)
    u = np.repeat(random.choice([0.0, 30.0, 60.0, 100.0], 60), 50)
    fit = fit_recorded([log(t, u, LAG if kind == "lag" else replace(LAG, zeta=0.3))], FitOptions())
    assert fit.plant.kind == kind and drawable(fit)
    plants = draw(fit, 400, 0).plants
    for name, (_, ends) in fit.plant_.numbers.items():
        low, high = np.quantile([number_at(one, name, 100.0) for one in plants], [0.025, 0.975])
        assert np.log([low, high]) == pytest.approx(np.log(ends), abs=0.2 * np.log(ends[1] / ends[0]))
    without = fit_recorded([log(t, u)], FitOptions(ci="none"))
    assert not drawable(without) and draw(without, 3, 0).plants == (without.plant,) * 3


def test_a_loop_with_a_missing_output_still_tells_its_law():
    from eaid.recorded.closed_loop import law_behind

    t = np.arange(4000) * 0.01
    wanted = 1 + 0.5 * np.sin(0.7 * t)
    u, y = loop(wanted, 0.01, (20.0, 30.0), lambda u: 0.02 * u, (0.5,), 1.0)
    y[500] = np.nan
    law = law_behind(RecordedLog("loop", t, u, y, reference=wanted))
    assert law is not None and law[0][:2] == pytest.approx((20, 30), rel=1e-3)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_an_input_below_rest_has_the_gain_that_its_log_shows(sign):
    """A motor turned backwards, and a brake whose voltage is logged negative."""
    t, random = np.arange(3000) * 0.01, np.random.default_rng(1)
    u = -np.repeat(np.append([0.0, 0.0], random.choice([0.0, 2.0, 3.5, 5.0], 28)), 100)
    signed = Plant((0.3,), (0.3,), (0.0, 20.0), (1.0, 5.0), C=1.0, Ts_below=(0.0, -20.0))
    y = sign * respond(signed, t, u, t) + 0.3 * random.standard_normal(len(t))
    columns = {"input": "volts", "output": "speed"}
    logs = pd.DataFrame({"time_s": t, "volts": u, "speed": y})
    steps = eaid.read(logs, columns=columns, units={"input": "V", "output": "N"}, logs_as="recorded")
    fit = eaid.fit(steps, ci="none", shape="one")
    assert fit.plant.steady(-5.0 if sign > 0 else 5.0) == pytest.approx(-100.0 * sign, rel=0.01)
    assert fit.logs[0].fit_pct > 98


@pytest.mark.slow
@pytest.mark.parametrize("step", [0.01, 0.05])
def test_an_output_that_has_settled_on_a_coarse_sensor_is_no_stuck_one(step):
    t, random = np.arange(4000) * 0.02, np.random.default_rng(3)
    u = np.repeat(np.append([0.0, 0.0], random.choice([0.0, 40.0, 80.0, 100.0], 14)), 250)
    ringing = Plant((0.25,), (0.25,), (0.0, 0.04), (20.0, 100.0), C=1.0, zeta=0.3)
    y = np.round((3.0 + respond(ringing, t, u, t) + 0.001 * random.standard_normal(len(t))) / step) * step
    fit = eaid.fit(t, u, y, shape="one")
    assert fit.verdict.usable and fit.plant.kind == "ringing"


@pytest.mark.slow
def test_steps_of_both_signs_in_logs_of_their_own_have_a_gain_on_each_side():
    """2 upward and 1.2 downward, which levels by their size would take for one that scatters."""
    t, random, logs = np.arange(800) * 0.01, np.random.default_rng(0), []
    for u in np.repeat([-1.0, -0.5, 0.5, 1.0], 3):
        rise = (2.0 if u > 0 else 1.2) * u * (1 - np.exp(-np.maximum(t - 2.0, 0.0) / 0.4))
        output = rise * (1 + 0.02 * random.standard_normal()) + 0.01 * random.standard_normal(len(t))
        logs.append(pd.DataFrame({"time_s": t, "input_V": np.where(t >= 2.0, u, 0.0), "torque_nm": output}))
    plant = eaid.fit(logs).plant
    assert (plant.steady(0.5), plant.steady(-0.5)) == pytest.approx((1.0, -0.6), rel=0.03)
    assert plant.tau1[0] == pytest.approx(0.4, rel=0.02)


def test_counts_in_a_column_of_percent_are_refused_and_a_coarse_sensor_may_stand_still_at_rest():
    t, random = np.arange(3000) * 0.02, np.random.default_rng(2)
    u = np.repeat(np.append([0.0, 0.0], random.uniform(10, 100, 28)), 100)
    trembling = 0.02 * random.integers(-3, 4, len(t)) * (t >= 4.1)  # under load only
    output = np.round(respond(LAG, t, u, t) / 0.02) * 0.02 + trembling
    bridge = np.where(u > 0, u - 50, 0.0)
    both = np.round(respond(replace(LAG, Ts_below=LAG.Ts), t, bridge, t) / 0.02) * 0.02 + trembling
    (told,) = eaid.read(pd.DataFrame({"time_s": t, "duty_pct": bridge, "torque_nm": both})).recorded
    assert told.input.min() < 0 and "sensor-stuck" not in {one.code for one in told.findings}
    stays = np.where(t < 12, 0.5, output)  # long after the input moves
    stuck = eaid.read(pd.DataFrame({"time_s": t, "duty_pct": u, "torque_nm": stays}))
    assert "sensor-stuck" in {one.code for one in stuck.recorded[0].findings}
    with pytest.raises(eaid.DataError, match="beyond 100 by more than noise; .* input=/255"):
        eaid.read(pd.DataFrame({"time_s": t, "PWM": 2.55 * u, "torque_nm": output}))
    noisy = eaid.read(pd.DataFrame({"time_s": t, "duty_pct": 1.05 * u, "torque_nm": output})).recorded[0]
    assert noisy.input.max() > 100  # as a measured one may be


def test_a_log_of_hardly_any_rows_is_refused_at_once():
    rng = np.random.default_rng(1)
    log = pd.DataFrame({"time_s": 0.01 * np.arange(49), "duty_pct": 50 * rng.random(49), "torque_nm": rng.random(49)})
    with pytest.raises(eaid.DataError, match="holds 49 rows, and a fit of recorded logs needs 50; record it longer"):
        eaid.fit(log)


@pytest.mark.slow
def test_a_log_whose_input_changes_within_its_gaps_must_not_be_used():
    t = np.arange(1600) * 0.02
    u = np.repeat(np.random.default_rng(1).choice([20.0, 40.0, 60.0, 80.0, 100.0], 16), 100)
    whole = log(t, u, REFERENCE_PLANT)
    kept = (np.arange(1600) - 90) % 100 >= 20  # a gap at every change
    holes = replace(whole, time_s=t[kept], input=u[kept], output=whole.output[kept])
    for one, told in ((holes, True), (whole, False)):
        assert ("changes-in-gaps" in codes(fit_recorded([one], FitOptions(model=("nonlinear",))))) is told


@pytest.mark.slow
@pytest.mark.parametrize("limit", [2.6, pytest.param(3.4, marks=pytest.mark.slow)])
def test_rows_at_the_end_of_a_sensor_are_left_out(limit, tmp_path):
    """They were the steady value: T_s 8 % low at 100 %, and τ1 too short by a fifth, with no word of a single spell."""
    random, t = np.random.default_rng(8), np.arange(0.0, 200.0, 0.02)
    held = random.uniform(10.0, 100.0, 60), random.integers(100, 300, 60)
    u = np.append(np.zeros(100), np.repeat(*held))[: len(t)]
    t, path = t[: len(u)], tmp_path / "log.csv"
    y = np.minimum(respond(REFERENCE_PLANT, t, u, t) + 0.01 * random.normal(size=len(t)), limit)
    pd.DataFrame({"time_s": t, "duty_pct": u, "torque_nm": y}).to_csv(path, index=False)
    fit = eaid.fit(path)
    told = {one.code: one.values for one in fit.findings}["output-saturates"]
    assert told["limit"] == limit and told["share_pct"] == pytest.approx(100 * (y == limit).mean())
    for duty in (20.0, 60.0, 95.0):
        assert fit.plant.steady(duty) == pytest.approx(REFERENCE_PLANT.steady(duty), rel=0.02)
        assert fit.plant.time_constants(duty)[0] == pytest.approx(REFERENCE_PLANT.time_constants(duty)[0], rel=0.05)
    again = eaid.simulate(fit, log=path).records["log"]
    assert again.metrics.fit_pct == pytest.approx(fit.logs[0].fit_pct, abs=0.01)


def test_an_output_that_comes_to_rest_is_at_no_end_of_its_sensor():
    t = np.arange(4000) * 0.01
    assert log(t, np.where(t > 5, 80.0, 0.0), noise=0.0).limit is None
    resting = np.minimum(1 - np.exp(-t / 0.5), 1 - 1e-9)
    assert not at_limit(resting).any() and at_limit(np.minimum(np.sin(t), 0.9)).sum() > 500
    assert not at_limit(np.round(resting + 0.02 * np.random.default_rng(1).normal(size=len(t)), 2)).any()


def loop_on_random_setpoints(seed):
    """A PI loop at 50 Hz that begins at rest: instants, what it was to follow, duty, measured torque."""
    random, at = np.random.default_rng(seed), REFERENCE_PLANT.at
    wanted = np.repeat(random.uniform(0.3, 2.5, 12), 250)
    wanted[:5], noise = 0.0, 0.005 * random.standard_normal(len(wanted)) * (np.arange(len(wanted)) >= 5)
    taus = (lambda u: at(u).tau1, lambda u: at(u).tau2)
    return 0.02 * np.arange(len(wanted)), wanted, *loop(wanted, 0.02, (15, 25), lambda u: at(u).Ts, taus, noise=noise)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.slow)])
def test_a_loop_that_begins_at_rest_is_fitted_without_its_reference(seed):
    """Its start was judged anew between the clutch's fit and that of its delay, which had other unknowns then."""
    t, _, u, y = loop_on_random_setpoints(seed)
    fit = fit_recorded([RecordedLog("log", t, u, y)], FitOptions(model=("nonlinear",)))
    assert {"duty-follows-output", "loop-bias-unknown"} <= set(codes(fit))
    at = float(np.quantile(u[u > 0], 0.5))
    assert fit.plant.steady(at) == pytest.approx(REFERENCE_PLANT.steady(at), rel=0.02)


@pytest.mark.slow
def test_a_setpoint_that_is_taken_for_the_output_crashes_nothing():
    """Rows were left out for kinds with a dead time, and the clutch's overshoot, fitted to all, was taken."""
    t, wanted, u, _ = loop_on_random_setpoints(7)
    noisy = wanted + 0.001 * np.random.default_rng(1).standard_normal(len(t))
    fit = fit_recorded([RecordedLog("log", t, u, noisy)], FitOptions(model=("nonlinear",)))
    assert fit.logs[0].samples <= len(t)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1])
def test_one_tone_that_the_output_follows_is_no_wrong_sign(seed):
    """A gain below 0 behind half a period explains it as well as any, and the log was refused for that."""
    t, Ts = np.arange(2000) * 0.02, (0.0, 8e-3, 1.5e-4, 1.2e-6)
    plant, u = Plant((0.2, 0.01, -8e-5), (2.0, 0.2, -1e-3), Ts, (1.0, 100.0)), 50.0 + 30.0 * np.sin(0.4 * np.pi * t)
    noise = 0.005 * np.random.default_rng(seed).standard_normal(len(t))
    hum_and_drift = 0.03 * np.sin(14 * np.pi * t) + 0.005 * t
    log = RecordedLog("log", t, u, respond(plant, t, u, t) + hum_and_drift + noise)
    assert "idle-not-seen" in codes(fit_recorded([log], FitOptions(model=("nonlinear",))))


@pytest.mark.slow
@pytest.mark.parametrize("noise", [0.005, 0.02])
def test_an_output_that_ends_with_noise_behind_its_limit_is_left_out_there(noise):
    """No row repeats another: T_s at 100 % was a quarter short, "usable", and said to be known to 2 %."""
    t, random = np.arange(12_000) * 0.01, np.random.default_rng(6)
    u = np.append(np.zeros(300), np.repeat(np.append(random.choice([20.0, 40.0, 60.0, 80.0, 100.0], 38), 0.0), 300))
    clean, drawn = respond(REFERENCE_PLANT, t, u, t), noise * random.standard_normal(len(t))
    limit = 0.75 * float(clean.max())
    fit = fit_recorded([RecordedLog("log", t, u, np.minimum(clean, limit) + drawn)], FitOptions(model=("nonlinear",)))
    told = codes(fit)["output-saturates"].values
    assert told["limit"] == pytest.approx(limit, abs=3 * noise) and told["share_pct"] > 5
    assert fit.plant.steady(100.0) == pytest.approx(REFERENCE_PLANT.steady(100.0), rel=0.03)
    whole = fit_recorded([RecordedLog("log", t, u, clean + drawn)], FitOptions(model=("nonlinear",)))
    assert "output-saturates" not in codes(whole)


def random_steps(seconds=160.0, dt=0.02, seed=3):
    """Levels of 12 to 100 %, held for 0.5 to 8 s, every seventh one at rest."""
    draw, levels, holds = np.random.default_rng(seed), [0.0], [150]
    while sum(holds) * dt < seconds:
        levels.append(0.0 if len(levels) % 7 == 6 else draw.uniform(12, 100))
        holds.append(int(draw.uniform(0.5, 8.0) / dt))
    u = np.repeat(levels, holds)
    return dt * np.arange(len(u)), u


CURVES = {
    "saturates": lambda u: 3.6 * np.tanh(u / 45),
    "is S-shaped": lambda u: 4 / (1 + np.exp(-(u - 45) / 12)) - 0.09,
}


@pytest.mark.slow
@pytest.mark.parametrize("name", [pytest.param(one, marks=[pytest.mark.slow] * (one != "saturates")) for one in CURVES])
def test_a_torque_that_follows_no_cubic_is_no_fall_of_its_own(name):
    points = tuple((float(u), float(CURVES[name](u))) for u in np.linspace(10, 100, 91))
    plant = replace(REFERENCE_PLANT, Ts_through=points)
    t, u = random_steps()
    logs = [log(t, u, plant, 0.02)]
    fit = fit_recorded(logs, FitOptions(ci="none"))
    told = codes(fit)
    assert "torque-curve-by-evidence" in told and not {"falls-differ", "hysteresis"} & told.keys()
    for level in (20.0, 50.0, 80.0):
        assert float(fit.plant.steady(level)) == pytest.approx(float(CURVES[name](level)), rel=0.012)
    assert eaid.tune_rc(judged(fit)).margins.worst["pi"].gain_db >= 6
    assert not fit_recorded(logs, FitOptions(curve="cubic", ci="none")).plant.Ts_through


def test_a_cubic_torque_stays_one():
    t, u = random_steps()
    fit = fit_recorded([log(t, u, REFERENCE_PLANT, 0.02)], FitOptions(ci="none"))
    assert "torque-curve-by-evidence" not in codes(fit)


def test_a_range_that_ends_below_the_inputs_of_its_logs_goes_on_with_them():
    """With a curve that ends at 60 % what 100 % give was an input noted late, a hysteresis, another kind."""
    t = np.arange(10_000) * 0.02
    u = np.repeat([0.0, 20, 40, 60, 80, 100, 80, 60, 40, 20], 1000)
    fit = fit_recorded([log(t, u, REFERENCE_PLANT)], FitOptions(duty=(20.0, 60.0)))
    assert codes(fit)["range-goes-on"].values == {"wanted": 60.0, "high": 100.0}
    assert fit.plant.u_range == (20.0, 100.0) and not {"input-late", "hysteresis"} & codes(fit).keys()
    assert float(fit.plant.steady(60.0)) == pytest.approx(float(REFERENCE_PLANT.steady(60.0)), rel=0.005)


@pytest.mark.slow
def test_another_kind_of_a_loop_has_a_gain_over_the_inputs_that_act():
    """Noise leads a loop at rest to inputs next to 0, where a polynomial of the gain may be anything."""
    draw, n, dt, dead_rows = np.random.default_rng(1), 8000, 0.02, 4
    wanted = np.repeat(draw.uniform(0.3, 3.5, n // 200 + 1), 200)[:n] * (np.arange(n) >= 250)
    slow = lfilter([0.35], [1, -np.exp(-dt / 0.3)], draw.standard_normal(n))
    noise, steady = 0.006 * draw.standard_normal(n) + 0.01 * slow * wanted, lambda u: 0.04 * u * (0.4 + 0.006 * u)
    taus = (lambda u: 0.2 + 0.0025 * u, lambda u: 5 + 0.06 * u)
    duty, read = loop(wanted, dt, (15, 25), steady, taus, noise=noise, dead_rows=dead_rows)
    log = RecordedLog("loop", dt * np.arange(n), duty, read, reference=wanted)
    fit = judged(fit_recorded([log], FitOptions(model=("nonlinear",), ci="none")))
    assert fit.verdict.usable and fit.plant.dead_time_s == pytest.approx(dead_rows * dt, abs=0.005)


@pytest.mark.slow
def test_inputs_below_the_onset_tell_no_b():
    """B of an output that rests is as large as one likes, and no loop bears it."""
    points = tuple((float(u), float(max(u - 15, 0) * 0.05)) for u in np.linspace(2, 100, 197))
    t, u = random_steps()
    u = np.where((u > 0) & (u < 30), u - 12, u)
    fit = judged(
        fit_recorded([log(t, u, replace(REFERENCE_PLANT, Ts_through=points, u_range=(2.0, 100.0)))], FitOptions())
    )
    assert codes(fit)["level-at-rest"].levels and 20 * fit.linear.bounds.B_m > fit.linear.bounds.B_M
    assert eaid.tune_rc(fit).margins.worst["pi"].gain_db >= 6


def test_levels_of_a_recorded_log_are_said_by_its_range(run_eaid, tmp_path):
    t, u = random_steps(40.0)
    pd.DataFrame({"time_s": t, "duty_pct": u, "torque_nm": log(t, u).output}).to_csv(tmp_path / "log.csv", index=False)
    ran = run_eaid("fit", tmp_path / "log.csv", "--levels", "20:60", "-o", tmp_path / "f.json")
    assert ran.code == 2 and "say their range by --duty" in ran.err


@pytest.mark.slow
def test_all_models_of_a_fit_explain_about_one_mean():
    """Each log about its own mean, the plant was 10 points below the linear model of the same logs."""
    t = np.arange(2000) * 0.02
    logs = [log(t, np.repeat([0.0, u, 0.9 * u, u, 0.95 * u], 400), LAG, 0.05, f"{u:g}") for u in (20.0, 50.0, 100.0)]
    fit = fit_recorded(logs, FitOptions())
    assert fit.plant_.another and fit.plant_.tried[0].fit_pct == pytest.approx(fit.linear.fit_pct, abs=0.5)


def test_a_binary_input_that_moves_at_every_row_has_one_level_and_no_values_between():
    """Values of T_s(u) at 9 inputs were laid over a range of none (ValueError)."""
    random, t = np.random.default_rng(0), np.arange(6000) * 0.01
    u = np.where(t < 3, 0.0, 60.0 * random.integers(0, 2, len(t)))
    fit = fit_recorded([log(t, u, REFERENCE_PLANT)], FitOptions(model=("nonlinear",)))
    (row,) = fit.nonlinear.curves
    assert row.Ts == pytest.approx(float(REFERENCE_PLANT.steady(60.0)), rel=0.03)
    assert "one-input-only" in {one.code for one in fit.findings}
    assert "input-saturates" not in {one.code for one in fit.findings}


@pytest.mark.parametrize("seed", [1, 2])
def test_one_row_at_rest_before_an_input_that_was_noted_late_is_a_rest(seed):
    """Its start became unknown, and with it the idle output: T_s(80 %) was 4.7 for 2.8, the idle output -1.9 for 0."""
    random, t = np.random.default_rng(seed), np.arange(8000) * 0.02
    plant = Plant((0.3,), (6.0,), (0.0, 0.01, 3e-4), (10.0, 100.0))
    begins = np.append(0.01, 0.01 + np.cumsum(random.uniform(0.5, 5.0, 60)))
    levels = np.append(0.0, random.uniform(10.0, 100.0, 61).round(1))
    y = respond(plant, np.append(0.0, begins), levels, t) + 0.01 * random.standard_normal(len(t))
    noted = levels[np.searchsorted(begins + 0.01, t + 1e-9, side="right")]
    assert int((noted == 0).sum()) == 1
    fit = fit_recorded([RecordedLog("one row", t, noted, y)], FitOptions())
    assert fit.plant.steady(80.0) == pytest.approx(plant.steady(80.0), rel=0.03)


def chirped(clutch: bool, seed: int) -> pd.DataFrame:
    """A chirp up to 3 Hz that goes on between the rows of a log of 100 Hz, stepped at 1 kHz by no code of eaid's."""
    t = np.arange(0, 60, 1e-3)
    u = np.where(t < 1, 0.0, 45 + 30 * np.sin(2 * np.pi * (0.05 * t + (3 - 0.05) / 120 * t**2)))
    middle = np.append((u[1:] + u[:-1]) / 2, u[-1])
    middle[999] = 0.0  # where it jumps from rest
    steady, tau1 = (0.02 * middle + 2e-4 * middle**2, 0.5 - 0.002 * middle) if clutch else (0.03 * middle, 0.4)
    part = np.array([0.85, 0.15]) if clutch else np.array([1.0, 0.0])
    decay = np.exp(-1e-3 / np.stack([tau1 * np.ones(len(t)), np.full(len(t), 4.0)]))
    x, y = np.zeros(2), np.zeros(len(t))
    for k in range(len(t)):
        y[k] = x.sum()
        x = part * steady[k] + decay[:, k] * (x - part * steady[k])
    y += 0.02 * y.std() * np.random.default_rng(seed).standard_normal(len(t))
    return pd.DataFrame({"time_s": t, "duty_pct": u, "torque_nm": y})[::10]


@pytest.mark.slow
def test_an_input_that_moves_between_its_rows_is_one_that_goes_straight() -> None:
    """Held from row to row, T_s(15 %) of a clutch was a quarter off, in silence, and one lag a clutch in a loop."""
    fit = eaid.fit(frame := chirped(True, 0))
    assert fit.plant.kind == "parallel" and not {"input-late", "dead-time"}.intersection(codes(fit))
    held = [row.ci95.Ts[0] < 0.02 * row.level + 2e-4 * row.level**2 < row.ci95.Ts[1] for row in fit.nonlinear.curves]
    assert np.mean(held) > 0.8 and fit.plant.steady(15.1) == pytest.approx(0.3476, rel=0.05)
    (log,) = eaid.simulate(fit, log=frame).records.values()
    assert log.metrics.fit_pct == pytest.approx(fit.logs[0].fit_pct, abs=0.01)
    lag = eaid.fit(chirped(False, 1))
    assert lag.plant.kind == "lag" and not any("loop" in code for code in codes(lag))
    assert lag.plant.steady(50.0) == pytest.approx(1.5, rel=2e-3)
    assert lag.plant.time_constants(50.0)[0] == pytest.approx(0.4, rel=5e-3)


def held_for(seconds: float, seed: int = 2) -> tuple[np.ndarray, np.ndarray]:
    t, draw = np.arange(0, 60, 0.01), np.random.default_rng(seed)
    at = (t / seconds).astype(int)
    return t, draw.choice([0.0, 3.0, 6.0, 9.0, 12.0], at[-1] + 1)[at] * (at > 0)


@pytest.mark.parametrize("noise", [0.03, pytest.param(0.1, marks=pytest.mark.slow)])
def test_the_noise_of_a_held_input_that_was_measured_is_no_input(noise):
    """Of 0.1 V on 12 V it made the gain 91.4 (91.1 … 91.8) for 95, and T_s(7.5 V) a -698 in a row of others."""
    t, u = held_for(1.7)
    draw = np.random.default_rng(1)
    y = respond(Plant((0.18,), (0.18,), (0.0, 95.0), (1.0, 12.0), C=1.0), t, u, t) + 3 * draw.standard_normal(len(t))
    frame = pd.DataFrame({"time_s": t, "voltage_V": u + noise * draw.standard_normal(len(t)), "speed_rpm": y})
    fit = eaid.fit(eaid.read(frame, columns={"input": "voltage_V", "output": "speed_rpm"}))
    (low, high), run = fit.plant_.ci95.gain, eaid.simulate(fit, log=frame)
    assert fit.plant.kind == "lag" and low < 95 < high < 1.01 * low
    (replayed,) = run.records.values()
    assert replayed.metrics.fit_pct == pytest.approx(fit.logs[0].fit_pct, abs=0.01)
    for end in (u[u > 0].min(), u.max()):  # which were measured a little apart from these
        assert fit.at(end).loc["Ts", "value"] == pytest.approx(95 * end, rel=0.01) and len(fit.predict(end, [1.0]))


def test_an_input_that_moves_or_answers_the_output_is_taken_as_it_is():
    t, u = held_for(4.0)
    draw = np.random.default_rng(3)
    noise, y = 0.05 * draw.standard_normal(len(t)), draw.standard_normal(len(t))
    assert len(np.unique(hold_measured(u + noise, y))) == 5 and hold_measured(u, y) is u
    levels = np.random.default_rng(5).permutation(np.linspace(0.5, 12, 60))  # close, and none the mean of others
    held = hold_measured(np.repeat(levels, 100) + 0.3 * noise, y)
    assert np.abs(held - np.repeat(levels, 100)).max() < 0.015
    slow = np.sin(t / 9) * 0.4  # which no noise is
    for other, output in ((u - 0.05 * y, y), (u + noise + slow, y), (6 + 6 * np.sin(t) + noise, y)):
        assert hold_measured(other, output) is other


def test_logs_of_other_units_are_no_further_logs_of_a_rig(tmp_path):
    """Once a gain of 0.0536 N·m/% in silence, for two logs with 0.05 N·m/% and one with 0.06 N/V."""
    for name, header, gain in (("a", "time_s,duty_pct,torque_nm", 0.05), ("b", "time (s),input (V),output (N)", 0.06)):
        u = np.repeat(np.random.default_rng(1).uniform(10, 100, 30).round(), 100)
        y, t = np.zeros(3000), np.arange(3000) * 0.01
        for k in range(1, 3000):
            y[k] = y[k - 1] + 0.02 * (gain * u[k - 1] - y[k - 1])
        table = np.column_stack([t, u, y + 0.01 * np.random.default_rng(2).standard_normal(3000)])
        np.savetxt(tmp_path / f"{name}.csv", table, "%.6g", ",", header=header, comments="")
    with pytest.raises(eaid.DataError, match=r"b\.csv: its input is in V, that of other logs in %; fit it apart, or"):
        eaid.fit(tmp_path)
