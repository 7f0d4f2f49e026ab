"""What a model makes of what it has not seen, and when it must not be used for it.

Of steps from rest each level between the others is left out in turn.

The model is fitted without it, from where the whole fit ended, and driven by the input. Levels at the ends are not
left out: that would be about extrapolation. A fit whose levels are missed by their gain alone, and by no more than
their runs scatter, is no worse for it: of L levels Σ off²/(v/(1 − h)) is L times F of L and the runs' degrees of
freedom, v the variance of a level's mean gain by its runs, h its own say in the curve.
"""

import numpy as np
from scipy.special import fdtri

from eaid.arrays import Array, best_gain, median
from eaid.estimate.data import quality
from eaid.findings import Finding, finding
from eaid.levels.certainty import Estimate
from eaid.levels.torque_curve import BEYOND_CHANCE
from eaid.options import FitOptions
from eaid.plant.respond import from_rest
from eaid.results.models import LevelsLeftOut

MOST_LEVELS_IN_TURN = 12  # Levels that are left out in turn, spread over all
TO_SPARE = 1  # Levels beyond the coefficients of T_s(u) that a fit without one must have
WORSE = 0.5  # Part of what is left unexplained by which a model may fall where it has not seen …
FALL_PCT = 10.0  # … and never less than this


def judge_unseen(fit_pct: float | None, held_pct: float | None, what: str) -> list[Finding]:
    """Where a model must not be used: it falls too far where it has not seen, or below 0."""
    if fit_pct is None or held_pct is None:
        return []
    if held_pct >= 0 and fit_pct - held_pct <= max(WORSE * (100 - fit_pct), FALL_PCT):
        return []
    return [finding("hold-out-fails", "nonlinear", (), fit_pct=fit_pct, held_pct=held_pct, what=what)]


def leave_levels_out(estimate: Estimate, options: FitOptions) -> tuple[LevelsLeftOut | None, list[Finding]]:
    """How the model holds at levels that it was fitted without, T_s as the option «curve» has it, and whether it must
    not be used for it; None where there are too few levels."""
    levels, known = estimate.levels, estimate.plant(options)
    if len(levels) < estimate.Ts_terms + 1 + TO_SPARE:
        return None, []
    between = np.argsort([one.level for one in levels])[1:-1].tolist()
    of, off = between[:: -(-len(between) // MOST_LEVELS_IN_TURN)], []
    left = np.zeros((2, 2))  # Squares with and without a level, as it is and with its own gain
    for k in of:
        one, plant, own = levels[k], estimate.without(k, options), float(estimate.solved.at.theta[0, k])
        off.append(float(plant.steady(one.level)) / own - 1 if own > 0 else 0.0)
        for row, p in enumerate((known, plant)):
            curve = from_rest(p, one.time_s, one.level)
            gain = best_gain(curve, one.mean)
            left[row] += [float(np.sum((one.mean - size * curve) ** 2)) for size in (1.0, gain)]
    outputs, worst = [levels[k].mean for k in of], int(np.argmax(np.abs(off)))
    (seen, of_shape), (missed, shape_missed) = (
        [quality(squares, outputs)[0] for squares in row.tolist()] for row in left
    )
    found = LevelsLeftOut(
        fit_pct=seen,
        held_pct=missed,
        Ts_off_pct=100 * median(np.abs(off)),
        worst=levels[of[worst]].level,
        worst_off_pct=100 * off[worst],
    )
    by_chance = not judge_unseen(of_shape, shape_missed, "levels") and _missed_by_chance(estimate, of, np.array(off))
    # a curve through the levels fits each of them by itself: that it falls between them is no fault
    return found, [] if by_chance else judge_unseen(missed if options.through else seen, missed, "levels")


def _missed_by_chance(estimate: Estimate, of: list[int], off: Array) -> bool:
    """Whether levels are missed by no more than their runs' gains scatter."""
    if estimate.model.Ts is None or not (estimate.scatter.repeats > 1).any():
        return False
    say = np.diag(estimate.model.Ts.rows(estimate.scatter.duty) @ estimate.curve.gains)[of]
    variance = estimate.gain_scatter.expected[of, 0] / np.maximum(1 - say, 1e-3)
    ratio = float(np.mean(np.log1p(np.maximum(off, -0.99)) ** 2 / np.maximum(variance, 1e-300)))
    return ratio <= float(fdtri(len(of), max(estimate.scatter.degrees, 1.0), BEYOND_CHANCE))
