"""Inputs that are read back: the noise of one that is held is neither a load nor both signs; a slow one moves."""

import numpy as np
import pandas as pd
import pytest

import eaid
from eaid.plant.dynamics import Plant
from eaid.plant.respond import respond

P = Plant((0.3,), (4.0,), (0.0, 0.01), (10.0, 300.0))


def test_a_noisy_voltage_monitor_holds_steps() -> None:
    """1 V of noise of 30 to 300 V: the lowest level was one of both signs, and the fit ended in an IndexError."""
    random, t, logs = np.random.default_rng(0), np.arange(0.0, 20.0, 0.01), {}
    for level in (30.0, 100.0, 200.0, 300.0):
        for repeat in range(3):
            volts = np.where((t >= 3) & (t < 15), level, 0.0)
            output = respond(P, t, volts, t) + 0.005 * random.standard_normal(len(t))
            noisy = volts + random.standard_normal(len(t))
            logs[f"{level:g}-{repeat}"] = pd.DataFrame({"time_s": t, "voltage_V": noisy, "torque_Nm": output})
    steps = eaid.read(logs)
    assert not steps.recorded and [round(one.level) for one in steps.levels] == [30, 100, 200, 300]
    fit = eaid.fit(steps, model=("friction", "nonlinear"))
    for row in fit.friction_levels:
        assert row.Ts == pytest.approx(0.01 * row.level, rel=0.03)


def test_steps_beside_a_log_of_both_signs_stop_no_fit() -> None:
    random, t = np.random.default_rng(1), np.arange(0.0, 60.0, 0.01)
    signed = np.repeat(random.choice([-100.0, -50.0, 0.0, 50.0, 100.0], 30), 200)
    lag = Plant((0.3,), (0.3,), (0.0, 0.01), (10.0, 300.0), C=1.0, Ts_below=(0.0, -0.01))
    rise = np.where(t >= 2, 100.0, 0.0)[:2000]
    logs = {}
    for name, volts in (("both", signed), ("step", rise), ("again", rise)):
        at = t[: len(volts)]
        output = respond(lag, at, volts, at) + 0.005 * random.standard_normal(len(at))
        logs[name] = pd.DataFrame({"time_s": at, "voltage_V": volts, "torque_Nm": output})
    fit = eaid.fit(logs)
    assert fit.plant.signed and fit.verdict.usable and len(fit.logs) == 1
    (told,) = [one for one in fit.findings if one.code == "runs-left-out"]
    assert len(told.values["runs"]) == 2 and "both signs" in told.values["why"]


def test_a_slow_input_is_not_at_rest_throughout() -> None:
    t = np.arange(0.0, 180.0, 0.02)
    u = np.where(t < 2, 0.0, 150 + 60 * np.sin(0.3 * (t - 2)) + 40 * np.sin(0.9 * (t - 2)))
    output = respond(P, t, u, t) + 0.01 * np.random.default_rng(2).standard_normal(len(t))
    steps = eaid.read(pd.DataFrame({"time_s": t, "voltage_V": u, "torque_Nm": output}))
    assert len(steps.recorded) == 1 and "runs-left-out" not in [one.code for one in steps.all_findings]
