"""Recorded logs of other rigs, fitted whole; skipped where they are not there."""

from pathlib import Path

import pytest

from eaid.reading import InputOptions, read_steps
from eaid.recorded.fit import fit_recorded
from eaid.results.fit import Fit

RIGS = Path(__file__).parents[2] / "../shared/realdata/rigs"
pytestmark = pytest.mark.skipif(not RIGS.is_dir(), reason="the recorded logs are not beside this checkout")
HEATER = InputOptions(columns="time=Time,input=Q1,output=T1", repair=True)


def fitted(name: str, options: InputOptions) -> Fit:
    _, steps = read_steps([RIGS / name], options, whole="recorded")
    return fit_recorded(steps.recorded)


def test_a_lamp_on_a_staircase() -> None:
    """Its first rise is 1.844 V with 18.5 ms and 201 ms, said the step fits."""
    options = InputOptions(columns="time=2,input=3,output=1", units="time=us,output=mV,input=PWM")
    found = fitted("light_staircase.csv", options)
    assert found.converged and found.nonlinear is not None and found.release is not None
    assert found.nonlinear.fit_pct is not None and found.nonlinear.fit_pct > 99
    first = found.nonlinear.curves[0]
    assert (first.level, first.Ts) == (50.0, pytest.approx(1.844, rel=2e-3))
    assert (first.tau1, first.tau2) == (pytest.approx(0.0185, rel=0.02), pytest.approx(0.201, rel=0.02))
    codes = [one.code for one in found.findings]
    assert "release-differs" in codes and "never-asked" in codes


def test_heaters_that_were_on_from_the_first_row() -> None:
    for name, rmse in (("heater_dead_time.csv", 0.27), ("heater_on_from_first_row.csv", 0.35)):
        found = fitted(name, HEATER)
        assert found.converged and found.nonlinear is not None and found.nonlinear.rmse is not None
        assert found.nonlinear.rmse < rmse
        assert "one-input-only" in [one.code for one in found.findings]
    assert "input-never-moves" in [one.code for one in found.findings]
