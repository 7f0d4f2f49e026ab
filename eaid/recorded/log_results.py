"""Every log against the nonlinear model: how well the free run and one step fit, and both curves to be drawn."""

import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from eaid.arrays import Array
from eaid.recorded.log import RecordedLog
from eaid.recorded.solve import Solved, idle_of
from eaid.results.recorded import LogCurve, LogFit

STRETCHES = 150
"""Of a long log, each with the rows of its extremes."""
DIGITS = 6
"""Of the values that are drawn."""


def log_parts(solved: Solved, logs: Sequence[RecordedLog]) -> tuple[LogFit, ...]:
    """The results of the first logs of a fit; there may be others after them."""
    return tuple(_log_part(solved, k, log) for k, log in enumerate(logs))


def _log_part(solved: Solved, k: int, log: RecordedLog) -> LogFit:
    drive, own = solved.setup.drives[k], solved.setup.places[k].own
    counted = drive.w > 0
    missed, y = solved.missed[k], solved.outputs[k]
    about = float(np.linalg.norm(y - y.mean()))
    span = float(log.time_s[-1] - log.time_s[0])
    return LogFit(
        name=log.name,
        path=log.source,
        sha256=log.sha256,
        samples=len(y),
        duration_s=span,
        rate_hz=(len(log.time_s) - 1) / span,
        input_kind="stepwise" if log.stepwise else "moving",
        idle=idle_of(solved, k) + (log.baseline or 0.0),
        idle_fitted=bool(own[0] >= 0),
        start=tuple(float(solved.x[at]) if at >= 0 else 0.0 for at in own[1:]),  # type: ignore[arg-type]
        rmse=float(np.sqrt(np.mean(missed * missed))),
        fit_pct=100 * (1 - float(np.linalg.norm(missed)) / about) if about > 0 else None,
        one_step_pct=100 * (1 - float(np.linalg.norm(np.diff(missed))) / about) if about > 0 else None,
        curve=curve_of(log.time_s[counted], log.input[counted], log.output[counted], -missed),
    )


def curve_of(time_s: Array, level: Array, measured: Array, residual: Array) -> LogCurve:
    """Rows to be drawn; shapes (n,)."""
    at = extremes(np.stack([level, measured, residual]), STRETCHES)
    columns = (time_s, level, measured, measured - residual, residual)
    return LogCurve(*(tuple(float(f"{x:.{DIGITS}g}") for x in column[at]) for column in columns))


def extremes(rows: Array, stretches: int) -> NDArray[np.intp]:
    """Samples at which one of the rows, (k, n), is least or greatest within its stretch; all where they are few."""
    count, n = rows.shape
    if n <= 2 * count * stretches:
        return np.arange(n)
    starts = np.linspace(0, n, stretches + 1).astype(np.intp)
    found = [np.array([0, n - 1])]
    for first, last in itertools.pairwise(starts.tolist()):
        part = rows[:, first:last]
        found += [first + part.argmin(axis=1), first + part.argmax(axis=1)]
    return np.unique(np.concatenate(found))
