"""Logs fitted as they were recorded: input, output and residual over time, and the frequency response (Bode plot)."""

import os
from collections.abc import Sequence

import numpy as np
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from eaid.report import style
from eaid.report.figures.steps import some_levels
from eaid.report.live import MODEL, Line, Panel, draw_panels, live_panels
from eaid.report.results import EdgeLog
from eaid.report.rig import over, quantity
from eaid.report.style import Ready, caption
from eaid.results.fit import Fit
from eaid.results.recorded import LogCurve, LogFit

MOST = 3
"""Most logs, and most frequency responses, that are drawn."""
BAND = "#BDBDBD"
MARKS = "abcdefghi"
TIME = "Time of the log (s)"


def drawn_logs(logs: Sequence[LogFit]) -> list[LogFit]:
    """The logs that are drawn: all, or the best, the middle and the worst followed."""
    known = [log for log in logs if log.curve.time_s]
    if len(known) <= MOST:
        return known
    return some_levels(sorted(known, key=lambda log: -(log.fit_pct or 0.0)), MOST)


def titles(names: Sequence[str], letters: int = 44) -> list[str]:
    """Names without the beginning that all share, and at most so many letters, as matplotlib text."""
    shared = os.path.commonprefix(list(names)) if len(names) > 1 else ""  # noqa: RUF071 (letters are meant)
    cut = max(shared.rfind("-"), shared.rfind("_")) + 1
    most = letters // len(names)
    tails = [name[cut:] or name for name in names]
    return [(tail if len(tail) <= most else f"…{tail[1 - most :]}").replace("$", r"\$") for tail in tails]


def recorded_logs(fit: Fit) -> Ready | None:
    """A column a log: (top) input, (middle) measured and the model driven by the input alone, (bottom) residual."""
    all_logs = fit.recorded.logs if fit.recorded is not None else ()
    logs, units = drawn_logs(all_logs), (fit.data.input_unit, fit.data.output_unit)
    if not logs:
        return None
    n, heads = len(logs), titles([log.name for log in logs])
    figure, axes = style.sheet(style.PAGE_IN, 4.2, 3, n, sharex="col", height_ratios=(1, 1.6, 1))
    for k, log in enumerate(logs):
        column, shown = axes[k::n], log_panels(log.curve, units)
        draw_panels(column, shown, TIME)
        column[2].axhline(0, color=style.BLACK, linewidth=0.5)
        percent = "" if log.fit_pct is None else f"fit {log.fit_pct:.3g} %"
        for row, text in enumerate((heads[k], percent, "")):
            style.letter(column[row], MARKS[n * row + k], text)
            if k:
                column[row].set_ylabel("")
    style.legend_over(figure, axes[n])
    known = [log for log in logs if None not in (log.rmse, log.fit_pct, log.one_step_pct)]
    worst = min(known, key=lambda log: log.fit_pct or 0.0, default=None)
    text = caption("recorded", shown=n, count=len(all_logs), worst=worst, unit=units[1])
    return Ready(figure, text, (live_panels(shown, TIME),) if n == 1 else ())


def log_panels(curve: LogCurve, units: tuple[str, str]) -> list[Panel]:
    """Input, measured and model, residual of one log over its own time."""
    t, (unit, out) = np.array(curve.time_s), units
    held = Line(np.repeat(t, 2)[1:], np.repeat(curve.input, 2)[:-1], "input", style.GREEN, linewidth=0.7)
    measured = Line(t, np.array(curve.measured), "measured", style.SKY, linewidth=1.8)
    model = Line(t, np.array(curve.model), "model", **MODEL)
    residual = Line(t, np.array(curve.residual), "residual", style.VERMILLION, linewidth=0.6)
    output = Panel(quantity(out), out, 280, [measured, model], named=True)
    return [Panel(over(unit), unit, 150, [held]), output, Panel(f"Residual ({out or 'output'})", out, 150, [residual])]


def bode(fit: Fit) -> Ready | None:
    """A column a log: gain and phase with 95 % bands, the models' on the same input over them, and coherence."""
    known = [one for one in (fit.recorded.responses if fit.recorded is not None else ()) if one.frequency_hz]
    if not known:
        return None
    responses = known[:MOST]
    n, heads = len(responses), titles([response.name for response in responses])
    width = style.COLUMN_IN if n == 1 else style.PAGE_IN
    figure, axes = style.sheet(width, 4.6, 3, n, sharex="col", sharey="row", height_ratios=(1.5, 1.3, 0.8))
    for k, response in enumerate(responses):
        gain, phase, coherence = axes[k], axes[n + k], axes[2 * n + k]
        f = np.array(response.frequency_hz)
        angle, half = np.array(response.phase_deg), np.array(response.phase_half_width_deg)
        gain.fill_between(f, response.gain_low, response.gain_high, color=BAND, linewidth=0, label="95 % band")
        gain.plot(f, response.gain, "o", color=style.BLACK, markersize=2, label="recorded")
        told = half < 90  # beyond, the region holds the origin and says nothing of the phase
        phase.fill_between(f, angle - half, angle + half, where=told, color=BAND, linewidth=0)
        phase.plot(f, angle, "o", color=style.BLACK, markersize=2)
        models = (
            ("nonlinear", style.BLUE, "-", response.nonlinear_gain, response.nonlinear_phase_deg),
            ("linear", style.VERMILLION, "--", response.linear_gain, response.linear_phase_deg),
        )
        for name, colour, line, size, turned in models:
            if size:
                gain.plot(f, size, line, color=colour, label=name)
                phase.plot(f, turned, line, color=colour)
        coherence.plot(f, response.coherence, color=style.BLACK, linewidth=0.9)
        gain.set(xscale="log", yscale="log")
        gain.set_ylim(0.5 * min(response.gain), 1.6 * max(response.gain))
        coherence.set(xlabel="Frequency (Hz)", ylim=(0, 1.05))
        for axis in (gain.yaxis, coherence.xaxis):
            axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
            axis.set_major_formatter(FuncFormatter(lambda value, _place: f"{value:g}"))
            axis.set_minor_formatter(NullFormatter())
        for row, panel, text in ((0, gain, heads[k]), (1, phase, ""), (2, coherence, "")):
            style.letter(panel, MARKS[n * row + k], text)
    axes[0].set_ylabel(f"Gain ({fit.data.output_unit or 'output'}/{fit.data.input_unit or 'input'})")
    axes[n].set_ylabel("Phase (°)")
    axes[2 * n].set_ylabel("Coherence (1)")
    style.legend_over(figure, axes[0], 2 if n == 1 else 4)
    first = next((response for response in responses if response.harmonics_pct is not None), responses[0])
    return Ready(figure, caption("bode", shown=n, count=len(known), first=first))


NUMBERED = 20
"""Most edges that are numbered in the picture."""


def edges(logs: Sequence[EdgeLog]) -> Ready | None:
    """The first log that has edges: reference and output over time, the edges numbered, and its input."""
    shown = [(run, found) for run, found in logs if found]
    if not shown:
        return None
    (run, first), every = shown[0], [one for _run, found in shown for one in found]
    lines = [Line(run.time_s, run.output, "output", style.BLUE)]
    if run.reference_nm is not None:
        lines.append(Line(run.time_s, run.reference_nm, "reference", style.BLACK, ":"))
    described = [Panel(quantity(run.output_unit), run.output_unit, 280, lines, named=True)]
    if run.has_input:
        acting = Line(run.time_s, run.input, "input", style.GREEN)
        described.append(Panel(over(run.input_unit), run.input_unit, 150, [acting]))
    figure, axes = style.sheet(style.PAGE_IN, 1.3 + 1.3 * len(described), len(described), 1, sharex=True)
    draw_panels(axes, described, TIME)
    for k, one in enumerate(first[: NUMBERED if len(first) <= NUMBERED else 0]):
        axes[0].axvline(one.at_s, color=style.GREY, linewidth=0.5)
        axes[0].annotate(f"{k + 1}", (one.at_s, 1.0), (2, -1), xycoords=("data", "axes fraction"), va="top",
                         textcoords="offset points")  # fmt: skip
    style.legend_over(figure, axes[0])
    worst = max(one.overshoot_pct for one in every)
    text = caption("edges", count=len(every), logs=len(logs), rise=[one.rise_s for one in every], worst=worst)
    return Ready(figure, text, (live_panels(described, TIME),))
