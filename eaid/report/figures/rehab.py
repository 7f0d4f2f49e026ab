"""Figs. 16 and 17: elbow rehabilitation, angle and torque over time, and the position error of each mode."""

import itertools
from collections.abc import Mapping, Sequence
from operator import itemgetter

import numpy as np

from eaid.arrays import Array
from eaid.replay import rehab
from eaid.report import style
from eaid.report.live import Line, Panel, draw_panels, live_panels
from eaid.report.rig import quantity
from eaid.report.style import Ready, caption
from eaid.report.tables.table import number
from eaid.results.replay import Replay

MODES = {
    "soft": ("#CFE6F5", "resistive, soft"),
    "hard": ("#F9DCCB", "resistive, hard"),
    "assisted": ("#D3EDE0", "assisted"),
}
"""Mode → pale ground and name; the paper's blue, red and green."""
Span = tuple[str, float, float]
"""A stretch of one mode: its name, from [s], to [s]."""


def mode_spans(time_s: Array, modes: Sequence[str]) -> list[Span]:
    """Stretches of one mode, from the mode of each sample."""
    spans = []
    for name, samples in itertools.groupby(zip(modes, time_s.tolist(), strict=True), key=itemgetter(0)):
        times = [t for _name, t in samples]
        spans.append((name, times[0], times[-1]))
    return spans


def session(replay: Replay) -> tuple[Mapping[str, Array], list[Span]] | None:
    """The first controller's trace that holds angle and target, and its modes; RC where it is there."""
    order = sorted(replay.records, key=lambda name: name != "rc")
    trace = next((one for name in order if "angle_deg" in (one := replay.records[name].columns)), None)
    if trace is None:
        return None
    names = [rehab.MODES[code] if 0 <= code < len(rehab.MODES) else str(code) for code in trace["mode"].astype(int)]
    return trace, mode_spans(trace["time_s"], names)


def training(replay: Replay) -> Ready | None:
    """Fig. 16: (a) target and angle, (b) position error [°], (c) desired and rendered output, (d) its error."""
    if (found := session(replay)) is None:
        return None
    (trace, spans), unit = found, replay.head.output_unit
    t = trace["time_s"]
    angle = [
        Line(t, trace["target_deg"], "target", style.BLACK, "--"),
        Line(t, trace["angle_deg"], "angle", style.BLUE),
    ]
    output = [
        Line(t, trace["desired_nm"], "desired", style.BLACK, "--"),
        Line(t, trace["rendered_nm"], "rendered", style.VERMILLION),
    ]
    position = [Line(t, trace["target_deg"] - trace["angle_deg"], "position error", style.BLUE)]
    error = [Line(t, trace["desired_nm"] - trace["rendered_nm"], "error", style.VERMILLION)]
    shown = [
        Panel("Angle (°)", "°", 210, angle, named=True),
        Panel("Position error (°)", "°", 150, position),
        Panel(quantity(unit), unit, 210, output, named=True),
        Panel(f"Error ({unit})", unit, 170, error),
    ]
    figure, axes = style.sheet(style.PAGE_IN, 5.0, 4, 1, sharex=True)
    for panel in axes:
        for name, start, end in spans:
            panel.axvspan(start, end, color=MODES.get(name, ("#EEEEEE", name))[0], lw=0)
            panel.axvline(start, color=style.BLACK, linewidth=0.6)  # told apart in grey, too
        panel.grid(color="white")
    draw_panels(axes, shown)
    for name, start, end in spans:
        axes[0].annotate(
            MODES.get(name, ("", name))[1], ((start + end) / 2, 1.02), xycoords=("data", "axes fraction"),
            ha="center", va="bottom",
        )  # fmt: skip
    axes[1].set_ylabel("Position\nerror (°)")
    axes[3].set_ylabel(f"Error\n({unit})")
    for panel in axes[::2]:  # beside the axes, off the data
        panel.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), handlelength=1.6)
    gap = float(np.mean(np.abs(trace["desired_nm"] - trace["rendered_nm"])))
    text = caption("training", gap=gap, top=float(np.max(np.abs(trace["desired_nm"]))), unit=unit)
    return Ready(figure, text, (live_panels(shown),))


def errors(replay: Replay) -> Ready | None:
    """Fig. 17: box plot of the absolute position error [°] of each mode, without its first seconds.

    Whiskers to 1.5 times the box.
    """
    if (found := session(replay)) is None:
        return None
    trace, spans = found
    skip = replay.head.exercise.uncounted_s if replay.head.exercise is not None else 5.0
    t, error = trace["time_s"], np.abs(trace["target_deg"] - trace["angle_deg"])
    by_mode = {name: error[(t >= start + skip - 1e-9) & (t <= end)] for name, start, end in spans}
    absolute_deg = {name: values for name, values in by_mode.items() if len(values)}
    if not absolute_deg:
        return None
    figure, (axes,) = style.sheet(style.COLUMN_IN, 2.4)
    names = list(absolute_deg)
    boxes = axes.boxplot(
        list(absolute_deg.values()),
        tick_labels=[MODES.get(name, ("", name))[1] for name in names],
        showfliers=False, patch_artist=True, widths=0.5, medianprops={"color": "black", "linewidth": 1.2},
    )  # fmt: skip
    for patch, name, hatch in zip(boxes["boxes"], names, ("", "////", "....", "xxxx"), strict=False):
        patch.set(facecolor=MODES.get(name, ("#EEEEEE", name))[0], hatch=hatch, linewidth=0.7)
    axes.set(ylabel="|position error| (°)")
    axes.set_ylim(0, None)
    axes.grid(axis="x", visible=False)
    medians = [f"{name} {number(float(np.median(values)), 2)}°" for name, values in absolute_deg.items()]
    return Ready(figure, caption("position", medians=medians))
