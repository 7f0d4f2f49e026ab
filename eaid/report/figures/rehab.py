"""Figs. 16 and 17: elbow rehabilitation, angle and torque over time, and the position error of each mode."""

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from eaid.arrays import Array
from eaid.report import style
from eaid.report.rig import quantity
from eaid.report.thin import thinned_at

MODES = {
    "soft": ("#CFE6F5", "resistive, soft"),
    "hard": ("#F9DCCB", "resistive, hard"),
    "assisted": ("#D3EDE0", "assisted"),
}
"""Mode → pale ground and name; the paper's blue, red and green."""


def mode_spans(time_s: Array, modes: list[str]) -> list[tuple[str, float, float]]:
    """Stretches of one mode as (name, from [s], to [s]), from the mode of each sample."""
    spans = []
    start = 0
    for i in range(1, len(modes) + 1):
        if i == len(modes) or modes[i] != modes[start]:
            spans.append((modes[start], float(time_s[start]), float(time_s[i - 1])))
            start = i
    return spans


def training(trace: Mapping[str, Array], spans: list[tuple[str, float, float]], unit: str = "N·m") -> Figure:
    """(a) target and angle, (b) position error [°], (c) desired and rendered output, (d) its error, in `unit`."""
    figure, axes = style.page(5.0, 4, 1, sharex=True)
    angle, position, torque, error = axes
    t = trace["time_s"]
    for mark, panel in zip("abcd", axes, strict=True):
        for name, start, end in spans:
            panel.axvspan(start, end, color=MODES.get(name, ("#EEEEEE", name))[0], lw=0)
            panel.axvline(start, color=style.BLACK, linewidth=0.6)  # told apart in grey, too
        panel.grid(color="white")
        style.letter(panel, mark)

    def draw(panel_index: int, values: Array, colour: str, line: str, label: str | None = None) -> None:
        keep = thinned_at(values, 2500)
        axes[panel_index].plot(t[keep], values[keep], color=colour, linestyle=line, linewidth=0.9, label=label)

    draw(0, trace["target_deg"], style.BLACK, "--", "target")
    draw(0, trace["angle_deg"], style.BLUE, "-", "angle")
    draw(1, trace["target_deg"] - trace["angle_deg"], style.BLUE, "-")
    draw(2, trace["desired_nm"], style.BLACK, "--", "desired")
    draw(2, trace["rendered_nm"], style.VERMILLION, "-", "rendered")
    draw(3, trace["desired_nm"] - trace["rendered_nm"], style.VERMILLION, "-")
    for name, start, end in spans:
        angle.annotate(
            MODES.get(name, ("", name))[1], ((start + end) / 2, 1.02), xycoords=("data", "axes fraction"),
            ha="center", va="bottom",
        )  # fmt: skip
    angle.set(ylabel="Angle (°)", xlim=(t[0], t[-1]))
    position.set(ylabel="Position\nerror (°)")
    torque.set(ylabel=quantity(unit))
    error.set(ylabel=f"Error\n({unit})", xlabel="Time (s)")
    for panel in (angle, torque):  # beside the axes, off the data
        panel.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), handlelength=1.6)
    return figure


def errors(absolute_deg: Mapping[str, Array]) -> Figure:
    """Fig. 17: box plot of the absolute position error [°] of each mode; whiskers to 1.5 times the box."""
    figure, (axes,) = style.column(2.4)
    names = list(absolute_deg)
    boxes = axes.boxplot(
        [np.asarray(absolute_deg[name]) for name in names],
        tick_labels=[MODES.get(name, ("", name))[1] for name in names],
        showfliers=False, patch_artist=True, widths=0.5, medianprops={"color": "black", "linewidth": 1.2},
    )  # fmt: skip
    for patch, name, hatch in zip(boxes["boxes"], names, ("", "////", "....", "xxxx"), strict=False):
        patch.set(facecolor=MODES.get(name, ("#EEEEEE", name))[0], hatch=hatch, linewidth=0.7)
    axes.set(ylabel="|position error| (°)")
    axes.set_ylim(0, None)
    axes.grid(axis="x", visible=False)
    return figure
