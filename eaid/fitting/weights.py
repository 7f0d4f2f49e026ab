"""How the levels count in the fits of all levels together: `--weights equal` or `sd`, and the other one beside it."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from eaid.arrays import Array
from eaid.errors import DataError
from eaid.fitting.data import Data, spread_weights
from eaid.steps.stepset import Level


def weights_of(levels: Sequence[Level], how: str) -> Array | None:
    """Weight of each level's squared residuals, or None where all are alike; raises DataError without a spread."""
    if how == "equal":
        return None
    if missing := no_spread(levels):
        raise DataError(f"--weights sd: {missing}; use --weights equal")
    return spread_weights(levels)


def no_spread(levels: Sequence[Level]) -> str | None:
    """Why there are no sd weights, in words; None where there are."""
    single = [f"{level.level:g}" for level in levels if len(level.runs) < 2]
    if single:
        return f"level {', '.join(single)} has one run only, so its repeats have no spread"
    if not np.isfinite(spread_weights(levels)).all():
        same = [f"{level.level:g}" for level in levels if not level.sd.any()]
        return f"the repeats of level {', '.join(same)} are identical, so their spread is no weight"
    return None


def with_other_weights(data: Data, levels: Sequence[Level]) -> Data | str:
    """The same data under the weights that were not asked for; in words why not, where there are none."""
    if len(levels) == 1:
        return "one level only: its weight changes nothing"
    if (data.weights != 1).any():
        weights = np.ones(len(levels))
    elif missing := no_spread(levels):
        return f"no sd weights: {missing}"
    else:
        weights = spread_weights(levels)
    other = replace(data, weights=weights)
    other.__dict__["points"] = data.points  # the compressed curves know nothing of weights
    return other
