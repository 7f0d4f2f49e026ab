"""The value from which a step starts: rests that are flat, wander, slope or are missing, and what `baseline` says."""

import itertools
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy.signal import lfilter

import eaid
from eaid.apparatus import Apparatus
from eaid.errors import DataError, UsageError
from eaid.options import FitOptions
from eaid.shapes.delay import dead_time_of
from eaid.steps.stepset import Level, StepSet

from ..conftest import codes
from .make import log, plus, read, told, white, with_input, without_input

T = np.arange(800) / 100
STEP = log([(0, 4), (50, 4)])
QUIET = [0.0, 0.01]
IDLES: dict[str, tuple[Any, float, float]] = {
    "flat": (0.3 + 0 * T, 0.3, 1e-3),
    "it wandered, as a motor's": (np.where(T < 1.5, 0.0, np.minimum(1.3 * (T - 1.5) / 0.3, 1.3)), 1.3, 0.005),
    "it slopes": (0.2 * T, 0.8, 0.015),
    "a spike": (np.where(np.arange(800) == 150, 1000.0, 0.0), 0.0, 1e-3),
}
"""What is added to the output, and the value just before the step, to within how much."""


@pytest.mark.parametrize("noise", QUIET)
@pytest.mark.parametrize("idle", IDLES)
def test_the_value_before_a_step_is_that_of_its_last_rest(idle: str, noise: float) -> None:
    change, value, within = IDLES[idle]
    steps = read(plus(STEP, change + white(800, noise)))
    assert steps.runs[0].baseline_nm == pytest.approx(value, abs=within + 0.2 * noise)
    assert steps.level_steps[0].start == steps.runs[0].baseline_nm
    assert ("idle-drifts" in told(steps)) is (idle == "it slopes") or idle.startswith("it wandered")
    assert not [one for one in steps.all_findings if one.severity == "stop"]


def test_how_long_a_rest_lasts_and_how_it_moved_is_known_and_a_fall_rests_for_a_twentieth_of_its_hold() -> None:
    frame = plus(log([(0, 4), (50, 9), (0, 9)]), 2e-3 * (np.arange(2200) > 200) + white(2200, 1e-3))
    up, down = read(frame).level_steps
    idle = frame.torque_nm[:400]
    assert up.rest_s == pytest.approx(4.0) and down.rest_s == pytest.approx(0.45)
    assert up.start == pytest.approx(idle.mean(), abs=1e-12)
    assert up.rest_moved == pytest.approx(idle[200:].mean() - idle[:200].mean(), abs=1e-12)


def test_behind_a_hold_the_last_quarter_and_one_sample_is_the_rest() -> None:
    frame = log([(0, 3), (30, 4), (0, 8), (60, 4)])
    frame = plus(frame, np.where((frame.time_s > 7) & (frame.time_s < 12.9), 0.004, 0.0))
    run = read(frame).runs[2]
    assert (run.name, run.baseline_nm) == ("a-2", pytest.approx(frame.torque_nm[1299:1500].mean(), abs=1e-12))


def test_each_step_has_its_own_rest_and_a_release_that_of_its_rise() -> None:
    frame = log([(0, 3), (30, 4), (0, 9), (60, 4), (0, 9)])
    frame = plus(frame, np.where(frame.time_s > 9, 0.5, 0.0))
    runs = {run.name: run.baseline_nm for run in read(frame).runs}
    near = pytest.approx
    assert runs == {"a": 0.0, "a-release": 0.0, "a-2": near(0.5, abs=2e-3), "a-release-2": near(0.5, abs=2e-3)}
    assert runs["a-release-2"] == runs["a-2"]
    first = read(frame, baseline="first").runs
    assert first[1].baseline_nm == first[0].baseline_nm


def test_the_first_samples_of_a_noisy_record_by_a_line() -> None:
    t = np.arange(5000) / 1000
    frame = log([(50, 5)], rate_hz=1000.0)
    starts = [
        read(frame.assign(torque_nm=3.0 - 2 * np.expm1(-t) + white(5000, 0.05, k))).runs[0].baseline_nm
        for k in range(12)
    ]
    assert np.mean(starts) == pytest.approx(3.0, abs=0.02)
    assert np.std(starts) < 0.03


@pytest.mark.parametrize("late", [0, 10])
def test_a_capture_that_begins_with_its_step_and_ends_released(late: int) -> None:
    """In noise of 1 %, with a dead time and without; one that begins loaded tells no rise."""
    plan = [(10, 20), (0, 10)]
    starts = []
    for seed in range(8):
        frame = log(plan, gain=0.1, offset=0.3, noise=0.01, seed=seed)
        frame["torque_nm"] = frame["torque_nm"].shift(late, fill_value=0.3)
        steps = read(frame)
        assert [one.level for one in steps.levels] == [10.0] and "step-at-first-sample" in told(steps)
        starts.append(steps.runs[0].baseline_nm)
    assert np.mean(starts) == pytest.approx(0.3, abs=0.012) and np.std(starts) < 0.015
    assert not read(log([(10, 20), *plan], gain=0.1)[1000:].reset_index(drop=True)).levels


@pytest.mark.parametrize(
    ("text", "value"), [("none", 0.0), ("-0.5", -0.5), ("FIRST", 0.4), ("-2:-1", 0.25), ("auto", 0.375), ("0.5:1", 2.4)]
)
def test_what_the_user_says_of_the_baseline(text: str, value: float) -> None:
    """An output that is 0.1 t before the step at 4 s, and 2 N·m more behind it."""
    steps = read(STEP.assign(torque_nm=0.1 * np.minimum(T, 4) + 2.0 * (T >= 4) * (T > 4.2)), baseline=text)
    expected = pytest.approx(value, abs=0.01)
    assert steps.runs[0].baseline_nm == expected and steps.level_steps[0].start == expected
    assert steps.levels[0].mean[-1] == pytest.approx(2.4 - steps.runs[0].baseline_nm, abs=1e-9)


def test_windows_that_hold_nothing() -> None:
    with pytest.raises(UsageError, match="baseline= 2:1: FROM must be below TO"):
        read(STEP, baseline="2:1")
    said = "baseline= -20:-10 holds no sample of a, which runs from -4 to 3.99 s relative"
    with pytest.raises(DataError, match=said):
        read(STEP, baseline="-20:-10")


@pytest.mark.parametrize(("rows", "code"), [(-5, "input-late"), (-2, "input-late"), (0, ""), (2, "dead-time")])
def test_an_input_noted_early_or_late_is_told_and_biases_nothing(rows: int, code: str) -> None:
    """Rows of 10 ms by which the output begins late: two of them once made τ1 5 and τ2 8 % wrong in silence."""
    time = np.arange(0, 17, 0.01)
    logs = {}
    for level, repeat in itertools.product((20, 40, 60, 80), (1, 2)):
        since = np.maximum(time - 2 - 0.01 * rows, 0)
        rise = 0.05 * level * (1 - 0.85 * np.exp(-since / 0.3) - 0.15 * np.exp(-since / 4))
        noise = 0.004 * np.random.default_rng(10 * level + repeat).standard_normal(len(time))
        duty = np.where(time >= 2 - 1e-9, level, 0)
        logs[f"{level}-{repeat}"] = pd.DataFrame({"time_s": time, "duty_pct": duty, "torque_nm": rise + noise})
    fit = eaid.fit(logs, model=("friction", "nonlinear"))
    told = {one.code: one.values for one in fit.findings if one.code in ("input-late", "dead-time")}
    assert set(told) == {code} - {""} and fit.verdict.usable and len(fit.friction.levels) == 4
    assert "output-creeps" not in [one.code for one in fit.findings]  # of a rise that began in the idle time
    for row in fit.friction.levels:
        assert (row.tau1, row.tau2) == pytest.approx((0.3, 4.0), rel=0.02)
    if rows < 0:
        assert told[code]["low"] < -10 * rows < told[code]["high"] and told[code]["rows"] == -rows
        assert fit.dead_time_s == 0
    elif rows:
        assert told[code]["low"] < 0.01 * rows < told[code]["high"] and fit.dead_time_s == told[code]["dead_time_s"]


T15 = np.arange(0.0, 15.0, 0.005)


def levels_of(share: float, theta_s: float, noise: float, runs: int, seed: int = 0) -> StepSet:
    """Five levels of two lags, 0.5 and 6 s, behind a dead time; gains that scatter by 3 %, white noise of the top."""
    random, t = np.random.default_rng(seed), np.maximum(T15 - theta_s, 0.0)
    curve = 1 - share * np.exp(-t / 0.5) - (1 - share) * np.exp(-t / 6)
    made = []
    for u in (20.0, 40.0, 60.0, 80.0, 100.0):
        gains = 0.04 * u * (1 + 0.03 * random.standard_normal((runs, 1)))
        made.append(
            Level(u, T15, gains * curve + 4 * noise * random.standard_normal((runs, T15.size)), (f"{u:g}",) * runs)
        )
    return StepSet("clutch", "V", "N", Apparatus(), tuple(made))


@pytest.mark.parametrize(("theta_s", "noise", "runs"), [(0.1, 0.05, 3), (0.05, 0.03, 1), (0.0, 0.05, 3)])
def test_noise_hides_no_dead_time_and_makes_none(theta_s: float, noise: float, runs: int) -> None:
    """It was 0 for 0.05 s and 0.17 for 0.1: a PI told 42 dB had 5.6."""
    fit = eaid.fit(levels_of(0.85, theta_s, noise, runs))
    assert fit.dead_time_s == pytest.approx(theta_s, abs=0.006)
    low, high = fit.at(60).loc["tau1", ["low", "high"]]
    assert low - 0.01 <= 0.5 <= high + 0.01


def test_one_lag_keeps_its_dead_time_under_noise() -> None:
    """Two exponentials made a jump of the first percents and a later start: 0.034 s (0.033 … 0.035) for 0.02."""
    random, t, made = np.random.default_rng(0), np.arange(0, 20, 0.004), []
    for u in np.linspace(20, 100, 8).tolist():
        gain, tau = 0.04 * u * (1 + 0.02 * random.normal(size=(3, 1))), 0.77 * np.exp(0.04 * random.normal(size=(3, 1)))
        runs = gain * -np.expm1(-np.maximum(t - 0.02, 0) / tau) + 0.03 * random.normal(size=(3, len(t)))
        made.append(Level(u, t, runs, (f"{u:g}",) * 3))
    begin = dead_time_of(StepSet("clutch", "V", "N", Apparatus(), tuple(made)), FitOptions())
    assert begin.ends is not None and begin.ends[1] - begin.ends[0] < 0.01
    assert begin.ends[0] < 0.02 < begin.ends[1]


@pytest.mark.slow
def test_an_overshoot_behind_a_dead_time_that_comes_down_slowly_keeps_it() -> None:
    """Its slow lag of 6 s in steps of 15 s was taken for a drift, and the kind without the dead time for it."""
    plant = eaid.fit(levels_of(1.3, 0.1, 0.002, 4)).plant
    assert plant.kind == "overshoot" and plant.dead_time_s == pytest.approx(0.1, abs=0.002)
    assert (plant.tau1[0], plant.tau2[0], plant.C) == pytest.approx((0.5, 6.0, 1.3), rel=0.03)


@pytest.mark.slow
@pytest.mark.parametrize("rows", [3, 5])
def test_steps_that_ring_tell_an_input_noted_late_too(rows: int) -> None:
    """Five rows of 10 ms once stopped the fit, and three bent the response by 3 % in silence."""
    time, logs, w, zeta = np.arange(0, 6, 0.01), {}, 6.0, 0.3
    since, wd = np.maximum(time - 1 + 0.01 * rows, 0), w * np.sqrt(1 - zeta**2)
    rings = 1 - np.exp(-zeta * w * since) * (np.cos(wd * since) + zeta * w / wd * np.sin(wd * since))
    for level in (20, 40, 60, 80):
        noise = 0.004 * np.random.default_rng(level).standard_normal(len(time))
        duty = np.where(time >= 1 - 1e-9, level, 0)
        logs[str(level)] = pd.DataFrame({"time_s": time, "duty_pct": duty, "torque_nm": 0.05 * level * rings + noise})
    fit = eaid.fit(logs)
    told = next(one.values for one in fit.findings if one.code == "input-late")
    assert abs(told["rows"] - rows) <= 1 and fit.verdict.usable
    assert rows == 5 or told["low"] < 10 * rows < told["high"] < 10 * rows + 2
    plant = fit.plant
    assert plant.kind == "ringing" and plant.zeta == pytest.approx(zeta, rel=0.01)
    assert plant.tau1[0] == pytest.approx(1 / w, rel=0.01)


def test_a_hold_ends_before_its_noted_end_where_its_input_was_noted_late(tmp_path: Path) -> None:
    """Its last rows hold the fall: τ2 was 17 % too short, the held output 2 %, and its logs were replayed late."""
    time = np.arange(0, 19, 0.01)
    since, fallen = np.maximum(time - 2 + 0.1, 0), np.maximum(time - 14 + 0.1, 0)
    rise = (1 - 0.85 * np.exp(-since / 0.4) - 0.15 * np.exp(-since / 5)) * np.exp(-fallen / 0.4)
    for level in (20, 40, 60, 80):
        noise = 0.004 * np.random.default_rng(level).standard_normal(len(time))
        duty = np.where((time >= 2 - 1e-9) & (time < 14 - 1e-9), level, 0)
        frame = pd.DataFrame({"time_s": time, "duty_pct": duty, "torque_nm": 0.04 * level * rise + noise})
        frame.to_csv(tmp_path / f"{level}.csv", index=False)
    fit = eaid.fit(tmp_path)
    assert [row.tau2 for row in fit.friction.levels] == pytest.approx([5.0] * 4, rel=0.03)
    assert fit.responses[-1].held == pytest.approx(0.04 * 80 * (1 - 0.15 * np.exp(-11.4 / 5)), rel=0.005)
    assert min(one.fit_pct for one in fit.data.replayed) > 97


def blind_folder(release: bool, noise: float) -> dict[str, Any]:
    """Logs without an input column, each with an idle time, an offset and, where it is let go, an end of its own."""
    rng, logs = np.random.default_rng(7), {}
    for level in (100, 170, 240, 310):
        for repeat in (1, 2):
            idle_s = round(float(rng.uniform(1, 4)), 2)
            frame = log([(0, idle_s), (level, 9), *([(0, 5)] if release else [])], "V", offset=0.4, tau2=4.0)
            y = frame.torque_nm + white(len(frame), noise, level + repeat)
            logs[f"rig_V={level}_r{repeat}"] = without_input(frame.assign(torque_nm=y)), idle_s
    return logs


@pytest.mark.parametrize(("release", "noise"), [(False, 0.02), (True, 0.2)])
def test_each_log_without_an_input_has_an_instant_of_its_own(release: bool, noise: float) -> None:
    logs = blind_folder(release, noise)
    steps = read({name: frame for name, (frame, _) in logs.items()}, name_pattern="_V={level}_r{repeat}")
    assert len(steps.runs) == (2 if release else 1) * len(logs)
    for run in steps.runs:
        idle_s = logs[run.name.removesuffix("-release")][1]
        (error_s,) = [one.values["error_s"] for one in run.findings if one.code == "step-from-output"] or [0.01]
        assert abs(run.step_s - idle_s - (9 if run.edge == "falling" else 0)) <= 0.03 + 3.5 * error_s
    fit = eaid.fit(steps)
    assert fit.verdict.usable and fit.dead_time_s == 0
    for level in (100, 170, 240, 310):
        for name, true in (("Ts", 0.04 * level), ("tau1", 0.2)):
            assert fit.at(level).loc[name].iloc[0] == pytest.approx(true, rel=0.15 if noise > 0.1 else 0.02)


def runs_late_by(theta_s: float, C: float, released: bool) -> dict[str, pd.DataFrame]:
    """Twelve runs at 100 Hz with noise that lasts; what is late below 0 is the note of the input."""
    time, logs = np.arange(0, 24 if released else 17, 0.01), {}
    for level, repeat in itertools.product((20, 40, 60, 80), (1, 2, 3)):
        rise_s, fall_s = np.maximum(time - 2 - theta_s, 0), np.maximum(time - 17 - theta_s, 0)
        y = 0.05 * level * (1 - C * np.exp(-rise_s / 0.4) - (1 - C) * np.exp(-rise_s / 4))
        y = y * np.exp(-fall_s / 0.3) if released else y
        random = np.random.default_rng(10 * level + repeat)
        wander = lfilter([1], [1, -np.exp(-0.05)], random.standard_normal(len(time))) * np.sqrt(1 - np.exp(-0.1))
        duty = np.where((time >= 2 - 1e-9) & (time < 17 - 1e-9), level, 0)
        y = y + 0.01 * wander + 0.003 * random.standard_normal(len(time))
        logs[f"{level}-{repeat}"] = pd.DataFrame({"time_s": time, "duty_pct": duty, "torque_nm": y})
    return logs


@pytest.mark.slow
def test_a_dead_time_beside_another_share_is_found_in_noise_that_lasts() -> None:
    """By a C of 0.85 no step was better behind it: it was lost, and a PI was told 27 dB on a loop that is unstable."""
    fit = eaid.fit(runs_late_by(0.06, 0.7, released=False))
    assert fit.plant.dead_time_s == pytest.approx(0.06, abs=0.006) and abs(fit.plant.C - 0.7) < 0.01


def test_an_input_noted_late_by_a_good_part_of_the_rise_is_moved_by_all_of_it() -> None:
    """The search ended at half of that, for holds end as early, too: τ1 was 20 % and τ2 25 % short."""
    fit = eaid.fit(runs_late_by(-0.2, 0.85, released=True))
    told = next(one.values for one in fit.findings if one.code == "input-late")
    assert told["ms"] == pytest.approx(200, abs=5) and fit.verdict.usable
    assert [row.tau1 for row in fit.friction_levels] == pytest.approx([0.4] * 4, rel=0.03)
    assert [row.tau2 for row in fit.friction_levels] == pytest.approx([4.0] * 4, rel=0.1)


def sampled_apart(rate_hz: int, in_phase: bool, seed: int = 1) -> dict[str, pd.DataFrame]:
    """Fifteen steps whose logger is slow, its clock in phase with the step, or by a part of a row off it in each."""
    random, logs, every = np.random.default_rng(seed), {}, 1000 // rate_hz
    t = np.arange(30_000) / 1000
    for level, k in itertools.product((20.0, 40.0, 60.0, 80.0, 100.0), range(3)):
        gain, pace = 1 + 0.02 * random.standard_normal(), float(np.exp(0.03 * random.standard_normal()))
        since = np.maximum(t - 5, 0.0)
        y = -0.04 * level * gain * (0.85 * np.expm1(-since / (0.4 * pace)) + 0.15 * np.expm1(-since / 6))
        rows = slice(0 if in_phase else int(random.integers(0, every)), None, every)
        noise = 0.005 * random.standard_normal(len(t[rows]))
        duty = np.where(t >= 5, level, 0.0)
        logs[f"u{level:g}_{k}"] = pd.DataFrame(
            {"time_s": t[rows], "duty_pct": duty[rows], "torque_nm": y[rows] + noise}
        )
    return logs


def test_a_slow_logger_notes_steps_half_a_row_late_and_the_fit_takes_them_as_they_acted() -> None:
    """τ1 of 0.4 s was 6 to 10 % short, τ2 up to 15, in intervals of half of that, without a word."""
    off, sure = (eaid.fit(sampled_apart(10, one), model=("nonlinear",)) for one in (False, True))
    assert codes(off)["input-late"].values["ms"] == pytest.approx(50, rel=0.5) and "input-late" not in codes(sure)
    for fit in (off, sure):
        for u in (40.0, 60.0, 80.0):
            for name, true in (("Ts", 0.04 * u), ("tau1", 0.4), ("tau2", 6.0)):
                value, low, high = fit.at(u).loc[name, ["value", "low", "high"]]
                assert value == pytest.approx(true, rel={"Ts": 0.05, "tau1": 0.07, "tau2": 0.1}[name]), (name, u)
                assert 0.98 * low <= true <= 1.02 * high, (name, u)


def test_a_load_that_never_leaves_5_N_is_told_to_rest_there() -> None:
    """Half of the levels began too far from 0 to count as steps from rest, and only a note said so."""
    frames = {}
    for level, k in itertools.product((20.0, 40.0, 80.0, 160.0), range(2)):
        frame = plus(log([(0, 4), (level, 10)], "N"), white(1400, 0.002))
        frames[f"N{level:g}_{k}"] = with_input(frame, np.maximum(frame.force_n, 5.0))
    steps = eaid.read(frames)
    (one,) = [each for each in steps.findings if each.code == "rests-elsewhere"]
    assert one.values["rest"] == pytest.approx(5.0) and len(steps.levels) < 4
    rested = eaid.read(frames, rest=5.0)
    assert len(rested.levels) == 4 and "rests-elsewhere" not in {each.code for each in rested.findings}


def test_a_rest_in_another_unit_is_refused_and_one_that_nobody_named_is_asked_for() -> None:
    """mV are read as V: --rest 500 made steps of −499.5 V, "usable yes". Rests at 20 % gave one lag a τ2 of 248 s."""
    t, draw = np.arange(0, 12, 0.01), np.random.default_rng(0)
    frames = {}
    for level in (30.0, 50.0, 100.0):
        u = np.where((t >= 2) & (t < 9), level, 20.0)
        y = 0.1 + 0.02 * (level - 20) * (np.exp(-np.maximum(t - 9, 0) / 0.4) - np.exp(-np.maximum(t - 2, 0) / 0.4))
        noise = 0.01 * draw.standard_normal(len(t))
        frames[f"{level:g}"] = pd.DataFrame({"time_s": t, "input (mV)": u, "torque_nm": y + noise})
    with pytest.raises(eaid.UsageError, match=r"rest=20 V: the inputs lie between 0.02 and 0.1 V"):
        eaid.read(frames, rest=20.0)
    told = next(one for one in eaid.read(frames).findings if one.code == "rest-unnamed")
    assert told.values["rest"] == pytest.approx(0.02)
    fit = eaid.fit(eaid.read(frames, rest=0.02))
    assert fit.plant.kind == "lag" and fit.plant.time_constants(0.05)[0] == pytest.approx(0.4, rel=0.02)
    assert "rest-unnamed" not in {one.code for one in fit.findings}
