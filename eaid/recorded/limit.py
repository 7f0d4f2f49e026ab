"""An output that ends below what the plant would give, with noise behind its limit, so that no row repeats another.

It comes to its largest value as steeply as it rises, and stays there. A fast plant does so, too: which of both it is,
a fit without the rows at that value tells, by whether it goes well beyond.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from eaid.arrays import median
from eaid.estimate.recorded_log import RecordedLog
from eaid.plant.respond import respond
from eaid.recorded.choice import Chosen
from eaid.recorded.from_logs import idle_found, plant_found, start_states
from eaid.steps.noise import sample_noise, stretches

NEAR, LARGEST = 4.0, 0.995  # Deviations of the noise about the largest value, which is a quantile of the output
AT_LIMIT_ROWS, AT_LIMIT = 20, 0.02  # Rows of a stretch at the largest value, and part of all rows in such stretches
RISE, STEEP = 5, 8.0  # Rows before a stretch over which the output rises by so many deviations of the noise
LEAST_BEYOND = 0.03  # Part of the largest value by which the plant goes beyond it there


def without_largest(log: RecordedLog) -> RecordedLog:
    """A log without the rows at its largest output, if it comes there as at a limit; itself where it does not."""
    y, known = log.output, np.isfinite(log.output)
    if log.limit is not None or log.reference is not None or not known.all():
        return log
    noise, top = sample_noise(y), float(np.quantile(y, LARGEST))
    limit = median(y[y > top - NEAR * noise])
    starts, stops = stretches(y > limit - NEAR * noise)
    long = (stops - starts >= AT_LIMIT_ROWS) & (starts >= RISE)
    starts, stops = starts[long], stops[long]
    if not len(starts) or (stops - starts).sum() < AT_LIMIT * len(y):
        return log
    if median(y[starts] - y[starts - RISE]) < STEEP * noise:
        return log
    there = y > limit - NEAR * noise
    share_pct = 100 * float(there.mean())
    return replace(log, output=np.where(there, np.nan, y), limit=limit, at_limit_pct=share_pct)


def goes_beyond(chosen: Chosen, logs: Sequence[RecordedLog], whole: Sequence[RecordedLog]) -> bool:
    """Whether the plant that was fitted to logs without their largest outputs goes beyond these in the mean."""
    solved, plant = chosen.solved, plant_found(chosen.solved)
    for k, (log, before, acting) in enumerate(zip(logs, whole, chosen.logs, strict=True)):
        if log is before or log.limit is None:
            continue
        changes_s, start = acting.time_s - acting.late_s, start_states(solved, k)
        y = respond(plant, changes_s, acting.input, acting.time_s, start, acting.stepwise)
        y = y + idle_found(solved, k) + (acting.baseline or 0.0)
        rows = np.isin(acting.time_s, log.time_s[np.isnan(log.output)])
        if float(y[rows].mean()) > (1 + LEAST_BEYOND) * log.limit:
            return True
    return False
