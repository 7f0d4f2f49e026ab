"""The same logs in other units are the same rig: fits, gains and replays agree after scaling."""

import numpy as np
import pandas as pd
import pytest

import eaid

from ..conftest import made_once

CONTROLLERS = ("rc", "pi", "inverse", "open-loop")
UNITS = {
    "V": (3.0, 1.0, "voltage_V", "torque_nm"),
    "A": (0.02, 25.0, "current_A", "force_N"),
    "percent": (1.0, 1.0, "duty_pct", "torque_nm"),
}
"""Input and output over % and N·m, and the columns' names."""


def logs(into, out, given, measured):
    """Five steps of the reference plant with noise, 10 s at 200 Hz."""
    random, made = np.random.default_rng(3), {}
    t = np.round(np.arange(0, 10, 0.005), 6)
    for u in (20.0, 40.0, 60.0, 80.0, 100.0):
        tau1, tau2 = 6.74e-3 + 2.39e-2 * u - 2.13e-4 * u**2, 0.93 + 0.41 * u - 2.64e-3 * u**2
        since, steady = np.maximum(t - 1, 0), 0.032 + 9.2e-3 * u + 2.1e-4 * u**2 + 1.32e-6 * u**3
        torque = steady * (1 - 0.85 * np.exp(-since / tau1) - 0.15 * np.exp(-since / tau2))
        torque = torque + 0.005 * random.standard_normal(len(t))
        made[f"r{u:g}"] = pd.DataFrame({"time_s": t, given: np.where(t >= 1, u, 0) * into, measured: torque * out})
    return made


@made_once
def fit_in(name):
    return eaid.fit(eaid.read(logs(*UNITS[name]), kind="clutch", columns={"input": UNITS[name][2]}), ci="none")


def agree(name, fit, gains, replay, fit0, gains0, replay0):
    """What V and N·m have, times the factors of the units."""
    into, out = UNITS[name][0] / UNITS["V"][0], UNITS[name][1] / UNITS["V"][1]
    for part, gain in (("tau1", 1.0), ("tau2", 1.0), ("Ts", out)):
        wanted = np.array(getattr(fit0.nonlinear, part))
        found = np.array(getattr(fit.nonlinear, part)) * into ** np.arange(len(wanted)) / gain
        np.testing.assert_allclose(found, wanted, rtol=1e-9)
    assert pytest.approx(gains0.pi.K_P * into / out, rel=1e-9) == gains.pi.K_P
    assert gains.rc.B_hat == pytest.approx(gains0.rc.B_hat * into / out, rel=1e-9)
    assert gains.rc.rho.constant == pytest.approx(gains0.rc.rho.constant * out, rel=1e-9)
    assert gains.rc.epsilon == pytest.approx(gains0.rc.epsilon * out, rel=1e-9)
    assert gains.guarantee.missing == gains0.guarantee.missing
    for controller in CONTROLLERS:
        found, wanted = replay.records[controller], replay0.records[controller]
        for column, factor in (("reference_nm", out), ("torque_nm", out), ("duty_pct", into)):
            size = np.abs(wanted.columns[column]).max()
            apart = found.columns[column] / factor, wanted.columns[column]
            np.testing.assert_allclose(*apart, atol=1e-9 * size, err_msg=controller)
        shares = found.metrics.saturated_fraction, wanted.metrics.saturated_fraction
        assert shares[0] == pytest.approx(shares[1], abs=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("scenario", ["steps", "multisine"])
def test_defaults_scale_with_the_rig(scenario):
    made = []
    for fit in (fit_in("A"), fit_in("V")):
        gains = eaid.tune_rc(fit)
        made += [fit, gains, eaid.simulate(fit, gains, scenario, controller=CONTROLLERS)]
    agree("A", *made)


@pytest.mark.slow
def test_the_papers_units_are_units_like_others_where_every_number_is_given(played):
    # in % and N·m the paper's numbers are the defaults; with the same wishes in both units nothing is left of that
    made, t = [], np.arange(3000) / 500
    for name in ("percent", "V"):
        into, out = UNITS[name][:2]
        gains = eaid.tune_rc(
            fit_in(name), kp=6.0, kd=3.5, epsilon=0.3 * out, gamma=80.0 / out, q_max=9.0 * out, phi="data",
            pi_overshoot=2.0, pi_settling=0.4, duty_limits=(0.0, 100.0 * into), rate_hz=500.0, pwm_hz=250.0,
        )  # fmt: skip
        reference = out * (1.5 + np.sin(2 * t) + (t > 3))
        run = played(reference, 1 / 500, fit=fit_in(name), gains=gains, controller=CONTROLLERS)
        made += [fit_in(name), gains, run]
    agree("percent", *made)
