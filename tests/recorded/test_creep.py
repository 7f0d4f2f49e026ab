"""An output that creeps beside its response, or whose zero jumps, in a log of any input."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy.signal import lfilter

import eaid
from benchmarks.coverage import RECORDED
from eaid.plant.dynamics import REFERENCE_PLANT, Plant
from eaid.plant.respond import respond

from ..conftest import codes

LEVELS = (20.0, 60.0, 100.0)
HEATER = {"input": "heater (%)", "output": "temp (degC)"}
TRUE = Plant((0.3,), (4.0,), (0.0, 0.02, 2e-4), (20.0, 100.0))


def staircase(creep: float, bent: bool = False, seed: int = 1) -> pd.DataFrame:
    """160 s up and down, to rest and up again; noise of 0.02 N·m, a creep in N·m, straight or as what warms up."""
    t = np.arange(0.0, 160.0, 0.04)
    duty = np.repeat([0.0, *LEVELS, 60.0, 20.0, 0.0, 100.0], 500)
    way = -np.expm1(-t / 50) if bent else t / 160
    torque = respond(TRUE, t, duty, t) + creep * way + 0.02 * np.random.default_rng(seed).normal(size=len(t))
    return pd.DataFrame({"time_s": t, "duty_pct": duty, "torque_nm": torque})


@pytest.mark.parametrize(("creep", "bent"), [(0.06, False), pytest.param(0.12, True, marks=pytest.mark.slow)])
def test_a_creep_is_found_and_no_plant_imitates_it(creep, bent, tmp_path):
    """One of 1 % of the highest output made τ2 half as long again, and a hysteresis."""
    path = tmp_path / "log.csv"
    staircase(creep, bent).to_csv(path, index=False)
    fit = eaid.fit(path, shape="one")
    told = {one.code: one.values for one in fit.findings if one.severity != "note"}
    assert set(told) == {"few-levels-for-polynomials", "log-creeps"}  # there are three
    if not bent:
        assert told["log-creeps"]["low"] < creep < told["log-creeps"]["high"]
        assert fit.logs[0].creep == pytest.approx((creep, 0.0), abs=0.015)
    for level in LEVELS:
        assert fit.at(level).loc["Ts", "value"] == pytest.approx(TRUE.steady(level), rel=0.008)
        assert fit.at(level).loc["tau2", "value"] == pytest.approx(4.0, rel=0.1)
    again = eaid.simulate(fit, log=path).records["log"]
    assert again.metrics.fit_pct == pytest.approx(fit.logs[0].fit_pct, abs=0.01)


WIDE = Plant((0.1, 0.012, -1e-4), (1.5, 0.12, -7e-4), (0.05, 0.01, 2e-4, 1.2e-6), (10.0, 100.0))


def with_ripple(plant: Plant, duty: np.ndarray, random: np.random.Generator) -> pd.DataFrame:
    """At 100 Hz; noise of 0.01 N·m, and of 1 % of the output with a memory of 0.2 s."""
    t, keep = np.arange(len(duty)) / 100, np.exp(-0.05)
    y = respond(plant, t, duty, t)
    ripple = lfilter([np.sqrt(1 - keep**2)], [1, -keep], random.normal(size=len(t)))
    torque = y + 0.01 * np.abs(y) * ripple + 0.01 * random.normal(size=len(t))
    return pd.DataFrame({"time_s": t, "duty_pct": duty, "torque_nm": torque})


def random_steps(plant: Plant, lasts_s: float, seed: int) -> pd.DataFrame:
    """Levels of 10 to 100 % for 0.3 to 6 s each."""
    random, parts = np.random.default_rng(seed), [np.zeros(200)]
    while sum(map(len, parts)) < 100 * lasts_s:
        parts.append(np.full(int(random.uniform(30, 600)), float(random.integers(10, 101))))
    return with_ripple(plant, np.concatenate(parts), random)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [4, 1])
def test_another_share_makes_no_input_noted_late(seed):
    """C of 0.6: with the one that is held, inputs acted 20 ms early, and τ1 was a quarter too long."""
    plant = replace(WIDE, C=0.6)
    fit = eaid.fit(random_steps(plant, 200.0, seed))
    assert not [one for one in fit.findings if one.code in ("input-late", "dead-time")]
    assert plant.C - 0.02 < fit.plant.C < plant.C + 0.02
    for level in (15.0, 55.0, 95.0):
        assert fit.at(level).loc["tau1", "value"] == pytest.approx(float(plant.time_constants(level)[0]), rel=0.06)


@pytest.mark.slow
def test_falls_that_differ_no_longer_by_themselves_are_as_rises():
    """Fitted alone, what the whole test told had a chance of 0.002 to 0.94, and was the plant's all the same."""
    random = np.random.default_rng(2)
    fit = eaid.fit(with_ripple(WIDE, np.append(np.zeros(200), np.repeat(random.choice([20.0, 80.0], 500), 25)), random))
    assert not any(one.fitted for one in fit.recorded.falls)
    assert fit.plant.falls == (1.0, 1.0) and "falls-differ" not in {one.code for one in fit.findings}


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.slow)])
def test_slow_noise_is_no_creep(seed):
    """Of a memory of 2 s, 1 % of the highest output: nothing but three levels to tell."""
    log = staircase(0.0)
    log["torque_nm"] += lfilter([0.04 * 0.2], [1, -0.98], np.random.default_rng(seed).normal(size=len(log)))
    told = {one.code for one in eaid.fit(log, ci="none").findings if one.severity != "note"}
    assert told == {"few-levels-for-polynomials"}


@pytest.mark.slow
def test_a_gain_that_drifts_is_no_creep_of_the_output():
    t, random = np.arange(0.0, 160.0, 0.04), np.random.default_rng(2)
    duty = np.append(np.zeros(100), np.repeat(random.choice(LEVELS, 39), 100))
    torque = respond(TRUE, t, duty, t) * (1 - 0.12 * (t / 160 - 0.5)) + 0.02 * random.normal(size=len(t))
    fit = eaid.fit(pd.DataFrame({"time_s": t, "duty_pct": duty, "torque_nm": torque}), ci="none", shape="one")
    told = {one.code: one.values for one in fit.findings}
    assert "log-creeps" not in told and told["gain-drifts"]["pct"] == pytest.approx(-12.0, abs=0.5)


@pytest.mark.slow
def test_a_drift_of_the_gain_takes_no_slow_part_away(tmp_path):
    """An input that moves: one lag took the place of the clutch, whose T_s was open, thrice too large at low ones."""
    t, random = np.arange(0.0, 240.0, 0.02), np.random.default_rng(5)
    holds = np.repeat(random.uniform(10.0, 100.0, 400), random.integers(10, 200, 400))[: len(t) - 100]
    duty = np.append(np.zeros(len(t) - len(holds)), holds)
    torque = respond(TRUE, t, duty, t) * (1 - 0.1 * t / 240) + 0.01 * random.normal(size=len(t))
    path = tmp_path / "log.csv"
    pd.DataFrame({"time_s": t, "duty_pct": duty, "torque_nm": torque}).to_csv(path, index=False)
    fit = eaid.fit(path)
    assert fit.plant.kind == "parallel" and fit.logs[0].drift == pytest.approx(-0.105, abs=0.005)
    for u in (20.0, 60.0, 95.0):
        assert fit.plant.steady(u) == pytest.approx(0.95 * TRUE.steady(u), rel=0.02)
    again = eaid.simulate(fit, log=path).records["log"]
    assert again.metrics.fit_pct == pytest.approx(fit.logs[0].fit_pct, abs=0.01)


@pytest.mark.slow
def test_a_chirp_whose_frequency_goes_with_time_drifts_no_gain():
    """In two of eight a drift of 3 and 4 % was taken off, and τ1 was 6 and 8 % off at the top, to 1.5 %."""
    excitation, shape = RECORDED["chirp"]
    noise = {"white_nm": 0.006, "coloured": 0.01, "coloured_s": 0.3}
    logs = eaid.synth(excitation=excitation, shape=shape, rate_hz=200.0, clean=True, seed=1002, **noise)
    fit = eaid.fit(logs, model=("nonlinear",), duty=(10.0, 100.0))
    assert "gain-drifts" not in [one.code for one in fit.findings]
    for row in fit.nonlinear.curves:
        assert row.ci95.tau1[0] < REFERENCE_PLANT.at(row.level).tau1 < row.ci95.tau1[1]


@pytest.mark.slow
@pytest.mark.parametrize("pct", [0.1, pytest.param(1.0, marks=pytest.mark.slow)])
def test_a_drift_beside_one_lag_is_no_slow_part_of_a_clutch(pct):
    """A motor whose tacho drifts by a thousandth: T_s was 1341 (1340.7 … 1342.1) RPM for 1140, in 4 of 5."""
    draw, t = np.random.default_rng(101), np.arange(0, 40, 0.02)
    at = np.searchsorted(np.cumsum(draw.uniform(0.5, 2, 40)), t)
    u = draw.choice([0.0, 3, 6, 9, 12], 41)[at] * (at > 0)
    keep = np.exp(-0.02 / 0.18)
    y = 95 * lfilter([0, 1 - keep], [1, -keep], u) + pct * 11.4 * t / 40 + 3 * draw.standard_normal(len(t))
    log = pd.DataFrame({"time (s)": t, "voltage (V)": u, "speed (rpm)": y})
    fit = eaid.fit(eaid.read(log, columns={"input": "voltage (V)", "output": "speed (rpm)"}))
    assert fit.plant.kind == "lag" and fit.plant.tau1[0] == pytest.approx(0.18, rel=0.01)
    low, high = fit.plant_.at(12.0)["Ts"][1]
    assert 0.99 * low < 1140 < 1.01 * high and high / low < 1.03


@pytest.mark.parametrize("drift", [0.0002, pytest.param(0.0008, marks=pytest.mark.slow)])
def test_a_heater_in_a_room_that_warms_up_is_one_lag(drift):
    """T_s(60 %) was 131 and 56 degrees for 48, "usable yes"."""
    t = np.arange(0, 3600, 2.0)
    u = np.select([t < 120, t < 900, t < 1800, t < 2700], [0.0, 20, 60, 40])
    late = np.append(np.zeros(3), u)[: len(t)]  # by 6 s
    keep = np.exp(-2 / 95)
    y = 22 + drift * t + 0.8 * lfilter([0, 1 - keep], [1, -keep], late)
    y = y + 0.05 * np.random.default_rng(0).standard_normal(len(t))
    log = pd.DataFrame({"time (s)": t, "heater (%)": u, "temp (degC)": y})
    fit = eaid.fit(eaid.read(log, columns=HEATER), ci="none", shape="one")
    assert fit.plant.kind == "lag" and float(fit.plant.steady(60.0)) == pytest.approx(48.0, rel=0.005)
    assert fit.plant.dead_time_s == pytest.approx(6.0, abs=0.5)
    assert fit.logs[0].creep[0] == pytest.approx(3600 * drift, rel=0.1)


@pytest.mark.slow
def test_steps_of_a_heater_in_a_room_that_warms_up_are_one_lag():
    """T_s(40 %) was 37.7 (34.6 … 40.9) degrees for 32, with a τ2 of 18,000 s that none of the levels showed."""
    draw, t, frames = np.random.default_rng(4), np.arange(0, 1200, 1.0), {}
    for level in (20.0, 40.0, 60.0):
        on = np.maximum(t - 246, 0)
        y = 21 + t / 1800 - 0.8 * level * np.expm1(-on / 95) + 0.05 * draw.standard_normal(len(t))
        columns = {"time (s)": t, "heater (%)": np.where(t >= 240, level, 0.0), "temp (degC)": y}
        frames[f"{level:g}"] = pd.DataFrame(columns)
    fit = eaid.fit(eaid.read(frames, columns=HEATER))
    assert fit.plant.kind == "lag" and float(fit.plant.steady(40.0)) == pytest.approx(32.0, rel=0.03)


JUMPING = Plant((0.2, 0.004), (3.0, 0.03), (0.0, 0.02, 1.9e-4), (20.0, 100.0), C=0.85)
TIMES = np.arange(0.0, 120.0, 0.02)


def jumping(seed, jump=0.0, at_s=60.0):
    random, u = np.random.default_rng(seed), np.zeros(len(TIMES))
    held = np.repeat(random.choice([0.0, 20.0, 40.0, 60.0, 80.0, 100.0], 60), random.integers(50, 300, 60))
    u[150:-250] = held[: len(TIMES) - 400]
    y = respond(JUMPING, TIMES, u, TIMES) + jump * (at_s <= TIMES) + 0.02 * random.standard_normal(len(TIMES))
    return pd.DataFrame({"time_s": TIMES, "duty_pct": u, "torque_nm": y})


@pytest.mark.slow
@pytest.mark.parametrize(
    ("seed", "jump", "at_s"), [(0, 0.15, 60.0), pytest.param(2, 0.3, 100.0, marks=pytest.mark.slow)]
)
def test_a_jump_of_the_zero_is_found_and_the_fit_is_without_it(seed, jump, at_s):
    """0.15 of 3.9 N·m: T_s 3 % off, or a slow part without end, "usable yes", in silence."""
    log = jumping(seed, jump, at_s)
    fit = eaid.fit(log, shape="one")
    told = codes(fit)["zero-jumps"].values
    assert (told["at_s"], told["size"]) == pytest.approx((at_s, jump), rel=0.05)
    for level in (20.0, 60.0, 100.0):
        at = fit.at(level)
        for name in ("Ts", "tau1", "tau2"):
            low, high = at.loc[name, ["low", "high"]]
            assert 0.97 * low < getattr(JUMPING.at(level), name) < 1.03 * high, (level, name)
    (record,) = eaid.simulate(fit, log=log).records.values()
    assert record.metrics.fit_pct == pytest.approx(fit.logs[0].fit_pct, abs=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("memory", [0.99, 1.0])
def test_noise_that_lasts_jumps_nowhere(memory):
    log = jumping(3)
    log["torque_nm"] += lfilter(
        [0.004 + 0.006 * (memory < 1)], [1, -memory], np.random.default_rng(7).normal(size=6000)
    )
    assert "zero-jumps" not in codes(eaid.fit(log))
