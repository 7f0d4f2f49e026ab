"""Steps from level to level: each change of input from its own start with its fitted curve, and gain over level."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from eaid.report import style
from eaid.report.figures.steps import MODEL, fine_times, label_ends, some_levels
from eaid.report.rig import over
from eaid.report.thin import thinned
from eaid.results.steps import StepShape
from eaid.steps.stepset import LevelStep, StepSet

MOST = 12
"""Most steps that are drawn."""


def step_text(step: LevelStep | StepShape) -> str:
    """A step as it is named: 50 → 100."""
    before = step.from_level if isinstance(step, LevelStep) else step.from_
    return f"{before:.3g} → {step.level:.3g}"


def paired(data: StepSet, shapes: Sequence[StepShape]) -> list[tuple[LevelStep, StepShape]]:
    """Each recorded step and what was fitted to it."""
    known = {(one.run, one.from_, one.level): one for one in shapes}
    keys = [((one.name, one.from_level, one.level), one) for one in data.level_steps]
    return [(step, known[key]) for key, step in keys if key in known]


def draw_level_steps(axes: Axes, data: StepSet, shapes: Sequence[StepShape]) -> None:
    """Change of output over time since each step, and the fitted curves (dashed)."""
    pairs = some_levels(paired(data, shapes), MOST)
    ends = []
    longest = max(float(step.time_s[-1]) for step, _ in pairs)
    for (step, shape), colour in zip(pairs, style.level_colours(len(pairs)), strict=True):
        axes.plot(*thinned(step.time_s, step.output - shape.start, 1200), color=colour, linewidth=1.5, alpha=0.75)
        fine = fine_times(float(step.time_s[-1]))
        axes.plot(fine, shape.predict(fine) - shape.start, **MODEL)
        end = float(np.mean(step.output[-max(1, len(step.output) // 50) :]))
        ends.append((end - shape.start, step_text(step), colour))
    axes.set(
        xlabel="Time since the step (s)", ylabel=f"Change of output ({data.output_unit or '1'})", xlim=(0, longest)
    )
    label_ends(axes, ends, longest)


def level_steps(data: StepSet, shapes: Sequence[StepShape]) -> Figure:
    """(a) each change of output and its curve, (b) the gain Δy/Δu over the level, up and down apart."""
    figure, (responses, gains) = style.page(3.0, 1, 2, width_ratios=(2.2, 1))
    draw_level_steps(responses, data, shapes)
    for edge, marker, colour in (("up", "^", style.BLUE), ("down", "v", style.VERMILLION)):
        rows = [(one.level, one.gain) for one in shapes if one.edge == edge and one.gain is not None]
        if rows:
            gains.plot(*zip(*rows, strict=True), marker, color=colour, label=edge)
    unit = f"{data.output_unit or 'output'}/{data.input_unit or 'input'}"
    gains.set(xlabel=over(data.input_unit), ylabel=f"Gain ({unit})")
    style.legend_above(gains, 2)
    style.letter(responses, "a", "dashed: fitted")
    style.letter(gains, "b")
    return figure
