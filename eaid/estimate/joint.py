"""The nonlinear clutch model, Eqs. (4)–(7): ten coefficients of τ1(u), τ2(u), T_s(u) fitted together.

The chain rule takes each level's sums to the unknowns of `basis`. Costs are compared with each level's weight 1.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import msgspec
import numpy as np

from eaid.arrays import Array
from eaid.estimate import data as metrics
from eaid.estimate.basis import Basis, active_at, basis_of, constraints
from eaid.estimate.data import Data
from eaid.estimate.huber import minimise
from eaid.estimate.points import by_tau, level_normal, log_curvature, log_products, residuals, weighted_shares
from eaid.estimate.solver import ROUNDING, EndPoint, Problem, approach, bring_in, concluded, ended, slsqp
from eaid.estimate.starts import form_starts, touching_starts
from eaid.models import nonlinear as model
from eaid.models.parameters import TAU_FLOOR_S
from eaid.models.parameters import Nonlinear as NonlinearModel
from eaid.options import FitOptions
from eaid.results.common import Huber, Solver
from eaid.results.fit import Estimate
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
    """The fitted coefficients, and the verdict."""

    basis: Basis
    x: Array
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
    inner = np.zeros(basis.size)
    inner[0] = max(float(data.points.y.max()), 1e-12)
    inner[basis.slices[1].start], inner[basis.slices[2].start] = 2 * TAU_FLOOR_S, 4 * TAU_FLOOR_S
    inner[-1] = 0.5 if basis.free_share else inner[-1]
    alike = np.ones(len(data.u))
    found = form_starts(basis, data, alike)
    begin = [bring_in(x, inner, problem) for x in (*found, *touching_starts(found[0], basis, data, alike))]
    return _confirmed(ended([approach(problem, x) for x in begin], problem), basis, problem)


def refit_nonlinear(data: Data, near: Solution) -> Solution:
    """The minimum next to an earlier one, on data that differ little: one start, no search."""
    problem = nonlinear_problem(data, near.basis)
    return _confirmed([slsqp(problem, near.x)], near.basis, problem)


def _confirmed(ends: Sequence[EndPoint], basis: Basis, problem: Problem) -> Solution:
    """The best end, polished, with our verdict."""
    end, solver, active = concluded(problem, ends)
    return Solution(basis, end.x, solver, active_at(basis, active))


def joint_fit(
    data: Data, options: FitOptions, held_out: Sequence[Level] = ()
) -> tuple[Estimate, dict[str, tuple[float, ...]], Huber | None]:
    """The joint estimate with its errors, the constraints that hold it, and what Huber's loss held back."""
    solution, huber = minimise(
        data, options.loss, lambda d: fit_nonlinear(d, options.held_share), refit_nonlinear, full_residuals
    )
    left = full_residuals(solution, data)
    part = estimate(solution.parameters, data, left, solution.solver, held_out)
    return msgspec.structs.replace(part, C_free=options.held_share is None), solution.active, huber


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
