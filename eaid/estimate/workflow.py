"""A set of steps → a finished fit: models, intervals, the believed estimate, findings.

The one entry that the command line and a notebook share.
"""

from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import msgspec
from threadpoolctl import threadpool_limits

from eaid.declared import forms
from eaid.estimate.fit import converged, data_part, fit
from eaid.estimate.intervals import with_intervals
from eaid.estimate.step_shapes import between_rows, of_another_shape, single_steps, with_step_intervals
from eaid.findings import Finding, finding, merged, ranked
from eaid.options import FitGiven, FitOptions
from eaid.results.fit import Fit, Friction, StepShape, Uncertainty
from eaid.results.verdict import judged
from eaid.steps.stepset import StepSet

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
        first = fit(stepset, options)
        still = next((one for one in first.findings if one.code == "curve-explains-little"), None)
        if still is not None and len(still.levels) < len(first.data.levels) - len(options.hold_out):
            stepset = stepset.without(still.levels, still)
            first = fit(stepset, options)
        result = with_intervals(stepset, first, options, progress)
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
    return judged(
        msgspec.structs.replace(
            result,
            steps=shapes,
            options=given(options, stepset),
            seed=options.seed,
            converged=converged(result),
            findings=ranked((*of_runs, *result.findings, *of_shapes, *beyond_measure)),
        )
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
