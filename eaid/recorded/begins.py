"""How recorded logs begin: at rest, in it before their first row, or in the midst of a response."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from eaid.estimate.recorded_log import RecordedLog, add_rest
from eaid.plant.drive import delayed
from eaid.recorded.engagements import FEWEST_ENGAGEMENTS
from eaid.recorded.from_logs import Setup, Solved, idle_found, setup_of
from eaid.recorded.inputs import Excited
from eaid.recorded.kinds import Search
from eaid.recorded.late import LOWER

FARTHEST_PATTERN, NEAREST = 0.3, 0.01  # Steps of a pattern, as parts of a lag and a dead time
FEWEST_RESTING, MANY_RESTING = 10, 30  # Rows of rest before a step that tell its idle output, and before any input
REST_BELIEVED = 4.0  # Squares of a start at rest over those of one with unknown states, up to which it is believed


def mark_resting_start(log: RecordedLog, inputs: Excited) -> RecordedLog:
    """A log that begins with some rows at rest known to be at rest where the output does not deny it."""
    if log.idle_start is not None or log.starts_idle or log.input[0] != 0 or not log.input.any():
        return log
    resting = replace(log, idle_start=True)
    return resting if quick_cost(resting, inputs) <= REST_BELIEVED * quick_cost(log, inputs) else log


def count_from_rest(log: RecordedLog, of: int) -> RecordedLog:
    """One of several logs counted from the rest before it, of a single step or a long one: with an idle output of its
    own it would hide how runs scatter."""
    first, least = int(np.argmax(log.input != 0)), FEWEST_RESTING if log.of_one_level else MANY_RESTING
    known = log.baseline is None and log.reference is None and first >= least
    known = known and (log.of_one_level or of >= FEWEST_ENGAGEMENTS)
    return replace(log, baseline=float(np.nanmean(log.output[:first]))) if known else log


def add_rest_before(log: RecordedLog, inputs: Excited) -> RecordedLog:
    """A log that begins with its input on, behind the rest before it where a dead time shows that there was one."""
    if log.idle_start is not None or log.input[0] == 0 or np.ptp(log.input) == 0 or log.reference is not None:
        return log
    resting = add_rest(log)
    return resting if quick_cost(resting, inputs) < (1 - LOWER) * quick_cost(log, inputs) else log


def quick_cost(log: RecordedLog, inputs: Excited) -> float:
    """Squares that the best lag near a few with dead times leaves of a log."""
    search = Search((log,), inputs.low, inputs.high)
    shapes = [(tau, np.inf) for tau in np.geomspace(search.shortest_s, search.longest_s, 12).tolist()]
    rows = list[tuple[float, float, float]]()
    for theta in (0.0, *np.geomspace(0.5 * search.shortest_s, 0.2 * search.longest_s, 8).tolist()):
        costs = search.costs([delayed(drive, theta) for drive in search.drives], shapes)[:, 0].tolist()
        rows += [(cost, tau, theta) for cost, (tau, _) in zip(costs, shapes, strict=True)]
    least, tau, theta = min(rows)
    apart = FARTHEST_PATTERN
    while apart > NEAREST:  # between these, by a pattern that halves
        factor = 1 + apart
        around = ((tau * factor, theta), (tau / factor, theta), (tau, theta * factor), (tau, theta / factor))
        near = min((search.cost(late, lag, np.inf), lag, late) for lag, late in around)
        apart = apart if near[0] < (1 - LOWER / 20) * least else apart / 2
        least, tau, theta = min(near, (least, tau, theta))
    return least


def set_up_above_idle(base: Solved, logs: Sequence[RecordedLog]) -> Setup:
    """The logs with the idle output that the plant has, for the linear model: it begins where the plant does."""
    known = [replace(log, baseline=idle_found(base, k) + (log.baseline or 0.0)) for k, log in enumerate(logs)]
    return setup_of(base.fitted.model, known, True, base.dead_time_s)
