"""Figs. 11–13: steps, the multisine and the sweep, each controller in its own colour and line."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from eaid.arrays import Array
from eaid.report import style
from eaid.report.thin import thinned_at

POINTS = 2500


def _draw(axes: Axes, trace: Mapping[str, Array], values: Array, **look: Any) -> None:
    keep = thinned_at(values, POINTS)
    axes.plot(trace["time_s"][keep], values[keep], linewidth=0.9, **look)


def _reference(axes: Axes, traces: Mapping[str, Mapping[str, Array]]) -> None:
    first = next(iter(traces.values()))
    _draw(axes, first, first["reference_nm"], color=style.BLACK, linestyle=":", label="reference", zorder=5)


def _legend(axes: Axes) -> None:
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=5, borderaxespad=0.2)


def tracking(
    traces: Mapping[str, Mapping[str, Array]],
    from_s: float = 0.0,
    bands: Mapping[str, tuple[Array, Array, Array]] | None = None,
) -> Figure:
    """(a) torque and reference [N·m], (b) torque error [N·m], (c) duty [%]; the error counts from `from_s` on.

    `bands` holds time, lower and upper torque of a controller over drawn plants, where there are any.
    """
    figure, (torque, error, duty) = style.sheet(style.PAGE_IN, 4.4, 3, 1, sharex=True, height_ratios=(1.5, 1, 1))
    for i, (name, trace) in enumerate(traces.items()):
        look = style.controller_look(name, i)
        _draw(torque, trace, trace["torque_nm"], label=style.controller_name(name), **look)
        _draw(error, trace, trace["reference_nm"] - trace["torque_nm"], **look)
        _draw(duty, trace, trace["duty_pct"], **look)
        if bands and name in bands:
            t, low, high = bands[name]
            torque.fill_between(t, low, high, color=look["color"], alpha=0.25, linewidth=0)
    _reference(torque, traces)
    if from_s > 0:
        for axes in (torque, error, duty):
            axes.axvspan(0, from_s, color="#EEEEEE", lw=0)
        torque.annotate("not counted", (from_s / 2, 0.04), xycoords=("data", "axes fraction"), ha="center", fontsize=6)
    first = next(iter(traces.values()))["time_s"]
    torque.set(ylabel="Torque (N·m)", xlim=(first[0], first[-1]))
    error.set(ylabel="Error (N·m)")
    duty.set(ylabel="Duty (%)", xlabel="Time (s)", ylim=(-4, 104))
    if len(traces) > 1:
        counted = [(trace["reference_nm"] - trace["torque_nm"])[trace["time_s"] >= from_s] for trace in traces.values()]
        top = max(float(np.max(np.abs(e))) for e in counted if len(e))
        error.set_ylim(-1.25 * top - 1e-9, 1.25 * top + 1e-9)
    for mark, axes in zip("abc", (torque, error, duty), strict=True):
        style.letter(axes, mark)
    _legend(torque)
    return figure


def steps(traces: Mapping[str, Mapping[str, Array]]) -> Figure:
    """Fig. 11: torque through rising and falling steps [N·m], and the duty that made it [%]."""
    figure, (torque, duty) = style.sheet(style.PAGE_IN, 3.4, 2, 1, sharex=True, height_ratios=(1.8, 1))
    for i, (name, trace) in enumerate(traces.items()):
        look = style.controller_look(name, i)
        _draw(torque, trace, trace["torque_nm"], label=style.controller_name(name), **look)
        _draw(duty, trace, trace["duty_pct"], **look)
    _reference(torque, traces)
    first = next(iter(traces.values()))["time_s"]
    torque.set(ylabel="Torque (N·m)", xlim=(first[0], first[-1]))
    duty.set(ylabel="Duty (%)", xlabel="Time (s)", ylim=(-4, 104))
    for mark, axes in zip("ab", (torque, duty), strict=True):
        style.letter(axes, mark)
    _legend(torque)
    return figure


def sweep(frequencies: Mapping[str, Mapping[str, Array]]) -> Figure:
    """Fig. 13: (a) amplitude [dB] and (b) mean absolute error [N·m] over the frequency [Hz].

    Per controller `frequency_hz`, `gain_db` and `mean_abs_error_nm`, each of shape (F,).
    """
    figure, (gain, error) = style.sheet(style.COLUMN_IN, 3.3, 2, 1, sharex=True)
    for i, (name, row) in enumerate(frequencies.items()):
        look = {**style.controller_look(name, i), "marker": style.controller_marker(name, i)}
        gain.semilogx(row["frequency_hz"], row["gain_db"], label=style.controller_name(name), **look)
        error.semilogx(row["frequency_hz"], row["mean_abs_error_nm"], **look)
    gain.axhline(-3, color=style.GREY, linewidth=0.7, linestyle=":")
    gain.annotate("−3 dB", (0.01, -3), xycoords=("axes fraction", "data"), fontsize=6, va="bottom")
    lowest = min(float(np.min(row["gain_db"])) for row in frequencies.values())
    gain.set(ylabel="Amplitude (dB)", ylim=(max(lowest - 2, -32), None))
    error.set(ylabel="Mean |error| (N·m)", xlabel="Frequency (Hz)")
    error.set_ylim(0, None)
    ticks = [f for f in (0.1, 0.2, 0.5, 1, 2, 3, 5, 10) if _inside(f, frequencies)]
    for axes in (gain, error):
        axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
        axes.set_xticks([], minor=True)
    for mark, axes in zip("ab", (gain, error), strict=True):
        style.letter(axes, mark)
    gain.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2, borderaxespad=0.2)
    return figure


def recorded_duty(traces: Mapping[str, Mapping[str, Array]]) -> Figure:
    """Recorded torque and the model's under the recorded duty [N·m], run over run, on each run's own clock."""
    figure, (torque, error) = style.sheet(style.PAGE_IN, 3.2, 2, 1, height_ratios=(1.8, 1))
    for colour, trace in zip(style.level_colours(len(traces)), traces.values(), strict=True):
        _draw(torque, trace, trace["reference_nm"], color=colour)
        _draw(torque, trace, trace["torque_nm"], color=style.VERMILLION, linestyle=(0, (3, 1.5)))
        _draw(error, trace, trace["reference_nm"] - trace["torque_nm"], color=colour)
    torque.plot([], [], color=style.BLACK, label="recorded")
    torque.plot([], [], color=style.VERMILLION, linestyle=(0, (3, 1.5)), label="model, same duty")
    torque.set(ylabel="Torque (N·m)")
    error.set(ylabel="Recorded − model (N·m)", xlabel="Time of the log (s)")
    for mark, axes in zip("ab", (torque, error), strict=True):
        style.letter(axes, mark)
    _legend(torque)
    return figure


def guarantee(trace: Mapping[str, Array]) -> Figure:
    """What the robust term has to cover, |χ|, and its size ρ over time [N·m/s]."""
    figure, (axes,) = style.sheet(style.COLUMN_IN, 2.2)
    _draw(axes, trace, trace["rho_nm_s"], color=style.BLUE, label=r"available, $\rho$")
    _draw(axes, trace, np.abs(trace["chi_nm_s"]), color=style.VERMILLION, linestyle="--", label=r"needed, $|\chi|$")
    axes.set(xlabel="Time (s)", ylabel="Robust term (N·m/s)", xlim=(trace["time_s"][0], trace["time_s"][-1]))
    axes.set_ylim(0, 2.5 * float(np.median(trace["rho_nm_s"])))
    _legend(axes)
    return figure


def _inside(f_hz: float, frequencies: Mapping[str, Mapping[str, Array]]) -> bool:
    every = np.concatenate([row["frequency_hz"] for row in frequencies.values()])
    return bool(0.95 * every.min() <= f_hz <= 1.05 * every.max())
