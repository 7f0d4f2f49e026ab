"""Starts from all over: where curves scatter from run to run, the joint cost has minima that lie far apart in τ2(u).

Every shape of τ2(u) through six values at the lowest, middle and highest level is tried, all of them together by a
few damped Gauss–Newton steps on the compressed points; the best that differ go on to the solver.
"""

import itertools

import numpy as np

from eaid.arrays import Array
from eaid.fitting.basis import Basis
from eaid.fitting.compress import Points
from eaid.fitting.data import Data
from eaid.fitting.kernel import level_curvature, level_sums
from eaid.fitting.solver import Problem, bring_in

VALUES = 6
"""Values of τ2 tried at each of three levels, from three times τ1 to thirty times the record."""
SIEVE = ((3, 216), (5, 48), (8, 16))
"""Rounds of the descent: steps in a round, and how many of the best shapes are in it."""
SAME = 1e-5
"""Ends whose costs differ by less than this part are taken for one."""
MOST = 6
"""Starts handed on."""


def broad_starts(x: Array, inner: Array, data: Data, basis: Basis, problem: Problem) -> list[Array]:
    """Up to six feasible starts with different costs, the best first; `x` gives τ1(u), `inner` is a feasible point."""
    found = slow_shapes(x, data, basis)
    cost, found = descend(found, data, basis, 1, steady_only=True)
    for steps, most in SIEVE:
        best = np.argsort(cost, kind="stable")[:most]
        cost, found = descend(found[best], data, basis, steps)
    chosen: list[int] = []
    for k in np.argsort(cost, kind="stable"):
        if all(abs(cost[k] - cost[other]) > SAME * cost[other] for other in chosen):
            chosen.append(int(k))
        if len(chosen) == MOST:
            break
    return [bring_in(found[k], inner, problem) for k in chosen]


def slow_shapes(x: Array, data: Data, basis: Basis) -> Array:
    """Unknowns with the τ1 and T_s of `x` and every quadratic τ2 through a grid of values, shape (216, n)."""
    at = np.array([basis.lowest, 0.5 * (basis.lowest + basis.highest), basis.highest])
    nodes = basis.rows(at)
    part = basis.slices[2]
    typical = max(float(np.median(nodes[1] @ x)), 1e-3)
    values = np.geomspace(3 * typical, max(30 * data.longest_s, 60 * typical), VALUES)
    grid = np.array(list(itertools.product(values, repeat=3)))
    shapes = np.tile(x, (len(grid), 1))
    shapes[:, part] = np.linalg.lstsq(nodes[2][:, part], grid.T, rcond=None)[0].T
    return shapes


def descend(x: Array, data: Data, basis: Basis, steps: int, steady_only: bool = False) -> tuple[Array, Array]:
    """Cost (N,) and place (N, n) a few damped Gauss–Newton steps on from N places.

    `steady_only` moves T_s alone: the cost is a parabola in it, so one step solves for it.
    """
    M = basis.rows(data.u)
    count, levels = len(x), len(data.u)
    p = data.points
    points = Points(
        p.t_s if len(p.t_s) == 1 else np.tile(p.t_s, (count, 1)),
        np.tile(p.y, (count, 1)),
        p.w if len(p.w) == 1 else np.tile(p.w, (count, 1)),
    )
    flat = M.transpose(1, 0, 2)  # (L, 4, n)

    def theta_of(x: Array) -> Array:
        theta = np.stack([basis.theta(one, M) for one in x], axis=1)  # (4, N, L)
        return theta.reshape(4, -1)

    def look(x: Array) -> tuple[Array, Array]:
        cost, gradient = level_sums(theta_of(x), points)
        weighted = (gradient.reshape(4, count, levels) * data.weights).transpose(1, 2, 0)
        return cost.reshape(count, levels) @ data.weights, np.tensordot(weighted, flat, 2)

    def curvature(x: Array) -> Array:
        own = level_curvature(theta_of(x), points).reshape(count, levels, 4, 4) * data.weights[:, None, None]
        return np.asarray(np.einsum("lan,clam->cnm", flat, own @ flat, optimize=True))

    cost, gradient = look(x)
    damping = np.full(count, 1e-12 if steady_only else 1e-3)
    free = np.ones(x.shape[1])
    if steady_only:
        free[basis.slices[1].start :] = 0.0
    for _ in range(steps):
        H = curvature(x) * (free * free[:, None])
        scale = np.sqrt(np.maximum(np.einsum("cnn->cn", H), 1e-300))
        H = H / scale[:, :, None] / scale[:, None, :] + damping[:, None, None] * np.eye(x.shape[1])
        H[:, free == 0, free == 0] = 1.0
        move = -np.linalg.solve(H, (gradient * free / scale)[:, :, None])[:, :, 0] / scale * free
        tried = x + move
        found, slope = look(tried)
        better = found < cost
        x = np.where(better[:, None], tried, x)
        cost, gradient = np.where(better, found, cost), np.where(better[:, None], slope, gradient)
        damping = np.where(better, damping / 5, damping * 10)
    return cost, x
