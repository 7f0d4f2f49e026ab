"""The rig that a fit describes, and the rigs that its data allow: one plant and one run-to-run scatter for each
simulated recording.

Plants are drawn from the fit's uncertainty: those of a clutch as `eaid.uncertainty.draw` says, the levels of a friction
experiment from their own intervals. Scatter known by ν degrees of freedom has a standard deviation of s √(ν/χ²(ν)).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from eaid.errors import DataError
from eaid.models.parameters import SHARE
from eaid.planning.design import PARAMETERS, Experiment, Session, level_sets, quickest
from eaid.results.fit import Fit
from eaid.results.friction import FrictionLevel
from eaid.synth.plants import Plant, clutch, of_fit
from eaid.uncertainty.draw import draw
from eaid.uncertainty.rig_noise import ASSUMED, Noise, cautious, noise_of_fit, scattered
from eaid.uncertainty.student_t import t_quantile

Rig: TypeAlias = tuple[Plant, Noise]


@dataclass(frozen=True)
class FittedRig:
    """A fit's plant, and the noise and scatter of its runs."""

    fit: Fit
    plant: Plant
    levels: Sequence[float]
    """The identified range of a clutch; the fitted levels of a friction experiment."""
    share: float
    """C."""
    noise: Noise
    known: bool
    """Whether the fit says how noisy the rig is; else the noise is assumed."""

    @property
    def degrees(self) -> float:
        """Degrees of freedom that the scatter is known by; 0: none are known."""
        return (self.fit.uncertainty.degrees_of_freedom if self.fit.uncertainty is not None else None) or 0.0

    @property
    def design_noise(self) -> Noise:
        """What to design with: the scatter that only one rig in five exceeds."""
        return cautious(self.noise, self.degrees if self.known else 0.0)

    def quickest(self, wanted: Mapping[str, float], session: Session) -> Experiment:
        """The quickest steps from rest for the wanted half-widths [%]."""
        polynomial = self.plant.kind == "clutch"
        candidates = level_sets(self.levels, session.most_levels) if polynomial else [list(self.levels)]
        return quickest(self.plant.at, candidates, wanted, self.design_noise, session, polynomial)

    def drawn(self, n: int, seed: int) -> list[Rig]:
        """`n` rigs that the data of the fit allow."""
        random = np.random.default_rng([seed, 3])
        if self.plant.kind == "clutch":
            plants = [clutch(model, self.plant.made_of) for model in draw(self.fit, n, seed).plants]
        else:
            assert self.fit.friction is not None
            plants = [_levels_drawn(self.plant, self.fit.friction.levels, random) for _ in range(n)]
        degrees = max(self.degrees, 1.0)
        chance = random.chisquare(degrees, (n, 3)) / degrees
        factors = 1 / np.sqrt(chance) if self.degrees > 0 else np.ones((n, 3))
        return [(plant, scattered(self.noise, row)) for plant, row in zip(plants, factors, strict=True)]


def rig_of(fit: Fit) -> FittedRig:
    """The rig that a fit describes; `DataError` where it holds neither a nonlinear nor a friction model."""
    if fit.nonlinear is None and (fit.data.kind == "clutch" or not fit.friction_levels):
        raise DataError("the fit holds neither a nonlinear nor a friction model to plan with; fit again")
    plant = of_fit(fit, "clutch" if fit.nonlinear is not None else fit.data.kind, "a fit")
    levels: Sequence[float] = plant.levels
    if plant.model is not None:
        levels, share = plant.model.u_range, plant.model.C
    else:
        share = (fit.friction.C if fit.friction is not None else None) or SHARE
    noise = noise_of_fit(fit)
    return FittedRig(fit, plant, levels, share, noise or ASSUMED, noise is not None)


def _levels_drawn(plant: Plant, rows: tuple[FrictionLevel, ...], random: np.random.Generator) -> Plant:
    """The same experiment with T_s, τ1, τ2 of each level drawn from their intervals, where they have some."""
    curves = {}
    for row in rows:
        drawn: dict[str, float] = {}
        for name in PARAMETERS:
            ends = None if row.ci95 is None else getattr(row.ci95, name)
            if ends is not None and ends[0] > 0:
                half_width = 0.5 * np.log(ends[1] / ends[0])
                factor = np.exp(random.standard_normal() * half_width / t_quantile(np.inf))
                drawn[name] = getattr(row, name) * float(factor)
        curves[row.level] = replace(row.curve, **drawn)
    return replace(plant, at=curves.__getitem__)
