"""What the steps before have left when a step from rest begins, as the plant tells it: taken off where it matters.

    y  ←  y − Σ x_i e^(−t/τ_i) + Σ m_i

x are the plant's states at the step, from its input since the log began; m is the mean of each over the rest that the
step is counted from. A high level leaves a good part of a low one's output. τ1(u), τ2(u) and T_s are fitted with x as
it is, whose fall tells τ as well, then x is found anew, until it stays as it is.

Falls that end before the output has are fitted with the states from which they began and the idle output of their log:
only their time constants are unknown, and the gain of each.
"""

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, TypeAlias

import numpy as np
from scipy.optimize import least_squares

from eaid.arrays import Array, best_gain
from eaid.estimate.data import Data, data_of
from eaid.estimate.spread import standard_errors
from eaid.levels.release import LEFT_SAVES
from eaid.plant.dynamics import Plant, plant_numbers, plant_pull, plant_step
from eaid.plant.respond import at_rest, left_of_start
from eaid.results.fit import Fit
from eaid.results.models import Release
from eaid.results.plant import with_release
from eaid.shapes.each_step import mean_before
from eaid.steps.stepset import Level, LevelStep, StepSet

OFF_REST = 0.02  # Part of its change by which the output at a step's begin is off the rest its log began with
TAIL_MATTERS = 0.003  # Part of its level's output by which a tail moves a step, from which all are taken off
TAILS_SETTLED = 1e-4  # The same, by which those of two rounds may differ
SETTLE_ROUNDS, FARTHEST_BACK = 25, (-4.0, 0.9)  # And, as a part of the last step, how far a secant may lead on or back
FALL_ROWS = 200  # Rows of a fall, denser at its begin, by which its time constants are found


class At(NamedTuple):
    """A step of a log, and where the plant is when it comes."""

    step: LevelStep
    tail: Array
    idle: float  # The log's output at rest, from which its first step is counted


@dataclass(frozen=True, eq=False)
class Falls:
    """What falls have of their own, and the same moved by one standard error in independent ways."""

    release: Release | None
    moved: tuple[Release, ...] = ()


# What the steps before have left of each state at a step from rest, and in the mean over the rest that it is counted
# from, (2, 2), by its level and the name of its run
Tails: TypeAlias = dict[tuple[float, str], Array]


def tails_of(tails: Tails, level: Level) -> Array:
    """Those of a level's runs, (R, 2, 2); 0 where a run has none."""
    return np.array([tails.get((level.level, name), np.zeros((2, 2))) for name in level.names])


def follow_logs(plant: Plant, stepset: StepSet) -> Iterator[At]:
    """The steps of each log in their order, and the states of the plant at each."""
    numbers = plant_numbers(plant)
    order = sorted(stepset.level_steps, key=lambda one: (one.source, one.at_s))
    for _, of_log in itertools.groupby(order, key=lambda one: one.source):
        x, u, left, since_s, rests = (0.0, 0.0), 0.0, 0.0, 0.0, dict[float, Array]()
        for step in of_log:
            acting = at_rest(numbers, left) if u == 0 else numbers
            x = plant_step(acting, *x, u, step.at_s - since_s)
            part = [mean_before(step.rest_s or 0.0, tau) for tau in plant_pull(acting, *x, 0.0)[2:]]
            # a rest that still moved is not taken, but that of a step before
            means = rests.setdefault(step.start, np.array(x) * part) if step.from_level == 0 else np.zeros(2)
            yield At(step, np.array([x, means]), next(iter(rests), step.start))
            u, left, since_s = step.level, step.from_level, step.at_s


def begin_off_rest(stepset: StepSet) -> bool:
    """Whether outputs are farther off the rest that their log began with than they should be, where steps begin."""
    first: dict[str, float] = {}
    for step in sorted((one for one in stepset.level_steps if one.from_level == 0), key=lambda one: one.at_s):
        if abs(step.start - first.setdefault(step.source, step.start)) > OFF_REST * abs(step.change):
            return True
    return False


def find_tails(plant: Plant, stepset: StepSet) -> Tails:
    """The tails of the steps from rest."""
    every = follow_logs(plant, stepset)
    return {(at.step.level, at.step.name): at.tail for at in every if at.step.from_level == 0}


def take_off_tails(stepset: StepSet, plant: Plant, tails: Tails) -> StepSet:
    """The set as if each of its steps had begun at rest, and the falls behind them; its idle slopes are those of
    tails."""
    numbers, fallen = plant_numbers(plant), _tails_of_falls(stepset, plant, tails)

    def taken(level: Level, of: Tails, left: Array) -> Level:
        pairs = zip(level.runs, tails_of(of, level), strict=True)
        return replace(level, runs=np.array([run - states @ left + means.sum() for run, (states, means) in pairs]))

    levels = tuple(taken(one, tails, left_of_start(numbers, one.level, one.time_s)) for one in stepset.levels)
    releases = tuple(
        taken(one, fallen, left_of_start(at_rest(numbers, one.level), 0.0, one.time_s, (True, True)))
        for one in stepset.releases
    )
    rows = tuple(replace(run, idle_slope=None) for run in stepset.runs)
    return replace(stepset, levels=levels, releases=releases, runs=rows)


def _tails_of_falls(stepset: StepSet, plant: Plant, tails: Tails) -> Tails:
    """What tails of steps have become when their holds end, by the level that was held and the name of the fall."""
    numbers, found = plant_numbers(plant), Tails()
    order = sorted(stepset.level_steps, key=lambda one: (one.source, one.at_s))
    for rise, fall in itertools.pairwise(order):
        tail = tails.get((rise.level, rise.name))
        if tail is not None and fall.source == rise.source and fall.level == 0:
            left = left_of_start(numbers, rise.level, np.array([fall.at_s - rise.at_s]))[:, 0]
            found[rise.level, fall.name] = tail * [left, [1.0, 1.0]]
    return found


def data_on_tails(levels: Sequence[Level], tails: Tails, moved: Sequence[Tails] = ()) -> Data:
    """The mean curves of levels as they were recorded, above the output at rest, with the states they begin from, and
    those that errors of these make."""
    offsets = [tails_of(tails, one)[:, 1].sum(axis=1, keepdims=True) for one in levels]
    data = data_of([replace(one, runs=one.runs + off) for one, off in zip(levels, offsets, strict=True)])

    def begins(of: Tails) -> Array:
        return np.array([tails_of(of, one)[:, 0].mean(axis=0) for one in levels]).T

    states, off = begins(tails), np.array([begins(one) for one in moved]).reshape(-1, 2, len(levels))
    return replace(data, compressed=replace(data.points, states=states, off=off - states if len(moved) else None))


def as_fitted(stepset: StepSet, fit: Fit) -> StepSet:
    """Steps without the creep, and the tails, that their fit is without."""
    if (creep := fit.data.creep) is not None:
        stepset = stepset.without_creep(creep.rate, creep.t0_s, creep.in_proportion)
    return take_off_tails(stepset, fit.plant, find_tails(fit.plant, stepset)) if fit.on_tails else stepset


def largest_part(stepset: StepSet, tails: Tails, supposed: Tails | None = None) -> tuple[float, float]:
    """By which part of its level's output a tail moves a step most, beyond one that was supposed, and the level."""
    parts = [(0.0, 0.0)]
    for level in stepset.levels:
        size = max(float(np.abs(level.mean).max()), 1e-300)
        moved = tails_of(tails, level)[:, 0] - tails_of(supposed or {}, level)[:, 0]
        parts.append((float(np.abs(moved).sum(axis=1).max()) / size, level.level))
    return max(parts)


def are_sound(stepset: StepSet, tails: Tails) -> bool:
    """Whether tails are finite, and below the highest output, of which a low level may begin on a good part."""
    highest = max(float(np.abs(level.mean).max()) for level in stepset.levels)
    return all(bool(np.abs(one).sum(axis=1).max() < highest) for one in tails.values())


def settle_tails(
    stepset: StepSet, plant: Plant, release: Release | None, refit: Callable[[Tails, StepSet], Plant]
) -> tuple[Tails, Plant, Falls]:
    """The tails of steps, their plant and its release, each of which gives the others, begun at some; `refit` gives the
    plant of steps with tails, and without them. Rounds that run away end at the last that did not."""
    supposed, rounds, falls = find_tails(plant, stepset), list[tuple[Tails, Tails]](), Falls(release)
    settled = supposed, plant, falls
    for _ in range(SETTLE_ROUNDS):
        plant = refit(supposed, take_off_tails(stepset, plant, supposed))
        falls = release_behind_tails(plant, stepset, falls.release)
        plant = with_release(plant, falls.release)
        found = find_tails(plant, stepset)
        if not are_sound(stepset, found):
            break
        settled = found, plant, falls
        if largest_part(stepset, found, supposed)[0] < TAILS_SETTLED:
            break
        rounds = [*rounds[-1:], (supposed, found)]
        supposed = _go_on(rounds)
    return settled


def _go_on(rounds: Sequence[tuple[Tails, Tails]]) -> Tails:
    """Tails to suppose next by those that were, and those that were found with them: by the secant through two rounds
    (Anderson), for they may go to and fro about what they settle to."""
    now = rounds[-1][1]
    if len(rounds) < 2:
        return now
    (x0, g0), (x, g) = ([np.array([tails[key] for key in now]) for tails in one] for one in rounds)
    left, change = g - x, (g - x) - (g0 - x0)
    back = float(np.vdot(left, change)) / max(float(np.vdot(change, change)), 1e-300)
    return dict(zip(now, g - np.clip(back, *FARTHEST_BACK) * (g - g0), strict=True))


def release_behind_tails(plant: Plant, stepset: StepSet, release: Release | None) -> Falls:
    """The release of a plant from the whole course of the logs, begun at what single falls tell; itself where there is
    none. How sure it is follows from what each fall leaves (sandwich)."""
    if release is None:
        return Falls(None)
    falls = [one for one in follow_logs(with_release(plant, release), stepset) if one.step.level == 0]
    if not falls:
        return Falls(release)
    rows = [np.unique(np.geomspace(1, len(one.step.output), FALL_ROWS).astype(int)) - 1 for one in falls]

    def left(logs: Array, as_left: bool = False) -> Array:
        """What a release, ln τ, (2,), leaves of the falls, as parts of their sizes."""
        tau1, tau2 = np.exp(logs).tolist()
        numbers, found = plant_numbers(replace(plant, release=(tau1, tau2), release_as_left=as_left)), []
        for one, at in zip(falls, rows, strict=True):
            y = one.step.output[at] - one.idle
            acting = at_rest(numbers, one.step.from_level)
            f = one.tail[0] @ left_of_start(acting, 0.0, one.step.time_s[at], (True, True))
            found.append((y - best_gain(f, y) * f) / float(np.abs(y).max()))
        return np.concatenate(found)

    of_fall = np.repeat(np.arange(len(falls)), [len(at) for at in rows])

    begin = np.log([release.tau1, release.tau2])
    own, end = left(begin, as_left=True), least_squares(left, begin)
    as_left = float(own @ own) < (1 - LEFT_SAVES) * 2 * float(end.cost)
    J = np.asarray(end.jac)
    of_falls = np.linalg.pinv(J.T @ J) @ [np.bincount(of_fall, weights=end.fun * slope) for slope in J.T]

    def at(logs: Array) -> Release:
        tau1, tau2 = np.exp(logs).tolist()
        return Release(tau1, tau2, plant.C, as_left=as_left)

    return Falls(at(end.x), tuple(at(end.x + one) for one in standard_errors(of_falls @ of_falls.T)))
