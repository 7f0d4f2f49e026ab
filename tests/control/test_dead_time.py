"""Rigs with a dead time: found in steps from rest, counted once; loops keep on the true plant what they are told."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pandas as pd
import pytest
from scipy.optimize import brentq
from scipy.signal import butter, lfilter, step

import eaid
from eaid.arrays import Array
from eaid.control.gains import law_of
from eaid.control.margins import enough, margins, points_of, supposed_falls
from eaid.control.rc import rc_step
from eaid.plant.dynamics import REFERENCE_PLANT, Plant
from eaid.plant.operating import around

from ..conftest import codes
from .test_smith import fit_of as heater

LEVELS = dict.fromkeys(range(10, 101, 30), 1.0)


def rig(dead_s: float, slower: float) -> Plant:
    return replace(REFERENCE_PLANT, dead_time_s=dead_s, tau1=tuple(slower * c for c in REFERENCE_PLANT.tau1))


def fitted(plant: Plant, noise: float = 0.01, repeats: int = 2, levels: dict[int, float] = LEVELS) -> eaid.Fit:
    """Steps from rest to each level by SciPy, its output times a factor."""
    random, t, frames = np.random.default_rng(5), np.arange(-400, 4000) * 0.005, {}
    acts = np.flatnonzero(t >= plant.dead_time_s - 1e-9)
    for u, factor in levels.items():
        tau1, tau2 = map(float, plant.time_constants(u))
        lags = ([plant.C * tau2 + (1 - plant.C) * tau1, 1.0], np.polymul([tau1, 1.0], [tau2, 1.0]))
        y = np.zeros(t.size)
        y[acts] = factor * float(plant.steady(u)) * step(lags, T=np.arange(acts.size) * 0.005)[1]
        for k in range(repeats):
            read = y * (1 + 0.02 * random.normal() * (noise > 0)) + noise * random.normal(size=t.size)
            duty = np.where(t >= -1e-9, float(u), 0.0)
            frames[f"u{u}r{k}"] = pd.DataFrame({"time_s": t + 2.0, "duty_pct": duty, "torque_nm": read})
    return eaid.fit(frames)


def slopes(gains: eaid.Gains, name: str, torque: float, duty: float) -> tuple[float, float]:
    """Duty per torque that is read, its sign turned, and per integral of the error, of a law at rest at a torque."""
    if name == "pi":
        return gains.pi.K_P, gains.pi.K_I
    law = law_of(gains, "rc")._replace(duty_min=-np.inf, duty_max=np.inf)

    def given(integral: float, read: float) -> float:
        return rc_step(law, integral, torque, 0.0, read, 0.0)[1]

    held = brentq(lambda q: given(q, torque) - duty, -1e6, 1e6, xtol=1e-15)
    h = 1e-6 * gains.rc.epsilon / gains.rc.Q[1][1]
    return (
        (given(held, torque - h) - given(held, torque + h)) / (2 * h),
        (given(held + h, torque) - given(held - h, torque)) / (2 * h),
    )


def true_margins(
    plant: Plant, gains: eaid.Gains, name: str, levels: dict[int, float] = LEVELS
) -> list[tuple[float, float]]:
    """Gain [dB] and phase margin [°] of a loop at every level of the true plant by python-control, sampled at 1 kHz,
    without a PWM's latch."""
    control = pytest.importorskip("control")
    h, omega, found = 1e-3, np.geomspace(1e-3, 0.999e3 * np.pi, 2_000), []
    z = np.exp(1j * omega * h)
    for u, factor in levels.items():
        tau1, tau2 = map(float, plant.time_constants(u))
        lags = factor * plant.slope(u) * (control.tf([plant.C], [tau1, 1.0]) + control.tf([1 - plant.C], [tau2, 1.0]))
        by_torque, by_integral = slopes(gains, name, factor * float(plant.steady(u)), float(u))
        loop = (by_torque + by_integral * h / (z - 1)) * control.c2d(control.ss(lags), h)(z)
        loop = loop * np.exp(-1j * omega * plant.dead_time_s)
        gain, phase_deg, *_ = control.stability_margins(control.frd(loop, omega, smooth=True))
        found.append((20 * np.log10(gain), phase_deg))
    return found


RIGS = [(0.05, 0.6), (0.08, 0.7), (0.1, 0.8), (0.12, 0.9), (0.15, 1.0), (0.2, 1.1), (0.25, 1.2), (0.3, 1.3)]


def saturating(form: Callable[[Array], Array]) -> Plant:
    """A plant of 3 N·m at 100 % whose T_s(u) is of a form."""
    u = np.linspace(0.0, 100.0, 101)
    return replace(
        rig(0.1, 1.0), u_range=(1.0, 100.0), Ts_through=tuple(zip(u, 3 * form(u) / form(u)[-1], strict=True))
    )


SATURATING = {
    "tanh": (saturating(lambda u: np.tanh(u / 70)), {20: 1.04, 40: 0.97, 60: 1.03, 80: 0.98, 100: 0.97}),
    "exponential": (saturating(lambda u: 1 - np.exp(-u / 100)), {30: 1.03, 53: 0.95, 77: 1.05, 100: 0.98}),
}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("form", "falls"), [pytest.param("tanh", False, marks=pytest.mark.slow), ("exponential", True)]
)
def test_where_T_s_saturates_and_levels_scatter_loops_have_their_margins_too(form: str, falls: bool) -> None:
    """A curve through such levels is too flat at the lowest one, and may fall at the highest."""
    plant, levels = SATURATING[form]
    gains = eaid.tune_rc(fitted(plant, levels=levels), pwm_hz=0.0)
    for name in ("pi", "rc"):
        each = true_margins(plant, gains, name, levels)
        gain_db, phase_deg = (min(one) for one in zip(*each, strict=True))
        assert gain_db >= 6 and phase_deg >= 45, name
    assert falls == ("fall-within-interval" in {one.code for one in gains.findings})


MARKED = [pytest.param(*one, marks=[pytest.mark.slow] if one != RIGS[0] else []) for one in RIGS]


@pytest.mark.parametrize(("dead_s", "slower"), MARKED)
def test_loops_have_six_decibels_and_45_degrees_on_the_true_plant(dead_s: float, slower: float) -> None:
    """PI and RC, at every level. Once 6.5 dB and 49° were told where the plant had 1.4 and 25."""
    plant = rig(dead_s, slower)
    fit = fitted(plant)
    assert fit.plant.dead_time_s == pytest.approx(dead_s, abs=0.003)
    for u in (25.0, 70.0):
        assert fit.at(u)["value"].to_numpy() == pytest.approx(
            [float(plant.steady(u)), *map(float, plant.time_constants(u))], rel=0.15
        )
    gains = eaid.tune_rc(fit, pwm_hz=0.0)
    assert not gains.refused and not [one for one in gains.findings if one.code == "margin-missed"]
    for name in ("pi", "rc"):
        each, told = true_margins(plant, gains, name), gains.margins.worst[name]
        gain_db, phase_deg = (min(one) for one in zip(*each, strict=True))
        assert gain_db >= 6 and phase_deg >= 45, name
        assert gain_db - 1.0 < told.gain_db < gain_db + 0.7, name
        assert phase_deg - 6.0 < told.phase_deg < phase_deg + 3.0, name


@pytest.mark.parametrize("late", [0.9, 1.1])
def test_behind_a_dead_time_longer_than_its_lag_there_is_no_robust_controller(late: float, tmp_path: Path) -> None:
    """A lag of 149 s: its PI and Smith predictor stand, and the reason is said wherever RC is asked for."""
    fit = heater(late * 149.0, 149.0, 32.0, 10.0)
    gains = eaid.tune_rc(fit)
    assert (gains.rc is not None) is (late < 1) is (gains.guarantee is not None)
    assert {"pi", "smith"} <= set(gains.margins.worst) and ("rc" in gains.margins.worst) is (late < 1)
    if late < 1:
        return
    assert set(gains.replayed.rows) == {"pi", "smith"}
    gains.save(tmp_path / "gains.json")
    read = eaid.load(tmp_path / "gains.json")
    assert list(eaid.simulate(fit, read, "steps").records) == ["pi"]
    said = r"rc: none behind a dead time of 164 s, longer than 1/a0, 149 s"
    with pytest.raises(eaid.UsageError, match=said):
        eaid.simulate(fit, read, controller=("rc",))
    with pytest.raises(eaid.UsageError, match=said):
        eaid.export(read, tmp_path / "c", law=("rc",))
    with pytest.raises(eaid.GainsError, match="the RC loop is unstable"):  # what is given is judged as it is
        eaid.tune_rc(fit, epsilon=50.0)


def test_the_margins_are_python_controls(small_fit: Any) -> None:
    """Around a level behind 20 samples of dead time: the exact sampled loop, its delays as states."""
    control = pytest.importorskip("control")
    from eaid.control.margins import Point, holds
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
        for part in (0.1, 0.3, 0.5, 0.7, 1.0, 3.0):  # what a search asks is what it has
            slower, at = PIGains(part * 20.0, part * 15.0), Point(60.0, 1.0, one)
            known = margins(slower, at, Timing(1 / h, None, late))
            assert holds(slower, at, Timing(1 / h, None, late)) == enough(known)
            assert holds(slower, at, Timing(1 / h, None, late), 0.0, -180.0) == known.stable


def test_a_dead_time_that_is_given_is_held(small_steps: Any) -> None:
    """Steps that answer at once, told to be late: the models begin behind it."""
    fit = eaid.fit(small_steps, dead_time=0.1, ci="none", model=("nonlinear",))
    assert fit.plant.dead_time_s == 0.1 and fit.predict(60.0, [0.05]).to_numpy()[0, 0] == 0.0


@pytest.mark.parametrize(
    ("part", "seen", "slower"),
    [(0.2, True, False), *(pytest.param(part, False, part < 1, marks=pytest.mark.slow) for part in (0.2, 1.0))],
)
def test_where_no_log_shows_falls_between_levels_loops_are_for_falls_as_quick_as_to_rest(
    small_fit: Any, part: float, seen: bool, slower: bool
) -> None:
    """A PI of 8.4 dB had 5.7 there, and was only warned of."""
    tau1, tau2 = (float(one) for one in small_fit.plant.time_constants(60.0))
    plant = msgspec.structs.replace(small_fit.plant_, dead_time_s=0.1, release=(part * tau1, part * tau2))
    rows = small_fit.friction.levels
    if seen:
        rows = (*rows, msgspec.structs.replace(rows[0], from_=rows[-1].level))
    fit = msgspec.structs.replace(
        small_fit, plant_=plant, friction=msgspec.structs.replace(small_fit.friction, levels=rows)
    )
    known = msgspec.structs.replace(fit, plant_=msgspec.structs.replace(plant, release=None))
    gains, of_rises = eaid.tune_rc(fit), eaid.tune_rc(known)
    assert ("falls-taken-as-releases" in codes(gains)) == slower == (gains.pi.K_P < of_rises.pi.K_P)
    assert "margin-if-falls-are-releases" not in codes(gains)
    falls = supposed_falls(fit, fit.plant, points_of(fit, fit.plant, gains.model, (), gains.duty_limits_pct))
    assert bool(falls) == ((not seen and part < 1) or part == 1.0)
    assert all(enough(margins(law_of(gains, "pi"), one, gains.margins.timing)) for one in falls)
    if slower:  # gains that are given are judged as they are
        given = eaid.tune_rc(fit, pi_gains=(of_rises.pi.K_P, of_rises.pi.K_I))
        assert codes(given)["margin-if-falls-are-releases"].values["gain_db"] < 6


def test_margins_that_are_far_less_in_falls_are_told(small_fit: Any) -> None:
    """29.2 dB were printed where falls as quick as those to rest have 6.8, and nothing was said."""
    tau1, tau2 = (float(one) for one in small_fit.plant.time_constants(60.0))
    fit, known = (
        msgspec.structs.replace(small_fit, plant_=msgspec.structs.replace(small_fit.plant_, release=release))
        for release in ((0.15 * tau1, 0.15 * tau2), None)
    )
    gains = eaid.tune_rc(fit)
    told = {one.subject: one.values for one in gains.findings if one.code == "margin-less-in-falls"}
    falls = supposed_falls(fit, fit.plant, points_of(fit, fit.plant, gains.model, (), gains.duty_limits_pct))
    least = min(margins(law_of(gains, "pi"), one, gains.margins.timing).gain_db for one in falls)
    assert told["pi"]["gain_db"] == pytest.approx(least) and 6 <= least < gains.margins.worst["pi"].gain_db - 3
    assert "margin-less-in-falls" not in codes(eaid.tune_rc(known))


def true_tau1(u: float) -> float:
    return 0.45 - 0.002 * u


def recorded(seed: int, paces: float, late_s: float = 0.0, filtered: bool = False) -> tuple[eaid.Fit, list[float]]:
    """Three runs a level of another clutch, late by up to so much, and its fit; how late each run is. A filter is that
    of a load cell's amplifier, of 5 Hz, behind a ripple of 4 %."""
    random, t, frames, late = np.random.default_rng(seed), np.arange(0.0, 26.0, 0.005), {}, []
    for u in (20.0, 40.0, 60.0, 80.0, 100.0):
        for k in range(3):
            late.append(random.uniform(0.0, late_s) if late_s else 0.0)
            since, pace = np.maximum(t - 3.0 - late[-1], 0.0), np.exp(paces * random.normal())
            way = 1 - 0.85 * np.exp(-since / true_tau1(u) / pace) - 0.15 * np.exp(-since / (6 + 0.06 * u))
            torque = (0.0066 * u + 7.04e-4 * u**2 - 3.3e-6 * u**3) * (1 + 0.03 * random.normal()) * way
            ripple = lfilter([0.0975], [1, -0.905], random.normal(size=t.size)) * 0.043 * torque if filtered else 0.0
            read = torque + ripple + 0.01 * random.normal(size=t.size)
            read = lfilter(*butter(2, 5 / 100), read) if filtered else read
            frames[f"u{u:g}r{k}"] = pd.DataFrame({"time_s": t, "duty_pct": np.where(t < 3, 0.0, u), "torque_nm": read})
    return eaid.fit(frames), late


def test_a_sensor_behind_a_filter_is_late_and_its_rises_are_not_slower() -> None:
    """No step alone wants a dead time, so none was found. τ1 was 20 % too large, and RC told 28 dB where it has 4."""
    fit, _ = recorded(21, 0.05, filtered=True)
    assert "starts-apart" not in codes(fit)
    assert fit.dead_time_s == pytest.approx(np.sqrt(2) / (2 * np.pi * 5), abs=0.01)  # what the filter is late by
    for u in (20.0, 60.0, 100.0):
        assert fit.at(u).loc["tau1", "value"] == pytest.approx(true_tau1(u), rel=0.08)


def test_runs_that_start_apart_are_laid_on_each_other() -> None:
    """A trigger late by up to 80 ms smeared the mean curves: τ1 was up to 35 % too large, and nothing was said."""
    fit, late = recorded(11, 0.03, late_s=0.08)
    assert "starts-apart" in codes(fit) and fit.dead_time_s == pytest.approx(np.mean(late), abs=0.004)
    for u in (20.0, 60.0, 100.0):
        _, low, high = fit.at(u).loc["tau1"]
        assert low < true_tau1(u) < high < 1.1 * true_tau1(u)


def test_falls_alone_tell_the_plant_and_that_rises_are_assumed() -> None:
    """Of inputs that are known; they were single steps, "usable yes", without a plant."""
    t = np.arange(0.0, 10.0, 0.01)
    gone, held = 0.02 * np.exp(-np.maximum(t - 3, 0) / 0.3), t < 3
    falls = {u: {"time_s": t, "duty_pct": u * held, "torque_nm": u * gone} for u in np.arange(20.0, 101.0, 20.0)}
    fit = eaid.fit({f"u{u}": pd.DataFrame(one) for u, one in falls.items()})
    assert fit.plant.steady(60.0) == pytest.approx(1.2, rel=1e-6)
    assert fit.plant.time_constants(60.0)[0] == pytest.approx(0.3, rel=1e-6)
    assert fit.verdict.usable and "rise-not-seen" in {one.code for one in fit.findings}


def test_the_overshoot_that_is_told_is_the_loops_behind_its_dead_time():
    """5 % and 300 s were told, of the linear model alone, where the loop overshoots by 14 %."""
    tau, gain, dead_s = 70.0, 3.0, 20.0
    gains = eaid.tune_rc(heater(dead_s, tau, gain, 8.0), pi_overshoot=5.0, pi_settling=300.0)
    dt, y, total, torque = 0.01, 0.0, 0.0, []
    played = [0.0] * round(dead_s / dt)
    for k in range(120_000):
        total += dt * (1.0 - y)
        played.append(gains.pi.K_P * (1.0 - y) + gains.pi.K_I * total)
        y += dt * (gain * played[k] - y) / tau
        torque.append(y)
    last = int(np.flatnonzero(np.abs(1.0 - np.array(torque)) > 0.02)[-1])
    assert gains.pi.settling_s == pytest.approx(dt * (last + 1), rel=0.02)
    assert gains.pi.overshoot_pct == pytest.approx(100 * (max(torque) - 1), rel=0.03)
    assert gains.pi.overshoot_pct > 8.0
