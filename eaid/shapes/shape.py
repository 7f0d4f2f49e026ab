"""Which of the curves of one step (`step_curve`) a record has, by least squares from the best places of a grid.

By AICc with the number of independent samples; the paper's form stands unless another is better by `BETTER`.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from eaid.arrays import Array
from eaid.errors import UsageError
from eaid.estimate.data import quality
from eaid.estimate.solver import Problem, approach, polish
from eaid.findings import Finding, finding
from eaid.options import FitOptions
from eaid.plant.dynamics import SHARE
from eaid.plant.steps import peak_of, step_way
from eaid.results.models import StepShape
from eaid.shapes.curves import (
    LARGEST_C,
    SHAPES,
    TAUS_APART,
    AveragedRecord,
    average_record,
    delays_tried,
    overshoots,
    slopes,
    starts_of,
    step_curve,
    step_of,
)
from eaid.steps.noise import block_means, block_noise, coarse_step
from eaid.steps.stepset import LevelStep

BETTER = 10.0  # Difference of AICc from which a shape replaces the paper's: 150 to 1
# Share of the RMSE that a shape has to save before it replaces a simpler one; freeing C alone is no small step
LEAST_SAVED = {"one": 0.05, "two": 0.05, "free": 0.15, "overshoot": 0.05}
# Which of (change, ln τ1, ln(τ2/τ1), C) a shape leaves free
FREE: dict[str, tuple[int, ...]] = {"one": (0, 1), "two": (0, 1, 2), "free": (0, 1, 2, 3), "overshoot": (0, 1, 2, 3)}
MISSED = 0.1  # Share of the change by which the best shape may miss the mean of a sixtieth of the record
LITTLE_EXPLAINED = 0.5  # R² below which a curve explains little
# Part of the cost by which no further step lowers it: of all starts, of the best of each shape, of the one chosen
STARTS_SETTLED, SHAPES_SETTLED, STEP_SETTLED = 1e-4, 1e-7, 1e-12
LOOKED_AT = 300_000  # Half of the values of the curve that are worked out to find a dead time, at most
DELAY_ROUNDS = 20  # Pairs of samples between which a dead time is fitted, at most
STEP_ROUNDING = 1e-16  # Of a sum of squares, as a part of that of the output
WHITE = 0.5  # Part of the samples that is independent where a curve leaves nothing but noise
LONGEST_DELAY_PART = 0.9  # Part of a record that a dead time may take
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


def fit_step(step: LevelStep, options: FitOptions | None = None, recorded: LevelStep | None = None) -> StepShape:
    """The shape of one step, with a finding where it explains little; `UsageError`: a dead time beyond its record.

    `recorded` is the step before the tail of another was taken from it."""
    options = options or FitOptions()
    refuse_longer(options.held_dead_time_s or 0.0, step.name, step.time_s[-1])
    y = step.output - step.start
    points = average_record(step.time_s, y)
    wanted = SHAPES if options.shape == "auto" else (options.shape,)
    tried: list[_Candidate] = []
    for dead in (False, True) if options.held_dead_time_s is None else (options.held_dead_time_s > 0,):
        tried += _candidates(points, step, options, wanted, dead, tried)
    best = min(tried, key=lambda one: (one.sse, one.unknowns))
    rounding = STEP_ROUNDING * float(y @ y)
    count = independent_samples(y - step_curve(best.p, step.time_s), rounding)
    scores, judged = {}, tried
    if q := coarse_step((recorded or step).output):
        judged = [replace(one, sse=beyond_counts(y - step_curve(one.p, step.time_s), q)) for one in tried]
    for one in judged:
        k = one.unknowns
        aicc = count * math.log(max(one.sse + rounding, 1e-300)) + 2 * k + 2 * k * (k + 1) / max(count - k - 1, 1.0)
        scores[one.name] = aicc
    chosen = _choose(judged, scores)
    every = AveragedRecord(step.time_s, y, np.ones(len(y)))
    p, _ = refine(every, chosen.p, chosen.shape, chosen.free, STEP_SETTLED)
    plain = [one.sse for one in tried if one.shape in ("one", "two") and not one.dead]
    others = None if chosen.shape in ("one", "two") and p[4] == 0 else min(plain, default=None)
    return _describe(step, chosen.shape, p, scores, y, None if others is None else math.sqrt(others / len(y)))


def refuse_longer(given_s: float, name: str, record_s: float) -> None:
    """Refuse a dead time beyond the record of a step."""
    if given_s >= LONGEST_DELAY_PART * record_s:
        raise UsageError(
            f"«dead_time» {given_s:g} s: the step of {name} is recorded for {record_s:.3g} s; give a shorter one"
        )


def _candidates(
    points: AveragedRecord,
    step: LevelStep,
    options: FitOptions,
    wanted: Sequence[str],
    dead: bool,
    simpler: Sequence[_Candidate],
) -> list[_Candidate]:
    """Every shape wanted, fitted from the best places of a grid, and never worse than a `simpler` one it contains."""
    window = float(step.time_s[-1])
    given = options.held_dead_time_s
    share = options.held_share or SHARE
    delays = delays_tried(points) if given is None and dead else [given or 0.0]
    found: list[_Candidate] = []
    for shape, starts in starts_of(points, window, delays, share, wanted).items():
        free = FREE[shape] + ((4,) if dead and given is None else ())
        fits = [solve_least(points, start, shape, free, STARTS_SETTLED) for start in starts]
        fits += [
            (p, one.sse - points.within) for one in (*simpler, *found) if (p := _within(one, shape, share)) is not None
        ]
        if shape == "overshoot" and options.shape == "auto":
            fits = [one for one in fits if overshoots(one[0], window)]
        if fits:
            near = min(fits, key=lambda one: one[1])
            p, sse = min(near, refine(points, near[0], shape, free, SHAPES_SETTLED), key=lambda one: one[1])
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


def refine(
    points: AveragedRecord, start: Array, shape: str, free: tuple[int, ...], settled: float, values: int = LOOKED_AT
) -> tuple[Array, float]:
    """The least squares next to one start: the unknowns p and the weighted sum of squares; `values` of the curve are
    worked out to find a dead time on either side of where it was, at most.

    A dead time bends the curve at every sample that it passes, so it is fitted between two samples, those between
    which the other unknowns as they are leave least, until no other two leave less.
    """
    p, sse = solve_least(points, start, shape, free, settled)
    middle, reach = 0.5 * (points.time_s[1:] + points.time_s[:-1]), max(2, values // len(points.time_s))
    middle = middle[middle < LONGEST_DELAY_PART * points.time_s[-1]]
    for _ in range(DELAY_ROUNDS):
        moved = p.copy()
        if 4 in free:
            at, row = step_of(p), int(np.searchsorted(middle, p[4]))
            near = middle[max(row - reach, 0) : row + reach]  # of a long record, those near the dead time so far
            after = np.maximum(points.time_s - near[:, np.newaxis], 0.0)
            s = step_way(at, after)
            along, square = s @ (points.weight * points.output), (s**2) @ points.weight
            moved[4] = near[np.argmax(along**2 / np.maximum(square, 1e-300))]
        q, less = solve_least(points, moved, shape, free, settled)
        if not less < (1 - settled) * sse:
            break
        p, sse = q, less
    return p, sse


def solve_least(
    points: AveragedRecord, start: Array, shape: str, free: tuple[int, ...], settled: float
) -> tuple[Array, float]:
    """Least squares within bounds from one start, its dead time kept between the same two samples.

    The unknowns are (change, ln τ2, ln(τ2/τ1), C, θ), τ2 the slower constant, of an overshoot the window's at most.
    """
    window, chosen = float(points.time_s[-1]), [*free]
    size = float(np.abs(points.output).max()) or 1.0
    root = np.sqrt(points.weight) / size
    share = {"free": (LEAST_SHARE, 1 - LEAST_SHARE), "overshoot": (1.0 + 1e-6, LARGEST_C)}.get(shape, (-1.0, 2.0))
    apart, slowest = (TAUS_APART, window) if shape == "overshoot" else (1.0, 50 * window)
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
        by = slopes(p, points.time_s).T
        left = root * (p[0] * by[0] - points.output)  # the curve is linear in the change
        by[2] -= by[1]
        J = root * by[chosen]
        return float(left @ left), 2 * J @ left, 2 * J @ J.T

    ways = np.eye(5)[chosen][:, chosen]
    b = np.concatenate([low[chosen], -high[chosen]])
    problem = Problem(normal, np.concatenate([ways, -ways]), b, str, floor=STEP_ROUNDING * float(points.weight.sum()))
    end = approach(problem, np.clip(begin, low, high)[chosen], near=settled)
    if settled < SHAPES_SETTLED:
        end = polish(problem, end, finished=settled)[0]
    return whole(end.x), end.cost * size**2


def independent_samples(left: Array, rounding: float = 0.0, fewest: float = 12.0) -> float:
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


def beyond_counts(left: Array, q: float) -> float:
    """Sum of squares of residuals beyond half a step q of a sensor coarser than its noise, within which they tell
    nothing, and of the rounding itself."""
    beyond = np.maximum(np.abs(left) - q / 2, 0.0)
    return float(beyond @ beyond + len(left) * q**2 / 12)


def is_coloured(left: Array) -> bool:
    """Whether the noise of residuals lasts: much of what neighbouring samples say is the same."""
    return independent_samples(left) < WHITE * len(left)


def _choose(tried: list[_Candidate], scores: dict[str, float]) -> _Candidate:
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


def _describe(
    step: LevelStep, shape: str, p: Array, scores: dict[str, float], y: Array, plain_rmse: float | None
) -> StepShape:
    """The result; `plain_rmse` is that of the paper's form, or of one exponential, where another was chosen."""
    left = y - step_curve(p, step.time_s)
    sse = float(left @ left)
    rmse, change = math.sqrt(sse / len(left)), float(p[0])
    fit_pct, r2 = quality(sse, [y])
    found: list[Finding] = []
    if r2 is not None and r2 < LITTLE_EXPLAINED and independent_samples(left) < len(left) / 4:
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
    at = step_of(p)
    tau1, tau2, peak = float(at.tau1), float(at.tau2), peak_of(at)[1] if at.C > 1 else None
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
