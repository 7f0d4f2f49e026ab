"""A plan is checked by doing it: the experiment is simulated some times over, and its own intervals measured.

Each time the rig is another one that the fit allows (`rigs`): the plan has to hold for the true rig, not for the fitted
one. What a plan states of each parameter is the 80 % quantile of the widths at the worst level. The m-th least of n
widths is kept by the next recording with probability m/(n + 1); 12 of 14 make that exactly 80 %.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from math import sqrt

import numpy as np

from eaid.models.friction import step_response
from eaid.planning.design import PARAMETERS, Experiment
from eaid.planning.rigs import Rig
from eaid.steps.stepset import Level
from eaid.synth.disturbance import NONE, measured, scatter
from eaid.synth.plants import Plant
from eaid.uncertainty.friction_intervals import level_rows
from eaid.uncertainty.level_statistics import curve_degrees, curves, statistics_at_share
from eaid.uncertainty.noise import Noise
from eaid.uncertainty.student_t import t_quantile

RATE_HZ = 100.0
MEMORY_S = 0.05
SETS, KEEPING = 14, 12
"""Recordings that are simulated, and how many of them keep the stated widths: 12/(14 + 1) = 80 %."""
DAMPED = 0.7
"""Power of the excess by which a plan is asked for narrower: widths fall faster than their prediction."""
LEAST_STEP = 1.03
ROUNDS = 6
"""Times that a plan is made larger because the simulated widths exceed the wanted ones."""


def enlarged(
    make: Callable[[Mapping[str, float]], Experiment],
    wanted: Mapping[str, float],
    rigs: Sequence[Rig],
    share: float,
    seed: int,
    progress: Callable[[], None] | None = None,
) -> tuple[Experiment, dict[str, float]]:
    """The experiment that `make` gives for the wanted widths [%], larger until simulated ones keep them; those widths.

    A width measured too wide is asked for narrower in the next round. An experiment that falls short even by its
    prediction is as large as the limits allow, and stays.
    """
    asked = dict(wanted)
    found = make(asked)
    measured = measure(found, rigs, share, seed, progress)
    for _ in range(ROUNDS):
        over = {name: measured[name] / width for name, width in wanted.items()}
        if not found.met or max(over.values()) <= 1 or max(over.values()) == float("inf"):
            break
        asked = {
            name: width / max(LEAST_STEP, over[name] ** DAMPED) if over[name] > 1 else width
            for name, width in asked.items()
        }
        larger = make(asked)
        if larger != found:
            found, measured = larger, measure(larger, rigs, share, seed, progress)
    return found, measured


def measure(
    found: Experiment, rigs: Sequence[Rig], share: float, seed: int, progress: Callable[[], None] | None = None
) -> dict[str, float]:
    """Half-width that the experiment's own intervals keep at the worst level [%], for each parameter by itself."""
    rows = []
    for k, (plant, noise) in enumerate(rigs):
        recorded = experiment(found, plant, noise, seed + 100_000 * k)
        rows.append(widths(recorded, share, polynomial=plant.kind == "clutch" and len(found.levels) > 1))
        if progress is not None:
            progress()
    place = -(-KEEPING * len(rows) // SETS) - 1
    return {name: sorted(row[name] for row in rows)[place] for name in PARAMETERS}


def experiment(found: Experiment, plant: Plant, noise: Noise, seed: int) -> tuple[Level, ...]:
    """The levels of one simulated recording."""
    disturbance = replace(
        NONE,
        white_nm=sqrt(noise.sensor_nm2_s * RATE_HZ),
        coloured=sqrt(noise.ripple_s / (2 * MEMORY_S)),
        coloured_s=MEMORY_S,
        ripple=0.0 if noise.periodic is None else noise.periodic.amplitude,
        gain_scatter=min(noise.scatter[0], 0.3),
        tau1_scatter=noise.scatter[1],
        tau2_scatter=noise.scatter[2],
    )
    rotor_hz = 0.0 if noise.periodic is None else 1 / noise.periodic.period_s
    levels = []
    for i, (level, hold_s) in enumerate(zip(found.levels, found.hold_s, strict=True)):
        random, time_s = np.random.default_rng([seed, i]), np.arange(round(hold_s * RATE_HZ)) / RATE_HZ
        runs = [
            measured(
                step_response(scatter(disturbance, random).of(plant.at(level)), time_s),
                time_s,
                np.full_like(time_s, rotor_hz),
                disturbance,
                random,
            )
            for _ in range(found.repeats)
        ]
        levels.append(Level(level, time_s, np.array(runs), tuple(map(str, range(found.repeats)))))
    return tuple(levels)


def widths(levels: tuple[Level, ...], share: float, polynomial: bool) -> dict[str, float]:
    """Half-width of the 95 % intervals at the worst level [%]: of the two-stage curves, else of the levels."""
    base = statistics_at_share(levels, share)
    if not polynomial:
        rows = level_rows(base)
        ends = {name: [row[k].interval for row in rows] for k, name in enumerate(PARAMETERS)}
        return {
            name: max(np.inf if end is None else 100 * (sqrt(end[1] / end[0]) - 1) for end in each)
            for name, each in ends.items()
        }
    through, open_curves = curves(base), base.open_curves()
    found = dict.fromkeys(PARAMETERS, np.inf)
    for name, curve in through.items():
        if name not in open_curves:
            reach = np.max(t_quantile(curve_degrees(base, curve, name)) * curve.log_sd(base.duty_pct))
            found[name] = float(100 * np.expm1(np.minimum(reach, 50.0)))
    return found
