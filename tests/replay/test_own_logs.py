"""A fit replayed on its own logs gives the percentage that it told: steps and recordings, of every kind of plant."""

import numpy as np
import pandas as pd
import pytest

import eaid
from eaid.plant.dynamics import REFERENCE_PLANT, Plant
from eaid.plant.respond import respond

RANDOM = np.random.default_rng(8)


def plant(tau1, tau2=1.0, Ts=(0.0, 1.0), u_range=(0.2, 1.0), **more):
    return Plant((tau1,), (tau2,), Ts, u_range, floor_s=0.0, **more)


PLANTS = {
    "lag": plant(0.8, C=1.0),
    "lag behind a dead time": plant(0.8, C=1.0, dead_time_s=0.253),
    "parallel": plant(0.3, 4.0),
    "parallel with its own falls": plant(0.3, 4.0, falls=(1.6, 1.3)),
    "parallel with hysteresis": plant(0.3, 4.0, excess=0.08),
    "parallel behind a dead time": plant(0.3, 4.0, dead_time_s=0.147),
    "series": plant(0.6, zeta=1.4),
    "ringing behind a dead time": plant(0.3, zeta=0.2, dead_time_s=0.253),
    "overshoot": plant(0.4, 2.0, C=1.6),
    "signed": plant(0.5, C=1.0, Ts_below=(0.0, -1.4)),
}


def logged(one, t, u):
    """A log of a plant, with noise and an idle output."""
    output = 3.0 + respond(one, t, u, t) + 0.005 * RANDOM.normal(size=len(t))
    return pd.DataFrame({"time_s": t, "input": u, "output": output})


def staircase(name):
    t, signs = np.arange(2000) * 0.02, (-1, 1) if name == "signed" else (1,)
    levels = RANDOM.choice([0.0, 0.3, 0.6, 1.0], 20) * RANDOM.choice(signs, 20)
    return t, np.r_[np.zeros(50), np.repeat(levels, 99)[:1950]]


def steps(folder, one, until_s=np.inf):
    for k, level in enumerate((0.25, 0.6, 1.0) * 2):
        t = np.arange(1200) * 0.02
        logged(one, t, np.where((t < 2) | (t >= until_s), 0.0, level)).to_csv(folder / f"{k}.csv", index=False)


def held_against(path, shape="auto", **reading):
    fit = eaid.fit(eaid.read(path, **reading), ci="none", shape=shape)
    told = {one.run: one.fit_pct for one in fit.data.replayed} | {one.name: one.fit_pct for one in fit.logs}
    again = eaid.simulate(fit, log=path).records
    assert told and told.keys() <= again.keys()
    for name, pct in told.items():
        assert again[name].metrics.fit_pct == pytest.approx(pct, abs=0.01), name
    return told


UNITS = {"columns": {"input": "input", "output": "output"}, "units": {"input": "V", "output": "N"}}


# of the others recorded/test_kinds holds the same, with their intervals
ALSO_THERE = {"series", "ringing behind a dead time", "overshoot"}
RECORDED = [pytest.param(name, marks=[pytest.mark.slow] if name in ALSO_THERE else []) for name in PLANTS]


@pytest.mark.parametrize("name", RECORDED)
def test_a_recording(name, tmp_path):
    logged(PLANTS[name], *staircase(name)).to_csv(tmp_path / "log.csv", index=False)
    (pct,) = held_against(tmp_path / "log.csv", "one", logs_as="recorded", **UNITS).values()
    assert pct > 95


@pytest.mark.parametrize(
    "name", [name for name, one in PLANTS.items() if not (one.Ts_below or one.excess or one.falls[0] != 1)]
)
def test_steps_from_rest(name, tmp_path):
    steps(tmp_path, PLANTS[name])
    assert min(held_against(tmp_path, logs_as="steps", **UNITS).values()) > 85


def test_an_overshoot_falls_as_it_rises(tmp_path):
    """Its release undershoots: 88 % with the one lag that a release has behind two rising lags."""
    steps(tmp_path, PLANTS["overshoot"], until_s=13.0)
    assert min(held_against(tmp_path, logs_as="steps", **UNITS).values()) > 96


def test_an_output_that_counts_with_its_sign_turned(tmp_path):
    t = np.arange(600) * 0.02
    for k, level in enumerate((0.25, 0.5, 0.75, 1.0) * 2):
        log = logged(PLANTS["lag"], t, np.where(t < 2, 0.0, level))
        log.assign(output=3.0 - log["output"]).to_csv(tmp_path / f"{k}.csv", index=False)
    assert min(held_against(tmp_path, logs_as="steps", **UNITS).values()) > 85


def test_the_clutch_that_is_shipped():
    assert len(held_against("datasets/clutch.h5")) == 30


def written(folder):
    """Five levels, two runs each with a spike of 8 N·m."""
    t, random = np.arange(0.0, 25.0, 0.02), np.random.default_rng(3)
    for u in (20, 40, 60, 80, 100):
        for run in (1, 2):
            duty = np.where((t >= 3) & (t < 20), float(u), 0.0)
            torque = respond(REFERENCE_PLANT, t, duty, t) + 0.01 * random.normal(size=len(t))
            torque[random.integers(300, 900)] += 8.0
            log = pd.DataFrame({"time_s": t, "duty_pct": duty, "torque_nm": torque})
            log.to_csv(folder / f"clutch_{u:03d}_run{run}.csv", index=False)
    return folder


def test_a_log_that_was_repaired_is_played_again_without_its_spikes(tmp_path):
    """They stood in the replay: 7 to 93 % of the logs of a fit that was right."""
    with pytest.raises(eaid.DataError, match="1 row far out of the record.*repair="):
        eaid.fit(written(tmp_path))
    fit = eaid.fit(eaid.read(tmp_path, repair=True))
    assert all((one.fit_pct or 0) > 90 for one in fit.data.replayed)
    replay = eaid.simulate(fit, log=tmp_path / "clutch_060_run1.csv")
    assert replay.records["clutch_060_run1"].metrics.fit_pct > 97
    assert "rows-dropped" in {one.code for one in replay.findings}
