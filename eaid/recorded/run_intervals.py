"""Intervals of another kind of plant from steps: how its unknowns answer to the runs, and how these scatter.

A run of a level has a gain and dynamics of its own: with J = ∂f/∂(ln gain, dynamics) on the samples of a level, each
run alone moves them by (J'J)⁻¹ J' (y_r − ȳ). That scatter, pooled over the levels, gives the unknowns' as it gives the
clutch's (`eaid.estimate.spread`); the dynamics are one for all levels, and so are their units here.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from eaid.estimate.scatter import alike_by_noise, pooled_scatter, run_residuals, run_statistics
from eaid.estimate.spread import Influence, free_inverse
from eaid.recorded.from_logs import Solved
from eaid.recorded.log_intervals import Spread
from eaid.steps.stepset import Level


def with_runs(plain: Spread, solved: Solved, levels: Sequence[Level]) -> Spread:
    """The spread of a fit to the mean curves of some levels, by their runs; as it is where no level has several."""
    if max(len(level.runs) for level in levels) < 2:
        return plain
    setup, x, first = solved.setup, solved.x, solved.setup.model.slices[0].stop
    units = np.where(x[first:] != 0, np.abs(x[first:]), 1.0)  # logarithms, but for what is 0
    curvature, along, own, statistics = np.zeros((setup.size, setup.size)), [], [], []
    for k, level in enumerate(levels):
        J, root = setup.jacobian(x, k)[0], np.sqrt(float(setup.drives[k].w.max()))
        curve = solved.outputs[k] + solved.missed[k]
        of_level = np.column_stack([curve, J[:, first:] / root * units])
        curvature += J.T @ J
        along.append(of_level.T @ J * root)
        own.append(of_level)
        statistics.append(run_statistics(level, run_residuals(level.runs, curve, of_level), of_level))
    pooled = pooled_scatter(statistics)
    pooled = replace(pooled, alike=alike_by_noise(statistics, own, pooled))
    pull = free_inverse(curvature, setup.problem().A[solved.active])
    return replace(plain, runs=Influence(np.array(along) @ pull, pooled, np.zeros((0, setup.size)), 0.0))
