"""Steps to one level: what they tell of other inputs is nothing, and no guarantee rests on it."""

import numpy as np
import pandas as pd

import eaid


def gains_of_one_level() -> eaid.Gains:
    t, random, logs = np.arange(0.0, 8.0, 0.01), np.random.default_rng(2), []
    for _ in range(3):
        rise = 1 - np.exp(-np.maximum(t - 1.0, 0.0) / 0.8)
        torque = 3.2 * (1 + 0.03 * random.standard_normal()) * rise + 0.01 * random.standard_normal(len(t))
        logs.append(pd.DataFrame({"time_s": t, "duty_pct": np.where(t < 1.0, 0.0, 80.0), "torque_Nm": torque}))
    at = np.arange(0.0, 30.0, 0.01)
    wanted = (at, 1.6 + 0.5 * np.cos(0.2 * np.pi * at))
    return eaid.tune_rc(eaid.fit(logs), reference=wanted, b_hat="minimax", phi="data")


def test_no_guarantee_rests_on_a_single_level_and_a_reference_that_begins_off_rest_is_no_error():
    gains = gains_of_one_level()
    held = {one.name: one.holds for one in gains.guarantee.conditions}
    assert gains.guarantee.holds is not True and held["phi"] is None and held["range"] is None
    assert held["rho"] is True  # B of one level is one number, to all its digits
    assert gains.replayed.rc.max_abs_error_nm < 0.2  # the reference jumps to 2.1 N·m at 0
