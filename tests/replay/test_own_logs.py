"""A fit replayed on its own logs gives the percentage that it told: steps of every kind of plant; for recordings,
tests/recorded/test_kinds.py."""

import numpy as np
import pandas as pd
import pytest

import eaid
from eaid.plant.dynamics import REFERENCE_PLANT, Plant
from eaid.plant.respond import respond


def plant(tau1, tau2=1.0, Ts=(0.0, 1.0), u_range=(0.2, 1.0), **more):
    return Plant((tau1,), (tau2,), Ts, u_range, floor_s=0.0, **more)


PLANTS = {
    "lag": plant(0.8, C=1.0),
    "lag behind a dead time": plant(0.8, C=1.0, dead_time_s=0.253),
    "parallel": plant(0.3, 4.0),
    "parallel behind a dead time": plant(0.3, 4.0, dead_time_s=0.147),
    "series": plant(0.6, zeta=1.4),
    "ringing behind a dead time": plant(0.3, zeta=0.2, dead_time_s=0.253),
    "overshoot": plant(0.4, 2.0, C=1.6),
}


def steps(folder, one, until_s=np.inf, sign=1.0):
    """Logs with noise and an idle output."""
    random, t = np.random.default_rng(8), np.arange(1200) * 0.02
    for k, level in enumerate((0.25, 0.6, 1.0) * 2):
        u = np.where((t < 2) | (t >= until_s), 0.0, level)
        output = 3.0 + sign * (respond(one, t, u, t) + 0.005 * random.normal(size=len(t)))
        pd.DataFrame({"time_s": t, "input": u, "output": output}).to_csv(folder / f"{k}.csv", index=False)


def held_against(path, **reading):
    fit = eaid.fit(eaid.read(path, **reading), ci="none")
    told = {one.run: one.fit_pct for one in fit.data.replayed}
    again = eaid.simulate(fit, log=path).records
    assert told and told.keys() <= again.keys()
    for name, pct in told.items():
        assert again[name].metrics.fit_pct == pytest.approx(pct, abs=0.01), name
    return told


OWN = {
    "columns": {"input": "input", "output": "output"}, "units": {"input": "V", "output": "N"}, "logs_as": "steps"
}  # fmt: skip


@pytest.mark.parametrize("name", PLANTS)
def test_steps_from_rest(name, tmp_path):
    steps(tmp_path, PLANTS[name])
    assert min(held_against(tmp_path, **OWN).values()) > 85


@pytest.mark.slow
def test_an_overshoot_falls_as_it_rises(tmp_path):
    """Its release undershoots: 88 % with the one lag that a release has behind two rising lags."""
    steps(tmp_path, PLANTS["overshoot"], until_s=13.0)
    assert min(held_against(tmp_path, **OWN).values()) > 96


def test_an_output_that_counts_with_its_sign_turned(tmp_path):
    steps(tmp_path, PLANTS["lag"], sign=-1.0)
    assert min(held_against(tmp_path, **OWN).values()) > 85


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
