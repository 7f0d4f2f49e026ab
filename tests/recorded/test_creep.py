"""An output that creeps beside its response, in a log of any input."""

import numpy as np
import pandas as pd
import pytest
from scipy.signal import lfilter

import eaid
from eaid.plant.dynamics import Plant
from eaid.plant.respond import respond

LEVELS = (20.0, 60.0, 100.0)
TRUE = Plant((0.3,), (4.0,), (0.0, 0.02, 2e-4), (20.0, 100.0))


def staircase(creep: float, bent: bool = False, seed: int = 1) -> pd.DataFrame:
    """160 s up and down, to rest and up again; noise of 0.02 N·m, a creep in N·m, straight or as what warms up."""
    t = np.arange(0.0, 160.0, 0.04)
    duty = np.repeat([0.0, *LEVELS, 60.0, 20.0, 0.0, 100.0], 500)
    way = -np.expm1(-t / 50) if bent else t / 160
    torque = respond(TRUE, t, duty, t) + creep * way + 0.02 * np.random.default_rng(seed).normal(size=len(t))
    return pd.DataFrame({"time_s": t, "duty_pct": duty, "torque_nm": torque})


@pytest.mark.parametrize(("creep", "bent"), [(0.0, False), (0.06, False), (-0.12, False), (0.12, True)])
def test_a_creep_is_found_and_no_plant_imitates_it(creep, bent, tmp_path):
    """One of 1 % of the highest output made τ2 half as long again, and a hysteresis."""
    path = tmp_path / "log.csv"
    staircase(creep, bent).to_csv(path, index=False)
    fit = eaid.fit(path)
    told = {one.code: one.values for one in fit.findings if one.severity != "note"}
    assert set(told) == ({"log-creeps"} if creep else set())
    if creep and not bent:
        assert told["log-creeps"]["low"] < creep < told["log-creeps"]["high"]
        assert fit.logs[0].creep == pytest.approx((creep, 0.0), abs=0.015)
    for level in LEVELS:
        assert fit.at(level).loc["Ts", "value"] == pytest.approx(TRUE.steady(level), rel=0.008)
        assert fit.at(level).loc["tau2", "value"] == pytest.approx(4.0, rel=0.1)
    again = eaid.simulate(fit, log=path).records["log"]
    assert again.metrics.fit_pct == pytest.approx(fit.logs[0].fit_pct, abs=0.01)


@pytest.mark.parametrize("seed", range(3))
def test_slow_noise_is_no_creep(seed):
    """Of a memory of 2 s, 1 % of the highest output."""
    log = staircase(0.0)
    log["torque_nm"] += lfilter([0.04 * 0.2], [1, -0.98], np.random.default_rng(seed).normal(size=len(log)))
    assert "log-creeps" not in {one.code for one in eaid.fit(log).findings}


def test_a_gain_that_drifts_is_no_creep_of_the_output():
    t, random = np.arange(0.0, 160.0, 0.04), np.random.default_rng(2)
    duty = np.append(np.zeros(100), np.repeat(random.choice(LEVELS, 39), 100))
    torque = respond(TRUE, t, duty, t) * (1 - 0.12 * (t / 160 - 0.5)) + 0.02 * random.normal(size=len(t))
    fit = eaid.fit(pd.DataFrame({"time_s": t, "duty_pct": duty, "torque_nm": torque}))
    told = {one.code: one.values for one in fit.findings}
    assert "log-creeps" not in told and told["gain-drifts"]["pct"] == pytest.approx(-12.0, abs=0.5)


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
