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
