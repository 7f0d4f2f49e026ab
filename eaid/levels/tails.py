"""What the steps before have left when a step from rest begins, as the plant tells it: taken off where it matters.

    y  ←  y − Σ x_i e^(−t/τ_i) + Σ m_i

x are the plant's states at the step, from its input since the log began; m is the mean of each over the rest that the
step is counted from. A high level leaves a good part of a low one's output. The plant is then fitted to what is left,
and so on until the tails stay as they are.

Falls that end before the output has are fitted with the states from which they began and the idle output of their log:
only their time constants are unknown, and the gain of each.
"""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple, TypeAlias

import numpy as np
from scipy.optimize import least_squares

from eaid.arrays import Array, best_gain
from eaid.levels.release import LEFT_SAVES
from eaid.plant.dynamics import Plant, plant_numbers, plant_pull, plant_step
from eaid.plant.respond import at_rest
from eaid.plant.steps import decay
from eaid.results.fit import Fit
from eaid.results.models import Release
from eaid.results.plant import with_release
from eaid.shapes.intervals import mean_before
from eaid.steps.stepset import Level, LevelStep, StepSet

MATTERS = 0.003  # Part of its level's output by which a tail moves a step, from which all are taken off
SETTLED = 1e-4  # The same, by which those of two rounds may differ
ROUNDS = 25
FALL_ROWS = 200  # Rows of a fall, denser at its begin, by which its time constants are found


class At(NamedTuple):
    """A step of a log, and where the plant is when it comes."""

    step: LevelStep
    states: tuple[float, float]
    taus: tuple[float, float]  # With which they fall before it [s], of a step from rest
    idle: float  # The log's output at rest, from which its first step is counted
    own_rest: bool  # Whether the step is counted from the rest before it: one that still moved is not taken


@dataclass(frozen=True, eq=False)
class Tail:
    """What the steps before have left of each state."""

    states: Array  # At the step, (2,)
    means: Array  # Over the rest that the step is counted from, (2,)


Tails: TypeAlias = dict[tuple[float, str], Tail]  # By the level of a step from rest, and the name of its run


def follow_logs(plant: Plant, stepset: StepSet) -> Iterator[At]:
    """The steps of each log in their order, and the states of the plant at each."""
    numbers = plant_numbers(plant)
    order = sorted(stepset.level_steps, key=lambda one: (one.source, one.at_s))
    for _, of_log in itertools.groupby(order, key=lambda one: one.source):
        x, u, left, since_s, starts = (0.0, 0.0), 0.0, 0.0, 0.0, list[float]()
        for step in of_log:
            acting = at_rest(numbers, left) if u == 0 else numbers
            x = plant_step(acting, *x, u, step.at_s - since_s)
            own_rest = step.from_level == 0 and step.start not in starts
            starts += [step.start] if own_rest else []
            yield At(step, x, plant_pull(acting, *x, 0.0)[2:], (starts or [step.start])[0], own_rest)
            u, left, since_s = step.level, step.from_level, step.at_s


def find_tails(plant: Plant, stepset: StepSet) -> Tails:
    """The tails of the steps from rest."""
    found = Tails()
    for step, x, taus, _, own_rest in follow_logs(plant, stepset):
        if step.from_level == 0:
            part = [mean_before(step.rest_s or 0.0, tau) if own_rest else 0.0 for tau in taus]
            found[step.level, step.name] = Tail(np.array(x), np.array(x) * part)
    return found


def take_off_tails(stepset: StepSet, plant: Plant, tails: Tails) -> StepSet:
    """The set as if each of its steps had begun at rest; its idle slopes are those of tails."""

    def taken(level: Level) -> Level:
        fallen = np.stack([decay(level.time_s, tau.item()) for tau in plant.time_constants(level.level)])
        of_runs = [tails.get((level.level, name)) for name in level.names]
        runs = [
            run if one is None else run - one.states @ fallen + one.means.sum()
            for run, one in zip(level.runs, of_runs, strict=True)
        ]
        return replace(level, runs=np.array(runs))

    rows = tuple(replace(run, idle_slope=None) for run in stepset.runs)
    return replace(stepset, levels=tuple(map(taken, stepset.levels)), runs=rows)


def as_fitted(stepset: StepSet, fit: Fit) -> StepSet:
    """Steps without the creep, and the tails, that their fit is without."""
    if (creep := fit.data.creep) is not None:
        stepset = stepset.without_creep(creep.rate, creep.t0_s)
    return take_off_tails(stepset, fit.plant, find_tails(fit.plant, stepset)) if fit.on_tails else stepset


def largest_part(stepset: StepSet, tails: Tails, before: Tails) -> tuple[float, float]:
    """By which part of its level's output a tail moves a step most, beyond one `before`, and the level."""
    parts = [(0.0, 0.0)]
    for level in stepset.levels:
        size = max(float(np.abs(level.mean).max()), 1e-300)
        for key in ((level.level, name) for name in level.names):
            moved = tails[key].states - (before[key].states if key in before else 0.0) if key in tails else np.zeros(2)
            parts.append((float(np.abs(moved).sum()) / size, level.level))
    return max(parts)


def release_behind_tails(plant: Plant, stepset: StepSet, release: Release | None) -> Release | None:
    """The release of a plant from the whole course of the logs, begun at what single falls tell; itself where there is
    none."""
    if release is None:
        return None
    falls = [one for one in follow_logs(with_release(plant, release), stepset) if one.step.level == 0]
    if not falls:
        return release
    rows = [np.unique(np.geomspace(1, len(one.step.output), FALL_ROWS).astype(int)) - 1 for one in falls]
    own = np.array([[tau.item() for tau in plant.time_constants(one.step.from_level)] for one in falls])

    def left(taus: Array) -> Array:
        """What time constants of each fall, (n, 2), leave of them, as parts of their sizes."""
        found = []
        for one, at, both in zip(falls, rows, taus.tolist(), strict=True):
            y = one.step.output[at] - one.idle
            f = np.array(one.states) @ np.stack([decay(one.step.time_s[at], tau) for tau in both])
            found.append((y - best_gain(f, y) * f) / float(np.abs(y).max()))
        return np.concatenate(found)

    def left_by_two(logs: Array) -> Array:
        return left(np.tile(np.exp(logs), (len(falls), 1)))

    end = least_squares(left_by_two, np.log([release.tau1, release.tau2]))
    as_left = float(np.sum(left(own) ** 2)) < (1 - LEFT_SAVES) * 2 * float(end.cost)
    tau1, tau2 = np.exp(end.x).tolist()
    return Release(tau1, tau2, plant.C, as_left=as_left)
