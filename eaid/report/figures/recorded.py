"""Logs fitted as they were recorded: input, output and residual over time, and the frequency response (Bode plot)."""

import os
from collections.abc import Sequence
from functools import partial

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from eaid.logs.run import Run
from eaid.report import style
from eaid.report.figures import panels
from eaid.report.figures.panels import MODEL, Line, Panel
from eaid.report.figures.steps import level_bar, some_levels
from eaid.report.live import Live, thinned
from eaid.report.results import EdgeLog
from eaid.report.rig import over, quantity
from eaid.report.style import Ready, caption
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


NUMBERED = 20
"""Most edges that are numbered in the picture, and told apart by a legend of their own."""
WITHIN = 0.05
"""An edge has settled within this share of its change."""


def edges_ready(logs: Sequence[EdgeLog]) -> Ready | None:
    """Logs of closed loops: reference and output, and the edges by themselves."""
    shown = [log for log in logs if log.edges]
    every = [one for log in shown for one in log.edges]
    if not every:
        return None
    worst = max(one.overshoot_pct for one in every)
    said = caption("edges", count=len(every), logs=len(logs), rise=[one.rise_s for one in every], worst=worst)
    alone = shown if len(shown) == 1 else []
    return Ready(partial(edges_of_logs, shown), said, lambda: tuple(live(log.run) for log in alone))


def _lines(run: Run) -> list[Line]:
    """Output and reference."""
    output = Line(run.time_s, run.output, "output", style.BLUE)
    reference = run.reference_nm
    return [output] if reference is None else [output, Line(run.time_s, reference, "reference", style.BLACK, ":")]


def live(run: Run) -> Live:
    """Output and reference over the time of the log, and its input where it was recorded."""
    shown = [Panel(quantity(run.output_unit), run.output_unit, 280, _lines(run), named=True)]
    if run.has_input:
        acting = Line(run.time_s, run.input, "input", style.GREEN)
        shown.append(Panel(over(run.input_unit), run.input_unit, 150, [acting]))
    return panels.live(shown, "Time of the log (s)")


def draw_log(axes: Axes, log: EdgeLog) -> None:
    """Reference and output over the time of the log, the edges numbered."""
    for line in _lines(log.run):
        panels.draw_line(axes, line)
    for k, one in enumerate(log.edges[: NUMBERED if len(log.edges) <= NUMBERED else 0]):
        axes.axvline(one.at_s, color=style.GREY, linewidth=0.5)
        axes.annotate(f"{k + 1}", (one.at_s, 1.0), (2, -1), xycoords=("data", "axes fraction"), va="top",
                      textcoords="offset points")  # fmt: skip
    low, high = axes.get_ylim()
    axes.set(xlabel="Time of the log (s)", ylabel=quantity(log.run.output_unit), ylim=(low, high + 0.12 * (high - low)))
    axes.margins(x=0)


def draw_each(axes: Axes, log: EdgeLog) -> None:
    """Every edge from its own start, as share of its own change; the band within which it has settled."""
    t, y = log.run.time_s, log.run.output
    shown = some_levels(list(zip(log.edges, log.ends_s, range(len(log.edges)), strict=True)), NUMBERED)
    lengths = [min(end - one.at_s, 3 * max(one.settling_s or 0.0, 2 * one.rise_s)) for one, end, _k in shown]
    longest = float(np.median(lengths)) if lengths else 1.0
    axes.axhspan(100 - 100 * WITHIN, 100 + 100 * WITHIN, color="#E8E8E8", lw=0)
    for (one, end, k), colour in zip(shown, style.level_colours(len(shown)), strict=True):
        inside = (t >= one.at_s - min(one.rise_s, 0.1 * longest)) & (t <= min(end, one.at_s + longest))
        share = 100 * (y[inside] - one.before) / (one.after - one.before)
        name = f"{k + 1}" if len(shown) <= 6 else None
        axes.plot(*thinned(t[inside] - one.at_s, share, 600), color=colour, linewidth=0.9, label=name)
    axes.set(xlabel="Time since the edge (s)", ylabel="Share of the change (%)")
    axes.margins(x=0)
    if len(shown) > 6:
        level_bar(axes, [k + 1 for _one, _end, k in shown], "Edge")
    elif shown:
        axes.legend(title="edge", loc="center left", bbox_to_anchor=(1.0, 0.5), handlelength=1.2)


def edges_of_logs(logs: Sequence[EdgeLog]) -> Figure:
    """A row a log: (left) reference and output, (right) its edges over each other."""
    shown = some_levels(logs, MOST)
    figure, axes = style.page(0.4 + 2.1 * len(shown), len(shown), 2, width_ratios=(1.5, 1))
    heads = titles([one.run.name for one in shown], 44 * len(shown)) if len(shown) > 1 else [""]
    for k, log in enumerate(shown):
        over_time, each = axes[2 * k : 2 * k + 2]
        draw_log(over_time, log)
        draw_each(each, log)
        style.letter(over_time, MARKS[2 * k], heads[k])
        style.letter(each, MARKS[2 * k + 1], f"grey: ± {100 * WITHIN:g} %")
    style.legend_over(figure, axes[0])
    return figure
