"""Panels over one time axis: described once, drawn as a figure and as a live plot."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from matplotlib.axes import Axes

from eaid.arrays import Array
from eaid.report import style
from eaid.report.live import Live, Plot, thinned

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


def draw(axes: Sequence[Axes], panels: Sequence[Panel], time: str = "Time (s)") -> None:
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


def live(panels: Sequence[Panel], time: str = "Time (s)") -> Live:
    """The panels as one live plot."""
    plot = Plot()
    for one in panels:
        drawn = plot.panel(time if one is panels[-1] else "", one.label, one.height, one.unit)
        for line in one.lines:
            legend = line.name if one.named else None
            dash = DASHES.get(line.linestyle, "dotted")
            plot.line(drawn, line.t, line.y, line.name, line.color, dash, legend)
    return plot.finish()
