"""An error that no duty can undercut: the exact path between lines that lie outside everything the plant can do.

From T = x1 + x2 a duty leads to (T − x2) e1 + x2 e2 + gained, which is linear in T and in x2: its extremes over x2 lie
at the ends of what x2 can have reached, its least over the duties is concave in T (a chord lies below it), its greatest
convex (a chord lies above it). Chords from T = 0 to the highest steady torque bound every next torque from both sides,
and `taut_path` is the best path between them.
"""

import math

import numpy as np

from eaid.arrays import Array
from eaid.replay.compiled import kernel
from eaid.replay.plant import PlantParameters, falling_taus, plant_terms
from eaid.replay.rate_limited import taut_path

DUTIES = 201
"""Duties at which the limits are taken, evenly from the lowest to the highest."""
REACHES = 101
"""Values of the slow part at which the upper limit is taken."""


def least_cost(
    plant: PlantParameters, reference: Array, weight: Array, dt_s: float, limits_pct: tuple[float, float]
) -> float:
    """Σ w (T − r)² [N²·m²] below which no duty [%] within its limits comes; reference [N·m] and weight, shapes (n,)."""
    duties = np.linspace(*limits_pct, DUTIES).tolist()
    top = max(plant_terms(plant, duty)[2] for duty in duties)
    keep1, keep2, gained1, gained2 = _rows(plant, duties, dt_s, highest=True)
    # the largest slow part that any duty can have made by each sample, from rest
    reach = np.zeros(len(reference))
    for k in range(1, len(reach)):
        reach[k] = max(float((keep2 * reach[k - 1] + gained2).max()), 0.0)
    most = max(float(reach.max()), 1e-12)
    # the greatest is convex in the reach, too: between a hundred values of it, chords again lie above
    some = np.linspace(0.0, most, REACHES)
    rises = []
    for torque in (0.0, top):
        step = np.multiply.outer(some, keep2 - keep1) + (keep1 * torque + gained1 + gained2)
        rises.append(np.interp(reach, some, np.maximum(step, step[0]).max(axis=1)))
    keep1, keep2, gained1, gained2 = _rows(plant, duties, dt_s, highest=False)
    falls = [
        min((keep1 * torque + x2 * (keep2 - keep1) + gained1 + gained2).min() for x2 in (0.0, most))
        for torque in (0.0, top)
    ]
    n = len(reach)
    lines = np.full(n, (falls[1] - falls[0]) / top), np.full(n, falls[0]), (rises[1] - rises[0]) / top, rises[0]
    return float(kernel(taut_path)(reference, weight, *lines, 0.0, np.empty(n)))


def _rows(plant: PlantParameters, duties: list[float], dt_s: float, highest: bool) -> tuple[Array, ...]:
    """Lines that bound what each duty does to the two parts in a sample: e1, e2 and what is gained, one row a line.

    With release constants a part follows the rising line above its own path and the release line below: where release
    is slower, the higher of the two, so that the release line alone bounds it from below; where quicker, the lower.
    """

    def constants(rising: float, release: float) -> tuple[float, ...]:
        if release == rising:
            return (rising,)
        if (release > rising) == highest:
            return (rising, release)
        return (rising,) if highest else (release,)

    rows = []
    for duty in duties:
        tau1, tau2, steady = plant_terms(plant, duty)
        release1, release2 = falling_taus(plant, duty)
        for fast_tau in constants(tau1, release1):
            for slow_tau in constants(tau2, release2):
                lost1, lost2 = -math.expm1(-dt_s / fast_tau), -math.expm1(-dt_s / slow_tau)
                rows.append((1 - lost1, 1 - lost2, plant.C * steady * lost1, (1 - plant.C) * steady * lost2))
    return tuple(np.array(rows).T)
