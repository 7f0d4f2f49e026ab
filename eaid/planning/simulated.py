"""Simulated recordings of a planned session of steps, and their own intervals.

Each time the rig is another one that the fit allows (`rigs`): the plan has to hold for the true rig, not for the fitted
one. The noise is that of the fit: white noise of density s0, coloured noise of density s1 as a share of the torque,
and the scatter between runs.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import sqrt

import numpy as np

from eaid.models.friction import step_response
from eaid.planning.design import PARAMETERS, Experiment
from eaid.planning.enlarge import Widths
from eaid.planning.rigs import Rig
from eaid.steps.stepset import Level
from eaid.synth.disturbance import NONE, Disturbance, measured, scatter
from eaid.synth.plants import Plant
from eaid.uncertainty.friction_intervals import level_rows
from eaid.uncertainty.level_statistics import curve_degrees, curves, statistics_at_share
from eaid.uncertainty.rig_noise import Noise
from eaid.uncertainty.student_t import t_quantile

RATE_HZ = 100.0
"""Samples a second of a simulated recording."""
MEMORY_S = 0.05
"""Time constant of its coloured noise [s]."""


def measure(
    plan: Experiment, rigs: Sequence[Rig], share: float, seed: int, progress: Callable[[], None]
) -> list[Widths]:
    """Half-widths of every recording's own intervals at the worst level [%]."""
    rows = []
    for k, (plant, noise) in enumerate(rigs):
        levels = experiment(plan, plant, noise, seed + 100_000 * k)
        rows.append(widths(levels, share, polynomial=plant.kind == "clutch" and len(plan.levels) > 1))
        progress()
    return rows


def experiment(plan: Experiment, plant: Plant, noise: Noise, seed: int) -> tuple[Level, ...]:
    """The levels of one simulated recording."""
    disturbance = disturbance_of(noise)
    levels = []
    for i, (level, hold_s) in enumerate(zip(plan.levels, plan.hold_s, strict=True)):
        random, time_s = np.random.default_rng([seed, i]), np.arange(round(hold_s * RATE_HZ)) / RATE_HZ
        runs = []
        for _ in range(plan.repeats):
            torque_nm = step_response(scatter(disturbance, random).of(plant.at(level)), time_s)
            runs.append(measured(torque_nm, time_s, np.zeros_like(time_s), disturbance, random))
        levels.append(Level(level, time_s, np.array(runs), tuple(map(str, range(plan.repeats)))))
    return tuple(levels)


def widths(levels: tuple[Level, ...], share: float, polynomial: bool) -> Widths:
    """Half-width of the 95 % intervals at the worst level [%]: of the two-stage curves, else of the levels."""
    base = statistics_at_share(levels, share)
    worst = dict.fromkeys(PARAMETERS, np.inf)
    if not polynomial:
        for k, name in enumerate(PARAMETERS):
            ends = [row[k].interval for row in level_rows(base)]
            worst[name] = max(np.inf if end is None else 100 * (sqrt(end[1] / end[0]) - 1) for end in ends)
        return worst
    open_curves = base.open_curves()
    for name, curve in curves(base).items():
        if name not in open_curves:
            reach = np.max(t_quantile(curve_degrees(base, curve, name)) * curve.log_sd(base.duty_pct))
            worst[name] = float(100 * np.expm1(np.minimum(reach, 50.0)))
    return worst


def disturbance_of(noise: Noise) -> Disturbance:
    """The noise and the scatter of a fit as a simulated recording has them."""
    return replace(
        NONE,
        white_nm=sqrt(noise.sensor_nm2_s * RATE_HZ),
        coloured=sqrt(noise.ripple_s / (2 * MEMORY_S)),
        coloured_s=MEMORY_S,
        gain_scatter=min(noise.scatter[0], 0.3),
        tau1_scatter=noise.scatter[1],
        tau2_scatter=noise.scatter[2],
    )
