"""Figures as plots that can be zoomed and read off by pointing: Bokeh documents as JSON, drawn by the page's script.

Bokeh, because its script (1.27 MB) is a quarter of plotly's (4.8 MB) and lies in the package that pip installs. On a
dark ground the page's style inverts their lightness, at the same hue.
"""

import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import bokeh
import numpy as np
from bokeh.document import Document
from bokeh.models import ColumnDataSource, HoverTool, Range1d
from bokeh.models.annotations import BoxAnnotation, Legend, LegendItem
from bokeh.models.annotations import Span as Rule
from bokeh.models.glyphs import Line as Stroke
from bokeh.models.glyphs import Text, VArea
from bokeh.models.layouts import Column
from bokeh.plotting import figure
from markupsafe import Markup

from eaid.report.panels import Line, Panel, Sheet, move_apart, thinned

LIVE_POINTS = 800  # Points of one line; extremes survive
LIVE_BAND_POINTS = 300
DASHES = {"-": "solid", "--": "dashed", "-.": "dashdot", ":": "dotted"}


def live_of(sheet: Sheet) -> Markup:
    """A figure of one column as a Bokeh document and its root, JSON that may stand inside a script; else nothing."""
    if not sheet.live:
        return Markup()
    total, ratios = 100 * sheet.height_in + 60 * len(sheet.panels), sheet.ratios or (1.0,) * len(sheet.panels)
    drawn: list[Any] = []
    for panel, ratio in zip(sheet.panels, ratios, strict=True):
        height = round(total * ratio / sum(ratios))
        p = _axes(panel, height, drawn[0].x_range if drawn else None, panel is sheet.panels[-1])
        hits: list[Any] = []
        items: list[LegendItem] = []
        for band in panel.bands:
            some = slice(None, None, max(1, len(band.x) // LIVE_BAND_POINTS))
            held = {name: getattr(band, name)[some].astype(np.float32) for name in ("x", "low", "high")}
            shade = VArea(x="x", y1="low", y2="high", fill_color=band.color, fill_alpha=band.alpha)
            p.add_glyph(ColumnDataSource(held), shade, level="underlay")
        for line in panel.lines:
            shown, reach = _draw_line(p, line)
            hits.append(reach)
            if line.name and panel.legend and not panel.keys:
                items.append(LegendItem(label={"value": harmless(line.name)}, renderers=[shown]))
        for span in panel.spans:
            if span.low < span.high and span.along == "x":
                p.add_layout(BoxAnnotation(left=span.low, right=span.high, fill_color=span.color, level="image"))
            elif span.low == span.high:
                rule = Rule(location=span.low, line_color=span.color, line_width=span.width)
                rule.dimension = "height" if span.along == "x" else "width"
                p.add_layout(rule)
        _name_ends(p, [line for line in panel.lines if line.end])
        if items:
            legend = Legend(items=items, click_policy="hide", orientation="horizontal", label_text_font_size="12px")
            legend.border_line_color = legend.background_fill_color = None
            legend.spacing, legend.padding, legend.margin, legend.ncols = 8, 2, 0, 5
            p.add_layout(legend, "above")
        across = panel.x.name.split(" ")[0].lower()
        values = (across, f"$x{{0.000}} {harmless(panel.x.unit)}"), ("value", f"$y{{0.000}} {harmless(panel.y.unit)}")
        p.add_tools(HoverTool(renderers=hits, tooltips=[("", "$name"), *values]))
        drawn.append(p)
    document = Document()
    root = drawn[0] if len(drawn) == 1 else Column(children=drawn, sizing_mode="stretch_width")
    document.add_root(root)
    held = {"doc": document.to_json(deferred=False), "root": {"id": root.id}}
    said = json.dumps(held, allow_nan=False, separators=(",", ":"))
    # Bokeh counts its ids on through a process, and the same plot has to have the same bytes
    names: dict[str, str] = {}
    said = re.sub(r'"id":"(\w+)"', lambda model: f'"id":"{names.setdefault(model[1], f"m{len(names) + 1}")}"', said)
    return Markup(said.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026"))


def _axes(panel: Panel, height: int, shared: Any, last: bool) -> Any:
    """An empty plot."""
    y = panel.y.text.replace("T_s", "Tₛ").replace("\n", " ")
    p = figure(
        height=height, sizing_mode="stretch_width", tools="pan,box_zoom,reset,save", toolbar_location="right",
        active_drag="box_zoom", background_fill_color=None, border_fill_color=None, output_backend="canvas",
        x_axis_label=panel.x.text if last else "", y_axis_label=y, min_border_left=58,
        **({"x_range": shared} if shared else {}),
    )  # fmt: skip
    low, high = panel.y.limits
    if low is not None and high is not None:
        p.y_range = Range1d(start=low, end=high)
    p.toolbar.logo, p.toolbar.autohide = None, True
    p.axis.axis_label_text_font_style, p.axis.minor_tick_line_color = "normal", None
    p.grid.grid_line_color = "#D0D0D0"
    return p


def _draw_line(p: Any, line: Line) -> tuple[Any, Any]:
    """A curve, thinned; and what catches the pointer, by the line's name."""
    # Text once for the whole line: a column of names would weigh more than the numbers.
    x, y = thinned(np.asarray(line.x), np.asarray(line.y), LIVE_POINTS)
    source = ColumnDataSource({"x": x.astype(np.float32), "y": y.astype(np.float32)}, name=harmless(line.name))
    dash = DASHES[line.dash] if isinstance(line.dash, str) else [2 * length for length in line.dash[1]]
    look = Stroke(x="x", y="y", line_color=line.color, line_width=1.7 * line.width, line_dash=dash)
    look.line_alpha = line.alpha
    # A pointer hits a line only within half its width: a broad one that nobody sees catches it.
    broad = Stroke(x="x", y="y", line_width=14, line_alpha=0)
    return p.add_glyph(source, look), p.add_glyph(source, broad, name=harmless(line.name))


def _name_ends(p: Any, lines: Sequence[Line]) -> None:
    """Texts at the right ends of lines, moved apart where those end close together."""
    if not lines:
        return
    ends = sorted((float(line.y[-1]), line.end.partition(":")[0]) for line in lines)  # numbers are for the pointer
    values, texts = zip(*ends, strict=True)
    longest = float(max(line.x[-1] for line in lines))
    placed = move_apart(values, 0.045 * max(map(abs, values)))
    words = ColumnDataSource({"x": [1.01 * longest] * len(ends), "y": placed, "text": texts})
    p.add_glyph(words, Text(x="x", y="y", text="text", text_font_size="12px", text_baseline="middle"))
    p.x_range = Range1d(start=0, end=(1.03 + 0.022 * max(map(len, texts))) * longest)


def harmless(text: str) -> str:
    """A text of the user's own without the signs by which a tooltip would read HTML or a column's name in it."""
    return text.translate(str.maketrans("<>&@${}", "‹›＆＠＄()"))


def script() -> str:
    """BokehJS, as it lies in the installed package."""
    return (Path(bokeh.__file__).parent / "server/static/js/bokeh.min.js").read_text(encoding="utf-8")
