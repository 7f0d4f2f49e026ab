"""Intervals of the linear model: pooled a0, b0, c0, the levels' own a0, gain and B, and the bounds B_m, B_M.

Every number here answers linearly to small changes of the levels' means, δq = Σ_l g_l δȳ_l. With repeats the runs
themselves say how the means scatter; with one run a level the scatter of (T_s, τ1, τ2) is carried through the curve.
"""

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np

from eaid.arrays import Array
from eaid.models import linear as model
from eaid.results.common import Interval
from eaid.results.linear import BoundsIntervals, Linear, LinearLevel, LinearLevelIntervals, Pooled, PooledIntervals
from eaid.steps.stepset import Level
from eaid.uncertainty.level_statistics import LevelStatistics
from eaid.uncertainty.levels import log_jacobian
from eaid.uncertainty.linear_influence import (
    Gain,
    combined_variance,
    level_run_statistics,
    own_gain,
    pooled_gain,
    scaled_inverse,
    with_log_B,
)
from eaid.uncertainty.scatter import pooled_scatter
from eaid.uncertainty.student_t import t_quantile
from eaid.uncertainty.weightings import weights_array

Ends: TypeAlias = tuple[float, float]


def spread(gains: Sequence[Array], stats: LevelStatistics) -> tuple[float, float]:
    """Variance and degrees of freedom of q with δq = Σ_l g_l δȳ_l, g_l of shape (n_l,)."""
    return spreads([(np.ones((1, 1)), g[None]) for g in gains], stats)[0]


def spreads(gains: Sequence[Gain], stats: LevelStatistics) -> list[tuple[float, float]]:
    """The same of m numbers at once."""
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
    for level, one, (take, along), variance in zip(stats.levels, stats.estimates, gains, stats.variance, strict=True):
        moved = take @ (along @ log_jacobian(one.curve, level.time_s))
        total += moved**2 @ np.where(np.isfinite(variance[:3]), variance[:3], 0.0)
    return [(float(variance), stats.total_degrees) for variance in total]


def pooled_intervals(fit: Pooled, stats: LevelStatistics) -> PooledIntervals:
    """95 % intervals of the pooled a0, b0, c0; one level leaves c0 to b0."""
    gains = pooled_gain(stats.levels, fit.parameters, weights_array(fit))
    ends = [
        around(getattr(fit, name), np.sqrt(variance), degrees)
        for name, (variance, degrees) in zip(("a0", "b0", "c0"), spreads(gains, stats), strict=True)
    ]
    return PooledIntervals(ends[0], ends[1], ends[2] if len(stats.levels) > 1 else None)


def around(value: float, sd: float, degrees: float) -> Ends:
    """value ± t sd."""
    reach = t_quantile(degrees) * float(sd)
    return value - reach, value + reach


def level_intervals(fit: Linear, stats: LevelStatistics) -> list[LinearLevelIntervals]:
    """95 % intervals of a0, gain and B of every level, B under the fit's convention."""
    zero = convention(fit) == "zero-offset"
    if not zero or stats.source != "repeats":
        own = [own_gain(level, row.a0, row.gain) for level, row in zip(stats.levels, fit.per_level, strict=True)]
        if not zero:
            return _with_pooled_terms(fit, stats, own)
        rows = []
        for i, row in enumerate(fit.per_level):
            variance = _own_variance(i, np.vstack([own[i], -own[i].sum(axis=0)]), stats).tolist()
            names = ("a0", "gain", "B")
            ends = [_log(_value(row, k), v, stats.total_degrees) for k, v in zip(names, variance, strict=True)]
            rows.append(LinearLevelIntervals(*ends))
        return rows
    linear_runs = with_log_B(
        [
            level_run_statistics(level, row.a0, row.gain, one.noise_nm)
            for level, row, one in zip(stats.levels, fit.per_level, stats.estimates, strict=True)
        ]
    )
    scatter = pooled_scatter(linear_runs)
    return [
        LinearLevelIntervals(
            *(
                _log(_value(row, name), float(scatter.variance[i, k]), float(scatter.degrees[i, k]))
                for k, name in enumerate(("a0", "gain", "B"))
            )
        )
        for i, row in enumerate(fit.per_level)
    ]


def _with_pooled_terms(fit: Linear, stats: LevelStatistics, own: Sequence[Array]) -> list[LinearLevelIntervals]:
    """The conventions that take c0, or a0 and c0, from the pooled fit: b0 = (a0 gain − c0)/u."""
    pooled = [take @ along for take, along in pooled_gain(stats.levels, fit.parameters)]
    rows: list[LinearLevelIntervals] = []
    for i, (level, row) in enumerate(zip(stats.levels, fit.per_level, strict=True)):
        gains = [-g[2] / row.level for g in pooled]
        if convention(fit) == "pooled-offset":
            gains[i] = gains[i] + row.a0 * row.gain * own[i].sum(axis=0) / row.level
            a0, gain = ([own[i][k] if j == i else np.zeros_like(g) for j, g in enumerate(gains)] for k in (0, 1))
            ends = _log(row.a0, *spread(a0, stats)), _log(row.gain, *spread(gain, stats))
        else:
            along, slope = _gain_at(level, row.a0)
            moved = (row.gain + row.a0 * slope) / row.level
            gains = [g + moved * p[0] for g, p in zip(gains, pooled, strict=True)]
            gains[i] = gains[i] + row.a0 * along / row.level
            steady = [slope * p[0] for p in pooled]
            steady[i] = steady[i] + along
            variance, degrees = spread([p[0] for p in pooled], stats)
            ends = around(row.a0, np.sqrt(variance), degrees), around(row.gain, *_sd(spread(steady, stats)))
        variance, degrees = spread(gains, stats)
        rows.append(LinearLevelIntervals(*ends, _inverse(around(row.b0 or 0.0, np.sqrt(variance), degrees))))
    return rows


def _sd(spread_of: tuple[float, float]) -> tuple[float, float]:
    return float(np.sqrt(spread_of[0])), spread_of[1]


def _gain_at(level: Level, a0: float) -> tuple[Array, float]:
    """∂gain/∂ȳ at a held a0, shape (n,), and ∂gain/∂a0."""

    def gain(rate: float) -> float:
        rise = -np.expm1(-rate * level.time_s)
        return float(rise @ level.mean / (rise @ rise))

    rise = -np.expm1(-a0 * level.time_s)
    step = 1e-5 * a0
    return rise / (rise @ rise), (gain(a0 + step) - gain(a0 - step)) / (2 * step)


def _own_variance(i: int, gains: Array, stats: LevelStatistics) -> Array:
    """Variance of numbers that answer to the mean of single runs of level i alone, shape (m,) for gains (m, n)."""
    moved = gains @ log_jacobian(stats.estimates[i].curve, stats.levels[i].time_s)
    variance = stats.variance[i, :3]
    return np.asarray(moved**2 @ np.where(np.isfinite(variance), variance, 0.0))


def _value(row: LinearLevel, name: str) -> float | None:
    return {"a0": row.a0, "gain": row.gain, "B": row.B}[name]


def _log(value: float | None, variance: float, degrees: float) -> Interval:
    """value · exp(±t √V); None for a B that does not exist, or where the interval has no end."""
    if value is None or value <= 0:
        return None
    reach = t_quantile(degrees) * float(np.sqrt(variance))
    if not reach < 50:
        return None
    return value * float(np.exp(-reach)), value * float(np.exp(reach))


def _inverse(b0: Ends) -> Interval:
    """The interval of B = 1/b0; None where b0 may be zero."""
    return (1 / b0[1], 1 / b0[0]) if b0[0] > 0 else None


def convention(fit: Linear) -> str:
    """The convention for b0 of a single level."""
    return fit.bounds.convention if fit.bounds is not None else "zero-offset"


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
    """Textbook intervals, s² (J'J)⁻¹ on the means: of the pooled fit, and of each level (zero-offset)."""
    M, cost, samples = np.zeros((3, 3)), 0.0, 0
    for level in levels:
        jacobian = model.gradient(fit.parameters, level.time_s, level.level)
        left = level.mean - model.step_response(fit.parameters, level.time_s, level.level)
        M += jacobian @ jacobian.T
        cost, samples = cost + float(left @ left), samples + len(left)
    terms = 3 if len(levels) > 1 else 2
    sd = np.sqrt(np.maximum(np.diag(scaled_inverse(M)) * cost / (samples - terms), 0)).tolist()
    pooled = PooledIntervals(
        *(around(getattr(fit, k), s, samples - terms) for k, s in zip(("a0", "b0", "c0"), sd, strict=True))
    )
    rows = []
    for level, row in zip(levels, fit.per_level, strict=True):
        decay = np.exp(-row.a0 * level.time_s)
        J = np.stack([row.gain * level.time_s * decay, -np.expm1(-row.a0 * level.time_s)], axis=1)
        left = level.mean - row.gain * J[:, 1]
        spare = len(left) - 2
        covariance = scaled_inverse(J.T @ J) * float(left @ left) / spare
        a0_sd, gain_sd = np.sqrt(np.diag(covariance)).tolist()
        B = None
        if row.B is not None:
            g = np.array([-1 / row.a0, -1 / row.gain])
            B = around(row.B, row.B * float(np.sqrt(g @ covariance @ g)), spare)
        rows.append(LinearLevelIntervals(around(row.a0, a0_sd, spare), around(row.gain, gain_sd, spare), B))
    return pooled, rows


def from_draws(
    fit: Linear, pooled: Array | None, own: Array | None, stats: LevelStatistics
) -> tuple[PooledIntervals, list[LinearLevelIntervals]]:
    """The same intervals from the spread of refits: covariance of (a0, b0, c0), variance of the levels' logs (L, 3).

    B of the levels is that of zero-offset; the other conventions keep the linear way for B.
    """
    assert pooled is not None and own is not None
    sd = np.sqrt(np.diag(pooled)).tolist()
    gains = pooled_gain(stats.levels, fit.parameters)
    ends = [
        around(getattr(fit, name), s, degrees)
        for name, s, (_, degrees) in zip(("a0", "b0", "c0"), sd, spreads(gains, stats), strict=True)
    ]
    found = PooledIntervals(ends[0], ends[1], ends[2] if len(stats.levels) > 1 else None)
    rows = level_intervals(fit, stats)
    if convention(fit) != "zero-offset":
        return found, rows
    # a level's own few draws count as much as its runs; what all levels share counts for the rest
    variance = 0.25 * own + 0.75 * own.mean(axis=0) if stats.source == "repeats" else own
    return found, [
        LinearLevelIntervals(
            *(_log(_value(row, name), float(v[k]), stats.total_degrees) for k, name in enumerate(("a0", "gain", "B")))
        )
        for row, v in zip(fit.per_level, variance, strict=True)
    ]
