"""Step responses on one pair of axes: mean, ± sd, model, and the level written at the end of each curve."""

from collections.abc import Callable, Mapping

import numpy as np
from matplotlib.axes import Axes

from eaid.arrays import Array
from eaid.report import style
from eaid.report.thin import thinned
from eaid.steps.stepset import StepSet


def quantity(unit: str) -> str:
    """Axis label of an output, by its unit."""
    name = {"N·m": "Torque", "N": "Force", "RPM": "Speed"}.get(unit, "Output")
    return f"{name} ({unit})" if unit else name


def level_text(level: float, unit: str) -> str:
    """A level as written beside its curve: 40 %, 86 N; the bare number where levels have no unit."""
    return (f"{level:.3g} {unit}" if level < 1000 else f"{level:.0f} {unit}").rstrip()


def draw_steps(
    axes: Axes,
    data: StepSet,
    fitted: Mapping[float, Callable[[Array], Array]],
    notes: Mapping[float, str] | None = None,
    spread: bool = False,
) -> None:
    """Draw each level's mean (solid), its model (dashed) and, on request, the band of ± one sd."""
    colours = style.level_colours(len(data.levels))
    ends: list[tuple[float, str, str]] = []
    longest = max(float(level.time_s[-1]) for level in data.levels)
    for level, colour in zip(data.levels, colours, strict=True):
        mean = level.mean
        t, y = thinned(level.time_s, mean, 1200)
        axes.plot(t, y, color=colour, linewidth=0.9)
        if spread and len(level.runs) > 1:
            stride = max(1, len(level.time_s) // 400)
            at, sd = level.time_s[::stride], level.sd[::stride]
            axes.fill_between(at, mean[::stride] - sd, mean[::stride] + sd, color=colour, alpha=0.22, linewidth=0)
        end = float(np.mean(mean[-max(1, len(mean) // 50) :]))
        if level.level in fitted:
            t_fine = np.unique(np.concatenate([np.geomspace(1e-3, 1, 120) * level.time_s[-1], [0.0]]))
            y_fine = fitted[level.level](t_fine)
            axes.plot(t_fine, y_fine, color="white", linewidth=1.7, alpha=0.75)  # lifts the dashes off a noisy curve
            axes.plot(t_fine, y_fine, color=style.VERMILLION, linestyle=(0, (3, 1.5)), linewidth=0.9)
        text = level_text(level.level, data.input_unit)
        ends.append((end, text + (f"  {notes[level.level]}" if notes and level.level in notes else ""), colour))
    axes.set(xlabel="Time since the step (s)", ylabel=quantity(data.output_unit), xlim=(0, longest))
    label_ends(axes, ends, longest)
    axes.plot([], [], color=colours[-1], linewidth=0.9, label="measured mean" + (" ± sd" if spread else ""))
    if fitted:
        axes.plot([], [], color=style.VERMILLION, linestyle=(0, (3, 1.5)), linewidth=0.9, label="model")
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2, borderaxespad=0.2)


def label_ends(axes: Axes, ends: list[tuple[float, str, str]], x: float) -> None:
    """Write a text at the right end of each curve, moved apart where curves end close together."""
    low, high = axes.get_ylim()
    gap = (high - low) * 0.052
    placed: list[float] = []
    for value, _text, _colour in sorted(ends):
        placed.append(max(value, placed[-1] + gap) if placed else value)
    if placed and placed[-1] > high:
        placed = [place - (placed[-1] - high) * k / max(len(placed) - 1, 1) for k, place in enumerate(placed)]
    for (value, text, colour), place in zip(sorted(ends), placed, strict=True):
        axes.annotate(
            text, (x, value), (1.015, place), xycoords="data", textcoords=("axes fraction", "data"),
            color="black", fontsize=6, va="center", annotation_clip=False,
            arrowprops={"arrowstyle": "-", "color": colour, "lw": 0.6, "shrinkA": 0, "shrinkB": 0},
        )  # fmt: skip
