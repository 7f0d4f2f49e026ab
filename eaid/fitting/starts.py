"""Where the fits of single levels start: the best pairs of τ over a log grid, then a few damped Newton steps."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from eaid.arrays import Array
from eaid.fitting.compress import Points
from eaid.fitting.data import Data
from eaid.fitting.descent import Descent, descend
from eaid.fitting.kernel import by_log, log_products, weighted_shares
from eaid.models.parameters import TAU_FLOOR_S

Indices: TypeAlias = NDArray[np.intp]
RECORDS = 1e6
"""τ2 is looked for up to this many record lengths: no data can tell it from endless."""
GRID = 48
"""Time constants on the starting grid."""
BOWLS = 3
"""Minima over the grid that a level starts from, at most."""
STEPS = 8
"""Damped Newton steps from each start, at most."""
ENOUGH = 1e-7
"""They end where another predicts less than this part of the cost on the points."""


@dataclass(frozen=True, eq=False)
class Starts:
    """Curves that single levels may start from, N in all."""

    end: Descent
    """In (T_s, ln τ1, ln τ2)."""
    share: float
    """C of all."""
    level: Indices
    """Index of the level of each, (N,), rising."""

    @property
    def theta(self) -> Array:
        """(T_s, τ1, τ2, C) of each, (4, N)."""
        return theta_at(self.end.x, self.share)


def starting_curves(data: Data, share: float, most: int = BOWLS, enough: float = ENOUGH) -> Starts:
    """Every level from its `most` best minima over a log grid of pairs of τ, then a few damped Newton steps."""
    points = data.points
    if len(points.t_s) == 1 and len(points.w) == 1:
        table = _shared_table(points.t_s.tobytes(), points.w.tobytes(), share)
    else:
        table = _table(points.t_s, points.w, share)
    along = np.zeros((len(points.y), len(table.grid) + 2))
    along[:, 1:-1] = grid_along(points.y, table.weighted)
    gain = grid_inner(along, share)
    gain *= gain
    gain *= table.inverse_square
    level, first, second = _bowls(gain, most)
    grid, one = table.grid, 0 if len(table.inverse_square) == 1 else level
    steady = share * along[level, 1 + first] + (1 - share) * along[level, 1 + second]
    steady = np.maximum(steady, 0.0) * table.inverse_square[one, 1 + first, 1 + second]
    theta = np.stack([steady, grid[first], grid[second], np.full_like(steady, share)])
    if len(level) > len(points.y):
        points = points.rows(level)
    return Starts(refine(theta, points, RECORDS * data.longest_s, enough=enough), share, level)


@dataclass(frozen=True, eq=False)
class _Table:
    """The starting grid of K time constants, and what its pairs need of the times of L levels."""

    grid: Array
    weighted: Array
    """Weighted 1 − e^(−t/τ), (L or 1, K, P)."""
    inverse_square: Array
    """1/φ'φ of pairs i < j and 0 of the others, in a frame of zeros, (L or 1, K + 2, K + 2)."""


def start_grid(t_s: Array, count: int = GRID) -> Array:
    """Time constants to start from [s], rising: a log grid of none below 1 ms, two at least, however short a record."""
    rising = t_s[t_s > 0]
    grid = np.geomspace(0.5 * float(rising.min()), 3.0 * float(rising.max()), count)
    grid = np.unique(np.maximum(grid, 1.01 * TAU_FLOOR_S))
    return grid if len(grid) > 1 else grid * np.array([1.0, 3.0])


def _table(t_s: Array, w: Array, share: float) -> _Table:
    grid = start_grid(t_s[w > 0])
    weighted, square = grid_table(t_s, w, grid, share)
    return _Table(grid, weighted, _framed(np.ones_like(square), square))


@lru_cache(maxsize=8)
def _shared_table(t_s: bytes, w: bytes, share: float) -> _Table:
    """The same for levels that share their times: so do the fits of a set under other weights, and its resamples."""
    return _table(np.frombuffer(t_s)[None], np.frombuffer(w)[None], share)


def _framed(gain: Array, square: Array) -> Array:
    """gain/square of pairs i < j, 0 elsewhere and in a frame around, (L, K + 2, K + 2)."""
    levels, count = gain.shape[:2]
    framed = np.zeros((levels, count + 2, count + 2))
    apart = np.arange(count) > np.arange(count)[:, None]
    np.divide(gain, square, out=framed[:, 1:-1, 1:-1], where=apart)
    return framed


def grid_bowls(inner: Array, square: Array, most: int) -> tuple[Indices, Indices, Indices]:
    """Level, i, j of the pairs i < j whose cost no neighbour undercuts, at most `most` a level, by level and cost.

    The cost falls by inner²/square; neighbours are the eight around a pair, those with i ≥ j left out.
    """
    return _bowls(_framed(inner * inner, square), most)


def _bowls(gain: Array, most: int) -> tuple[Indices, Indices, Indices]:
    """`grid_bowls` for what the cost falls by, in a frame of zeros, (L, K + 2, K + 2)."""
    levels, wide = gain.shape[:2]
    if most == 1:
        best = gain.reshape(levels, -1).argmax(axis=1)
        best[best == 0] = wide + 2  # nothing gains: the first pair
        first, second = np.divmod(best, wide)
        return np.arange(levels), first - 1, second - 1
    inner, places = gain[:, 1:-1, 1:-1], np.arange(1, wide - 1)
    beside = [gain[:, a : a + wide - 2, b : b + wide - 2] for a in range(3) for b in range(3)]
    peak = (inner >= np.maximum.reduce(beside)) & (places > places[:, None])
    level, first, second = np.nonzero(peak)
    order = np.lexsort((-inner[peak], level))
    rank = np.arange(len(order)) - np.searchsorted(level, level)
    order = order[rank < most]
    return level[order], first[order], second[order]


def refine(theta: Array, points: Points, limit: float, steps: int = STEPS, enough: float = ENOUGH) -> Descent:
    """Damped steps in (T_s, ln τ1, ln τ2) on every row of points at once, from θ of shape (4, N) with one C.

    τ stays within 1 ms and `limit` [s]; ln τ moves by 2 at most.
    """
    share = theta[3, 0]
    shares = weighted_shares(theta[3, :1], points)

    def look(x: Array) -> tuple[Array, Array, Array]:
        theta = theta_at(x, share)
        cost, gradient, curvature = by_log(theta, log_products(theta, shares, points))
        return cost, gradient.T, curvature

    return descend(look, np.stack([theta[0], *np.log(theta[1:3])], axis=1), steps, enough, within(limit))


def theta_at(x: Array, share: Array | float) -> Array:
    """θ (4, N) at x = (T_s, ln τ1, ln τ2), (N, 3)."""
    theta = np.empty((4, len(x)))
    theta[0], theta[3] = x[:, 0], share
    np.exp(x[:, 1:].T, out=theta[1:3])
    return theta


def tau_limits(limit: float) -> tuple[Array, Array, tuple[str, ...]]:
    """A, b and the codes of A x ≥ b for x = (ln τ1, ln τ2): τ1 ≥ 1 ms, τ2 ≥ τ1, τ2 ≤ `limit` [s]."""
    A = np.array([[1.0, 0.0], [-1.0, 1.0], [0.0, -1.0]])
    return A, np.array([np.log(TAU_FLOOR_S), 0.0, -np.log(limit)]), ("tau1-floor", "tau2-meets-tau1", "tau2-endless")


def within(limit: float) -> Callable[[Array, Array], Array]:
    """x less a step in (T_s, ln τ1, ln τ2), (N, 3); T_s stays above 0, τ within 1 ms and `limit` [s], τ2 above τ1."""
    least, most = np.log(TAU_FLOOR_S), np.log(limit)

    def moved(x: Array, step: Array) -> Array:
        tried = x - step
        tried[:, 0] = np.maximum(tried[:, 0], 0.0)
        away = np.minimum(np.maximum(step[:, 1:], -2.0), 2.0)
        tried[:, 1:] = np.minimum(np.maximum(x[:, 1:] - away, least), most)
        tried[:, 2] = np.maximum(tried[:, 2], tried[:, 1])
        return tried

    return moved


def grid_fits(
    t_s: Array, y: Array, weights: Array, grid: Array, share: float, offset: bool = False
) -> tuple[Array, Array]:
    """φ'y ≥ 0, (L, K, K), and φ'φ, (L or 1, K, K), for τ1 = grid[i] and τ2 = grid[j]; `t_s`, `y`, `weights` (L, n).

    T_s = φ'y/φ'φ is the best amplitude, and the cost falls by (φ'y)²/φ'φ.
    """
    weighted, square = grid_table(t_s, weights, grid, share, offset)
    return grid_inner(grid_along(y, weighted), share), square


def grid_table(t_s: Array, weights: Array, grid: Array, share: float, offset: bool = False) -> tuple[Array, Array]:
    """What pairs of time constants need of the times alone: weighted 1 − e^(−t/τ), (L or 1, K, n), and φ'φ, (…, K, K).

    All pairs follow from the products of the single ones. With `offset` those are orthogonal to a constant.
    """
    shapes = -np.expm1(-t_s[:, None, :] / grid[:, None])
    if offset:
        whole = weights.sum(axis=1)
        shapes = shapes - ((shapes * weights[:, None, :]).sum(axis=2) / whole[:, None])[:, :, None]
    weighted = shapes * weights[:, None, :]
    gram = weighted @ np.swapaxes(shapes, 1, 2)
    c, d = share, 1 - share
    squares = np.diagonal(gram, axis1=1, axis2=2)
    return weighted, (c * c * squares)[:, :, None] + (d * d * squares)[:, None, :] + (2 * c * d) * gram


def grid_along(y: Array, weighted: Array) -> Array:
    """Products of the data with the weighted shapes of `grid_table`, (L, K)."""
    if len(weighted) == 1:
        return np.asarray(y @ weighted[0].T)
    return np.asarray((weighted @ y[:, :, None])[:, :, 0])


def grid_inner(along: Array, share: float) -> Array:
    """φ'y of every pair, 0 where it is negative, (L, K, K)."""
    inner = (share * along)[:, :, None] + ((1 - share) * along)[:, None, :]
    return np.maximum(inner, 0.0, out=inner)
