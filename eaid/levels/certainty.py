"""Intervals of levels first, which fits T_s of each level and then T_s(u) through them: how numbers answer to the runs.

Unknowns are T_s of the L levels and the coefficients x of τ1(u), τ2(u), C. Levels with repeats contribute their runs.
Levels of a single run contribute their own distance to the estimate, as clusters with scores corrected for their own
say (CR3), and to T_s(u) by the spread of the levels about it; where there are too few levels, the noise within the run.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from eaid.arrays import Array
from eaid.estimate.data import Data
from eaid.estimate.forms import Model, nonlinear
from eaid.estimate.mixed import MixedLine
from eaid.estimate.own_level import NO_SCATTER, gains_of_runs, levels_about, pull_to_line
from eaid.estimate.points import Normal, crossed_with_tails, level_normal, log_crossed
from eaid.estimate.scatter import LEVELS_TO_SPARE, USUAL, USUAL_TAU, Scatter, run_residuals, window_sums
from eaid.estimate.spread import (
    FEW_DEGREES,
    Influence,
    LevelScatter,
    free_inverse,
    gains_of,
    score_test_end,
    standard_errors,
    t_quantile,
)
from eaid.levels.from_steps import Solution, fit_levels_first, torques
from eaid.levels.slow_part import SlowPart, slow_part
from eaid.levels.torque_curve import TorqueCurve, torque_curve
from eaid.options import FitOptions
from eaid.plant.dynamics import Plant
from eaid.plant.forms import Form, KnownPoints
from eaid.plant.steps import step_bends
from eaid.shapes.shape import is_coloured
from eaid.steps.stepset import Level

SAYS_NOTHING = float(np.log(100.0))  # Logarithm of the factor up or down from which an interval says nothing
USUAL_SCATTER = (USUAL, USUAL_TAU, USUAL_TAU)  # Of ln T_s, ln τ1, ln τ2 from run to run, where nothing shows it
SHOWN_PART = 0.25  # Of a record, up to which a τ2 is shown by single runs of few levels
CURVED = 0.25  # Half-width of ln τ2 from which the ends of a level's intervals are found by the score test


def single_scores(take: Array, information: Array, score: Array, back: Array) -> Array:
    """Scores of levels of a single run, each without its own say, (I − own back)⁻¹ score (CR3), (L, n)."""
    others = np.eye(len(back)) - take.transpose(0, 2, 1) @ information @ take @ back
    rows = zip(others, take, score, strict=True)
    return np.array([np.linalg.lstsq(left, -T.T @ s, rcond=1e-9)[0] for left, T, s in rows])


@dataclass(frozen=True, eq=False)
class Estimate:
    """The solved estimate of L levels."""

    levels: Sequence[Level]
    solved: Solution  # τ1(u), τ2(u), and C where it is free
    form: Form | None = None  # Of T_s(u); None: the paper's cubic

    @cached_property
    def model(self) -> Model:
        """The whole model, T_s(u) among it."""
        found = nonlinear(self.solved.steps.data.u, self.solved.steps.model.share)
        return replace(found, Ts=self.form or found.Ts)

    @property
    def Ts_terms(self) -> int:
        """Coefficients of T_s(u)."""
        return int(self.model.slices[0].stop)

    @cached_property
    def size(self) -> Array:
        """What T_s of each level is measured in, (L,); 0 for one that is 0 throughout."""
        w = self.solved.steps.weight
        return np.asarray(np.where(w > 0, 1 / np.sqrt(np.where(w > 0, w, 1.0)), 0.0))

    @cached_property
    def blocked(self) -> Array:
        """Rows of the active constraints over all unknowns."""
        rows = self.solved.steps.limits.A[list(self.solved.active)]
        return np.concatenate([np.zeros((len(rows), len(self.levels))), rows], axis=1)

    @cached_property
    def scatter(self) -> Scatter:
        """What the runs say about the levels' curves."""
        return Scatter(tuple(self.levels), self.solved.at.theta, self.model.free_share)

    def residuals(self, data: Data) -> list[Array]:
        """f − y at every sample of each level, shapes (n_l,)."""
        return self.solved.residuals(data)

    @property
    def all_single(self) -> bool:
        """Whether no level has repeats."""
        return bool((self.scatter.repeats == 1).all())

    @property
    def by_levels(self) -> bool:
        """Whether levels of a single run show their scatter in their distance to the estimate."""
        return len(self.levels) - self.Ts_terms >= LEVELS_TO_SPARE

    @property
    def single_degrees(self) -> float:
        """Degrees of freedom of what levels of a single run show."""
        return float(len(self.levels) - self.Ts_terms) if self.by_levels else FEW_DEGREES

    def along(self, theta: Array) -> Array:
        """How the curves θ go with the levels' own estimates, (L, k, 4)."""
        return log_crossed(self.solved.at.theta, theta, self.solved.steps.data.points, self.model.free_share)

    def influence_at(self, at: Normal, of_levels: LevelScatter | None = None) -> tuple[Influence, Array]:
        """How T_s/size of the levels and x answer to the levels' own estimates at curves, and the Newton step from
        there, (L + p,); `of_levels` is how these scatter."""
        L, p, weight = len(self.levels), len(self.solved.x), self.solved.steps.weight
        take, every = self.take, weight[:, None, None]
        gain, back = gains_of(every * at.information, every * self.along(at.theta), take, self.blocked)
        alone = of_levels is None and self.all_single
        singles = self._singles(at) if alone else np.zeros((0, L + p))
        singles = np.concatenate([singles, self._of_creep(at, take), self._of_tails(at, take)]) @ back
        if alone and not self.by_levels:  # nothing shows how runs scatter
            known = np.array(USUAL_SCATTER) * t_quantile(np.inf) / t_quantile(self.single_degrees)
            singles = np.concatenate([singles, *(gain[:, :3] * known[:, None])])
        gradient = np.einsum("lk,lkm->m", weight[:, None] * at.score, take)
        scatter, least = of_levels or self.scatter.of_levels, self.of_noise @ back if alone and self.by_levels else None
        return Influence((not alone) * gain, scatter, singles, self.single_degrees, least), -gradient @ back

    def _of_creep(self, at: Normal, take: Array) -> Array:
        """The scores that one standard error of a creep makes that was taken off, (1, L + p), if any."""
        data = self.solved.steps.data
        if data.creep is None:
            return np.zeros((0, take.shape[2]))
        points = data.points
        since_s = np.array([[data.creep.of_levels[u]] for u in data.u.tolist()])
        size = points.y if data.creep.in_proportion else 1.0
        ramp = points.w * data.creep.error * size * (points.t_s + since_s)
        rows = enumerate(zip(points.t_s, ramp, strict=True))
        along = np.array([points.step_slopes(at.theta, i, t) @ w for i, (t, w) in rows])
        return np.asarray(np.einsum("l,lk,lkm->m", self.solved.steps.weight, along, take))[None]

    def _of_tails(self, at: Normal, take: Array) -> Array:
        """The scores that errors of the tails make on which steps begin, (parts, L + p)."""
        points = self.solved.steps.data.points
        if points.off is None:
            return np.zeros((0, take.shape[2]))
        by_level = np.einsum("lji,pil->plj", crossed_with_tails(at.theta, points), points.off)
        return np.asarray(np.einsum("l,plj,ljm->pm", self.solved.steps.weight, by_level, take))

    @cached_property
    def take(self) -> Array:
        """How T_s, τ1, τ2, C of a level go with the unknowns, (L, 4, L + p)."""
        L, take = len(self.levels), np.zeros((len(self.levels), 4, len(self.levels) + len(self.solved.x)))
        take[np.arange(L), 0, np.arange(L)] = self.size
        take[:, 1:, L:] = self.solved.steps.M[1:].transpose(1, 0, 2)
        return take

    @cached_property
    def of_noise(self) -> Array:
        """Scores that the noise within single runs makes, (parts, L + p)."""
        weight, each = self.solved.steps.weight, range(len(self.levels))
        return np.concatenate([weight[i] * self._within_run(self.solved.at, i) @ self.take[i] for i in each])

    def _singles(self, at: Normal) -> Array:
        """Scores of levels of a single run, (parts, L + p)."""
        if not self.by_levels:
            return self.of_noise
        L, (score, information) = len(self.levels), self.solved.steps.reduced(at)
        take = self.take[:, 1:, L:]
        back = free_inverse(np.einsum("lin,lij,ljm->nm", take, information, take), self.blocked[:, L:])
        return np.pad(single_scores(take, information, score, back), ((0, 0), (L, 0)))

    def _within_run(self, at: Normal, i: int) -> Array:
        """Rows whose squares sum to the covariance of a single run's scores by its own noise, (4, 4)."""
        level = self.levels[i]
        slopes = self.solved.steps.data.points.step_slopes(at.theta, i, level.time_s)
        noise = run_residuals(level.runs, at.theta[0, i] * slopes[0], slopes.T)[0]
        sums = window_sums(level.time_s, (slopes * noise).T)
        covariance = np.array([sum(x @ x.T for x in parts) / m for parts, m in sums])
        white = np.maximum(np.diag(covariance[0]), 1e-300)
        largest = covariance[int((np.einsum("wkk->wk", covariance) / white).sum(axis=1).argmax())]
        return standard_errors(largest)

    @cached_property
    def of_levels(self) -> Influence:
        """How T_s/size of the levels and x answer to the runs."""
        return self.influence_at(self.solved.at)[0]

    @cached_property
    def curve_by_runs(self) -> tuple[TorqueCurve, Array | None, float]:
        """T_s(u) through T_s of the levels as if only runs scattered; that variance, relative, and its degrees."""
        several, Ts = self.scatter.repeats > 1, self.solved.at.theta[0]
        relative, known = None, 0.0
        if several.any() and len(self.levels) > self.Ts_terms:
            every = np.eye(len(self.levels), len(self.levels) + len(self.solved.x))
            variance = self.of_levels.of(every[several]).variance()[0]
            part = self.size[several] / np.maximum(Ts[several], 1e-3 * max(float(Ts.max()), 1e-300))
            relative = float(np.mean(self.scatter.repeats[several] * variance * part**2)) / self.scatter.repeats
            known = float((self.scatter.repeats - 1).sum())
        return self._curve_through(relative, known), relative, known

    def _curve_through(self, relative: Array | None, known: float) -> TorqueCurve:
        at = self.solved.at
        samples = self.solved.steps.data.points.w.sum(axis=1)
        noise = at.cost / samples / np.maximum(at.information[:, 0, 0], 1e-300)
        return torque_curve(self.model, self.solved.steps.data.u, at.theta[0], relative, noise, known)

    def without(self, index: int, options: FitOptions) -> Plant:
        """The model by all levels but one, its time constants from where those of all ended."""
        steps, kept = self.solved.steps, [k for k in range(len(self.levels)) if k != index]
        solved = fit_levels_first(steps.data.only(kept), steps.model.share, [self.solved.x])
        other = replace(self, levels=[self.levels[k] for k in kept], solved=solved)
        _, relative, known = self.curve_by_runs
        if relative is not None:
            relative = relative[kept] + self.level_scatter**2
        found = self.model.parameters(np.append(other._curve_through(relative, known).coefficients, solved.x))
        return replace(found, Ts_through=tuple(self.level_points[k] for k in kept)) if options.through else found

    @cached_property
    def levels_about_curve(self) -> MixedLine | None:
        """T_s of the levels over the curve's: what they scatter about it beyond what their runs explain.

        None where repeats do not part the one from the other, or a curve has as many coefficients as there are levels.
        """
        curve, relative, _ = self.curve_by_runs
        if relative is None or len(self.levels) <= self.Ts_terms or not curve.coefficients.any():
            return None
        assert self.model.Ts is not None
        D, Ts = self.model.Ts.rows(self.solved.steps.data.u), self.solved.at.theta[0]
        size = np.maximum(D @ curve.coefficients, 1e-3 * float(Ts.max()))
        of_logs = np.diag(self.gain_scatter.expected[:, 0]) + self._of_time_constants()
        known = np.isfinite(of_logs).all() and Ts.min() > NO_SCATTER * Ts.max()  # not of levels that stay at rest
        return levels_about(Ts, size, D, of_logs) if known else None

    @cached_property
    def gain_scatter(self) -> LevelScatter:
        """How ln T_s of the levels' runs scatters where τ1 and τ2 are known."""
        return gains_of_runs(self.levels, [J[:, 0] for J in self.scatter.jacobians])

    def _of_time_constants(self) -> Array:
        """Covariance of ln T_s of the levels by what is not known of τ1 and τ2, (L, L).

        T_s answers to τ2 less and less the further off it is: where it is open, by what its ends make of T_s.
        """
        at, u, x = self.solved.at, self.solved.steps.data.u, slice(self.Ts_terms, None)
        slopes = self.numbers(u, np.append(np.zeros(self.Ts_terms), self.solved.x))[1][1:, :, x]
        by_tau = -at.information[:, 0, 1:3] / np.maximum(at.information[:, 0, :1], 1e-300)
        by_log = by_tau * (at.theta[1:3] / np.maximum(at.theta[0], 1e-300)).T
        count = len(u)
        covariance = self.of_levels.of(np.eye(len(self.solved.x), count + len(self.solved.x), count)).covariance()
        rows = np.einsum("lk,klx->lx", by_log, slopes)
        straight = rows @ covariance @ rows.T
        apart = np.sqrt(np.maximum(np.einsum("klx,xy,kly->kl", slopes, covariance, slopes), 0.0))
        reached = []
        for side in (-1.0, 1.0):
            theta = at.theta.copy()
            theta[2] = np.maximum(theta[2] * np.exp(side * np.minimum(2 * apart[1], SAYS_NOTHING)), theta[1])
            moved = level_normal(theta, self.solved.steps.data.points, torques).theta[0]
            reached.append(np.abs(np.log(np.maximum(moved, 1e-300) / np.maximum(at.theta[0], 1e-300))))
        bent = np.hypot(by_log[:, 0] * np.minimum(apart[0], 1.0), np.max(reached, axis=0) / 2)
        part = np.minimum(1.0, bent / np.sqrt(np.maximum(np.diag(straight), 1e-300)))
        return np.asarray(straight * np.outer(part, part))

    @cached_property
    def slow(self) -> SlowPart:
        """Which slow time constants the runs leave possible."""
        return slow_part(self.levels, self.solved.steps, self.solved.x)

    def leaves_slow_part(self, high: Array) -> bool:
        """Whether single runs of few levels, whose noise is coloured and whose scatter nothing shows, have a τ2 of most
        levels up to more than a part of the record: ln τ2 reaches up to `high`, (L,)."""
        if self.by_levels or not self.all_single:
            return False
        curves = [one.mean - J[:, 0] for one, J in zip(self.levels, self.scatter.jacobians, strict=True)]
        coloured = any(map(is_coloured, curves))
        record = np.array([level.time_s[-1] for level in self.levels])
        return coloured and 2 * int((high > np.log(SHOWN_PART * record)).sum()) > len(self.levels)

    def gain_half_width(self) -> Array:
        """Half-width of ln T_s of the levels where τ1 and τ2 are known, by how their runs scatter, (L,).

        Of levels of a single run that of the curve through them.
        """
        if not self.all_single:
            return np.asarray(t_quantile(self.scatter.degrees) * np.sqrt(self.gain_scatter.expected[:, 0]))
        assert self.model.Ts is not None
        follows = self.model.Ts.rows(self.solved.steps.data.u) @ self.curve.gains
        size = np.maximum(self.solved.at.theta[0], 1e-300)
        return np.asarray(t_quantile(self.single_degrees) * np.sqrt(follows**2 @ self.curve.variance) / size)

    @property
    def level_scatter(self) -> float:
        """σ_d: how far levels lie off the curve, a part of T_s; 0 where their runs explain it, or nothing shows it."""
        return 0.0 if self.levels_about_curve is None else float(np.sqrt(self.levels_about_curve.v[0]))

    @cached_property
    def curve(self) -> TorqueCurve:
        """T_s(u) through T_s of the levels."""
        plain, relative, known = self.curve_by_runs
        if relative is None or self.level_scatter <= NO_SCATTER:
            return plain
        return replace(self._curve_through(relative + self.level_scatter**2, known), misfit=plain.misfit)

    @cached_property
    def own_Ts(self) -> tuple[Array, Array, Array]:
        """ln T_s of the levels, each its own about the curve, half-width of its interval, degrees of freedom, (L,)."""
        line, u = self.levels_about_curve, self.solved.steps.data.u
        if line is None or self.level_scatter <= NO_SCATTER:
            low, high, degrees = (part[0] for part in self.intervals(u))
            return self.numbers(u, self.coefficients)[0][0], 0.5 * (high - low), degrees[0]
        size = self.solved.at.theta[0] / line.values.y
        return pull_to_line(line, size, self.scatter.degrees, self.gain_scatter)

    @property
    def coefficients(self) -> Array:
        """Of T_s(u), τ1(u), τ2(u), and C where it is free, (n,)."""
        return np.append(self.curve.coefficients, self.solved.x)

    @property
    def parameters(self) -> Plant:
        """The model of Eqs. (4)–(7)."""
        return self.model.parameters(self.coefficients)

    @property
    def moved(self) -> list[Plant]:
        """The same moved by one standard error in independent ways."""
        errors = standard_errors(self.influence.covariance())
        return [self.model.parameters(self.coefficients + one) for one in errors]

    def plant(self, options: FitOptions) -> Plant:
        """The same with T_s(u) as the option «curve» has it: the paper's cubic, or through the levels' own values."""
        return replace(self.parameters, Ts_through=self.level_points) if options.through else self.parameters

    @property
    def level_points(self) -> KnownPoints:
        """The levels, and T_s of each, its own."""
        return tuple(zip(self.solved.steps.data.u.tolist(), np.exp(self.own_Ts[0]).tolist(), strict=True))

    @cached_property
    def held(self) -> dict[str, tuple[float, ...]]:
        """Constraints that hold the estimate, by code, and the inputs at which they do."""
        on_Ts = self.model.limited[list(self.curve.active)].tolist()
        return {**self.solved.held, **({"Ts-zero": tuple(on_Ts)} if on_Ts else {})}

    @cached_property
    def answers(self) -> Array:
        """How the coefficients follow from T_s/size of the levels and x, (n, L + p)."""
        first, rows = self.Ts_terms, np.zeros((self.model.size, len(self.levels) + len(self.solved.x)))
        rows[:first, : len(self.levels)] = self.curve.gains * self.size * np.sqrt(self.curve.widened)
        rows[first:, len(self.levels) :] = np.eye(len(self.solved.x))
        return rows

    @cached_property
    def influence(self) -> Influence:
        """How the coefficients answer to the runs, single ones by their scatter about T_s(u)."""
        by_runs = self.of_levels.of(self.answers)
        if self.level_scatter > NO_SCATTER:
            of_Ts = self.level_scatter * self.solved.at.theta[0]  # each level's own distance to the curve, (L,)
        elif self.all_single and self.by_levels:
            of_Ts = np.sqrt(self.curve.variance)
        else:
            return by_runs
        apart = np.pad((self.curve.gains * of_Ts).T, ((0, 0), (0, self.model.size - self.Ts_terms)))
        return replace(by_runs, singles=np.concatenate([by_runs.singles, apart]))

    def curve_half_width(self) -> Array:
        """Half-width of ln T_s(u) at the levels, as far as the curve answers to the runs straight, (L,)."""
        slopes = self.numbers(self.solved.steps.data.u, self.coefficients)[1][0]
        variance, degrees = self.influence.of(slopes).variance()
        return np.asarray(t_quantile(degrees) * np.sqrt(variance))

    def refit(self, data: Data) -> Array:
        """The coefficients for data that differ little, with the weights of T_s(u) kept, (n,)."""
        again = fit_levels_first(data, self.model.share, [self.solved.x])
        return np.append(self.curve.gains @ again.at.theta[0], again.x)

    def numbers(self, u: Array, c: Array) -> tuple[Array, Array]:
        """ln T_s, ln τ1, ln τ2 at inputs, (3, m), and their slopes by the coefficients c, (3, m, n)."""
        rows = self.model.rows(u)[:3]
        value = np.maximum(rows @ c, 1e-300)
        return np.log(value), rows / value[:, :, None]

    def intervals(self, u: Array, scatter: LevelScatter | None = None) -> tuple[Array, Array, Array]:
        """Least and largest ln T_s, ln τ1, ln τ2 at inputs and their degrees of freedom, (3, m) each.

        `scatter` is how the levels scatter where more than these show it. Where τ2 is known so little that the
        estimate is not linear in it, its ends are those of the score test, and T_s and τ1 reach over all that
        go with a τ2 between them.
        """
        value, slopes = self.numbers(u, self.coefficients)
        influence = self.influence
        if scatter is not None:
            influence = self.influence_at(self.solved.at, scatter)[0].of(self.answers)
        variance, degrees = (v.reshape(3, -1) for v in influence.of(slopes.reshape(-1, self.model.size)).variance())
        reach = t_quantile(degrees) * np.sqrt(variance)
        low, high = value - reach, value + reach
        if scatter is None and self.all_single and not self.by_levels:
            return low, high, degrees
        covariance = influence.covariance()
        for i in np.flatnonzero((reach[2] > CURVED) & np.isfinite(reach[2])).tolist():
            among = slopes[:, i] @ covariance @ slopes[:, i].T
            way = covariance @ slopes[2, i] / max(float(among[2, 2]), 1e-300)
            size = np.sqrt(np.maximum(np.diag(among), 1e-300))
            alone = reach[:2, i] * np.sqrt(np.maximum(1 - (among[:2, 2] / (size[:2] * size[2])) ** 2, 0.0))
            for side, ends in ((-1.0, low), (1.0, high)):
                reached = self._reached(u[i : i + 1], way, side * float(reach[2, i]), scatter)
                if reached is None:
                    ends[2, i] = side * np.inf
                    continue
                ends[2, i] = reached[2]
                low[:2, i] = np.minimum(low[:2, i], reached[:2] - alone)
                high[:2, i] = np.maximum(high[:2, i], reached[:2] + alone)
        return low, high, degrees

    def _reached(self, u: Array, way: Array, reach: float, scatter: LevelScatter | None) -> Array | None:
        """ln T_s, ln τ1, ln τ2 where τ2 is moved along a way of the coefficients until the runs reject it."""
        limits = self.solved.steps.limits
        least = np.minimum(limits.b, limits.A @ self.solved.x) - 1e-9  # the estimate itself is within, and rounds

        def at(factor: float) -> tuple[Array, float] | None:
            x = self.solved.x + np.expm1(factor * reach) * way[self.Ts_terms :]
            if not np.isfinite(x).all() or (limits.A @ x < least).any():
                return None
            there = self.solved.steps.at(x)
            c = np.append(self.curve.coefficients + self.curve.gains @ (there.theta[0] - self.solved.at.theta[0]), x)
            value, slopes = self.numbers(u, c)
            influence, step = self.influence_at(there, scatter)
            variance, degrees = influence.of(slopes[2] @ self.answers).variance()
            back = -float(slopes[2, 0] @ self.answers @ step) * np.sign(reach)
            return value[:, 0], back / float(t_quantile(degrees)[0] * np.sqrt(variance[0]))

        return score_test_end(at)


def estimate_levels_first(
    levels: Sequence[Level], data: Data, share: float | None, near: Estimate | None = None, form: Form | None = None
) -> Estimate:
    """The estimate from the runs of L levels, `data` being their means, with a form of T_s(u), None: the paper's cubic;
    `near` is that of data that differ little."""
    found = Estimate(levels, fit_levels_first(data, share, None if near is None else [near.solved.x]), form)
    if (found.scatter.repeats == 1).all():
        return found
    return replace(found, solved=fit_levels_first(unbent(data, found.scatter), share, [found.solved.x]))


def unbent(data: Data, seen: Scatter) -> Data:
    """The mean curves of levels as τ1 and τ2 in the mean of their R runs make them: where these scatter by a variance
    of ln τ, the mean of the runs is bent by half of that, less what R runs leave of it, times ∂²f/∂(ln τ)²."""
    variance = np.nan_to_num(seen.pooled.between[1:3, None]) + seen.repeats * seen.pooled.common[1:3, None]
    half = 0.5 * variance * (1 - 1 / seen.repeats)
    points = data.points
    bend = (half[:, :, None] * step_bends(seen.theta, points.t_s)).sum(axis=0)
    return replace(data, compressed=replace(points, y=points.y - bend))
