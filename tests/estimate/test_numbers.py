"""Numbers of a fit by hand, where a small change of the code would move them and no other quick test looks."""

import numpy as np
import pandas as pd
import pytest

import eaid


def test_a_release_as_slow_as_the_hold_returns() -> None:
    """Both of its time constants above 1 s: the quick one has no bound there but the slow one."""
    t, logs = np.arange(0.0, 60.0, 0.05), {}
    on, off = (t - 1.0).clip(0.0), (t - 31.0).clip(0.0)
    for u in (20.0, 60.0, 100.0):
        rise = 1 - 0.85 * np.exp(-on / 0.4) - 0.15 * np.exp(-on / 3.0)
        fall = 0.85 * np.exp(-off / 1.6) + 0.15 * np.exp(-off / 7.0)
        torque = 0.04 * u * np.where(t < 31.0, rise, fall)
        logs[f"u{u:g}"] = pd.DataFrame({"time_s": t, "duty_pct": u * ((t >= 1) & (t < 31)), "torque_nm": torque})
    release = eaid.fit(logs, ci="none").release
    assert (release.tau1, release.tau2) == pytest.approx((1.6, 7.0), rel=1e-3)


def test_a_decay_under_hold_is_seen_through_noise_that_smoothing_takes_off() -> None:
    """Ten hundredths are lost under noise of five: a fiftieth of the record has 20 samples, so a mean has one."""
    t, random, logs = np.arange(0.0, 22.0, 0.02), np.random.default_rng(2), {}
    on = (t - 2.0).clip(0.0)
    for u in (20.0, 60.0, 100.0):
        for k in range(2):
            torque = 0.04 * u * (1 - np.exp(-on / 0.4)) * (1 - 0.1 * on / 20)
            noise = 0.05 * 0.04 * u * random.normal(size=len(t))
            logs[f"u{u:g}r{k}"] = pd.DataFrame({"time_s": t, "duty_pct": u * (t >= 2), "torque_nm": torque + noise})
    told = [one for one in eaid.fit(logs, ci="none").findings if one.code == "output-decays-under-hold"]
    assert len(told) == 1
