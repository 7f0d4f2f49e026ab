"""Steps from level to level: each from its own start with its fitted curve; gain and time constants over the level."""

from collections.abc import Sequence
from functools import partial

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from eaid.arrays import Array
from eaid.report import style
from eaid.report.figures.steps import Curve, draw_curves, some_levels
from eaid.report.figures.values import axis_label, points
from eaid.report.ready import Ready, caption
from eaid.report.results import Results
from eaid.report.rig import over
from eaid.results.fit import StepShape
from eaid.steps.stepset import LevelStep, StepSet

MOST = 12
"""Most steps that are drawn."""


def level_steps_ready(results: Results) -> Ready | None:
    """Steps from level to level, where some were recorded and fitted."""
    for one in results.data:
        data, fit = one.result, results.fit(one.result.kind)
        if fit is not None and (pairs := paired(data, fit.steps)):
            shares = [(shape.fit_pct, step_text(shape)) for _, shape in pairs if shape.fit_pct is not None]
            said = caption("level_steps", count=len(pairs), worst=min(shares))
            return Ready(partial(level_steps, data, fit.steps), said)
    return None


def over_level_ready(results: Results) -> Ready | None:
    """Gain and time constants of steps from level to level over the level."""
    fit = next((one.result for one in results.fits if len(one.result.steps) > 1), None)
    if fit is None:
        return None
    units = fit.data.input_unit, fit.data.output_unit
    gains = {edge: [s.gain for s in fit.steps if s.edge == edge and s.gain is not None] for edge in ("up", "down")}
    said = caption("steps_over_level", edges=gains, units=units)
    return Ready(partial(over_level, fit.steps, units), said)


def step_text(step: StepShape) -> str:
    """A step as it is named: 50 → 100."""
    return f"{step.from_:.3g} → {step.level:.3g}".replace("-", "−")


def paired(data: StepSet, shapes: Sequence[StepShape]) -> list[tuple[LevelStep, StepShape]]:
    """Each recorded step and what was fitted to it."""
    known = {(one.run, one.from_, one.level): one for one in shapes}
    keys = [((one.name, one.from_level, one.level), one) for one in data.level_steps]
    return [(step, known[key]) for key, step in keys if key in known]


def level_steps(data: StepSet, shapes: Sequence[StepShape]) -> Figure:
    """Change of output over time since each step, and the fitted curves (dashed)."""
    figure, (axes,) = style.page(3.0)
    draw_level_steps(axes, data, shapes)
    return figure


def draw_level_steps(axes: Axes, data: StepSet, shapes: Sequence[StepShape]) -> None:
    """Draw them on one pair of axes."""
    curves = [
        Curve(step.time_s, step.output - shape.start, step_text(shape), partial(_change, shape))
        for step, shape in some_levels(paired(data, shapes), MOST)
    ]
    axes.set_ylabel(f"Change of output ({data.output_unit or '1'})")
    draw_curves(axes, curves, "fitted")


def _change(shape: StepShape, t_s: Array) -> Array:
    return shape.predict(t_s) - shape.start


EDGES = (("up", "^", style.BLUE), ("down", "v", style.VERMILLION))
"""Edge, marker and colour."""


def over_level(shapes: Sequence[StepShape], units: tuple[str, str]) -> Figure:
    """Gain Δy/Δu, τ1 and τ2, where there is one, of each step over the level that it goes to, up and down apart."""
    unit = f"{units[1] or 'output'}/{units[0] or 'input'}"
    labels = {"gain": f"Gain ({unit})", "tau1": axis_label("tau1", "s"), "tau2": axis_label("tau2", "s")}
    drawn = [name for name in labels if any(getattr(one, name) is not None for one in shapes)]
    figure, axes = style.page(2.5, 1, len(drawn))
    for mark, name, panel in zip("abc", drawn, axes, strict=False):
        for edge, marker, colour in EDGES:
            rows = [one for one in shapes if one.edge == edge and getattr(one, name) is not None]
            if rows:
                values = np.array([getattr(one, name) for one in rows], dtype=float)
                ends = [getattr(one.ci95, name) for one in rows]
                look = {"fmt": marker, "color": colour, "label": edge, "markersize": 5, "alpha": 0.8}
                points(panel, [one.level for one in rows], values, ends, **look)
        panel.set(xlabel=over(units[0]), ylabel=labels[name])
        low, high = panel.get_ylim()
        if low > 0:
            panel.set_ylim(0, 1.08 * high)
        style.letter(panel, mark)
    style.legend_over(figure, axes[0])
    return figure
