"""Run-to-run scatter pooled over levels (Paule–Mandel), and the variance of each level's parameters.

With repeats: a ≥ 0 from Σ_l (R − 1) v_l / (a + h_l) = Σ_l (R − 1); if the sum is already below at a = 0, then a = 0 and
q = sum / Σ(R − 1), else q = 1. One scatter for all levels would give the mean of R runs V = q (a + h_l) / R. Scatter
may change from level to level, so V is multiplied by what the runs of the level and its neighbours show of it.
With one run a level: a from Σ_l res_l² / (a + h_l) = L − p of a curve through the levels.
Repeats recorded as sweeps have a gain of that day in common: levels then move together, and Σ(R − 1) counts far too
many independent runs. The common part m_r, the mean over the levels, is known from R sweeps only: R − 1 degrees.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtrc

from eaid.arrays import Array, median
from eaid.uncertainty.run_statistics import RunStatistics
from eaid.uncertainty.student_t import VarianceComponents, satterthwaite

Mask: TypeAlias = NDArray[np.bool_]

NEIGHBOURS = 4.5
"""Degrees of freedom that a level's scatter takes from its neighbourhood: itself and both neighbours where R = 3."""
SMOOTH_LEVELS, SMOOTH_TERMS = 5, 4
"""From so many levels on the within-run variance is a smooth function of the level, log h a polynomial of four terms:
a τ2 that came out low by chance must not look well determined as well."""
CHANCE = 0.01
"""Probability at which scatter that is alike over the levels would be told to change, and independent repeats be taken
for sweeps."""
SWEPT_LEVELS = 3
"""Levels at least that show sweeps."""


@dataclass(frozen=True, eq=False)
class Jump:
    """Where along the levels the scatter changes."""

    place: int
    """The last level on the lower side."""
    ratio: float
    """How many times larger the scatter (sd) is on the lower side."""


@dataclass(frozen=True, eq=False)
class PooledScatter:
    """Variance of the levels' parameters, with the degrees of freedom that their intervals take."""

    between: Array
    """a: variance between runs beyond what one run shows within itself, shape (k,)."""
    variance: Array
    """V of each level's log θ, shape (L, k)."""
    degrees: Array
    """Degrees of freedom of V, shape (L, k)."""
    pooled: Array
    """V of each level's log θ as one scatter for all levels gives it, shape (L, k)."""
    total_degrees: float
    """Σ(R − 1) over the levels, or L − p with one run a level."""
    own: Array
    """V without what all levels of a sweep have in common, shape (L, k)."""
    components: tuple[VarianceComponents, ...]
    """What `own` is made of, one a parameter."""
    common: Array
    """Variance that all levels share because repeats were sweeps, shape (k,); 0 where they were not."""
    common_degrees: float
    """R − 1, the degrees of freedom of `common`."""
    jumps: tuple[Jump | None, ...]
    """Where the scatter changes by more than chance, one a parameter."""


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


def pooled_scatter(levels: Sequence[RunStatistics], usable: Mask | None = None) -> PooledScatter:
    """Scatter of levels with repeats; levels of a single run borrow it. Needs one level with R ≥ 2.

    Where `usable`, shape (L, k), is false, a parameter has no say in the pool (a constraint holds it there) and borrows
    from it. Where repeats were recorded as sweeps, what a sweep's levels have in common is taken out first and added to
    V at the end.
    """
    repeats = np.array([level.repeats for level in levels], dtype=float)
    v = np.array([np.nan_to_num(level.scatter) for level in levels])
    h = np.array([np.maximum(level.within, 1e-300) for level in levels])
    x = np.array([level.level for level in levels])
    counted = np.ones(v.shape, dtype=bool) if usable is None else usable
    count = v.shape[1]
    between, common = np.zeros(count), np.zeros(count)
    pooled, variance, degrees = np.zeros_like(v), np.zeros_like(v), np.zeros_like(v)
    components: list[VarianceComponents] = []
    jumps: list[Jump | None] = []
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
            components.append(VarianceComponents(np.full(len(levels), np.inf), np.eye(len(levels)), own))
            jumps.append(None)
            continue
        within = smoothed(h[:, k], x, own > 0)
        between[k], q = paule_mandel(_total(own * v[:, k], within), total, float(v[own > 0, k].max()))
        pooled[:, k] = q * (between[k] + within) / repeats
        relative = v[:, k] / np.maximum(repeats * pooled[:, k], 1e-300)
        mixed = neighbours(own)
        components.append(VarianceComponents(pooled[:, k], mixed, own))
        variance[:, k] = pooled[:, k] * (mixed @ relative)
        degrees[:, k] = components[k].degrees(np.eye(len(levels)))
        jumps.append(jump(relative, own))
    most = float(repeats.max() - 1)
    with np.errstate(divide="ignore", invalid="ignore"):
        together = satterthwaite((variance, common), (degrees, most))
    return PooledScatter(
        between=between,
        variance=variance + common,
        degrees=np.where(common > 0, together, degrees),
        pooled=pooled,
        total_degrees=float((repeats - 1).sum()),
        own=variance,
        components=tuple(components),
        common=common,
        common_degrees=most,
        jumps=tuple(jumps),
    )


def common_shifts(levels: Sequence[RunStatistics], k: int) -> Array | None:
    """m_r, what every level's run r has in common in parameter k, shape (R,); None where repeats are independent.

    Runs are matched by their place: the first run of each level was one sweep, and so on. A two-way analysis of
    variance of the runs' influences (levels × repeats): F = L Σ m_r²/(R − 1) against what is left.
    """
    counts = {level.repeats for level in levels}
    if len(levels) < SWEPT_LEVELS or len(counts) != 1 or counts == {1}:
        return None
    d = np.array([level.influence[:, k] for level in levels])
    if not np.isfinite(d).all():
        return None
    count, repeats = d.shape
    mean = d.mean(axis=0)
    together = count * float(mean @ mean) / (repeats - 1)
    apart = float(((d - mean) ** 2).sum()) / ((count - 1) * (repeats - 1))
    if apart == 0:
        return None
    chance = fdtrc(repeats - 1, (count - 1) * (repeats - 1), together / apart)
    return mean if chance < CHANCE else None


def _total(weighted: Array, within: Array) -> Callable[[float], float]:
    return lambda a: float((weighted / (a + within)).sum())


def smoothed(within: Array, x: Array, counted: Mask) -> Array:
    """h as a smooth function of the level where enough levels count; else as it is; shape (L,)."""
    size = int(counted.sum())
    if size < SMOOTH_LEVELS or np.ptp(x[counted]) == 0:
        return within
    design = np.vander((x - x.mean()) / np.ptp(x), min(SMOOTH_TERMS, size - 3), increasing=True)
    coefficients = np.linalg.lstsq(design[counted], np.log(within[counted]), rcond=None)[0]
    return np.where(counted, np.exp(np.clip(design @ coefficients, -690, 690)), within)


def neighbours(own: Array) -> Array:
    """How much each level's runs, of `own` degrees of freedom, count for each level's scatter: rows of sum 1, (L, L).

    The narrowest triangle about a level that gives half of the levels `NEIGHBOURS` degrees of freedom.
    """
    apart = np.abs(np.subtract.outer(np.arange(len(own)), np.arange(len(own))))
    for width in range(2 * len(own)):
        weight = np.maximum(1 - apart / (width + 1), 0) * own
        total = weight.sum(axis=1)
        square = (weight**2 / np.where(own > 0, own, 1)).sum(axis=1)
        if (total > 0).all() and median(total**2 / square) >= NEIGHBOURS:
            break
    weight[total == 0], total[total == 0] = own, own.sum()
    return np.asarray(weight / total[:, None])


def jump(relative: Array, own: Array) -> Jump | None:
    """Where the scatter of the levels on one side differs most from the other side's, if by more than chance (F)."""
    below, squares = np.cumsum(own)[:-1], np.cumsum(own * relative)[:-1]
    above, others = own.sum() - below, (own * relative).sum() - squares
    fine = (below > 0) & (above > 0) & (squares > 0) & (others > 0)
    if not fine.any():
        return None
    below, squares, above, others = below[fine], squares[fine], above[fine], others[fine]
    F = squares / below / (others / above)
    chance = 2 * np.minimum(fdtrc(below, above, F), fdtrc(above, below, 1 / F)) * len(F)
    i = int(chance.argmin())
    return Jump(int(np.flatnonzero(fine)[i]), float(np.sqrt(F[i]))) if chance[i] < CHANCE else None
