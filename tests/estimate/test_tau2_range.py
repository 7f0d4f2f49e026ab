"""Which τ2 the runs allow: the sets hold the truth where the estimate runs off; alarms about the record hold."""

import numpy as np

import eaid
from eaid.apparatus import Apparatus
from eaid.plant.dynamics import Step
from eaid.plant.respond import step_response
from eaid.steps.stepset import Level, StepSet


def fitted(record_s: float, tau2_s: float, runs: int = 3) -> eaid.Fit:
    """Six levels of one plant: gain scatter of 2 %, white noise and a slow ripple."""
    random = np.random.default_rng([1, 9])
    t = np.arange(int(100 * record_s)) * 0.01
    levels = []
    for i in range(6):
        clean = step_response(Step(1.0 + i, 0.3, tau2_s), t)
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
