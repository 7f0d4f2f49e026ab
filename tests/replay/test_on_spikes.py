"""Spikes that «repair» has bridged are bridged where the log is played again, too."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import eaid
from eaid.plant.dynamics import REFERENCE_PLANT
from eaid.plant.respond import respond


def written(folder: Path) -> Path:
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


def test_a_log_that_was_repaired_is_played_again_without_its_spikes(tmp_path: Path) -> None:
    """They stood in the replay: 7 to 93 % of the logs of a fit that was right."""
    with pytest.raises(eaid.DataError, match="1 row far out of the record.*repair="):
        eaid.fit(written(tmp_path))
    fit = eaid.fit(eaid.read(tmp_path, repair=True))
    assert all((one.fit_pct or 0) > 90 for one in fit.data.replayed)
    replay = eaid.simulate(fit, log=tmp_path / "clutch_060_run1.csv")
    assert replay.records["clutch_060_run1"].metrics.fit_pct > 97
    assert "rows-dropped" in {one.code for one in replay.findings}
