"""The dead time of steps from rest: one of all levels, behind which every model of them begins; below 0 where their
input was noted late.

Looked for on the first rise to each level, on a grid with the sizes solved for; where it saves a good part of what is
left at most levels, each of these steps is fitted with a dead time of its own (`shape.py`), and the plant's is their
mean, each weighed by how sharply its output leaves rest: (change/(τ1 · RMSE))².

Where none is found so, the rises are extrapolated to their start: of every run y = A (1 − e^(−(t − θ)/τ)) is fitted to
the rows between 10 and 40 % of its held output, and θ is the mean of all, weighed by (A/(τ · RMSE))². One of half a row
and a hundredth of τ or more that the runs' scatter does not explain is taken where most steps are explained as well
behind it. An input that is sampled is noted half a row late in the mean, where the sampler does not drive it: where a
row is a good part of the rise, a start of a quarter of a row and more before the input is taken so, too.

Noise hides both. Where the mean curves of the levels tell of a dead time beyond their noise, or the rises' starts do,
and two exponentials leave nothing but noise of these curves, θ is that of their least sum of squares, and each run
says how far it alone would move it.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import minimize_scalar

from eaid.arrays import Array, inverse, median, white_squares
from eaid.estimate.spread import t_quantile
from eaid.findings import Finding, finding
from eaid.options import FitOptions
from eaid.plant.dynamics import SHARE
from eaid.plant.steps import decay
from eaid.results.common import Interval
from eaid.results.models import StepShape
from eaid.shapes.curves import AveragedRecord, average_record, delays_tried, slopes, starts_of, step_curve
from eaid.shapes.shape import FREE, SHAPES_SETTLED, WHITE, fit_step, independent_samples, refuse_longer, solve_least
from eaid.steps.step import moving_means, usual_step
from eaid.steps.stepset import Level, LevelStep, StepSet

SAVED = 0.1  # Part of the RMSE that a dead time has to save at a level
LEVELS_ASKED = 10  # Levels that are asked
START_ROWS, LEAST_LATE_PART = 0.5, 0.01  # Rows, and part of the time constant of the rise, from which a start is told
SAMPLED_ROWS = 0.25  # The same of an input noted late, which is so by half a row where it was sampled
MOST_LOST = 5.0  # Time constants of the rise, or a row, by which an input may be noted late
TOLD_WHOLE = 0.75  # From which on it is told as whole rows
COARSE_PART = 0.05  # Of the rise to half, from which a row is looked at for that
# By which the runs' scatter may explain it; where the input looks as if it was noted late, which is likelier
START_CHANCE, EARLY_CHANCE = 0.01, 0.05
LEAST_ROWS_BEHIND = 8  # Of a level or release behind its dead time
SURE_ROWS = 0.2  # Rows that the form of the curve leaves open
RISE_PART = (0.1, 0.4)  # Of the held output: the rise in between leads to its start
FEWEST_ROWS, RISE_TAUS = 6, 30
START_NOISE = 0.02  # Of the held output: noise that is larger is averaged before a rise's rows are looked for
SECOND_SAVES = 8.0  # Squares over the noise's by which a second exponential has to leave less of a level
HARDLY_ANY = 0.1  # Part of the next that the larger half of the levels has, below which the others are not asked
LATE_EVIDENCE = 30.0  # Twice the logarithm of the likelihood that noise alone hardly makes of a dead time
# Levels whose dead times tell a ramp, by what factor these differ, and squares about it over those about their mean
FEWEST_RAMPS, RAMPS_APART, RAMP_PART = 3, 1.5, 0.2
ENDS_PART = 0.1  # Of holds, that is not looked at where their input was noted late
# Dead times tried, from so much before the step, as a part of the latest; from earlier where the earliest is the best
CURVES_TRIED, EARLIEST = 9, (0.5, 2.0, 8.0, 32.0)


class Begin(NamedTuple):
    """Where the steps of a set begin, behind a dead time [s]; below 0 their inputs were noted late."""

    dead_time_s: float = 0.0
    ends: Interval = None
    findings: tuple[Finding, ...] = ()


def dead_time_of(stepset: StepSet, options: FitOptions) -> Begin:
    """The dead time of a set's steps, as given or as most levels show it; none where they show none."""
    if (given := options.held_dead_time_s) is not None:
        for level in stepset.levels:
            refuse_longer(given, level.names[0], level.time_s[-1])
        return Begin(given)
    rises = {step.level: step for step in reversed(stepset.level_steps) if step.edge == "up" and step.from_level == 0}
    steps = [rises[level] for level in sorted(rises)]
    steps = steps[:: 1 + (len(steps) - 1) // LEVELS_ASKED] if steps else []
    share = options.held_share or SHARE
    late = [step for step in steps if starts_late(step, share)]
    if 2 * len(late) > len(steps) and (by_shapes := find_by_shapes(late, stepset, options, len(steps))) is not None:
        return by_shapes
    found = find_by_rises(stepset)
    theta_s = found.dead_time_s
    levels = stepset.levels[:: 1 + (len(stepset.levels) - 1) // LEVELS_ASKED] if stepset.levels else ()
    law = DelayedLaw("free", share) if options.held_share in (None, SHARE) else DelayedLaw("two", share)
    early = theta_s < 0 or (not theta_s and (risen_when_noted(levels) or sampled_coarsely(levels)))
    if theta_s or early or are_late(levels, law):
        # of an input noted late, holds end as much before their noted end
        whole = [one.ended(ENDS_PART * float(one.time_s[-1])) if early else one for one in levels]
        by_curves = find_by_cost(whole, law, white=not early)
        if by_curves is not None and (by_curves.dead_time_s < 0 or not early):
            return by_curves
    better = sum(begins_late(step, theta_s, replace(options, shape=law.shape)) for step in steps) if theta_s else 0
    return found if not steps or 2 * better > len(steps) else Begin()


def find_by_shapes(late: Sequence[LevelStep], stepset: StepSet, options: FitOptions, asked: int) -> Begin | None:
    """The dead time of the steps that start late by their best shapes; None where most of those `asked` have none."""
    shapes = [fit_step(step, replace(options, shape="auto")) for step in late]
    shapes = [one for one in shapes if one.dead_time_s > 0]
    if 2 * len(shapes) <= asked:
        return None
    weight = np.array([(one.change / (one.tau1 * max(one.rmse, 1e-12 * abs(one.change)))) ** 2 for one in shapes])
    theta_s, reach = _mean(np.array([one.dead_time_s for one in shapes]), weight, stepset.levels)
    begin = _begin_late(theta_s, reach if len(shapes) > 1 else None)
    return begin._replace(findings=(*begin.findings, *find_ramps(shapes, stepset.input_unit)))


def find_ramps(shapes: Sequence[StepShape], unit: str) -> list[Finding]:
    """Said where dead times grow with the level as half the ramp of a drive does, θ = u/(2 rate), better by far than as
    one that all have."""
    u, theta = (np.array([getattr(one, name) for one in shapes]) for name in ("level", "dead_time_s"))
    slope = float(u @ theta) / float(u @ u)
    apart, about = float(((theta - theta.mean()) ** 2).sum()), float(((theta - slope * u) ** 2).sum())
    least, most = int(np.argmin(u)), int(np.argmax(u))
    if len(shapes) < FEWEST_RAMPS or theta[most] < RAMPS_APART * theta[least] or about > RAMP_PART * apart:
        return []
    ends = {"least": float(u[least]), "most": float(u[most])}
    ends |= {"least_s": float(theta[least]), "most_s": float(theta[most]), "rate": 0.5 / slope}
    return [finding("dead-time-grows", "steps", u.tolist(), unit=unit, **ends)]


def _begin_late(theta_s: float, reach: float | None) -> Begin:
    """A dead time, known to so much where that is known."""
    ends = None if reach is None else (max(theta_s - reach, 0.0), theta_s + reach)
    known: dict[str, Any] = {} if ends is None else {"low": ends[0], "high": ends[1]}
    return Begin(theta_s, ends, (finding("dead-time", "steps", dead_time_s=theta_s, **known),))


def _mean(theta: Array, weight: Array, levels: Sequence[Level], chance: float = START_CHANCE) -> tuple[float, float]:
    """The weighed mean of starts, and how far by their scatter it may be off."""
    mean, total = float(np.average(theta, weights=weight)), float(weight.sum())
    sd = float(np.sqrt(((weight * (theta - mean)) ** 2).sum())) / total
    return mean, float(np.hypot(t_quantile(len(theta) - 1.0, 1 - chance) * sd, SURE_ROWS * usual_row_s(levels)))


def usual_row_s(levels: Sequence[Level]) -> float:
    """The usual time between two rows [s]."""
    return median(np.array([usual_step(level.time_s) for level in levels]))


def risen_when_noted(levels: Sequence[Level]) -> bool:
    """Whether the outputs of most runs have risen by a good part when their input is noted."""
    off = [float(run[0]) > RISE_PART[0] * float(run.max()) for level in levels for run in level.runs]
    return 2 * sum(off) > len(off)


def sampled_coarsely(levels: Sequence[Level]) -> bool:
    """Whether a row is a good part of the rise to half: an input that is sampled is noted half a row late in the mean,
    where the sampler does not drive it."""
    parts = []
    for level in levels:
        over = np.flatnonzero(level.mean >= 0.5 * level.mean[-1])
        parts += [usual_step(level.time_s) / float(level.time_s[over[0]])] if len(over) and over[0] else [np.inf]
    return len(parts) > 1 and median(parts) > COARSE_PART


def find_by_rises(stepset: StepSet) -> Begin:
    """How late the rises begin, by the curves that lead to them; below 0: before their input is noted."""
    starts = [(level.time_s, run) for level in stepset.levels for run in level.runs]
    found = np.array([one for time_s, run in starts if (one := _start_of(time_s, run)) is not None])
    if len(found) < max(2, len(starts) / 2):
        return Begin()
    return _judge_starts(found, stepset.levels)


def _judge_starts(found: Array, levels: Sequence[Level], chance: float = START_CHANCE) -> Begin:
    """The mean of rows of dead time, weight and time constant, (n, 3); 0 where scatter or the rows explain it."""
    theta, weight, tau = found.T
    (mean, reach), row_s = _mean(theta, weight, levels, chance), usual_row_s(levels)
    least_rows = START_ROWS if mean > 0 else SAMPLED_ROWS
    lost = -mean > max(MOST_LOST * median(tau), row_s)  # of a rise that began so early none is left to tell it
    if abs(mean) < max(least_rows * row_s, LEAST_LATE_PART * median(tau), reach) or lost:
        return Begin()
    if mean > 0:
        return _begin_late(mean, reach)
    rows, ms = -mean / row_s, -1e3 * mean
    rows = max(1, round(rows)) if rows > TOLD_WHOLE else round(rows, 1)
    late = finding("input-late", "steps", rows=rows, ms=ms, low=ms - 1e3 * reach, high=ms + 1e3 * reach)
    return Begin(mean, findings=(late,))


class DelayedLaw(NamedTuple):
    """Two exponentials: with C held at a share, or free where no user holds it, for a wrong C hides a dead time."""

    shape: str
    share: float


ONE = DelayedLaw("one", 1.0)


def are_late(levels: Sequence[Level], law: DelayedLaw) -> bool:
    """Whether levels' mean curves ask for a dead time: the larger half of them, and the others where those leave it
    open."""
    order = sorted(levels, key=lambda level: -float(np.abs(level.mean).max()))
    half = (len(order) + 1) // 2
    found = sum(evidence(level, law) for level in order[:half])
    if found >= HARDLY_ANY * LATE_EVIDENCE:
        found += sum(evidence(level, law) for level in order[half:])
    return found > LATE_EVIDENCE


def evidence(level: Level, law: DelayedLaw) -> float:
    """By how much the logarithm of the likelihood of a level's mean curve grows with a dead time, twice."""
    points = average_record(level.time_s, level.mean)
    plain, late = (_fit_curves(points, delays, law) for delays in ([0.0], delays_tried(points)))
    if plain is None or late is None or not 0 < late[1] < plain[1]:
        return 0.0
    return independent_samples(level.mean - step_curve(late[0], level.time_s)) * float(np.log(plain[1] / late[1]))


def _fit_curves(points: AveragedRecord, delays: Sequence[float], law: DelayedLaw) -> tuple[Array, float] | None:
    """Two exponentials from the best of some dead times, and what they leave; None: no place on the grid."""
    starts = starts_of(points, float(points.time_s[-1]), delays, law.share, (law.shape,))[law.shape]
    if not starts:
        return None
    ends = (solve_least(points, p, law.shape, FREE[law.shape], SHAPES_SETTLED) for p in starts)
    p, left = min(ends, key=lambda end: end[1])
    return p, left + points.within


def find_by_cost(levels: Sequence[Level], law: DelayedLaw, white: bool) -> Begin | None:
    """The dead time behind which a law leaves least of the levels' mean curves, or one exponential that leaves no more;
    None where they leave more than `white` noise, if that is asked for: a rise that began before its input has lost its
    begin, and the whole curve tells more whatever its noise is."""
    points = [average_record(level.time_s, level.mean) for level in levels]
    fits = [_fit_curves(one, [0.0, *delays_tried(one)], law) for one in points]
    near = [found[0] for found in fits if found is not None]
    if len(near) < len(fits):
        return None
    noise = [_noise(level.mean - step_curve(p, level.time_s)) for level, p in zip(levels, near, strict=True)]
    cost, near = _least_late(points, near, noise, law.shape)
    shape, alone = law.shape, [_fit_curves(one, [float(p[4])], ONE) for one, p in zip(points, near, strict=True)]
    ones = [found[0] for found in alone if found is not None]
    if len(ones) == len(levels):
        of_one, ones = _least_late(points, ones, noise, ONE.shape)
        if of_one < cost + SECOND_SAVES * len(levels):  # a second one makes a jump of the start
            shape, near = ONE.shape, ones
    found, count = [], 0
    for level, p in zip(levels, near, strict=True):
        curve, J = step_curve(p, level.time_s), slopes(p, level.time_s)[:, [*FREE[shape], 4]]
        count += independent_samples(level.mean - curve) > WHITE * len(curve)
        unit = inverse(J.T @ J)
        for run in level.runs:
            shift, spread = float((unit @ (J.T @ (run - curve)))[-1]), float(unit[-1, -1]) * _noise(run - curve)
            found.append((float(p[4]) + shift, 1 / max(spread, 1e-300), float(np.exp(p[1]))))
    if len(found) < 2 or (white and 2 * count <= len(levels)):
        return None
    return _judge_starts(np.array(found), levels, START_CHANCE if white else EARLY_CHANCE)


def _least_late(
    points: Sequence[AveragedRecord], near: Sequence[Array], noise: Sequence[float], shape: str
) -> tuple[float, list[Array]]:
    """What a shape leaves of the levels over their noise behind the dead time that is best for all, and their places
    there."""

    def ends(theta: float) -> list[tuple[Array, float]]:  # always from there: far off, a curve ends elsewhere
        begin = [np.append(p[:4], theta) for p in near]
        pairs = zip(points, begin, strict=True)
        return [solve_least(one, p, shape, FREE[shape], SHAPES_SETTLED) for one, p in pairs]

    def cost(theta: float) -> float:
        each = zip(ends(theta), points, noise, strict=True)
        return sum((square + one.within) / size for (_, square), one, size in each)

    latest = max(delays_tried(one)[-1] for one in points)
    for earliest in EARLIEST:
        tried = np.linspace(-earliest * latest, latest, CURVES_TRIED)
        at = int(np.argmin([cost(theta) for theta in tried.tolist()]))
        if at:
            break
    between = tried[max(at - 1, 0)], tried[min(at + 1, CURVES_TRIED - 1)]
    best = minimize_scalar(cost, bounds=between, method="bounded", options={"xatol": 1e-3 * latest})
    return float(best.fun), [p for p, _ in ends(float(best.x))]


def _noise(left: Array) -> float:
    """Variance of white noise by the differences of neighbours."""
    return max(white_squares(left) / len(left), 1e-300)


def _start_of(time_s: Array, run: Array) -> tuple[float, float, float] | None:
    """Where a rise begins by an exponential through its first part, its weight and its τ [s]; None: too short."""
    held = float(run[-max(1, len(run) // 10) :].mean())
    noise = _noise(run) / max((START_NOISE * held) ** 2, 1e-300)
    smooth = moving_means(run[None], max(1, len(run) // 500, min(int(noise), len(run) // 50)))[0]
    over = np.flatnonzero(smooth >= RISE_PART[1] * held)
    last = int(over[0]) if held > 0 and len(over) else 0
    rows = np.flatnonzero((smooth if noise > 1 else run)[:last] < RISE_PART[0] * held)
    first = int(rows[-1]) + 1 if len(rows) else 0
    if last - first < FEWEST_ROWS:
        return None
    t, y = time_s[first:last], run[first:last]
    tau = (t[-1] - t[0]) * np.geomspace(0.3, 30, RISE_TAUS)
    fallen = decay(t - t[0], tau[:, None])  # y = a + b fallen, for each τ
    means, off = fallen.mean(axis=1), y - y.mean()
    fallen -= means[:, None]
    b = fallen @ off / (fallen**2).sum(axis=1)
    a = y.mean() - b * means
    square = ((off - b[:, None] * fallen) ** 2).sum(axis=1)
    square[(a <= 0) | (b >= 0)] = np.inf
    k = int(square.argmin())
    if not np.isfinite(square[k]):
        return None
    theta, per = t[0] + tau[k] * float(np.log(-b[k] / a[k])), (tau[k] / a[k]) ** 2
    return theta, len(t) / max(float(square[k] * per), 1e-300), float(tau[k])


def starts_late(step: LevelStep, share: float) -> bool:
    """Whether a dead time saves a good part of what a step's best curve without one leaves."""
    points = average_record(step.time_s, step.output - step.start)
    plain, less = (_left(points, delays, share) for delays in ([0.0], delays_tried(points)))
    return less < (1 - SAVED) ** 2 * plain


def begins_late(step: LevelStep, theta_s: float, options: FitOptions) -> bool:
    """Whether a shape from a dead time on leaves no more of a step, in the mean, than from its own start."""
    plain, kept = replace(options, dead_time=0.0), step.time_s >= theta_s
    later = replace(step, time_s=step.time_s[kept] - theta_s, output=step.output[kept])
    return fit_step(later, plain).rmse <= fit_step(step, plain).rmse


def _left(points: AveragedRecord, delays: Sequence[float], share: float) -> float:
    """Least squares of one or two exponentials on a grid."""
    found = starts_of(points, float(points.time_s[-1]), delays, share, ("one", "two"))
    places = [p for starts in found.values() for p in starts]
    sums = [float(points.weight @ (points.output - step_curve(p, points.time_s)) ** 2) for p in places]
    return min(sums, default=np.inf) + points.within


def cut_behind(stepset: StepSet, dead_time_s: float) -> StepSet:
    """The set as it is seen from where its inputs act: each level and release from its dead time on."""
    if dead_time_s == 0:
        return stepset
    parts = ((_cut_later(one, dead_time_s) for one in part) for part in (stepset.levels, stepset.releases))
    levels, releases = (tuple(one for one in part if len(one.time_s) >= LEAST_ROWS_BEHIND) for part in parts)
    return replace(stepset, levels=levels, releases=releases)


def _cut_later(level: Level, dead_time_s: float) -> Level:
    kept = level.time_s >= dead_time_s
    return replace(level, time_s=level.time_s[kept] - dead_time_s, runs=level.runs[:, kept])
