"""An output that creeps beside its response, as that of a sensor which warms up: y = response + r (t − t0), t0 the
first row, with a rate r for each log.

A slow part without end, falls that differ and a hysteresis imitate a creep, so that it is asked for beside the plant
that was chosen: where the rates save more squares than noise does, everything is fitted anew to logs without them.
They stay unknowns of the fit, and their freedom is in its intervals.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.special import chdtri

from eaid.arrays import Array
from eaid.estimate.recorded_log import RecordedLog, without_creep
from eaid.estimate.solver import approach
from eaid.estimate.spread import t_quantile
from eaid.findings import Finding, finding
from eaid.levels.creep import SHARE_CHANCE
from eaid.recorded.from_logs import Solved, ended_near, setup_of
from eaid.recorded.kinds import independent_of
from eaid.recorded.log_intervals import Spread, spread

LEAST_PART, MOST_PART = 0.002, 0.2  # Of what an output spans, that a creep makes of it by the end of its log


def begun(solved: Solved, logs: Sequence[RecordedLog]) -> Solved:
    """A fit with the rates of all logs as unknowns, 0 so far."""
    setup = replace(solved.fitted, creeping=len(logs))
    own = (np.append(solved.x[place.own[place.own >= 0]], 0.0) for place in solved.fitted.places)
    return replace(solved, fitted=setup, x=np.concatenate([solved.x[: setup.shared], *own]))


def rates_of(solved: Solved) -> Array:
    """The rates of the logs, (L,)."""
    return np.asarray(solved.x[[place.own[3] for place in solved.fitted.places]])


def creeping(chosen: Solved, clutch: Solved | None, logs: Sequence[RecordedLog]) -> Array:
    """Rates that the logs show beside the plant that was chosen, or the clutch, (L,); zeros where noise explains them,
    or they are no creep's."""
    left, nothing = chosen.fitted.problem().value(chosen.x)[0], np.zeros(len(logs))
    tried = [begun(one, logs) for one in (chosen, clutch) if one is not None]
    ends = [replace(one, x=end.x, cost=end.cost) for one in tried for end in [approach(one.fitted.problem(), one.x)]]
    free = min(ends, key=lambda one: one.cost)
    if left - free.cost <= max(by_noise(free, len(logs)), free.fitted.problem().floor):
        return nothing
    rates = rates_of(free)
    spans = np.array([np.nanmax(log.output) - np.nanmin(log.output) for log in logs])
    parts = np.abs(rates) * [float(log.time_s[-1] - log.time_s[0]) for log in logs] / spans
    return rates if LEAST_PART < parts.max() < MOST_PART else nothing


def by_noise(free: Solved, count: int) -> float:
    """Squares that so many rates save of nothing but noise, as rarely as `SHARE_CHANCE`."""
    return float(chdtri(count, SHARE_CHANCE)) * free.cost / independent_of(free)


def with_rates(solved: Solved, logs: Sequence[RecordedLog]) -> tuple[Solved, tuple[RecordedLog, ...]]:
    """The fit with the rates of its logs at their end, and the logs without them: of these the rates are 0."""
    free = begun(solved, logs)
    ended = ended_near(free.fitted, free.x)
    rates = rates_of(ended)
    plain = tuple(without_creep(log, rate) for log, rate in zip(logs, rates.tolist(), strict=True))
    before, x = ended.fitted, ended.x.copy()
    x[[place.own[3] for place in before.places]] = 0.0
    setup = setup_of(before.model, plain, before.idle_free, before.dead_time_s)
    drives = setup.every.drives if before.model.kind == "swing" else setup.drives
    return replace(ended, fitted=replace(setup, extras=before.extras, creeping=len(logs), drives=drives), x=x), plain


def sure(solved: Solved, logs: Sequence[RecordedLog]) -> bool:
    """Whether the noise, coloured as it is, makes some of the rates as rarely as `SHARE_CHANCE`."""
    known, unknowns = spread(solved), np.eye(solved.setup.size)
    for log, place in zip(logs, solved.setup.places, strict=True):
        variance, degrees = known.variance(unknowns[place.own[3]])
        if abs(log.creep) > t_quantile(degrees, 1 - SHARE_CHANCE) * np.sqrt(variance):
            return True
    return False


def creep_findings(solved: Solved, logs: Sequence[RecordedLog], known: Spread | None, unit: str) -> list[Finding]:
    """What is said of each log whose creep was taken off, with its 95 % interval."""
    found = []
    for log, place in zip(logs, solved.setup.places, strict=False):
        if log.creep and place.own[3] >= 0:
            half = 0.0 if known is None else known.of(np.eye(solved.setup.size)[place.own[3]])
            low, high = log.creep - half, log.creep + half
            found.append(finding("creep-taken-off", log.name, rate=log.creep, low=low, high=high, unit=unit))
    return found
