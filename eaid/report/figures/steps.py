"""Step responses on one pair of axes: the mean of each level, ± sd, its model, and the level at the curve's end."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TypeVar

import numpy as np
from bokeh.models import ColumnDataSource, Range1d
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import BoundaryNorm

from eaid.arrays import Array
from eaid.models import nonlinear
from eaid.report import style
from eaid.report.figures.panels import MODEL
from eaid.report.live import Live, Plot
from eaid.report.rig import level_text, over, quantity
from eaid.report.thin import thinned
from eaid.results.fit import Fit
from eaid.steps.stepset import StepSet

Model = Callable[[Array], Array]
T = TypeVar("T")
LABELLED = 14
"""Most levels that are named at the ends of their curves; beyond, a colour bar names them."""
DRAWN, LIVE = 40, 24
"""Most levels that are drawn, and most of a live plot: more hide each other."""


def nonlinear_curves(fit: Fit | None, data: StepSet) -> dict[float, Model]:
    """Level → the nonlinear model's step response."""
    if fit is None or fit.nonlinear is None:
        return {}
    model = fit.nonlinear.parameters
    return {one.level: partial(nonlinear.step_response, model, duty_pct=one.level) for one in data.levels}


def single_curves(fit: Fit | None) -> dict[float, Model]:
    """Level → its own fitted curve."""
    rows = fit.friction.levels if fit is not None and fit.friction is not None else ()
    return {row.level: row.predict for row in rows}


def model_curves(fit: Fit | None, data: StepSet | None) -> dict[float, Model]:
    """Level → model curve of a fit: the nonlinear model, else the single levels' curves."""
    return nonlinear_curves(fit, data) or single_curves(fit) if data is not None else {}


def some_levels(levels: Sequence[T], most: int = DRAWN) -> list[T]:
    """All levels, or so many of them spread evenly, the first and the last among them."""
    if len(levels) <= most:
        return list(levels)
    return [levels[round(k * (len(levels) - 1) / (most - 1))] for k in range(most)]


def end_of(values: Array) -> float:
    """Where a curve ends: the mean of its last fiftieth."""
    return float(np.mean(values[-max(1, len(values) // 50) :]))


def fine_times(t_end: float, points: int = 150) -> Array:
    """Instants at which a model is drawn [s]: dense where it is steep."""
    return np.unique(np.concatenate([[0.0], np.geomspace(1e-3, 1, points) * t_end]))


@dataclass(frozen=True, eq=False)
class Curve:
    """One level: what was measured, its model, and what stands at its end."""

    time_s: Array
    measured: Array
    text: str
    model: Model | None = None
    sd: Array | None = None
    """Half of the band around it; None: no band."""


def draw_curves(axes: Axes, curves: Sequence[Curve], said: str, bar: tuple[Sequence[float], str] | None = None) -> None:
    """Draw each level's curve, its band and its model (dashed, `said` in the legend), and its text at the end.

    `bar` holds levels and label of a colour bar that stands in place of the texts.
    """
    colours = style.level_colours(len(curves))
    longest = max(float(one.time_s[-1]) for one in curves)
    for one, colour in zip(curves, colours, strict=True):
        if one.sd is not None:
            some = slice(None, None, max(1, len(one.time_s) // 400))
            t, mean, sd = one.time_s[some], one.measured[some], one.sd[some]
            axes.fill_between(t, mean - sd, mean + sd, color=colour, alpha=0.2, linewidth=0)
        t, mean = thinned(one.time_s, one.measured, 1200)
        axes.plot(t, mean, color=colour, linewidth=1.5, alpha=0.75, solid_capstyle="round")
        if one.model is not None:
            fine = fine_times(float(one.time_s[-1]))
            axes.plot(fine, one.model(fine), **MODEL)
    axes.set(xlabel="Time since the step (s)", xlim=(0, longest))
    if bar is None:
        ends = [(end_of(one.measured), one.text, colour) for one, colour in zip(curves, colours, strict=True)]
        label_ends(axes, ends, longest)
    else:
        level_bar(axes, *bar)
    spread = " ± sd" if any(one.sd is not None for one in curves) else ""
    axes.plot([], [], color=colours[len(colours) // 2], linewidth=1.5, alpha=0.75, label="measured" + spread)
    if any(one.model is not None for one in curves):
        axes.plot([], [], label=said, **MODEL)
    style.legend_above(axes, 2)


def draw_steps(
    axes: Axes,
    data: StepSet,
    fitted: Mapping[float, Model],
    notes: Mapping[float, str] | None = None,
    spread: bool = False,
    said: str = "model",
) -> None:
    """Draw each level's mean, its model (dashed) and, on request, the band of ± one sd; `notes` follow its name."""
    levels = some_levels(data.levels)
    notes = {level: f": {note}" for level, note in (notes or {}).items()}
    curves = [
        Curve(
            one.time_s, one.mean, level_text(one.level, data.input_unit) + notes.get(one.level, ""),
            fitted.get(one.level), one.sd if spread and len(one.runs) > 1 else None,
        )
        for one in levels
    ]  # fmt: skip
    axes.set_ylabel(quantity(data.output_unit))
    named = len(levels) <= LABELLED
    draw_curves(axes, curves, said, None if named else ([one.level for one in levels], over(data.input_unit)))


def level_bar(axes: Axes, levels: Sequence[float], label: str) -> None:
    """A colour bar of the levels beside the axes."""
    norm = BoundaryNorm(np.concatenate([[0], np.arange(len(levels)) + 1.0]) - 0.5, 256)
    bar = axes.figure.colorbar(ScalarMappable(norm, style.level_map()), ax=axes, label=label, pad=0.02)
    places = np.unique(np.linspace(0, len(levels) - 1, 6).round().astype(int))
    bar.set_ticks(list(places), labels=[f"{levels[k]:.3g}" for k in places])


def label_ends(axes: Axes, ends: Sequence[tuple[float, str, str]], x: float) -> None:
    """Write a text at the right end of each curve, moved apart where curves end close together."""
    low, high = axes.get_ylim()
    height_in = axes.get_window_extent().height / axes.figure.dpi
    gap = (high - low) * 1.15 * style.SMALLEST_PT / 72 / height_in
    ordered = sorted(ends)
    placed = [value for value, _text, _colour in ordered]
    for _ in range(200):  # push neighbours apart, both by half, until none touches
        moved = False
        for i in range(len(placed) - 1):
            if (lack := gap - (placed[i + 1] - placed[i])) > 1e-9 * gap:
                placed[i], placed[i + 1], moved = placed[i] - lack / 2, placed[i + 1] + lack / 2, True
        if not moved:
            break
    for (value, text, colour), place in zip(ordered, placed, strict=True):
        axes.annotate(
            text, (x, value), (1.02, place), xycoords="data", textcoords=("axes fraction", "data"),
            color="black", va="center", annotation_clip=False,
            arrowprops={"arrowstyle": "-", "color": colour, "lw": 0.8, "shrinkA": 0, "shrinkB": 0},
        )  # fmt: skip


def live(data: StepSet, fitted: Mapping[float, Model], notes: Mapping[float, str] | None = None) -> Live:
    """Mean ± sd of each level, its model beside it; `notes` follow the model's name when hovered."""
    plot = Plot()
    out = data.output_unit
    p = plot.panel("Time since the step (s)", quantity(out), 420, out)
    levels = some_levels(data.levels, LIVE)
    colours = style.level_colours(len(levels))
    for level, colour in zip(levels, colours, strict=True):
        if len(level.runs) > 1:
            plot.band(p, level.time_s, level.mean - level.sd, level.mean + level.sd, colour)
    ends = []
    for level, colour in zip(levels, colours, strict=True):
        name = level_text(level.level, data.input_unit)
        plot.line(p, level.time_s, level.mean, f"{name}, measured", colour, width=2.4)
        ends.append((end_of(level.mean), name))
        if (model := fitted.get(level.level)) is not None:
            fine = fine_times(float(level.time_s[-1]))
            note = f", RMSE {notes[level.level]}" if notes and level.level in notes else ""
            plot.line(p, fine, model(fine), f"{name}, model{note}", style.BLACK, "dashed", width=1.2)
    ends.sort()
    gap = 0.045 * max(abs(value) for value, _name in ends)
    placed: list[float] = []
    for value, _name in ends:
        placed.append(max(value, placed[-1] + gap) if placed else value)
    longest = float(max(level.time_s[-1] for level in levels))
    names = [name for _value, name in ends]
    words = ColumnDataSource({"x": [1.01 * longest] * len(ends), "y": placed, "text": names})
    p.text("x", "y", text="text", source=words, text_font_size="12px", text_baseline="middle")
    p.x_range = Range1d(start=0, end=(1.03 + 0.022 * max(map(len, names))) * longest)
    return plot.finish()
