"""Every level by itself, Eq. (3): T_s, τ1 and τ2 answer to its own runs; how these scatter is pooled over levels."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import msgspec
import numpy as np
from scipy.special import expit, logit

from eaid.arrays import Array
from eaid.estimate.data import Data
from eaid.estimate.points import level_residuals
from eaid.estimate.scatter import Scatter
from eaid.estimate.solver import solver_verdict
from eaid.estimate.spread import Influence, interval_of
from eaid.levels.certainty import Estimate, unbent
from eaid.levels.from_steps import fit_levels_first
from eaid.results.common import Interval, Solver
from eaid.steps.stepset import Level


@dataclass(frozen=True, eq=False)
class OwnLevels:
    """The levels' own estimates."""

    levels: tuple[Level, ...]
    each: tuple[Estimate, ...]

    @cached_property
    def scatter(self) -> Scatter:
        """What the runs say of their curves."""
        theta = np.concatenate([one.solved.at.theta for one in self.each], axis=1)
        return Scatter(self.levels, theta, self.each[0].model.free_share)

    @property
    def logs(self) -> Array:
        """ln T_s, ln τ1, ln τ2 of the levels, (3, L)."""
        return np.log(np.maximum(self.scatter.theta[:3], 1e-300))

    def residuals(self, data: Data) -> list[Array]:
        """f − y at every sample of each level, shapes (n_l,)."""
        return level_residuals(self.scatter.theta, data.records)

    @cached_property
    def solver(self) -> Solver:
        """One verdict for all levels: the worst of theirs."""
        solvers = [one.solved.solver for one in self.each]
        failed = [f"{level.level:g}" for level, one in zip(self.levels, solvers, strict=True) if not one.converged]
        fewest = min(len(one.starts) for one in solvers)
        costs = np.sum([one.costs[:fewest] for one in solvers], axis=0)
        held = [code for one in solvers for code in one.at_bounds]
        worst = max(one.predicted_decrease or 0.0 for one in solvers)
        said = f"not converged at level {', '.join(failed)}" if failed else "converged at every level"
        whole = solver_verdict(worst, sum(one.evaluations for one in solvers), costs, held)
        return msgspec.structs.replace(whole, converged=not failed, message=said)

    @cached_property
    def intervals(self) -> tuple[Array, Array, Array]:
        """Least and largest ln T_s, ln τ1, ln τ2 of the levels and their degrees of freedom, (3, L) each."""
        rows = []
        for i, (level, one) in enumerate(zip(self.levels, self.each, strict=True)):
            rows.append(one.intervals(np.array([level.level]), self.scatter.of_levels.alone(i)))
        low, high, degrees = (np.concatenate(part, axis=1) for part in zip(*rows, strict=True))
        return low, high, degrees

    def share_interval(self, i: int) -> Interval:
        """95 % interval of a free C of one level; None where it was held."""
        if not self.scatter.share_free:
            return None
        seen = self.scatter.of_levels.alone(i)
        own = Influence(np.eye(1, 4, 3)[:, :, None], seen, np.zeros((0, 1)), 0.0)
        variance, degrees = (float(one[0]) for one in own.variance())
        low, high = interval_of(float(logit(self.scatter.theta[3, i])), variance, degrees)
        return (float(expit(low)), float(expit(high))) if np.isfinite([low, high]).all() else None


def own_levels(levels: Sequence[Level], data: Data, share: float | None, near: OwnLevels | None = None) -> OwnLevels:
    """Every level by itself, C held at `share` or free; `near` are those of data that differ little."""
    found = _each_by_itself(levels, data, share, near)
    several = bool((found.scatter.repeats > 1).any())
    return _each_by_itself(levels, unbent(data, found.scatter), share, found) if several else found


def _each_by_itself(levels: Sequence[Level], data: Data, share: float | None, near: OwnLevels | None) -> OwnLevels:
    each = []
    for i, level in enumerate(levels):
        begin = None if near is None else [near.each[i].solved.x]
        each.append(Estimate((level,), fit_levels_first(data.only([i]), share, begin)))
    return OwnLevels(tuple(levels), tuple(each))
