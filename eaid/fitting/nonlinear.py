"""The nonlinear clutch model, Eqs. (4)–(7): ten coefficients of τ1(u), τ2(u), T_s(u) fitted together.

The chain rule takes each level's sums to the unknowns of `basis`. Two starts come from the curves of single levels;
where the data leave room for another minimum, many more are looked at together (`broad`).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from eaid.arrays import Array
from eaid.fitting.basis import Basis, basis_of, constraints
from eaid.fitting.broad import broad_starts
from eaid.fitting.data import Data
from eaid.fitting.kernel import level_curvature, level_sums, residuals
from eaid.fitting.levels import SHARES, TAU1_LEAST_S, quick_curves, verdict
from eaid.fitting.result import Solver
from eaid.fitting.solver import PROMISE, ROUNDING, EndPoint, Problem, bring_in, draw_in, polish, slsqp
from eaid.models.parameters import Nonlinear

NARROW = 0.3
"""Reach of a level's ln τ within which its cost is taken for a bowl."""


def nonlinear_problem(data: Data, basis: Basis) -> Problem:
    """The ten coefficients on the compressed points."""
    M, points, weights = basis.rows(data.u), data.points, data.weights
    flat = M.reshape(-1, basis.size)
    by_level = np.ascontiguousarray(M.transpose(1, 0, 2))

    def value(x: Array) -> tuple[float, Array]:
        cost, gradient = level_sums(basis.theta(x, M), points)
        return float(weights @ cost), (gradient * weights).ravel() @ flat

    def chained(curvature: Array) -> Array:
        half = (curvature * weights[:, None, None]) @ by_level
        return np.asarray(by_level.reshape(-1, basis.size).T @ half.reshape(-1, basis.size))

    def gauss_newton(x: Array) -> Array:
        return chained(level_curvature(basis.theta(x, M), points))

    def exact(x: Array) -> Array:
        return chained(level_curvature(basis.theta(x, M), points, exact=True))

    A, b, names = constraints(basis, data.longest_s)
    return Problem(value, gauss_newton, A, b, names, exact, ROUNDING * data.energy)


def full_residuals(x: Array, data: Data, basis: Basis) -> list[Array]:
    """f − y at every sample of each level, shapes (n_l,)."""
    return residuals(basis.theta(x, basis.rows(data.u)), data.records)


@dataclass(frozen=True, eq=False)
class OwnCurves:
    """The best curve of each level on its own: what the joint fit starts from, and what it cannot go below."""

    theta: Array
    """(4, L)."""
    cost: float
    """Weighted sum of the levels' least costs on the compressed points: a lower bound of the joint cost."""
    spread: Array
    """Diagonal of the inverse of J'WJ in (T_s, τ1, τ2), (L, 3): variance of each value for unit noise."""


def own_curves(data: Data, share: float) -> OwnCurves:
    """Best curves of single levels with C held at `share`."""
    theta = quick_curves(data, share)
    curvature = 0.5 * level_curvature(theta, data.points)[:, :3, :3] * data.weights[:, None, None]
    scale = np.sqrt(np.maximum(np.einsum("lii->li", curvature), 1e-200))
    inverse = np.linalg.inv(curvature / scale[:, :, None] / scale[:, None, :] + 1e-9 * np.eye(3))
    cost = float(data.weights @ level_sums(theta, data.points)[0])
    return OwnCurves(theta, cost, np.einsum("lii->li", inverse) / scale**2)


def polynomial_starts(own: OwnCurves, data: Data, basis: Basis, problem: Problem) -> list[Array]:
    """Feasible starts from the curves of single levels, the most promising first.

    Polynomials pass through τ1, τ2, T_s of the levels: weighted by their own precision, then each level alike. The last
    start has the weighted means of τ1 and τ2 at every level; it lies inside the constraints, and the others are brought
    there from outside.
    """
    theta, precision = own.theta, 1 / np.sqrt(own.spread)
    M = basis.rows(data.u)
    shaped, alike, level_means = np.zeros(basis.size), np.zeros(basis.size), np.zeros(basis.size)
    for k, part in enumerate(basis.slices):
        p = precision[:, k]
        shaped[part] = np.linalg.lstsq(M[k, :, part] * p[:, None], theta[k] * p, rcond=None)[0]
        alike[part] = np.linalg.lstsq(M[k, :, part], theta[k], rcond=None)[0]
        level_means[part.start] = float(p**2 @ theta[k] / (p**2).sum())
    level_means[basis.slices[0]] = shaped[basis.slices[0]]
    if basis.free_share:
        shaped[-1] = alike[-1] = level_means[-1] = theta[3, 0]
    tau1, tau2 = basis.slices[1].start, basis.slices[2].start
    level_means[tau1] = max(level_means[tau1], 2 * TAU1_LEAST_S)
    level_means[tau2] = max(level_means[tau2], 1.5 * level_means[tau1])
    flat = _above_zero(level_means, basis, problem)
    return [bring_in(shaped, flat, problem), bring_in(alike, flat, problem), flat]


def _above_zero(x: Array, basis: Basis, problem: Problem) -> Array:
    """T_s drawn to its mean where its polynomial falls below 0, so that a point with constant τ is feasible."""
    x = x.copy()
    part = basis.slices[0]
    mean = np.zeros(part.stop)
    mean[0] = max(x[0], 1e-12)
    inner = x.copy()
    inner[part] = mean
    return draw_in(x, inner, problem)


@dataclass(frozen=True, eq=False)
class Solution:
    """The fitted coefficients, their cost on the full data, and the verdict."""

    basis: Basis
    x: Array
    cost: float
    solver: Solver

    @property
    def parameters(self) -> Nonlinear:
        """The model in the units of SPEC §1."""
        return self.basis.parameters(self.x)


def fit_nonlinear(data: Data, share: float | None, starts: Sequence[Nonlinear] = ()) -> Solution:
    """The least-squares coefficients under the constraints, from our own starts and any given ones."""
    basis = basis_of(data.u, share)
    problem = nonlinear_problem(data, basis)
    own = [own_curves(data, c) for c in (SHARES if share is None else (share,))]
    begin = [polynomial_starts(curves, data, basis, problem) for curves in own]
    flat = begin[0][-1]
    near = [start for starts in begin for start in starts[:-1]] + [
        draw_in(basis.unknowns(p), flat, problem) for p in starts
    ]
    ends = [slsqp(problem, start) for start in near]
    if share is None or not alone(own[0], min(end.cost for end in ends), problem):
        far = [starts[-1] for starts in begin] + broad_starts(near[0], flat, data, basis, problem)
        ends += [slsqp(problem, start) for start in far]
    return _confirmed(ends, data, basis, problem)


def refit_nonlinear(data: Data, near: Solution) -> Solution:
    """The minimum next to an earlier one, on data that differ little: one start, no search."""
    problem = nonlinear_problem(data, near.basis)
    return _confirmed([slsqp(problem, near.x)], data, near.basis, problem)


def _confirmed(ends: Sequence[EndPoint], data: Data, basis: Basis, problem: Problem) -> Solution:
    """The best end, confirmed and polished on every sample, with our verdict."""
    best = min(ends, key=lambda end: end.cost)
    M = basis.rows(data.u)

    def full(x: Array) -> tuple[float, Array]:
        cost, gradient = data.sums(basis.theta(x, M))
        return float(data.weights @ cost), (gradient * data.weights).ravel() @ M.reshape(-1, basis.size)

    end, promise, active = polish(problem, best, full)
    converged = promise <= PROMISE
    offset = end.cost - best.cost  # what compression leaves out of every start's cost alike
    return Solution(
        basis,
        end.x,
        end.cost,
        Solver(
            converged=converged,
            message=verdict(converged, promise),
            evaluations=sum(e.evaluations for e in ends) + end.evaluations - best.evaluations,
            starts=tuple(e.cost + offset for e in ends),
            at_bounds=tuple(problem.names(i) for i in active),
            promise=promise,
        ),
    )


def alone(own: OwnCurves, cost: float, problem: Problem) -> bool:
    """Whether no other minimum can lie below `cost`: then every level's curve is known so well that costs are bowls.

    A better joint curve has its levels within `cost − own.cost` of their least costs: in each level it lies in an
    ellipsoid about the level's own curve. Where that is narrow in τ1 and τ2, the cost has one minimum there.
    """
    if own.cost > cost + problem.floor:
        return False  # the levels' own curves are not the best there are
    spare = cost - own.cost + problem.floor
    reach = np.sqrt(spare * own.spread[:, 1:]) / own.theta[1:3].T
    return bool(reach.max() < NARROW)
