"""The two pictures at the top of the page: measured against model, and the controllers against their reference."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from eaid.arrays import Array
from eaid.report import style
from eaid.report.figures.steps import MODEL, Model, draw_steps, some_levels
from eaid.report.figures.values import NAMES, axis_label, draw_values
from eaid.report.rig import over, quantity
from eaid.report.thin import thinned_at
from eaid.results.fit import Fit
from eaid.results.recorded import LogFit
from eaid.steps.stepset import StepSet

WIDTH_IN, HEIGHT_IN = 5.0, 2.75
SHOWN_S = 20.0
"""Most of a replay that the picture at the top shows [s]."""


def one_panel(draw: Callable[[Axes], None]) -> Figure:
    """One pair of axes, with the legend of what has a name above it."""
    figure, (axes,) = style.sheet(WIDTH_IN, HEIGHT_IN)
    draw(axes)
    if axes.get_legend() is None and axes.get_legend_handles_labels()[1]:
        style.legend_above(axes)
    return figure


def measured_and_model(data: StepSet, fitted: Mapping[float, Model]) -> Figure:
    """Up to six levels, spread over the range: what was measured and the model's curve."""
    figure, (axes,) = style.sheet(WIDTH_IN, HEIGHT_IN)
    few = StepSet(data.kind, data.input_unit, data.output_unit, data.apparatus, tuple(some_levels(data.levels, 6)))
    draw_steps(axes, few, fitted)
    return figure


def log_and_model(log: LogFit, units: tuple[str, str]) -> Figure:
    """(top) the input, (bottom) the measured output and the model driven by that input alone."""
    figure, (acting, output) = style.sheet(WIDTH_IN, HEIGHT_IN, 2, 1, sharex=True, height_ratios=(1, 2))
    acting.plot(log.curve.time_s, log.curve.input, color=style.GREEN, linewidth=0.7, drawstyle="steps-post")
    output.plot(log.curve.time_s, log.curve.measured, color=style.SKY, linewidth=2.0, label="measured")
    output.plot(log.curve.time_s, log.curve.model, label="model", **MODEL)
    acting.set(ylabel=over(units[0]))
    output.set(ylabel=quantity(units[1]), xlabel="Time of the log (s)")
    output.margins(x=0)
    style.legend_over(figure, output)
    return figure


def controllers(traces: Mapping[str, Mapping[str, Array]], from_s: float, unit: str) -> Figure:
    """(top) reference and the output under each controller, (bottom) the error, where it counts."""
    figure, (output, error) = style.sheet(WIDTH_IN, HEIGHT_IN, 2, 1, sharex=True, height_ratios=(1.6, 1))
    top = 1e-9
    for i, (name, trace) in enumerate(traces.items()):
        look = style.controller_look(name, i)
        t = trace["time_s"]
        shown = (t >= from_s) & (t <= from_s + SHOWN_S)
        t, wanted, y = t[shown], trace["reference_nm"][shown], trace["torque_nm"][shown]
        if i == 0:
            output.plot(t[thinned_at(wanted, 1500)], wanted[thinned_at(wanted, 1500)], color=style.GREY,
                        linewidth=2.4, alpha=0.6, label="reference")  # fmt: skip
        for axes, values in ((output, y), (error, wanted - y)):
            keep = thinned_at(values, 1500)
            axes.plot(t[keep], values[keep], linewidth=1.0, label=style.controller_name(name), **look)
        top = max(top, float(np.max(np.abs(wanted - y)))) if len(y) else top
    output.set(ylabel=quantity(unit))
    error.set(ylabel=f"Error ({unit})", xlabel="Time (s)", ylim=(-1.1 * top, 1.1 * top))
    output.margins(x=0)
    style.legend_above(output)
    return figure


def values_over_level(
    fits: Sequence[tuple[str, Fit]],
    draw: Callable[[Sequence[Axes], Sequence[tuple[str, Fit]]], None] = draw_values,
) -> Figure:
    """T_s, τ1 and τ2 over the level, of one fit or of two to compare: levels with their intervals, or curves."""
    figure, axes = style.sheet(WIDTH_IN, HEIGHT_IN, 1, 3)
    draw(axes, fits)
    for name, panel in zip(NAMES, axes, strict=True):
        panel.set_title(axis_label(name, fits[0][1].data.output_unit))
    if len(fits) > 1:
        style.legend_over(figure, axes[0])
    return figure
