"""Each change of input by itself, a step from level to level behind the tail of the one before it in its log; with 95 %
intervals by its residuals as they are: what noise that remembers, a second lag that it hides, a rest that still moved
and that tail make of each number."""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import TypeAlias

import msgspec
import numpy as np
from scipy.linalg import solveh_banded
from scipy.optimize import minimize_scalar

from eaid.arrays import Array, inverse
from eaid.estimate.scatter import bartlett_variance
from eaid.estimate.spread import t_quantile
from eaid.findings import finding
from eaid.options import FitOptions
from eaid.plant.dynamics import SHARE
from eaid.plant.steps import decay, rise
from eaid.results.common import Interval
from eaid.results.models import FrictionLevel, LevelIntervals, StepIntervals, StepShape
from eaid.shapes.curves import average_record, slopes
from eaid.shapes.shape import SHAPES_SETTLED, fit_step, independent_samples, refine, solve_least
from eaid.steps.noise import WHOLE, left_open, resolution
from eaid.steps.stepset import LevelStep, StepSet

LEAST_TAIL = 1e-6  # Part of a step's change below which what it has left is nothing
FEW_STEPS = 3  # Steps up to which each is shown by itself, too
# What the steps before a step have left to go, Σ a e^(−t/τ): a, τ, and the half-width of the 95 % interval of a
TailTerms: TypeAlias = tuple[tuple[float, float, float], ...]


def fit_single_steps(stepset: StepSet, options: FitOptions) -> tuple[StepShape, ...]:
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
    tail: TailTerms = ()
    reach = NO_OTHER_LAGS
    for k in sorted(range(len(steps)), key=lambda k: (steps[k].source, steps[k].at_s)):
        step, last = steps[k], steps[before]
        lasted, until = step.at_s - last.at_s, float(last.time_s[-1]) * (1 + 2 / len(last.time_s))
        follows = before >= 0 and last.source == step.source and last.level == step.from_level and 0 < lasted <= until
        tail = tail_of(found[before], tail, lasted, reach) if follows else ()
        rest_s, output, start, moved = step.rest_s or 0.0, step.output, step.start, step.rest_moved
        for size, tau, _ in tail:  # as it would have been behind a hold that had settled
            output = output - size * decay(step.time_s, tau)
            start -= size * mean_before(rest_s, tau)
            moved -= abs(size * mean_before(rest_s / 2, tau) * float(rise(np.array(-rest_s / 2), tau)))
        alone = replace(step, output=output, start=start, rest_moved=max(moved, 0.0)) if tail else step
        shape = fit_step(alone, options, step)
        reach = lags_possible(alone, shape, options)
        shape = add_intervals(alone, shape, options, reach, tail, step)
        found[k] = msgspec.structs.replace(shape, tail=tuple((size, tau) for size, tau, _ in tail if size))
        before = k
    return tuple(found[k] for k in range(len(steps)))


def tail_of(shape: StepShape, before: TailTerms, lasted_s: float, reach: Array) -> TailTerms:
    """What a fitted step, and the tail before it, have left to go after a hold; where it has one lag, a second one
    `reach` knows may have left something, too."""
    left = [(part, float(decay(np.array(lasted_s), part[1]))) for part in before]
    parts = [(size * of, tau, half * of) for (size, tau, half), of in left]
    if any(one.code == "shape-explains-little" for one in shape.findings):
        return tuple(parts)
    after, ci = max(lasted_s - shape.dead_time_s, 0.0), shape.ci95
    ends = ci.change if shape.change else None
    of_change = 1.0 if ends is None else 0.5 * (ends[1] - ends[0]) / abs(shape.change)
    of_share = 0.5 * (ci.C[1] - ci.C[0]) if ci.C is not None else 0.0
    moved = abs(float(shape.predict(np.array([lasted_s]))[0]) - shape.start)
    for share, tau, ends in ((shape.C, shape.tau1, ci.tau1), (1 - shape.C, shape.tau2, ci.tau2)):
        if tau is not None and share != 0:
            size = -shape.change * share * float(decay(np.array(after), tau))
            of_tau = 0.5 * math.log(ends[1] / ends[0]) if ends is not None else math.log(WIDEST_FACTOR)
            half = abs(size) * math.hypot(of_change, of_share / share, after / tau * of_tau)
            # a part that outlasts the hold is no more known than what the output has done in it
            parts.append((size, tau, half) if tau <= lasted_s else (0.0, tau, moved))
    if shape.tau2 is None and len(reach):
        change, _, ln_tau2, share = reach.T
        left_over = np.abs((1 - share) * change) * np.exp(-after / np.exp(ln_tau2))
        k = int(left_over.argmax())
        parts.append((0.0, float(np.exp(ln_tau2[k])), float(left_over[k])))
    return tuple(part for part in parts if abs(part[0]) + part[2] > LEAST_TAIL * abs(shape.change))


def fit_another_shape(stepset: StepSet, options: FitOptions) -> tuple[StepShape, ...]:
    """The first rise to each level that asks for another shape than the paper's, with intervals, where most do."""
    first_rises = {step.level: step for step in reversed(stepset.level_steps) if step.edge == "up"}
    asking: list[StepShape] = []
    for k, step in enumerate(first_rises[level] for level in sorted(first_rises)):
        shape = fit_step(step, options)
        if any(found.code == "other-shape-fits-better" for found in shape.findings):
            asking.append(add_intervals(step, shape, options, lags_possible(step, shape, options)))
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


def mean_before(rest_s: float, tau: float) -> float:
    """Mean of e^(−t/τ) over the rest that ends at t = 0."""
    return -float(rise(np.array(-rest_s), tau)) * tau / rest_s if rest_s > 0 else 1.0


STEP_NAMES = ("change", "tau1", "tau2", "C", "dead_time_s")
NOISE_LAGS = 16  # Part of the record up to which noise may remember
LONGEST_TAU2 = 1.0  # Record lengths beyond which the slow time constant is not quoted, nor the change that rests on it
# Record lengths beyond which a slow time constant makes all intervals twice as wide: the tail before is not known
SHORT_RECORD = 0.5
LONGEST_MEMORY, MEMORY_SETTLED = 5.0, 1e-9  # ρ = tanh of it at most, and the change of that at which its search ends
NO_OTHER_LAGS = np.zeros((0, 4))
# Ratios of two time constants that are held against the chosen shape, and record lengths of the longest τ2
RATIOS_TRIED, LONGEST_RATIO = 24, 50.0
FOLLOWED_VALUES = 20_000  # Values of the curve by which a dead time is followed from ratio to ratio
HALVES_TRIED = np.linspace(-1.5, 1.5, 13)  # Half-widths of the chosen ratio, by its curvature, that are tried beside it
WIDEST_FACTOR = 3.0  # Factor by which an interval of a time constant may reach to either side before it says nothing


def add_intervals(
    step: LevelStep, shape: StepShape, options: FitOptions, reach: Array, tail: TailTerms = (),
    recorded: LevelStep | None = None,
) -> StepShape:  # fmt: skip
    """One fitted step with its intervals, and a finding where some say nothing; two lags may `reach` beside it, and
    `tail` was taken from its output, which was `recorded` so."""
    if options.ci == "none":
        return shape
    window = float(step.time_s[-1])
    two = shape.tau2 is not None
    free = [True, True, two, shape.shape in ("free", "overshoot")]
    free.append(options.held_dead_time_s is None and shape.dead_time_s > 0)
    names = [name for name, is_free in zip(STEP_NAMES, free, strict=True) if is_free]
    refused = any(one.severity == "stop" for one in shape.findings)
    errors_of = partial(_errors, step, shape, ci=options.ci, tail=tail, recorded=recorded or step)
    error = {} if refused else dict(zip(names, errors_of(free).tolist(), strict=True))
    if len(reach) and two and error:  # what τ2 leaves open of both is in its reach
        held = [True, True, False, False, free[4]]
        error |= zip(names[:2], errors_of(held).tolist(), strict=False)
    most = {"tau1": math.log(WIDEST_FACTOR), "tau2": math.log(WIDEST_FACTOR), "C": 1.0}
    wide = {name for name, half in error.items() if not half < most.get(name, math.inf)}
    slow_s = shape.tau2 or 0.0
    if len(reach):
        wide |= {"tau2"} if (reach[:, 2] > math.log(LONGEST_TAU2 * window)).any() else set()
    elif slow_s > SHORT_RECORD * window:
        error = {name: 2.0 * half for name, half in error.items()}
        wide |= {"tau2", "change"} if slow_s > LONGEST_TAU2 * window else set()
    ends: dict[str, Interval] = {}
    for name in error.keys() - wide:
        value, half, log = getattr(shape, name), error[name], name in ("tau1", "tau2")
        value = math.log(value) if log else value
        off = reach[:, STEP_NAMES.index(name)] - value if name in STEP_NAMES[:3] else np.zeros(1)
        both = max if name == "tau2" else math.hypot  # of τ2 they are one thing
        low, high = value - both(half, -off.min(initial=0.0)), value + both(half, off.max(initial=0.0))
        ends[name] = (math.exp(low), math.exp(high)) if log else (low, high)
    change = ends.get("change")
    if change is not None and shape.gain is not None:
        low, high = sorted(end / (shape.level - shape.from_) for end in change)
        ends["gain"] = (low, high)
    open_ = tuple(name for name in names if name not in ends)
    said = (finding("step-leaves-open", shape.run, (shape.level,), open=", ".join(open_)),) if open_ else ()
    return msgspec.structs.replace(shape, ci95=StepIntervals(**ends), findings=(*shape.findings, *said))


def lags_possible(step: LevelStep, shape: StepShape, options: FitOptions) -> Array:
    """Change, ln τ1, ln τ2 and C of two exponentials that leave as little of a step as noise allows beside the least,
    by ratios of their time constants, behind those of the chosen shape, (m, 4); none beside one with a C of its own,
    beside one lag that was asked for, and in the textbook's white noise."""
    asked_for_one = shape.shape == "one" and options.shape != "auto"
    if shape.shape not in ("one", "two") or asked_for_one or options.ci in ("white", "none"):
        return NO_OTHER_LAGS
    points, window = average_record(step.time_s, step.output - step.start), float(step.time_s[-1])
    p, residuals = numbers_of(shape), step.output - shape.predict(step.time_s)
    chosen, ratio, least = [*p[:2], p[1] + p[2], p[3]], float(p[2]), float(residuals @ residuals)
    spare = independent_samples(residuals, fewest=4.0) - 3.0
    allowed = float(t_quantile(min(spare, NOISE_LAGS - 3.0))) ** 2 / spare
    by = slopes(p, step.time_s)[:, :3]
    half = math.sqrt(allowed * least * max(float(inverse(by.T @ by)[2, 2]), 0.0)) if shape.tau2 else 0.0
    tried = np.linspace(0.0, math.log(LONGEST_RATIO * window / shape.tau1), RATIOS_TRIED)
    tried = np.sort(np.append(tried, ratio + half * HALVES_TRIED)) if 0 < half < tried[-1] else tried
    late = options.held_dead_time_s is None and shape.dead_time_s > 0
    p[3], found = options.held_share or SHARE, []
    for p[2] in tried[tried >= 0].tolist():
        if late:
            p, left = refine(points, p, "two", (0, 1, 4), SHAPES_SETTLED, FOLLOWED_VALUES)
        else:
            p, left = solve_least(points, p, "two", (0, 1), SHAPES_SETTLED)
        found.append([left + points.within, p[0], p[1], p[1] + p[2], p[3]])
    rows = np.array(found)
    most = min(rows[:, 0].min(), least) * (1 + allowed)
    inside = rows[:, 0] <= most
    for k in np.flatnonzero(np.diff(inside)).tolist():  # between two ratios, where it is as much
        part = (most - rows[k, 0]) / (rows[k + 1, 0] - rows[k, 0])
        rows[k + inside[k]] = rows[k] + part * (rows[k + 1] - rows[k])
        inside[k + inside[k]] = True
    return np.array([chosen, *rows[inside, 1:]])


def numbers_of(shape: StepShape) -> Array:
    """(change, ln τ1, ln(τ2/τ1), C, θ) of a fitted step."""
    tau2 = shape.tau2 or shape.tau1
    return np.array([shape.change, math.log(shape.tau1), math.log(tau2 / shape.tau1), shape.C, shape.dead_time_s])


def _errors(
    step: LevelStep, shape: StepShape, free: Sequence[bool], ci: str, tail: TailTerms, recorded: LevelStep
) -> Array:
    """Half widths of the 95 % intervals of the free parameters, time constants in logarithms."""
    by = slopes(numbers_of(shape), step.time_s)
    by[:, 1] -= by[:, 2]  # of ln τ1 and ln τ2, in place of ln τ1 and ln τ2/τ1
    if not free[2]:
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
        # what the noise remembers is seen in so many stretches
        seen = min(independent_samples(left, fewest=k + 1.0), NOISE_LAGS)
        degrees = seen - k
        own = bartlett_variance(step.time_s, directions * left[:, None]).max(axis=0)
        sums = np.maximum(own, lasting_variance(left, jacobian, directions))
        variance, per_sample = sums[:-1], float(sums[-1]) / count
    moved = unit @ jacobian.sum(axis=0)
    rested = max(1.0, (step.rest_s or 0.0) * (count - 1) / float(step.time_s[-1]))
    start = per_sample / rested
    # a rest that still moved by more than its noise, 4 start, has as far to go again
    start += max(0.0, step.rest_moved**2 - 4 * start)
    of_counts, of_start = within_counts(recorded, left, jacobian @ unit)
    variance, start = variance + of_counts, start + of_start
    halves = t_quantile(degrees) ** 2 * (variance + moved**2 * start)
    for _, tau, half in tail:
        halves = (
            halves + (half * unit @ jacobian.T @ (mean_before(step.rest_s or 0.0, tau) - decay(step.time_s, tau))) ** 2
        )
    return np.asarray(np.sqrt(halves))


def within_counts(recorded: LevelStep, left: Array, directions: Array) -> tuple[Array, float]:
    """Variances by a sensor coarser than its noise: of sums of its errors, alike wherever it stands on one count, times
    each column, shape (k,), and of the start that it stood at."""
    y = recorded.output
    room, counts = left_open(y, y - left), np.unique(y, return_inverse=True)[1]
    sums = np.zeros((int(counts.max()) + 1, directions.shape[1]))
    np.add.at(sums, counts, directions * room[:, None])
    whole = (recorded.start - y[0]) / q if (q := resolution(y)) else 0.5
    stood = room.any() and abs(whole - round(whole)) < WHOLE
    return (sums**2).sum(axis=0) / 12, q**2 / 12 * stood


def lasting_variance(left: Array, jacobian: Array, directions: Array) -> Array:
    """Variance of sums of noise times each column, shape (k,), for noise that goes on as ρ of what it was a sample ago.

    ρ is where the residuals are likeliest behind the parameters that took their share of slow noise out of them
    (restricted likelihood of a first-order autoregression); a fast constant is told by the first samples only, too few
    to show by themselves how long the noise remembers.
    """
    count, k = jacobian.shape
    basis = np.linalg.qr(jacobian)[0]
    both = np.column_stack([basis, left])

    def whitened(rho: float) -> tuple[Array, float]:
        white = both.copy()
        white[1:] -= rho * both[:-1]
        white[0] *= np.sqrt(1 - rho**2)
        product = white.T @ white
        square = float(product[k, k] - product[k, :k] @ np.linalg.solve(product[:k, :k], product[:k, k]))
        return product[:k, :k], max(square, 1e-300)

    def unlikely(at: float) -> float:
        rho = float(np.tanh(at))
        product, square = whitened(rho)
        of_parameters = float(np.linalg.slogdet(product)[1])
        return float((count - k) * np.log(square) + of_parameters - np.log(1 - rho**2))

    ends = (0.0, LONGEST_MEMORY)
    found = minimize_scalar(unlikely, bounds=ends, method="bounded", options={"xatol": MEMORY_SETTLED})
    rho = float(np.tanh(found.x))
    power = whitened(rho)[1] / max(count - k, 1) / (1 - rho**2)
    back = np.array([np.full(count, -rho), np.full(count, 1 + rho**2)]) / (1 - rho**2)  # the correlations' inverse
    back[1, [0, -1]] = 1 / (1 - rho**2)
    return np.asarray(power * (directions * solveh_banded(back, directions)).sum(axis=0))
