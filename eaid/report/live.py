"""Time plots that can be zoomed and read off by hovering: Bokeh documents as JSON, drawn by the script inside the page.

Bokeh, because its script (1.27 MB) is a quarter of plotly's (4.8 MB) and lies in the package that pip installs. A plot
is a JSON document; beside it stand the colours that change between light and dark.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from bokeh.document import Document
from bokeh.models import ColumnDataSource, HoverTool, Range1d
from bokeh.models.annotations import Legend
from bokeh.models.layouts import Column
from bokeh.plotting import figure

from eaid.arrays import Array
from eaid.report import style
from eaid.report.thin import thinned_at

BAND_POINTS = 300
"""Points of one band on the page."""
LINE_POINTS = 800
"""Points of one line on the page; extremes survive."""
DARK = {
    style.BLUE: "#7FBBE8", style.VERMILLION: "#FF9A4D", style.GREEN: "#4FD0A5", style.PURPLE: "#E3A6C8",
    style.BLACK: "#F2F2F2", style.ORANGE: "#F0B840", style.SKY: "#8FD0F5", style.GREY: "#B5B5B5",
}  # fmt: skip
"""Colour on white → colour on the dark ground, at the same hue."""
MODEL = (style.VERMILLION, "#9AD0FF")
INK, PAPER, RULE = ("#1A1A1A", "#E8E8E8"), ("#FFFFFF", "#1B1E23"), ("#DDDDDD", "#3A3F47")


@dataclass
class Plot:
    """One live plot under construction: its panels, and which of their colours change in the dark."""

    panels: list[Any] = field(default_factory=list)
    themed: list[tuple[str, str, str, str]] = field(default_factory=list)
    """(model id, property, light, dark)"""

    def panel(self, x: str, y: str, height: int, unit: str) -> Any:
        """Add a panel below the others; all share the time axis."""
        shared = {"x_range": self.panels[0].x_range} if self.panels else {}
        p = figure(
            height=height, sizing_mode="stretch_width", tools="pan,box_zoom,reset,save", toolbar_location="right",
            active_drag="box_zoom",
            x_axis_label=x, y_axis_label=y, output_backend="canvas", min_border_left=58, **shared,
        )  # fmt: skip
        p.toolbar.logo = None
        p.toolbar.autohide = True
        p.add_tools(
            HoverTool(renderers=[], tooltips=[("", "$name"), ("time", "$x{0.000} s"), ("value", f"$y{{0.000}} {unit}")])
        )
        for axis in p.axis:
            axis.axis_label_text_font_style = "normal"
            for prop in ("axis_label_text_color", "major_label_text_color", "axis_line_color", "major_tick_line_color"):
                self.themed.append((axis.id, prop, *INK))
            axis.minor_tick_line_color = None
        for grid in p.grid:
            self.themed.append((grid.id, "grid_line_color", *RULE))
        self.themed += [(p.id, "background_fill_color", *PAPER), (p.id, "border_fill_color", *PAPER)]
        self.themed.append((p.id, "outline_line_color", *RULE))
        self.panels.append(p)
        return p

    def line(
        self,
        p: Any,
        t: Array,
        y: Array,
        name: str,
        colours: tuple[str, str],
        dash: str = "solid",
        legend: str | None = None,
    ) -> None:
        """Draw a curve, thinned, with the name that hovering shows."""
        keep = thinned_at(y, LINE_POINTS)
        # Text once for the whole line: a column of names would weigh more than the numbers.
        source = ColumnDataSource({"x": t[keep].astype(np.float32), "y": y[keep].astype(np.float32)}, name=name)
        drawn = p.line(
            "x", "y", source=source, line_width=1.6, line_dash=dash, **({"legend_label": legend} if legend else {})
        )
        # A pointer hits a line only within half its width: a broad one that nobody sees catches it.
        reach = p.line("x", "y", source=source, line_width=14, line_alpha=0, name=name)
        p.select_one(HoverTool).renderers.append(reach)
        drawn.nonselection_glyph = None
        drawn.selection_glyph = None
        drawn.muted_glyph = None
        drawn.hover_glyph = None
        self.themed.append((drawn.glyph.id, "line_color", *colours))

    def band(self, p: Any, t: Array, low: Array, high: Array, colours: tuple[str, str]) -> None:
        """Shade between two curves, behind the lines."""
        keep = slice(None, None, max(1, len(t) // BAND_POINTS))
        columns = {"x": t[keep], "low": low[keep], "high": high[keep]}
        source = ColumnDataSource({name: values.astype(np.float32) for name, values in columns.items()})
        drawn = p.varea("x", "low", "high", source=source, fill_alpha=0.25, level="underlay")
        drawn.nonselection_glyph = drawn.selection_glyph = drawn.muted_glyph = drawn.hover_glyph = None
        self.themed.append((drawn.glyph.id, "fill_color", *colours))

    def finish(self) -> dict[str, Any]:
        """The plot as plain data: the document, its root, and the colours of both grounds."""
        for p in self.panels:
            for legend in p.select({"type": Legend}):
                legend.click_policy = "hide"
                p.add_layout(legend, "above")
                legend.border_line_color = None
                legend.orientation = "horizontal"
                legend.background_fill_alpha = 0.8
                legend.label_text_font_size = "12px"
                self.themed.append((legend.id, "background_fill_color", *PAPER))
                self.themed.append((legend.id, "label_text_color", *INK))
        document = Document()
        root = self.panels[0] if len(self.panels) == 1 else Column(children=self.panels, sizing_mode="stretch_width")
        document.add_root(root)
        return _renumbered(
            {"doc": document.to_json(deferred=False), "root": root.id, "themed": [list(item) for item in self.themed]}
        )


def _renumbered(plot: dict[str, Any]) -> dict[str, Any]:
    """The same plot with model ids counted from 1: Bokeh counts on through a process, and bytes have to be the same."""
    names: dict[str, str] = {}

    def learn(value: Any) -> None:
        if isinstance(value, dict):
            if "type" in value and isinstance(value.get("id"), str):
                names.setdefault(value["id"], f"m{len(names) + 1}")
            for item in value.values():
                learn(item)
        elif isinstance(value, list):
            for item in value:
                learn(item)

    def rename(value: Any) -> Any:
        if isinstance(value, dict):
            return {
                key: names.get(item, item) if key == "id" and isinstance(item, str) else rename(item)
                for key, item in value.items()
            }
        return [rename(item) for item in value] if isinstance(value, list) else value

    learn(plot["doc"])
    return {
        "doc": rename(plot["doc"]),
        "root": names[plot["root"]],
        "themed": [[names[item[0]], *item[1:]] for item in plot["themed"]],
    }


def _level_pairs(n: int) -> list[tuple[str, str]]:
    """Colours of n rising levels on white and on the dark ground: contrast grows with the level on both."""
    import matplotlib as mpl

    table = mpl.colormaps["cividis"]
    dark = [mpl.colors.to_hex(table(0.38 + 0.62 * i / max(n - 1, 1))) for i in range(n)]
    return list(zip(style.level_colours(n), dark, strict=True))


def steps(
    levels: Sequence[tuple[str, Array, Array]],
    fitted: Sequence[Callable[[Array], Array] | None],
    quantity: str,
    unit: str,
    spreads: Sequence[Array | None] = (),
    notes: Sequence[str] = (),
) -> dict[str, Any]:
    """Step responses: name, time [s] and mean of each level, its model beside it, a band of ± `spreads` behind it.

    `notes` follow the model's name where the pointer reads it.
    """
    plot = Plot()
    p = plot.panel("Time since the step (s)", quantity, 420, unit)
    pairs = _level_pairs(len(levels))
    for (_name, t, y), sd, colours in zip(levels, spreads, pairs, strict=False):
        if sd is not None:
            plot.band(p, t, y - sd, y + sd, colours)
    said = notes or [""] * len(levels)
    for (name, t, y), model, colours, note in zip(levels, fitted, pairs, said, strict=True):
        plot.line(p, t, y, f"{name}, measured", colours)
        if model is not None:
            fine = np.unique(np.concatenate([[0.0], np.geomspace(1e-3, 1, 150) * t[-1]]))
            plot.line(p, fine, model(fine), f"{name}, model{note}", MODEL, "dashed")
    longest = float(max(t[-1] for _, t, _ in levels))
    ends = sorted((float(np.mean(y[-max(1, len(y) // 50) :])), name) for name, _, y in levels)
    gap = 0.045 * max(abs(value) for value, _ in ends)
    placed: list[float] = []
    for value, _name in ends:
        placed.append(max(value, placed[-1] + gap) if placed else value)
    words = ColumnDataSource({"x": [1.01 * longest] * len(ends), "y": placed, "text": [name for _, name in ends]})
    text = p.text("x", "y", text="text", source=words, text_font_size="12px", text_baseline="middle")
    plot.themed.append((text.glyph.id, "text_color", *INK))
    p.x_range = Range1d(start=0, end=1.13 * longest)
    return plot.finish()


def tracking(traces: Mapping[str, Mapping[str, Array]], with_error: bool = True) -> dict[str, Any]:
    """Torque, error and duty of each controller over time; clicking a name in the legend hides it."""
    plot = Plot()
    torque = plot.panel("" if with_error else "Time (s)", "Torque (N·m)", 300, "N·m")
    error = plot.panel("", "Error (N·m)", 190, "N·m") if with_error else None
    duty = plot.panel("Time (s)", "Duty (%)", 190, "%")
    for i, (name, trace) in enumerate(traces.items()):
        look = style.controller_look(name, i)
        colours = (look["color"], DARK.get(look["color"], look["color"]))
        dash = {"-": "solid", "--": "dashed", "-.": "dashdot"}.get(look["linestyle"], "dotted")
        said = style.controller_name(name)
        t = trace["time_s"]
        plot.line(torque, t, trace["torque_nm"], said, colours, dash, legend=said)
        if error is not None:
            plot.line(error, t, trace["reference_nm"] - trace["torque_nm"], said, colours, dash)
        plot.line(duty, t, trace["duty_pct"], said, colours, dash)
    first = next(iter(traces.values()))
    ink = (style.BLACK, DARK[style.BLACK])
    plot.line(torque, first["time_s"], first["reference_nm"], "reference", ink, "dotted", legend="reference")
    return plot.finish()


def training(trace: Mapping[str, Array]) -> dict[str, Any]:
    """Angle, position error, torque and torque error of the rehabilitation replay over time."""
    plot = Plot()
    ink, blue, red = ((c, DARK[c]) for c in (style.BLACK, style.BLUE, style.VERMILLION))
    t = trace["time_s"]
    angle = plot.panel("", "Angle (°)", 230, "°")
    plot.line(angle, t, trace["target_deg"], "target", ink, "dashed", legend="target")
    plot.line(angle, t, trace["angle_deg"], "angle", blue, legend="angle")
    position = plot.panel("", "Position error (°)", 180, "°")
    plot.line(position, t, trace["target_deg"] - trace["angle_deg"], "position error", blue)
    torque = plot.panel("", "Torque (N·m)", 230, "N·m")
    plot.line(torque, t, trace["desired_nm"], "desired", ink, "dashed", legend="desired")
    plot.line(torque, t, trace["rendered_nm"], "rendered", red, legend="rendered")
    error = plot.panel("Time (s)", "Torque error (N·m)", 180, "N·m")
    plot.line(error, t, trace["desired_nm"] - trace["rendered_nm"], "torque error", red)
    return plot.finish()


def script() -> str:
    """BokehJS, as it lies in the installed package."""
    import bokeh

    return (Path(bokeh.__file__).parent / "server/static/js/bokeh.min.js").read_text(encoding="utf-8")
