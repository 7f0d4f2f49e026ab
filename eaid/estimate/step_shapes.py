"""The shape of one step: y = start + change · s(t), with s one of four, each with or without a dead time θ.

With t' = max(t − θ, 0): one exponential, s = 1 − e^(−t'/τ1); two, s = 1 − C e^(−t'/τ1) − (1 − C) e^(−t'/τ2) with C held
(the paper's eq. (4)), free between 0 and 1, or beyond 1: a slow part that decays, an overshoot. Which of them is chosen
by AICc with the number of independent samples; the paper's form stands unless another is better by `BETTER`.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import msgspec
import numpy as np

from eaid.arrays import Array, inverse
from eaid.errors import UsageError
from eaid.estimate.data import quality
from eaid.estimate.scatter import bartlett_variance
from eaid.estimate.solver import Problem, approach, polish, slsqp
from eaid.estimate.spread import t_quantile
from eaid.findings import Finding, finding
from eaid.options import FitOptions
from eaid.plant.dynamics import SHARE
from eaid.results.common import Interval
from eaid.results.fit import FrictionLevel, LevelIntervals, StepIntervals, StepShape
from eaid.steps.noise import block_means, block_noise
from eaid.steps.stepset import LevelStep, StepSet

SHAPES = ("one", "two", "free", "overshoot")
MOST = 3.0  # Largest C of an overshoot: beyond, two nearly equal parts of opposite sign imitate other shapes
APART = 2.0  # Least τ2/τ1 of an overshoot
SEEN = 0.02  # Share of its peak by which an overshoot has to come down within the record


def curve(p: Array, time_s: Array) -> Array:
    """change · s(t) of p = (change, ln τ1, ln(τ2/τ1), C, θ), shape (n,)."""
    after = np.maximum(time_s - p[4], 0.0)
    fast = np.exp(-after / np.exp(p[1]))
    slow = np.exp(-after / np.exp(p[1] + p[2])) if p[3] != 1.0 else 0.0
    return np.asarray(p[0] * (1.0 - p[3] * fast - (1.0 - p[3]) * slow))


def slopes(p: Array, time_s: Array) -> Array:
    """∂ curve / ∂p, shape (n, 5); where p is complex, its real part decides which samples lie behind the dead time."""
    behind = np.real(time_s - p[4]) > 0
    after = np.where(behind, time_s - p[4], 0.0)
    tau1, tau2 = np.exp(p[1]), np.exp(p[1] + p[2])
    fast, slow = np.exp(-after / tau1), np.exp(-after / tau2)
    by_fast, by_slow = p[3] * fast * after / tau1, (1 - p[3]) * slow * after / tau2
    by_time = np.where(behind, p[3] * fast / tau1 + (1 - p[3]) * slow / tau2, 0.0)
    return np.stack(
        (
            1.0 - p[3] * fast - (1 - p[3]) * slow,
            -p[0] * (by_fast + by_slow),
            -p[0] * by_slow,
            p[0] * (slow - fast),
            -p[0] * by_time,
        ),
        axis=1,
    )


def overshoots(p: Array, window: float) -> bool:
    """True where a curve passes its peak within the window, and is `SEEN` of its peak below it at the end."""
    at = np.linspace(p[4], window, 400)
    s = curve(np.array([1.0, *p[1:]]), at)
    return bool(s.max() - s[-1] > SEEN * s.max())


FEW = 800  # Points to which a record is averaged for the choice of a shape; the chosen one is fitted to all samples
GRID = 28
STARTS = 3
DELAYS = 20
LOOKED_AT = 300_000  # Half of the values of the curve that are worked out to find a dead time, at most
FAR = 1.0  # Distance in ln τ2 from which a start is another


@dataclass(frozen=True, eq=False)
class AveragedRecord:
    """A record averaged to fewer points: finely at first, then coarser."""

    time_s: Array
    output: Array
    weight: Array
    within: float = 0.0  # Sum of squares of the samples about the means that stand for them: no shape takes it away


def averaged(time_s: Array, y: Array) -> AveragedRecord:
    """A record as at most FEW means and what they leave out."""
    count = len(y)
    if count <= FEW:
        return AveragedRecord(time_s, y, np.ones(count))
    edges = np.unique(np.round(np.geomspace(1, count, FEW)).astype(np.intp)) - 1
    fine = np.linspace(0, count, FEW // 2).astype(np.intp)
    edges = np.unique(np.concatenate((edges, fine[:-1], [0])))
    edges = edges[edges < count]
    weight = np.diff(np.append(edges, count)).astype(np.float64)
    means = np.add.reduceat(y, edges) / weight
    within = max(0.0, float(y @ y - weight @ means**2))
    return AveragedRecord(np.add.reduceat(time_s, edges) / weight, means, weight, within)


def delays_tried(points: AveragedRecord) -> list[float]:
    """Shares of the time to half of the change [s]."""
    half = np.flatnonzero(np.abs(points.output) >= 0.5 * np.abs(points.output[-1]))
    until = float(points.time_s[half[0]]) if len(half) else float(points.time_s[-1]) / 4
    return [until * (k + 0.5) / DELAYS for k in range(DELAYS)]


def starts_of(
    points: AveragedRecord, window: float, delays: Sequence[float], share: float, wanted: Sequence[str]
) -> dict[str, list[Array]]:
    """The best places on a grid of time constants and dead times, for each shape; amplitudes are linear there."""
    stride = max(1, len(points.time_s) // 300)
    t, y, w = points.time_s[::stride], points.output[::stride], points.weight[::stride]
    shortest = max(window / 3000, float(np.diff(points.time_s[: max(2, len(t))]).min()) / 3)
    tau, each = np.geomspace(shortest, 5 * window, GRID), np.arange(GRID)
    pairs, total = np.triu_indices(GRID, 1), float(w @ y**2)
    places: dict[str, list[list[tuple[float, Array]]]] = {shape: [] for shape in wanted}
    for delay in delays:
        rises = -np.expm1(-np.maximum(t - delay, 0.0) / tau[:, np.newaxis])
        gram, right = (rises * w) @ rises.T, rises @ (w * y)
        one = np.diag(gram)
        for shape, rows in places.items():
            i, j = (each, each) if shape == "one" else pairs
            if shape in ("one", "two"):
                C = np.full(len(i), 1.0 if shape == "one" else share)
                size = C**2 * one[i] + 2 * C * (1 - C) * gram[i, j] + (1 - C) ** 2 * one[j]
                along = C * right[i] + (1 - C) * right[j]
                change = along / np.maximum(size, 1e-300)
                cost = total - change * along
            else:
                det = np.maximum(one[i] * one[j] - gram[i, j] ** 2, 1e-12 * one[i] * one[j])
                a = (one[j] * right[i] - gram[i, j] * right[j]) / det
                b = (one[i] * right[j] - gram[i, j] * right[i]) / det
                change = a + b
                C = a / np.where(change == 0, 1.0, change)
                cost = total - a * right[i] - b * right[j]
                inside = (C > 0) & (C < 1) if shape == "free" else (C > 1) & (C < MOST) & (tau[j] > APART * tau[i])
                cost = np.where(inside, cost, np.inf)
            best = _apart(cost, np.log(tau[j]))[: 1 if shape == "one" else None]
            p = np.stack([change, np.log(tau[i]), np.log(tau[j] / tau[i]), C, np.full(len(i), delay)], axis=1)
            rows.append([(float(cost[m]), p[m]) for m in best if np.isfinite(cost[m])])
    found = {}
    for shape, rows in places.items():  # of those delays whose neighbours have none as good
        least = [min((cost for cost, _ in row), default=np.inf) for row in rows]
        lower = [row for k, row in enumerate(rows) if least[k] <= min(least[max(k - 1, 0) : k + 2])]
        found[shape] = [p for _, p in sorted((one for row in lower for one in row), key=lambda one: one[0])[:STARTS]]
    return found


def _apart(cost: Array, slow: Array) -> list[int]:
    """The best place, and the best of those whose ln τ2 is far from it, on either side: a grid is coarse for τ1."""
    best = int(cost.argmin())
    far = [np.where(side * (slow - slow[best]) > FAR, cost, np.inf) for side in (1, -1)]
    return [best, *(int(one.argmin()) for one in far if np.isfinite(one.min(initial=np.inf)))]


BETTER = 10.0  # Difference of AICc from which a shape replaces the paper's: 150 to 1
# Share of the RMSE that a shape has to save before it replaces a simpler one; freeing C alone is no small step
LEAST_SAVED = {"one": 0.05, "two": 0.05, "free": 0.15, "overshoot": 0.05}
# Which of (change, ln τ1, ln(τ2/τ1), C) a shape leaves free
FREE: dict[str, tuple[int, ...]] = {"one": (0, 1), "two": (0, 1, 2), "free": (0, 1, 2, 3), "overshoot": (0, 1, 2, 3)}
MISSED = 0.1  # Share of the change by which the best shape may miss the mean of a sixtieth of the record
LITTLE = 0.5  # R² below which a curve explains little
# Part of the cost by which no further step lowers it: of all starts, of the best of each shape
COARSE, SETTLED = 1e-4, 1e-12
ROUNDS = 20  # Pairs of samples between which a dead time is fitted, at most
ROUNDING = 1e-16  # Of a sum of squares, as a part of that of the output
LEAST_SHARE = 0.01  # Least C of a free shape, and least 1 − C


@dataclass(frozen=True, eq=False)
class _Candidate:
    """One shape fitted: which, its unknowns p, and its weighted sum of squares."""

    shape: str
    dead: bool
    p: Array
    sse: float
    free: tuple[int, ...]  # Which of p are fitted

    @property
    def unknowns(self) -> int:
        """Those, and the noise's own size."""
        return len(self.free) + 1

    @property
    def name(self) -> str:
        return self.shape + ("+dead" if self.dead else "")


def fit_step(step: LevelStep, options: FitOptions | None = None) -> StepShape:
    """The shape of one step, with a finding where it explains little; `UsageError`: a dead time beyond its record."""
    options = options or FitOptions()
    if (options.held_dead_time_s or 0.0) >= 0.9 * step.time_s[-1]:
        raise UsageError(
            f"«dead_time» {options.held_dead_time_s:g} s: the step of {step.name} is recorded for "
            f"{step.time_s[-1]:.3g} s; give a shorter one"
        )
    y = step.output - step.start
    points = averaged(step.time_s, y)
    wanted = SHAPES if options.shape == "auto" else (options.shape,)
    tried: list[_Candidate] = []
    for dead in (False, True) if options.held_dead_time_s is None else (options.held_dead_time_s > 0,):
        tried += _candidates(points, step, options, wanted, dead, tried)
    best = min(tried, key=lambda one: (one.sse, one.unknowns))
    rounding = ROUNDING * float(y @ y)
    count = independent(y - curve(best.p, step.time_s), rounding)
    scores = {}
    for one in tried:
        k = one.unknowns
        aicc = count * math.log(max(one.sse + rounding, 1e-300)) + 2 * k + 2 * k * (k + 1) / max(count - k - 1, 1.0)
        scores[one.name] = aicc
    chosen = _chosen(tried, scores)
    every = AveragedRecord(step.time_s, y, np.ones(len(y)))
    p, _ = _polished(every, chosen.p, chosen.shape, chosen.free)
    plain = [one.sse for one in tried if one.shape in ("one", "two") and not one.dead]
    others = None if chosen.shape in ("one", "two") and p[4] == 0 else min(plain, default=None)
    return _result(step, chosen.shape, p, scores, y, None if others is None else math.sqrt(others / len(y)))


def _candidates(
    points: AveragedRecord,
    step: LevelStep,
    options: FitOptions,
    wanted: Sequence[str],
    dead: bool,
    simpler: Sequence[_Candidate] = (),
) -> list[_Candidate]:
    """Every shape wanted, fitted from the best places of a grid, and never worse than a `simpler` one it contains."""
    window = float(step.time_s[-1])
    given = options.held_dead_time_s
    share = options.held_share or SHARE
    delays = delays_tried(points) if given is None and dead else [given or 0.0]
    found: list[_Candidate] = []
    for shape, starts in starts_of(points, window, delays, share, wanted).items():
        free = FREE[shape] + ((4,) if dead and given is None else ())
        fits = [_least(points, start, shape, free, COARSE) for start in starts]
        fits += [
            (p, one.sse - points.within) for one in (*simpler, *found) if (p := _within(one, shape, share)) is not None
        ]
        if shape == "overshoot" and options.shape == "auto":
            fits = [one for one in fits if overshoots(one[0], window)]
        if fits:
            near = min(fits, key=lambda one: one[1])
            p, sse = min(near, _polished(points, near[0], shape, free), key=lambda one: one[1])
            found.append(_Candidate(shape, dead, p, sse + points.within, free))
    return found


def _within(one: _Candidate, shape: str, share: float) -> Array | None:
    """The same curve as one of a shape that contains it; None where it does not."""
    p = one.p.copy()
    if one.shape == "one" and shape in ("two", "free"):
        p[2:4] = 0.0, share  # both time constants alike
    elif one.shape != shape and (one.shape, shape) != ("two", "free"):
        return None
    return p if shape != "free" or LEAST_SHARE <= p[3] <= 1 - LEAST_SHARE else None


def _polished(points: AveragedRecord, start: Array, shape: str, free: tuple[int, ...]) -> tuple[Array, float]:
    """The least squares next to one start: the unknowns p and the weighted sum of squares.

    A dead time bends the curve at every sample that it passes, so it is fitted between two samples, those between
    which the other unknowns as they are leave least, until no other two leave less.
    """
    p, sse = _least(points, start, shape, free, SETTLED)
    middle, reach = 0.5 * (points.time_s[1:] + points.time_s[:-1]), max(2, LOOKED_AT // len(points.time_s))
    middle = middle[middle < 0.9 * points.time_s[-1]]
    for _ in range(ROUNDS):
        moved = p.copy()
        if 4 in free:
            at = int(np.searchsorted(middle, p[4]))
            near = middle[max(at - reach, 0) : at + reach]  # of a long record, those near the dead time so far
            after = np.maximum(points.time_s - near[:, np.newaxis], 0.0)
            s = 1 - p[3] * np.exp(-after / np.exp(p[1])) - (1 - p[3]) * np.exp(-after / np.exp(p[1] + p[2]))
            along, square = s @ (points.weight * points.output), (s**2) @ points.weight
            moved[4] = near[np.argmax(along**2 / np.maximum(square, 1e-300))]
        q, less = _least(points, moved, shape, free, SETTLED)
        if not less < (1 - SETTLED) * sse:
            break
        p, sse = q, less
    return p, sse


def _least(
    points: AveragedRecord, start: Array, shape: str, free: tuple[int, ...], settled: float
) -> tuple[Array, float]:
    """Least squares within bounds from one start, its dead time kept between the same two samples.

    The unknowns are (change, ln τ2, ln(τ2/τ1), C, θ), τ2 the slower constant, of an overshoot the window's at most.
    """
    root, window, chosen = np.sqrt(points.weight)[:, None], float(points.time_s[-1]), [*free]
    size = float(np.abs(points.output).max()) or 1.0
    share = {"free": (LEAST_SHARE, 1 - LEAST_SHARE), "overshoot": (1.0 + 1e-6, MOST)}.get(shape, (-1.0, 2.0))
    apart, slowest = (APART, window) if shape == "overshoot" else (1.0, 50 * window)
    k = min(int(np.searchsorted(points.time_s, start[4], side="right")), len(points.time_s) - 1)
    between = (float(points.time_s[k - 1]) if k else 0.0, float(points.time_s[k]))
    low = np.array([-100 * size, math.log(window * 1e-6), math.log(apart), share[0], between[0]])
    high = np.array([100 * size, math.log(slowest), math.log(1e4), share[1], between[1]])
    begin = start.copy()
    begin[2] = 0.0 if shape == "one" else start[2]
    begin[1] += begin[2]

    def whole(x: Array) -> Array:
        p = begin.copy()
        p[chosen] = np.clip(x, low[chosen], high[chosen])  # SLSQP may look outside before it comes back
        p[1] -= p[2]
        return p

    def normal(x: Array) -> tuple[float, Array, Array]:
        p = whole(x)
        by = slopes(p, points.time_s)
        left = root[:, 0] * (p[0] * by[:, 0] - points.output) / size  # the curve is linear in the change
        by[:, 2] -= by[:, 1]
        J = root * by[:, chosen] / size
        return float(left @ left), 2 * J.T @ left, 2 * J.T @ J

    ways = np.eye(5)[chosen][:, chosen]
    b = np.concatenate([low[chosen], -high[chosen]])
    problem = Problem(normal, np.concatenate([ways, -ways]), b, str, floor=ROUNDING * float(points.weight.sum()))
    end = approach(problem, np.clip(begin, low, high)[chosen], near=settled)
    if settled < COARSE:
        end = polish(problem, slsqp(problem, end), finished=settled)[0]
    return whole(end.x), end.cost * size**2


def independent(left: Array, rounding: float = 0.0, fewest: float = 12.0) -> float:
    """Number of independent samples in residuals: fewer than all where means of blocks scatter more than white noise's.

    The larger of two inflations counts: of neighbours (autocorrelation at lag 1) and of fifty blocks. A sum of squares
    up to `rounding` tells nothing, and `fewest` are counted at least.
    """
    count = len(left)
    left = left - left.mean()
    power = float(left @ left)
    if power <= rounding or count < 20:
        return float(count)
    alike = min(max(float(left[1:] @ left[:-1]) / power, 0.0), 0.999)
    blocks = min(50, count // 4)
    spread = float(np.mean(block_means(left, blocks) ** 2)) * count / blocks / (power / count)
    return max(count / max(1.0, (1 + alike) / (1 - alike), spread), fewest)


def _chosen(tried: list[_Candidate], scores: dict[str, float]) -> _Candidate:
    """The paper's form; one exponential where a second adds nothing; else what is better and worth it."""
    named = {one.name: one for one in tried}
    plain = [name for name in ("two", "one", "two+dead", "one+dead") if name in named]
    chosen = plain[0] if plain else tried[0].name
    simple = chosen.replace("two", "one")
    if simple in named and scores[simple] < scores[chosen] + BETTER:
        chosen = simple
    order = sorted(named, key=lambda name: (named[name].unknowns, scores[name]))
    for name in order:
        better = named[name].sse < (1 - LEAST_SAVED[named[name].shape]) ** 2 * named[chosen].sse
        if better and scores[name] < scores[chosen] - BETTER:
            chosen = name
    return named[chosen]


def _result(
    step: LevelStep, shape: str, p: Array, scores: dict[str, float], y: Array, plain_rmse: float | None
) -> StepShape:
    """The result; `plain_rmse` is that of the paper's form, or of one exponential, where another was chosen."""
    left = y - curve(p, step.time_s)
    sse = float(left @ left)
    rmse, change = math.sqrt(sse / len(left)), float(p[0])
    fit_pct, r2 = quality(sse, [y])
    found: list[Finding] = []
    if r2 is not None and r2 < LITTLE and independent(left) < len(left) / 4:
        found.append(finding("shape-explains-little", step.name, (step.level,), R2=r2, shape=shape))
    elif len(left) >= 240:  # block means that stand far out of their noise: the response has another form
        means = block_means(left, 60)
        worst = float(np.abs(means).max())
        if worst > max(MISSED * abs(change), 8 * block_noise(means)):
            pct = 100 * worst / abs(change)
            found.append(finding("shape-misses", step.name, (step.level,), worst=worst, share_pct=pct))
    if plain_rmse is not None:
        said = {"dead_time_s": float(p[4]), "rmse": rmse, "plain_rmse": plain_rmse}
        saved = 100 * (1 - rmse / plain_rmse)
        found.append(finding("other-shape-fits-better", step.name, (step.level,), shape=shape, saved_pct=saved, **said))
    tau1, tau2, peak = float(np.exp(p[1])), float(np.exp(p[1] + p[2])), None
    if p[3] > 1:  # where ds/dt = 0: C/τ1 e^(−t/τ1) = (C − 1)/τ2 e^(−t/τ2)
        at = p[4] + np.log(p[3] * tau2 / ((p[3] - 1) * tau1)) / (1 / tau1 - 1 / tau2)
        peak = float(curve(p, np.array([at]))[0])
    best, single = min(scores.values()), shape == "one"
    return StepShape(
        run=step.name,
        from_=step.from_level,
        level=step.level,
        edge=step.edge,
        start=step.start,
        change=change,
        gain=None if step.level == step.from_level else change / (step.level - step.from_level),
        shape=shape,
        tau1=tau1,
        tau2=None if single else tau2,
        C=1.0 if single else float(p[3]),
        dead_time_s=float(p[4]),
        rmse=rmse,
        fit_pct=fit_pct,
        R2=r2,
        samples=len(left),
        peak=peak,
        evidence={name: score - best for name, score in scores.items()},
        findings=tuple(found),
    )


LEAST_TAIL = 1e-6  # Part of a step's change below which what it has left is nothing
FEW_STEPS = 3  # Steps up to which each is shown by itself, too
# What the steps before a step have left to go, Σ a e^(−t/τ): a, τ, and the half-width of the 95 % interval of a
Tail: TypeAlias = tuple[tuple[float, float, float], ...]


def single_steps(stepset: StepSet, options: FitOptions) -> tuple[StepShape, ...]:
    """The shape of each change of input, where some go from level to level, where they are few, or where it is asked.

    Steps from rest are fitted together, as levels, too; these are beside them, with their intervals. Each carries the
    tail of the step before it in its log: what a hold too short has left to go.
    """
    steps = stepset.level_steps
    between = any(0.0 not in (step.from_level, step.level) for step in steps)
    asked = options.shape != "auto" or options.held_dead_time_s is not None
    if not (between or asked or len(steps) <= FEW_STEPS):
        return ()
    found: dict[int, StepShape] = {}
    before: int = -1
    tail: Tail = ()
    for k in sorted(range(len(steps)), key=lambda k: (steps[k].source, steps[k].at_s)):
        step, last = steps[k], steps[before]
        lasted, until = step.at_s - last.at_s, float(last.time_s[-1]) * (1 + 2 / len(last.time_s))
        follows = before >= 0 and last.source == step.source and last.level == step.from_level and 0 < lasted <= until
        tail = tail_of(found[before], tail, lasted) if follows else ()
        rest_s, output, start, moved = step.rest_s or 0.0, step.output, step.start, step.rest_moved
        for size, tau, _ in tail:  # as it would have been behind a hold that had settled
            output = output - size * np.exp(-step.time_s / tau)
            start -= size * _before(rest_s, tau)
            moved -= abs(size) * abs(_before(rest_s / 2, tau) * (math.exp(rest_s / 2 / tau) - 1))
        alone = replace(step, output=output, start=start, rest_moved=max(moved, 0.0)) if tail else step
        shape = with_interval(alone, fit_step(alone, options), options, tail)
        found[k] = msgspec.structs.replace(shape, tail=tuple((size, tau) for size, tau, _ in tail))
        before = k
    return tuple(found[k] for k in range(len(steps)))


def _before(rest_s: float, tau: float) -> float:
    """Mean of e^(−t/τ) over the rest that ends at t = 0."""
    return math.expm1(rest_s / tau) * tau / rest_s if rest_s > 0 else 1.0


def tail_of(shape: StepShape, before: Tail, lasted_s: float) -> Tail:
    """What a fitted step, and the tail before it, have left to go after a hold."""
    parts = [(size * math.exp(-lasted_s / tau), tau, half * math.exp(-lasted_s / tau)) for size, tau, half in before]
    if any(one.code == "shape-explains-little" for one in shape.findings):
        return tuple(parts)
    after, ci = max(lasted_s - shape.dead_time_s, 0.0), shape.ci95
    ends = ci.change if shape.change else None
    of_change = 1.0 if ends is None else 0.5 * (ends[1] - ends[0]) / abs(shape.change)
    of_share = 0.5 * (ci.C[1] - ci.C[0]) if ci.C is not None else 0.0
    moved = abs(float(shape.predict(np.array([lasted_s]))[0]) - shape.start)
    for share, tau, ends in ((shape.C, shape.tau1, ci.tau1), (1 - shape.C, shape.tau2, ci.tau2)):
        if tau is not None and share != 0:
            size = -shape.change * share * math.exp(-after / tau)
            of_tau = 0.5 * math.log(ends[1] / ends[0]) if ends is not None else math.log(WIDEST)
            half = abs(size) * math.hypot(of_change, of_share / share, after / tau * of_tau)
            # a part that outlasts the hold is no more known than what the output has done in it
            parts.append((size, tau, half) if tau <= lasted_s else (0.0, tau, moved))
    return tuple(part for part in parts if abs(part[0]) + part[2] > LEAST_TAIL * abs(shape.change))


def of_another_shape(stepset: StepSet, options: FitOptions) -> tuple[StepShape, ...]:
    """The first rise to each level that asks for another shape than the paper's, with intervals, where most do."""
    first_rises = {step.level: step for step in reversed(stepset.level_steps) if step.edge == "up"}
    asking: list[StepShape] = []
    for k, step in enumerate(first_rises[level] for level in sorted(first_rises)):
        shape = fit_step(step, options)
        if any(found.code == "other-shape-fits-better" for found in shape.findings):
            asking.append(with_interval(step, shape, options))
        elif 2 * (k + 1 - len(asking)) >= len(first_rises):  # it can be most of them no more
            return ()
    return tuple(asking)


def between_rows(shapes: Sequence[StepShape]) -> tuple[FrictionLevel, ...]:
    """Those that neither begin nor end at rest as rows of the friction model; a single constant stands there twice."""
    return tuple(
        FrictionLevel(
            one.level, one.change, one.tau1, one.tau1 if one.tau2 is None else one.tau2, one.C,
            from_=one.from_, start=one.start, shape=one.shape, delay_s=one.dead_time_s,
            rmse=one.rmse, samples=one.samples, fit_pct=one.fit_pct, R2=one.R2,
            ci95=LevelIntervals(Ts=one.ci95.change, tau1=one.ci95.tau1, tau2=one.ci95.tau2, C=one.ci95.C),
        )
        for one in shapes if one.from_ != 0 and one.level != 0
    )  # fmt: skip


NAMES = ("change", "tau1", "tau2", "C", "dead_time_s")
LAGS = 16  # Part of the record up to which noise may remember
LONGEST = 1.0  # Record lengths beyond which the slow time constant is not quoted, nor the change that rests on it
# Record lengths beyond which a slow time constant makes all intervals twice as wide: the tail before is not known
SHORT = 0.5
NEARLY = 4.0  # Difference of AICc from which two exponentials are nearly chosen
WIDEST = 3.0  # Factor by which an interval of a time constant may reach to either side before it says nothing


def with_interval(step: LevelStep, shape: StepShape, options: FitOptions, tail: Tail = ()) -> StepShape:
    """One fitted step with its intervals, and a finding where some say nothing; `tail` was taken from its output."""
    if options.ci == "none":
        return shape
    window = float(step.time_s[-1])
    two = shape.tau2 is not None
    free = [True, True, two, shape.shape in ("free", "overshoot")]
    free.append(options.held_dead_time_s is None and shape.dead_time_s > 0)
    names = [name for name, is_free in zip(NAMES, free, strict=True) if is_free]
    refused = any(one.severity == "stop" for one in shape.findings)
    error = {} if refused else dict(zip(names, _errors(step, shape, free, options.ci, tail).tolist(), strict=True))
    if not all(map(math.isfinite, error.values())):
        error = {}
    if shape.tau2 is not None and shape.tau2 > SHORT * window:
        error = {name: 2.0 * half for name, half in error.items()}
    most = {"tau1": math.log(WIDEST), "tau2": math.log(WIDEST), "C": 1.0}
    wide = {name for name, half in most.items() if error.get(name, 0.0) > half}
    if shape.tau2 is not None and shape.tau2 > LONGEST * window:
        wide |= {"tau2", "change"}
    one, more = (shape.evidence.get(name + "+dead" * (shape.dead_time_s > 0)) for name in ("one", "two"))
    if shape.shape == "one" and one is not None and more is not None and more < one - NEARLY:  # a mixture
        wide |= {"tau1", "change"}
    ends: dict[str, Interval] = {}
    for name in error.keys() - wide:
        value, half = getattr(shape, name), error[name]
        log = name in ("tau1", "tau2")
        ends[name] = (value * math.exp(-half), value * math.exp(half)) if log else (value - half, value + half)
    change = ends.get("change")
    if change is not None and shape.gain is not None:
        low, high = sorted(end / (shape.level - shape.from_) for end in change)
        ends["gain"] = (low, high)
    open_ = tuple(name for name in names if name not in ends)
    said = (finding("step-leaves-open", shape.run, (shape.level,), open=", ".join(open_)),) if open_ else ()
    return msgspec.structs.replace(shape, ci95=StepIntervals(**ends), findings=(*shape.findings, *said))


def _errors(step: LevelStep, shape: StepShape, free: Sequence[bool], ci: str, tail: Tail) -> Array:
    """Half widths of the 95 % intervals of the free parameters, time constants in logarithms."""
    tau2 = shape.tau2 or shape.tau1
    p = np.array([shape.change, math.log(shape.tau1), math.log(tau2 / shape.tau1), shape.C, shape.dead_time_s])
    by = slopes(p, step.time_s)
    by[:, 1] -= by[:, 2]  # of ln τ1 and ln τ2, in place of ln τ1 and ln τ2/τ1
    if shape.tau2 is None:
        by[:, 1] += by[:, 2]
    jacobian = by[:, np.asarray(free)]
    left = step.output - shape.predict(step.time_s)
    count, k = jacobian.shape
    unit = inverse(jacobian.T @ jacobian)
    if ci == "white":
        degrees, per_sample = float(count - k), float(left @ left) / max(count - k, 1)
        variance = per_sample * np.diag(unit)
    else:
        directions = np.concatenate((jacobian @ unit, np.ones((count, 1))), axis=1)
        seen = min(independent(left, fewest=k + 1.0), LAGS)  # what the noise remembers is seen in so many stretches
        degrees = seen - k
        own = bartlett_variance(step.time_s, directions * left[:, None]).max(axis=0)
        # the fit has taken k parameters' worth of the slow noise out of the residuals
        sums = np.maximum(own, stationary_variance(left, directions) / (1 - k / seen))
        variance, per_sample = sums[:-1], float(sums[-1]) / count
    moved = unit @ jacobian.sum(axis=0)
    rested = max(1.0, (step.rest_s or 0.0) * (count - 1) / float(step.time_s[-1]))
    start = per_sample / rested
    # a rest that still moved by more than its noise, 4 start, has as far to go again
    start += max(0.0, step.rest_moved**2 - 4 * start)
    halves = t_quantile(degrees) ** 2 * (variance + moved**2 * start)
    for _, tau, half in tail:
        halves = (
            halves + (half * unit @ jacobian.T @ (_before(step.rest_s or 0.0, tau) - np.exp(-step.time_s / tau))) ** 2
        )
    return np.asarray(np.sqrt(halves))


def stationary_variance(left: Array, directions: Array) -> Array:
    """Variance of sums of noise times each column, shape (k,), for noise whose autocovariance is that of `left`.

    A fast constant is told by the first samples only: too few to show by themselves how long the noise remembers.
    Autocovariances up to a sixteenth of the record, with Bartlett's weights.
    """
    count = len(left)
    size = 1 << (2 * count - 1).bit_length()
    lags = max(1, count // LAGS)

    def correlations(columns: Array) -> Array:
        power = np.abs(np.fft.rfft(columns, size, axis=0)) ** 2
        return np.asarray(np.fft.irfft(power, size, axis=0)[:lags])

    noise = correlations(left) / count * (1 - np.arange(lags) / lags)
    noise[1:] *= 2
    return np.asarray(np.maximum(noise @ correlations(directions), 0.0))
