"""Intervals of the linear model: pooled a0, b0, c0, the levels' own a0, gain and B, and the bounds B_m, B_M.

Every number here answers linearly to small changes of the levels' means, δq = Σ_l g_l δȳ_l. With repeats the runs
themselves say how the means scatter; with one run a level the scatter of (T_s, τ1, τ2) is carried through the curve.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from eaid.arrays import Array
from eaid.fitting.result import Bounds, LinearFit, LinearLevel, PooledLinear
from eaid.models import linear as model
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

Interval = list[float]


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


def pooled_intervals(fit: LinearFit | PooledLinear, stats: LevelStatistics) -> dict[str, Interval]:
    """95 % intervals of the pooled a0, b0, c0."""
    gains = pooled_gain(stats.levels, fit.parameters, None if fit.weights is None else np.array(fit.weights))
    return {
        name: around(getattr(fit.parameters, name), np.sqrt(variance), degrees)
        for name, (variance, degrees) in zip(("a0", "b0", "c0"), spreads(gains, stats), strict=True)
    }


def around(value: float, sd: float, degrees: float) -> Interval:
    """value ± t sd."""
    reach = t_quantile(degrees) * float(sd)
    return [value - reach, value + reach]


def level_intervals(fit: LinearFit, stats: LevelStatistics) -> list[dict[str, Interval | None]]:
    """95 % intervals of a0, gain and B of every level, B under the fit's convention."""
    zero = fit.bounds.convention == "zero-offset"
    if not zero or stats.source != "repeats":
        own = [own_gain(level, row.a0, row.gain) for level, row in zip(stats.levels, fit.per_level, strict=True)]
        if not zero:
            return _with_pooled_terms(fit, stats, own)
        rows = []
        for i, row in enumerate(fit.per_level):
            takes = {"a0": own[i][0], "gain": own[i][1], "B": -own[i].sum(axis=0)}
            rows.append(
                {name: _log(_value(row, name), *spread(_only(i, g, stats), stats)) for name, g in takes.items()}
            )
        return rows
    linear_runs = with_log_B(
        [
            level_run_statistics(level, row.a0, row.gain, one.noise_nm)
            for level, row, one in zip(stats.levels, fit.per_level, stats.estimates, strict=True)
        ]
    )
    scatter = pooled_scatter(linear_runs)
    return [
        {
            name: _log(_value(row, name), float(scatter.variance[i, k]), float(scatter.degrees[i, k]))
            for k, name in enumerate(("a0", "gain", "B"))
        }
        for i, row in enumerate(fit.per_level)
    ]


def _with_pooled_terms(
    fit: LinearFit, stats: LevelStatistics, own: Sequence[Array]
) -> list[dict[str, Interval | None]]:
    """The conventions that take c0, or a0 and c0, from the pooled fit: b0 = (a0 gain − c0)/u."""
    pooled = [take @ along for take, along in pooled_gain(stats.levels, fit.parameters)]
    rows: list[dict[str, Interval | None]] = []
    for i, (level, row) in enumerate(zip(stats.levels, fit.per_level, strict=True)):
        gains = [-g[2] / row.level for g in pooled]
        if fit.bounds.convention == "pooled-offset":
            gains[i] = gains[i] + row.a0 * row.gain * own[i].sum(axis=0) / row.level
            a0, gain = ([own[i][k] if j == i else np.zeros_like(g) for j, g in enumerate(gains)] for k in (0, 1))
            found = {"a0": _log(row.a0, *spread(a0, stats)), "gain": _log(row.gain, *spread(gain, stats))}
        else:
            along, slope = _gain_at(level, row.a0)
            moved = (row.gain + row.a0 * slope) / row.level
            gains = [g + moved * p[0] for g, p in zip(gains, pooled, strict=True)]
            gains[i] = gains[i] + row.a0 * along / row.level
            steady = [slope * p[0] for p in pooled]
            steady[i] = steady[i] + along
            variance, degrees = spread([p[0] for p in pooled], stats)
            found = {
                "a0": around(row.a0, np.sqrt(variance), degrees),
                "gain": around(row.gain, *_sd(spread(steady, stats))),
            }
        variance, degrees = spread(gains, stats)
        found["B"] = _inverse(around(row.b0, np.sqrt(variance), degrees))
        rows.append(found)
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


def _only(i: int, g: Array, stats: LevelStatistics) -> list[Array]:
    return [g if j == i else np.zeros(len(level.time_s)) for j, level in enumerate(stats.levels)]


def _value(row: LinearLevel, name: str) -> float | None:
    return {"a0": row.a0, "gain": row.gain, "B": row.B}[name]


def _log(value: float | None, variance: float, degrees: float) -> Interval | None:
    """value · exp(±t √V); None for a B that does not exist, or where the interval has no end."""
    if value is None or value <= 0:
        return None
    reach = t_quantile(degrees) * float(np.sqrt(variance))
    if not reach < 50:
        return None
    return [value * float(np.exp(-reach)), value * float(np.exp(reach))]


def _inverse(b0: Interval) -> Interval | None:
    """The interval of B = 1/b0; None where b0 may be zero."""
    return [1 / b0[1], 1 / b0[0]] if b0[0] > 0 else None


def bound_intervals(bounds: Bounds, per_level: Sequence[tuple[float, Interval | None]]) -> dict[str, Interval | None]:
    """95 % intervals of B_m and B_M, the least and largest B over the kept levels; None where some B is unbounded."""
    kept = [interval for level, interval in per_level if level in bounds.levels]
    known = [interval for interval in kept if interval is not None]
    if not known or len(known) < len(kept):
        return {"B_m": None, "B_M": None}
    low, high = np.array(known).T
    return {"B_m": [float(low.min()), float(high.min())], "B_M": [float(low.max()), float(high.max())]}


def white(fit: LinearFit, levels: Sequence[Level]) -> dict[str, Any]:
    """Textbook standard deviations and intervals, s² (J'J)⁻¹ on the means: of the pooled fit and of each level's own.

    `pooled` has ci95 and sd of a0, b0, c0; `per_level` of a0, gain and B (zero-offset).
    """
    M, cost, samples = np.zeros((3, 3)), 0.0, 0
    for level in levels:
        jacobian = model.gradient(fit.parameters, level.time_s, level.level)
        left = level.mean - model.step_response(fit.parameters, level.time_s, level.level)
        M += jacobian @ jacobian.T
        cost, samples = cost + float(left @ left), samples + len(left)
    terms = 3 if len(levels) > 1 else 2
    sd = np.sqrt(np.maximum(np.diag(scaled_inverse(M)) * cost / (samples - terms), 0))
    named = dict(zip(("a0", "b0", "c0"), sd.tolist(), strict=True))
    pooled = {name: around(getattr(fit.parameters, name), s, samples - terms) for name, s in named.items()}
    rows = []
    for level, row in zip(levels, fit.per_level, strict=True):
        decay = np.exp(-row.a0 * level.time_s)
        J = np.stack([row.gain * level.time_s * decay, -np.expm1(-row.a0 * level.time_s)], axis=1)
        left = level.mean - row.gain * J[:, 1]
        spare = len(left) - 2
        covariance = scaled_inverse(J.T @ J) * float(left @ left) / spare
        own = {"a0": float(np.sqrt(covariance[0, 0])), "gain": float(np.sqrt(covariance[1, 1]))}
        ci: dict[str, Interval | None] = {name: around(getattr(row, name), s, spare) for name, s in own.items()}
        if row.B is None:
            ci["B"] = None
        else:
            g = np.array([-1 / row.a0, -1 / row.gain])
            own["B"] = row.B * float(np.sqrt(g @ covariance @ g))
            ci["B"] = around(row.B, own["B"], spare)
        rows.append({"ci95": ci, "sd": own})
    return {"pooled": {"ci95": pooled, "sd": named}, "per_level": rows}


def from_draws(
    fit: LinearFit, pooled: Array | None, own: Array | None, stats: LevelStatistics
) -> tuple[dict[str, Interval], list[dict[str, Interval | None]]]:
    """The same intervals from the spread of refits: covariance of (a0, b0, c0), variance of the levels' logs (L, 3).

    B of the levels is that of zero-offset; the other conventions keep the linear way for B.
    """
    assert pooled is not None and own is not None
    sd = np.sqrt(np.diag(pooled))
    names = ("a0", "b0", "c0")[: 3 if len(stats.levels) > 1 else 2]
    degrees = stats.total_degrees
    gains = pooled_gain(stats.levels, fit.parameters)
    found = {
        name: around(getattr(fit.parameters, name), float(sd[k]), own_degrees)
        for k, (name, (_, own_degrees)) in enumerate(zip(names, spreads(gains, stats), strict=False))
    }
    rows = level_intervals(fit, stats)
    if fit.bounds.convention != "zero-offset":
        return found, rows
    mean = own.mean(axis=0) if stats.source == "repeats" else None
    for i, row in enumerate(fit.per_level):
        for k, name in enumerate(("a0", "gain", "B")):
            # a level's own few draws count as much as its runs; what all levels share counts for the rest
            variance = float(own[i, k] if mean is None else 0.25 * own[i, k] + 0.75 * mean[k])
            rows[i][name] = _log(_value(row, name), variance, degrees)
    return found, rows
