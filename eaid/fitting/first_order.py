"""One exponential for each level, gain_l (1 − e^(−t/τ)): one τ for all with gains linear in the input, or τ of each.

It is the friction curve with C = 1 and T_s = gain, so the same sums serve, by (gain, ln τ). The cost is linear in the
gains for a given τ: the start is a search over τ alone.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from eaid.arrays import Array
from eaid.fitting.compress import Points
from eaid.fitting.data import Data
from eaid.fitting.descent import descend, last_step
from eaid.fitting.kernel import by_log, log_curvature, log_products, weighted_shares
from eaid.fitting.levels import LEAST_LOG, MOST_LOG
from eaid.fitting.problem import ROUNDING, Problem, Value
from eaid.fitting.solver import SETTLED
from eaid.fitting.verdict import judged, minimised
from eaid.results.common import Solver

A0_GRID = 40
"""Time constants on the starting grid."""
MOST = 3
"""Starts from it."""
ENOUGH = 1e-16
"""Steps of single levels end where another predicts less than this part of the cost on the points."""
CLOSE = 1e-9
"""Determinant of a curvature, over the product of its diagonal, below which gain and τ are one."""


@dataclass(frozen=True, eq=False)
class FirstOrder:
    """One time constant for all curves, and gains that are linear in the input: x = (ln τ, gain coefficients)."""

    tau: float
    coefficients: Array
    """Of the columns of the design; the gain itself of a single level."""
    cost: float
    solver: Solver


def first_order_problem(data: Data, design: Array) -> tuple[Problem, Value]:
    """Squares of gain_l (1 − e^(−t/τ)), gain = design @ coefficients, in (ln τ, coefficients), design of shape (L, k).

    On the points, and cost and gradient on every sample.
    """
    sums = Sums(data.points)
    low, high, _ = _limits(data)

    def at(x: Array) -> Array:
        """(gain, ln τ) of each level; SLSQP may look far outside before it comes back."""
        return np.stack([design @ x[1:], np.full(len(design), np.clip(x[0], LEAST_LOG, MOST_LOG))], axis=1)

    def chain(gradient: Array) -> Array:
        return np.concatenate([[gradient[:, 1].sum()], gradient[:, 0] @ design])

    def chained(per_level: Array) -> Array:
        cross = per_level[:, 0, 1] @ design
        by_gain = design.T @ (per_level[:, 0, 0, None] * design)
        return np.block([[per_level[:, 1, 1].sum(), cross], [cross[:, None], by_gain]])

    def normal(x: Array) -> tuple[float, Array, Array]:
        cost, gradient, curvature = sums.normal(at(x))
        return float(cost.sum()), chain(gradient), chained(curvature)

    def full(x: Array) -> tuple[float, Array]:
        cost, gradient = _on_every_sample(at(x), data)
        return float(cost.sum()), chain(gradient)

    A = np.zeros((2, 1 + design.shape[1]))
    A[:, 0] = 1.0, -1.0
    problem = Problem(
        normal,
        A,
        np.array([np.log(low), -np.log(high)]),
        ("a0-fastest", "a0-slowest").__getitem__,
        lambda x: chained(sums.exact(at(x))),
        ROUNDING * data.energy,
    )
    return problem, full


def fit_first_order(data: Data, design: Array) -> FirstOrder:
    """Least squares of gain_l (1 − e^(−t/τ)), gain = design @ coefficients, design of shape (L, k)."""
    problem, full = first_order_problem(data, design)
    starts = _best_of_grid(data, design, np.geomspace(_limits(data)[2], 3 * data.longest_s, A0_GRID))
    end, solver, _ = minimised(problem, starts, full)
    return FirstOrder(float(np.exp(end.x[0])), end.x[1:], end.cost, solver)


@dataclass(frozen=True, eq=False)
class Sums:
    """Sums over the points at (gain, ln τ) of each level, (L, 2)."""

    points: Points

    def normal(self, x: Array) -> tuple[Array, Array, Array]:
        """Cost (L,), gradient (L, 2), Gauss–Newton curvature (L, 2, 2)."""
        theta = _theta(x)
        cost, gradient, curvature = by_log(theta, log_products(theta, self._shares, self.points))
        return cost, gradient[:2].T, curvature[:, :2, :2]

    def exact(self, x: Array) -> Array:
        """Second derivatives, (L, 2, 2)."""
        return log_curvature(_theta(x), self._shares, self.points)[1][:, :2, :2]

    @cached_property
    def _shares(self) -> Array:
        return weighted_shares(np.ones(1), self.points)


def _theta(x: Array) -> Array:
    one = np.ones(len(x))
    return np.stack([x[:, 0], np.exp(x[:, 1]), one, one])


def _on_every_sample(x: Array, data: Data) -> tuple[Array, Array]:
    """Cost (L,) and gradient (L, 2) over every sample."""
    theta = _theta(x)
    cost, gradient = data.sums(theta)
    return cost, np.stack([gradient[0], gradient[1] * theta[1]], axis=1)


def _limits(data: Data) -> tuple[float, float, float]:
    """Least and greatest τ that are looked for, and the least on the grid of starts [s]."""
    shortest = min(float(r.t_s[r.t_s > 0].min()) for r in data.records)
    return 0.01 * shortest, 1e3 * data.longest_s, 0.3 * shortest


def _best_of_grid(data: Data, design: Array, grid: Array) -> list[Array]:
    """Starts at the local minima over τ of the cost with the gains solved for, the best first."""
    square, along = _by_tau(data, grid)
    normal = design.T @ (square.T[:, :, None] * design)  # (K, k, k)
    right = along.T @ design
    ridge = 1e-14 * np.trace(normal, axis1=1, axis2=2)[:, None, None] * np.eye(design.shape[1])
    gains = np.linalg.solve(normal + ridge, right[:, :, None])
    costs = -(right * gains[:, :, 0]).sum(axis=1)
    minima = np.flatnonzero(_is_minimum(costs[None])[0])
    order = minima[np.argsort(costs[minima])][:MOST]
    return [np.concatenate([[np.log(grid[k])], gains[k, :, 0]]) for k in order]


def _by_tau(data: Data, grid: Array) -> tuple[Array, Array]:
    """φ'φ and φ'y of every level for φ = 1 − e^(−t/τ), shapes (L, K)."""
    points = data.points
    rise = -np.expm1(-points.t_s[:, None, :] / grid[:, None])  # (L or 1, K, P)
    weighted = rise * points.w[:, None, :]
    square = np.broadcast_to((weighted * rise).sum(axis=2), (len(data.u), len(grid)))
    return square, (weighted @ points.y[:, :, None])[:, :, 0]


def _is_minimum(costs: Array) -> NDArray[np.bool_]:
    """Where a row has a value that no neighbour undercuts, (N, K)."""
    inside = np.pad(costs, ((0, 0), (1, 1)), constant_values=np.inf)
    return (costs <= inside[:, :-2]) & (costs <= inside[:, 2:])


def fit_each_level(data: Data) -> list[FirstOrder]:
    """τ and gain of each level on its own: all together, and judged on the full data together.

    A level that has several minima over τ, or has not settled, is fitted alone.
    """
    low, high, first = _limits(data)
    grid = np.geomspace(first, 3 * data.longest_s, A0_GRID)
    square, along = _by_tau(data, grid)
    costs = -(along**2) / square
    best, every = costs.argmin(axis=1), np.arange(len(costs))

    def within(x: Array, step: Array) -> Array:
        tried = x - np.clip(step, (-np.inf, -2.0), (np.inf, 2.0))
        return np.clip(tried, (-np.inf, np.log(low)), (np.inf, np.log(high)))

    start = np.stack([(along / square)[every, best], np.log(grid[best])], axis=1)
    sums = Sums(data.points)
    x = descend(sums.normal, start, 12, ENOUGH, within).x
    cost, slope = _on_every_sample(x, data)
    H, tau = sums.exact(x), np.exp(x[:, 1])
    whole = (_is_minimum(costs).sum(axis=1) == 1) & (tau > 1.001 * low) & (tau < 0.999 * high) & (cost > 0)
    whole &= np.linalg.det(H) > CLOSE * H[:, 0, 0] * np.abs(H[:, 1, 1])
    step, predicted = last_step(cost, slope, H, whole)
    found = []
    for i, decrease in enumerate(predicted.tolist()):
        if decrease > SETTLED:
            found.append(fit_first_order(data.one(i), np.ones((1, 1))))
            continue
        (gain, log_tau), sse = x[i] - step[i], float(cost[i])  # the last step is too small for the cost to show
        solver = judged(decrease, A0_GRID, (sse,))
        found.append(FirstOrder(float(np.exp(log_tau)), np.array([gain]), sse, solver))
    return found
