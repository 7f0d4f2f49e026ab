"""The nonlinear clutch model, Eqs. (4)–(7): ten coefficients of τ1(u), τ2(u), T_s(u) fitted together.

The chain rule takes each level's sums to the unknowns of `basis`. The first start comes from the curves of single
levels. Where no other minimum can lie as low as its end (`alone`), that is all; else there is a second, and where the
data still leave room, many more are looked at together (`broad`).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from eaid.arrays import Array
from eaid.fitting.basis import Basis, basis_of, constraints, held_at
from eaid.fitting.broad import broad_starts
from eaid.fitting.data import Data
from eaid.fitting.kernel import by_tau, level_costs, level_normal, log_curvature, log_products, weighted_shares
from eaid.fitting.levels import SHARES, TRUST
from eaid.fitting.problem import ROUNDING, Problem, bring_in, draw_in
from eaid.fitting.samples import residuals
from eaid.fitting.solver import EndPoint, approach, concluded, ended, slsqp
from eaid.fitting.starts import starting_curves
from eaid.models.parameters import TAU_FLOOR_S, Nonlinear
from eaid.results.common import Solver

NARROW = 0.3
"""Reach of a level's ln τ within which its cost is taken for a bowl."""

ROUGH = 0.1
"""Steps to the curve of a level end where another predicts less than this part of its cost."""


def nonlinear_problem(data: Data, basis: Basis) -> Problem:
    """The ten coefficients on the compressed points; the levels of `data` are those of the basis."""
    M, points, weights = basis.M, data.points, data.weights
    known = 4 if basis.free_share else 3  # how many of T_s, τ1, τ2, C move
    flat = M[:known].reshape(-1, basis.size)
    by_level = np.ascontiguousarray(M[:known].transpose(1, 0, 2))
    shares = weighted_shares(np.array([basis.share]), points)

    def sums(x: Array) -> tuple[Array, Array, Array]:
        theta = basis.theta(x, M)
        return level_normal(theta, points) if basis.free_share else by_tau(theta, log_products(theta, shares, points))

    def chained(curvature: Array) -> Array:
        half = (curvature * weights[:, None, None]) @ by_level
        return np.asarray(by_level.reshape(-1, basis.size).T @ half.reshape(-1, basis.size))

    def exact(x: Array) -> Array:
        theta = basis.theta(x, M)
        slope, H = log_curvature(theta, shares, points)
        by_tau = 1 / theta[1:3].T
        H[:, 1, 1] -= slope[:, 1]  # d²/dτ² = (d²/d(ln τ)² − d/d ln τ)/τ²
        H[:, 2, 2] -= slope[:, 2]
        H[:, 1:] *= by_tau[:, :, None]
        H[:, :, 1:] *= by_tau[:, None, :]
        return chained(H)

    def normal(x: Array) -> tuple[float, Array, Array]:
        cost, gradient, curvature = sums(x)
        return float(weights @ cost), (gradient * weights).ravel() @ flat, chained(curvature)

    A, b, names = constraints(basis, data.longest_s)
    return Problem(normal, A, b, names, None if basis.free_share else exact, ROUNDING * data.energy)


def full_residuals(x: Array, data: Data, basis: Basis) -> list[Array]:
    """f − y at every sample of each level, shapes (n_l,)."""
    return residuals(basis.theta(x, basis.rows(data.u)), data.records)


@dataclass(frozen=True, eq=False)
class OwnCurves:
    """The best curve of each level on its own: what the joint fit starts from, and what it cannot go below."""

    theta: Array
    """(4, L)."""
    cost: Array
    """What the weighted least costs on the compressed points are at least, (L,), and all together the joint cost is."""
    normal: Array
    """J'WJ in (T_s, τ1, τ2), (L, 3, 3)."""
    covariance: Array
    """Its inverse, (L, 3, 3): covariance of the three values for unit noise."""


def own_curves(data: Data, share: float) -> OwnCurves:
    """Best curves of single levels with C held at `share`."""
    found = starting_curves(data, share, most=1, enough=ROUGH)
    theta, end = found.theta, found.end
    by_tau = np.stack([np.ones_like(theta[0]), 1 / theta[1], 1 / theta[2]], axis=1)
    normal = end.curvature * (0.5 * data.weights[:, None, None]) * (by_tau[:, :, None] * by_tau[:, None, :])
    scale = np.sqrt(np.maximum(np.einsum("lii->li", normal), 1e-200))
    outer = scale[:, :, None] * scale[:, None, :]
    return OwnCurves(
        theta,
        data.weights * (end.cost - TRUST * end.predicted),
        normal,
        np.linalg.inv(normal / outer + 1e-9 * np.eye(3)) / outer,
    )


def polynomial_starts(own: OwnCurves, basis: Basis, problem: Problem) -> Iterator[Array]:
    """Feasible starts from the curves of single levels, the most promising first, made as they are asked for.

    Polynomials pass through τ1, τ2, T_s of the levels: weighted by their own precision, then each level alike. The last
    start has the weighted means of τ1 and τ2 at every level; it lies inside the constraints, and the others are brought
    there from outside.
    """
    theta, precision, M = own.theta, 1 / np.sqrt(np.einsum("lii->li", own.covariance)), basis.M
    shaped, alike, level_means = np.zeros((3, basis.size))
    if basis.free_share:
        shaped[-1] = alike[-1] = level_means[-1] = theta[3, 0]
    for k, part in enumerate(basis.slices):
        p = precision[:, k]
        shaped[part] = np.linalg.lstsq(M[k, :, part] * p[:, None], theta[k] * p, rcond=None)[0]
    if feasible := bool((problem.A @ shaped >= problem.b).all()):
        yield shaped
    for k, part in enumerate(basis.slices):
        alike[part] = basis.inverses[k] @ theta[k]
        level_means[part.start] = np.average(theta[k], weights=precision[:, k] ** 2)
    level_means[basis.slices[0]] = shaped[basis.slices[0]]
    tau1, tau2 = basis.slices[1].start, basis.slices[2].start
    level_means[tau1] = max(level_means[tau1], 2 * TAU_FLOOR_S)
    level_means[tau2] = max(level_means[tau2], 1.5 * level_means[tau1])
    flat = _above_zero(level_means, basis, problem)
    if not feasible:
        yield bring_in(shaped, flat, problem)
    yield bring_in(alike, flat, problem)
    yield flat


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
    held: dict[str, tuple[float, ...]]
    """The constraints that hold it, and the inputs at which they do."""

    @property
    def parameters(self) -> Nonlinear:
        """The model in the units of specification 1."""
        return self.basis.parameters(self.x)


def fit_nonlinear(data: Data, share: float | None, starts: Sequence[Nonlinear] = ()) -> Solution:
    """The least-squares coefficients under the constraints, from our own starts and any given ones."""
    basis = basis_of(data.u, share)
    problem = nonlinear_problem(data, basis)
    own = [own_curves(data, c) for c in (SHARES if share is None else (share,))]
    begin = [polynomial_starts(curves, basis, problem) for curves in own]
    first = next(begin[0])

    def proven() -> bool:
        return share is not None and alone(own[0], min(end.cost for end in ends), data, basis, problem)

    ends = [approach(problem, first)]
    if starts or not proven():
        *near, flat = begin[0]
        others = [list(more) for more in begin[1:]]
        near += [start for more in others for start in more[:-1]]
        near += [draw_in(basis.unknowns(p), flat, problem) for p in starts]
        ends += [approach(problem, start) for start in near]
        if not proven():
            far = [flat, *(more[-1] for more in others), *broad_starts(first, flat, data, basis, problem)]
            ends += [approach(problem, start) for start in far]
    return _confirmed(ended(ends, problem), data, basis, problem)


def refit_nonlinear(data: Data, near: Solution) -> Solution:
    """The minimum next to an earlier one, on data that differ little: one start, no search."""
    problem = nonlinear_problem(data, near.basis)
    return _confirmed([slsqp(problem, near.x)], data, near.basis, problem)


def _confirmed(ends: Sequence[EndPoint], data: Data, basis: Basis, problem: Problem) -> Solution:
    """The best end, confirmed and polished on every sample, with our verdict."""
    M = basis.M

    def full(x: Array) -> tuple[float, Array]:
        cost, gradient = data.sums(basis.theta(x, M))
        return float(data.weights @ cost), (gradient * data.weights).ravel() @ M.reshape(-1, basis.size)

    end, solver, active = concluded(problem, ends, full)
    return Solution(basis, end.x, end.cost, solver, held_at(basis, active))


def alone(own: OwnCurves, cost: float, data: Data, basis: Basis, problem: Problem) -> bool:
    """Whether no other minimum can lie below `cost`: then every level is known so well that its cost is a bowl.

    In a better joint curve the levels lie above their own least costs by no more than `spare`, all together. A level is
    narrow where its cost has risen by as much at the edge of the ellipsoid that reaches `NARROW` in ln τ. The narrow
    ones leave the polynomials an ellipsoid too; levels that it reaches less than `NARROW` of are narrow with them.
    """
    spare = cost - float(own.cost.sum()) + problem.floor
    if spare < 0:
        return False  # the levels' own curves are not the best there are
    kept, rise = _edges(own, data)
    narrow = rise >= spare
    if narrow.all():
        return True
    rows = basis.M[:3].transpose(1, 0, 2)  # (L, 3, n)
    weighted = kept[:, None, None] * own.normal @ rows
    while narrow.sum() >= max(basis.degrees) + 1 and not narrow.all():
        A, J = weighted[narrow].reshape(-1, basis.size), rows[narrow].reshape(-1, basis.size)
        H = J.T @ A
        x = np.linalg.lstsq(H, A.T @ own.theta[:3, narrow].T.ravel(), rcond=None)[0]
        off = own.theta[:3].T - rows @ x
        left = spare - float((kept[:, None] * off * (own.normal @ off[:, :, None])[:, :, 0])[narrow].sum())
        scale = np.sqrt(np.maximum(np.diagonal(H), 1e-200))
        spread = rows[:, 1:] / scale @ np.linalg.inv(H / scale / scale[:, None] + 1e-12 * np.eye(len(H)))
        reach = np.sqrt(max(left, 0.0) * np.maximum((spread * rows[:, 1:] / scale).sum(axis=2), 0.0))
        reached = (reach < NARROW * (rows @ x)[:, 1:]).all(axis=1)
        if not (reached & ~narrow).any():
            break
        narrow |= reached
    return bool(narrow.all())


def _edges(own: OwnCurves, data: Data) -> tuple[Array, Array]:
    """How far the cost rises to the edge of each level's ellipsoid that reaches `NARROW` in ln τ, (L,).

    In front of it, what part of the parabola's rise that is, 0 to 1, (L,): the cost is no parabola.
    """
    variance = np.einsum("lii->li", own.covariance)[:, 1:]
    which = 1 + (variance / own.theta[1:3].T ** 2).argmax(axis=1)
    every = np.arange(len(which))
    width = NARROW * own.theta[which, every] / variance[every, which - 1]
    way = np.zeros_like(own.theta)
    way[:3] = own.covariance[every, :, which].T * width
    ends = level_costs(np.stack([own.theta + way, own.theta - way], axis=1), data.points)
    rise = data.weights * ends.min(axis=0) - own.cost
    parabola = NARROW * own.theta[which, every] * width
    return np.clip(rise / parabola, 0.0, 1.0), rise
