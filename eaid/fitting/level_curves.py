"""The best curve of each level on its own: what the joint fit starts from, and what it cannot go below.

Where no other minimum of the joint cost can lie as low as an end (`no_lower_minimum`), no other start is looked at.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from eaid.arrays import Array
from eaid.fitting.basis import Basis
from eaid.fitting.data import Data
from eaid.fitting.kernel import level_costs
from eaid.fitting.levels import TRUST
from eaid.fitting.problem import Problem, bring_in, draw_in
from eaid.fitting.starts import starting_curves
from eaid.models.parameters import TAU_FLOOR_S

NARROW = 0.3
"""Reach of a level's ln τ within which its cost is taken for a bowl."""

ROUGH = 0.1
"""Steps to the curve of a level end where another predicts less than this part of its cost."""


@dataclass(frozen=True, eq=False)
class LevelCurves:
    """The best curve of each level on its own: what the joint fit starts from, and what it cannot go below."""

    theta: Array
    """(4, L)."""
    cost: Array
    """What the weighted least costs on the compressed points are at least, (L,), and all together the joint cost is."""
    normal: Array
    """J'WJ in (T_s, τ1, τ2), (L, 3, 3)."""
    covariance: Array
    """Its inverse, (L, 3, 3): covariance of the three values for unit noise."""


def level_curves(data: Data, share: float) -> LevelCurves:
    """Best curves of single levels with C held at `share`."""
    found = starting_curves(data, share, most=1, enough=ROUGH)
    theta, end = found.theta, found.end
    by_tau = np.stack([np.ones_like(theta[0]), 1 / theta[1], 1 / theta[2]], axis=1)
    normal = end.curvature * 0.5 * (by_tau[:, :, None] * by_tau[:, None, :])
    scale = np.sqrt(np.maximum(np.einsum("lii->li", normal), 1e-200))
    outer = scale[:, :, None] * scale[:, None, :]
    return LevelCurves(
        theta,
        end.cost - TRUST * end.predicted,
        normal,
        np.linalg.inv(normal / outer + 1e-9 * np.eye(3)) / outer,
    )


def polynomial_starts(curves: LevelCurves, basis: Basis, problem: Problem) -> Iterator[Array]:
    """Feasible starts from the curves of single levels, the most promising first, made as they are asked for.

    Polynomials pass through τ1, τ2, T_s of the levels: weighted by their own precision, then each level alike. The last
    start has the weighted means of τ1 and τ2 at every level; it lies inside the constraints, and the others are brought
    there from outside.
    """
    precision = 1 / np.sqrt(np.einsum("lii->li", curves.covariance))
    shaped = _through(curves, basis, precision)
    if feasible := bool((problem.A @ shaped >= problem.b).all()):
        yield shaped
    level_means = np.where(np.arange(basis.size) < basis.slices[1].start, shaped, 0.0)
    for k, part in enumerate(basis.slices[1:], 1):
        level_means[part.start] = np.average(curves.theta[k], weights=precision[:, k] ** 2)
    if basis.free_share:
        level_means[-1] = shaped[-1]
    tau1, tau2 = basis.slices[1].start, basis.slices[2].start
    level_means[tau1] = max(level_means[tau1], 2 * TAU_FLOOR_S)
    level_means[tau2] = max(level_means[tau2], 1.5 * level_means[tau1])
    flat = _above_zero(level_means, basis, problem)
    if not feasible:
        yield bring_in(shaped, flat, problem)
    yield bring_in(_through(curves, basis, np.ones_like(precision)), flat, problem)
    yield flat


def _through(curves: LevelCurves, basis: Basis, precision: Array) -> Array:
    """The polynomials nearest to T_s, τ1 and τ2 of the levels, each level weighted by its precision, (L, 3)."""
    x = np.full(basis.size, curves.theta[3, 0])  # where C is free, the last is C
    for k, part in enumerate(basis.slices):
        p = precision[:, k]
        x[part] = np.linalg.lstsq(basis.M[k, :, part] * p[:, None], curves.theta[k] * p, rcond=None)[0]
    return x


def _above_zero(x: Array, basis: Basis, problem: Problem) -> Array:
    """T_s drawn to its mean where its polynomial falls below 0, so that a point with constant τ is feasible."""
    x = x.copy()
    part = basis.slices[0]
    mean = np.zeros(part.stop)
    mean[0] = max(x[0], 1e-12)
    inner = x.copy()
    inner[part] = mean
    return draw_in(x, inner, problem)


def no_lower_minimum(curves: LevelCurves, cost: float, data: Data, basis: Basis, problem: Problem) -> bool:
    """Whether no other minimum can lie below `cost`: then every level is known so well that its cost is a bowl.

    In a better joint curve the levels lie above their own least costs by no more than `spare`, all together. A level is
    narrow where its cost has risen by as much at the edge of the ellipsoid that reaches `NARROW` in ln τ. The narrow
    ones leave the polynomials an ellipsoid too; levels that it reaches less than `NARROW` of are narrow with them.
    """
    spare = cost - float(curves.cost.sum()) + problem.floor
    if spare < 0:
        return False  # the levels' own curves are not the best there are
    kept, rise = _edges(curves, data)
    narrow = rise >= spare
    if narrow.all():
        return True
    rows = basis.M[:3].transpose(1, 0, 2)  # (L, 3, n)
    weighted = kept[:, None, None] * curves.normal @ rows
    while narrow.sum() >= max(basis.degrees) + 1 and not narrow.all():
        A, J = weighted[narrow].reshape(-1, basis.size), rows[narrow].reshape(-1, basis.size)
        H = J.T @ A
        x = np.linalg.lstsq(H, A.T @ curves.theta[:3, narrow].T.ravel(), rcond=None)[0]
        off = curves.theta[:3].T - rows @ x
        left = spare - float((kept[:, None] * off * (curves.normal @ off[:, :, None])[:, :, 0])[narrow].sum())
        scale = np.sqrt(np.maximum(np.diagonal(H), 1e-200))
        spread = rows[:, 1:] / scale @ np.linalg.inv(H / scale / scale[:, None] + 1e-12 * np.eye(len(H)))
        reach = np.sqrt(max(left, 0.0) * np.maximum((spread * rows[:, 1:] / scale).sum(axis=2), 0.0))
        reached = (reach < NARROW * (rows @ x)[:, 1:]).all(axis=1)
        if not (reached & ~narrow).any():
            break
        narrow |= reached
    return bool(narrow.all())


def _edges(curves: LevelCurves, data: Data) -> tuple[Array, Array]:
    """How far the cost rises to the edge of each level's ellipsoid that reaches `NARROW` in ln τ, (L,).

    In front of it, what part of the parabola's rise that is, 0 to 1, (L,): the cost is no parabola.
    """
    variance = np.einsum("lii->li", curves.covariance)[:, 1:]
    which = 1 + (variance / curves.theta[1:3].T ** 2).argmax(axis=1)
    every = np.arange(len(which))
    width = NARROW * curves.theta[which, every] / variance[every, which - 1]
    way = np.zeros_like(curves.theta)
    way[:3] = curves.covariance[every, :, which].T * width
    ends = level_costs(np.stack([curves.theta + way, curves.theta - way], axis=1), data.points)
    rise = ends.min(axis=0) - curves.cost
    parabola = NARROW * curves.theta[which, every] * width
    return np.clip(rise / parabola, 0.0, 1.0), rise
