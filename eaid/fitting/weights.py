"""Weights of the levels in the fits of all levels: alike, or by the spread of their repeats.

Each fit is also made with the weights that were not asked for.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from eaid.arrays import Array
from eaid.errors import DataError
from eaid.findings import Finding, finding, say
from eaid.fitting.data import Data
from eaid.steps.stepset import Level


def weights_of(levels: Sequence[Level], how: str) -> Array | None:
    """Weight of each level's squared residuals, or None where all are alike; raises DataError without a spread."""
    if how == "equal":
        return None
    missing = no_spread(levels)
    if missing is not None:
        raise DataError(f"«weights» sd: {say(missing)}; use «weights» equal")
    return spread_weights(levels)


def no_spread(levels: Sequence[Level]) -> Finding | None:
    """Why there are no sd weights; None where there are."""
    single = [level.level for level in levels if len(level.runs) < 2]
    if single:
        return finding("no-weights-for-single-runs", "data", single)
    if not np.isfinite(spread_weights(levels)).all():
        same = [level.level for level in levels if not level.sd.any()]
        return finding("no-weights-for-identical-runs", "data", same)
    return None


def with_other_weights(data: Data, levels: Sequence[Level]) -> Data | Finding:
    """The same data under the weights that were not asked for; why not, where there are none."""
    if len(levels) == 1:
        return finding("no-weights-for-one-level", "data")
    missing = no_spread(levels)
    if (data.weights != 1).any():
        weights = np.ones(len(levels))
    elif missing is not None:
        return missing
    else:
        weights = spread_weights(levels)
    other = replace(data, weights=weights)
    other.__dict__["points"] = data.points  # the compressed curves know nothing of weights
    return other


def _variance(level: Level) -> float:
    """Mean over samples of the variance of the repeats (n − 1); NaN for a single run."""
    if len(level.runs) < 2:
        return np.nan
    off = (level.ordered_runs - level.mean).ravel()
    return float(off @ off) / (len(off) - len(level.time_s))


def spread_weights(levels: Sequence[Level]) -> Array:
    """1/s² of each level, s the rms spread of its repeats about their mean, scaled to a mean of 1; shape (L,).

    Levels of a single run have no spread: the result is NaN there.
    """
    variance = np.array([_variance(level) for level in levels])
    with np.errstate(divide="ignore", invalid="ignore"):
        weights = 1.0 / variance
        return np.asarray(weights / weights.mean())
