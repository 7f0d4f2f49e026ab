"""Responses of single steps, from rest or from level to level, as fit.json holds them."""

import msgspec
import numpy as np

from eaid.arrays import Array
from eaid.findings import Finding
from eaid.results.common import Count, Interval, Number, Positive, Result


class StepIntervals(Result, frozen=True):
    """95 % intervals of one step; null where the record says nothing of use, or where it was given."""

    change: Interval = None
    gain: Interval = None
    tau1: Interval = None
    tau2: Interval = None
    C: Interval = None
    dead_time_s: Interval = None


class StepShape(Result, frozen=True):
    """The response of one step, in the units of its step set."""

    run: str
    from_: Number = msgspec.field(name="from")
    """Input before the step."""
    level: Number
    """Input after it."""
    edge: str
    """up or down."""
    start: Number
    """Output before the step."""
    change: Number
    """Steady output less the start."""
    gain: Number | None
    """Change of output over change of input."""
    shape: str
    tau1: Positive
    """Fast time constant [s]; the only one of the shape "one"."""
    tau2: Positive | None
    """Slow time constant [s]."""
    C: Number
    """Fast share; 1 of the shape "one", above 1 of "overshoot"."""
    dead_time_s: Number
    rmse: Number
    fit_pct: Number | None
    """100 (1 − ‖y − ŷ‖/‖y − mean y‖)"""
    R2: Number | None
    samples: Count
    ci95: StepIntervals = StepIntervals()
    """From the noise of this one record: how much steps differ from one another is not in it."""
    evidence: dict[str, Number | None] = {}
    """AICc of each shape less that of the best; shapes with a dead time are named `one+dead` and so on."""
    findings: tuple[Finding, ...] = ()

    def predict(self, time_s: Array) -> Array:
        """Output at times since the step [s]."""
        after = np.maximum(time_s - self.dead_time_s, 0.0)
        slow = 0.0 if self.tau2 is None else (1 - self.C) * np.exp(-after / self.tau2)
        return np.asarray(self.start + self.change * (1 - self.C * np.exp(-after / self.tau1) - slow))
