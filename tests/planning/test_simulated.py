"""What a plan states: the 80 % quantile over the rigs that the fit allows, not over the fitted one."""

from dataclasses import replace
from typing import Any

import msgspec
import numpy as np
import pytest

from eaid.fitting.fit import fit
from eaid.planning import recordings, simulated
from eaid.planning.design import Experiment
from eaid.planning.rigs import rigs
from eaid.synth.plants import clutch
from eaid.uncertainty.intervals import with_intervals
from eaid.uncertainty.noise import Noise, noise_of_fit
from tests.uncertainty.conftest import sets

__all__ = ["sets"]
QUIET = Noise(1e-7, 1e-6, (0.03, 0.05, 0.02))
SMALL = Experiment((10.0, 50.0), (20.0, 30.0), 3, {}, 0.0, True)


def test_what_is_stated_is_kept_by_four_of_five(monkeypatch: pytest.MonkeyPatch) -> None:
    """The m-th least of n widths is kept by the next with probability m/(n + 1), whatever their distribution."""
    assert simulated.KEEPING / (simulated.SETS + 1) == 0.8
    given = iter(np.arange(simulated.SETS, 0, -1.0).tolist())
    monkeypatch.setattr(simulated, "widths", lambda *_, **__: dict.fromkeys(("Ts", "tau1", "tau2"), next(given)))
    stated = simulated.measure(SMALL, [(clutch(), QUIET)] * simulated.SETS, 0.85, 0)
    assert stated == {"Ts": 12.0, "tau1": 12.0, "tau2": 12.0}


@pytest.fixture(scope="module")
def fitted(sets: Any) -> Any:
    made = sets.one_set(7, sets.VARIANTS["base"])
    return with_intervals(made, fit(made))


def test_rigs_scatter_as_the_fit_is_sure(fitted: Any) -> None:
    """Plants by the fit's intervals, scatter by √(ν/χ²), each rig its own."""
    plant, _, _ = recordings._plant(fitted)
    noise = noise_of_fit(fitted, apart=True)
    found = rigs(fitted, plant, noise, 200, 1)
    tau2 = np.log([one.at(50.0).tau2 for one, _ in found])
    row = next(row for row in fitted.nonlinear.curves if row.level == 50.0)
    half_width = 0.5 * np.log(row.ci95.tau2[1] / row.ci95.tau2[0])
    assert np.quantile(np.abs(tau2 - np.log(row.tau2)), 0.95) == pytest.approx(half_width, rel=0.3)
    degrees = fitted.uncertainty.degrees_of_freedom
    factor = np.array([own.scatter[0] / noise.scatter[0] for _, own in found])
    assert np.mean(1 / factor**2) == pytest.approx(1.0, abs=4 * np.sqrt(2 / degrees / 200))
    assert np.std(1 / factor**2) == pytest.approx(np.sqrt(2 / degrees), rel=0.25)
    again = rigs(fitted, plant, noise, 200, 1)
    assert [one.scatter for _, one in again] == [one.scatter for _, one in found]


def test_rigs_of_a_fit_without_intervals_are_the_fitted_one(fitted: Any) -> None:
    bare = msgspec.structs.replace(
        fitted, nonlinear=msgspec.structs.replace(fitted.nonlinear, covariance=None), uncertainty=None
    )
    plant, _, _ = recordings._plant(fitted)
    found = rigs(bare, plant, QUIET, 3, 1)
    assert all(one.at(50.0) == plant.at(50.0) and noise == QUIET for one, noise in found)


def test_levels_of_a_friction_experiment_are_drawn_from_their_intervals(fitted: Any) -> None:
    data = msgspec.structs.replace(fitted.data, kind="friction-force")
    friction = msgspec.structs.replace(fitted, data=data, nonlinear=None)
    plant, levels, _ = recordings._plant(friction)
    found = rigs(friction, plant, QUIET, 300, 1)
    row = fitted.friction.levels[4]
    spread = np.std(np.log([one.at(row.level).Ts for one, _ in found]))
    assert spread == pytest.approx(0.5 * np.log(row.ci95.Ts[1] / row.ci95.Ts[0]) / 1.96, rel=0.2)
    assert levels == plant.levels and len({one.at(row.level).tau1 for one, _ in found}) == 300


def test_a_rotor_is_simulated_where_the_fit_saw_one() -> None:
    from eaid.uncertainty.periodic import Periodic

    found = Experiment((50.0,), (30.0,), 40, {}, 0.0, True)
    none = Noise(0.0, 0.0, (0.0, 0.0, 0.0))
    level = simulated.experiment(found, clutch(), replace(none, periodic=Periodic(6.0, 0.01)), 0)[0]
    still = simulated.experiment(found, clutch(), none, 0)[0]
    ripple = (level.runs / np.maximum(still.runs, 1e-9) - 1)[:, 300:]
    assert np.sqrt(np.mean(ripple**2)) == pytest.approx(0.01 / np.sqrt(2), rel=0.1)
    wave = np.exp(2j * np.pi * level.time_s[300:] / 6)
    assert np.mean(np.abs(ripple @ wave)) == pytest.approx(0.005 * len(wave), rel=0.1)
