"""What a plan states: the 80 % quantile over the rigs that the fit allows, not over the fitted one."""

from dataclasses import dataclass
from typing import Any

import msgspec
import numpy as np
import pytest

import eaid
from benchmarks.coverage import VARIANTS, one_set
from eaid.estimate.scatter import ASSUMED
from eaid.planning.widths import Widths, enlarged, fitted_rig


@dataclass(frozen=True)
class Asked:
    """A plan that has half of the width that it was asked for, as simulated, or none."""

    width: float
    met: bool = True

    @property
    def half_width_pct(self) -> dict[str, float]:
        return {"Ts": self.width, "tau2": self.width}

    @property
    def time_on_rig_s(self) -> float:
        return 1 / self.width**2


def test_a_plan_is_not_taken_for_its_luck() -> None:
    """Widths that differ by a quarter from recording to recording: four of five keep what is stated, 73 % without."""
    random = np.random.default_rng(1)

    def measure(plan: Asked) -> list[Widths]:
        return [{"Ts": plan.width * float(np.exp(0.25 * z))} for z in random.standard_normal(14)]

    kept = []
    for _ in range(400):
        plan, widths = enlarged(lambda wanted: Asked(wanted["Ts"]), measure, {"Ts": 1.0}, 0.8)
        stated = widths["Ts"]
        assert stated <= 1.0
        kept.append(np.mean([row["Ts"] <= stated for row in measure(plan)]))
    assert np.mean(kept) == pytest.approx(0.8, abs=0.02)


@pytest.fixture(scope="module")
def fitted() -> Any:
    return eaid.fit(one_set(7, VARIANTS["base"]))


def test_rigs_scatter_as_the_fit_is_sure(fitted: Any) -> None:
    """Plants by the fit's intervals, scatter by √(ν/χ²), each rig its own."""
    rig = fitted_rig(fitted)
    found, noise = rig.drawn(200, 1), rig.noise
    tau2 = np.log([one.at(50.0).tau2 for one, _ in found])
    row = next(row for row in fitted.nonlinear.curves if row.level == 50.0)
    half_width = 0.5 * np.log(row.ci95.tau2[1] / row.ci95.tau2[0])
    assert np.quantile(np.abs(tau2 - np.log(row.tau2)), 0.95) == pytest.approx(half_width, rel=0.3)
    degrees = fitted.uncertainty.degrees_of_freedom
    factor = np.array([own.scatter["Ts"] / noise.scatter["Ts"] for _, own in found])
    assert np.mean(1 / factor**2) == pytest.approx(1.0, abs=4 * np.sqrt(2 / degrees / 200))
    assert np.std(1 / factor**2) == pytest.approx(np.sqrt(2 / degrees), rel=0.25)
    again = rig.drawn(200, 1)
    assert [one.scatter for _, one in again] == [one.scatter for _, one in found]


def test_rigs_of_a_fit_without_intervals_are_the_fitted_one(fitted: Any) -> None:
    bare = msgspec.structs.replace(
        fitted, nonlinear=msgspec.structs.replace(fitted.nonlinear, covariance=None), uncertainty=None
    )
    rig = fitted_rig(bare)
    found = rig.drawn(3, 1)
    assert not rig.known and rig.noise == ASSUMED
    assert all(one.at(50.0) == fitted_rig(fitted).plant.at(50.0) and noise == ASSUMED for one, noise in found)
