"""The rigs that a fit allows: one plant and one run-to-run scatter for each simulated recording.

Plants are drawn from the fit's uncertainty: those of a clutch as `eaid.uncertainty.draw` says, the levels of a friction
experiment from their own intervals. Scatter known by ν degrees of freedom has a standard deviation of s √(ν/χ²(ν)).
"""

from typing import TypeAlias

import numpy as np

from eaid.models.parameters import Friction
from eaid.results.fit import Fit
from eaid.results.friction import FrictionLevel
from eaid.synth.plants import Plant, clutch
from eaid.uncertainty.draw import draw
from eaid.uncertainty.noise import Noise, scattered
from eaid.uncertainty.student_t import t_quantile

Rig: TypeAlias = tuple[Plant, Noise]


def rigs(fit: Fit, plant: Plant, noise: Noise, n: int, seed: int) -> list[Rig]:
    """`n` rigs that the data of a fit allow; `plant` is the fitted one."""
    random = np.random.default_rng([seed, 3])
    degrees = (fit.uncertainty.degrees_of_freedom if fit.uncertainty is not None else None) or 0.0
    if plant.kind == "clutch":
        plants = [clutch(model, plant.made_of) for model in draw(fit, n, seed).plants]
    else:
        rows = fit.friction.levels if fit.friction is not None else ()
        plants = [_levels_drawn(plant, rows, random) for _ in range(n)]
    chance = random.chisquare(max(degrees, 1.0), (n, 3)) / max(degrees, 1.0)
    factors = 1 / np.sqrt(chance) if degrees > 0 else np.ones((n, 3))
    return [(one, scattered(noise, own)) for one, own in zip(plants, factors, strict=True)]


def _levels_drawn(plant: Plant, rows: tuple[FrictionLevel, ...], random: "np.random.Generator") -> Plant:
    """The same experiment with T_s, τ1, τ2 of each level drawn from their intervals, where they have some."""
    curves = {}
    for row in rows:
        values = [row.Ts, row.tau1, row.tau2]
        for k, name in enumerate(("Ts", "tau1", "tau2")):
            ends = None if row.ci95 is None else getattr(row.ci95, name)
            if ends is not None and ends[0] > 0:
                values[k] *= float(
                    np.exp(random.standard_normal() * 0.5 * np.log(ends[1] / ends[0]) / t_quantile(np.inf))
                )
        Ts, tau1, tau2 = values
        curves[row.level] = Friction(Ts, tau1, tau2, row.curve.C)
    return Plant(plant.kind, curves.__getitem__, plant.rotor_rpm, plant.levels, plant.made_of)
