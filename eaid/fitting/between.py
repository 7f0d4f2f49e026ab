"""Steps between two levels as rows of the friction model: change, time constants, shape, each from its own start."""

from collections.abc import Sequence

from eaid.fitting.step_shapes import fit_step, may_ask
from eaid.results.fit import FitOptions
from eaid.results.friction import FrictionLevel, LevelIntervals
from eaid.results.steps import StepShape
from eaid.steps.stepset import LevelStep, StepSet

FEW = 3
"""Steps up to which each is shown by itself, too."""
MOST = 200
"""Rises up to which all are, where the first ones to a level ask for another shape."""


def single_steps(stepset: StepSet, options: FitOptions) -> tuple[StepShape, ...]:
    """The shape of each change of input, where some go from level to level, where they are few, or where it is asked.

    Steps from rest are fitted together, as levels, too; these are beside them.
    """
    steps = stepset.level_steps
    between = any(0.0 not in (step.from_level, step.level) for step in steps)
    asked = options.shape != "auto" or options.dead_time_s is not None
    wanted = steps if between or asked or len(steps) <= FEW else ()
    return tuple(fit_step(step, options) for step in wanted)


def of_another_shape(stepset: StepSet, options: FitOptions) -> tuple[StepShape, ...]:
    """Rises that ask for another shape than the paper's, where most of the first ones to a level do."""
    rises = [step for step in stepset.level_steps if step.edge == "up"]
    first = {step.level: step for step in reversed(rises)}.values()
    found: dict[str, StepShape | None] = {}
    most = len(first)
    for step in first:
        found[step.name] = _asking(step, options)
        most -= found[step.name] is None
        if 2 * most <= len(first):  # it can be most of them no more
            return ()
    if len(rises) <= MOST:
        found |= {step.name: _asking(step, options) for step in rises if step.name not in found}
    shapes = [found.get(step.name) for step in rises]
    return tuple(shape for shape in shapes if shape is not None)


def _asking(step: LevelStep, options: FitOptions) -> StepShape | None:
    """The shape of a step, where it is another than the paper's."""
    shape = fit_step(step, options) if may_ask(step, options) else None
    asks = shape is not None and any(one.code == "other-shape-fits-better" for one in shape.findings)
    return shape if asks else None


def between_rows(shapes: Sequence[StepShape]) -> tuple[FrictionLevel, ...]:
    """Those that neither begin nor end at rest as rows of the friction model."""
    return tuple(row_of(one) for one in shapes if one.from_ != 0 and one.level != 0)


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
        ci95=LevelIntervals(Ts=one.ci95.change, tau1=one.ci95.tau1, tau2=one.ci95.tau2, C=one.ci95.C),
    )
