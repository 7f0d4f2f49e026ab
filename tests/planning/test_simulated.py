"""What a plan states: the 80 % quantile over the rigs that the fit allows, not over the fitted one."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import msgspec
import numpy as np
import pytest

from eaid.fitting.fit import fit
from eaid.planning import design, excitation, recordings
from eaid.planning.design import Experiment, rig_of
from eaid.uncertainty.intervals import with_intervals
from eaid.uncertainty.rig_noise import ASSUMED, Noise
from tests.uncertainty.conftest import sets

__all__ = ["sets"]
QUIET = Noise(1e-7, 1e-6, (0.03, 0.05, 0.02))
SMALL = Experiment((10.0, 50.0), (20.0, 30.0), 3, {}, 0.0, True)


def test_what_is_stated_is_kept_by_so_many() -> None:
    """The m-th least of n widths is kept by the next with probability m/(n + 1), whatever their distribution."""
    rows = [{"Ts": float(k), "tau1": float(-k)} for k in range(14, 0, -1)]
    assert recordings.SETS == 14 and design.kept_widths(rows, recordings.KEEPING) == {"Ts": 12.0, "tau1": -3.0}
    rows = [{"Ts": float(k)} for k in range(1, 21)]
    assert excitation.SETS == 20 and design.kept_widths(rows, excitation.KEEPING) == {"Ts": 19.0}


@dataclass(frozen=True)
class Asked:
    """A plan that has half of the width that it was asked for, as simulated, or none."""

    width: float
    met: bool = True

    @property
    def half_width_pct(self) -> dict[str, float]:
        return {"Ts": self.width, "tau2": self.width}


def test_a_plan_is_made_larger_until_its_recordings_keep_the_widths() -> None:
    asked = []

    def make(wanted: Mapping[str, float]) -> Asked:
        asked.append(wanted["tau2"])
        return Asked(wanted["tau2"])

    plan, rows = design.enlarged(make, lambda plan: [{"tau2": 2 * plan.width, "Ts": 9.0}], {"tau2": 10.0}, 0.5)
    assert rows[0]["tau2"] <= 10.0 and asked == sorted(asked, reverse=True)
    assert asked[1] == pytest.approx(10 / 2**0.7) and plan.width == asked[-1]


def test_a_plan_that_cannot_be_met_stays_and_one_without_intervals_is_enlarged() -> None:
    def short(wanted: Mapping[str, float]) -> Asked:
        return Asked(wanted["Ts"], met=False)

    assert design.enlarged(short, lambda _: [{"Ts": 3.0}], {"Ts": 1.0}, 0.5)[0].width == 1.0
    lost = design.enlarged(
        lambda wanted: Asked(wanted["Ts"]),
        lambda plan: [{"Ts": np.inf if plan.width > 0.3 else plan.width}], {"Ts": 1.0}, 0.5,
    )  # fmt: skip
    assert lost[1][0]["Ts"] < 0.3


def test_a_width_that_is_predicted_to_be_none_is_no_obstacle() -> None:
    """Without any noise τ2 is predicted, and comes out, exactly; T_s scatters."""

    @dataclass(frozen=True)
    class Exact(Asked):
        @property
        def half_width_pct(self) -> dict[str, float]:
            return {"Ts": self.width, "tau2": 0.0}

    plan, rows = design.enlarged(
        lambda wanted: Exact(wanted["Ts"]), lambda plan: [{"Ts": 1.5 * plan.width, "tau2": 0.0}], {"Ts": 1.0}, 0.5
    )
    assert plan.width < 0.7 and all(row["tau2"] == 0 for row in rows)


def test_a_plan_is_not_taken_for_its_luck() -> None:
    """Widths that differ by a quarter from recording to recording: four of five keep what is stated, 73 % without."""
    random = np.random.default_rng(1)

    def measure(plan: Asked) -> list[design.Widths]:
        return [{"Ts": plan.width * float(np.exp(0.25 * z))} for z in random.standard_normal(14)]

    kept = []
    for _ in range(400):
        plan, rows = design.enlarged(lambda wanted: Asked(wanted["Ts"]), measure, {"Ts": 1.0}, 0.8)
        stated = design.kept_widths(rows, 0.8)["Ts"]
        assert stated <= 1.0
        kept.append(np.mean([row["Ts"] <= stated for row in measure(plan)]))
    assert np.mean(kept) == pytest.approx(0.8, abs=0.02)


@pytest.fixture(scope="module")
def fitted(sets: Any) -> Any:
    made = sets.one_set(7, sets.VARIANTS["base"])
    return with_intervals(made, fit(made))


def test_rigs_scatter_as_the_fit_is_sure(fitted: Any) -> None:
    """Plants by the fit's intervals, scatter by √(ν/χ²), each rig its own."""
    rig = rig_of(fitted)
    found, noise = rig.drawn(200, 1), rig.noise
    tau2 = np.log([one.at(50.0).tau2 for one, _ in found])
    row = next(row for row in fitted.nonlinear.curves if row.level == 50.0)
    half_width = 0.5 * np.log(row.ci95.tau2[1] / row.ci95.tau2[0])
    assert np.quantile(np.abs(tau2 - np.log(row.tau2)), 0.95) == pytest.approx(half_width, rel=0.3)
    degrees = fitted.uncertainty.degrees_of_freedom
    factor = np.array([own.scatter[0] / noise.scatter[0] for _, own in found])
    assert np.mean(1 / factor**2) == pytest.approx(1.0, abs=4 * np.sqrt(2 / degrees / 200))
    assert np.std(1 / factor**2) == pytest.approx(np.sqrt(2 / degrees), rel=0.25)
    again = rig.drawn(200, 1)
    assert [one.scatter for _, one in again] == [one.scatter for _, one in found]


def test_rigs_of_a_fit_without_intervals_are_the_fitted_one(fitted: Any) -> None:
    bare = msgspec.structs.replace(
        fitted, nonlinear=msgspec.structs.replace(fitted.nonlinear, covariance=None), uncertainty=None
    )
    rig = rig_of(bare)
    found = rig.drawn(3, 1)
    assert not rig.known and rig.design_noise == ASSUMED
    assert all(one.at(50.0) == rig_of(fitted).plant.at(50.0) and noise == ASSUMED for one, noise in found)


@pytest.mark.slow
def test_levels_of_a_friction_experiment_are_drawn_from_their_intervals(fitted: Any) -> None:
    data = msgspec.structs.replace(fitted.data, kind="friction-force")
    friction = msgspec.structs.replace(fitted, data=data, nonlinear=None)
    rig = rig_of(friction)
    found = rig.drawn(300, 1)
    row = fitted.friction.levels[4]
    spread = np.std(np.log([one.at(row.level).Ts for one, _ in found]))
    assert spread == pytest.approx(0.5 * np.log(row.ci95.Ts[1] / row.ci95.Ts[0]) / 1.96, rel=0.2)
    assert rig.levels == rig.plant.levels and len({one.at(row.level).tau1 for one, _ in found}) == 300
