"""Fits to steps from rest: one problem for the joint fit, the linear model, and levels first.

    cost   Σ_l w_l Σ_t (T_l φ(t; τ1, τ2, C) − ȳ_l(t))²,   φ = 1 − C e^(−t/τ1) − (1 − C) e^(−t/τ2),  Eq. (3)

θ_l = (T_s, τ1, τ2, C) of a level is linear in the unknowns of a model, θ_l = M_l x. Where T_s is none of them it is
solved for at each level (variable projection, Kaufman's curvature).

Levels first is the estimate that is believed: T_s of each level solved for, so that scatter of a level's gain does not
reach τ1(u) and τ2(u), and w_l = 1/(T_l² + s_l²), s_l the rms residual, for runs scatter by a part of their output.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from eaid.arrays import Array, lowest_places, scaled_inverse
from eaid.estimate.data import Data
from eaid.estimate.forms import Constraints, Model, linear, nonlinear
from eaid.estimate.points import Normal, level_normal, level_residuals
from eaid.estimate.solver import (
    ROUNDING,
    SOLVE_SETTLED,
    EndPoint,
    Problem,
    approach,
    bring_in,
    polish,
    slsqp,
    solve_ends,
    solver_verdict,
    with_second_derivatives,
)
from eaid.estimate.spread import textbook
from eaid.estimate.starts import form_starts, touching_starts
from eaid.plant.dynamics import TAU_FLOOR_S, Plant
from eaid.results.common import Solver

A0_GRID = 16  # Time constants on the starting grid of the linear model
A0_STARTS = 3  # Starts from it
ENDLESS_RECORDS = 10.0  # Records from which a τ2 may as well have no end
MET = 1.01  # τ2 over τ1 where one lag is looked for
CHI2_APART = 20.0  # χ² by which two ends must differ to be told apart
WEIGHED = 10  # Rounds of weights, at most
UNSEEN_PART = 1e-10  # Directions that the data do not see have this part of the information at most
SAME_WEIGHT = 1e-10  # Weights that change by less than this part of the largest have settled


def torques(square: Array, along: Array) -> Array:
    """T_s of levels from Σ w φ² and Σ w φ y of each."""
    return np.maximum(along, 0.0) / np.maximum(square, 1e-300)


@dataclass(frozen=True, eq=False)
class StepProblem:
    """What a model costs on the mean curves of L levels."""

    data: Data
    model: Model
    weight: Array  # w of each level, (L,)
    shares: Array | None = None  # C of each level, where they differ, (L,)

    @cached_property
    def M(self) -> Array:
        """∂θ/∂x, (4, L, n)."""
        return self.model.rows(self.data.u)

    def at(self, x: Array) -> Normal:
        """The levels' curves and their sums, not weighted."""
        theta = self.model.theta(x, self.M)
        if self.shares is not None:
            theta[3] = self.shares
        return level_normal(theta, self.data.points, torques if self.model.Ts is None else None)

    def normal(self, x: Array) -> tuple[float, Array, Array]:
        """Cost, gradient (n,) and Gauss–Newton curvature (n, n)."""
        at = self.at(x)
        score, information = self.weight[:, None] * at.score, self.weight[:, None, None] * at.information
        M = self.M.transpose(1, 0, 2)
        if self.model.Ts is None:
            (score, information), M = self.reduced(at), M[:, 1:]
        flat = np.ascontiguousarray(M).reshape(-1, M.shape[2])
        curvature = flat.T @ (information @ M).reshape(flat.shape)
        return float(self.weight @ at.cost), 2 * (score.ravel() @ flat), 2 * curvature

    def reduced(self, at: Normal) -> tuple[Array, Array]:
        """Weighted scores, (L, 3), and information on τ1, τ2, C with what each T_s can follow taken out, (L, 3, 3)."""
        A, square = at.information, np.maximum(at.information[:, 0, 0], 1e-300)
        inner = A[:, 1:, 1:] - A[:, 1:, :1] * A[:, :1, 1:] / square[:, None, None]
        return self.weight[:, None] * at.score[:, 1:], self.weight[:, None, None] * inner

    @cached_property
    def limits(self) -> Constraints:
        """Its constraints."""
        return self.model.limits(self.data.longest_s, self.data.shortest_s)

    @cached_property
    def problem(self) -> Problem:
        """For the solver."""
        points, limits = self.data.points, self.limits
        floor = ROUNDING * float((self.weight[:, None] * points.w * points.y**2).sum())
        problem = Problem(self.normal, limits.A, limits.b, limits.codes.__getitem__, floor=floor)
        return with_second_derivatives(problem)

    @property
    def inner(self) -> Array:
        """A feasible point: short constant τ."""
        x = np.zeros(self.model.size)
        sizes = (max(float(self.data.points.y.max()), 1e-12), 2 * TAU_FLOOR_S, 4 * TAU_FLOOR_S)
        for part, size in zip(self.model.slices, sizes, strict=True):
            x[part][:1] = size
        if self.model.free_share:
            x[-1] = 0.5
        return x

    def weighed(self, x: Array) -> "StepProblem":
        """The same with w = 1/(T_s² + s²) at x; none for a level that is 0 throughout."""
        at = self.at(x)
        size = at.theta[0] ** 2 + at.cost / self.data.points.w.sum(axis=1)
        known = size > 1e-24 * size.max(initial=0.0)
        return replace(self, weight=np.where(known, 1 / np.where(known, size, 1.0), 0.0))


@dataclass(frozen=True, eq=False)
class Solution:
    """Where a fit ended, and the verdict."""

    steps: StepProblem
    x: Array
    solver: Solver
    active: tuple[int, ...] = ()  # Constraints that hold it

    @cached_property
    def at(self) -> Normal:
        """The levels' curves and their sums."""
        return self.steps.at(self.x)

    @property
    def parameters(self) -> Plant:
        """Of a model whose T_s is a polynomial, in the units of specification 1."""
        return self.steps.model.parameters(self.x)

    @property
    def held(self) -> dict[str, tuple[float, ...]]:
        """The constraints that hold it, and the inputs at which they do."""
        return self.steps.limits.active(self.active)

    def residuals(self, data: Data) -> list[Array]:
        """f − y at every sample of each level, shapes (n_l,)."""
        return level_residuals(self.at.theta, data.records)


def fit_nonlinear(data: Data, share: float | None) -> Solution:
    """The joint fit of the paper: ten coefficients by least squares, each sample of the mean curves alike."""
    steps = StepProblem(data, nonlinear(data.u, share), np.ones(len(data.u)))
    starts = form_starts(steps.model, data, steps.weight)
    begin = [*starts, *touching_starts(starts[0], steps.model, data, steps.weight)]
    begin = [bring_in(x, steps.inner, steps.problem) for x in begin]
    return minimise(steps, begin)


def refit_nonlinear(data: Data, near: Solution) -> Solution:
    """The minimum next to an earlier one, on data that differ little: one start, no search."""
    steps = replace(near.steps, data=data)
    slack = steps.problem.A @ near.x - steps.problem.b
    problem = replace(steps.problem, b=steps.problem.b + np.minimum(slack, 0.0))  # what rounding left outside
    return _conclude(steps, [slsqp(problem, approach(problem, near.x))])


def textbook_covariance(data: Data, model: Model, x: Array) -> tuple[Array, float]:
    """s² (J'J)⁻¹ of a model's unknowns, as if every sample's error were its own, and N − P."""
    M = model.rows(data.u)
    theta = model.theta(x, M)
    noise, spare = textbook(level_residuals(theta, data.records), len(x))
    curvature = np.einsum("kln,lkj,jlm->nm", M, level_normal(theta, data.points).information, M)
    return scaled_inverse(curvature, UNSEEN_PART) * noise, spare


def fit_linear(data: Data) -> Solution:
    """Eq. (8) fitted to all levels at once: x are coefficients of the gain, then τ = 1/a0; c0 of a single one is 0."""
    model, alike = linear(data.u), np.ones(len(data.u))
    assert model.Ts is not None
    steps, each = StepProblem(data, model, alike), StepProblem(data, replace(model, Ts=None), alike)
    grid = np.geomspace(0.3 * data.shortest_s, 3 * data.longest_s, A0_GRID)
    gains = np.linalg.pinv(model.Ts.rows(data.u))
    starts = [np.append(gains @ each.at(np.array([tau])).theta[0], tau) for tau in grid]
    costs = np.array([steps.normal(x)[0] for x in starts])
    return minimise(steps, [starts[k] for k in lowest_places(costs)[:A0_STARTS]])


def fit_levels_first(
    data: Data, share: float | None, starts: Sequence[Array] | None = None, form: Model | None = None
) -> Solution:
    """T_s of each level, τ1(u), τ2(u), of the nonlinear model or another form, from `starts` or those of a search."""
    model = form or replace(nonlinear(data.u, share), Ts=None)
    steps = StepProblem(data, model, 1 / np.maximum((data.points.y**2).max(axis=1), 1e-300))
    if starts is None:
        starts = form_starts(model, data, steps.weight)
    begin = [bring_in(x, steps.inner, steps.problem) for x in starts]
    if not data.points.y.any():
        return Solution(replace(steps, weight=np.zeros(len(data.u))), begin[0], solver_verdict(0.0, 0, (0.0,)))
    steps = steps.weighed(min(begin, key=lambda x: steps.normal(x)[0]))
    ends = [approach(steps.problem, x) for x in begin]
    if len(ends) > 1:
        ends = solve_ends(ends, steps.problem)
    end = _without_endless(steps, min(ends, key=lambda end: end.cost))
    for _ in range(WEIGHED):
        before, steps = steps, steps.weighed(end.x)
        if np.abs(steps.weight - before.weight).max() <= SAME_WEIGHT * before.weight.max():
            break
        end = approach(steps.problem, end.x, near=SOLVE_SETTLED)
    return _conclude(steps, [slsqp(steps.problem, end)])


def _without_endless(steps: StepProblem, end: EndPoint, records: float = ENDLESS_RECORDS) -> EndPoint:
    """The end of a fit; where its τ2 lies `records` beyond the longest and one lag explains as much, that: what has one
    time constant is explained as well by a slow part that never comes, and a T_s larger by what it hides."""
    one, two, model = steps.model.slices[1], steps.model.slices[2], steps.model
    if model.tau2 is None or (model.tau2.rows(steps.data.u) @ end.x[two]).max() < records * steps.data.longest_s:
        return end
    met = end.x.copy()
    met[two] = 0.0
    met[two][: one.stop - one.start] = MET * met[one]
    other = approach(steps.problem, bring_in(met, steps.inner, steps.problem))
    points = steps.weight @ (steps.data.points.w > 0).sum(axis=1) / steps.weight.max()  # as many of equal weight
    return other if other.cost <= (1 + CHI2_APART / points) * end.cost + steps.problem.floor else end


def minimise(steps: StepProblem, starts: Iterable[Array], records: float = np.inf) -> Solution:
    """The least of what feasible starts lead to; a τ2 beyond so many records has to explain more than one lag does."""
    ends = solve_ends([approach(steps.problem, x) for x in starts], steps.problem)
    return _conclude(steps, [_without_endless(steps, end, records) for end in ends])


def _conclude(steps: StepProblem, ends: Sequence[EndPoint]) -> Solution:
    """The best end, polished, with our verdict."""
    best = min(ends, key=lambda end: end.cost)
    end, predicted, active = polish(steps.problem, best)
    evaluations = sum(one.evaluations for one in ends) + end.evaluations - best.evaluations
    costs = [end.cost if one is best else one.cost for one in ends]
    return Solution(
        steps, end.x, solver_verdict(predicted, evaluations, costs, map(steps.problem.names, active)), active
    )
