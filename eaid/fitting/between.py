"""Steps between two levels as rows of the friction model: change, time constants, shape, each from its own start."""

from collections.abc import Sequence

from eaid.fitting.step_shapes import fit_step, may_ask
from eaid.options import FitOptions
from eaid.results.fit import FrictionLevel, LevelIntervals, StepShape
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
    asked = options.shape != "auto" or options.held_dead_time_s is not None
    return tuple(fit_step(step, options) for step in steps) if between or asked or len(steps) <= FEW else ()


def of_another_shape(stepset: StepSet, options: FitOptions) -> tuple[StepShape, ...]:
    """Rises that ask for another shape than the paper's, where most of the first ones to a level do."""
    rises = [step for step in stepset.level_steps if step.edge == "up"]
    first_rises = {step.level: step for step in reversed(rises)}.values()
    shapes: dict[str, StepShape | None] = {}
    may_be_asking = len(first_rises)
    for step in first_rises:
        shapes[step.name] = _other_shape(step, options)
        may_be_asking -= shapes[step.name] is None
        if 2 * may_be_asking <= len(first_rises):  # it can be most of them no more
            return ()
    if len(rises) <= MOST:
        shapes |= {step.name: _other_shape(step, options) for step in rises if step.name not in shapes}
    return tuple(shape for step in rises if (shape := shapes.get(step.name)) is not None)


def _other_shape(step: LevelStep, options: FitOptions) -> StepShape | None:
    """The shape of a step, where it is another than the paper's."""
    shape = fit_step(step, options) if may_ask(step, options) else None
    asks = shape is not None and any(found.code == "other-shape-fits-better" for found in shape.findings)
    return shape if asks else None


def between_rows(shapes: Sequence[StepShape]) -> tuple[FrictionLevel, ...]:
    """Those that neither begin nor end at rest as rows of the friction model."""
    return tuple(row_of(shape) for shape in shapes if shape.from_ != 0 and shape.level != 0)


def row_of(step: StepShape) -> FrictionLevel:
    """One fitted step; a single exponential has its constant twice."""
    return FrictionLevel(
        step.level,
        step.change,
        step.tau1,
        step.tau2 if step.tau2 is not None else step.tau1,
        step.C,
        from_=step.from_,
        start=step.start,
        shape=step.shape,
        delay_s=step.dead_time_s,
        rmse=step.rmse,
        samples=step.samples,
        fit_pct=step.fit_pct,
        R2=step.R2,
        ci95=LevelIntervals(Ts=step.ci95.change, tau1=step.ci95.tau1, tau2=step.ci95.tau2, C=step.ci95.C),
    )
