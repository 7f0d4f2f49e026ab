"""The friction curve of one level, Eq. (3), fitted in (T_s, ln τ1, ln τ2); with C free see `free_share`."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from eaid.arrays import Array
from eaid.fitting.compress import Points
from eaid.fitting.data import Data
from eaid.fitting.free_share import free_problem, free_starts, full_value, theta_of
from eaid.fitting.kernel import level_curvature, level_normal, level_sums
from eaid.fitting.result import LevelFit, Solver
from eaid.fitting.solver import PROMISE, ROUNDING, SETTLED, EndPoint, Problem, polish, slsqp
from eaid.models.friction import grid_fits, tau_grid
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
ENOUGH = 1e-9
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
    times = points.t_s if len(points.t_s) == len(points.y) else points.t_s[:1]
    grid = np.unique(np.maximum(tau_grid(times[points.w[: len(times)] > 0], GRID), 1.01 * TAU1_LEAST_S))
    inner, square = grid_fits(times, points.y, points.w, grid, share)
    level, first, second = grid_bowls(inner, square, most)
    steady = inner[level, first, second] / np.broadcast_to(square, inner.shape)[level, first, second]
    theta = np.stack([steady, grid[first], grid[second], np.full_like(steady, share)])
    if len(level) > len(points.y):
        points = Points(
            points.t_s if len(points.t_s) == 1 else points.t_s[level],
            points.y[level],
            points.w if len(points.w) == 1 else points.w[level],
        )
    return Starts(*refine(theta, points, RECORDS * data.longest_s, enough=enough), level)


def grid_bowls(inner: Array, square: Array, most: int) -> tuple[Indices, Indices, Indices]:
    """Level, i, j of the pairs i < j whose cost no neighbour undercuts, at most `most` a level, by level and cost.

    The cost falls by inner²/square; neighbours are the eight around a pair, those with i ≥ j left out.
    """
    levels, count = inner.shape[:2]
    apart = np.arange(count) > np.arange(count)[:, None]
    if most == 1:
        best = np.where(apart, inner * inner / square, -1.0).reshape(levels, -1).argmax(axis=1)
        return np.arange(levels), *np.divmod(best, count)
    cost = np.full((levels, count + 2, count + 2), np.inf)
    inside = cost[:, 1:-1, 1:-1]
    np.divide(inner * -inner, square, out=inside, where=apart)
    across = np.minimum(cost[:, :-2], cost[:, 2:])
    np.minimum(across, cost[:, 1:-1], out=across)
    least = np.minimum(across[:, :, :-2], across[:, :, 2:])
    np.minimum(least, across[:, :, 1:-1], out=least)
    place = np.flatnonzero((inside <= least) & apart)
    level, rest = np.divmod(place, count * count)
    first, second = np.divmod(rest, count)
    order = np.lexsort((inside[level, first, second], level))
    rank = np.arange(len(order)) - np.searchsorted(level, level)
    order = order[rank < most]
    return level[order], first[order], second[order]


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
    cost, gradient, H = level_normal(theta, points)
    damping, moved = np.full(len(cost), 1e-3), np.full(len(cost), True)
    for _ in range(steps):
        scale = theta[:3].T.copy()
        scale[:, 0] = 1.0
        normal = H[:, :3, :3] * (scale[:, :, None] * scale[:, None, :])
        diagonal = np.einsum("lii->li", normal)
        diagonal += damping[:, None] * diagonal + 1e-300
        g = gradient[:3].T * scale
        move = np.linalg.solve(normal, g[:, :, None])[:, :, 0]
        promised = 0.5 * (g * move).sum(axis=1)
        if moved.any() and (promised <= enough * cost)[moved].all():
            break
        tried = theta.copy()
        tried[0] = np.maximum(theta[0] - move[:, 0], 0.0)
        tried[1:3] *= np.exp(np.minimum(np.maximum(-move[:, 1:].T, -2.0), 2.0))
        tried[1] = np.minimum(np.maximum(tried[1], TAU1_LEAST_S), limit)
        tried[2] = np.minimum(np.maximum(tried[2], tried[1]), limit)
        found, slope, bent = level_normal(tried, points)
        moved = found < cost
        if moved.all():
            theta, cost, gradient, H = tried, found, slope, bent
        else:
            theta, cost = np.where(moved, tried, theta), np.where(moved, found, cost)
            gradient, H = np.where(moved, slope, gradient), np.where(moved[:, None, None], bent, H)
        # where τ1 and τ2 have met, two rows of H are one, and only damping keeps it from being singular
        damping = np.where(moved, np.maximum(damping / 10, 1e-12), damping * 10)
    return theta, cost, H[:, :3, :3]


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
    theta = starts.theta[:, order[bounds[:-1]]]
    full, gradient = data.sums(theta)
    promises = _settled(theta, full, gradient, level_curvature(theta, data.points), RECORDS * data.longest_s)
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


def _settled(theta: Array, cost: Array, gradient: Array, curvature: Array, limit: float) -> Array:
    """What a Newton step promises at each level, relative to the cost, (L,); infinite at a limit or off a bowl."""
    Ts, tau1, tau2, _ = theta
    scale = theta[:3].T.copy()
    scale[:, 0] = 1.0
    g = gradient[:3].T * scale
    H = curvature[:, :3, :3] * (scale[:, :, None] * scale[:, None, :])
    H[:, 1, 1] += g[:, 1]  # d²/d(ln τ)² = τ² d²/dτ² + τ d/dτ
    H[:, 2, 2] += g[:, 2]
    inside = (Ts > 0) & (tau1 > 1.001 * TAU1_LEAST_S) & (1.001 * tau1 < tau2) & (tau2 < 0.5 * limit) & (cost > 0)
    inside &= np.linalg.eigvalsh(H)[:, 0] > 0
    H[~inside] = np.eye(3)
    promise = 0.5 * (g * np.linalg.solve(H, g[:, :, None])[:, :, 0]).sum(axis=1)
    return np.where(inside, promise / np.where(inside, cost, 1.0), np.inf)
