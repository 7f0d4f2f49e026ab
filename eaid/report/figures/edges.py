"""Edges of an output that goes to and fro, as of a closed loop: reference and output, and each edge by itself."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from eaid.logs.run import Run
from eaid.report import style
from eaid.report.figures.recorded import MARKS, MOST, titles
from eaid.report.figures.steps import level_bar, some_levels
from eaid.report.rig import quantity
from eaid.report.thin import thinned
from eaid.steps.edges import Edge, edges

NUMBERED = 20
"""Most edges that are numbered in the picture, and told apart by a legend of their own."""
WITHIN = 0.05
"""An edge has settled within this share of its change."""


@dataclass(frozen=True, eq=False)
class EdgeLog:
    """A log as it was recorded, and the edges of its output."""

    run: Run
    edges: tuple[Edge, ...]

    @property
    def ends_s(self) -> list[float]:
        """Where each edge gives way to the next, or the log ends [s]."""
        return [*(one.at_s for one in self.edges[1:]), float(self.run.time_s[-1])][: len(self.edges)]

    @property
    def goals(self) -> list[float | None]:
        """What the reference asks for behind each edge: its median in the second half of the edge's stretch."""
        t, wanted = self.run.time_s, self.run.reference_nm
        if wanted is None:
            return [None] * len(self.edges)
        spans = zip(self.edges, self.ends_s, strict=True)
        return [float(np.median(wanted[(t >= (one.at_s + end) / 2) & (t <= end)])) for one, end in spans]

    @property
    def rms_error(self) -> float | None:
        """Root mean square of reference − output; None without a reference."""
        wanted = self.run.reference_nm
        return None if wanted is None else float(np.sqrt(np.mean((wanted - self.run.output) ** 2)))


def is_whole(run: Run) -> bool:
    """Whether a run is a log whose edges are looked at: not cut, and a closed loop's or of an unknown input."""
    uncut = not run.cut and run.level is None and run.step_s is None
    return uncut and (run.reference_nm is not None or not run.has_input)


def edge_logs(runs: Sequence[Run]) -> tuple[EdgeLog, ...]:
    """The logs among some runs whose edges are looked at."""
    return tuple(EdgeLog(run, edges(run.time_s, run.output, run.reference_nm)) for run in runs if is_whole(run))


def draw_log(axes: Axes, log: EdgeLog) -> None:
    """Reference and output over the time of the log, the edges numbered."""
    run = log.run
    axes.plot(*thinned(run.time_s, run.output, 2500), color=style.BLUE, linewidth=0.9, label="output")
    if run.reference_nm is not None:
        axes.plot(*thinned(run.time_s, run.reference_nm, 2500), color=style.BLACK, linestyle=":", label="reference")
    for k, one in enumerate(log.edges[: NUMBERED if len(log.edges) <= NUMBERED else 0]):
        axes.axvline(one.at_s, color=style.GREY, linewidth=0.5)
        axes.annotate(f"{k + 1}", (one.at_s, 1.0), (2, -1), xycoords=("data", "axes fraction"), va="top",
                      textcoords="offset points")  # fmt: skip
    low, high = axes.get_ylim()
    axes.set(xlabel="Time of the log (s)", ylabel=quantity(run.output_unit), ylim=(low, high + 0.12 * (high - low)))
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
