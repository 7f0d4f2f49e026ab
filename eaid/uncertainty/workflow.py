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
    experiment does not allow; `DataError` without a rising step, or for weights that the repeats do not give.
    """
    options = options or FitOptions()
    check(options)
    # the products here are small: threads of BLAS would wait for each other, and round otherwise than one does
    with threadpool_limits(1, user_api="blas"):
        return _fit_steps(stepset, options, progress)


def _fit_steps(stepset: StepSet, options: FitOptions, progress: Callable[[], None] | None) -> Fit:
    if stepset.levels or not stepset.level_steps:
        found = with_intervals(stepset, fit(stepset, options), options, progress)
    else:  # a staircase that never rests: no model of steps from rest
        found = Fit(data=data_part(stepset), uncertainty=Uncertainty("none"))
    shapes = shapes_of(stepset, options)
    doubts = tuple(said for one in shapes for said in one.findings)
    if not shapes and any(one.code in OTHER_SHAPES for one in (*found.findings, *stepset.all_findings)):
        shapes = with_step_intervals(stepset.level_steps, of_another_shape(stepset, options), options.ci)
        doubts = merged([said for one in shapes for said in one.findings])
    rows = between_rows(shapes) if "friction" in (options.models or ("friction",)) else ()
    if rows:
        part = found.friction or Friction(options.held_share)
        found = msgspec.structs.replace(found, friction=msgspec.structs.replace(part, levels=(*part.levels, *rows)))
    found, unknown = quotable(found)
    if unknown:
        doubts = (*doubts, finding("numbers-beyond-measure", "data", keys=unknown))
    return msgspec.structs.replace(
        found,
        steps=shapes,
        options=asked(options, stepset),
        seed=options.seed,
        converged=converged(found),
        findings=ranked((*_beside(stepset.all_findings, found.findings), *found.findings, *doubts)),
    )


def shapes_of(stepset: StepSet, options: FitOptions) -> tuple[StepShape, ...]:
    """Each change of input by itself with its intervals, where that is shown (`single_steps`)."""
    found = single_steps(stepset, options)
    return with_step_intervals(stepset.level_steps, found, options.ci, options.dead_time_s is None)


OTHER_SHAPES = {
    "shape-of-another-kind", "no-shape-fits", "output-decays-under-hold", "decays-under-hold",
}  # fmt: skip
"""Findings that ask what shape single steps have."""
SAID_BY = {"decays-under-hold": "output-decays-under-hold", "window-too-short": "tau2-outlasts-record"}
"""What is said of a run, and the finding of a fit that says it of levels."""


def _beside(of_runs: Sequence[Finding], of_the_fit: Sequence[Finding]) -> tuple[Finding, ...]:
    """Findings of runs that the fit does not say again of its levels."""
    said = {one.code for one in of_the_fit}
    return tuple(one for one in of_runs if SAID_BY.get(one.code) not in said)


def asked(options: FitOptions, stepset: StepSet) -> FitAsked:
    """The options as fit.json keeps them, beside those of reading."""
    return FitAsked(**msgspec.structs.asdict(options), reading=dict(stepset.reading))
