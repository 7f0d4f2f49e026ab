"""How sure the estimate of `levels_first` is: T_s(u) through the levels, and how every number answers to the runs.

Unknowns are T_s of the L levels and the coefficients x of τ1(u), τ2(u), C. Levels with repeats contribute their runs.
Levels of a single run contribute their own distance to the estimate, as clusters with scores corrected for their own
say (CR3), and to T_s(u) by the spread of the levels about it; where there are too few levels, the noise within the run.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
from scipy.special import fdtri

from eaid.arrays import Array
from eaid.estimate.basis import Basis, active_at
from eaid.estimate.data import Data
from eaid.estimate.levels_first import LevelsFirst, Shape, solve
from eaid.estimate.scatter import FEW_DEGREES, Scatter, bartlett_covariance, paule_mandel, run_residuals
from eaid.estimate.solver import Problem, newton_step
from eaid.estimate.spread import Counts, Influence, LevelScatter, corrected, free_inverse, gains_of, t_quantile
from eaid.models import friction
from eaid.models.parameters import Friction, Nonlinear
from eaid.results.common import Solver
from eaid.steps.stepset import Level

LEVELS_TO_SPARE = 2
"""Levels beyond the coefficients of T_s(u) from which single runs show their scatter in the levels' distance to it."""
USUAL = 0.03
"""Scatter of T_s from run to run [part of it] by which levels are weighed where none is seen."""
BEYOND_CHANCE = 0.999
"""Probability with which levels that lie on the curve are no further from it than this quantile of F."""
CURVED = 0.25
"""Half-width of ln τ2 from which the ends of a level's intervals are found by the score test."""
OUTWARD = (0.5, 0.8, 1.2, 1.8, 2.7, 4.0, 6.0)
"""How far out that looks, in half-widths."""
SAYS_NOTHING = float(np.log(100.0))
"""Logarithm of the factor up or down from which an interval is left out."""


@dataclass(frozen=True, eq=False)
class Estimate:
    """The solved estimate of L levels."""

    levels: Sequence[Level]
    problem: LevelsFirst
    x: Array
    """Coefficients of τ1(u), τ2(u), and C where it is free, in the basis."""
    solver: Solver
    held: tuple[int, ...]
    """Active constraints on x."""

    @property
    def basis(self) -> Basis:
        """Forms of T_s, τ1, τ2."""
        return self.problem.basis

    @cached_property
    def at(self) -> Shape:
        """The levels' curves."""
        return self.problem.shape(self.x)

    @cached_property
    def size(self) -> Array:
        """What T_s of each level is measured in, (L,); 0 for one that is 0 throughout."""
        w = self.problem.weight
        return np.asarray(np.where(w > 0, 1 / np.sqrt(np.where(w > 0, w, 1.0)), 0.0))

    @cached_property
    def repeats(self) -> Counts:
        """Runs of each level, (L,)."""
        return np.array([len(level.runs) for level in self.levels])

    @cached_property
    def blocked(self) -> Array:
        """Rows of the active constraints over all unknowns."""
        rows = self.problem.problem().A[list(self.held)]
        return np.concatenate([np.zeros((len(rows), len(self.levels))), rows], axis=1)

    @cached_property
    def curves(self) -> tuple[Friction, ...]:
        """The levels' curves of Eq. (3)."""
        theta = np.concatenate([self.at.Ts[None], self.problem.values(self.x)])
        return tuple(Friction(*row) for row in theta.T.tolist())

    @cached_property
    def scatter(self) -> Scatter:
        """What the runs say about them."""
        return Scatter(tuple(self.levels), self.curves, self.basis.free_share)

    @property
    def by_levels(self) -> bool:
        """Whether levels of a single run show their scatter in their distance to the estimate."""
        return len(self.levels) - self.problem.first >= LEVELS_TO_SPARE

    @property
    def single_degrees(self) -> float:
        """Degrees of freedom of what levels of a single run show."""
        return float(len(self.levels) - self.problem.first) if self.by_levels else FEW_DEGREES

    @cached_property
    def along(self) -> Array:
        """Slopes of the levels' curves at the points by ln T_s, ln τ1, ln τ2, and a free logit C, (L, k, P)."""
        at, (tau1, tau2, C) = self.at, self.problem.values(self.x)
        scale = np.stack([tau1, tau2, *([C * (1 - C)] if self.basis.free_share else [])], axis=1)
        others = at.slopes[:, : scale.shape[1]] * (at.Ts[:, None] * scale)[:, :, None]
        return np.concatenate([(at.Ts[:, None] * at.phi)[:, None], others], axis=1)

    def influence_at(self, at: Shape, seen: LevelScatter | None = None) -> tuple[Influence, Array]:
        """How T_s/size of the levels and x answer to the levels' own estimates at curves, and the Newton step from
        there, (L + p,); `seen` is how these scatter."""
        L, p, problem = len(self.levels), len(self.x), self.problem
        w = np.broadcast_to(problem.data.points.w, problem.data.points.y.shape)
        ways = np.concatenate([at.phi[:, None] * self.size[:, None, None], at.slopes * at.Ts[:, None, None]], axis=1)
        take = np.zeros((L, 4, L + p))  # how T_s, τ1, τ2, C of a level go with the unknowns
        take[np.arange(L), 0, np.arange(L)] = 1.0
        take[:, 1:, L:] = problem.rows.transpose(1, 0, 2)
        weighed = ways * (problem.weight[:, None] * w)[:, None]
        gain, back = gains_of(weighed, ways, take, self.along, self.blocked)
        alone = seen is None and bool((self.repeats == 1).all())
        singles = self._singles(at, take) if alone else np.zeros((0, L + p))
        gradient = np.einsum("lk,lkm->m", (weighed @ at.left[:, :, None])[:, :, 0], take)
        scatter = seen or self.scatter.of_levels
        return Influence((not alone) * gain, scatter, singles @ back, self.single_degrees), -gradient @ back

    def _singles(self, at: Shape, take: Array) -> Array:
        """Scores of levels of a single run, (parts, L + p)."""
        problem, alone = self.problem, []
        by_level, information = problem.reduced(at)
        back = free_inverse(
            np.einsum("kln,lkj,jlm->nm", problem.rows, information, problem.rows), self.blocked[:, len(self.levels) :]
        )
        for i in range(len(self.levels)):
            if self.by_levels:
                own = problem.rows[:, i].T @ information[i] @ problem.rows[:, i]
                score = -problem.rows[:, i].T @ by_level[i]
                alone.append(np.append(np.zeros(len(self.levels)), corrected(own, back, score))[None])
            else:
                alone.append(problem.weight[i] * self._within_run(at, i) @ take[i])
        return np.concatenate(alone)

    def _within_run(self, at: Shape, i: int) -> Array:
        """Rows whose squares sum to the covariance of a single run's scores by its own noise, (4, 4)."""
        level = self.levels[i]
        curve = Friction(float(at.Ts[i]), *self.problem.values(at.x)[:, i].tolist())
        slopes = friction.gradient(curve, level.time_s)
        noise = run_residuals(level.runs, curve.Ts * slopes[0], slopes.T)[0]
        slopes[0] *= self.size[i]
        covariance = bartlett_covariance(level.time_s, (slopes * noise).T)
        white = np.maximum(np.diag(covariance[0]), 1e-300)
        largest = covariance[int((np.einsum("wkk->wk", covariance) / white).sum(axis=1).argmax())]
        variance, ways = np.linalg.eigh(largest)
        return np.asarray((ways * np.sqrt(np.maximum(variance, 0.0))).T)

    @cached_property
    def of_levels(self) -> Influence:
        """How T_s/size of the levels and x answer to the runs."""
        return self.influence_at(self.at)[0]

    @cached_property
    def curve(self) -> "TorqueCurve":
        """T_s(u) through T_s of the levels."""
        at, several = self.at, self.repeats > 1
        relative, known = None, 0.0
        if several.any() and len(self.levels) > self.problem.first:
            every = np.eye(len(self.levels), len(self.levels) + len(self.x))
            variance = self.of_levels.of(every[several]).variance()[0]
            part = self.size[several] / np.maximum(at.Ts[several], 1e-3 * max(float(at.Ts.max()), 1e-300))
            relative = float(np.mean(self.repeats[several] * variance * part**2)) / self.repeats
            known = float((self.repeats - 1).sum())
        w = np.broadcast_to(self.problem.data.points.w, at.phi.shape)
        noise = (w * at.left**2).sum(axis=1) / w.sum(axis=1) / np.maximum((w * at.phi**2).sum(axis=1), 1e-300)
        return torque_curve(self.basis, at.Ts, relative, noise, known)

    @property
    def coefficients(self) -> Array:
        """Of T_s(u), τ1(u), τ2(u), and C where it is free, in the basis, (n,)."""
        return np.append(self.curve.coefficients, self.x)

    @property
    def parameters(self) -> Nonlinear:
        """The model of Eqs. (4)–(7)."""
        return self.basis.parameters(self.coefficients)

    @cached_property
    def active(self) -> dict[str, tuple[float, ...]]:
        """Constraints that hold the estimate, by code, and the inputs at which they do."""
        on_Ts = (2 * len(self.basis.duties) + i for i in self.curve.active)
        return active_at(self.basis, [*self.problem.kept[list(self.held)].tolist(), *on_Ts])

    @cached_property
    def answers(self) -> Array:
        """How the coefficients follow from T_s/size of the levels and x, (n, L + p)."""
        first, found = self.problem.first, np.zeros((self.basis.size, len(self.levels) + len(self.x)))
        found[:first, : len(self.levels)] = self.curve.gains * self.size * np.sqrt(self.curve.widened)
        found[first:, len(self.levels) :] = np.eye(len(self.x))
        return found

    def with_levels(self, of_levels: Influence) -> Influence:
        """Influence on the coefficients, with the scatter of single runs about T_s(u)."""
        whole = of_levels.of(self.answers)
        if not ((self.repeats == 1).all() and self.by_levels):
            return whole
        apart = np.zeros((len(self.levels), self.basis.size))
        apart[:, : self.problem.first] = (self.curve.gains * np.sqrt(self.curve.variance)).T
        return replace(whole, singles=np.concatenate([whole.singles, apart]))

    @cached_property
    def influence(self) -> Influence:
        """How the coefficients answer to the runs."""
        return self.with_levels(self.of_levels)

    def refit(self, data: Data) -> Array:
        """The coefficients for data that differ little, with the weights of T_s(u) kept, (n,)."""
        problem, x, *_ = solve(data, None if self.basis.free_share else self.basis.share, [self.x])
        return np.append(self.curve.gains @ problem.shape(x).Ts, x)

    def numbers(self, u: Array, c: Array) -> tuple[Array, Array]:
        """ln T_s, ln τ1, ln τ2 at inputs, (3, m), and their slopes by the coefficients c, (3, m, n)."""
        rows = self.basis.rows(u)[:3]
        value = np.maximum(rows @ c, 1e-300)
        return np.log(value), rows / value[:, :, None]

    def intervals(self, u: Array, seen: LevelScatter | None = None) -> tuple[Array, Array, Array]:
        """Least and largest ln T_s, ln τ1, ln τ2 at inputs and their degrees of freedom, (3, m) each.

        `seen` is how the levels scatter where more than these show it. Where τ2 is known so little that the estimate is
        not linear in it, its ends are those of the score test, and T_s and τ1 reach over all that go with a τ2 between
        them.
        """
        value, slopes = self.numbers(u, self.coefficients)
        influence = self.influence
        if seen is not None:
            influence = self.influence_at(self.at, seen)[0].of(self.answers)
        variance, degrees = (v.reshape(3, -1) for v in influence.of(slopes.reshape(-1, self.basis.size)).variance())
        reach = t_quantile(degrees) * np.sqrt(variance)
        low, high = value - reach, value + reach
        if seen is None and (self.repeats == 1).all() and not self.by_levels:
            return low, high, degrees
        covariance = influence.covariance()
        for i in np.flatnonzero((reach[2] > CURVED) & np.isfinite(reach[2])).tolist():
            among = slopes[:, i] @ covariance @ slopes[:, i].T
            way = covariance @ slopes[2, i] / max(float(among[2, 2]), 1e-300)
            size = np.sqrt(np.maximum(np.diag(among), 1e-300))
            alone = reach[:2, i] * np.sqrt(np.maximum(1 - (among[:2, 2] / (size[:2] * size[2])) ** 2, 0.0))
            for side, ends in ((-1.0, low), (1.0, high)):
                reached = self._reached(u[i : i + 1], way, side * float(reach[2, i]), seen)
                if reached is None:
                    ends[2, i] = side * np.inf
                    continue
                ends[2, i] = reached[2]
                low[:2, i] = np.minimum(low[:2, i], reached[:2] - alone)
                high[:2, i] = np.maximum(high[:2, i], reached[:2] + alone)
        return low, high, degrees

    def _reached(self, u: Array, way: Array, reach: float, seen: LevelScatter | None) -> Array | None:
        """ln T_s, ln τ1, ln τ2 where τ2 is moved along a way of the coefficients until the runs reject it; None: never.

        Neyman's score test: from a supposed place the Newton step leads back by more than t standard deviations there.
        """
        first, before, last = self.problem.first, 0.0, self.numbers(u, self.coefficients)[0][:, 0]
        problem = self.problem.problem()
        for factor in OUTWARD:
            x = self.x + np.expm1(factor * reach) * way[first:]
            if not np.isfinite(x).all() or (problem.A @ x < problem.b - 1e-9).any():
                return last if np.isfinite(x).all() else None
            at = self.problem.shape(x)
            c = np.append(self.curve.coefficients + self.curve.gains @ (at.Ts - self.at.Ts), x)
            value, slopes = self.numbers(u, c)
            influence, step = self.influence_at(at, seen)
            variance, degrees = influence.of(slopes[2] @ self.answers).variance()
            back = -float(slopes[2, 0] @ self.answers @ step) * np.sign(reach)
            ratio = back / float(t_quantile(degrees)[0] * np.sqrt(variance[0]))
            if ratio >= 1:
                return np.asarray(last + (value[:, 0] - last) * (1 - before) / (ratio - before))
            last, before = value[:, 0], ratio
        return None


@dataclass(frozen=True, eq=False)
class TorqueCurve:
    """T_s(u) through T_s of the levels."""

    coefficients: Array
    gains: Array
    """How the coefficients answer to T_s of the levels, (p, L)."""
    variance: Array
    """Of the levels' T_s, (L,)."""
    misfit: float | None
    """χ² of the levels about the curve over its degrees of freedom; None where there are none."""
    widened: float
    """Factor by which variances are larger where the levels are further from the curve than chance lets them be."""
    active: tuple[int, ...]
    """Rows of the constraints that hold it, among those of T_s ≥ 0."""


def torque_curve(basis: Basis, Ts: Array, relative: Array | None, noise: Array, degrees: float) -> TorqueCurve:
    """T_s(u) ≥ 0 through the levels' T_s by least squares, with the variance `relative` T_s(u)² + `noise`, (L,) each.

    `relative` is known by so many degrees of freedom; None: it is found from the levels' distance to the curve. Where
    that is more than chance lets it be, it counts in place of the variance.
    """
    first = basis.slices[1].start
    D, duties = basis.M[0][:, :first], basis.M_of_duties[0][:, :first]
    spare, largest = len(Ts) - first, float(Ts.max())
    if largest <= 0:
        nothing = np.zeros((first, len(Ts)))
        return TorqueCurve(nothing[:, 0], nothing, np.zeros(len(Ts)), None, 1.0, tuple(range(len(duties))))

    def through(variance: Array) -> tuple[Array, tuple[int, ...], float]:
        weighed = D / variance[:, None]
        inner = np.zeros(first)
        inner[0] = largest
        problem = Problem(lambda x: (0.0, x, x), duties, np.zeros(len(duties)), str)
        step = newton_step(problem, inner, 2 * weighed.T @ (D @ inner - Ts), 2 * weighed.T @ D)
        left = Ts - D @ (inner + step.d)
        return inner + step.d, step.active, float((left**2 / variance).sum())

    def variance_of(at: Array, scatter: Array | float) -> Array:
        return np.maximum(scatter * at**2 + noise, (1e-9 * largest) ** 2)

    at, scatter, shrunk = np.maximum(Ts, 1e-3 * largest), USUAL**2 if relative is None else relative, 1.0
    for _ in range(4):
        c, active, chi_square = through(variance_of(at, scatter))
        at = np.maximum(D @ c, 1e-3 * largest)
        if relative is None and spare > 0:
            total = partial(lambda at, a: through(variance_of(at, a))[2], at)
            scatter, shrunk = paule_mandel(total, float(spare), USUAL**2)
    variance = variance_of(at, scatter) * np.sqrt(shrunk)
    misfit = chi_square / spare if spare > 0 else None
    gains = free_inverse((D / variance[:, None]).T @ D, duties[list(active)]) @ (D / variance[:, None]).T
    widened = 1.0
    if relative is not None and misfit is not None and misfit > fdtri(spare, max(degrees / 2, 1.0), BEYOND_CHANCE):
        widened = misfit
    return TorqueCurve(c, gains, variance * widened, misfit, widened, active)


def levels_first(levels: Sequence[Level], data: Data, share: float | None, near: Estimate | None = None) -> Estimate:
    """The estimate from the runs of L levels, `data` being their means; `near` is that of data that differ little."""
    problem, x, solver, active = solve(data, share, None if near is None else [near.x])
    return Estimate(levels, problem, x, solver, tuple(active))
