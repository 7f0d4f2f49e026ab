"""Figs. 11–13: steps, the multisine and the sweep, each controller in its own colour and line."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from eaid.arrays import Array
from eaid.report import style
from eaid.report.figures.recorded import titles
from eaid.report.rig import over, quantity
from eaid.report.thin import thinned_at

POINTS = 2500


def _draw(axes: Axes, trace: Mapping[str, Array], values: Array, **look: Any) -> None:
    keep = thinned_at(values, POINTS)
    axes.plot(trace["time_s"][keep], values[keep], **{"linewidth": 0.9, **look})


UNITS = ("%", "N·m")


def tracking(
    traces: Mapping[str, Mapping[str, Array]],
    from_s: float = 0.0,
    bands: Mapping[str, tuple[Array, Array, Array]] | None = None,
    units: tuple[str, str] = UNITS,
    with_error: bool = True,
) -> Figure:
    """Output and reference, the error where wanted, and the input; the error counts from `from_s` on.

    `units` of input and output; `bands` holds time, lower and upper output of a controller over drawn plants, where
    there are any.
    """
    height, ratios = (4.4, (1.5, 1, 1)) if with_error else (3.4, (1.8, 1))
    figure, panels = style.page(height, len(ratios), 1, sharex=True, height_ratios=ratios)
    output, *errors, duty = panels
    for i, (name, trace) in enumerate(traces.items()):
        look = style.controller_look(name, i)
        _draw(output, trace, trace["torque_nm"], label=style.controller_name(name), **look)
        _draw(duty, trace, trace["duty_pct"], **look)
        for axes in errors:
            _draw(axes, trace, trace["reference_nm"] - trace["torque_nm"], **look)
        if bands and name in bands:
            t, low, high = bands[name]
            output.fill_between(t, low, high, color=look["color"], alpha=0.25, linewidth=0)
    first = next(iter(traces.values()))
    _draw(output, first, first["reference_nm"], color=style.BLACK, linestyle=":", label="reference", zorder=5)
    if from_s > 0:
        for axes in panels:
            axes.axvspan(0, from_s, color="#EEEEEE", lw=0)
    output.set_xlim(first["time_s"][0], first["time_s"][-1])
    output.set_ylabel(quantity(units[1]))
    for axes in errors:
        axes.set_ylabel(f"Error ({units[1]})")
        if len(traces) > 1:
            counted = [(one["reference_nm"] - one["torque_nm"])[one["time_s"] >= from_s] for one in traces.values()]
            top = max((float(np.max(np.abs(e))) for e in counted if len(e)), default=1.0)
            axes.set_ylim(-1.25 * top - 1e-9, 1.25 * top + 1e-9)
    duty.set(ylabel=over(units[0]), xlabel="Time (s)")
    for mark, axes in zip("abc", panels, strict=False):
        style.letter(axes, mark, "grey: not counted" if axes in errors and from_s > 0 else "")
    style.legend_above(output)
    return figure


def sweep(frequencies: Mapping[str, Mapping[str, Array]], output_unit: str = "N·m") -> Figure:
    """Fig. 13: (a) amplitude [dB] and (b) mean absolute error over the frequency [Hz].

    Per controller `frequency_hz`, `gain_db` and `mean_abs_error_nm`, each of shape (F,).
    """
    figure, (gain, error) = style.column(3.3, 2, 1, sharex=True)
    for i, (name, row) in enumerate(frequencies.items()):
        look = {**style.controller_look(name, i), "marker": style.controller_marker(name, i)}
        gain.semilogx(row["frequency_hz"], row["gain_db"], label=style.controller_name(name), **look)
        error.semilogx(row["frequency_hz"], row["mean_abs_error_nm"], **look)
    gain.axhline(-3, color=style.GREY, linewidth=0.7, linestyle=":")
    gain.annotate("−3 dB", (1.01, -3), xycoords=("axes fraction", "data"), va="center")
    lowest = min(float(np.min(row["gain_db"])) for row in frequencies.values())
    gain.set(ylabel="Amplitude (dB)", ylim=(max(lowest - 2, -32), None))
    error.set(ylabel=f"Mean |error| ({output_unit})", xlabel="Frequency (Hz)")
    error.set_ylim(0, None)
    ticks = [f for f in (0.1, 0.2, 0.5, 1, 2, 3, 5, 10) if _inside(f, frequencies)]
    for axes in (gain, error):
        axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
        axes.set_xticks([], minor=True)
    for mark, axes in zip("ab", (gain, error), strict=True):
        style.letter(axes, mark)
    style.legend_above(gain, 2 if len(frequencies) > 3 else 3)
    return figure


def recorded_duty(traces: Mapping[str, Mapping[str, Array]], units: tuple[str, str] = UNITS) -> Figure:
    """Recorded output and the model's under the recorded input, a panel a run, with the RMS of their difference."""
    columns = min(3, len(traces))
    rows = -(-len(traces) // columns)
    figure, panels = style.page(0.5 + 1.35 * rows, rows, columns)
    for panel in panels[len(traces) :]:
        panel.set_visible(False)
    heads = titles(list(traces), 16 * len(traces))
    for mark, head, trace, panel in zip("abcdef", heads, traces.values(), panels, strict=False):
        _draw(panel, trace, trace["reference_nm"], color=style.SKY, label="recorded", linewidth=2.2)
        _draw(panel, trace, trace["torque_nm"], color=style.BLACK, label="model, same input", linestyle=(0, (4, 2)))
        rms = float(np.sqrt(np.mean((trace["reference_nm"] - trace["torque_nm"]) ** 2)))
        style.letter(panel, mark, f"{head}: RMS {rms:.2g}")
    for i, panel in enumerate(panels):
        if i % columns == 0:
            panel.set_ylabel(quantity(units[1]))
        if i + columns >= len(traces):
            panel.set_xlabel("Time of the log (s)")
    style.legend_over(figure, panels[0])
    return figure


def guarantee(trace: Mapping[str, Array], output_unit: str = "N·m") -> Figure:
    """What the robust term has to cover, |χ|, and its size ρ over time."""
    figure, (axes,) = style.column(2.3)
    _draw(axes, trace, trace["rho_nm_s"], color=style.BLUE, label=r"available, $\rho$")
    _draw(axes, trace, np.abs(trace["chi_nm_s"]), color=style.VERMILLION, linestyle="--", label=r"needed, $|\chi|$")
    axes.set(xlabel="Time (s)", ylabel=f"Robust term ({output_unit}/s)")
    axes.set_xlim(trace["time_s"][0], trace["time_s"][-1])
    axes.set_ylim(0, 2.5 * float(np.median(trace["rho_nm_s"])))
    style.legend_above(axes)
    return figure


def _inside(f_hz: float, frequencies: Mapping[str, Mapping[str, Array]]) -> bool:
    every = np.concatenate([row["frequency_hz"] for row in frequencies.values()])
    return bool(0.95 * every.min() <= f_hz <= 1.05 * every.max())
