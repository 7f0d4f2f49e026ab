"""The dead time of steps from rest: one of all levels, behind which every model of them begins.

Looked for on the first rise to each level, on a grid with the sizes solved for; where it saves a good part of what is
left at most levels, each of these steps is fitted with a dead time of its own (`step_shapes`), and the plant's is their
mean, each weighed by how sharply its output leaves rest: (change/(τ1 · RMSE))².
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from eaid.errors import UsageError
from eaid.estimate.step_shapes import AveragedRecord, averaged, curve, delays_tried, fit_step, starts_of
from eaid.options import FitOptions
from eaid.plant.dynamics import SHARE
from eaid.steps.stepset import Level, LevelStep, StepSet

SAVED = 0.1  # Part of the RMSE that a dead time has to save at a level
MOST_LEVELS = 10  # Levels that are asked
LONGEST = 0.9  # Part of a record that a dead time may take


def dead_time_of(stepset: StepSet, options: FitOptions) -> float:
    """The dead time of a set's steps [s], as it was given or as most levels show it; 0 where they show none."""
    if (given := options.held_dead_time_s) is not None:
        for level in stepset.levels:
            if given >= LONGEST * level.time_s[-1]:
                raise UsageError(
                    f"«dead_time» {given:g} s: the step of {level.names[0]} is recorded for {level.time_s[-1]:.3g} s; "
                    "give a shorter one"
                )
        return given
    rises = {step.level: step for step in reversed(stepset.level_steps) if step.edge == "up" and step.from_level == 0}
    steps = [rises[level] for level in sorted(rises)]
    steps = steps[:: 1 + (len(steps) - 1) // MOST_LEVELS] if steps else []
    share = options.held_share or SHARE
    late = [step for step in steps if starts_late(step, share)]
    if 2 * len(late) <= len(steps):
        return 0.0
    shapes = [fit_step(step, replace(options, shape="auto")) for step in late]
    if 2 * sum(one.dead_time_s > 0 for one in shapes) <= len(steps):
        return 0.0
    shapes = [one for one in shapes if one.dead_time_s > 0]
    weights = [(one.change / (one.tau1 * max(one.rmse, 1e-12 * abs(one.change)))) ** 2 for one in shapes]
    return float(np.average([one.dead_time_s for one in shapes], weights=weights))


def starts_late(step: LevelStep, share: float) -> bool:
    """Whether a dead time saves a good part of what a step's best curve without one leaves."""
    points = averaged(step.time_s, step.output - step.start)
    left = [_left(points, delays, share) for delays in ([0.0], delays_tried(points))]
    return left[1] < (1 - SAVED) ** 2 * left[0]


def _left(points: AveragedRecord, delays: Sequence[float], share: float) -> float:
    """Least squares of one or two exponentials on a grid."""
    found = starts_of(points, float(points.time_s[-1]), delays, share, ("one", "two"))
    places = [p for starts in found.values() for p in starts]
    sums = [float(points.weight @ (points.output - curve(p, points.time_s)) ** 2) for p in places]
    return min(sums, default=np.inf) + points.within


def behind(stepset: StepSet, dead_time_s: float) -> StepSet:
    """The set as it is seen from where its inputs act: each level and release from its dead time on."""
    if dead_time_s <= 0:
        return stepset
    levels, releases = (tuple(_later(one, dead_time_s) for one in part) for part in (stepset.levels, stepset.releases))
    return replace(stepset, levels=levels, releases=releases)


def _later(level: Level, dead_time_s: float) -> Level:
    kept = level.time_s >= dead_time_s
    return replace(level, time_s=level.time_s[kept] - dead_time_s, runs=level.runs[:, kept])
