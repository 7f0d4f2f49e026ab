"""Which τ2 the runs allow: the sets hold the truth where the estimate runs off; alarms about the record hold."""

from typing import Any

import numpy as np
import pytest

import eaid
from eaid.apparatus import Apparatus
from eaid.models import friction
from eaid.models.parameters import Friction
from eaid.steps.stepset import Level, StepSet


def fitted(record_s: float, tau2_s: float, runs: int = 3) -> eaid.Fit:
    """Six levels of one plant: gain scatter of 2 %, white noise and a slow ripple."""
    random = np.random.default_rng([1, 9])
    t = np.arange(int(100 * record_s)) * 0.01
    levels = []
    for i in range(6):
        clean = friction.step_response(Friction(1.0 + i, 0.3, tau2_s), t)
        ripple = 1 + 0.005 * np.sin(2 * np.pi * (t / 6 + random.random((runs, 1))))
        rows = clean * ripple * (1 + 0.02 * random.standard_normal((runs, 1)))
        rows = rows + 0.01 * random.standard_normal((runs, len(t)))
        levels.append(Level(10.0 * (i + 1), t, rows, ("a", "b", "c")[:runs]))
    return eaid.fit(StepSet("clutch", "%", "N·m", Apparatus(), tuple(levels)), model=("friction",))


def test_a_long_record_bounds_it_and_a_short_one_does_not() -> None:
    long, short = fitted(30.0, 6.0), fitted(3.0, 12.0)
    for row in long.friction.levels:
        low, high = row.ci95.tau2
        assert 2 < low < 6 < high < 18
    assert not [one for one in long.findings if one.code == "tau2-open"]
    told = [one.values for one in short.findings if one.code == "tau2-open"]
    assert told and all(one["high_s"] is None or one["high_s"] > 12 for one in told)
    for i, row in enumerate(short.friction.levels):  # T_s reaches over all that goes with it: 15 % are still to come
        assert row.ci95.tau2 is None and row.ci95.Ts[0] < 1.0 + i < row.ci95.Ts[1]
        assert row.ci95.tau1[0] < 0.3 < row.ci95.tau1[1]


@pytest.mark.slow
@pytest.mark.parametrize("record_s", [5.0, 20.0])
def test_quoted_intervals_and_alarms_of_a_few_sets(sets: Any, record_s: float) -> None:
    """5 s: no τ2, no curve is quoted; 20 s: all are, and none is told to outlast the record (10 of 10 sets were)."""
    true = np.array([sets.plant(float(u), sets.VARIANTS["base"]).tau2 for u in sets.LEVELS])
    quoted, curves, ranges = [], [], []
    for seed in range(4):
        made = sets.one_set(seed, sets.VARIANTS["base"], samples=round(100 * record_s), record_s=record_s)
        found = eaid.fit(made)
        quoted += [sets.inside(row.ci95.tau2, tau2) for row, tau2 in zip(found.friction.levels, true, strict=True)]
        rows = found.nonlinear.curves if found.nonlinear.estimator == "levels-first" else ()
        curves += [sets.inside(row.ci95.tau2, tau2) for row, tau2 in zip(rows, true, strict=False)]
        value = dict(zip(sets.LEVELS.tolist(), true.tolist(), strict=True))
        for one in found.findings:
            if one.code == "tau2-open":
                ends = one.values["low_s"] or 0.0, one.values["high_s"] or np.inf
                ranges.append(sets.inside(ends, value[one.levels[0]]))
            assert one.code != "tau2-outlasts-record" or all(value[u] > record_s for u in one.levels)
    if record_s == 5.0:
        assert np.isnan(quoted).all() and np.isnan(curves).all()
        assert np.mean(ranges) > 0.9
    else:
        assert np.isfinite(quoted).sum() >= 36 and np.nanmean(quoted) > 0.85 and np.nanmean(curves) > 0.85
