"""The friction curve of one level, Eq. (3), fitted in (T_s, ln τ1, ln τ2) and, where it is free, C."""

import numpy as np

from eaid.arrays import Array
from eaid.fitting.data import Data
from eaid.fitting.kernel import level_curvature, level_sums
from eaid.fitting.result import LevelFit, Solver
from eaid.fitting.solver import PROMISE, ROUNDING, EndPoint, Problem, polish, slsqp
from eaid.models.friction import grid_minima, tau_grid
from eaid.models.parameters import Friction

TAU1_LEAST_S = 1e-3
"""SPEC §3: τ1 ≥ 1 ms."""
RECORDS = 1e6
"""τ2 is looked for up to this many record lengths: no data can tell it from endless."""
RECORDS_FREE = 100.0
"""The same where C is free: T_s then grows with τ2, for the slow part is a straight line of a given slope."""
LEAST_LOG, MOST_LOG = np.log(1e-9), np.log(1e12)
APART = 3
"""Grid steps between the starting τ1 and τ2: a start with both alike would stay so."""
SHARES = (0.3, 0.5, 0.7, 0.85, 0.95)
"""Where a free C starts from."""


def starting_curves(data: Data, share: float, enough: float = 1e-12, grid_size: int = 20) -> Array:
    """θ = (T_s, τ1, τ2, C) of every level, shape (4, L): best pair on a log grid, then a few damped Newton steps."""
    points = data.points
    times = points.t_s if len(points.t_s) == len(points.y) else points.t_s[:1]
    grid = np.maximum(tau_grid(times[points.w[: len(times)] > 0], grid_size), 1.01 * TAU1_LEAST_S)
    tau1, tau2, steady = grid_minima(times, points.y, points.w, np.unique(grid), share, APART)
    theta = np.stack([steady, tau1, np.maximum(tau2, 1.01 * tau1), np.full_like(tau1, share)])
    return refine(theta, data, enough=enough)


def refine(theta: Array, data: Data, steps: int = 8, enough: float = 1e-12) -> Array:
    """Damped Gauss–Newton in (T_s, ln τ1, ln τ2) on every level at once; a level moves only where its cost falls.

    Ends when a step lowers no level's cost by more than `enough` of it.
    """
    limit = RECORDS * data.longest_s
    cost, gradient = level_sums(theta, data.points)
    damping = np.full(len(cost), 1e-3)
    for _ in range(steps):
        scale = np.stack([np.ones_like(theta[0]), theta[1], theta[2]])
        g = gradient[:3] * scale
        H = level_curvature(theta, data.points)[:, :3, :3] * (scale.T[:, :, None] * scale.T[:, None, :])
        diagonal = np.maximum(np.einsum("lii->li", H), 1e-300)
        H = H + damping[:, None, None] * diagonal[:, :, None] * np.eye(3)
        move = -np.linalg.solve(H, g.T[:, :, None])[:, :, 0].T
        tried = theta.copy()
        tried[0] = np.maximum(theta[0] + move[0], 0.0)
        tried[1] = np.clip(theta[1] * np.exp(np.clip(move[1], -2, 2)), TAU1_LEAST_S, limit)
        tried[2] = np.clip(theta[2] * np.exp(np.clip(move[2], -2, 2)), tried[1], limit)
        found, slope = level_sums(tried, data.points)
        better = found < cost
        done = np.max((cost - found)[better] / cost[better], initial=0.0) < enough
        theta = np.where(better, tried, theta)
        cost, gradient = np.where(better, found, cost), np.where(better, slope, gradient)
        damping = np.where(better, damping / 10, damping * 10)
        if done and better.any():
            break
    return theta


def fit_level(data: Data, share: float | None, start: Array | None = None) -> LevelFit:
    """The least-squares friction curve of one level; C held at `share`, or free where that is None.

    `start` is θ = (T_s, τ1, τ2, C) to begin from, shape (4,).
    """
    limit = (RECORDS_FREE if share is None else RECORDS) * data.longest_s
    if share is None:
        starts = [starting_curves(data, c)[:, 0] for c in SHARES]
    else:
        starts = [starting_curves(data, share)[:, 0] if start is None else start]
    problem = level_problem(data, share, limit)
    ends = [slsqp(problem, _unknowns(theta, share, limit)) for theta in starts]
    best = min(ends, key=lambda end: end.cost)
    # The full data's own problem has the compressed curvature: only its gradient decides.
    end, promise, active = polish(problem, best, lambda x: _full(x, data, share))
    at_bounds = tuple(problem.names(i) for i in active)
    converged = promise <= PROMISE
    Ts, tau1, tau2, c = _theta(end.x, share).tolist()
    n = data.samples
    return LevelFit(
        level=float(data.u[0]),
        curve=Friction(Ts, tau1, tau2, c),
        rmse=float(np.sqrt(end.cost / n)),
        sse=end.cost,
        samples=n,
        solver=Solver(
            converged=converged,
            message=verdict(converged, promise),
            evaluations=sum(e.evaluations for e in ends) + end.evaluations - best.evaluations,
            starts=tuple(_full(e.x, data, share)[0] for e in ends) if len(ends) > 1 else (end.cost,),
            at_bounds=at_bounds,
            promise=promise,
        ),
    )


def verdict(converged: bool, promise: float) -> str:
    """The verdict in words."""
    said = f"a further constrained Newton step on the full data would lower the cost by {promise:.0e} of it"
    return f"converged: {said}" if converged else f"not converged: {said}"


def level_problem(data: Data, share: float | None, limit: float) -> Problem:
    """Eq. (3) for one level in x = (T_s, ln τ1, ln τ2[, C]) on the compressed points."""
    free = share is None
    n = 4 if free else 3

    def value(x: Array) -> tuple[float, Array]:
        theta = _theta(x, share)
        cost, gradient = level_sums(theta[:, None], data.points)
        return float(cost[0]), _chain(gradient[:, 0], theta)[:n]

    def curvature(x: Array) -> Array:
        theta = _theta(x, share)
        scale = np.array([1.0, theta[1], theta[2], 1.0])
        return np.asarray((level_curvature(theta[:, None], data.points)[0] * np.outer(scale, scale))[:n, :n])

    def exact(x: Array) -> Array:
        theta = _theta(x, share)
        scale = np.array([1.0, theta[1], theta[2], 1.0])
        own = level_curvature(theta[:, None], data.points, exact=True)[0] * np.outer(scale, scale)
        gradient = level_sums(theta[:, None], data.points)[1][:, 0]
        own[1, 1] += gradient[1] * theta[1]  # d²/d(ln τ)² = τ² d²/dτ² + τ d/dτ
        own[2, 2] += gradient[2] * theta[2]
        return np.asarray(own[:n, :n])

    rows = [
        ([1.0, 0.0, 0.0, 0.0], 0.0, "T_s at 0"),
        ([0.0, 1.0, 0.0, 0.0], float(np.log(TAU1_LEAST_S)), "τ1 at 1 ms"),
        ([0.0, -1.0, 1.0, 0.0], 0.0, "τ2 at τ1"),
        ([0.0, 0.0, -1.0, 0.0], -float(np.log(limit)), "τ2 endless"),
    ]
    if free:
        rows += [([0.0, 0.0, 0.0, 1.0], 0.0, "C at 0"), ([0.0, 0.0, 0.0, -1.0], -1.0, "C at 1")]
    A = np.array([row for row, _, _ in rows])[:, :n]
    return Problem(
        value,
        curvature,
        A,
        np.array([b for _, b, _ in rows]),
        [name for *_, name in rows].__getitem__,
        exact,
        ROUNDING * data.energy,
    )


def _unknowns(theta: Array, share: float | None, limit: float) -> Array:
    tau1 = min(max(theta[1], TAU1_LEAST_S), limit)
    x = np.array([max(theta[0], 0.0), np.log(tau1), np.log(min(max(theta[2], tau1), limit)), theta[3]])
    return x if share is None else x[:3]


def _theta(x: Array, share: float | None) -> Array:
    tau1, tau2 = np.exp(np.clip(x[1:3], LEAST_LOG, MOST_LOG))  # SLSQP may look far outside before it comes back
    return np.array([x[0], tau1, tau2, x[3] if share is None else share])


def _chain(gradient: Array, theta: Array) -> Array:
    return np.array([gradient[0], gradient[1] * theta[1], gradient[2] * theta[2], gradient[3]])


def _full(x: Array, data: Data, share: float | None) -> tuple[float, Array]:
    theta = _theta(x, share)
    cost, gradient = data.sums(theta[:, None])
    return float(cost[0]), _chain(gradient[:, 0], theta)[: len(x)]


def fit_levels(data: Data, share: float | None) -> list[LevelFit]:
    """`fit_level` for every level; the starts of all are found together."""
    if share is None:
        return [fit_level(data.one(i), None) for i in range(len(data.u))]
    starts = starting_curves(data, share)
    return [fit_level(data.one(i), share, starts[:, i]) for i in range(len(data.u))]


def as_end(fit: LevelFit) -> EndPoint:
    """The end point of a level's fit in θ = (T_s, τ1, τ2, C)."""
    curve = fit.curve
    return EndPoint(np.array([curve.Ts, curve.tau1, curve.tau2, curve.C]), fit.sse, fit.solver.evaluations)
