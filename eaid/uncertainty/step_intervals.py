"""95 % intervals of single steps: change, gain, time constants, C and dead time, from the noise of that one record.

With θ = (change, ln τ1, ln τ2, C, dead time), those that were free, J = ∂y/∂θ and residuals r, the covariance is
A⁻¹ Ω A⁻¹ with A = J'J and Ω the Bartlett sum over J r, the largest of four windows, as within a run of a level
(`run_statistics`), or of noise that is alike all along the record, whichever is larger. The start is a mean over the
rest before the step: its own error, of the same noise, moves all of θ by A⁻¹ J' 1. What one record does not show, how
much steps differ from one another, is not in these intervals.
"""

import math
from collections.abc import Sequence

import msgspec
import numpy as np

from eaid.arrays import Array, inverse
from eaid.findings import finding
from eaid.fitting.shape_curves import slopes
from eaid.fitting.step_shapes import independent
from eaid.results.common import Interval
from eaid.results.steps import StepIntervals, StepShape
from eaid.steps.stepset import LevelStep
from eaid.uncertainty.run_statistics import bartlett_variance
from eaid.uncertainty.student_t import t_quantile

NAMES = ("change", "tau1", "tau2", "C", "dead_time_s")
LAGS = 16
"""Part of the record up to which noise may remember."""
LONGEST = 1.0
"""Record lengths beyond which the slow time constant is not quoted: its size is then that of the model's form."""
NEARLY = 4.0
"""Difference of AICc from which two exponentials are nearly chosen."""
WIDEST = 3.0
"""Factor by which an interval of a time constant may reach to either side before it says nothing."""


def with_intervals(
    steps: Sequence[LevelStep], shapes: Sequence[StepShape], ci: str, dead_time_free: bool = True
) -> tuple[StepShape, ...]:
    """Shapes of some of the steps with their intervals; as they are for `ci` none, or where there are none."""
    if ci == "none" or not shapes:
        return tuple(shapes)
    of_run = {step.name: step for step in steps}
    return tuple(with_interval(of_run[one.run], one, ci, dead_time_free) for one in shapes)


def with_interval(step: LevelStep, shape: StepShape, ci: str = "robust", dead_time_free: bool = True) -> StepShape:
    """One fitted step with its intervals, and a finding where some say nothing."""
    window = float(step.time_s[-1])
    two = shape.tau2 is not None
    free = [True, True, two, shape.shape in ("free", "overshoot"), dead_time_free and shape.dead_time_s > 0]
    names = [name for name, is_free in zip(NAMES, free, strict=True) if is_free]
    refused = any(one.severity == "stop" for one in shape.findings)
    error = {} if refused else dict(zip(names, _errors(step, shape, free, ci).tolist(), strict=True))
    if not all(map(math.isfinite, error.values())):
        error = {}
    wide = {name for name in ("tau1", "tau2") if error.get(name, 0.0) > math.log(WIDEST)}
    if shape.tau2 is not None and shape.tau2 > LONGEST * window:
        wide |= {"tau2", "change"}
    if shape.shape == "one" and _nearly_two(shape):
        wide |= {"tau1", "change"}
    ends: dict[str, Interval] = {}
    for name, half in error.items():
        value = getattr(shape, name)
        if name in wide:
            continue
        if name in ("tau1", "tau2"):
            ends[name] = (value * math.exp(-half), value * math.exp(half))
        else:
            ends[name] = (value - half, value + half)
    change = ends.get("change")
    if change is not None and shape.gain is not None:
        low, high = sorted(end / (shape.level - shape.from_) for end in change)
        ends["gain"] = (low, high)
    open_ = tuple(name for name in names if name not in ends)
    said = (finding("step-leaves-open", shape.run, (shape.level,), open=", ".join(open_)),) if open_ else ()
    return msgspec.structs.replace(shape, ci95=StepIntervals(**ends), findings=(*shape.findings, *said))


def _nearly_two(shape: StepShape) -> bool:
    """Whether two exponentials are better, if not by enough to be chosen: one constant is then a mixture."""
    dead = "+dead" if shape.dead_time_s > 0 else ""
    one, two = (shape.evidence.get(name + dead) for name in ("one", "two"))
    return one is not None and two is not None and two < one - NEARLY


def _errors(step: LevelStep, shape: StepShape, free: Sequence[bool], ci: str) -> Array:
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
        degrees = max(min(independent(left), LAGS) - k, 1.0)  # what the noise remembers is seen in so many stretches
        own = bartlett_variance(step.time_s, directions * left[:, None]).max(axis=0)
        # the fit has taken k parameters' worth of the slow noise out of the residuals
        sums = np.maximum(own, stationary_variance(left, directions) / (1 - k / LAGS))
        variance, per_sample = sums[:-1], float(sums[-1]) / count
    moved = unit @ jacobian.sum(axis=0)
    rested = max(1.0, (step.rest_s or 0.0) * (count - 1) / float(step.time_s[-1]))
    start = per_sample / rested
    # a rest that still moved by more than its noise, 4 start, has as far to go again
    start += max(0.0, step.rest_moved**2 - 4 * start)
    return np.asarray(t_quantile(degrees) * np.sqrt(variance + moved**2 * start))


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
