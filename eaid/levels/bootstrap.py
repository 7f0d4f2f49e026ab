"""Second opinion: refits to resampled data. Whole runs within a level, or blocks where a level has one run, as long as
the longest memory that the Bartlett windows allow for.

Resampling R runs with replacement shows (R − 1)/R of their variance; the deviations from the mean are drawn out by
√(R/(R − 1)) to make up for it. A refit starts at the fit itself and finds the same minimum, moved. Each has a seed of
its own.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from eaid.arrays import Array
from eaid.estimate.data import Data
from eaid.estimate.points import Points, compress
from eaid.estimate.scatter import Scatter, windows_of
from eaid.estimate.spread import t_quantile
from eaid.levels.task import FitTask
from eaid.plant.steps import step_response
from eaid.steps.stepset import Level


def bootstrap(task: FitTask, of_runs: Scatter, refit: Callable[[Data], Array]) -> Array:
    """What `refit` makes of resampled sets, (draws, …)."""
    data, options = task.data, task.options
    runs = [_compress_runs(level, data.points.y.shape[1]) for level in of_runs.levels]
    rows = []
    for i in range(options.draws):
        # the means as they were fitted keep their times; only their compressed values change
        random = np.random.default_rng([options.seed, i])
        rows.append(refit(replace(data, compressed=_resample(data.points, of_runs, runs, random))))
        if task.progress:
            task.progress()
    return np.array(rows)


def drawn_ends(value: Array, draws: Array, degrees: Array) -> tuple[Array, Array, Array]:
    """Ends of intervals of values, from what they are in the refits, and their degrees of freedom."""
    reach = t_quantile(degrees) * spread_of(draws)
    return value - reach, value + reach, degrees


def spread_of(draws: Array) -> Array:
    """Standard deviation over refits, the first axis, from their middle 95 %."""
    low, high = np.quantile(draws, [0.025, 0.975], axis=0)
    return np.asarray((high - low) / 3.92)


def _compress_runs(level: Level, length: int) -> Array:
    """Every run of a level on the points of its mean, shape (R, length): compression is linear in the data."""
    rows = compress([level.time_s] * len(level.runs), list(level.runs)).y
    return np.pad(rows, ((0, 0), (0, length - rows.shape[1])))


def _resample(base: Points, of_runs: Scatter, runs: Sequence[Array], random: np.random.Generator) -> Points:
    """The levels' means, resampled; `runs` are their compressed runs."""
    y = np.zeros_like(base.y)
    for k, (level, curve, rows) in enumerate(zip(of_runs.levels, of_runs.curves, runs, strict=True)):
        count = len(rows)
        if count > 1:
            mean, taken = rows.mean(axis=0), random.integers(0, count, count)
            y[k] = mean + np.sqrt(count / (count - 1)) * (rows[taken].mean(axis=0) - mean)
        else:
            fitted, n = step_response(curve, level.time_s), len(level.time_s)
            block = int(np.searchsorted(level.time_s - level.time_s[0], windows_of(level.time_s)[-1]))
            length = min(max(block, 1), max(1, n // 2))
            starts = random.integers(0, n, -(-n // length))
            blocks = (level.mean - fitted)[((starts[:, None] + np.arange(length)) % n).ravel()[:n]]
            y[k] = _compress_runs(replace(level, runs=(fitted + blocks)[None]), len(y[k]))[0]
    return Points(base.t_s, y, base.w)
