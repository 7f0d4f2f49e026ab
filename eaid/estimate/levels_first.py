"""The estimate that is believed: one free T_s per level, polynomials τ1(u) and τ2(u); then T_s(u) through the levels.

The cost is Σ_l w_l Σ_t (T_l φ(t; τ1(u_l), τ2(u_l), C) − ȳ_l(t))², φ = 1 − C e^(−t/τ1) − (1 − C) e^(−t/τ2), Eqs. (3) to
(6), with w_l = 1/(T_l² + s_l²), s_l the rms residual: runs scatter by a part of their output, so levels count by it.
T_l is linear and solved for (variable projection), so that scatter of a level's gain does not reach the time constants,
as it does where T_s(u) is fitted together with them. Eq. (7) passes through T_l by least squares of relative errors.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from eaid.arrays import Array
from eaid.estimate.basis import Basis, basis_of, constraints
from eaid.estimate.data import Data
from eaid.estimate.solver import ROUNDING, Problem, approach, concluded, draw_in, ended, judged, slsqp
from eaid.estimate.starts import Indices, form_starts
from eaid.models.parameters import TAU_FLOOR_S
from eaid.results.common import Solver

SHIFT = 1e-5
"""Relative step of the differences that second derivatives come from."""


@dataclass(frozen=True, eq=False)
class Shape:
    """φ of every level and its slopes by τ1, τ2, C at the points, with the best T_s."""

    x: Array
    phi: Array
    """(L, P)."""
    slopes: Array
    """∂φ/∂(τ1, τ2, C), (L, 3, P)."""
    Ts: Array
    """(L,)."""
    left: Array
    """T_s φ − ȳ, (L, P)."""


@dataclass(frozen=True, eq=False)
class LevelsFirst:
    """The weighted problem in the coefficients of τ1(u), τ2(u), and C where it is free."""

    data: Data
    basis: Basis
    weight: Array
    """w of each level, (L,)."""

    @property
    def first(self) -> int:
        """Where the coefficients of τ1 begin among the unknowns of the basis."""
        return int(self.basis.slices[1].start)

    @property
    def rows(self) -> Array:
        """∂(τ1, τ2, C)/∂x at each level, (3, L, n)."""
        return self.basis.M[1:, :, self.first :]

    def values(self, x: Array) -> Array:
        """τ1, τ2, C of the levels, (3, L)."""
        theta = self.rows @ x
        np.maximum(theta[:2], 0.1 * TAU_FLOOR_S, out=theta[:2])  # SLSQP may look outside before it comes back
        theta[2] = np.clip(theta[2], 0.0, 1.0) if self.basis.free_share else self.basis.share
        return theta

    def shape(self, x: Array) -> Shape:
        """φ, its slopes and the best T_s at x."""
        points = self.data.points
        tau1, tau2, share = self.values(x)[:, :, None]
        e1, e2 = np.exp(-points.t_s / tau1), np.exp(-points.t_s / tau2)
        phi = 1 - share * e1 - (1 - share) * e2
        by = (-share * points.t_s * e1 / tau1**2, -(1 - share) * points.t_s * e2 / tau2**2, e2 - e1)
        weighed = phi * points.w
        Ts = np.maximum((weighed * points.y).sum(axis=1), 0.0) / np.maximum((weighed * phi).sum(axis=1), 1e-300)
        return Shape(x, phi, np.stack(by, axis=1), Ts, Ts[:, None] * phi - points.y)

    def normal(self, x: Array) -> tuple[float, Array, Array]:
        """Cost, gradient and Gauss–Newton curvature (Kaufman), T_s of the levels solved for."""
        at, w = self.shape(x), self.data.points.w
        by_level, information = self.reduced(at)
        gradient = 2 * np.einsum("lk,kln->n", by_level, self.rows)
        cost = float((self.weight[:, None] * w * at.left**2).sum())
        return cost, gradient, 2 * np.einsum("kln,lkj,jlm->nm", self.rows, information, self.rows)

    def reduced(self, at: Shape) -> tuple[Array, Array]:
        """w T φ_k'r, (L, 3), and w T² φ_k'φ_j with what T_s can follow taken out, (L, 3, 3), of each level."""
        weighed = at.slopes * self.data.points.w[:, None]
        along = (weighed * at.phi[:, None]).sum(axis=2)
        square = np.maximum((at.phi**2 * self.data.points.w).sum(axis=1), 1e-300)
        inner = weighed @ at.slopes.transpose(0, 2, 1) - along[:, :, None] * along[:, None] / square[:, None, None]
        scores = self.weight[:, None] * at.Ts[:, None] * (weighed * at.left[:, None]).sum(axis=2)
        return scores, (self.weight * at.Ts**2)[:, None, None] * inner

    @property
    def kept(self) -> Indices:
        """The constraints of the basis that say nothing of T_s."""
        return np.flatnonzero(~constraints(self.basis, self.data.longest_s)[0][:, : self.first].any(axis=1))

    def problem(self) -> Problem:
        """The same with τ1 ≥ 1 ms and τ2 ≥ τ1 at 101 inputs, an end of τ2, and 0 ≤ C ≤ 1."""
        A, b, names = constraints(self.basis, self.data.longest_s)
        kept, points = self.kept, self.data.points
        floor = ROUNDING * float((self.weight[:, None] * points.w * points.y**2).sum())
        return Problem(self.normal, A[kept][:, self.first :], b[kept], lambda i: names(int(kept[i])), self.exact, floor)

    def exact(self, x: Array) -> Array:
        """Second derivatives of the cost, by differences of its exact gradient, (n, n)."""
        steps = SHIFT * np.diag(np.maximum(np.abs(x), 1e-3))
        rows = [(self.normal(x + h)[1] - self.normal(x - h)[1]) / (2 * h.sum()) for h in steps]
        return np.asarray(0.5 * (np.array(rows) + np.array(rows).T))

    def weighed(self, x: Array) -> "LevelsFirst":
        """The same with the weights that the levels have at x; none for a level that is 0 throughout."""
        at, w = self.shape(x), np.broadcast_to(self.data.points.w, self.data.points.y.shape)
        size = at.Ts**2 + (w * at.left**2).sum(axis=1) / w.sum(axis=1)
        known = size > 1e-24 * size.max(initial=0.0)
        return replace(self, weight=np.where(known, 1 / np.where(known, size, 1.0), 0.0))


def solve(
    data: Data, share: float | None, starts: Sequence[Array] | None = None
) -> tuple[LevelsFirst, Array, Solver, list[int]]:
    """The weighted problem, its solution x, our verdict, and the constraints that hold it.

    `starts` are coefficients of τ1(u), τ2(u), and C where it is free, to begin from; by default those of a search.
    """
    basis = basis_of(data.u, share)
    start = LevelsFirst(data, basis, 1 / np.maximum((data.points.y**2).max(axis=1), 1e-300))
    inner = np.zeros(basis.size - start.first)
    inner[0], inner[basis.slices[2].start - start.first] = 2 * TAU_FLOOR_S, 4 * TAU_FLOOR_S
    inner[-1] = 0.5 if basis.free_share else inner[-1]
    whole = start.problem()
    if starts is None:
        starts = [x[start.first :] for x in form_starts(basis, data, start.weight)]
    begin = [draw_in(x, inner, whole) for x in starts]
    if data.energy == 0.0:
        return replace(start, weight=np.zeros(len(data.u))), begin[0], judged(0.0, 0, (0.0,)), []
    weighed = start.weighed(min(begin, key=lambda x: start.normal(x)[0]))
    problem = weighed.problem()
    ends = ended([approach(problem, x) for x in begin], problem)
    weighed = weighed.weighed(min(ends, key=lambda end: end.cost).x)
    problem = weighed.problem()
    last = [slsqp(problem, min(ends, key=lambda end: end.cost).x)]
    end, solver, active = concluded(problem, last)
    return weighed, end.x, solver, list(active)
