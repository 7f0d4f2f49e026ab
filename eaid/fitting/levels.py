"""The friction curve of one level, Eq. (3), fitted in (T_s, ln τ1, ln τ2); with C free see `free_share`."""

from collections.abc import Callable

import numpy as np

from eaid.arrays import Array
from eaid.fitting.compress import Points
from eaid.fitting.data import Data
from eaid.fitting.free_share import free_problem, free_starts, full_value, theta_of
from eaid.fitting.kernel import level_curvature, level_sums
from eaid.fitting.result import LevelFit, Solver
from eaid.fitting.solver import PROMISE, ROUNDING, SETTLED, EndPoint, Problem, polish, slsqp
from eaid.models.friction import grid_minima, tau_grid
from eaid.models.parameters import Friction

TAU1_LEAST_S = 1e-3
"""SPEC §3: τ1 ≥ 1 ms."""
RECORDS = 1e6
"""τ2 is looked for up to this many record lengths: no data can tell it from endless."""
RECORDS_FREE = 100.0
"""The same where C is free: T_s then grows with τ2, for the slow part is a straight line of a given slope."""
LEAST_LOG, MOST_LOG = np.log(1e-9), np.log(1e12)
GRID = 24
"""Time constants on the starting grid."""
BANDS = ((1, 4), (4, 7), (7, GRID))
"""How many grid steps the starting τ1 and τ2 lie apart, one start each; at none apart they would stay together."""
STEPS = 8
"""Damped Newton steps from each start, at most."""
CLEAR = 1e-3
"""A start this much above the best, after its steps, is another minimum and no rival."""
SAME = 1e-6
"""Starts whose costs differ by less than this part have found the same minimum."""
SHARES = (0.3, 0.5, 0.7, 0.85, 0.95)
"""Where a free C starts from."""


def starting_curves(data: Data, share: float, enough: float = 1e-12) -> tuple[Array, Array]:
    """Starts of every level, best pairs of τ on a log grid in each band of `BANDS`, then a few damped Newton steps.

    θ = (T_s, τ1, τ2, C) of shape (4, bands, L), and the costs, (bands, L): a level's cost may have two bowls.
    """
    times, points, grid = _grid(data)
    found = grid_minima(times, points.y, points.w, grid, share, BANDS)
    levels = len(points.y)
    theta = np.stack([found[2], found[0], np.maximum(found[1], 1.01 * found[0]), np.full_like(found[0], share)])
    many = Points(
        points.t_s if len(points.t_s) == 1 else np.tile(points.t_s, (len(BANDS), 1)),
        np.tile(points.y, (len(BANDS), 1)),
        points.w if len(points.w) == 1 else np.tile(points.w, (len(BANDS), 1)),
    )
    theta, cost = refine(theta.reshape(4, -1), many, RECORDS * data.longest_s, enough=enough)
    return theta.reshape(4, len(BANDS), levels), cost.reshape(len(BANDS), levels)


def quick_curves(data: Data, share: float) -> Array:
    """θ of every level, (4, L): the best pair on the grid, refined until a step gains less than a ten-thousandth.

    The next would gain about the square of that.
    """
    times, points, grid = _grid(data)
    band = ((BANDS[0][0], GRID),)
    tau1, tau2, steady = grid_minima(times, points.y, points.w, grid, share, band)
    theta = np.concatenate([steady, tau1, np.maximum(tau2, 1.01 * tau1), np.full_like(tau1, share)])
    return refine(theta, points, RECORDS * data.longest_s, enough=1e-4)[0]


def _grid(data: Data) -> tuple[Array, Points, Array]:
    """Times of the points, the points, and time constants to try."""
    points = data.points
    times = points.t_s if len(points.t_s) == len(points.y) else points.t_s[:1]
    return times, points, np.unique(np.maximum(tau_grid(times[points.w[: len(times)] > 0], GRID), 1.01 * TAU1_LEAST_S))


def refine(
    theta: Array, points: Points, limit: float, steps: int = STEPS, enough: float = 1e-12
) -> tuple[Array, Array]:
    """Damped Gauss–Newton in (T_s, ln τ1, ln τ2) on every row of points at once: θ (4, N) and cost (N,).

    A row moves only where its cost falls; τ stays within 1 ms and `limit` [s]. Ends when a step lowers no row by
    more than `enough` of its cost.
    """
    cost, gradient = level_sums(theta, points)
    damping = np.full(len(cost), 1e-3)
    for _ in range(steps):
        scale = np.stack([np.ones_like(theta[0]), theta[1], theta[2]])
        g = gradient[:3] * scale
        H = level_curvature(theta, points)[:, :3, :3] * (scale.T[:, :, None] * scale.T[:, None, :])
        diagonal = np.maximum(np.einsum("lii->li", H), 1e-300)
        H = H + damping[:, None, None] * diagonal[:, :, None] * np.eye(3)
        move = -np.linalg.solve(H, g.T[:, :, None])[:, :, 0].T
        tried = theta.copy()
        tried[0] = np.maximum(theta[0] + move[0], 0.0)
        tried[1] = np.clip(theta[1] * np.exp(np.clip(move[1], -2, 2)), TAU1_LEAST_S, limit)
        tried[2] = np.clip(theta[2] * np.exp(np.clip(move[2], -2, 2)), tried[1], limit)
        found, slope = level_sums(tried, points)
        better = found < cost
        done = np.max((cost - found)[better] / cost[better], initial=0.0) < enough
        theta = np.where(better, tried, theta)
        cost, gradient = np.where(better, found, cost), np.where(better, slope, gradient)
        # where τ1 and τ2 have met, two rows of H are one, and only damping keeps it from being singular
        damping = np.where(better, np.maximum(damping / 10, 1e-12), damping * 10)
        if done and better.any():
            break
    return theta, cost


def fit_level(data: Data, share: float | None, starts: Array | None = None) -> LevelFit:
    """The least-squares friction curve of one level; C held at `share`, or free where that is None.

    `starts` are θ = (T_s, τ1, τ2, C) to begin from, shape (4, n), instead of our own.
    """
    if share is None:
        limit = RECORDS_FREE * data.longest_s
        problem = free_problem(data, TAU1_LEAST_S, limit)
        begin = (
            free_starts(data, TAU1_LEAST_S, BANDS, GRID)
            if starts is None
            else [np.log(np.clip(pair, TAU1_LEAST_S, limit)) for pair in starts[1:3].T]
        )
        return _solved(data, problem, begin, lambda x: full_value(x, data), lambda x: theta_of(x, data))
    limit = RECORDS * data.longest_s
    problem = level_problem(data, share, limit)
    if starts is None:
        starts = starting_curves(data, share)[0][:, :, 0]
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
        return np.asarray(level_curvature(theta[:, None], data.points)[0, :3, :3] * np.outer(scale, scale))

    def exact(x: Array) -> Array:
        theta = _theta(x, share)
        scale = _scale(theta)
        own = level_curvature(theta[:, None], data.points, exact=True)[0, :3, :3] * np.outer(scale, scale)
        gradient = level_sums(theta[:, None], data.points)[1][:, 0]
        own[1, 1] += gradient[1] * theta[1]  # d²/d(ln τ)² = τ² d²/dτ² + τ d/dτ
        own[2, 2] += gradient[2] * theta[2]
        return np.asarray(own)

    A = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 1.0], [0.0, 0.0, -1.0]])
    b = np.array([0.0, np.log(TAU1_LEAST_S), 0.0, -np.log(limit)])
    names = ("T_s at 0", "τ1 at 1 ms", "τ2 at τ1", "τ2 endless")
    return Problem(value, curvature, A, b, names.__getitem__, exact, ROUNDING * data.energy)


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
    starts, costs = starting_curves(data, share)
    theta = starts[:, costs.argmin(axis=0), np.arange(len(data.u))]
    full, gradient = data.sums(theta)
    curvature = level_curvature(theta, data.points, exact=True)
    limit = RECORDS * data.longest_s
    found = []
    for i in range(len(data.u)):
        settled = _settled(theta[:, i], full[i], gradient[:, i], curvature[i], limit)
        rivals = costs[:, i][costs[:, i] > (1 + SAME) * costs[:, i].min()]
        if settled is None or (rivals < (1 + CLEAR) * costs[:, i].min()).any():
            found.append(fit_level(data.one(i), share, starts[:, :, i]))
        else:
            Ts, tau1, tau2, _ = theta[:, i].tolist()
            n = len(data.records[i].y)
            ends = tuple((costs[:, i] + full[i] - costs[:, i].min()).tolist())
            solver = Solver(True, verdict(True, settled), len(ends) * STEPS, ends, (), settled)
            curve = Friction(Ts, tau1, tau2, share)
            found.append(LevelFit(float(data.u[i]), curve, float(np.sqrt(full[i] / n)), float(full[i]), n, solver))
    return found


def _settled(theta: Array, cost: float, gradient: Array, curvature: Array, limit: float) -> float | None:
    """What a Newton step on the full data promises, relative to the cost; None unless nothing and inside the limits."""
    scale = _scale(theta)
    inside = theta[0] > 0 and theta[1] > 1.001 * TAU1_LEAST_S and 1.001 * theta[1] < theta[2] < 0.5 * limit
    if not inside or cost <= 0:
        return None
    H = curvature[:3, :3] * (scale * scale[:, None])
    H[1, 1] += gradient[1] * theta[1]
    H[2, 2] += gradient[2] * theta[2]
    try:
        q = np.linalg.solve(np.linalg.cholesky(H), gradient[:3] * scale)
    except np.linalg.LinAlgError:
        return None
    promise = 0.5 * float(q @ q) / cost
    return promise if promise <= SETTLED else None
