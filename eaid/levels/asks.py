"""Whether a fit of steps asks for another kind of plant than the clutch's, which `recorded/another_kind.py` tries."""

import numpy as np

from eaid.arrays import median
from eaid.logs.units import UNKNOWN, unit_of
from eaid.results.fit import Fit

MEETS = ("tau2-meets-tau1", "tau1-floor")  # Constraints that hold two lags which are one
NEARLY_ALIKE = 2.5  # τ2 over τ1 up to which the two may be one
MOST_PEAKS, ALIKE = 0.67, 2.0  # Of the single steps from rest; factor between the τ1 of those that one plant may have
LITTLE_BY_LEVEL_PCT = 50.0  # Of every level by its own curve, below which another kind of plant is asked for


def asks_for_one_lag(result: Fit) -> bool:
    """Whether the two lags of the model have met, or a constraint holds them, or the runs ask for C = 1."""
    share = None if result.uncertainty is None else result.uncertainty.share
    of_one = share is not None and share.matters and share.ci95 is not None and share.ci95[1] >= 1
    # a slow lag that is endless at some levels has not met the fast one: the records have not shown it
    meet = any(one.code == "taus-meet" or one.values.get("constraint") in MEETS for one in result.findings)
    meet = meet or never_slow(result) or nearly_alike(result)
    of_stand = any(one.code == "rise-of-the-rig" for one in result.findings)  # whose loading has no lags
    return (of_one or meet) and (not of_stand or result.dead_time_s > 0)


def never_slow(result: Fit) -> bool:
    """Whether the slow lag has no end at any level, or of an output that no friction makes comes behind all records:
    these show one lag, and T_s over C is seen nowhere."""
    part, data = result.nonlinear, result.data
    if part is None or any(row.ci95 is not None and row.ci95.tau2 is not None for row in part.curves):
        return False
    beyond = all((row.tau2 or 0.0) > max(data.record_s, default=np.inf) for row in part.curves)
    of_friction = data.output_unit == UNKNOWN or unit_of(data.output_unit).quantity in ("torque", "force")
    endless = any(one.values.get("constraint") == "tau2-endless" for one in result.findings)
    return endless or (beyond and not of_friction)


def nearly_alike(result: Fit) -> bool:
    """Whether the two lags of the model are as good as one at most levels: a single one that goes with the input."""
    rows = [] if result.nonlinear is None else result.nonlinear.curves
    known = [row.tau2 / row.tau1 for row in rows if row.tau1 and row.tau2]
    return bool(known) and median(known) < NEARLY_ALIKE


def asks_for_another_kind(result: Fit) -> bool:
    """Whether the clutch's model fails, its two lags meet, every level overshoots or most steps do, or the model
    explains little of any level."""
    decaying = {u for one in result.findings if one.code == "output-decays-under-hold" for u in one.levels}
    part = result.nonlinear
    fits = [] if part is None else [row.fit_pct for row in part.per_level if row.fit_pct is not None]
    little = bool(fits) and max(fits) < LITTLE_BY_LEVEL_PCT
    steps = [one for one in result.steps if one.edge == "up" and one.from_ == 0]
    peaks = [one.tau1 for one in steps if one.C > 1 and one.tau2 is not None]
    alike = len(peaks) > MOST_PEAKS * len(steps) and np.quantile(peaks, 0.9) < ALIKE * np.quantile(peaks, 0.1)
    overshoots = decaying >= set(result.data.levels) or bool(alike)
    return not result.verdict.of("nonlinear").usable or little or overshoots or asks_for_one_lag(result)
