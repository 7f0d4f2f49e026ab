"""The PI behind a Smith predictor: what it promises, on the true plant by python-control, and what it is worth."""

import numpy as np
import pytest

import eaid

from ..conftest import GAINS, loaded

HEATERS = [(164.0, 149.0, 32.0, 10.0), (13.0, 110.0, 0.71, 80.0)]  # dead time and lag [s], gain, highest input


def fit_of(dead_s, tau, gain, top):
    plant = {"kind": "lag", "C": 1.0, "Ts": [0.0, gain], "tau1": [tau], "u_range": [top / 10, top],
             "dead_time_s": dead_s, "input_unit": "V", "output_unit": "°C"}  # fmt: skip
    B = tau / gain
    linear = {"a0": 1 / tau, "b0": 1 / B, "c0": 0.0, "bounds": {"B_m": 0.95 * B, "B_M": 1.05 * B}}
    data = {"input_unit": "V", "output_unit": "°C", "levels": [top / 10, top]}
    return loaded({"data": data, "linear": linear, "plant": plant})


def margins_by_python_control(gains, fit, name, dead_s, rate_hz):
    """Gain [dB] and phase margin [°] of the loop opened at the duty: one lag and a dead time, by blocks."""
    import control

    h, held, plant = 1 / rate_hz, gains.controllers_by_name[name], fit.plant
    omega = np.geomspace(1e-5, 0.999 * np.pi / h, 50_000)
    z = np.exp(1j * omega * h)
    rig = control.c2d(control.tf([plant.Ts[1]], [plant.tau1[0], 1.0]), h)(z)
    if name == "smith":
        pi = held["K_P"] + held["K_I"] * h / (z - 1)
        law = pi / (1 + pi * rig * (1 - np.exp(-1j * omega * held["dead_time_s"])))
    else:
        law = held.K_P + held.K_I * h / (z - 1)
    loop = law * rig * np.exp(-1j * omega * dead_s)
    turns = np.flatnonzero((loop.imag[:-1] < 0) & (loop.imag[1:] >= 0) & (loop.real[1:] < 0))
    crosses = np.flatnonzero((np.abs(loop[:-1]) >= 1) != (np.abs(loop[1:]) >= 1))
    return -20 * np.log10(np.abs(loop[turns]).max()), np.degrees(np.angle(-loop[crosses])).min()


@pytest.mark.parametrize("heater", HEATERS)
def test_its_margins_are_python_controls_with_the_dead_time_a_fifth_off_too(heater):
    fit = fit_of(*heater)
    gains = eaid.tune_rc(fit)
    rate_hz, worst = gains.margins.timing.rate_hz, gains.margins.worst
    for name in ("pi", "smith"):
        found = margins_by_python_control(gains, fit, name, heater[0], rate_hz)
        assert (worst[name].gain_db, worst[name].phase_deg) == (
            pytest.approx(found[0], abs=0.15), pytest.approx(found[1], abs=0.3),
        )  # fmt: skip
    for wrong in (0.8, 1.2):
        gain_db, phase_deg = margins_by_python_control(gains, fit, "smith", wrong * heater[0], rate_hz)
        assert gain_db >= 5.9 and phase_deg >= 44.5  # the map of a long dead time is of 20 holds: 0.1 dB


@pytest.mark.parametrize(("heater", "quicker"), list(zip(HEATERS, (2.0, 1.3), strict=True)))
def test_on_the_heaters_it_settles_sooner_than_the_pi_with_more_margin(heater, quicker):
    """Once the dead time is as long as the lag, half the time and no overshoot for a fifth."""
    fit = fit_of(*heater)
    gains = eaid.tune_rc(fit)
    assert gains.margins.worst["smith"].phase_deg > gains.margins.worst["pi"].phase_deg + 10
    t = np.arange(0.0, 14 * sum(heater[:2]), 1 / gains.margins.timing.rate_hz)
    wanted = np.where(t < t[-1] / 2, 0.4, 0.6) * heater[2] * heater[3]
    last = {}
    for name in ("pi", "smith"):
        run = eaid.simulate(fit, gains, reference=(t, wanted), controller=(name,)).records[name].columns
        beyond = np.flatnonzero(np.abs(run["torque_nm"] / wanted - 1) > 0.02)
        last[name] = t[beyond[-1]] - t[-1] / 2
    assert last["pi"] > quicker * last["smith"]


@pytest.mark.parametrize("late", [3.0, 3.25])
def test_with_the_right_model_it_is_the_pi_without_dead_time_so_much_later(late):
    h, pi = 0.01, {"K_P": 30.0, "K_I": 20.0}
    plain = {**GAINS, "model": {"a0": 2.0, "b0": 0.1, "c0": -1.0}, "pi": pi}
    plain["controllers"] = {"smith": {**pi, "dead_time_s": late * h}}
    reference = np.arange(300) * h, 2.0 + np.sin(np.arange(300) * h) * (np.arange(300) > 100)
    outputs = []
    for name, dead_s in (("pi", 0.0), ("smith", late * h)):
        fit = fit_of(dead_s, 0.5, 0.05, 100.0)
        gains = loaded({**plain, "input_unit": "V", "output_unit": "°C"})
        run = eaid.simulate(fit, gains, reference=reference, controller=(name,), rate_hz=1 / h).records[name].columns
        assert run["duty_pct"].max() < 100 and run["duty_pct"].min() > 0  # the limits are left out of it
        outputs.append(run["torque_nm"])
    free, behind = outputs
    then = np.interp(np.arange(300) - late, np.arange(300), free, left=0.0)
    np.testing.assert_allclose(behind, then, atol=1e-9 if late == 3.0 else 3e-3)


def test_where_nothing_is_late_there_is_none(tuned):
    assert "smith" not in tuned(nonlinear=True).controllers
