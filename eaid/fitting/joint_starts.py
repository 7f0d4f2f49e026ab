"""Starts from all over: where curves scatter from run to run, the joint cost has minima that lie far apart in τ2(u).

Every shape of τ2(u) through five values at the lowest, middle and highest level is tried, all of them together by a
few damped Gauss–Newton steps; the best that differ go on to the solver.
"""

import itertools
from dataclasses import dataclass

import numpy as np

from eaid.arrays import Array
from eaid.fitting.basis import Basis
from eaid.fitting.data import Data
from eaid.fitting.descent import Look, descend, solved
from eaid.fitting.kernel import by_tau, level_normal, log_products, weighted_shares
from eaid.fitting.problem import Problem, bring_in
from eaid.models.nonlinear import CHECKED_DUTIES
from eaid.models.parameters import TAU_FLOOR_S

VALUES = 5
"""Values of τ2 tried at each of three levels: from three times τ1 to thirty times the record, and one without end."""
TOUCHING = 20
"""Steep parabolas touch the fast constant at each level, at every second where there are as many as this."""
ENDLESS = 1e3
"""That one, as a multiple of the slowest of the others: the slow part is then missing from the record."""
SIEVE = ((3, 376), (5, 32), (8, 12))
"""Rounds of the descent: steps in a round, and how many of the best shapes are in it."""
STEEP = 100.0
"""How steep the penalty is that stands for the constraints."""
SAME = 1e-5
"""Ends whose costs differ by less than this part are taken for one."""
MOST = 6
"""Starts handed on."""
MOST_POINTS = 1 << 17
"""Points that are looked at together."""


def broad_starts(x: Array, inner: Array, data: Data, basis: Basis, problem: Problem) -> list[Array]:
    """Up to six feasible starts with different costs, the best first; `x` gives τ1(u), `inner` is a feasible point.

    None where all data are 0.
    """
    if problem.floor == 0.0:
        return []
    cost, found = steadied(slow_shapes(x, data, basis), basis, looked_at(data, basis))
    least = 1e-9 * float(np.abs(data.points.y).max())  # rounding may take the cost below 0, and T_s may be 0
    penalty = penalty_of(x, max(float(cost.min()), problem.floor), least, basis, problem)
    look = looked_at(data, basis, penalty)
    for steps, most in SIEVE:
        best = np.argsort(cost, kind="stable")[:most]
        end = descend(look, found[best], steps, enough=0.0)
        cost, found = end.cost, end.x
    chosen: list[int] = []
    for k in np.argsort(cost, kind="stable"):
        if all(abs(cost[k] - cost[other]) > SAME * cost[other] for other in chosen):
            chosen.append(int(k))
        if len(chosen) == MOST:
            break
    return [bring_in(found[k], inner, problem) for k in chosen]


@dataclass(frozen=True, eq=False)
class Penalty:
    """Constraints as a steep price: Σ min(0, A x − b)², over a tenth of the duties."""

    A: Array
    b: Array

    def price(self, x: Array) -> tuple[Array, Array, Array]:
        """Price (N,), its gradient (N, n) and second derivatives (N, n, n)."""
        out = np.minimum(x @ self.A.T - self.b, 0.0)
        squares = (self.A[:, :, None] * self.A[:, None, :]).reshape(len(self.A), -1)
        bent = 2 * ((out < 0) @ squares).reshape(len(x), x.shape[1], x.shape[1])
        return (out**2).sum(axis=1), 2 * out @ self.A, bent


def penalty_of(x: Array, cost: float, least: float, basis: Basis, problem: Problem) -> Penalty:
    """A penalty where T_s below 0 by a tenth of its largest, or τ by a tenth of τ1, costs `STEEP`/100 of `cost`.

    Its largest counts as `least` [N·m] or more.
    """
    at = CHECKED_DUTIES if basis.highest > basis.lowest else 1
    rows = np.concatenate([np.arange(block * at, (block + 1) * at, 10) for block in range(3)])
    ends = basis.rows(np.linspace(basis.lowest, basis.highest, 5))
    fast, torque = max(np.median(ends[1] @ x), TAU_FLOOR_S), max(float(np.max(ends[0] @ x)), least)
    size = np.where(rows < 2 * at, fast, torque) / np.sqrt(STEEP * cost)
    return Penalty(problem.A[rows] / size[:, None], problem.b[rows] / size)


def slow_shapes(x: Array, data: Data, basis: Basis) -> Array:
    """Unknowns with the τ1 and T_s of `x` and many quadratics τ2, shape (N, n).

    They pass through a grid of values at three levels. Steeper ones would cross zero in between: those come down to the
    fast constant at one level and rise to both sides.
    """
    at = np.array([basis.lowest, 0.5 * (basis.lowest + basis.highest), basis.highest])
    nodes = basis.rows(at)
    part = basis.slices[2]
    typical = max(np.median(nodes[1] @ x), 1e-3)
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


def looked_at(data: Data, basis: Basis, penalty: Penalty | None = None) -> Look:
    """The problem's cost, gradient and curvature at N places, `penalty` added to the cost."""
    M, points, levels = basis.M, data.points, np.arange(len(data.u))
    chain = M[: 4 if basis.free_share else 3].transpose(1, 0, 2)  # (L, 3, n)
    flat = chain.reshape(-1, basis.size)
    together = max(1, MOST_POINTS // points.y.size)

    def some(x: Array) -> tuple[Array, Array, Array]:
        theta = np.moveaxis(basis.theta(x.T, M), 2, 1).reshape(4, -1)
        rows = points.rows(np.tile(levels, len(x)))
        if basis.free_share:
            cost, gradient, H = level_normal(theta, rows)
        else:
            products = log_products(theta, weighted_shares(np.array([basis.share]), rows), rows)
            cost, gradient, H = by_tau(theta, products)
        bent = H.reshape(len(x), *chain.shape[:2], -1) @ chain
        slope = gradient.T.reshape(len(x), -1) @ flat
        return cost.reshape(len(x), -1).sum(axis=1), slope, flat.T @ bent.reshape(len(x), *flat.shape)

    def look(x: Array) -> tuple[Array, Array, Array]:
        parts = [some(x[k : k + together]) for k in range(0, len(x), together)]
        cost, slope, H = (np.concatenate(part) for part in zip(*parts, strict=True))
        if penalty is None:
            return cost, slope, H
        price, rise, bent = penalty.price(x)
        return cost + price, slope + rise, H + bent

    return look


def steadied(x: Array, basis: Basis, look: Look) -> tuple[Array, Array]:
    """Cost (N,) and place (N, n) with T_s solved for: the cost is a parabola in it."""
    part = basis.slices[0]
    cost, gradient, curvature = look(x)
    normal, slope = curvature[:, part, part], gradient[:, part]
    trace = np.einsum("cnn->c", normal)[:, None, None] * np.eye(part.stop)
    step = solved(normal + 1e-12 * trace, slope)
    x = x.copy()
    x[:, part] -= step
    return cost - 0.5 * (slope * step).sum(axis=1), x
