"""Step responses on one pair of axes: the mean of each level, ± sd, its model, and the level at the curve's end."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import BoundaryNorm

from eaid.arrays import Array
from eaid.report import style
from eaid.report.rig import level_text, over, quantity
from eaid.report.thin import thinned
from eaid.steps.stepset import StepSet

Model = Callable[[Array], Array]
T = TypeVar("T")
MODEL: dict[str, Any] = {"color": style.BLACK, "linestyle": (0, (4, 2)), "linewidth": 0.8}
"""A model is a thin dark dashed line over the broader, paler line of what was measured: both stay to be seen."""
LABELLED = 14
"""Most levels that are named at the ends of their curves; beyond, a colour bar names them."""
DRAWN = 40
"""Most levels that are drawn: more hide each other."""


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


def draw_steps(
    axes: Axes,
    data: StepSet,
    fitted: Mapping[float, Model],
    notes: Mapping[float, str] | None = None,
    spread: bool = False,
    said: str = "model",
) -> None:
    """Draw each level's mean, its model (dashed) and, on request, the band of ± one sd."""
    levels = some_levels(data.levels)
    colours = style.level_colours(len(levels))
    ends: list[tuple[float, str, str]] = []
    longest = max(float(level.time_s[-1]) for level in levels)
    for level, colour in zip(levels, colours, strict=True):
        mean = level.mean
        if spread and len(level.runs) > 1:
            stride = max(1, len(level.time_s) // 400)
            at, sd = level.time_s[::stride], level.sd[::stride]
            axes.fill_between(at, mean[::stride] - sd, mean[::stride] + sd, color=colour, alpha=0.2, linewidth=0)
        axes.plot(*thinned(level.time_s, mean, 1200), color=colour, linewidth=1.5, alpha=0.75, solid_capstyle="round")
        if level.level in fitted:
            fine = fine_times(float(level.time_s[-1]))
            axes.plot(fine, fitted[level.level](fine), **MODEL)
        text = level_text(level.level, data.input_unit)
        end = end_of(mean)
        ends.append((end, text + (f": {notes[level.level]}" if notes and level.level in notes else ""), colour))
    axes.set(xlabel="Time since the step (s)", ylabel=quantity(data.output_unit), xlim=(0, longest))
    if len(levels) <= LABELLED:
        label_ends(axes, ends, longest)
    else:
        level_bar(axes, [one.level for one in levels], over(data.input_unit))
    middle = colours[len(colours) // 2]
    axes.plot([], [], color=middle, linewidth=1.5, alpha=0.75, label="measured" + (" ± sd" if spread else ""))
    if fitted:
        axes.plot([], [], label=said, **MODEL)
    style.legend_above(axes, 2)


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
