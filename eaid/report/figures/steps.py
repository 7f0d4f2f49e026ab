"""Step responses on one pair of axes: the mean of each level, ± sd, its model, and the level at the curve's end."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
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
