"""Live plots of data and fits: the overlay by level, parameters over the level, the residual map."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from bokeh.models import ColumnDataSource, HoverTool, LinearColorMapper, Range1d
from bokeh.models.annotations import ColorBar, TeeHead, Whisker

from eaid.report import style
from eaid.report.figures.checks import ResidualMap
from eaid.report.figures.steps import Model, end_of, fine_times, some_levels
from eaid.report.figures.values import TALL, highest, top_of, values_of, values_over
from eaid.report.page.live import Plot, bare
from eaid.report.rig import level_text, level_values, over, quantity
from eaid.report.tables.fits import estimates_of
from eaid.results.fit import Fit
from eaid.steps.stepset import StepSet

MOST = 24
"""Most levels of a live overlay."""


def steps(data: StepSet, fitted: Mapping[float, Model], notes: Mapping[float, str] | None = None) -> Mapping[str, Any]:
    """Step responses: mean ± sd of each level, its model beside it; `notes` follow the model's name when hovered."""
    plot = Plot()
    out = data.output_unit
    p = plot.panel("Time since the step (s)", quantity(out), 420, out)
    levels = some_levels(data.levels, MOST)
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
    longest = float(max(level.time_s[-1] for level in levels))
    ends.sort()
    gap = 0.045 * max(abs(value) for value, _ in ends)
    placed: list[float] = []
    for value, _name in ends:
        placed.append(max(value, placed[-1] + gap) if placed else value)
    words = ColumnDataSource({"x": [1.01 * longest] * len(ends), "y": placed, "text": [name for _, name in ends]})
    p.text("x", "y", text="text", source=words, text_font_size="12px", text_baseline="middle")
    p.x_range = Range1d(start=0, end=(1.03 + 0.022 * max(len(name) for _, name in ends)) * longest)
    return plot.finish()


LINES = ((style.BLUE, "solid"), (style.VERMILLION, "dashdot"), (style.GREEN, "dotdash"), (style.PURPLE, "dotted"))
HEADS = {"Ts": "Tₛ", "tau1": "τ1", "tau2": "τ2"}


def parameters(fit: Fit) -> tuple[Mapping[str, Any], ...]:
    """T_s, τ1 and τ2 over the level, a plot each: every estimate, the single levels with their intervals."""
    assert fit.nonlinear is not None
    u = np.linspace(*fit.nonlinear.u_range, 120)
    rows = level_values(fit)
    found = []
    for name, sign in HEADS.items():
        plot = Plot(wide=False)
        unit = fit.data.output_unit if name == "Ts" else "s"
        p = plot.panel(over(fit.data.input_unit), f"{sign} ({unit})", 300, unit, ("level", fit.data.input_unit))
        curves = {said: values_over(one, u)[name] for said, one in estimates_of(fit.nonlinear).items()}
        seen, values = 0.0, values_of(rows, name)
        if np.isfinite(values).any():
            ends = [getattr(row.ci95, name) if row.ci95 else None for row in rows]
            low, high = (
                np.array([v if e is None else e[k] for v, e in zip(values, ends, strict=True)]) for k in (0, 1)
            )
            points = ColumnDataSource({"x": [row.level for row in rows], "y": values, "low": low, "high": high})
            said = "level by itself" if fit.recorded is None else "95 %"
            drawn = bare(p.scatter("x", "y", source=points, size=7, name=said, color=style.BLACK))
            p.select_one(HoverTool).renderers.append(drawn)
            foot, head = TeeHead(size=6), TeeHead(size=6)
            span = {"base": "x", "lower": "low", "upper": "high"}
            p.add_layout(Whisker(**span, source=points, lower_head=foot, upper_head=head))  # type: ignore[arg-type]
            seen = highest(np.minimum(high, TALL * values))
        top = top_of(next(iter(curves.values())), seen)
        for (said, y), (colour, dash), width in zip(curves.items(), LINES, (2.0, 1.3, 1.3, 1.3), strict=False):
            plot.line(p, u, np.where(y < 1.3 * top, y, np.nan), said, colour, dash, said, width)
        p.y_range = Range1d(start=0, end=1.1 * top or 1.0)
        found.append(plot.finish())
    return tuple(found)


def residuals(found: ResidualMap, input_unit: str, output_unit: str) -> Mapping[str, Any]:
    """The residual map: stretches of time along, levels upward, the mean of measured − model as colour."""
    import matplotlib as mpl

    plot = Plot()
    height = 120 + 26 * min(max(len(found.levels), 4), 16)
    first = found.edges_s[1] / 1.6
    p = plot.panel("Time since the step (s)", over(input_unit), height, output_unit, x_axis_type="log")
    left = np.concatenate([[first], found.edges_s[1:-1]])
    i, k = np.nonzero(np.isfinite(found.mean))
    columns = {"left": left[k], "right": found.edges_s[1:][k], "bottom": i - 0.5, "top": i + 0.5, "z": found.mean[i, k]}
    source = ColumnDataSource({name: values.astype(np.float32) for name, values in columns.items()})
    table = mpl.colormaps["PuOr_r"]
    palette = [mpl.colors.to_hex(table(n / 20)) for n in range(21)]
    mapper = LinearColorMapper(palette=palette, low=-found.size, high=found.size)
    fill = {"field": "z", "transform": mapper}
    drawn = bare(p.quad("left", "right", "top", "bottom", source=source, line_color=None, fill_color=fill))
    hover = p.select_one(HoverTool)
    hover.renderers = [drawn]
    hover.tooltips = [("time", "@left{0.000} to @right{0.000} s"), ("measured − model", "@z{0.0000}")]
    shown = np.unique(np.linspace(0, len(found.levels) - 1, 16).round().astype(int))
    p.yaxis.ticker = [int(n) for n in shown]
    p.yaxis.major_label_overrides = {int(n): level_text(found.levels[n], input_unit) for n in shown}
    p.add_layout(ColorBar(color_mapper=mapper, width=10, title=output_unit, background_fill_color=None), "right")
    p.xaxis.ticker.desired_num_ticks = 4  # on a phone, too, they stand apart
    p.x_range = Range1d(start=float(first), end=float(found.edges_s[-1]))
    p.y_range = Range1d(start=-0.5, end=len(found.levels) - 0.5)
    return plot.finish()
