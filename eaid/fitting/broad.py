"""Starts from all over: where curves scatter from run to run, the joint cost has minima that lie far apart in τ2(u).

Every shape of τ2(u) through seven values at the lowest, middle and highest level is tried, all of them together by a
few damped Gauss–Newton steps on the compressed points; the best that differ go on to the solver.
"""

import itertools
from dataclasses import dataclass

import numpy as np

from eaid.arrays import Array
from eaid.fitting.basis import DUTIES, Basis
from eaid.fitting.compress import Points
from eaid.fitting.data import Data
from eaid.fitting.kernel import level_curvature, level_sums
from eaid.fitting.levels import TAU1_LEAST_S
from eaid.fitting.solver import Problem, bring_in

VALUES = 7
"""Values of τ2 tried at each of three levels: from three times τ1 to thirty times the record, and one without end."""
TOUCHING = 20
"""Steep parabolas touch the fast constant at each level, at every second where there are as many as this."""
ENDLESS = 1e3
"""That one, as a multiple of the slowest of the others: the slow part is then missing from the record."""
SIEVE = ((3, 376), (5, 48), (8, 16))
"""Rounds of the descent: steps in a round, and how many of the best shapes are in it."""
STEEP = 100.0
"""How steep the wall is that stands for the constraints."""
SAME = 1e-5
"""Ends whose costs differ by less than this part are taken for one."""
MOST = 6
"""Starts handed on."""


def broad_starts(x: Array, inner: Array, data: Data, basis: Basis, problem: Problem) -> list[Array]:
    """Up to six feasible starts with different costs, the best first; `x` gives τ1(u), `inner` is a feasible point."""
    found = slow_shapes(x, data, basis)
    cost, found = descend(found, data, basis, 1, steady_only=True)
    wall = wall_of(x, float(cost.min()), basis, problem)
    for steps, most in SIEVE:
        best = np.argsort(cost, kind="stable")[:most]
        cost, found = descend(found[best], data, basis, steps, wall=wall)
    chosen: list[int] = []
    for k in np.argsort(cost, kind="stable"):
        if all(abs(cost[k] - cost[other]) > SAME * cost[other] for other in chosen):
            chosen.append(int(k))
        if len(chosen) == MOST:
            break
    return [bring_in(found[k], inner, problem) for k in chosen]


@dataclass(frozen=True, eq=False)
class Wall:
    """Constraints as a steep price: Σ min(0, A x − b)², over a tenth of the duties."""

    A: Array
    b: Array

    def price(self, x: Array) -> tuple[Array, Array]:
        """Price (N,) and its gradient (N, n)."""
        out = np.minimum(x @ self.A.T - self.b, 0.0)
        return (out**2).sum(axis=1), 2 * out @ self.A

    def curvature(self, x: Array) -> Array:
        """Second derivatives of the price, (N, n, n)."""
        broken = (x @ self.A.T < self.b)[:, :, None] * self.A
        return np.asarray(2 * broken.transpose(0, 2, 1) @ broken)


def wall_of(x: Array, cost: float, basis: Basis, problem: Problem) -> Wall:
    """A wall where T_s below 0 by a tenth of its largest, or τ by a tenth of τ1, costs `STEEP`/100 of `cost`."""
    at = DUTIES if basis.highest > basis.lowest else 1
    rows = np.concatenate([np.arange(block * at, (block + 1) * at, 10) for block in range(3)])
    ends = basis.rows(np.linspace(basis.lowest, basis.highest, 5))
    fast, torque = max(float(np.median(ends[1] @ x)), TAU1_LEAST_S), max(float(np.max(ends[0] @ x)), 1e-300)
    size = np.where(rows < 2 * at, fast, torque) / np.sqrt(STEEP * cost)
    return Wall(problem.A[rows] / size[:, None], problem.b[rows] / size)


def slow_shapes(x: Array, data: Data, basis: Basis) -> Array:
    """Unknowns with the τ1 and T_s of `x` and many quadratics τ2, shape (N, n).

    They pass through a grid of values at three levels. Steeper ones would cross zero in between: those come down to the
    fast constant at one level and rise to both sides.
    """
    at = np.array([basis.lowest, 0.5 * (basis.lowest + basis.highest), basis.highest])
    nodes = basis.rows(at)
    part = basis.slices[2]
    typical = max(float(np.median(nodes[1] @ x)), 1e-3)
    slowest = max(30 * data.longest_s, 60 * typical)
    values = np.append(np.geomspace(3 * typical, slowest, VALUES - 1), ENDLESS * slowest)
    touching = [
        3 * typical + size * (np.array([-1.0, 0.0, 1.0]) - s) ** 2
        for s in basis.scaled(np.unique(data.u)[:: 1 + len(data.u) // TOUCHING])
        for size in slowest * np.array([0.1, 10.0, ENDLESS])
    ]
    grid = np.array([*itertools.product(values, repeat=3), *touching])
    shapes = np.tile(x, (len(grid), 1))
    shapes[:, part] = np.linalg.lstsq(nodes[2][:, part], grid.T, rcond=None)[0].T
    return shapes


def descend(
    x: Array, data: Data, basis: Basis, steps: int, steady_only: bool = False, wall: Wall | None = None
) -> tuple[Array, Array]:
    """Cost (N,) and place (N, n) a few damped Gauss–Newton steps on from N places.

    `steady_only` moves T_s alone: the cost is a parabola in it, so one step solves for it. `wall` is added to the cost.
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
        total, slope = cost.reshape(count, levels) @ data.weights, np.tensordot(weighted, flat, 2)
        if wall is None:
            return total, slope
        price, rise = wall.price(x)
        return total + price, slope + rise

    def curvature(x: Array) -> Array:
        own = level_curvature(theta_of(x), points).reshape(count, levels, 4, 4) * data.weights[:, None, None]
        H = np.einsum("lan,clam->cnm", flat, own @ flat, optimize=True)
        return np.asarray(H if wall is None else H + wall.curvature(x))

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
