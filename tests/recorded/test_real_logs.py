"""Recorded logs of other rigs, fitted whole; skipped where they are not there."""

from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import least_squares

from eaid.models.parameters import Nonlinear
from eaid.options import ReadOptions
from eaid.reading import read_steps
from eaid.recorded.fit import fit_recorded
from eaid.replay.plant import plant_parameters, plant_step
from eaid.results.fit import Fit

RIGS = Path(__file__).parents[2] / "../shared/realdata/rigs"
pytestmark = pytest.mark.skipif(not RIGS.is_dir(), reason="the recorded logs are not beside this checkout")
HEATER = ReadOptions(columns="time=Time,input=Q1,output=T1", repair=True)


def fitted(name: str, options: ReadOptions) -> Fit:
    _, steps = read_steps([RIGS / name], options, whole="recorded")
    return fit_recorded(steps.recorded)


@pytest.mark.slow
def test_a_lamp_on_a_staircase() -> None:
    """Its first rise is 1.844 V with 18.5 ms and 201 ms, said the step fits."""
    options = ReadOptions(columns="time=2,input=3,output=1", units="time=us,output=mV,input=PWM")
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


@pytest.mark.slow
def test_no_independent_least_squares_finds_less_of_the_lamp() -> None:
    """The replay's plant, row by row, over τ1(u), T_s(u), the idle output and the release; τ2 stands at its limit."""
    options = ReadOptions(columns="time=2,input=3,output=1", units="time=us,output=mV,input=PWM")
    (run,) = read_steps([RIGS / "light_staircase.csv"], options, whole="recorded")[1].recorded
    found = fit_recorded([run])
    p, release = found.nonlinear, found.release
    assert p is not None and p.sse is not None and release is not None and found.recorded is not None
    start = np.array([*p.tau1, *p.Ts, found.recorded.logs[0].idle, release.tau1, release.tau2])

    def missed(factors: np.ndarray) -> np.ndarray:
        c = (start * factors).tolist()
        model = Nonlinear(tuple(c[:3]), p.tau2, tuple(c[3:7]), p.u_range, release=(c[8], c[9]))
        plant, x1, x2 = plant_parameters(model), 0.0, 0.0
        out = np.empty(len(run.time_s))
        for k, step_s in enumerate([*np.diff(run.time_s).tolist(), 0.0]):
            out[k] = x1 + x2 + c[7] - run.output[k]
            x1, x2 = plant_step(plant, x1, x2, float(run.input[k]), step_s)
        return out

    assert float(np.sum(missed(np.ones(10)) ** 2)) == pytest.approx(p.sse, rel=1e-6)
    best = least_squares(missed, np.ones(10), x_scale="jac", ftol=1e-12, xtol=1e-12, gtol=1e-12, max_nfev=20)
    assert p.sse <= 2 * best.cost * (1 + 1e-6)


def test_a_heater_is_two_exponentials_and_no_independent_fit_has_less_left() -> None:
    (run,) = read_steps([RIGS / "heater_on_from_first_row.csv"], HEATER, whole="recorded")[1].recorded
    found = fit_recorded([run]).nonlinear
    assert found is not None and found.sse is not None
    t, y = run.time_s - run.time_s[0], run.output

    def missed(c: np.ndarray) -> np.ndarray:
        return c[0] + c[1] * np.exp(-t / c[2]) + c[3] * np.exp(-t / c[4]) - y

    starts = [np.array([y[-1], 5.0, fast, -30.0, slow]) for fast in (5.0, 20.0) for slow in (60.0, 150.0)]
    best = min((least_squares(missed, c, x_scale="jac", ftol=1e-14, xtol=1e-14, gtol=1e-14) for c in starts),
               key=lambda one: one.cost)  # fmt: skip
    assert found.sse == pytest.approx(2 * best.cost, rel=1e-6)
    assert sorted(best.x[[2, 4]]) == pytest.approx([found.tau1[0], found.tau2[0]], rel=1e-3)
