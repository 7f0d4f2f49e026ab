"""Edges of an output that goes to and fro, as of a closed loop: reference and output, and each edge by itself."""

from collections.abc import Sequence
from functools import partial

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from eaid.logs.run import Run
from eaid.report import style
from eaid.report.edge_logs import EdgeLog
from eaid.report.figures import panels
from eaid.report.figures.panels import Line, Panel
from eaid.report.figures.recorded import MARKS, MOST, titles
from eaid.report.figures.steps import level_bar, some_levels
from eaid.report.live import Live
from eaid.report.ready import Ready, caption
from eaid.report.rig import over, quantity
from eaid.report.thin import thinned

NUMBERED = 20
"""Most edges that are numbered in the picture, and told apart by a legend of their own."""
WITHIN = 0.05
"""An edge has settled within this share of its change."""


def edges_ready(logs: Sequence[EdgeLog]) -> Ready | None:
    """Logs of closed loops: reference and output, and the edges by themselves."""
    shown = [log for log in logs if log.edges]
    every = [one for log in shown for one in log.edges]
    if not every:
        return None
    worst = max(one.overshoot_pct for one in every)
    said = caption("edges", count=len(every), logs=len(logs), rise=[one.rise_s for one in every], worst=worst)
    alone = shown if len(shown) == 1 else []
    return Ready(partial(edges_of_logs, shown), said, lambda: tuple(live(log.run) for log in alone))


def _lines(run: Run) -> list[Line]:
    """Output and reference."""
    output = Line(run.time_s, run.output, "output", style.BLUE)
    reference = run.reference_nm
    return [output] if reference is None else [output, Line(run.time_s, reference, "reference", style.BLACK, ":")]


def live(run: Run) -> Live:
    """Output and reference over the time of the log, and its input where it was recorded."""
    shown = [Panel(quantity(run.output_unit), run.output_unit, 280, _lines(run), named=True)]
    if run.has_input:
        acting = Line(run.time_s, run.input, "input", style.GREEN)
        shown.append(Panel(over(run.input_unit), run.input_unit, 150, [acting]))
    return panels.live(shown, "Time of the log (s)")


def draw_log(axes: Axes, log: EdgeLog) -> None:
    """Reference and output over the time of the log, the edges numbered."""
    for line in _lines(log.run):
        panels.draw_line(axes, line)
    for k, one in enumerate(log.edges[: NUMBERED if len(log.edges) <= NUMBERED else 0]):
        axes.axvline(one.at_s, color=style.GREY, linewidth=0.5)
        axes.annotate(f"{k + 1}", (one.at_s, 1.0), (2, -1), xycoords=("data", "axes fraction"), va="top",
                      textcoords="offset points")  # fmt: skip
    low, high = axes.get_ylim()
    axes.set(xlabel="Time of the log (s)", ylabel=quantity(log.run.output_unit), ylim=(low, high + 0.12 * (high - low)))
    axes.margins(x=0)


def draw_each(axes: Axes, log: EdgeLog) -> None:
    """Every edge from its own start, as share of its own change; the band within which it has settled."""
    t, y = log.run.time_s, log.run.output
    shown = some_levels(list(zip(log.edges, log.ends_s, range(len(log.edges)), strict=True)), NUMBERED)
    lengths = [min(end - one.at_s, 3 * max(one.settling_s or 0.0, 2 * one.rise_s)) for one, end, _k in shown]
    longest = float(np.median(lengths)) if lengths else 1.0
    axes.axhspan(100 - 100 * WITHIN, 100 + 100 * WITHIN, color="#E8E8E8", lw=0)
    for (one, end, k), colour in zip(shown, style.level_colours(len(shown)), strict=True):
        inside = (t >= one.at_s - min(one.rise_s, 0.1 * longest)) & (t <= min(end, one.at_s + longest))
        share = 100 * (y[inside] - one.before) / (one.after - one.before)
        name = f"{k + 1}" if len(shown) <= 6 else None
        axes.plot(*thinned(t[inside] - one.at_s, share, 600), color=colour, linewidth=0.9, label=name)
    axes.set(xlabel="Time since the edge (s)", ylabel="Share of the change (%)")
    axes.margins(x=0)
    if len(shown) > 6:
        level_bar(axes, [k + 1 for _one, _end, k in shown], "Edge")
    elif shown:
        axes.legend(title="edge", loc="center left", bbox_to_anchor=(1.0, 0.5), handlelength=1.2)


def edges_of_logs(logs: Sequence[EdgeLog]) -> Figure:
    """A row a log: (left) reference and output, (right) its edges over each other."""
    shown = some_levels(logs, MOST)
    figure, axes = style.page(0.4 + 2.1 * len(shown), len(shown), 2, width_ratios=(1.5, 1))
    heads = titles([one.run.name for one in shown], 44 * len(shown)) if len(shown) > 1 else [""]
    for k, log in enumerate(shown):
        over_time, each = axes[2 * k : 2 * k + 2]
        draw_log(over_time, log)
        draw_each(each, log)
        style.letter(over_time, MARKS[2 * k], heads[k])
        style.letter(each, MARKS[2 * k + 1], f"grey: ± {100 * WITHIN:g} %")
    style.legend_over(figure, axes[0])
    return figure
