"""Rigs with a dead time: found in steps from rest, counted once; loops keep on the true plant what they are told."""

from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import pytest

import eaid
from eaid.plant.dynamics import REFERENCE_PLANT, Plant
from eaid.plant.operating import around
from eaid.plant.respond import from_rest

LEVELS = range(10, 101, 15)


def rig(dead_s: float, slower: float) -> Plant:
    return replace(REFERENCE_PLANT, dead_time_s=dead_s, tau1=tuple(slower * c for c in REFERENCE_PLANT.tau1))


def fitted(plant: Plant, noise: float = 0.01, repeats: int = 2) -> eaid.Fit:
    random, t, frames = np.random.default_rng(5), np.arange(-400, 4000) * 0.005, {}
    for u in LEVELS:
        for k in range(repeats):
            y = from_rest(plant, np.maximum(t, 0.0), float(u)) * (1 + 0.02 * random.normal() * (noise > 0))
            y = np.where(t > 0, y, 0.0) + noise * random.normal(size=t.size)
            duty = np.where(t >= -1e-9, float(u), 0.0)
            frames[f"u{u}r{k}"] = pd.DataFrame({"time_s": t + 2.0, "duty_pct": duty, "torque_nm": y})
    return eaid.fit(frames)


def true_margins(plant: Plant, gains: eaid.Gains) -> tuple[float, float]:
    """Least gain [dB] and phase margin [°] of the PI on the true plant, sampled at 1 kHz, without a PWM's latch."""
    h, omega = 1e-3, np.geomspace(1e-3, 0.999e3 * np.pi, 20_000)
    z, worst = np.exp(1j * omega * h), [np.inf, np.inf]
    for u in LEVELS:
        loop = (gains.pi.K_P + gains.pi.K_I * h / (z - 1)) * around(plant, float(u)).sampled(z, h)
        loop = loop * np.exp(-1j * omega * plant.dead_time_s)
        phase, size = np.unwrap(np.angle(loop)), np.abs(loop)
        turns = np.flatnonzero((phase[:-1] > -np.pi) & (phase[1:] <= -np.pi))
        crosses = np.flatnonzero((size[:-1] > 1) & (size[1:] <= 1))
        worst[0] = min([worst[0], *(-20 * np.log10(size[turns]))])
        worst[1] = min([worst[1], *(180 + np.degrees(phase[crosses]))])
    return worst[0], worst[1]


RIGS = [(0.05, 0.6), (0.08, 0.7), (0.1, 0.8), (0.12, 0.9), (0.15, 1.0), (0.2, 1.1), (0.25, 1.2), (0.3, 1.3)]


MARKED = [pytest.param(*one, marks=[pytest.mark.slow] if one != RIGS[0] else []) for one in RIGS]


@pytest.mark.parametrize(("dead_s", "slower"), MARKED)
def test_a_loop_has_on_the_true_plant_what_it_is_told(dead_s: float, slower: float) -> None:
    """Once 6.5 dB and 49° were told where the plant had 1.4 and 25."""
    plant = rig(dead_s, slower)
    fit = fitted(plant)
    assert fit.plant.dead_time_s == pytest.approx(dead_s, abs=0.003)
    for u in (25.0, 70.0):
        assert fit.at(u)["value"].to_numpy() == pytest.approx(
            [float(plant.steady(u)), *map(float, plant.time_constants(u))], rel=0.15
        )
    gains = eaid.tune_rc(fit, pwm_hz=0.0)
    told = gains.margins.worst["pi"]
    gain_db, phase_deg = true_margins(plant, gains)
    assert gain_db >= 6 and phase_deg >= 45
    assert (told.gain_db, told.phase_deg) == (pytest.approx(gain_db, abs=0.7), pytest.approx(phase_deg, abs=3))


def test_the_margins_are_python_controls(small_fit: Any) -> None:
    """Around a level behind 20 samples of dead time: the exact sampled loop, its delays as states."""
    control = pytest.importorskip("control")
    from eaid.control.margins import Point, margins
    from eaid.control.pi import PIGains
    from eaid.results.gains import Timing

    h, late, pi = 1e-2, 20, PIGains(20.0, 15.0)
    for one in (
        around(small_fit.plant, 60.0),
        around(Plant((0.3,), (0.3,), (0.0, 0.02), (1.0, 100.0), zeta=0.4), 50.0),
    ):
        plant = control.c2d(one.to_control(), h)
        delay = control.tf([1.0], [1.0, *([0.0] * late)], h)
        law = control.tf([pi.K_P, pi.K_I * h - pi.K_P], [1.0, -1.0], h)
        gain, phase_deg, *_ = control.stability_margins(control.tf(plant) * delay * law)
        found = margins(pi, Point(60.0, 1.0, one), Timing(1 / h, None, late))
        assert found.gain_db == pytest.approx(20 * np.log10(gain), abs=0.05)
        assert found.phase_deg == pytest.approx(phase_deg, abs=0.3)


def test_a_dead_time_that_is_given_is_held(small_steps: Any) -> None:
    """Steps that answer at once, told to be late: the models begin behind it."""
    fit = eaid.fit(small_steps, dead_time=0.1, ci="none")
    assert fit.plant.dead_time_s == 0.1 and fit.predict(60.0, [0.05]).to_numpy()[0, 0] == 0.0
