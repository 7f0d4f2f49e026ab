"""Every kind of plant returns from a log of random steps without noise, through `eaid.fit`, to 1e-6."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd
import pytest

import eaid
from benchmarks import kinds
from eaid.plant.dynamics import Plant
from eaid.plant.respond import respond

COLUMNS = {"time": "time_s", "input": "input_V", "output": "speed_rpm"}
UP, BOTH = (0.0, 20.0, 40.0, 60.0, 80.0, 100.0), (-100.0, -60.0, -30.0, 0.0, 30.0, 60.0, 100.0)


@dataclass(frozen=True)
class Case:
    plant: Plant
    levels: tuple[float, ...] = UP
    given: dict[str, Any] | None = None


def plant(tau1: float, tau2: float = 1.0, gain: float = 0.04, **more: Any) -> Plant:
    return Plant((tau1,), (tau2,), (0.0, gain), (0.0, 100.0), floor_s=0.0, **more)


CLUTCH = Plant((0.2, 4e-3, -1e-5), (2.0, 2e-2, -4e-5), (0.05, 0.02, 2e-4, -8e-7), (20.0, 100.0), floor_s=0.0)
KINDS = {
    "lag": Case(plant(0.4, C=1.0)),
    "lag, a gain each side": Case(plant(0.4, C=1.0, Ts_below=(0.0, -0.025)), BOTH),
    "lag, odd": Case(plant(0.4, C=1.0, Ts_below=(0.0, -0.04)), BOTH),
    "lag, idle known": Case(plant(0.4, C=1.0), given={"baseline": "25"}),
    "series": Case(plant(0.3, zeta=1.3)),
    "ringing": Case(plant(0.15, zeta=0.2)),
    "ringing, odd": Case(plant(0.15, zeta=0.2, Ts_below=(0.0, -0.04)), BOTH),
    "C beyond 1": Case(plant(0.2, 1.0, C=1.6)),
    "C by evidence": Case(plant(0.2, 1.5, C=0.5)),
    "C held": Case(CLUTCH),
    "C free": Case(replace(CLUTCH, C=0.7), given={"share": "free"}),
    "falls of their own": Case(replace(CLUTCH, falls=(0.5, 0.7), excess=0.08, release=(0.12, 1.5))),
}
QUICK = {"lag, a gain each side + dead time", "falls of their own"}
CASES = [
    pytest.param(name, late, id=name + late, marks=[] if name + late in QUICK else [pytest.mark.slow])
    for name in KINDS
    for late in ("", " + dead time")
]


@pytest.mark.parametrize(("name", "late"), CASES)
def test_without_noise_the_truth_comes_back(name: str, late: str) -> None:
    case = KINDS[name]
    truth, given = replace(case.plant, dead_time_s=0.133 * bool(late)), dict(case.given or {})
    random, t = np.random.default_rng(2), np.arange(4500) * 0.02
    u = np.repeat(random.choice(case.levels, len(t) // 75), 75)
    u[:75] = 0.0
    log = pd.DataFrame({"time_s": t, "input_V": u, "speed_rpm": 25.0 + respond(truth, t, u, t)})
    baseline = {"baseline": given.pop("baseline")} if "baseline" in given else {}
    fit = eaid.fit(eaid.read(log, logs_as="recorded", columns=COLUMNS, **baseline), ci="none", shape="one", **given)
    found, top = fit.plant, np.array([case.levels[0], 40.0, 100.0])
    assert found.kind == truth.kind
    np.testing.assert_allclose(found.steady(top), truth.steady(top), rtol=1e-6)
    for mine, true in zip(found.time_constants(top), truth.time_constants(top), strict=True):
        np.testing.assert_allclose(mine, true, rtol=1e-6)
        if truth.kind == "lag":
            break
    for name in ("zeta", "dead_time_s", "falls", "excess", "release", "idle", *(["C"] if truth.zeta is None else [])):
        value = getattr(replace(truth, idle=25.0), name)
        if name == "release" and value is None and found.release is not None:  # falls to rest go as the lowest input
            value = tuple(float(tau) for tau in truth.time_constants(case.levels[1]))
        assert getattr(found, name) == (value if value is None else pytest.approx(value, rel=1e-6, abs=1e-6)), name
    since = np.linspace(0.0, 5.0, 251)
    predicted = fit.predict(60.0, since)  # of the plant, whatever other models were fitted
    true = respond(truth, np.array([-1.0, 0.0]), np.array([0.0, 60.0]), since)
    assert str(predicted.columns.name).startswith("plant") == fit.plant_.another  # type: ignore[union-attr]
    np.testing.assert_allclose(predicted[60.0], true, atol=1e-5)


@pytest.mark.slow
def test_falls_that_nothing_determines_are_bounded() -> None:
    """A log that rings, to which the clutch's form is fitted, too: of its endless τ2 a factor went to 1e28."""
    assert kinds.tried("ringing + dead time", 10)["right"]
