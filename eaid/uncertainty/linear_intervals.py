"""Intervals of the linear model: pooled a0, b0, c0, the levels' own a0, gain and B, and the bounds B_m, B_M.

Every number here answers linearly to small changes of the levels' means, δq = Σ_l g_l δȳ_l. With repeats the runs
themselves say how the means scatter; with one run a level the scatter of (T_s, τ1, τ2) is carried through the curve.
"""

from collections.abc import Sequence

import numpy as np

from eaid.arrays import Array, scaled_inverse
from eaid.models import linear as model
from eaid.results.linear import BoundsIntervals, Linear, LinearLevel, LinearLevelIntervals, Pooled, PooledIntervals
from eaid.steps.stepset import Level
from eaid.uncertainty.level_statistics import LevelStatistics
from eaid.uncertainty.levels import log_jacobian
from eaid.uncertainty.linear_influence import (
    TO_LOG_B,
    UNSEEN,
    Gain,
    combined_variance,
    level_gain,
    level_run_statistics,
    level_terms,
    pooled_gain,
)
from eaid.uncertainty.run_statistics import textbook
from eaid.uncertainty.scatter import pooled_scatter
from eaid.uncertainty.student_t import interval_of, log_interval_of


def spreads(gains: Sequence[Gain], stats: LevelStatistics) -> list[tuple[float, float]]:
    """Variance and degrees of freedom of m numbers q with δq = Σ_l g_l δȳ_l, g_l of shape (m, n_l)."""
    if stats.source == "repeats":
        psi = [
            (level.runs @ along.T - level.mean @ along.T) @ take.T / len(level.runs)
            for level, (take, along) in zip(stats.levels, gains, strict=True)
        ]
        if stats.swept:
            together = np.sum(psi, axis=0)  # one number a sweep: its levels do not move apart
            count = len(together)
            return [(float(own @ own * count / (count - 1)), count - 1.0) for own in together.T]
        return [combined_variance([one[:, k] for one in psi]) for k in range(psi[0].shape[1])]
    total = np.zeros(len(gains[0][0]))
    for i, gain in enumerate(gains):
        total += _own_variance(i, gain, stats)
    return [(float(variance), stats.total_degrees) for variance in total]


def _own_variance(i: int, gain: Gain, stats: LevelStatistics) -> Array:
    """Variance of numbers that answer to the mean of level i by `gain`, shape (m,)."""
    take, along = gain
    moved = take @ (along @ log_jacobian(stats.estimates[i].curve, stats.levels[i].time_s))
    variance = stats.variance[i, :3]
    return np.asarray(moved**2 @ np.where(np.isfinite(variance), variance, 0.0))


def pooled_intervals(fit: Pooled, stats: LevelStatistics) -> PooledIntervals:
    """95 % intervals of the pooled a0, b0, c0; one level leaves c0 to b0."""
    found = spreads(pooled_gain(stats.levels, fit.parameters), stats)
    return _pooled(fit, found if len(stats.levels) > 1 else found[:2])


def _pooled(fit: Pooled, found: Sequence[tuple[float, float]]) -> PooledIntervals:
    """From the variance and degrees of freedom of a0, b0 and, with several levels, c0."""
    pairs = zip((fit.a0, fit.b0, fit.c0), found, strict=False)
    return PooledIntervals(*(interval_of(value, variance, degrees) for value, (variance, degrees) in pairs))


def level_intervals(fit: Linear, stats: LevelStatistics) -> list[LinearLevelIntervals]:
    """95 % intervals of a0, gain and B of every level."""
    each = list(zip(stats.levels, fit.per_level, stats.estimates, strict=True))
    if stats.source == "repeats":
        runs = [level_run_statistics(level, row.a0, row.gain, one.noise_nm) for level, row, one in each]
        scatter = pooled_scatter(runs)
        return [
            _logs(row, *found) for row, *found in zip(fit.per_level, scatter.variance, scatter.degrees, strict=True)
        ]
    gains = [(np.eye(3), level_gain(level, row.a0, row.gain)) for level, row, _ in each]
    own = [_own_variance(i, gain, stats) for i, gain in enumerate(gains)]
    return [_logs(row, v, np.full(3, stats.total_degrees)) for row, v in zip(fit.per_level, own, strict=True)]


def _logs(row: LinearLevel, variance: Array, degrees: Array) -> LinearLevelIntervals:
    """Intervals of a0, gain and B from the variances of their logarithms, shape (3,)."""
    values = zip((row.a0, row.gain, row.B), variance.tolist(), degrees.tolist(), strict=True)
    return LinearLevelIntervals(*(log_interval_of(*one) for one in values))


def bound_intervals(fit: Linear, own: Sequence[LinearLevelIntervals]) -> BoundsIntervals:
    """95 % intervals of B_m and B_M, the least and largest B over the kept levels; None where some B is unbounded."""
    levels = fit.bounds.levels if fit.bounds is not None else ()
    kept = [ci.B for row, ci in zip(fit.per_level, own, strict=True) if row.level in levels]
    known = [interval for interval in kept if interval is not None]
    if not known or len(known) < len(kept):
        return BoundsIntervals()
    low, high = np.array(known).T
    return BoundsIntervals((float(low.min()), float(high.min())), (float(low.max()), float(high.max())))


def white(fit: Linear, levels: Sequence[Level]) -> tuple[PooledIntervals, list[LinearLevelIntervals]]:
    """Textbook intervals, s² (J'J)⁻¹ on the means: of the pooled fit, and of each level."""
    p = fit.parameters
    slopes = [model.gradient(p, level.time_s, level.level).T for level in levels]
    left = [level.mean - model.step_response(p, level.time_s, level.level) for level in levels]
    M, noise, spare = textbook(slopes, left, 3 if len(levels) > 1 else 2)
    variance = np.maximum(np.diag(scaled_inverse(M, UNSEEN)) * noise, 0).tolist()
    pooled = _pooled(fit, [(v, spare) for v in variance])
    rows = []
    for level, row in zip(levels, fit.per_level, strict=True):
        J = level_terms(level, row.a0, row.gain)[0]
        M, noise, spare = textbook([J], [level.mean - J[:, 1]], 2)
        logs = TO_LOG_B @ scaled_inverse(M, UNSEEN) @ TO_LOG_B.T * noise
        each = zip((row.a0, row.gain, row.B), np.diag(logs).tolist(), strict=True)
        rows.append(LinearLevelIntervals(*(None if x is None else interval_of(x, x * x * v, spare) for x, v in each)))
    return pooled, rows


def from_draws(
    fit: Linear, pooled: Array | None, own: Array | None, stats: LevelStatistics
) -> tuple[PooledIntervals, list[LinearLevelIntervals]]:
    """The same intervals from the spread of refits: covariance of (a0, b0, c0), variance of the levels' logs (L, 3)."""
    assert pooled is not None and own is not None
    count = 3 if len(stats.levels) > 1 else 2
    degrees = [degrees for _, degrees in spreads(pooled_gain(stats.levels, fit.parameters), stats)]
    found = _pooled(fit, list(zip(np.diag(pooled).tolist(), degrees, strict=True))[:count])
    # a level's own few draws count as much as its runs; what all levels share counts for the rest
    variance = 0.25 * own + 0.75 * own.mean(axis=0) if stats.source == "repeats" else own
    df = np.full(3, stats.total_degrees)
    return found, [_logs(row, v, df) for row, v in zip(fit.per_level, variance, strict=True)]
