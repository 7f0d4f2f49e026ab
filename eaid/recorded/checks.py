"""What can be said of recorded logs before a fit: refusals, and findings about their inputs and outputs."""

from collections.abc import Sequence

import numpy as np

from eaid.arrays import Array
from eaid.errors import DataError
from eaid.findings import Finding, finding
from eaid.recorded.log import RecordedLog

LEAST_ROWS = 10
FEW_VALUES = 5
"""Different outputs up to which an input that moves all the time is taken for the output."""
JUMP = 0.1
"""A jump, as a part of the largest input."""
FAST_PCT = 20.0
SATURATED_PCT = 20.0
CLIPPED_PCT = 5.0


def refuse(logs: Sequence[RecordedLog]) -> None:
    """Raise `DataError` with a sentence for every log that no model can be fitted to."""
    faults = []
    for log in logs:
        where = log.source or log.name
        top = float(np.nanmax(np.abs(log.input), initial=0.0))
        known = int(np.isfinite(log.output).sum())
        if not np.isfinite(log.input).all():
            faults.append(f"{where}: the input is not known at every row; a fit needs it whole")
        elif top == 0.0:
            faults.append(f"{where}: its input never leaves rest; there is nothing to fit")
        elif (log.input < 0).any():
            faults.append(f"{where}: its input is both above and below rest; say where rest is («rest»)")
        elif known < LEAST_ROWS:
            faults.append(f"{where}: holds {known} rows with an output; a fit needs {LEAST_ROWS}")
        elif np.ptp(log.output[np.isfinite(log.output)]) == 0:
            faults.append(f"{where}: its output never changes; look at the sensor")
        elif len(np.unique(log.output[np.isfinite(log.output)])) <= FEW_VALUES and not log.stepwise:
            faults.append(
                f"{where}: its output takes {FEW_VALUES} values or fewer while its input moves all the time, as if "
                "they were swapped; name both with «columns» input=NAME,output=NAME"
            )
        elif not (np.diff(log.time_s) > 0).all():
            faults.append(f"{where}: its time does not rise; sort or drop the rows")
    if faults:
        raise DataError(*faults)


def input_findings(logs: Sequence[RecordedLog], levels: Array, stepwise: bool) -> list[Finding]:
    """What is doubtful in the inputs, log by log and together."""
    found = [one for log in logs for one in (_fast(log), _saturated(log), _clipped(log)) if one is not None]
    found += [
        finding("input-never-moves", log.name, level=float(log.input[0]))
        for log in logs
        if np.ptp(log.input) == 0 and log.idle_start is not True
    ]
    if len(levels) == 1:
        found.append(finding("one-input-only", "data", levels))
    elif stepwise and len(levels) < 4:
        found.append(finding("few-inputs", "data", levels, count=len(levels)))
    return found


def _fast(log: RecordedLog) -> Finding | None:
    """Rows that differ much from both neighbours, in opposite directions or not."""
    step = np.abs(np.diff(log.input)) > JUMP * log.input.max()
    alone = step[1:] & step[:-1]
    acting = int((log.input > 0).sum())
    share = 100.0 * int(alone.sum()) / max(acting, 1)
    return finding("input-faster-than-sampled", log.name, share_pct=share) if share > FAST_PCT else None


def _saturated(log: RecordedLog) -> Finding | None:
    """A moving input that stands at its largest value."""
    share = 100.0 * log.saturated
    if (log.stepwise and log.reference is None) or share <= SATURATED_PCT:
        return None
    return finding("input-saturates", log.name, share_pct=share, limit=float(log.input.max()))


def _clipped(log: RecordedLog) -> Finding | None:
    """An output that stands at its largest value while different inputs act, and never comes near it otherwise."""
    y = log.output[np.isfinite(log.output)]
    u = log.input[np.isfinite(log.output)]
    top = float(y.max())
    at = y == top
    share = 100.0 * float(at.mean())
    steps = np.unique(y)
    if share <= CLIPPED_PCT or len(steps) < 20 or np.ptp(u[at]) <= JUMP * u.max():
        return None
    return finding("output-saturates", log.name, share_pct=share, limit=top)
