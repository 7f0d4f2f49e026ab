"""What a model leaves of what was measured: over time, with itself a lag later, and against the input."""

import numpy as np

from eaid.arrays import Array
from eaid.report import panels as ink
from eaid.report.figures.replays import drawn_logs
from eaid.report.figures.steps import some_of
from eaid.report.panels import Axis, Line, Panel, Sheet, Span, over
from eaid.report.rig import level_text
from eaid.results import statistics
from eaid.results.fit import Fit
from eaid.results.residuals import Correlation, correlation_of
from eaid.steps.stepset import StepSet

SHOWN = 6  # Levels whose residuals are drawn
OF_LOGS = (ink.BLUE, ink.VERMILLION, ink.GREEN)
Left = list[tuple[str, Array, Array]]  # Name, time and residual of each record


def residuals(fit: Fit, steps: StepSet | None = None) -> Sheet | None:
    """The three panels; None where no samples are at hand. `steps`: those of a fit that was read from a file."""
    logs = drawn_logs(fit.logs)
    if logs:
        left: Left = [(one.name, np.array(one.curve.time_s), np.array(one.curve.residual)) for one in logs]
        known = [(one.name, one.correlation) for one in logs]
        dots = [
            Line(one.curve.input, one.curve.residual, one.name, colour, "", marker="o", size=1.5, alpha=0.5)
            for one, colour in zip(logs, OF_LOGS, strict=False)
        ]
        return _sheet(fit, left, known, list(OF_LOGS), dots)
    if not any((fit.nonlinear, fit.linear, fit.friction)) or (steps or fit.__dict__.get("steps_fitted")) is None:
        return None
    both = statistics.residuals(fit, steps)
    if both.empty:
        return None
    off = both["recorded"] - both["fitted"]
    groups = [(u, off.loc[u]) for u in off.index.unique(0).astype(float)]
    every = [part.to_numpy() for _, part in groups]
    dt_s = float(np.median(np.diff(groups[0][1].index)))
    left = [(level_text(u, fit.data.input_unit), part.index.to_numpy(), part.to_numpy())
            for u, part in some_of(groups, SHOWN)]  # fmt: skip
    low, middle, high = np.array([np.quantile(one, (0.025, 0.5, 0.975)) for one in every]).T
    spread = Line([u for u, _ in groups], middle, "19 of 20", ink.BLUE, "", marker="o", ends=(low, high))
    return _sheet(fit, left, [("", correlation_of(every, dt_s))], ink.level_colours(len(left)), [spread])


def _sheet(
    fit: Fit, left: Left, known: list[tuple[str, Correlation]], colours: list[str], against: list[Line]
) -> Sheet:
    y, zero = Axis("Residual", fit.data.output_unit), Span(0.0, 0.0, ink.BLACK, "y", 0.5)
    at = [Line(t, e, name, colour, width=0.8, alpha=0.7) for (name, t, e), colour in zip(left, colours, strict=False)]
    own = [
        Line(one.lag_s, one.own, name, colour, width=1.1)
        for (name, one), colour in zip(known, colours if len(known) > 1 else [ink.BLUE], strict=False) if one.own
    ]  # fmt: skip
    band = max((one.band for _, one in known), default=0.0)
    time = ink.OF_LOG if fit.logs else ink.OF_STEP
    panels = [Panel(time, y, at[::-1], spans=[zero], legend="over" if len(at) > 1 else "", columns=SHOWN)]
    if own:
        white = Span(-band, band, ink.PALE, "y")
        panels.append(Panel(Axis("Lag", "s"), Axis("Autocorrelation", limits=(None, 1.0)), own, spans=[white, zero]))
    panels.append(Panel(over(fit.data.input_unit), Axis("Residual", fit.data.output_unit), against, spans=[zero],
                        tight=False))  # fmt: skip
    return Sheet(panels, 2.5, columns=len(panels), shared=False)
