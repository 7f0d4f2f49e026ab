"""Logs fitted as they were recorded: input, output and residual over time, and the frequency response (Bode plot)."""

import os
from collections.abc import Sequence
from functools import partial

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from eaid.report import style
from eaid.report.figures import panels
from eaid.report.figures.panels import MODEL, Line, Panel
from eaid.report.figures.steps import some_levels
from eaid.report.ready import Ready, caption
from eaid.report.rig import over, quantity
from eaid.results.fit import Fit
from eaid.results.recorded import LogCurve, LogFit, Response

MOST = 3
"""Most logs, and most frequency responses, that are drawn."""
BAND = "#BDBDBD"
MARKS = "abcdefghi"


def logs_ready(fit: Fit) -> Ready | None:
    """Logs fitted as recorded: input, measured, model, residual."""
    all_logs = fit.recorded.logs if fit.recorded is not None else ()
    logs = drawn_logs(all_logs)
    if not logs:
        return None
    units = fit.data.input_unit, fit.data.output_unit
    known = [log for log in logs if None not in (log.rmse, log.fit_pct, log.one_step_pct)]
    worst = min(known, key=lambda log: log.fit_pct or 0.0, default=None)
    text = caption("recorded", shown=len(logs), count=len(all_logs), worst=worst, unit=units[1])
    live = [log_panels(log.curve, units) for log in logs] if len(logs) == 1 else []
    draw = partial(recorded_logs, logs, units)
    return Ready(draw, text, lambda: tuple(panels.live(shown, "Time of the log (s)") for shown in live))


def bode_ready(fit: Fit) -> Ready | None:
    """Frequency responses of recorded logs whose input moves."""
    responses = fit.recorded.responses if fit.recorded is not None else ()
    known = [response for response in responses if response.frequency_hz]
    if not known:
        return None
    shown = known[:MOST]
    first = next((response for response in shown if response.harmonics_pct is not None), shown[0])
    text = caption("bode", shown=len(shown), count=len(known), first=first)
    return Ready(partial(bode, shown, (fit.data.input_unit, fit.data.output_unit)), text)


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


def recorded_logs(logs: Sequence[LogFit], units: tuple[str, str]) -> Figure:
    """A column a log: (top) input, (middle) measured and the model driven by the input alone, (bottom) residual."""
    n, heads = len(logs), titles([log.name for log in logs])
    figure, axes = style.page(4.2, 3, n, sharex="col", height_ratios=(1, 1.6, 1))
    for k, log in enumerate(logs):
        column = axes[k::n]
        panels.draw(column, log_panels(log.curve, units), "Time of the log (s)")
        column[2].axhline(0, color=style.BLACK, linewidth=0.5)
        fit = "" if log.fit_pct is None else f"fit {log.fit_pct:.3g} %"
        for row, text in enumerate((heads[k], fit, "")):
            style.letter(column[row], MARKS[n * row + k], text)
            if k:
                column[row].set_ylabel("")
    style.legend_over(figure, axes[n])
    return figure


def log_panels(curve: LogCurve, units: tuple[str, str]) -> list[Panel]:
    """Input, measured and model, residual of one log over its own time."""
    t, (unit, out) = np.array(curve.time_s), units
    held = Line(np.repeat(t, 2)[1:], np.repeat(curve.input, 2)[:-1], "input", style.GREEN, linewidth=0.7)
    measured = Line(t, np.array(curve.measured), "measured", style.SKY, linewidth=1.8)
    model = Line(t, np.array(curve.model), "model", **MODEL)
    residual = Line(t, np.array(curve.residual), "residual", style.VERMILLION, linewidth=0.6)
    output = Panel(quantity(out), out, 280, [measured, model], named=True)
    return [Panel(over(unit), unit, 150, [held]), output, Panel(f"Residual ({out or 'output'})", out, 150, [residual])]


def bode(responses: Sequence[Response], units: tuple[str, str]) -> Figure:
    """A column a log: gain and phase with 95 % bands, the models' on the same input over them, and coherence."""
    n, heads = len(responses), titles([response.name for response in responses])
    make = style.column if n == 1 else style.page
    figure, axes = make(4.6, 3, n, sharex="col", sharey="row", height_ratios=(1.5, 1.3, 0.8))
    for k, response in enumerate(responses):
        gain, phase, coherence = axes[k], axes[n + k], axes[2 * n + k]
        f = np.array(response.frequency_hz)
        angle, half = np.array(response.phase_deg), np.array(response.phase_half_width_deg)
        gain.fill_between(f, response.gain_low, response.gain_high, color=BAND, linewidth=0, label="95 % band")
        gain.plot(f, response.gain, "o", color=style.BLACK, markersize=2, label="recorded")
        known = half < 90  # beyond, the region holds the origin and says nothing of the phase
        phase.fill_between(f, angle - half, angle + half, where=known, color=BAND, linewidth=0)
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
    axes[0].set_ylabel(f"Gain ({units[1] or 'output'}/{units[0] or 'input'})")
    axes[n].set_ylabel("Phase (°)")
    axes[2 * n].set_ylabel("Coherence (1)")
    style.legend_over(figure, axes[0], 2 if n == 1 else 4)
    return figure
