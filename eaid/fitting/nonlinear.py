"""The nonlinear clutch model, Eqs. (4)–(7): ten coefficients of τ1(u), τ2(u), T_s(u) fitted together.

The unknowns are Legendre coefficients over the fitted levels; the chain rule takes each level's sums to them.
Constraints, SPEC §3, at 101 equally spaced duties from the lowest to the highest level: τ1 ≥ 1 ms, τ2 ≥ τ1, T_s ≥ 0.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import legendre, polynomial

from eaid.arrays import Array
from eaid.fitting.data import Data
from eaid.fitting.kernel import full_sums, level_curvature, level_sums
from eaid.fitting.levels import RECORDS, RECORDS_FREE, SHARES, TAU1_LEAST_S, starting_curves, verdict
from eaid.fitting.result import Solver
from eaid.fitting.solver import PROMISE, ROUNDING, EndPoint, Problem, newton_step, polish, slsqp
from eaid.models.parameters import Nonlinear

DUTIES = 101
"""Duties at which the constraints hold."""
DEGREES = (3, 2, 2)
"""Degrees of T_s, τ1, τ2."""


@dataclass(frozen=True, eq=False)
class Basis:
    """The map between the unknowns x and θ = (T_s, τ1, τ2, C) of each level: θ = M x + k."""

    degrees: tuple[int, int, int]
    """Of T_s, τ1, τ2; below (3, 2, 2) where the levels are too few."""
    lowest: float
    highest: float
    free_share: bool
    share: float

    @property
    def slices(self) -> tuple[slice, slice, slice]:
        """Where the coefficients of T_s, τ1, τ2 lie in x."""
        a, b, c = (degree + 1 for degree in self.degrees)
        return slice(0, a), slice(a, a + b), slice(a + b, a + b + c)

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return sum(self.degrees) + 3 + int(self.free_share)

    def scaled(self, u: Array) -> Array:
        """Duty mapped to −1…1 over the fitted levels."""
        half = 0.5 * (self.highest - self.lowest)
        return (np.asarray(u) - 0.5 * (self.highest + self.lowest)) / (half if half else 1.0)

    def rows(self, u: Array) -> Array:
        """M for some duties, shape (4, len(u), n); the row of C is its own unknown, or 0."""
        M = np.zeros((4, len(u), self.size))
        for k, (degree, part) in enumerate(zip(self.degrees, self.slices, strict=True)):
            M[k, :, part] = legendre.legvander(self.scaled(u), degree)
        if self.free_share:
            M[3, :, -1] = 1.0
        return M

    def parameters(self, x: Array) -> Nonlinear:
        """The polynomials in powers of the duty, lowest first, padded with zeros to the paper's degrees."""
        half = 0.5 * (self.highest - self.lowest) or 1.0
        line = np.array([-0.5 * (self.highest + self.lowest) / half, 1.0 / half])
        found = []
        for part, degree in zip(self.slices, DEGREES, strict=True):
            inner = legendre.leg2poly(x[part])
            powers = np.zeros(degree + 1)
            total: Array = np.zeros(1)
            term: Array = np.ones(1)
            for coefficient in inner:
                total = np.asarray(polynomial.polyadd(total, coefficient * term), dtype=np.float64)
                term = np.asarray(polynomial.polymul(term, line), dtype=np.float64)
            powers[: len(total)] = total
            found.append(tuple(powers.tolist()))
        Ts, tau1, tau2 = found
        share = float(x[-1]) if self.free_share else self.share
        return Nonlinear(tau1, tau2, Ts, (self.lowest, self.highest), share)

    def unknowns(self, p: Nonlinear) -> Array:
        """x of a model, by interpolation at as many duties as it has coefficients."""
        x = np.zeros(self.size)
        for part, degree, coefficients in zip(self.slices, self.degrees, (p.Ts, p.tau1, p.tau2), strict=True):
            at = np.linspace(self.lowest, self.highest, degree + 1)
            values = polynomial.polyval(at, np.array(coefficients))
            x[part] = np.linalg.solve(legendre.legvander(self.scaled(at), degree), values)
        if self.free_share:
            x[-1] = p.C
        return x


def basis_of(u: Array, share: float | None) -> Basis:
    """The basis that these levels allow: a polynomial has at most as many coefficients as there are levels."""
    most = len(np.unique(u)) - 1
    a, b, c = (min(degree, most) for degree in DEGREES)
    return Basis((a, b, c), float(u.min()), float(u.max()), share is None, 0.85 if share is None else share)


def nonlinear_problem(data: Data, basis: Basis) -> Problem:
    """The ten coefficients on the compressed points."""
    M = basis.rows(data.u)
    constant = np.zeros((4, 1))
    constant[3] = 0.0 if basis.free_share else basis.share
    weights = data.weights

    def value(x: Array) -> tuple[float, Array]:
        theta = _guarded(M @ x + constant)
        cost, gradient = level_sums(theta, data.points)
        return float(weights @ cost), np.tensordot(gradient * weights, M, 2)

    def chained(curvature: Array) -> Array:
        return np.asarray(np.einsum("alm,lab,bln->mn", M, curvature * weights[:, None, None], M, optimize=True))

    def gauss_newton(x: Array) -> Array:
        return chained(level_curvature(_guarded(M @ x + constant), data.points))

    def exact(x: Array) -> Array:
        return chained(level_curvature(_guarded(M @ x + constant), data.points, exact=True))

    A, b, names = constraints(basis, data.longest_s)
    return Problem(value, gauss_newton, A, b, names, exact, ROUNDING * data.energy)


def _guarded(theta: Array) -> Array:
    # Between the 101 duties a quadratic may dip a little below its floor; a level's τ is kept off zero there.
    theta[1:3] = np.maximum(theta[1:3], 0.1 * TAU1_LEAST_S)
    return theta


def constraints(basis: Basis, longest_s: float) -> tuple[Array, Array, tuple[str, ...]]:
    """A x ≥ b at the 101 duties, and what each row says; τ2 ends at `RECORDS` times the longest record."""
    limit = (RECORDS_FREE if basis.free_share else RECORDS) * longest_s
    at = np.linspace(basis.lowest, basis.highest, DUTIES if basis.highest > basis.lowest else 1)
    M = basis.rows(at)
    A = np.concatenate([M[1], M[2] - M[1], M[0], -M[2]])
    b = np.concatenate([np.full(len(at), TAU1_LEAST_S), np.zeros(2 * len(at)), np.full(len(at), -limit)])
    names = [f"{what} at input {u:g}" for what in ("τ1 = 1 ms", "τ2 = τ1", "T_s = 0", "τ2 endless") for u in at]
    if basis.free_share:
        row = np.zeros((2, basis.size))
        row[0, -1], row[1, -1] = 1.0, -1.0
        A, b = np.vstack([A, row]), np.concatenate([b, [0.0, -1.0]])
        names += ["C = 0", "C = 1"]
    return A, b, tuple(names)


def full_value(x: Array, data: Data, basis: Basis) -> tuple[float, Array, list[Array]]:
    """Cost and gradient over every sample, and the residuals of each level."""
    M = basis.rows(data.u)
    theta = M @ x
    if not basis.free_share:
        theta[3] = basis.share
    cost, gradient, residuals = full_sums(_guarded(theta), data.records)
    return float(data.weights @ cost), np.tensordot(gradient * data.weights, M, 2), residuals


def polynomial_starts(data: Data, basis: Basis, problem: Problem, share: float) -> list[Array]:
    """Feasible starts from the curves of single levels, the most promising first.

    τ1, τ2, T_s of each level are weighted by their own precision: polynomials through them; where a τ polynomial meets
    its bound it is drawn to the weighted mean. The second start has the means themselves.
    """
    theta = starting_curves(data, share)
    curvature = level_curvature(theta, data.points)[:, :3, :3] * data.weights[:, None, None]
    scale = np.sqrt(np.maximum(np.einsum("lii->li", curvature), 1e-300))
    inverse = np.linalg.inv(curvature / scale[:, :, None] / scale[:, None, :] + 1e-9 * np.eye(3))
    precision = scale / np.sqrt(np.einsum("lii->li", inverse))  # 1/sd of each value of each level, (L, 3)
    M = basis.rows(data.u)
    shaped, level_means = np.zeros(basis.size), np.zeros(basis.size)
    for k, part in enumerate(basis.slices):
        p = precision[:, k]
        rows = M[k, :, part]
        shaped[part] = np.linalg.lstsq(rows * p[:, None], theta[k] * p, rcond=None)[0]
        level_means[part.start] = float(p**2 @ theta[k] / (p**2).sum())
    level_means[basis.slices[0]] = shaped[basis.slices[0]]
    if basis.free_share:
        shaped[-1] = level_means[-1] = share
    tau1, tau2 = basis.slices[1].start, basis.slices[2].start
    level_means[tau1] = max(level_means[tau1], 2 * TAU1_LEAST_S)
    level_means[tau2] = max(level_means[tau2], 1.5 * level_means[tau1])
    flat = _above_zero(level_means, basis, problem)
    return [_feasible(shaped, flat, problem), flat]


def _above_zero(x: Array, basis: Basis, problem: Problem) -> Array:
    """T_s drawn to its mean where its polynomial falls below 0, so that a point with constant τ is feasible."""
    x = x.copy()
    part = basis.slices[0]
    mean = np.zeros(part.stop)
    mean[0] = max(x[0], 1e-12)
    inner = x.copy()
    inner[part] = mean
    return _feasible(x, inner, problem)


def _feasible(x: Array, inner: Array, problem: Problem) -> Array:
    """The point nearest to `x` on the line to a feasible `inner`, a little inside."""
    slack, own = problem.A @ x - problem.b, problem.A @ inner - problem.b
    out = slack < 0
    if not out.any():
        return x
    part = float(np.max(slack[out] / (slack[out] - np.maximum(own[out], 1e-300))))
    return x + min(1.0, 1.001 * part) * (inner - x)


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
    begin = [s for c in (SHARES if share is None else (share,)) for s in polynomial_starts(data, basis, problem, c)]
    begin += [_feasible(basis.unknowns(p), begin[1], problem) for p in starts]
    ends = [slsqp(problem, start) for start in begin]
    if _disputed(ends, problem):
        best = min(ends, key=lambda end: end.cost)
        ends += [slsqp(problem, start) for start in _around(best.x, begin[1], problem)]
    best = min(ends, key=lambda end: end.cost)

    def full(x: Array) -> tuple[float, Array]:
        cost, gradient, _ = full_value(x, data, basis)
        return cost, gradient

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
            at_bounds=tuple(problem.names[i] for i in active),
            promise=promise,
        ),
    )


def _disputed(ends: Sequence[EndPoint], problem: Problem) -> bool:
    """Whether more starts are called for: the first ones disagree, or the best of them lies at a constraint."""
    costs = [end.cost for end in ends]
    best = ends[int(np.argmin(costs))]
    if max(costs) - min(costs) > 1e-9 * max(min(costs), problem.floor):
        return True
    step = newton_step(problem, best.x, problem.value(best.x)[1], problem.curvature(best.x))
    return bool(step.active)


def _around(x: Array, inner: Array, problem: Problem) -> list[Array]:
    """Starts about a disputed end: towards the point with constant τ, and along the directions the data know least."""
    starts = [x + part * (inner - x) for part in (0.2, 0.5)]
    values, vectors = np.linalg.eigh(problem.curvature(x))
    for k in range(2):
        size = np.sqrt(problem.value(x)[0] * 1e-3 / max(values[k], 1e-300))
        starts += [_feasible(x + sign * size * vectors[:, k], inner, problem) for sign in (-1.0, 1.0)]
    return starts
