"""What a fit of recorded logs says beyond the models: each log, its falls, its loop."""

from typing import Literal

from eaid.results.common import Count, Interval, Number, Result
from eaid.results.residuals import Correlation


class LogCurve(Result, frozen=True):
    """A log beside the model, to be drawn: tuples of one length, in the units of input and output.

    Of a long log these are the rows with the least and the greatest input, output and residual of each of equal
    stretches, so that a line through them touches every extreme of all three.
    """

    time_s: tuple[Number, ...] = ()
    """The log's own clock [s]."""
    input: tuple[Number, ...] = ()
    """Counted from rest."""
    measured: tuple[Number, ...] = ()
    model: tuple[Number, ...] = ()
    """The free run, idle output included."""
    residual: tuple[Number, ...] = ()
    """Measured less model."""


class LogFit(Result, frozen=True):
    """One log against the nonlinear model (the linear one, where that alone was fitted), in the output's unit."""

    name: str
    path: str = ""
    sha256: str = ""
    samples: Count = 0
    duration_s: Number = 0.0
    rate_hz: Number | None = None
    input_kind: Literal["stepwise", "moving"] = "stepwise"
    idle: Number | None = None
    """Idle output, fitted or known."""
    start: tuple[Number, Number] = (0.0, 0.0)
    """Fast and slow state at the first row."""
    creep: tuple[Number, Number] = (0.0, 0.0)
    """A creep of the output beside the response, which the fit is without: how far it went by the end of the log, and
    how much farther than half of that it was amid the log."""
    drift: Number = 0.0
    """Part by which its gain grew from its start to its end; the fit is of the gain amid it."""
    jump: tuple[Number, Number] = (0.0, 0.0)
    """When the zero of its sensor jumps [s since its first row], and by how much; the fit is without that."""
    counted_from_s: Number = 0.0
    """Time since the first row from which the output is compared: before, an input from before the log acts."""
    late_rows: Number = 0.0
    """Rows by which the input was noted late, a part of one where it changed between two; it was fitted as it acted."""
    rmse: Number | None = None
    fit_pct: Number | None = None
    """Free run: 100 (1 − ‖y − ŷ‖/‖y − mean y‖), the model driven by the input alone."""
    one_step_pct: Number | None = None
    """The same for the prediction y_k + (ŷ_k+1 − ŷ_k) of row k + 1."""
    curve: LogCurve = LogCurve()
    correlation: Correlation = Correlation()
    """Of its residuals, of all rows."""


class FallTest(Result, frozen=True):
    """One number by which falls may differ from rises: what was tested, and whether the fit took it over."""

    name: str
    """release_tau1, release_tau2: time constants of falls to rest [s]; fall_tau1, fall_tau2: factors on those of falls
    between levels; hysteresis_pct: how much more T_s is after a fall of the input than after a rise [%]."""
    value: Number | None = None
    ci95: Interval = None
    chance: Number | None = None
    """Chance of a difference this large if falls went as rises do."""
    fitted: bool = False


class Loop(Result, frozen=True):
    """A recorded closed loop, judged."""

    name: str
    K_P: Number | None = None
    """Gains of a PI law that explains the recorded duty [%/(N·m)], [%/(N·m·s)]; None: none does, or no reference."""
    K_I: Number | None = None
    law_fit_pct: Number | None = None
    """How much of the changes of the duty that law explains."""
    saturated_fraction: Number = 0.0
    """Part of the acting time with the duty at a limit."""
    rms_error: Number | None = None
    """Reference minus recorded output, in the output's unit."""
    method: Literal["direct", "instrument"] = "direct"


class KindTried(Result, frozen=True):
    """One kind of lag beside the others, on the logs that were fitted."""

    kind: str
    """clutch (two in parallel over the input), lag, series, ringing, zero (two with a zero); `+dead`: a dead time."""
    gain: str
    """curve (polynomials of the input), one (for all inputs), sides (one on each side of rest)."""
    lags: Literal["constant", "curve"]
    """Whether time constants are polynomials of the input, too."""
    unknowns: Count
    fit_pct: Number | None
    score: Number | None
    """Squares that are left and what noise alone would save, relative to the kind that is taken."""


class LogsHeldOut(Result, frozen=True):
    """The model on what a fit without it has not seen, beside what it explains of all that was fitted."""

    of: str
    """logs (each left out in turn), or last, middle, first third of a single log."""
    fit_pct: Number | None = None
    held_pct: Number | None = None
    """Both 100 (1 − rms residual/rms output about the mean of all)."""


class Recorded(Result, frozen=True):
    """The part `recorded` of a fit."""

    logs: tuple[LogFit, ...] = ()
    u_range: tuple[Number, Number] = (0.0, 0.0)
    falls: tuple[FallTest, ...] = ()
    loops: tuple[Loop, ...] = ()
    dead_time_s: Number = 0.0
    """Longest dead time of the logs; the models begin behind it."""
    engagements: Count = 0
    hold_out: LogsHeldOut | None = None
