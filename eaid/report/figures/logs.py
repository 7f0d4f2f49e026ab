"""Logs fitted as they were recorded: input, output and residual over time."""

from collections.abc import Sequence

import numpy as np

from eaid.report import panels as ink
from eaid.report.figures.steps import some_of
from eaid.report.panels import Axis, Line, Panel, Ready, Sheet, Span, caption, over, quantity
from eaid.results.fit import Fit
from eaid.results.recorded import LogCurve, LogFit

MOST = 3  # Most logs that are drawn


def drawn_logs(logs: Sequence[LogFit]) -> list[LogFit]:
    """The logs that are drawn: all, or the best, the middle and the worst followed."""
    known = [log for log in logs if log.curve.time_s]
    return known if len(known) <= MOST else some_of(sorted(known, key=lambda log: -(log.fit_pct or 0.0)), MOST)


def titles(names: Sequence[str], letters: int = 44) -> list[str]:
    """The ends of names, by which they differ, all of them in at most so many letters, as matplotlib text."""
    most = letters // len(names)
    return [(name if len(name) <= most else f"…{name[1 - most :]}").replace("$", r"\$") for name in names]


def recorded_logs(fit: Fit) -> Ready | None:
    """A column a log: (top) input, (middle) measured and the model driven by the input alone, (bottom) residual."""
    all_logs = fit.recorded.logs if fit.recorded is not None else ()
    logs, units = drawn_logs(all_logs), (fit.data.input_unit, fit.data.output_unit)
    if not logs:
        return None
    n, heads = len(logs), titles([log.name for log in logs])
    percents = ["" if log.fit_pct is None else f"fit {log.fit_pct:.3g} %" for log in logs]
    columns = [log_panels(log.curve, units, (heads[k], percents[k]), first=k == 0) for k, log in enumerate(logs)]
    panels = [column[row] for row in range(3) for column in columns]
    known = [log for log in logs if None not in (log.rmse, log.fit_pct, log.one_step_pct)]
    worst = min(known, key=lambda log: log.fit_pct or 0.0, default=None)
    text = caption("recorded", shown=n, count=len(all_logs), worst=worst, unit=units[1])
    return Ready(Sheet(panels, 4.2, columns=n, ratios=(1, 1.6, 1), live=n == 1), text)


def log_panels(
    curve: LogCurve, units: tuple[str, str], heads: tuple[str, str] = ("", ""), first: bool = True
) -> list[Panel]:
    """Input, measured and model, residual of one log over its own time; names and legend beside the `first` alone."""
    t, (unit, out) = np.array(curve.time_s), units
    held = Line(np.repeat(t, 2)[1:], np.repeat(curve.input, 2)[:-1], "input", ink.GREEN, width=0.7)
    measured = Line(t, np.array(curve.measured), "measured", ink.SKY, width=1.8)
    model = Line(t, np.array(curve.model), "model", **ink.MODEL)
    residual = Line(t, np.array(curve.residual), "residual", ink.VERMILLION, width=0.6)
    axes = (over(unit), quantity(out), Axis("Residual", out or "output")) if first else (Axis(),) * 3
    return [
        Panel(ink.OF_LOG, axes[0], [held], title=heads[0]),
        Panel(ink.OF_LOG, axes[1], [measured, model], legend="over" if first else "", columns=6, title=heads[1]),
        Panel(ink.OF_LOG, axes[2], [residual], spans=[Span(0.0, 0.0, ink.BLACK, "y", 0.5)]),
    ]
