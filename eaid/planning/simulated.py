"""Simulated recordings of a planned session of steps, and their own intervals.

Each time the rig is another one that the fit allows (`rigs`): the plan has to hold for the true rig, not for the fitted
one.
"""

from collections.abc import Callable, Sequence
from math import sqrt

import numpy as np

from eaid.models.friction import step_response
from eaid.planning.design import PARAMETERS, Experiment
from eaid.planning.promise import RATE_HZ, Widths, disturbance_of, rotor_hz
from eaid.planning.rigs import Rig
from eaid.steps.stepset import Level
from eaid.synth.disturbance import measured, scatter
from eaid.synth.plants import Plant
from eaid.uncertainty.friction_intervals import level_rows
from eaid.uncertainty.level_statistics import curve_degrees, curves, statistics_at_share
from eaid.uncertainty.noise import Noise
from eaid.uncertainty.student_t import t_quantile


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
    disturbance, ripple_hz = disturbance_of(noise), rotor_hz(noise)
    levels = []
    for i, (level, hold_s) in enumerate(zip(plan.levels, plan.hold_s, strict=True)):
        random, time_s = np.random.default_rng([seed, i]), np.arange(round(hold_s * RATE_HZ)) / RATE_HZ
        rotor = np.full_like(time_s, ripple_hz)
        runs = []
        for _ in range(plan.repeats):
            torque_nm = step_response(scatter(disturbance, random).of(plant.at(level)), time_s)
            runs.append(measured(torque_nm, time_s, rotor, disturbance, random))
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
