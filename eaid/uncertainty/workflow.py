"""A set of steps → a finished fit: models, intervals, the believed estimate, findings.

The one entry that the command line and a notebook share.
"""

from collections.abc import Callable, Sequence

import msgspec
from threadpoolctl import threadpool_limits

from eaid.findings import Finding, finding, merged, ranked
from eaid.fitting.between import between_rows, of_another_shape, single_steps
from eaid.fitting.choices import check
from eaid.fitting.fit import converged, data_part, fit
from eaid.results.fit import Fit, FitAsked, FitOptions
from eaid.results.friction import Friction
from eaid.results.quotable import quotable
from eaid.results.steps import StepShape
from eaid.results.uncertainty import Uncertainty
from eaid.steps.stepset import StepSet
from eaid.uncertainty.intervals import with_intervals
from eaid.uncertainty.step_intervals import with_intervals as with_step_intervals


def fit_steps(stepset: StepSet, options: FitOptions | None = None, progress: Callable[[], None] | None = None) -> Fit:
    """Fit a set of steps and find how sure the result is: what `eaid.fit` calls.

    `progress` is called once per bootstrap refit. `UsageError` for an option that is none, or a model that the kind of
    experiment does not allow; `DataError` without a rising step.
    """
    options = options or FitOptions()
    check(options)
    # the products here are small: threads of BLAS would wait for each other, and round otherwise than one does
    with threadpool_limits(1, user_api="blas"):
        return _fit_steps(stepset, options, progress)


def _fit_steps(stepset: StepSet, options: FitOptions, progress: Callable[[], None] | None) -> Fit:
    if stepset.levels or not stepset.level_steps:
        result = with_intervals(stepset, fit(stepset, options), options, progress)
    else:  # a staircase that never rests: no model of steps from rest
        result = Fit(data=data_part(stepset), uncertainty=Uncertainty("none"))
    shapes = shapes_of(stepset, options)
    of_shapes = tuple(doubt for shape in shapes for doubt in shape.findings)
    if not shapes and any(doubt.code in OTHER_SHAPES for doubt in (*result.findings, *stepset.all_findings)):
        shapes = with_step_intervals(stepset.level_steps, of_another_shape(stepset, options), options.ci)
        of_shapes = merged([doubt for shape in shapes for doubt in shape.findings])
    rows = between_rows(shapes) if "friction" in (options.models or ("friction",)) else ()
    if rows:
        part = result.friction or Friction(options.held_share)
        result = msgspec.structs.replace(result, friction=msgspec.structs.replace(part, levels=(*part.levels, *rows)))
    result, unknown = quotable(result)
    beyond_measure = [finding("numbers-beyond-measure", "data", keys=unknown)] if unknown else []
    of_runs = _not_said_again(stepset.all_findings, result.findings)
    return msgspec.structs.replace(
        result,
        steps=shapes,
        options=asked(options, stepset),
        seed=options.seed,
        converged=converged(result),
        findings=ranked((*of_runs, *result.findings, *of_shapes, *beyond_measure)),
    )


def shapes_of(stepset: StepSet, options: FitOptions) -> tuple[StepShape, ...]:
    """Each change of input by itself with its intervals, where that is shown (`single_steps`)."""
    shapes = single_steps(stepset, options)
    return with_step_intervals(stepset.level_steps, shapes, options.ci, options.dead_time_s is None)


OTHER_SHAPES = {
    "shape-of-another-kind", "no-shape-fits", "output-decays-under-hold", "decays-under-hold",
}  # fmt: skip
"""Findings that ask what shape single steps have."""
SAID_BY = {"decays-under-hold": "output-decays-under-hold", "window-too-short": "tau2-outlasts-record"}
"""What is said of a run, and the finding of a fit that says it of levels."""


def _not_said_again(of_runs: Sequence[Finding], of_the_fit: Sequence[Finding]) -> tuple[Finding, ...]:
    """Findings of runs that the fit does not say again of its levels."""
    codes = {doubt.code for doubt in of_the_fit}
    return tuple(doubt for doubt in of_runs if SAID_BY.get(doubt.code) not in codes)


def asked(options: FitOptions, stepset: StepSet) -> FitAsked:
    """The options as fit.json keeps them, beside those of reading."""
    return FitAsked(**msgspec.structs.asdict(options), reading=dict(stepset.reading))
