"""Recorded logs of other rigs, fitted whole; skipped where they are not there."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import least_squares

import eaid

RIGS = Path(__file__).parents[2] / "../shared/realdata/rigs"
pytestmark = pytest.mark.skipif(not RIGS.is_dir(), reason="the recorded logs are not beside this checkout")
HEATER = {"columns": "time=Time,input=Q1,output=T1", "repair": True}


def fitted(name: str, options: dict[str, Any]) -> eaid.Fit:
    return eaid.fit(eaid.read(RIGS / name, logs_as="recorded", **options))


@pytest.mark.slow
def test_a_lamp_on_a_staircase() -> None:
    """Its first rise is 1.844 V with 18.5 ms and 201 ms, said the step fits."""
    options = {"columns": "time=2,input=3,output=1", "units": "time=us,output=mV,input=PWM"}
    found = fitted("light_staircase.csv", options)
    assert found.converged and found.nonlinear is not None and found.release is not None
    assert found.nonlinear.fit_pct is not None and found.nonlinear.fit_pct > 99
    first = found.nonlinear.curves[0]
    assert (first.level, first.Ts) == (50.0, pytest.approx(1.844, rel=2e-3))
    assert (first.tau1, first.tau2) == (pytest.approx(0.0185, rel=0.02), pytest.approx(0.201, rel=0.02))
    codes = [one.code for one in found.findings]
    assert "release-differs" in codes and "input-leaves-tau-open" in codes


def test_a_heaters_dead_time_is_its_own() -> None:
    """Known: + 35.4 °C behind 13 to 15 s, RMSE 0.27 with one lag and a dead time; two in series leave less still."""
    found = fitted("heater_dead_time.csv", HEATER)
    (log,) = found.logs
    assert found.verdict.usable and log.rmse is not None and log.rmse < 0.27
    delayed = next(one for one in found.plant_.tried if one.kind == "lag+dead")  # type: ignore[union-attr]
    assert delayed.fit_pct == pytest.approx(97.2, abs=0.2)
    assert found.plant.steady(50.0) == pytest.approx(35.4, rel=0.03)


def test_a_heater_is_two_exponentials_and_no_independent_fit_has_less_left() -> None:
    steps = eaid.read(RIGS / "heater_on_from_first_row.csv", logs_as="recorded", **HEATER)
    (run,), found = steps.recorded, eaid.fit(steps).nonlinear
    assert found is not None and found.sse is not None
    t, y = run.time_s - run.time_s[0], run.output

    def missed(c: np.ndarray) -> np.ndarray:
        return c[0] + c[1] * np.exp(-t / c[2]) + c[3] * np.exp(-t / c[4]) - y

    starts = [np.array([y[-1], 5.0, fast, -30.0, slow]) for fast in (5.0, 20.0) for slow in (60.0, 150.0)]
    best = min((least_squares(missed, c, x_scale="jac", ftol=1e-14, xtol=1e-14, gtol=1e-14) for c in starts),
               key=lambda one: one.cost)  # fmt: skip
    assert found.sse == pytest.approx(2 * best.cost, rel=1e-6)
    assert sorted(best.x[[2, 4]]) == pytest.approx([found.tau1[0], found.tau2[0]], rel=1e-3)
