"""Steps between two levels as rows of the friction model: change, time constants, shape, each from its own start."""

from eaid.findings import Finding
from eaid.fitting.options import FitOptions
from eaid.fitting.step_shapes import ShapeOptions, fit_step
from eaid.models.parameters import SHARE
from eaid.results.fit import FrictionLevel
from eaid.results.steps import StepShape
from eaid.steps.stepset import StepSet


def between_rows(stepset: StepSet, options: FitOptions) -> tuple[tuple[FrictionLevel, ...], tuple[Finding, ...]]:
    """The steps that neither begin nor end at rest, in the order of the set, and what is to be doubted of them."""
    steps = [step for step in stepset.level_steps if step.from_level != 0 and step.level != 0]
    how = ShapeOptions(options.shape, share=options.share or SHARE)  # type: ignore[arg-type]  # checked
    found = [fit_step(step, how) for step in steps]
    return tuple(row_of(one) for one in found), tuple(said for one in found for said in one.findings)


def row_of(one: StepShape) -> FrictionLevel:
    """One fitted step; a single exponential has its constant twice."""
    return FrictionLevel(
        one.level,
        one.change,
        one.tau1,
        one.tau2 if one.tau2 is not None else one.tau1,
        one.C,
        from_=one.from_,
        start=one.start,
        shape=one.shape,
        delay_s=one.dead_time_s,
        rmse=one.rmse,
        samples=one.samples,
        fit_pct=one.fit_pct,
        R2=one.R2,
    )
