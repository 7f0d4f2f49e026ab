"""Six sessions of the reference plant whose T_s differ by a gain, a tilt over the level and a session × level part."""

import numpy as np
import pandas as pd
import pytest

import eaid
from eaid.plant.dynamics import REFERENCE_PLANT
from eaid.plant.respond import from_rest

LEVELS = (20.0, 40.0, 60.0, 80.0, 100.0)
TIME = np.arange(0.0, 14.0, 0.02)
T_S = (0.175, 0.325, 0.934, 0.111, 0.4, 1.312, 0.12, 0.264, 0.642, 0.095, 0.21, 0.5, 0.15, 0.33, 0.9)


def log(level, gain, rng, after_s=2.0):
    on = after_s <= TIME
    y = gain * np.exp(0.05 * rng.standard_normal()) * from_rest(REFERENCE_PLANT, np.maximum(TIME - after_s, 0), level)
    noise = 0.01 * rng.standard_normal(len(TIME))
    return pd.DataFrame({"time_s": TIME, "duty_pct": np.where(on, level, 0.0), "torque_nm": on * y + noise})


def session(seed, gain=0.0, tilt=0.0, levels=LEVELS, repeats=3):
    """Logs by name."""
    rng = np.random.default_rng(seed)
    logs = {}
    for u in levels:
        factor = np.exp(gain + tilt * np.log(u / 60) + 0.05 * rng.standard_normal())
        logs |= {f"s{seed}_{u:g}_{k}": log(u, factor, rng) for k in range(repeats)}
    return logs


@pytest.fixture(scope="session")
def make():
    """The makers of logs."""
    return session


@pytest.fixture(scope="session")
def fits():
    rng = np.random.default_rng(11)
    return {f"s{k}": eaid.fit(session(k, *rng.normal(0, (0.3, 0.3)))) for k in range(6)}


@pytest.fixture(scope="session")
def rig(fits):
    return eaid.sessions(fits)


@pytest.fixture(scope="session")
def slipping():
    """A clutch that slips back, 1.2 at its peak, 0.9 held: three sessions, and the gain of each."""
    t, rng, fits, gains = np.arange(0.0, 14.0, 0.02), np.random.default_rng(3), {}, []
    for s in range(3):
        gain, logs = np.exp(0.4 * rng.standard_normal()), {}
        for u in (20.0, 60.0, 100.0):
            for k in range(2):
                own, since = gain * np.exp(0.03 * rng.standard_normal()), np.maximum(t - 2, 0)
                y = 0.05 * u * own * (1.5 * (1 - np.exp(-since / 0.2)) - 0.6 * (1 - np.exp(-since / 2.0)))
                y += 0.002 * rng.standard_normal(len(t))
                columns = {"time_s": t, "duty_pct": np.where(t < 2, 0.0, u), "torque_nm": y}
                logs[f"s{s}_{u:g}_{k}"] = pd.DataFrame(columns)
        fits[f"s{s}"] = eaid.fit(logs)
        gains.append(gain)
    return fits, gains


@pytest.fixture
def table():
    """The check values: five sessions at 150, 200 and 300 V."""
    days, levels = [f"day {k // 3}" for k in range(15)], (150, 200, 300) * 5
    return pd.DataFrame({"session": days, "level": levels, "value": T_S, "sd_log": 0.11 / 5**0.5})
