"""A drive that reaches no further than some level: what was recorded beyond it are repeats of that level.

The highest levels then have one output and one shape. A clutch that saturates has one output, too, but time constants
that go on with the input: whichever leaves less of the steps' shapes is taken, where both do the drive.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from eaid.arrays import best_gain
from eaid.estimate.own_level import AS_LIMITED
from eaid.findings import Finding
from eaid.plant.dynamics import Plant
from eaid.plant.respond import from_rest
from eaid.results.fit import Fit
from eaid.steps.stepset import Level, StepSet


def flat_levels(result: Fit) -> Finding | None:
    """What a fit tells of levels of one output that its T_s(u) goes through; None where it does not."""
    return next((one for one in result.findings if one.code == "output-levels-off" and one.values.get("how")), None)


def join_beyond(levels: Sequence[Level], knee: float) -> tuple[Level, ...] | None:
    """The levels, those beyond one as repeats of it; None where their samples lie at other times."""
    kept, beyond = [one for one in levels if one.level < knee], [one for one in levels if one.level >= knee]
    if not beyond:
        return tuple(kept)
    rows = min(len(one.time_s) for one in beyond)
    grid = beyond[0].time_s[:rows]
    if not all(np.allclose(one.time_s[:rows], grid, rtol=0, atol=1e-6 * grid[-1]) for one in beyond):
        return None
    runs = np.concatenate([one.runs[:, :rows] for one in beyond])
    return (*kept, Level(beyond[0].level, grid, runs, tuple(name for one in beyond for name in one.names)))


def limit_at(stepset: StepSet, told: Finding) -> StepSet | None:
    """The set of a drive that ends at the lowest of levels of one output; None where their samples lie apart."""
    levels, releases = (join_beyond(part, told.levels[0]) for part in (stepset.levels, stepset.releases))
    if levels is None or releases is None:
        return None
    return replace(stepset, levels=levels, releases=releases, findings=(*stepset.findings, told))


def limit_explains_as_well(limited: Fit, through: Fit, levels: Sequence[Level]) -> bool:
    """Whether a drive that ends explains the shapes of levels as well as T_s(u) through them."""
    plants = [one.nonlinear.parameters for one in (limited, through) if one.nonlinear is not None]
    of_drive, of_curve = (_shape_squares(plant, levels) for plant in plants)
    return of_drive <= AS_LIMITED * of_curve


def _shape_squares(plant: Plant, levels: Sequence[Level]) -> float:
    """What a plant leaves of the levels, each with a gain of its own and as a part of its own squares."""
    left = 0.0
    for one in levels:
        f, y = from_rest(plant, one.time_s, one.level), one.mean
        r = y - f * best_gain(f, y)
        left += float(r @ r) / max(float(y @ y), 1e-300)
    return left
