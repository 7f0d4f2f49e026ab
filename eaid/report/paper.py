"""Figures as matplotlib draws them: one look, and bytes that are the same every time (no date, no program name).

Widths of a journal's columns, letters of 8 pt and more, no index of a symbol below 6 pt.
"""

import io
import re
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter, NullLocator

from eaid.errors import DataError
from eaid.report.figures.replays import tracking_panels
from eaid.report.figures.residuals import residual_panels
from eaid.report.figures.sessions import control_panel, values_panel
from eaid.report.figures.steps import fitted_steps
from eaid.report.figures.values import margins_panel
from eaid.report.panels import BLACK, VERMILLION, Axis, Line, Panel, Sheet, move_apart, thinned
from eaid.results.fit import Fit
from eaid.results.gains import Gains
from eaid.results.replay import Replay
from eaid.sessions.compare import Comparison
from eaid.sessions.rig import Rig

DPI = 300
SMALLEST_PT = 8.0  # No letter of a figure is smaller at its printed size [pt]
INDEXED_PT = 8.6  # Letters of a text with an index, which matplotlib sets at 0.7 of them
CURVE_POINTS, BAND_POINTS = 2500, 400  # Most points of a curve; extremes survive; and of a band
_LOOK = threading.Lock()


@contextmanager
def look() -> Iterator[None]:
    """The settings under which a figure is made and saved; matplotlib has one set of them, so threads take turns."""
    with _LOOK, mpl.rc_context(fname=Path(__file__).with_name("figures.mplstyle")):
        yield


def figure_of(sheet: Sheet, mark: str = "") -> Figure:
    """A figure, drawn, a mark below all its panels; under `look`."""
    rows = -(-len(sheet.panels) // sheet.columns)
    figure = Figure(figsize=(sheet.width_in, sheet.height_in), layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.subplots(
        rows, sheet.columns, squeeze=False, sharex="col" if sheet.shared else False,
        height_ratios=sheet.ratios or None, width_ratios=sheet.widths or None,
    )  # fmt: skip
    for k, (axes, panel) in enumerate(zip(grid.flat, sheet.panels, strict=False)):
        lowest = not sheet.shared or k + sheet.columns >= len(sheet.panels)
        draw_panel(axes, panel, x_label=lowest)
        letter = f"({'abcdefghi'[k]}) " * (sheet.lettered and len(sheet.panels) > 1)
        axes.set_title(**_text(f"{letter}{panel.title}".rstrip()))
    named = next((k for k, panel in enumerate(sheet.panels) if panel.legend == "over"), None)
    if named is not None:
        handles, labels = grid.flat[named].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper right", ncols=sheet.panels[named].columns)
    if mark:
        said = f"\N{WARNING SIGN} {mark}"
        figure.supxlabel(said, fontsize=SMALLEST_PT, fontweight="bold", color=VERMILLION)
    for axes, panel in zip(grid.flat, sheet.panels, strict=False):
        _name_ends(axes, panel)
        if panel.legend == "above" and axes.get_title(loc="left"):
            narrow_legend(figure, axes, panel.columns)
    for axes in grid.flat[len(sheet.panels) :]:
        axes.set_visible(False)
    return figure


LONG_NAMES, OF_LETTER = 24, 0.08  # Letters of a legend from which it is measured; part of a panel that its letter takes


def narrow_legend(figure: Figure, axes: Axes, columns: int) -> None:
    """A legend above a panel in as few columns as leave the panel's letter free."""
    legend = axes.get_legend()
    if legend is None or sum(len(one.get_text()) for one in legend.get_texts()) < LONG_NAMES:
        return
    for count in range(columns, 0, -1):
        legend = _legend_above(axes, count)
        figure.draw_without_rendering()
        place = axes.get_window_extent()
        if legend.get_window_extent().x0 >= place.x0 + OF_LETTER * place.width:
            return


def draw_panel(axes: Axes, panel: Panel, x_label: bool = True) -> None:
    """Draw a panel."""
    for band in panel.bands:
        some = slice(None, None, max(1, len(band.x) // BAND_POINTS))
        low, high = band.low[some], band.high[some]
        axes.fill_between(band.x[some], low, high, color=band.color, alpha=band.alpha, linewidth=0)
    for line in (*panel.lines, *panel.keys):
        _drawn_line(axes, line, named=bool(panel.legend) and (not panel.keys or line in panel.keys))
    for span in panel.spans:
        across = "v" if span.along == "x" else "h"
        if span.low == span.high:
            getattr(axes, f"ax{across}line")(span.low, color=span.color, linewidth=span.width, linestyle=span.dash)
        else:
            getattr(axes, f"ax{across}span")(span.low, span.high, facecolor=span.color, lw=0)
    if panel.boxes:
        names, values, colours, hatches = zip(*panel.boxes, strict=True)
        drawn = axes.boxplot(
            values, tick_labels=names, showfliers=False, patch_artist=True, widths=0.5,
            medianprops={"color": "black", "linewidth": 1.2},
        )  # fmt: skip
        for patch, colour, hatch in zip(drawn["boxes"], colours, hatches, strict=True):
            patch.set(facecolor=colour, hatch=hatch, linewidth=0.7)
        axes.grid(axis="x", visible=False)
    if panel.tight and panel.lines:
        axes.set_xlim(min(line.x[0] for line in panel.lines), max(line.x[-1] for line in panel.lines))
    for name, axis, labelled in (("x", panel.x, x_label), ("y", panel.y, True)):
        _axis(axes, name, axis, labelled)
    for note in panel.notes:
        shares = {"": axes.transData, "xy": axes.transAxes, "x": axes.get_yaxis_transform(),
                  "y": axes.get_xaxis_transform()}  # fmt: skip
        box = {"bbox": {"facecolor": "white", "edgecolor": "none", "pad": 1}} if note.boxed else {}
        said = _text(note.text)
        axes.text(note.x, note.y, said.pop("label"), transform=shares[note.of], ha=note.ha, va=note.va, **said, **box)
    if panel.legend == "above":
        _legend_above(axes, panel.columns)
    elif panel.legend == "beside":
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), handlelength=1.6)


def _legend_above(axes: Axes, columns: int) -> Legend:
    return axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=columns)


def _text(said: str) -> dict[str, Any]:
    """A text with its indices set, as matplotlib takes it."""
    text = re.sub(r"\b([TCBPQ])_([sfmaM])\b", r"$\1_\2$", said)
    return {"label": text, **({"fontsize": INDEXED_PT} if text != said else {})}


def _drawn_line(axes: Axes, line: Line, named: bool) -> None:
    look: dict[str, Any] = {"color": line.color, "linewidth": line.width, "linestyle": line.dash or "none"}
    look |= {"marker": line.marker or None, "markersize": line.size, "label": line.name if named else None}
    if line.fill:
        look |= {"markerfacecolor": line.fill, "markeredgewidth": 1.4}
    if line.alpha < 1:
        look |= {"alpha": line.alpha, **({} if line.marker else {"solid_capstyle": "round"})}
    if line.ends is not None:
        y = np.asarray(line.y)
        axes.errorbar(line.x, y, yerr=[y - line.ends[0], line.ends[1] - y], capsize=1.6, elinewidth=0.7, **look)
    else:
        axes.plot(*thinned(np.asarray(line.x), np.asarray(line.y), CURVE_POINTS), **look)


def _axis(axes: Axes, name: str, axis: Axis, labelled: bool) -> None:
    if labelled and axis.text:
        said = _text(axis.text)
        getattr(axes, f"set_{name}label")(said.pop("label"), **said)
    one = getattr(axes, f"{name}axis")
    if axis.limits != (None, None):
        getattr(axes, f"set_{name}lim")(*axis.limits)
    if axis.log:
        getattr(axes, f"set_{name}scale")("log")
        low, high = one.get_view_interval()
        one.set_major_locator(LogLocator(subs=(1, 2, 5)) if high < 300 * low else LogLocator(numticks=6))
        one.set_major_formatter(FuncFormatter(lambda value, _place: f"{value:g}"))
        one.set_minor_formatter(NullFormatter())
        if high < 300 * low:
            one.set_minor_locator(NullLocator())
    if axis.ticks is not None:
        one.set_ticks(list(axis.ticks), list(axis.ticks.values()))


def _name_ends(axes: Axes, panel: Panel) -> None:
    """Write a text at the right end of each curve, moved apart where curves end close together."""
    # a curve ends at the mean of its last fiftieth
    ends = sorted(
        (float(np.mean(line.y[-max(1, len(line.y) // 50) :])), line.end, line.color) for line in panel.lines if line.end
    )
    low, high = axes.get_ylim()
    gap = (high - low) * 1.15 * SMALLEST_PT / 72 / (axes.get_window_extent().height / axes.figure.dpi)
    for (value, text, colour), place in zip(ends, move_apart([value for value, _, _ in ends], gap), strict=True):
        said = _text(text)
        axes.annotate(
            said.pop("label"), (axes.get_xlim()[1], value), (1.02, place), xycoords="data",
            textcoords=("axes fraction", "data"), color=BLACK, va="center", annotation_clip=False,
            arrowprops={"arrowstyle": "-", "color": colour, "lw": 0.8, "shrinkA": 0, "shrinkB": 0}, **said,
        )  # fmt: skip


def saved(figure: Figure, kind: str, dpi: float = DPI) -> bytes:
    """A figure as PNG, PDF (TrueType fonts inside) or SVG (letters as outlines), without date or program name."""
    from PIL import Image  # which matplotlib brings

    out, canvas = io.BytesIO(), figure.canvas
    if kind != "png":
        nobody = ("Creator", "Date") if kind == "svg" else ("Creator", "Producer", "CreationDate")
        figure.savefig(out, format=kind, metadata=dict.fromkeys(nobody), dpi=dpi)
        return out.getvalue()
    figure.set_dpi(dpi)
    canvas.draw()
    drawn = Image.frombuffer("RGBA", canvas.get_width_height(), canvas.buffer_rgba()).convert("RGB")  # type: ignore[attr-defined]
    # A figure has a few colours and their blends; 128 draw alike at a third of the bytes.
    few = drawn.quantize(128, method=Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
    few.save(out, format="PNG", dpi=(dpi, dpi), compress_level=7)
    return out.getvalue()


def plot_residuals(fit: Fit) -> Any:
    """For notebooks: the residuals of a fit over time, with themselves a lag later, and against the input."""
    from matplotlib import pyplot

    sheet = residual_panels(fit)
    if sheet is None:
        raise DataError("this fit was read from a file and holds no samples; fit again, or make a report")
    axes = pyplot.subplots(1, len(sheet.panels), figsize=(3 * len(sheet.panels), 3), layout="constrained")[1]
    for one, panel in zip(axes, sheet.panels, strict=True):
        draw_panel(one, panel)
    return axes


def plot_result(result: Fit | Gains | Replay | Rig | Comparison, ax: Axes | None = None) -> Axes:
    """For notebooks: the step responses of a fit, the margins of gains, the trace of every controller, the control
    chart of a rig, or T_s of the sessions compared."""
    from matplotlib import pyplot

    ax = ax if ax is not None else pyplot.subplots(layout="constrained")[1]
    panels: dict[type, Any] = {Fit: fitted_steps, Rig: control_panel, Comparison: values_panel, Gains: margins_panel}
    draw_panel(ax, panels[type(result)](result) if type(result) in panels else tracking_panels(result)[0])  # type: ignore[arg-type]
    return ax
