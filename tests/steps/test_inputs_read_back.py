"""Inputs that are read back: the noise of one that is held is neither a load nor both signs; a slow one moves."""

import numpy as np
import pandas as pd
import pytest

import eaid
from eaid.plant.dynamics import Plant
from eaid.plant.respond import respond

from ..conftest import codes

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


@pytest.mark.slow
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
    assert fit.plant.signed and fit.verdict.usable and len(fit.logs) == 3
    assert fit.plant.steady(np.array([-100.0, 100.0])) == pytest.approx([-1.0, 1.0], rel=0.01)


def test_a_slow_input_is_not_at_rest_throughout() -> None:
    t = np.arange(0.0, 180.0, 0.02)
    u = np.where(t < 2, 0.0, 150 + 60 * np.sin(0.3 * (t - 2)) + 40 * np.sin(0.9 * (t - 2)))
    output = respond(P, t, u, t) + 0.01 * np.random.default_rng(2).standard_normal(len(t))
    steps = eaid.read(pd.DataFrame({"time_s": t, "voltage_V": u, "torque_Nm": output}))
    assert len(steps.recorded) == 1 and "runs-left-out" not in [one.code for one in steps.all_findings]


CLUTCH = Plant((0.25, 0.004), (4.0, 0.03), (0.05, 0.012, 2.2e-4), (10.0, 100.0), C=0.85)


def read_back(seed: int, duty_noise: float = 0.0, resolution: float = 0.0, slope: float = np.inf) -> dict:
    """Three steps from rest to each of six duties: read back with noise, a sensor that rounds, a drive that ramps."""
    random, t, logs = np.random.default_rng(seed), np.arange(0.0, 24.0, 0.01), {}
    for level in (10.0, 20.0, 40.0, 60.0, 80.0, 100.0):
        duty = np.where((t >= 3) & (t < 22), level, 0.0)
        acts = np.minimum(duty, slope * np.maximum(t - 3, 0)) if np.isfinite(slope) else duty
        for repeat in range(3):
            gain = 1 + 0.02 * random.standard_normal()
            output = gain * respond(CLUTCH, t, acts, t) + 0.02 + 0.004 * random.standard_normal(len(t))
            output = np.round(output / resolution) * resolution if resolution else output
            noisy = duty + duty_noise * random.standard_normal(len(t)) if duty_noise else duty
            logs[f"{level:g}-{repeat}"] = pd.DataFrame({"time_s": t, "duty_pct": noisy, "torque_Nm": output})
    return logs


def test_a_duty_that_is_read_back_with_noise_is_a_duty() -> None:
    """It was refused: −0.55 % at rest, 100.5 % at the top."""
    fit = eaid.fit(read_back(3, duty_noise=0.3))
    assert [round(one) for one in fit.data.levels] == [10, 20, 40, 60, 80, 100] and fit.data.repeats == (3,) * 6
    for row in fit.friction_levels:
        true = CLUTCH.at(round(row.level))
        assert row.Ts == pytest.approx(true.Ts, rel=0.03) and row.tau1 == pytest.approx(true.tau1, rel=0.03)
    assert "designed-for-rig" not in codes(eaid.tune_rc(fit))  # 100.002 is a duty
    alone = {"one": read_back(3)["60-0"].assign(duty_pct=lambda log: log["duty_pct"] * 2.55)}
    with pytest.raises(eaid.DataError, match="153 % at 3 s, above 100"):
        eaid.fit(alone)


def test_a_sensor_that_rounds_leaves_its_low_levels_out_and_makes_no_spikes() -> None:
    """Single rows one step off were spikes, low plateaus a saturated sensor, and what was left of them drew τ2 off by
    37 %."""
    fit = eaid.fit(read_back(4, resolution=0.02), model=("friction", "nonlinear"))
    told = {one.code for one in fit.findings}
    assert not told & {"spikes-before-step", "saturated", "flat-topped"} and fit.data.levels == (40, 60, 80, 100)
    assert "runs-left-out" in told or any("coarse" in one for one in told)
    for row in fit.friction_levels:
        assert row.tau2 == pytest.approx(CLUTCH.at(row.level).tau2, rel=0.1)
    dithered = read_back(4, resolution=0.005)  # noise of a step's size: nothing is lost
    assert eaid.fit(dithered, model="nonlinear").data.levels == (10, 20, 40, 60, 80, 100)


@pytest.mark.slow
def test_a_drive_that_ramps_is_no_dead_time() -> None:
    fit = eaid.fit(read_back(5, slope=200.0), model=("friction", "nonlinear"))
    (told,) = [one for one in fit.findings if one.code == "dead-time-grows"]
    assert told.values["rate"] == pytest.approx(200, rel=0.15)
    assert "dead-time-grows" not in codes(eaid.fit(read_back(5), model="nonlinear"))


def test_a_log_that_is_left_out_is_not_played_again(tmp_path):
    logs = read_back(6)
    logs["60-1"] = logs["60-1"].assign(torque_Nm=np.where(logs["60-1"]["time_s"] > 8, 0.9, logs["60-1"]["torque_Nm"]))
    for name, log in logs.items():
        log.to_csv(tmp_path / f"{name}.csv", index=False)
    fit = eaid.fit(tmp_path, model=("friction", "nonlinear"))
    assert fit.data.repeats == (3, 3, 3, 2, 3, 3) and "runs-left-out" in codes(fit)
    assert "60-1" not in {one.run for one in fit.data.replayed} and len(fit.data.replayed) == 17
