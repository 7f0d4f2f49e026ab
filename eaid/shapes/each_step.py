"""Each change of input by itself, a step from level to level behind the tail of the one before it in its log; with 95 %
intervals by its residuals as they are: what noise that remembers, a rest that still moved and that tail make of each
number."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TypeAlias

import msgspec
import numpy as np

from eaid.arrays import Array, inverse
from eaid.estimate.scatter import bartlett_variance
from eaid.estimate.spread import t_quantile
from eaid.findings import finding
from eaid.options import FitOptions
from eaid.plant.steps import decay, rise
from eaid.results.common import Interval
from eaid.results.models import FrictionLevel, LevelIntervals, StepIntervals, StepShape
from eaid.shapes.curves import slopes
from eaid.shapes.shape import fit_step, independent_samples
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
    for k in sorted(range(len(steps)), key=lambda k: (steps[k].source, steps[k].at_s)):
        step, last = steps[k], steps[before]
        lasted, until = step.at_s - last.at_s, float(last.time_s[-1]) * (1 + 2 / len(last.time_s))
        follows = before >= 0 and last.source == step.source and last.level == step.from_level and 0 < lasted <= until
        tail = tail_of(found[before], tail, lasted) if follows else ()
        rest_s, output, start, moved = step.rest_s or 0.0, step.output, step.start, step.rest_moved
        for size, tau, _ in tail:  # as it would have been behind a hold that had settled
            output = output - size * decay(step.time_s, tau)
            start -= size * mean_before(rest_s, tau)
            moved -= abs(size * mean_before(rest_s / 2, tau) * float(rise(np.array(-rest_s / 2), tau)))
        alone = replace(step, output=output, start=start, rest_moved=max(moved, 0.0)) if tail else step
        shape = add_intervals(alone, fit_step(alone, options), options, tail)
        found[k] = msgspec.structs.replace(shape, tail=tuple((size, tau) for size, tau, _ in tail))
        before = k
    return tuple(found[k] for k in range(len(steps)))


def tail_of(shape: StepShape, before: TailTerms, lasted_s: float) -> TailTerms:
    """What a fitted step, and the tail before it, have left to go after a hold."""
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
    return tuple(part for part in parts if abs(part[0]) + part[2] > LEAST_TAIL * abs(shape.change))


def fit_another_shape(stepset: StepSet, options: FitOptions) -> tuple[StepShape, ...]:
    """The first rise to each level that asks for another shape than the paper's, with intervals, where most do."""
    first_rises = {step.level: step for step in reversed(stepset.level_steps) if step.edge == "up"}
    asking: list[StepShape] = []
    for k, step in enumerate(first_rises[level] for level in sorted(first_rises)):
        shape = fit_step(step, options)
        if any(found.code == "other-shape-fits-better" for found in shape.findings):
            asking.append(add_intervals(step, shape, options))
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
NEARLY_TWO = 4.0  # Difference of AICc from which two exponentials are nearly chosen
WIDEST_FACTOR = 3.0  # Factor by which an interval of a time constant may reach to either side before it says nothing


def add_intervals(step: LevelStep, shape: StepShape, options: FitOptions, tail: TailTerms = ()) -> StepShape:
    """One fitted step with its intervals, and a finding where some say nothing; `tail` was taken from its output."""
    if options.ci == "none":
        return shape
    window = float(step.time_s[-1])
    two = shape.tau2 is not None
    free = [True, True, two, shape.shape in ("free", "overshoot")]
    free.append(options.held_dead_time_s is None and shape.dead_time_s > 0)
    names = [name for name, is_free in zip(STEP_NAMES, free, strict=True) if is_free]
    refused = any(one.severity == "stop" for one in shape.findings)
    error = {} if refused else dict(zip(names, _errors(step, shape, free, options.ci, tail).tolist(), strict=True))
    if not all(map(math.isfinite, error.values())):
        error = {}
    if shape.tau2 is not None and shape.tau2 > SHORT_RECORD * window:
        error = {name: 2.0 * half for name, half in error.items()}
    most = {"tau1": math.log(WIDEST_FACTOR), "tau2": math.log(WIDEST_FACTOR), "C": 1.0}
    wide = {name for name, half in most.items() if error.get(name, 0.0) > half}
    if shape.tau2 is not None and shape.tau2 > LONGEST_TAU2 * window:
        wide |= {"tau2", "change"}
    one, more = (shape.evidence.get(name + "+dead" * (shape.dead_time_s > 0)) for name in ("one", "two"))
    if shape.shape == "one" and one is not None and more is not None and more < one - NEARLY_TWO:  # a mixture
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


def _errors(step: LevelStep, shape: StepShape, free: Sequence[bool], ci: str, tail: TailTerms) -> Array:
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
        seen = min(
            independent_samples(left, fewest=k + 1.0), NOISE_LAGS
        )  # what the noise remembers is seen in so many stretches
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
            halves + (half * unit @ jacobian.T @ (mean_before(step.rest_s or 0.0, tau) - decay(step.time_s, tau))) ** 2
        )
    return np.asarray(np.sqrt(halves))


def stationary_variance(left: Array, directions: Array) -> Array:
    """Variance of sums of noise times each column, shape (k,), for noise whose autocovariance is that of `left`.

    A fast constant is told by the first samples only: too few to show by themselves how long the noise remembers.
    Autocovariances up to a sixteenth of the record, with Bartlett's weights.
    """
    count = len(left)
    size = 1 << (2 * count - 1).bit_length()
    lags = max(1, count // NOISE_LAGS)

    def correlations(columns: Array) -> Array:
        power = np.abs(np.fft.rfft(columns, size, axis=0)) ** 2
        return np.asarray(np.fft.irfft(power, size, axis=0)[:lags])

    noise = correlations(left) / count * (1 - np.arange(lags) / lags)
    noise[1:] *= 2
    return np.asarray(np.maximum(noise @ correlations(directions), 0.0))
