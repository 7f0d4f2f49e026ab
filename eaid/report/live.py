"""Plots that can be zoomed and read off by hovering: Bokeh documents as JSON, drawn by the script inside the page.

Bokeh, because its script (1.27 MB) is a quarter of plotly's (4.8 MB) and lies in the package that pip installs. On a
dark ground the page's style inverts their lightness, at the same hue.
"""

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import bokeh
import numpy as np
from bokeh.document import Document
from bokeh.models import ColumnDataSource, HoverTool
from bokeh.models.annotations import Legend, TeeHead, Whisker
from bokeh.models.layouts import Column
from bokeh.plotting import figure
from markupsafe import Markup
from matplotlib.axes import Axes

from eaid.arrays import Array
from eaid.report import style


def thinned(time_s: Array, values: Array, points: int) -> tuple[Array, Array]:
    """At most about `points` samples of a curve, shape (≤ points + 2,): extremes of equal stretches, in order of time.

    A spike of one sample survives, which taking every k-th sample would lose.
    """
    keep = thinned_at(values, points)
    return time_s[keep], values[keep]


def thinned_at(values: Array, points: int) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
    """Which samples `thinned` keeps, rising; the first and the last are always among them."""
    n = len(values)
    if n <= points:
        return np.arange(n)
    stretches = max(points // 2, 1)
    width = -(-n // stretches)
    padded = np.full(-(-n // width) * width, np.nan)
    padded[:n] = np.nan_to_num(values)
    blocks = padded.reshape(-1, width)
    start = np.arange(len(blocks)) * width
    low = start + np.argmin(np.where(np.isnan(blocks), np.inf, blocks), axis=1)
    high = start + np.argmax(np.where(np.isnan(blocks), -np.inf, blocks), axis=1)
    return np.unique(np.concatenate([[0], low, high, [n - 1]]))


Live = Markup
"""A live plot: a Bokeh document and its root as JSON that may stand inside a script element."""

BAND_POINTS = 300
"""Points of one band on the page."""
LINE_POINTS = 800
"""Points of one line on the page; extremes survive."""


@dataclass
class Plot:
    """One live plot under construction."""

    panels: list[Any] = field(default_factory=list)
    wide: bool = True
    """Whether it has the page's whole width; else its legend has two columns."""

    def panel(
        self, x: str, y: str, height: int, unit: str, across: tuple[str, str] = ("time", "s"), **more: Any
    ) -> Any:
        """Add a panel below the others; all share the axis `across`, whose name and unit hovering shows."""
        shared = {"x_range": self.panels[0].x_range} if self.panels else {}
        p = figure(
            height=height, sizing_mode="stretch_width", tools="pan,box_zoom,reset,save", toolbar_location="right",
            active_drag="box_zoom", background_fill_color=None, border_fill_color=None,
            x_axis_label=x, y_axis_label=y, output_backend="canvas", min_border_left=58, **shared, **more,
        )  # fmt: skip
        p.toolbar.logo = None
        p.toolbar.autohide = True
        where, value = (across[0], f"$x{{0.000}} {plain(across[1])}"), ("value", f"$y{{0.000}} {plain(unit)}")
        p.add_tools(HoverTool(renderers=[], tooltips=[("", "$name"), where, value]))
        p.axis.axis_label_text_font_style = "normal"
        p.axis.minor_tick_line_color = None
        p.grid.grid_line_color = "#D0D0D0"
        self.panels.append(p)
        return p

    def line(
        self,
        p: Any,
        t: Array,
        y: Array,
        name: str,
        colour: str,
        dash: str = "solid",
        legend: str | None = None,
        width: float = 1.6,
    ) -> None:
        """Draw a curve, thinned, with the name that hovering shows."""
        name = plain(name)
        keep = thinned_at(y, LINE_POINTS)
        # Text once for the whole line: a column of names would weigh more than the numbers.
        source = ColumnDataSource({"x": t[keep].astype(np.float32), "y": y[keep].astype(np.float32)}, name=name)
        named = {"legend_label": legend} if legend else {}
        bare(p.line("x", "y", source=source, line_width=width, line_dash=dash, line_color=colour, **named))
        # A pointer hits a line only within half its width: a broad one that nobody sees catches it.
        reach = p.line("x", "y", source=source, line_width=14, line_alpha=0, name=name)
        p.select_one(HoverTool).renderers.append(reach)

    def points(self, p: Any, x: Sequence[float], y: Array, ends: tuple[Array, Array], name: str, colour: str) -> None:
        """Draw points with whiskers from their lower to their upper ends, with the name that hovering shows."""
        source = ColumnDataSource({"x": x, "y": y, "low": ends[0], "high": ends[1]})
        drawn = bare(p.scatter("x", "y", source=source, size=7, name=name, color=colour))
        p.select_one(HoverTool).renderers.append(drawn)
        foot, head = TeeHead(size=6), TeeHead(size=6)
        p.add_layout(Whisker(base="x", lower="low", upper="high", source=source, lower_head=foot, upper_head=head))

    def band(self, p: Any, t: Array, low: Array, high: Array, colour: str) -> None:
        """Shade between two curves, behind the lines."""
        keep = slice(None, None, max(1, len(t) // BAND_POINTS))
        columns = {"x": t[keep], "low": low[keep], "high": high[keep]}
        source = ColumnDataSource({name: values.astype(np.float32) for name, values in columns.items()})
        bare(p.varea("x", "low", "high", source=source, fill_color=colour, fill_alpha=0.25, level="underlay"))

    def finish(self) -> Live:
        """The plot as text."""
        for p in self.panels:
            for legend in p.select({"type": Legend}):
                legend.click_policy = "hide"
                p.add_layout(legend, "above")
                legend.border_line_color = legend.background_fill_color = None
                legend.orientation = "horizontal"
                legend.ncols = 5 if self.wide else 2
                legend.spacing, legend.padding, legend.margin = 8, 2, 0
                legend.label_text_font_size = "12px"
        document = Document()
        root = self.panels[0] if len(self.panels) == 1 else Column(children=self.panels, sizing_mode="stretch_width")
        document.add_root(root)
        drawn = {"doc": document.to_json(deferred=False), "root": {"id": root.id}}
        return Markup(script_safe(_renumbered(json.dumps(drawn, allow_nan=False, separators=(",", ":")))))


def bare(drawn: Any) -> Any:
    """What is drawn, without the looks of being selected, muted or hovered, which the page does not use."""
    drawn.nonselection_glyph = drawn.selection_glyph = drawn.muted_glyph = drawn.hover_glyph = None
    return drawn


def plain(text: str) -> str:
    """A text of the user's own without the signs by which a tooltip would read HTML or a column's name in it."""
    return text.translate(str.maketrans("<>&@${}", "‹›＆＠＄()"))


def script_safe(text: str) -> str:
    """JSON that may stand inside a script element: no `<`, `>` or `&` is left in it."""
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def _renumbered(text: str) -> str:
    """The same plot with model ids counted from 1: Bokeh counts on through a process, and bytes have to be the same."""
    names: dict[str, str] = {}
    return re.sub(r'"id":"(\w+)"', lambda model: f'"id":"{names.setdefault(model[1], f"m{len(names) + 1}")}"', text)


def script() -> str:
    """BokehJS, as it lies in the installed package."""
    return (Path(bokeh.__file__).parent / "server/static/js/bokeh.min.js").read_text(encoding="utf-8")


POINTS = 2500
"""Most points of a curve in a figure; extremes survive."""
MODEL: style.Stroke = {"color": style.BLACK, "linestyle": (0, (4, 2)), "linewidth": 0.8}
"""A model is a thin dark dashed line over the broader, paler line of what was measured: both stay to be seen."""
DASHES = {"-": "solid", "--": "dashed", (0, (4, 2)): "dashed", "-.": "dashdot"}
"""Line of a figure → the same in a live plot; all others are dotted there."""


@dataclass(frozen=True, eq=False)
class Line:
    """A curve of a panel."""

    t: Array
    y: Array
    name: str
    color: str
    linestyle: Any = "-"
    linewidth: float = 0.9
    """In the figure [pt]."""


@dataclass(frozen=True, eq=False)
class Panel:
    """One of the panels: its label, its unit, its height on the page [px], and its curves."""

    label: str
    unit: str
    height: int
    lines: Sequence[Line]
    named: bool = False
    """Whether its curves stand in a legend of the live plot, which hides them by click."""


def draw_panels(axes: Sequence[Axes], panels: Sequence[Panel], time: str = "Time (s)") -> None:
    """Draw the panels on axes that share their time."""
    for mark, one, panel in zip("abcd", panels, axes, strict=False):
        for line in one.lines:
            draw_line(panel, line)
        panel.set_ylabel(one.label)
        style.letter(panel, mark)
    t = panels[0].lines[0].t
    axes[-1].set(xlabel=time, xlim=(t[0], t[-1]))


def draw_line(axes: Axes, line: Line) -> None:
    """Draw one of the curves."""
    look = {"color": line.color, "linestyle": line.linestyle, "linewidth": line.linewidth}
    axes.plot(*thinned(line.t, line.y, POINTS), label=line.name, **look)


def live_panels(panels: Sequence[Panel], time: str = "Time (s)") -> Live:
    """The panels as one live plot."""
    plot = Plot()
    for one in panels:
        drawn = plot.panel(time if one is panels[-1] else "", one.label, one.height, one.unit)
        for line in one.lines:
            legend = line.name if one.named else None
            dash = DASHES.get(line.linestyle, "dotted")
            plot.line(drawn, line.t, line.y, line.name, line.color, dash, legend)
    return plot.finish()
