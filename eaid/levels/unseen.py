"""What a model makes of what it has not seen, and when it must not be used for it.

Of steps from rest each level between the others is left out in turn.

The model is fitted without it, from where the whole fit ended, and driven by the input. Levels at the ends are not
left out: that would be about extrapolation.
"""

import numpy as np

from eaid.arrays import median
from eaid.estimate.data import quality
from eaid.findings import Finding, finding
from eaid.levels.certainty import Estimate
from eaid.options import FitOptions
from eaid.plant.respond import from_rest
from eaid.results.models import LevelsLeftOut

MOST_LEFT_OUT = 12  # Levels that are left out in turn, spread over all
TO_SPARE = 1  # Levels beyond the coefficients of T_s(u) that a fit without one must have
WORSE = 0.5  # Part of what is left unexplained by which a model may fall where it has not seen …
FALL_PCT = 10.0  # … and never less than this


def worse_unseen(fit_pct: float | None, held_pct: float | None, what: str) -> list[Finding]:
    """Where a model must not be used: it falls too far where it has not seen, or below 0."""
    if fit_pct is None or held_pct is None:
        return []
    if held_pct >= 0 and fit_pct - held_pct <= max(WORSE * (100 - fit_pct), FALL_PCT):
        return []
    return [finding("hold-out-fails", "nonlinear", (), fit_pct=fit_pct, held_pct=held_pct, what=what)]


def levels_left_out(estimate: Estimate, options: FitOptions) -> LevelsLeftOut | None:
    """How the model holds at levels that it was fitted without, T_s as the option «curve» has it; None where there are
    too few levels."""
    levels, known = estimate.levels, estimate.plant(options)
    if len(levels) < estimate.Ts_terms + 1 + TO_SPARE:
        return None
    between = np.argsort([one.level for one in levels])[1:-1].tolist()
    of, seen, missed, off = between[:: -(-len(between) // MOST_LEFT_OUT)], 0.0, 0.0, []
    for k in of:
        one, plant, own = levels[k], estimate.without(k, options), float(estimate.solved.at.theta[0, k])
        off.append(float(plant.steady(one.level)) / own - 1 if own > 0 else 0.0)
        seen += float(np.sum((one.mean - from_rest(known, one.time_s, one.level)) ** 2))
        missed += float(np.sum((one.mean - from_rest(plant, one.time_s, one.level)) ** 2))
    outputs, worst = [levels[k].mean for k in of], int(np.argmax(np.abs(off)))
    return LevelsLeftOut(
        fit_pct=quality(seen, outputs)[0],
        held_pct=quality(missed, outputs)[0],
        Ts_off_pct=100 * median(np.abs(off)),
        worst=levels[of[worst]].level,
        worst_off_pct=100 * off[worst],
    )
