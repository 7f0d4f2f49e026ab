"""A set of steps → a finished fit: models, intervals, the believed estimate, findings.

The one entry that the command line and a notebook share.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import msgspec
import numpy as np
from threadpoolctl import threadpool_limits

from eaid.arrays import Array, inverse
from eaid.declared import forms
from eaid.estimate.fit import converged, data_part, fit
from eaid.estimate.intervals import with_intervals
from eaid.estimate.runs import bartlett_variance, t_quantile
from eaid.estimate.step_shapes import between_rows, independent, of_another_shape, single_steps, slopes
from eaid.findings import Finding, finding, merged, ranked
from eaid.options import FitGiven, FitOptions
from eaid.results.common import Interval
from eaid.results.fit import Fit, Friction, StepIntervals, StepShape, Uncertainty
from eaid.steps.stepset import LevelStep, StepSet

NAMES = ("change", "tau1", "tau2", "C", "dead_time_s")
LAGS = 16
"""Part of the record up to which noise may remember."""
LONGEST = 1.0
"""Record lengths beyond which the slow time constant is not quoted: its size is then that of the model's form."""
NEARLY = 4.0
"""Difference of AICc from which two exponentials are nearly chosen."""
WIDEST = 3.0
"""Factor by which an interval of a time constant may reach to either side before it says nothing."""


def with_step_intervals(
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


MOST = 1e60
"""Largest size of a number that a result may hold; its cube is still a number."""
R = TypeVar("R", bound=msgspec.Struct)


def quotable(result: R) -> tuple[R, tuple[str, ...]]:
    """The result with unknown numbers as None (an interval with such an end as a whole), and the keys they stood at."""
    found: list[str] = []
    return _kept(result, "", found), tuple(dict.fromkeys(found))


def _kept(value: Any, key: str, found: list[str]) -> Any:
    if isinstance(value, msgspec.Struct):
        changed = {}
        for name in value.__struct_fields__:
            have = getattr(value, name)
            kept = _kept(have, name, found)
            if kept is not have:
                changed[name] = kept
        return msgspec.structs.replace(value, **changed) if changed else value
    if isinstance(value, tuple):
        if len(value) == 2 and all(isinstance(end, float) for end in value):
            if all(_known(end) for end in value):
                return value
            found.append(key)
            return None
        items = [_kept(item, key, found) for item in value]
        return value if all(a is b for a, b in zip(items, value, strict=True)) else tuple(items)
    if isinstance(value, dict):
        entries = {name: _kept(item, key, found) for name, item in value.items()}
        return value if all(entries[name] is value[name] for name in value) else entries
    if isinstance(value, float) and not _known(value):
        found.append(key)
        return None
    return value


def _known(value: float) -> bool:
    return -MOST <= value <= MOST


def fit_steps(stepset: StepSet, options: FitOptions | None = None, progress: Callable[[], None] | None = None) -> Fit:
    """Fit a set of steps and find how sure the result is: what `eaid.fit` calls.

    `progress` is called once per bootstrap refit. `UsageError` for an option that is none, or a model that the kind of
    experiment does not allow; `DataError` without a rising step.
    """
    options = options or FitOptions()
    # the products here are small: threads of BLAS would wait for each other, and round otherwise than one does
    with threadpool_limits(1, user_api="blas"):
        return _fit_steps(stepset, options, progress)


def _fit_steps(stepset: StepSet, options: FitOptions, progress: Callable[[], None] | None) -> Fit:
    if stepset.levels or not stepset.level_steps:
        result = with_intervals(stepset, fit(stepset, options), options, progress)
    else:  # a staircase that never rests: no model of steps from rest
        result = Fit(data=data_part(stepset), uncertainty=Uncertainty("none"))
    shapes = shapes_of(stepset, options)
    of_shapes = tuple(warning for shape in shapes for warning in shape.findings)
    if not shapes and any(warning.code in OTHER_SHAPES for warning in (*result.findings, *stepset.all_findings)):
        shapes = with_step_intervals(stepset.level_steps, of_another_shape(stepset, options), options.ci)
        of_shapes = merged([warning for shape in shapes for warning in shape.findings])
    rows = between_rows(shapes) if "friction" in (options.model or ("friction",)) else ()
    if rows:
        part = result.friction or Friction(options.held_share)
        result = msgspec.structs.replace(result, friction=msgspec.structs.replace(part, levels=(*part.levels, *rows)))
    result, unknown = quotable(result)
    beyond_measure = [finding("numbers-beyond-measure", "data", keys=unknown)] if unknown else []
    of_runs = _not_said_again(stepset.all_findings, result.findings)
    return msgspec.structs.replace(
        result,
        steps=shapes,
        options=given(options, stepset),
        seed=options.seed,
        converged=converged(result),
        findings=ranked((*of_runs, *result.findings, *of_shapes, *beyond_measure)),
    )


def shapes_of(stepset: StepSet, options: FitOptions) -> tuple[StepShape, ...]:
    """Each change of input by itself with its intervals, where that is shown (`single_steps`)."""
    shapes = single_steps(stepset, options)
    return with_step_intervals(stepset.level_steps, shapes, options.ci, options.held_dead_time_s is None)


OTHER_SHAPES = {
    "shape-of-another-kind", "no-shape-fits", "output-decays-under-hold", "decays-under-hold",
}  # fmt: skip
"""Findings that ask what shape single steps have."""
SAID_BY = {"decays-under-hold": "output-decays-under-hold", "window-too-short": "tau2-outlasts-record"}
"""What is said of a run, and the finding of a fit that says it of levels."""


def _not_said_again(of_runs: Sequence[Finding], of_the_fit: Sequence[Finding]) -> tuple[Finding, ...]:
    """Findings of runs that the fit does not say again of its levels."""
    codes = {warning.code for warning in of_the_fit}
    return tuple(warning for warning in of_runs if SAID_BY.get(warning.code) not in codes)


def given(options: FitOptions, stepset: StepSet) -> FitGiven:
    """The options as fit.json keeps them, beside those of reading."""
    values = {name: getattr(options, name) for name in forms(FitOptions)}
    return FitGiven(**values, reading=dict(stepset.reading))
