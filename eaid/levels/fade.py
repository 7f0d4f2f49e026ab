"""Whether the response of steps fades, or grows, in proportion while it is held, as that of discs that warm up does.

    ȳ_l(t) = T_l φ(t; τ1_l, τ2_l, C) (1 + r t),   one r of all levels, T_l, τ1_l, τ2_l of each by itself

r is where Σ ln cost_l is least, each level having noise of its own; how far each by itself pulls it says how sure it is
(sandwich), and by which of the two levels are explained better, whether it is a fade or another C of all levels. A
slow part of the response that grows is its second lag, so only a fade is taken, and only where it explains more than
another C of each level does, or a creep beside the response.
"""

from collections.abc import Callable

import numpy as np
from scipy.optimize import minimize_scalar

from eaid.arrays import Array
from eaid.estimate.data import data_of
from eaid.estimate.spread import t_quantile
from eaid.levels.creep import SHARE_CHANCE
from eaid.levels.each_level import OwnLevels, own_levels
from eaid.steps.stepset import Creep, StepSet

FEWEST_FADES = 4  # Levels that tell a fade
LEAST_FADE = 3e-3  # Part of the output that matters, in the longest hold
MOST_FADED, MOST_GROWN = 0.3, 0.05  # Part of the output in the longest hold within which it is looked for
FADE_SETTLED = 1e-4  # Of that part
FADE_STEP = 2e-3  # The same, over which its derivatives are taken
SHARES_TRIED = (0.5, 0.99)  # Among which another C of all levels is looked for
OF_SHARES = 0.8  # Of what another C of each level saves, that a fade, which is one number, has to
ONE_SIDED = 0.9  # By how many standard errors, over the levels, one of the two explains surely more (two-sided)


def find_fade(stepset: StepSet, share: float, creep: Creep | None) -> tuple[Creep | None, bool]:
    """The fade of levels, C being held at a `share`, and whether it is surely one: else another C explains as much.
    None where none matters, they do not show it, or a `creep` beside the response explains more."""
    levels = stepset.levels
    if len(levels) < FEWEST_FADES:
        return None, False
    data, near = data_of(levels), list[OwnLevels]()
    hold_s, spare = data.longest_s, len(levels) - 1

    def faded(part: float) -> Array:
        """What each level leaves behind a growth by such a part in the longest hold, (L,)."""
        grown = data_of(stepset.without_creep(part / hold_s, 0.0, in_proportion=True).levels)
        near[:] = [own_levels(levels, grown, share, near[0] if near else None)]
        return logs_left(near[0])

    def with_share(C: float | None) -> Array:
        return logs_left(own_levels(levels, data, C))

    part = find_least(faded, (-MOST_FADED, MOST_GROWN))
    below, here, above = (faded(part + step) for step in (-FADE_STEP, 0.0, FADE_STEP))
    pulled, bent = (above - below) / (2 * FADE_STEP), float((above - 2 * here + below).sum()) / FADE_STEP**2
    error = float(np.sqrt((pulled**2).sum() * len(levels) / spare)) / bent
    if not (bent > 0 and part < -max(LEAST_FADE, t_quantile(spare, 1 - SHARE_CHANCE) * error)):
        return None, False
    beside = [] if creep is None else stepset.without_creep(creep.rate, creep.t0_s).levels
    if creep is not None and logs_left(own_levels(levels, data_of(beside), share)).sum() <= here.sum():
        return None, False
    plain, of_shares = float(with_share(share).sum()), float(with_share(None).sum())
    more = with_share(find_least(with_share, SHARES_TRIED)) - here
    surely = float(more.mean() / (more.std(ddof=1) / np.sqrt(len(levels)))) / float(t_quantile(spare, ONE_SIDED))
    if surely < -1 or plain - float(here.sum()) < OF_SHARES * (plain - of_shares):
        return None, False
    rate, error, half = (one / hold_s for one in (part, error, float(t_quantile(spare)) * error))
    since_s = dict.fromkeys((one.level for one in levels), 0.0)
    return Creep(rate, error, half, 0.0, since_s, in_proportion=True), surely > 1


def find_least(logs: Callable[[float], Array], bounds: tuple[float, float]) -> float:
    """Where the levels leave least together."""
    found = minimize_scalar(lambda x: logs(x).sum(), bounds=bounds, method="bounded", options={"xatol": FADE_SETTLED})
    return float(found.x)


def logs_left(found: OwnLevels) -> Array:
    """The logarithm of what each level leaves, (L,)."""
    return np.log([max(float(one.solved.at.cost[0]), 1e-300) for one in found.each])
