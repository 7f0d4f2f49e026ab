"""The nonlinear clutch model, Eqs. (4)–(7): ten coefficients of τ1(u), τ2(u), T_s(u) fitted together.

The chain rule takes each level's sums to the unknowns of `basis`. The first start comes from the curves of single
levels. Where no other minimum can lie as low as its end (`no_lower_minimum`), that is all; else there is a second, and
where the data still leave room, many more are looked at together (`joint_starts`).
"""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import msgspec
import numpy as np

from eaid.arrays import Array
from eaid.findings import Finding
from eaid.fitting import data as metrics
from eaid.fitting import robust
from eaid.fitting.basis import Basis, active_at, basis_of, constraints
from eaid.fitting.data import Data, fit_findings, missed
from eaid.fitting.levels import SHARES, TRUST, starting_curves
from eaid.fitting.solver import (
    ROUNDING,
    EndPoint,
    Look,
    Problem,
    approach,
    bring_in,
    concluded,
    descend,
    draw_in,
    ended,
    slsqp,
    solved,
)
from eaid.fitting.sums import by_tau, level_costs, level_normal, log_curvature, log_products, residuals, weighted_shares
from eaid.models import nonlinear as model
from eaid.models.nonlinear import CHECKED_DUTIES
from eaid.models.parameters import TAU_FLOOR_S
from eaid.models.parameters import Nonlinear as NonlinearModel
from eaid.options import FitOptions
from eaid.results.common import Solver
from eaid.results.fit import Estimate, Nonlinear
from eaid.steps.stepset import Level

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


def nonlinear_problem(data: Data, basis: Basis) -> Problem:
    """The ten coefficients on the compressed points; the levels of `data` are those of the basis."""
    M, points = basis.M, data.points
    known = 4 if basis.free_share else 3  # how many of T_s, τ1, τ2, C move
    flat = M[:known].reshape(-1, basis.size)
    by_level = np.ascontiguousarray(M[:known].transpose(1, 0, 2))
    shares = weighted_shares(np.array([basis.share]), points)

    def sums(x: Array) -> tuple[Array, Array, Array]:
        theta = basis.theta(x, M)
        return level_normal(theta, points) if basis.free_share else by_tau(theta, log_products(theta, shares, points))

    def chained(curvature: Array) -> Array:
        half = curvature @ by_level
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
        return float(cost.sum()), gradient.ravel() @ flat, chained(curvature)

    A, b, names = constraints(basis, data.longest_s)
    return Problem(normal, A, b, names, None if basis.free_share else exact, ROUNDING * data.energy)


@dataclass(frozen=True, eq=False)
class Solution:
    """The fitted coefficients, their cost on the full data, and the verdict."""

    basis: Basis
    x: Array
    cost: float
    solver: Solver
    active: dict[str, tuple[float, ...]]
    """The constraints that hold it, and the inputs at which they do."""

    @property
    def parameters(self) -> NonlinearModel:
        """The model in the units of specification 1."""
        return self.basis.parameters(self.x)


def full_residuals(solved: Solution, data: Data) -> list[Array]:
    """f − y at every sample of each level, shapes (n_l,)."""
    return residuals(solved.basis.theta(solved.x, solved.basis.rows(data.u)), data.records)


def fit_nonlinear(data: Data, share: float | None) -> Solution:
    """The least-squares coefficients under the constraints."""
    basis = basis_of(data.u, share)
    problem = nonlinear_problem(data, basis)
    by_share = [level_curves(data, c) for c in (SHARES if share is None else (share,))]
    begin = [polynomial_starts(curves, basis, problem) for curves in by_share]
    first = next(begin[0])

    def proven() -> bool:
        return share is not None and no_lower_minimum(by_share[0], min(end.cost for end in ends), data, basis, problem)

    ends = [approach(problem, first)]
    if not proven():
        *near, flat = begin[0]
        others = [list(more) for more in begin[1:]]
        near += [start for more in others for start in more[:-1]]
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
        return float(cost.sum()), gradient.ravel() @ M.reshape(-1, basis.size)

    end, solver, active = concluded(problem, ends, full)
    return Solution(basis, end.x, end.cost, solver, active_at(basis, active))


def nonlinear_fit(data: Data, options: FitOptions, held_out: Sequence[Level] = ()) -> tuple[Nonlinear, list[Finding]]:
    """The joint estimate with its errors, and what is to be doubted of it."""
    solution, huber = robust.minimise(
        data, options.loss, lambda d: fit_nonlinear(d, options.held_share), refit_nonlinear, full_residuals
    )
    p, left = solution.parameters, full_residuals(solution, data)
    one = msgspec.structs.replace(estimate(p, data, left, solution.solver, held_out), C_free=options.held_share is None)
    found = fit_findings(p, solution.solver, solution.active, [level.level for level in held_out])
    found += robust.huber_findings("nonlinear", huber)
    found += missed("nonlinear", data, left, one)
    return Nonlinear.of(one, robust=huber), found


def estimate(
    p: NonlinearModel, data: Data, residuals: Sequence[Array], solver: Solver, held_out: Sequence[Level] = ()
) -> Estimate:
    """Ten coefficients with their errors per level, over all, and on held-out levels."""
    outputs = [record.y for record in data.records]
    total = metrics.errors(outputs, residuals)
    rows = [metrics.errors([y], [r]).at(u) for u, y, r in zip(data.u.tolist(), outputs, residuals, strict=True)]
    return Estimate(
        tau1=p.tau1,  # type: ignore[arg-type]  # padded with zeros to the paper's degrees
        tau2=p.tau2,  # type: ignore[arg-type]
        Ts=p.Ts,  # type: ignore[arg-type]
        u_range=p.u_range,
        C=p.C,
        rmse=total.rmse,
        sse=total.sse,
        abs_error=total.abs_error,
        fit_pct=total.fit_pct,
        R2=total.R2,
        per_level=tuple(rows),
        solver=solver,
        hold_out=metrics.hold_out(
            held_out, lambda level: model.step_response(p, level.time_s, level.level), total.rmse
        ),
    )
