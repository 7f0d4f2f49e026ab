"""Frequency responses against closed forms."""

from dataclasses import replace

import numpy as np
import pytest

import eaid
from eaid.estimate.record import recorded_log
from eaid.models.parameters import REFERENCE_PLANT, Linear
from eaid.recorded.fit import fit_recorded
from eaid.recorded.frequency import frequency_response, on_input
from eaid.synth.excitation import Excitation, synthesise_excitation
from eaid.synth.logs import NONE
from eaid.synth.plants import clutch


def first_order(f: np.ndarray, p: Linear, dt_s: float) -> np.ndarray:
    """b0/a0 (1 − q)/(z − q): the exact hold, whose output answers one row later."""
    q = np.exp(-p.a0 * dt_s)
    z = np.exp(2j * np.pi * f * dt_s)
    return np.asarray(p.b0 / p.a0 * (1 - q) / (z - q))


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["chirp", "multisine", "prbs"])
def test_a_linear_system_has_its_closed_form(kind: str) -> None:
    line = Linear(3.0, 0.1, 0.0)
    e = Excitation(
        kind=kind,
        duration_s=200.0 + (kind == "multisine"),
        rate_hz=100.0,
        duty=(20.0, 80.0),
        idle_s=1.0,
        **({} if kind == "prbs" else {"frequency_hz": (0.1, 4.0)}),
    )
    run = synthesise_excitation(clutch(), e, NONE, 2)[0]
    log = recorded_log(run)
    draw = np.random.default_rng(0)
    log = replace(log, output=on_input(line, log) + 0.01 * draw.standard_normal(len(log.input)))
    found = frequency_response(log, log, REFERENCE_PLANT, line)
    f = np.array(found.frequency_hz)
    exact = first_order(f, line, 0.01)
    inside = (f > 0.12) & (f < 3.5)
    np.testing.assert_allclose(np.array(found.gain)[inside], np.abs(exact)[inside], rtol=0.12)
    low, high = np.array(found.gain_low), np.array(found.gain_high)
    same = np.array(found.linear_gain)
    held = (low <= same) & (same <= high)
    assert held[inside].mean() > 0.85  # the model's response lies within the recorded one's band


@pytest.mark.slow
def test_a_fit_holds_the_responses_of_its_moving_logs() -> None:
    e = Excitation(kind="chirp", duration_s=60.0, rate_hz=100.0, frequency_hz=(0.1, 2.0))
    fit = fit_recorded(synthesise_excitation(clutch(), e, NONE, 1), eaid.FitOptions(duty=(10.0, 100.0)))
    assert fit.recorded is not None
    (found,) = fit.recorded.responses
    assert len(found.gain) == len(found.nonlinear_gain) == len(found.linear_gain) > 10
    np.testing.assert_allclose(found.gain, found.nonlinear_gain, rtol=0.02)  # no noise, the model itself
