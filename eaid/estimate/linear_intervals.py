"""Intervals of the linear model: pooled a0, b0, c0, the levels' own a0, gain and B, and the bounds B_m, B_M.

Every number here answers linearly to small changes of the levels' means, δq = Σ_l g_l δȳ_l. With repeats the runs
themselves say how the means scatter; with one run a level the scatter of (T_s, τ1, τ2) is carried through the curve.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from eaid.arrays import Array, scaled_inverse
from eaid.estimate.level_statistics import LevelStatistics, log_jacobian
from eaid.estimate.runs import (
    RunStatistics,
    interval_of,
    log_interval_of,
    pooled_scatter,
    run_statistics,
    textbook,
)
from eaid.estimate.spread import Influence
from eaid.models import linear as model
from eaid.models.parameters import Linear as LinearParameters
from eaid.results.fit import BoundsIntervals, Linear, LinearLevel, LinearLevelIntervals, Pooled, PooledIntervals
from eaid.steps.stepset import Level

TO_LOG_B = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, -1.0]])
"""(log a0, log gain) → (log a0, log gain, log B) less log u."""


UNSEEN = 1e-10
"""Directions that the data do not see, b0 and c0 of a single level, have this part of the information at most."""


def _rise(a0: float, t_s: Array) -> tuple[Array, Array, Array]:
    """r = (1 − e^(−a0 t))/a0 and its first two derivatives by a0, shape (n,) each."""
    rise = -np.expm1(-a0 * t_s)
    decay, r = 1.0 - rise, rise / a0
    first = (t_s * decay - r) / a0
    return r, first, (-(t_s**2) * decay - 2 * first) / a0


Gain = tuple[Array, Array]
"""How a change of a level's mean moves m numbers, shape (m, n), as a product of (m, k) and (k, n)."""


def pooled_gain(levels: Sequence[Level], p: LinearParameters) -> list[Gain]:
    """How a change of each level's mean moves the pooled (a0, b0, c0): H⁻¹ J' of each level, J' = (3, 2) of (r', r)."""
    hessian = np.zeros((3, 3))
    parts = []
    time_s, second, both, square = np.empty(0), np.empty(0), np.empty((2, 0)), np.empty((2, 2))
    for level in levels:
        if not np.array_equal(level.time_s, time_s):  # most levels have the same times
            time_s = level.time_s
            r, first, second = _rise(p.a0, time_s)
            both = np.stack([first, r])
            square = both @ both.T
        size = p.b0 * level.level + p.c0
        take = np.array([[size, 0.0], [0.0, level.level], [0.0, 1.0]])
        left = level.mean - size * both[1]
        curved = np.zeros((3, 3))
        curved[0, 0] = size * (left @ second)
        curved[0, 1] = curved[1, 0] = level.level * (left @ both[0])
        curved[0, 2] = curved[2, 0] = left @ both[0]
        hessian += take @ square @ take.T - curved
        parts.append((take, both))
    inverse = scaled_inverse(hessian, UNSEEN)
    return [(inverse @ take, both) for take, both in parts]


def level_gain(level: Level, a0: float, gain: float) -> Array:
    """How a change of a level's mean moves its own (log a0, log gain, log B), B = u/(a0 gain), shape (3, n)."""
    jacobian, hessian = level_terms(level, a0, gain)
    return np.asarray(TO_LOG_B @ scaled_inverse(hessian, UNSEEN) @ jacobian.T)


def level_terms(level: Level, a0: float, gain: float) -> tuple[Array, Array]:
    """∂f/∂(log a0, log gain) of gain · (1 − e^(−a0 t)), shape (n, 2), and the full Hessian of half the cost (2, 2)."""
    rise = -np.expm1(-a0 * level.time_s)
    decay = 1.0 - rise
    slope = gain * a0 * level.time_s * decay
    jacobian = np.stack([slope, gain * rise], axis=1)
    left = level.mean - gain * rise
    curved = np.array([[left @ (slope * (1 - a0 * level.time_s)), left @ slope], [left @ slope, left @ (gain * rise)]])
    return jacobian, np.asarray(jacobian.T @ jacobian - curved)


def level_run_statistics(level: Level, a0: float, gain: float, noise_nm: Array) -> RunStatistics:
    """Statistics of the runs for (log a0, log gain, log B) of one level's own fit, gain [N·m] · (1 − e^(−a0 t))."""
    jacobian, hessian = level_terms(level, a0, gain)
    theta = np.log([a0, gain])
    one = run_statistics(
        level.level, level.time_s, level.runs, jacobian, theta,
        noise_nm=noise_nm, mean_nm=level.mean, hessian=hessian,
    )  # fmt: skip
    return replace(
        one,
        log_theta=np.append(theta, np.log(level.level) - theta.sum()),
        influence=one.influence @ TO_LOG_B.T,
        # both parts of B come from the same samples: their within-run errors are taken as additive, the wider reading
        within=np.append(one.within, np.sqrt(one.within).sum() ** 2),
    )


def spreads(gains: Sequence[Gain], stats: LevelStatistics) -> list[tuple[float, float]]:
    """Variance and degrees of freedom of m numbers q with δq = Σ_l g_l δȳ_l, g_l of shape (m, n_l)."""
    runs, singles = [np.zeros((0, len(gains[0][0])))], [np.zeros((0, len(gains[0][0])))]
    for level, estimate, variance, (take, along) in zip(
        stats.levels, stats.estimates, stats.variance, gains, strict=True
    ):
        if stats.source == "repeats" and len(level.runs) > 1:
            runs.append((level.runs @ along.T - level.mean @ along.T) @ take.T / len(level.runs))
        elif stats.source != "repeats":
            moved = take @ (along @ log_jacobian(estimate.curve, level.time_s)[:, :3])
            singles.append((moved * np.sqrt(np.where(np.isfinite(variance[:3]), variance[:3], 0.0))).T)
    repeats = np.array([len(psi) for psi in runs[1:]], dtype=np.int64)
    found = Influence(np.concatenate(runs), repeats, np.concatenate(singles), stats.total_degrees, stats.swept)
    return list(zip(*(one.tolist() for one in found.variance()), strict=True))


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
