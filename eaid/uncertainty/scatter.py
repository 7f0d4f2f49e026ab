"""Run-to-run scatter pooled over levels (Paule–Mandel), and the variance of each level's parameters.

With repeats: a ≥ 0 from Σ_l (R − 1) v_l / (a + h_l) = Σ_l (R − 1); if the sum is already below at a = 0, then a = 0 and
q = sum / Σ(R − 1), else q = 1. The variance of the mean of R runs is V_l = q (a + h_l) / R.
With one run a level: a from Σ_l res_l² / (a + h_l) = L − p of a curve through the levels.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from eaid.arrays import Array
from eaid.uncertainty.evidence import Evidence
from eaid.uncertainty.sweeps import common_shifts

Mask: TypeAlias = NDArray[np.bool_]

TREND_LEVELS, TREND_DEGREES = 4, 8
"""Fewer levels or degrees of freedom than these cannot show that the scatter changes with the level."""

PRIOR = 5.0
"""Prior precision of the trend's slope: scatter that doubles over the range of the levels is one standard deviation."""


@dataclass(frozen=True, eq=False)
class Scatter:
    """Variance of the levels' parameters, with the degrees of freedom that their intervals take."""

    between: Array
    """a: variance between runs beyond what one run shows within itself, shape (k,)."""
    variance: Array
    """V of each level's log θ, shape (L, k)."""
    degrees: Array
    """Degrees of freedom of V, shape (L, k)."""
    pooled: Array
    """V of each level's log θ as one scatter for all levels gives it, shape (L, k); its degrees are Σ(R − 1)."""
    total_degrees: float
    """Σ(R − 1) over the levels, or L − p with one run a level."""
    own: Array
    """V without what all levels of a sweep have in common, shape (L, k)."""
    common: Array
    """Variance that all levels share because repeats were sweeps, shape (k,); 0 where they were not."""
    common_degrees: float
    """R − 1, the degrees of freedom of `common`."""
    ratio: Array
    """How many times larger the scatter (sd) is at the lowest level than at the highest, shape (k,)."""
    ratio_z: Array
    """That ratio's logarithm over its standard error, shape (k,): beyond ±2 the scatter is not alike."""


def paule_mandel(total: Callable[[float], float], wanted: float, scale: float) -> tuple[float, float]:
    """The a ≥ 0 at which the falling function `total` meets `wanted`, and q (1, or below it where a = 0)."""
    at_zero = total(0.0)
    if at_zero <= wanted:
        return 0.0, at_zero / wanted
    low, high = 0.0, max(scale, 1e-300)
    while total(high) > wanted:
        low, high = high, 4 * high
    for _ in range(80):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if total(middle) > wanted else (low, middle)
        if high - low <= 1e-12 * high:
            break
    return 0.5 * (low + high), 1.0


def pooled_scatter(levels: Sequence[Evidence], usable: Mask | None = None) -> Scatter:
    """Scatter of levels with repeats; levels of a single run borrow it. Needs one level with R ≥ 2.

    A level's V is the pooled one times e^(α + β x), x the level's own number: scatter that grows towards one end is
    followed, and V is worth fewer degrees of freedom the further x lies from the mean. Where `usable`,
    shape (L, k), is false, a parameter has no say in the pool (a constraint holds it there) and borrows from it. Where
    repeats were recorded as sweeps, what a sweep's levels have in common is taken out first and added to V at the end.
    """
    repeats = np.array([level.repeats for level in levels], dtype=float)
    v = np.array([np.nan_to_num(level.scatter) for level in levels])
    h = np.array([np.maximum(level.within, 1e-300) for level in levels])
    x = np.array([level.level for level in levels])
    counted = np.ones(v.shape, dtype=bool) if usable is None else usable
    count = v.shape[1]
    between, ratio, ratio_z = np.zeros(count), np.ones(count), np.zeros(count)
    pooled, variance, degrees = np.zeros_like(v), np.zeros_like(v), np.zeros_like(v)
    common = np.zeros(count)
    for k in range(count):
        own = (repeats - 1) * counted[:, k]
        shared = common_shifts(levels, k) if counted[:, k].all() else None
        if shared is not None:
            common[k] = shared @ shared / (len(shared) - 1) / len(shared)
            own = own * (len(levels) - 1) / len(levels)
            left = np.array([level.influence[:, k] for level in levels]) - shared
            v[:, k] = (left**2).sum(axis=1) / (len(shared) - 1) * len(levels) / (len(levels) - 1)
        total = float(own.sum())
        if total == 0:
            pooled[:, k] = variance[:, k] = np.inf
            continue
        between[k], q = paule_mandel(_total(own * v[:, k], h[:, k]), total, float(v[own > 0, k].max()))
        pooled[:, k] = q * (between[k] + h[:, k]) / repeats
        variance[:, k], degrees[:, k] = pooled[:, k], total
        centred = x - own @ x / total
        spread = float(own @ centred**2 / total)
        if np.count_nonzero(own) < TREND_LEVELS or total < TREND_DEGREES or spread == 0 or not v[own > 0, k].any():
            continue
        relative = v[:, k] / np.maximum(repeats * pooled[:, k], 1e-300)
        shape, worth, slope = _trend(relative, centred / np.sqrt(spread), own)
        variance[:, k] *= shape
        degrees[:, k] = worth
        ends = variance[[int(x.argmin()), int(x.argmax())], k] * repeats[[int(x.argmin()), int(x.argmax())]]
        ratio[k] = np.sqrt(ends[0] / ends[1])
        ratio_z[k] = -slope * np.sqrt(total / 2 + PRIOR)
    most = float(repeats.max() - 1)
    with np.errstate(divide="ignore", invalid="ignore"):
        together = (variance + common) ** 2 / (variance**2 / degrees + common**2 / most)
    return Scatter(
        between=between,
        variance=variance + common,
        degrees=np.where(common > 0, together, degrees),
        pooled=pooled,
        total_degrees=float((repeats - 1).sum()),
        own=variance,
        common=common,
        common_degrees=most,
        ratio=ratio,
        ratio_z=ratio_z,
    )


def _total(weighted: Array, within: Array) -> Callable[[float], float]:
    return lambda a: float((weighted / (a + within)).sum())


def _trend(relative: Array, x: Array, degrees: Array) -> tuple[Array, Array, float]:
    """e^(α + β x) through relative variances of χ²-like spread, its degrees of freedom, shapes (L,), and β.

    Fisher scoring with a prior of mean 0 on β: a few runs alike by luck at one end make no trend.
    """
    design = np.stack([np.ones_like(x), x], axis=1)
    prior = np.diag([0.0, 2 * PRIOR])
    weighted = design * degrees[:, None]
    spread = np.linalg.inv(design.T @ weighted + prior)
    coefficients = np.zeros(2)
    for _ in range(50):
        slope = weighted.T @ (relative * np.exp(-design @ coefficients) - 1) - prior @ coefficients
        step = np.clip(spread @ slope, -1.0, 1.0)
        coefficients = coefficients + step
        if np.abs(step).max() < 1e-10:
            break
    worth = 1 / np.einsum("ij,jk,ik->i", design, spread, design)
    return np.asarray(np.exp(design @ coefficients)), np.asarray(worth), float(coefficients[1])
