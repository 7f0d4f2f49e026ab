"""The nonlinear clutch model, Eqs. (4)–(7): ten coefficients of τ1(u), τ2(u), T_s(u) fitted together.

The chain rule takes each level's sums to the unknowns of `basis`. The first start comes from the curves of single
levels. Where no other minimum can lie as low as its end (`no_lower_minimum`), that is all; else there is a second, and
where the data still leave room, many more are looked at together (`joint_starts`).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import msgspec
import numpy as np

from eaid.arrays import Array
from eaid.findings import Finding
from eaid.fitting import metrics, robust
from eaid.fitting.basis import Basis, active_at, basis_of, constraints
from eaid.fitting.data import Data
from eaid.fitting.findings import missed, nonlinear_findings
from eaid.fitting.joint_starts import broad_starts
from eaid.fitting.kernel import by_tau, level_normal, log_curvature, log_products, weighted_shares
from eaid.fitting.level_curves import level_curves, no_lower_minimum, polynomial_starts
from eaid.fitting.levels import SHARES
from eaid.fitting.problem import ROUNDING, Problem
from eaid.fitting.samples import residuals
from eaid.fitting.solver import EndPoint, approach, ended, slsqp
from eaid.fitting.verdict import concluded
from eaid.models import nonlinear as model
from eaid.models.parameters import Nonlinear as NonlinearModel
from eaid.results.common import Solver
from eaid.results.fit import FitOptions
from eaid.results.nonlinear import Estimate, Nonlinear
from eaid.steps.stepset import Level


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
    found = nonlinear_findings(p, solution.solver, solution.active, [level.level for level in held_out])
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
