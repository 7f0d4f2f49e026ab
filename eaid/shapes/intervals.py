"""95 % intervals of one fitted step, by its residuals as they are: what noise that remembers, a rest that still moved
and the tail of the step before make of each number."""

import math
from collections.abc import Sequence
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
from eaid.results.models import StepIntervals, StepShape
from eaid.shapes.curves import slopes
from eaid.shapes.shape import independent_samples
from eaid.steps.stepset import LevelStep

# What the steps before a step have left to go, Σ a e^(−t/τ): a, τ, and the half-width of the 95 % interval of a
TailTerms: TypeAlias = tuple[tuple[float, float, float], ...]


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
