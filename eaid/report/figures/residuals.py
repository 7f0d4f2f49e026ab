"""What a model leaves of what was measured: over time, with itself a lag later, and against the input."""

import numpy as np

from eaid.arrays import median
from eaid.report import panels as ink
from eaid.report.figures.replays import broken_at_gaps, drawn_logs
from eaid.report.figures.steps import some_of
from eaid.report.panels import Axis, Line, Panel, Sheet, Span, over
from eaid.report.rig import level_text
from eaid.results import statistics
from eaid.results.fit import Fit
from eaid.results.residuals import Correlation, correlation_of
from eaid.steps.stepset import StepSet

SHOWN_LEVELS = 6  # Levels whose residuals are drawn
LOG_COLOURS = (ink.BLUE, ink.VERMILLION, ink.GREEN)  # Of logs


def residual_panels(fit: Fit, steps: StepSet | None = None) -> Sheet | None:
    """The three panels; None where no samples are at hand. `steps`: those of a fit that was read from a file."""
    over_time, own, against = list[Line](), list[tuple[Correlation, str]](), list[Line]()
    for log, colour in zip(drawn_logs(fit.logs), LOG_COLOURS, strict=False):
        t, u, e = (np.array(column) for column in (log.curve.time_s, log.curve.input, log.curve.residual))
        at, left = broken_at_gaps(t, e[None])
        over_time.append(Line(at, left, log.name, colour, width=0.8, alpha=0.7))
        against.append(Line(u, e, "", colour, "", marker="o", size=1.5, alpha=0.5))
        own.append((log.correlation, colour))
    steps = fit.samples.steps or steps
    ours = steps is not None and steps.levels and {one.level for one in steps.levels} <= set(fit.levels)
    if not over_time and steps is not None and ours and any((fit.nonlinear, fit.linear, fit.friction)):
        both = statistics.residuals(fit, steps)
        off = both["recorded"] - both["fitted"]
        parts = [(one.level, one.time_s, off.loc[one.level].to_numpy()) for one in steps.levels]
        shown = some_of(parts, SHOWN_LEVELS)[::-1]  # the highest, whose noise is largest, below the others
        for (level, at_s, left), colour in zip(shown, ink.level_colours(len(shown))[::-1], strict=True):
            over_time.append(Line(at_s, left, level_text(level, fit.data.input_unit), colour, width=0.8, alpha=0.7))
        low, middle, high = np.array([np.quantile(e, (0.025, 0.5, 0.975)) for _, _, e in parts]).T
        at = [u for u, _, _ in parts]
        against.append(Line(at, middle, "", ink.BLUE, "", marker="o", ends=(low, high)))
        dt_s = median(np.diff(parts[0][1]))
        own.append((correlation_of([e for _, _, e in parts], dt_s), ink.BLUE))
    if not over_time:
        return None
    y, zero = Axis("Residual", fit.data.output_unit), Span(0.0, 0.0, ink.BLACK, "y", 0.5)
    lags = [Line(one.lag_s, one.own, "", colour, width=1.1) for one, colour in own if one.own]
    band = max(one.band for one, _ in own)
    white = [Span(-band, band, ink.PALE, "y"), zero]
    time, legend = ink.OF_LOG if fit.logs else ink.OF_STEP, "over" if len(over_time) > 1 else ""
    panels = [Panel(time, y, over_time, spans=[zero], legend=legend, columns=SHOWN_LEVELS)]
    panels += [Panel(Axis("Lag", "s"), Axis("Autocorrelation", "1", (None, 1.0)), lags, spans=white)] if lags else []
    panels.append(Panel(over(fit.data.input_unit), y, against, spans=[zero], tight=False))
    return Sheet(panels, 2.5, columns=len(panels), shared=False)
