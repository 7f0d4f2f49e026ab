"""The friction curve of one level, Eq. (3), fitted in (T_s, ln τ1, ln τ2); with C free see `free_share`."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from eaid.arrays import Array
from eaid.fitting.compress import Points
from eaid.fitting.data import Data
from eaid.fitting.free_share import free_problem, free_starts, full_value, theta_of
from eaid.fitting.kernel import (
    by_tau,
    level_curvature,
    level_normal,
    level_sums,
    log_curvature,
    log_products,
    weighted_shares,
)
from eaid.fitting.result import LevelFit, Solver
from eaid.fitting.solver import PROMISE, ROUNDING, SETTLED, EndPoint, Problem, polish, slsqp
from eaid.models.friction import grid_along, grid_inner, grid_table, tau_grid
from eaid.models.parameters import Friction

Indices: TypeAlias = NDArray[np.intp]
TAU1_LEAST_S = 1e-3
"""SPEC §3: τ1 ≥ 1 ms."""
RECORDS = 1e6
"""τ2 is looked for up to this many record lengths: no data can tell it from endless."""
RECORDS_FREE = 100.0
"""The same where C is free: T_s then grows with τ2, for the slow part is a straight line of a given slope."""
LEAST_LOG, MOST_LOG = np.log(1e-9), np.log(1e12)
GRID = 48
"""Time constants on the starting grid."""
BOWLS = 3
"""Minima over the grid that a level starts from, at most."""
STEPS = 8
"""Damped Newton steps from each start, at most."""
ENOUGH = 1e-7
"""They end where another promises less than this part of the cost on the points."""
CLEAR = 1e-3
"""A start this much above the best, after its steps, is another minimum and no rival."""
SAME = 1e-6
"""Starts whose costs differ by less than this part have found the same minimum."""
SHARES = (0.3, 0.5, 0.7, 0.85, 0.95)
"""Where a free C starts from."""


@dataclass(frozen=True, eq=False)
class Starts:
    """Curves that single levels may start from, N in all."""

    theta: Array
    """(4, N)."""
    cost: Array
    """On the compressed points, (N,)."""
    curvature: Array
    """Gauss–Newton, by (T_s, τ1, τ2), (N, 3, 3)."""
    level: Indices
    """Index of the level of each, (N,), rising."""


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
    gain *= table.worth
    level, first, second = _bowls(gain, most)
    grid, one = table.grid, 0 if len(table.worth) == 1 else level
    steady = share * along[level, 1 + first] + (1 - share) * along[level, 1 + second]
    steady = np.maximum(steady, 0.0) * table.worth[one, 1 + first, 1 + second]
    theta = np.stack([steady, grid[first], grid[second], np.full_like(steady, share)])
    if len(level) > len(points.y):
        points = Points(
            points.t_s if len(points.t_s) == 1 else points.t_s[level],
            points.y[level],
            points.w if len(points.w) == 1 else points.w[level],
        )
    return Starts(*refine(theta, points, RECORDS * data.longest_s, enough=enough), level)


@dataclass(frozen=True, eq=False)
class _Table:
    """The starting grid of K time constants, and what its pairs need of the times of L levels."""

    grid: Array
    weighted: Array
    """Weighted 1 − e^(−t/τ), (L or 1, K, P)."""
    worth: Array
    """1/φ'φ of pairs i < j and 0 of the others, in a frame of zeros, (L or 1, K + 2, K + 2)."""


def _table(t_s: Array, w: Array, share: float) -> _Table:
    grid = np.unique(np.maximum(tau_grid(t_s[w > 0], GRID), 1.01 * TAU1_LEAST_S))
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
    flat, places = gain.ravel(), np.arange(wide)
    pairs = (places > 0) & (places < wide - 1) & (places[:, None] > 0) & (places > places[:, None])
    peak = np.zeros(gain.shape, dtype=bool)
    along = peak.ravel()[1:-1]
    np.greater_equal(flat[1:-1], flat[:-2], out=along)
    along &= flat[1:-1] >= flat[2:]
    peak &= pairs
    at = np.flatnonzero(peak)  # peaks along τ2: a few, whose other neighbours are looked at one by one
    beside = np.array([-wide - 1, -wide, -wide + 1, wide - 1, wide, wide + 1])
    at = at[(flat[at][:, None] >= flat[at[:, None] + beside]).all(axis=1)]
    level, rest = np.divmod(at, wide * wide)
    first, second = np.divmod(rest, wide)
    order = np.lexsort((-flat[at], level))
    rank = np.arange(len(order)) - np.searchsorted(level, level)
    order = order[rank < most]
    return level[order], first[order] - 1, second[order] - 1


def quick_curves(data: Data, share: float) -> tuple[Array, Array, Array]:
    """θ (4, L), cost (L,) and curvature (L, 3, 3) of every level from its best pair of τ on the grid."""
    found = starting_curves(data, share, most=1, enough=1e-4)
    return found.theta, found.cost, found.curvature


def refine(
    theta: Array, points: Points, limit: float, steps: int = STEPS, enough: float = ENOUGH
) -> tuple[Array, Array, Array]:
    """Damped Gauss–Newton in (T_s, ln τ1, ln τ2) on every row of points at once.

    Returns θ (4, N), cost (N,), and curvature by (T_s, τ1, τ2), (N, 3, 3). A row moves only where its cost falls; τ
    stays within 1 ms and `limit` [s]. Ends when a step promises no row that still moves more than `enough` of its cost.
    """
    shares = weighted_shares(theta[3], points)
    P = log_products(theta, shares, points)
    damping, moved = np.full(len(P), 1e-3), np.full(len(P), True)
    for _ in range(steps):
        cost, slope = P[:, 3, 3], P[:, 3, :3]
        normal = P[:, :3, :3].copy()
        diagonal = np.einsum("lii->li", normal)
        diagonal += damping[:, None] * diagonal + 1e-300
        move = _solved_for(normal, slope)
        promised = (slope * move).sum(axis=1)
        if moved.any() and (promised <= enough * cost)[moved].all():
            break
        tried = _moved(theta, move, limit)
        found = log_products(tried, shares, points)
        moved = found[:, 3, 3] < cost
        if moved.all():
            theta, P = tried, found
        else:
            theta, P = np.where(moved, tried, theta), np.where(moved[:, None, None], found, P)
        # where τ1 and τ2 have met, two rows are one, and only damping keeps them from being singular
        damping = np.where(moved, np.maximum(damping / 10, 1e-12), damping * 10)
    cost, _, curvature = by_tau(theta, P)
    return theta, cost, curvature


def _solved_for(H: Array, slope: Array) -> Array:
    """The step of each level that H and its slope ask for, (L, 3)."""
    return np.asarray(np.linalg.solve(H, slope[:, :, None])[:, :, 0], dtype=np.float64)


def _moved(theta: Array, move: Array, limit: float) -> Array:
    """θ less a step in T_s, and in ln τ1 and ln τ2 over T_s, (L, 3); τ stays within 1 ms and `limit` [s]."""
    moved = theta.copy()
    moved[0] = np.maximum(theta[0] - move[:, 0], 0.0)
    away = move[:, 1:].T / np.maximum(theta[0], 1e-300)
    moved[1:3] *= np.exp(np.minimum(np.maximum(-away, -2.0), 2.0))
    moved[1] = np.minimum(np.maximum(moved[1], TAU1_LEAST_S), limit)
    moved[2] = np.minimum(np.maximum(moved[2], moved[1]), limit)
    return moved


def fit_level(data: Data, share: float | None, starts: Array | None = None) -> LevelFit:
    """The least-squares friction curve of one level; C held at `share`, or free where that is None.

    `starts` are θ = (T_s, τ1, τ2, C) to begin from, shape (4, n), instead of our own.
    """
    if share is None:
        limit = RECORDS_FREE * data.longest_s
        problem = free_problem(data, TAU1_LEAST_S, limit)
        begin = (
            free_starts(data, TAU1_LEAST_S)
            if starts is None
            else [np.log(np.clip(pair, TAU1_LEAST_S, limit)) for pair in starts[1:3].T]
        )
        return _solved(data, problem, begin, lambda x: full_value(x, data), lambda x: theta_of(x, data))
    limit = RECORDS * data.longest_s
    problem = level_problem(data, share, limit)
    if starts is None:
        starts = starting_curves(data, share).theta
    begin = [_unknowns(theta, limit) for theta in starts.T]
    return _solved(data, problem, begin, lambda x: _full(x, data, share), lambda x: _theta(x, share))


def _solved(
    data: Data,
    problem: Problem,
    begin: list[Array],
    full: Callable[[Array], tuple[float, Array]],
    theta_at: Callable[[Array], Array],
) -> LevelFit:
    costs = np.array([problem.value(x)[0] for x in begin])
    # Starts that have reached the same cost lie in one bowl: the solver goes once into each.
    ends: list[EndPoint] = []
    for k in np.argsort(costs, kind="stable"):
        if all(abs(costs[k] - end.cost) > SAME * costs[k] for end in ends):
            ends.append(slsqp(problem, begin[k]))
            costs[k] = ends[-1].cost
    best = min(ends, key=lambda end: end.cost)
    end, promise, active = polish(problem, best, full)
    converged = promise <= PROMISE
    Ts, tau1, tau2, share = theta_at(end.x).tolist()
    n = data.samples
    return LevelFit(
        level=float(data.u[0]),
        curve=Friction(Ts, tau1, tau2, share),
        rmse=float(np.sqrt(end.cost / n)),
        sse=end.cost,
        samples=n,
        solver=Solver(
            converged=converged,
            message=verdict(converged, promise),
            evaluations=len(begin) + sum(e.evaluations for e in ends) + end.evaluations - best.evaluations,
            starts=tuple(float(cost) + end.cost - best.cost for cost in costs),
            at_bounds=tuple(problem.names(i) for i in active),
            promise=promise,
        ),
    )


def verdict(converged: bool, promise: float) -> str:
    """The verdict in words."""
    said = f"a further constrained Newton step on the full data would lower the cost by {promise:.0e} of it"
    return f"converged: {said}" if converged else f"not converged: {said}"


def level_problem(data: Data, share: float, limit: float) -> Problem:
    """Eq. (3) for one level in x = (T_s, ln τ1, ln τ2) on the compressed points."""

    def value(x: Array) -> tuple[float, Array]:
        theta = _theta(x, share)
        cost, gradient = level_sums(theta[:, None], data.points)
        return float(cost[0]), gradient[:3, 0] * _scale(theta)

    def curvature(x: Array) -> Array:
        theta = _theta(x, share)
        scale = _scale(theta)
        return np.asarray(level_normal(theta[:, None], data.points)[2][0, :3, :3] * np.outer(scale, scale))

    def exact(x: Array) -> Array:
        theta = _theta(x, share)
        scale = _scale(theta)
        own = level_curvature(theta[:, None], data.points)[0, :3, :3] * np.outer(scale, scale)
        gradient = level_sums(theta[:, None], data.points)[1][:, 0]
        own[1, 1] += gradient[1] * theta[1]  # d²/d(ln τ)² = τ² d²/dτ² + τ d/dτ
        own[2, 2] += gradient[2] * theta[2]
        return np.asarray(own)

    A = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 1.0], [0.0, 0.0, -1.0]])
    b = np.array([0.0, np.log(TAU1_LEAST_S), 0.0, -np.log(limit)])
    names = ("T_s at 0", "τ1 at 1 ms", "τ2 at τ1", "τ2 endless")
    return Problem(value, curvature, A, b, names.__getitem__, exact, floor=ROUNDING * data.energy)


def _unknowns(theta: Array, limit: float) -> Array:
    tau1 = min(max(theta[1], TAU1_LEAST_S), limit)
    return np.array([max(theta[0], 0.0), np.log(tau1), np.log(min(max(theta[2], tau1), limit))])


def _theta(x: Array, share: float) -> Array:
    tau1, tau2 = np.exp(np.clip(x[1:3], LEAST_LOG, MOST_LOG))  # SLSQP may look far outside before it comes back
    return np.array([x[0], tau1, tau2, share])


def _scale(theta: Array) -> Array:
    """∂(T_s, τ1, τ2)/∂(T_s, ln τ1, ln τ2)."""
    return np.array([1.0, theta[1], theta[2]])


def _full(x: Array, data: Data, share: float) -> tuple[float, Array]:
    theta = _theta(x, share)
    cost, gradient = data.sums(theta[:, None])
    return float(cost[0]), gradient[:3, 0] * _scale(theta)


def fit_levels(data: Data, share: float | None) -> list[LevelFit]:
    """`fit_level` for every level; the starts of all are found, and judged on the full data, together.

    Where the best start of a level is at its minimum already and no other comes near it, the solver has nothing to add.
    """
    if share is None:
        return [fit_level(data.one(i), None) for i in range(len(data.u))]
    starts = starting_curves(data, share)
    order = np.lexsort((starts.cost, starts.level))  # by level, and within a level the lowest first
    bounds = [*np.searchsorted(starts.level, np.arange(len(data.u))).tolist(), len(order)]
    theta, full, promises = _last_step(starts.theta[:, order[bounds[:-1]]], data)
    costs = starts.cost[order].tolist()
    found = []
    for i, (promise, sse, row) in enumerate(zip(promises.tolist(), full.tolist(), theta.T.tolist(), strict=True)):
        ends = costs[bounds[i] : bounds[i + 1]]
        rival = any((1 + SAME) * ends[0] < end < (1 + CLEAR) * ends[0] for end in ends)
        if promise > SETTLED or rival:
            found.append(fit_level(data.one(i), share, starts.theta[:, order[bounds[i] : bounds[i + 1]]]))
            continue
        n = len(data.records[i].y)
        full_ends = tuple(end + (sse - ends[0]) for end in ends)
        solver = Solver(True, verdict(True, promise), len(ends) * STEPS, full_ends, (), promise)
        found.append(LevelFit(float(data.u[i]), Friction(*row), math.sqrt(sse / n), sse, n, solver))
    return found


def _last_step(theta: Array, data: Data) -> tuple[Array, Array, Array]:
    """θ of each level a Newton step on, (4, L), its cost over every sample, (L,), and what another step promises.

    That is relative to the cost, (L,); infinite at a limit or off a bowl, where no step is taken either.
    """
    limit = RECORDS * data.longest_s
    some = np.where(theta[0] > 0, theta, 1.0)
    slope, H = log_curvature(some, weighted_shares(some[3], data.points), data.points)
    bowl = (theta[0] > 0) & _definite(H)
    H[~bowl] = np.eye(3)
    slope[~bowl] = 0.0
    theta = _moved(theta, _solved_for(H, slope), limit)
    cost, gradient = data.sums(theta)
    Ts, tau1, tau2, _ = theta
    bowl &= (tau1 > 1.001 * TAU1_LEAST_S) & (1.001 * tau1 < tau2) & (tau2 < 0.5 * limit) & (Ts > 0) & (cost > 0)
    slope = 0.5 * gradient[:3].T
    slope[:, 1:] *= theta[1:3].T / np.where(bowl, Ts, 1.0)[:, None]
    promise = (slope * _solved_for(H, slope)).sum(axis=1)
    return theta, cost, np.where(bowl, promise / np.where(bowl, cost, 1.0), np.inf)


def _definite(H: Array) -> NDArray[np.bool_]:
    """Which of some symmetric matrices, (L, n, n), are positive definite, (L,)."""
    try:
        np.linalg.cholesky(H)
    except np.linalg.LinAlgError:
        return np.asarray(np.linalg.eigvalsh(H)[:, 0] > 0)
    return np.ones(len(H), dtype=bool)
