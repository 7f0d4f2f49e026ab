"""Steps that overshoot: the plant, the replay and the margins know it; where some levels do, the margins and a word."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

import eaid
from eaid.control.gains import law_of
from eaid.control.margins import Point, margins
from eaid.plant.dynamics import Plant
from eaid.plant.operating import around
from eaid.plant.respond import from_rest

PEAKED = Plant((0.2,), (1.0,), (0.0, 0.04), (20.0, 100.0), C=1.6)
FLAT = Plant((0.2,), (1.0,), (0.0, 0.04), (20.0, 100.0), C=0.8)


RINGING = Plant((0.2,), (0.2,), (0.0, 0.04), (20.0, 100.0), C=1.0, zeta=0.25)


def fitted(*plants, runs=2, ci="none", day=""):
    random, t, frames = np.random.default_rng(len(day)), np.arange(-100, 600) * 0.01, {}
    for u, plant in zip((20.0, 60.0, 100.0), plants, strict=True):
        for k in range(runs):
            y = np.where(t > 0, from_rest(plant, t.clip(0), u), 0.0) + 0.01 * random.normal(size=t.size)
            frames[f"{day}u{u:g}r{k}"] = pd.DataFrame(
                {"time_s": t + 1, "input (V)": np.where(t > -1e-9, u, 0.0), "output (N)": y}
            )
    return eaid.fit(frames, ci=ci)


def test_where_every_level_overshoots_the_plant_does():
    fit = fitted(PEAKED, PEAKED, PEAKED)
    assert fit.plant.kind == "overshoot" and (fit.plant.C, fit.plant.tau1[0]) == pytest.approx((1.6, 0.2), rel=0.03)
    gains = eaid.tune_rc(fit)
    codes = {one.code for one in (*gains.findings, *eaid.simulate(fit, gains, "steps").findings)}
    assert "output-decays-under-hold" not in codes
    t = np.arange(0.0, 6.0, 1e-3)
    run = eaid.simulate(fit, reference=(t, np.full(len(t), 2.0)), controller=(lambda *_: 60.0,)).records
    (played,) = (record.columns["torque_nm"] for record in run.values())
    assert played.max() == pytest.approx(from_rest(PEAKED, t, 60.0).max(), rel=0.02)


@pytest.mark.slow
@pytest.mark.parametrize("true", [PEAKED, RINGING, replace(RINGING, dead_time_s=0.12)])
def test_single_runs_show_it_as_well_and_the_table_has_the_plants_numbers(true):
    """No repeat that misses alike, no scatter that a fall would stand out of: the levels' fit is reason enough."""
    fit = fitted(true, true, true, runs=1, ci="robust")
    assert fit.plant.kind == true.kind and fit.dead_time_s == pytest.approx(true.dead_time_s, abs=0.002)
    assert fit.plant.steady(60.0) == pytest.approx(2.4, rel=0.01) and fit.data.replayed[1].fit_pct > 97
    rows = fit.at(60.0)
    assert rows.low["Ts"] < 2.4 < rows.high["Ts"]
    numbers = {"tau1": 0.2, "tau2": 1.0, "C": 1.6} if true is PEAKED else {"omega": 5.0, "zeta": 0.25}
    for name, value in numbers.items():
        assert rows.value[name] == pytest.approx(value, rel=0.02), name
    if true is PEAKED:
        sessions = eaid.compare(fit, fitted(true, true, true, ci="robust", day="b"))  # by T_s of the levels
        assert {one.quantity for one in sessions.shifts} >= {"Ts"} and not sessions.changed
        (row,) = (one for one in fit.friction_levels if one.level == 60.0)
        assert (row.tau1, row.tau2, row.C) == pytest.approx((0.2, 1.0, 1.6), rel=0.02)


@pytest.mark.slow
def test_where_some_levels_do_margins_are_of_their_steps_and_a_word_goes_with_every_use():
    fit = fitted(FLAT, PEAKED, PEAKED)
    assert fit.plant.kind == "parallel"
    gains = eaid.tune_rc(fit)
    for found in (gains, eaid.simulate(fit, gains, "steps")):
        assert "output-decays-under-hold" in {one.code for one in found.findings}
    for point, C in zip(gains.margins.points, (0.85, 1.6, 1.6), strict=True):
        plain = around(fit.plant, point.duty_pct)
        seen = plain if C < 1 else replace(plain, tau1=0.2, tau2=1.0, C=C)
        wanted = margins(law_of(gains, "pi"), Point(point.duty_pct, 1.0, seen), gains.margins.timing)
        assert point.loops["pi"].gain_db == pytest.approx(wanted.gain_db, abs=0.3)
