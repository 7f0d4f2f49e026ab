"""Whether a fit of steps asks for another kind of plant than the clutch's, which `recorded/another_kind.py` tries."""

import numpy as np

from eaid.arrays import median
from eaid.logs.units import UNKNOWN, unit_of
from eaid.results.fit import Fit

MEETS = ("tau2-meets-tau1", "tau1-floor")  # Constraints that hold two lags which are one
OPEN = ("tau2-open", "taus-meet")  # Findings that name levels whose τ2 no log tells, beside those of a held parameter
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
    """Whether the slow lag has no end at any level, or of an output that no friction makes comes behind all records, or
    at some is as good as the fast one and comes behind the records of the others: these show one lag, and T_s over C is
    seen nowhere."""
    part, data = result.nonlinear, result.data
    if part is None or not (lags := lags_of_levels(result)):
        return False
    held = [one for one in result.findings if one.values.get("parameter") == "tau2" or one.code in OPEN]
    unknown = {u for one in held for u in one.levels}
    if len(unknown) < len(lags):
        return False
    longest_s = max(data.record_s, default=np.inf)
    beyond, met = [tau2 > longest_s for _, tau2 in lags], [tau2 < NEARLY_ALIKE * tau1 for tau1, tau2 in lags]
    of_friction = data.output_unit == UNKNOWN or unit_of(data.output_unit).quantity in ("torque", "force")
    endless = any(one.values.get("constraint") == "tau2-endless" for one in result.findings)
    alike = any(met) and all(far or near for far, near in zip(beyond, met, strict=True))
    return endless or alike or (all(beyond) and not of_friction)


def nearly_alike(result: Fit) -> bool:
    """Whether the two lags of the model are as good as one at most levels: a single one that goes with the input."""
    lags = lags_of_levels(result)
    return bool(lags) and median([tau2 / tau1 for tau1, tau2 in lags]) < NEARLY_ALIKE


def lags_of_levels(result: Fit) -> list[tuple[float, float]]:
    """τ1 and τ2 of the model at its levels."""
    if (part := result.nonlinear) is None:
        return []
    tau1, tau2 = part.parameters.time_constants(np.array([row.level for row in part.per_level]))
    return [(one, two) for one, two in zip(tau1.tolist(), tau2.tolist(), strict=True) if one > 0]


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
