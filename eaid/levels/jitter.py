"""Runs of a level that start apart, as a trigger that jitters makes them: told, and brought in step.

Of each run a shift in time is fitted beside its own T_s, τ1 and τ2, one linear step from the level's curve f,

    y_r − f ≈ J d_r − ḟ θ_r,

and the scatter of θ_r within the levels is held against what the noise within the runs makes of it (Bartlett sums). The
mean of runs that start apart is smeared, and its τ1 too long: all are laid on each other, each θ_r less their mean
earlier, for that is a dead time.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.special import chdtri

from eaid.arrays import Array, median
from eaid.estimate.scatter import Scatter, bartlett_variance
from eaid.findings import Finding, finding
from eaid.plant.dynamics import Step
from eaid.plant.steps import step_rate
from eaid.shapes.delay import usual_row_s
from eaid.steps.stepset import Level, StepSet

APART_CHANCE = 1e-3  # That noise alone makes starts scatter so
LEAST_ROWS, TAU1_PART = 0.5, 0.03  # Rows, and part of the middle τ1, that starts scatter by at least: less smears none


class Starts(NamedTuple):
    """By how much the runs of some levels start later than all do in the mean [s], and what is said of it."""

    shifts_s: dict[float, Array]
    told: Finding


def find_starts_apart(scatter: Scatter) -> Starts | None:
    """The starts of runs that scatter by more than noise and more than matters; None of others."""
    shifts, squares, noise, degrees = dict[float, Array](), 0.0, 0.0, 0
    for level, curve, J in zip(scatter.levels, scatter.curves, scatter.jacobians, strict=True):
        if len(level.runs) > 1:
            shifts[level.level], within = _shifts(level, curve, J)
            own = shifts[level.level] - shifts[level.level].mean()
            squares, noise = squares + float(own @ own), noise + (len(own) - 1) * within
            degrees += len(own) - 1
    if not degrees:
        return None
    sd, row_s = float(np.sqrt(squares / degrees)), usual_row_s(scatter.levels)
    tau1 = median(np.array([curve.tau1 for curve in scatter.curves]))
    by_noise = float(chdtri(degrees, APART_CHANCE)) * noise / degrees
    if not by_noise < squares < np.inf or sd < max(LEAST_ROWS * row_s, TAU1_PART * tau1):
        return None
    middle = float(np.mean(np.concatenate([*shifts.values()])))  # which is a dead time
    shifts, slow = {u: own - middle for u, own in shifts.items()}, max(curve.tau1 for curve in scatter.curves)
    if any(float(np.abs(own).max()) > slow for own in shifts.values()):  # no step as long as that is straight
        return None
    known = [one for one in scatter.levels if one.level in shifts]
    each = [(theta, name) for one in known for theta, name in zip(shifts[one.level], one.names, strict=True)]
    off_s, run = max(each, key=lambda one: abs(one[0]))
    told = finding("starts-apart", "data", ms=1e3 * sd, pct=100 * sd / tau1, run=run, off_ms=1e3 * float(off_s))
    return Starts(shifts, told)


def lay_in_step(stepset: StepSet, starts: Starts) -> StepSet:
    """The set with the runs of its levels laid on each other, and the single steps that they are."""
    levels, late_s = [], dict[tuple[float, str], float]()
    for level in stepset.levels:
        late = starts.shifts_s.get(level.level, np.zeros(len(level.runs)))
        late_s |= {(level.level, name): theta for name, theta in zip(level.names, late.tolist(), strict=True)}
        t = level.time_s[level.time_s <= level.time_s[-1] - max(late.max(), 0.0)]
        runs = [np.interp(t + theta, level.time_s, run, left=0.0) for theta, run in zip(late, level.runs, strict=True)]
        levels.append(replace(level, time_s=t, runs=np.array(runs)))
    steps = []
    for step in stepset.level_steps:
        theta = late_s.get((step.level, step.name), 0.0) if step.edge == "up" and step.from_level == 0 else 0.0
        output = np.interp(step.time_s + theta, step.time_s, step.output, left=step.start) if theta else step.output
        steps.append(replace(step, output=output))
    return replace(stepset, levels=tuple(levels), level_steps=tuple(steps))


def _shifts(level: Level, curve: Step, J: Array) -> tuple[Array, float]:
    """By how much each run of a level starts later than its curve [s], and the variance that noise makes of one."""
    columns = np.column_stack([J, -step_rate(curve, level.time_s)])
    size = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    back = np.linalg.pinv(columns / size, rcond=1e-8) / size[:, None]
    off = level.runs - J[:, 0]
    found = off @ back.T
    left = (off - off.mean(axis=0) - (found - found.mean(axis=0)) @ columns.T) * back[-1]
    share = len(level.runs) / (len(level.runs) - 1)  # what is left of R runs about their mean
    return found[:, -1], share * float(bartlett_variance(level.time_s, left.T).max(axis=0).mean())
