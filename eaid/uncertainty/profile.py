"""Lopsided intervals of one level's parameters by profiling its cost, scaled to the scatter that is really there.

With the other parameters refitted, the cost S rises by t² V/[A⁻¹]_kk at the ends of the interval: where the cost is a
parabola in log θ this is θ̂ exp(±t √V) again; where it is not (τ2 of a short record) the interval leans as the data do.
"""

from dataclasses import replace

import numpy as np
from scipy.optimize import brentq

from eaid.arrays import Array
from eaid.fitting.compress import Points
from eaid.fitting.data import data_of
from eaid.fitting.descent import Descent
from eaid.uncertainty.friction_intervals import Parameter
from eaid.uncertainty.level_statistics import LevelStatistics
from eaid.uncertainty.levels import log_theta
from eaid.uncertainty.refit import free_parameters, refit
from eaid.uncertainty.student_t import t_quantile

FARTHEST = np.log(1000.0)
"""An end more than a factor of 1000 away counts as none."""
FIRST_STEP, GROWTH = 0.02, 1.6


def profiled(stats: LevelStatistics, i: int, k: int, p: Parameter) -> Parameter:
    """One level's parameter with the interval of its profile; as it was where scatter, not noise, makes its width."""
    one = stats.estimates[i]
    within = float(one.runs.within[k]) / one.runs.repeats
    inverse = one.runs.inverse
    # scatter from run to run (a gain, a τ1) knows nothing of the cost's shape: logs are its own scale; and what is open
    # is not quoted, however its profile looks
    noisy = within >= 0.5 * float(stats.variance[i, k])
    if p.name in one.constrained or not noisy or p.open or not inverse[k, k] > 0:
        return p
    rise = t_quantile(float(stats.degrees[i, k])) ** 2 * float(stats.variance[i, k]) / float(inverse[k, k])
    theta, points = log_theta(one.curve, True), data_of([stats.levels[i]]).points
    low, high = np.exp([_end(points, theta, k, one.share_free, rise, side) for side in (-1.0, 1.0)])
    if p.name == "C":
        low, high = low / (1 + low), high / (1 + high) if np.isfinite(high) else 1.0
    if not np.isfinite(high) or low <= 0:
        return replace(p, interval=None, open=True)
    return replace(p, interval=(float(low), float(high)))


def _end(points: Points, start: Array, k: int, share_free: bool, rise: float, side: float) -> float:
    """Where the profile of one level's parameter k crosses `rise` above its least cost, on the log (logit) scale.

    −inf or inf where it never does.
    """
    free = free_parameters(share_free)
    best = refit(points, start[None], free)
    wanted = float(best.cost[0]) + rise
    free = free & (np.arange(4) != k)
    inside, step, near = 0.0, FIRST_STEP, best.x

    def at(distance: float) -> Descent:
        held = near.copy()
        held[0, k] = start[k] + side * distance
        return refit(points, held, free)

    while (tried := at(inside + step)).cost[0] < wanted:
        inside, step, near = inside + step, GROWTH * step, tried.x
        if inside + step > FARTHEST:
            return side * np.inf
    # every refit from the same `near`: what is found at a distance then depends on nothing but the distance
    crossing = brentq(lambda d: float(at(d).cost[0]) - wanted, inside, inside + step, xtol=1e-6, rtol=1e-4)
    return float(start[k] + side * crossing)
