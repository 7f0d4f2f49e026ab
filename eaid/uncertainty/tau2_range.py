"""Which τ2 the runs of a level allow: a confidence set by inverting tests, whatever the shape of the cost.

At a supposed τ2 = x the other two parameters are refitted to the level's mean ȳ, f_x. Along a direction z that T_s and
τ1 cannot follow, a run would move the fit by d_r = z'(y_r − f_x)/z'z. If x is the truth, the runs' mean is zero but for
their scatter: t(x) = d̄/√V(x), V(x) from the runs pooled over the levels, is Student's. Two directions are tried:
∂f_x/∂log τ2 (a score test), and the way from f_x to the level's best curve, which has power where x is far off. The
best curve has been chosen by the same data, so the second test rejects only at 99.9 %.

The set of all x that neither rejects holds the true τ2 in 95 % also where the estimate has run off into another minimum
of the cost, as it often does in records no longer than τ2 (docs/uncertainty.md has the coverage).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from eaid.arrays import Array
from eaid.fitting.compress import compress
from eaid.models import friction
from eaid.steps.stepset import Level
from eaid.uncertainty.levels import LevelEstimate
from eaid.uncertainty.run_statistics import RunStatistics
from eaid.uncertainty.scatter import Mask, pooled_scatter
from eaid.uncertainty.student_t import t_quantile

SUPPOSED = np.geomspace(0.02, 20.0, 25)
"""τ2 that are tried, in units of the level's record."""
FAR_NOMINAL = 0.999
"""Confidence at which the way to the best curve rejects a τ2."""
ROUNDING = 1e-14
STEPS = 12
"""Gauss–Newton steps in which T_s and τ1 settle at a supposed τ2."""


@dataclass(frozen=True, eq=False)
class Tau2Sets:
    """95 % confidence sets of the levels' τ2, and the T_s and τ1 that go with them."""

    tau2_s: Array
    """Least and largest τ2 allowed [s], shape (L, 2); 0 and ∞ where no end is seen, NaN where none is asked for."""
    log_theta: Array
    """Least and largest log T_s and log τ1 over the allowed τ2, shape (L, 2, 2)."""


def tau2_sets(levels: Sequence[Level], estimates: Sequence[LevelEstimate], variance: Array, degrees: Array) -> Tau2Sets:
    """The sets of the levels whose C was held and whose τ2 no constraint holds.

    `variance` and `degrees` of log τ2, shape (L,), serve single runs.
    """
    sets = Tau2Sets(np.full((len(estimates), 2), np.nan), np.full((len(estimates), 2, 2), np.nan))
    free = [i for i, one in enumerate(estimates) if "tau2" not in one.constrained and not one.share_free]
    if free:
        asked = [levels[i] for i in free], [estimates[i] for i in free]
        sets.tau2_s[free], sets.log_theta[free] = _sets(*asked, variance[free], degrees[free])
    return sets


def _sets(
    levels: Sequence[Level], estimates: Sequence[LevelEstimate], variance: Array, degrees: Array
) -> tuple[Array, Array]:
    """The ends of τ2, shape (L, 2), and those of log T_s and log τ1, shape (L, 2, 2)."""
    means = _Means.of(levels, estimates)
    supposed = np.array([one.runs.duration_s for one in estimates])[:, None] * SUPPOSED
    t = np.zeros((2, *supposed.shape))
    theta = np.zeros((*supposed.shape, 2))
    count = np.zeros(supposed.shape)
    start = np.array([one.runs.log_theta[:2] for one in estimates])
    for j in reversed(range(len(SUPPOSED))):  # from τ2 without end, where T_s and τ1 are plain
        start, tests = means.tested(supposed[:, j], start)
        theta[:, j] = start
        t[:, :, j], count[:, j] = _statistics(tests, estimates, variance, degrees)
    allowed = (np.abs(t[0]) <= t_quantile(count)) & (np.abs(t[1]) <= t_quantile(count, FAR_NOMINAL))
    best = np.exp([one.runs.log_theta[2] for one in estimates]).tolist()
    ends = [_ends(*row) for row in zip(supposed, t[0], allowed, best, strict=True)]
    low, high = (np.where(allowed[:, :, None], theta, side).T for side in (np.inf, -np.inf))
    return np.array(ends), np.stack([low.min(axis=1), high.max(axis=1)], axis=-1).transpose(1, 0, 2)


@dataclass(frozen=True, eq=False)
class _Means:
    """The levels' means and best curves on their compressed points, padded with weight 0, shape (L, P); their runs."""

    estimates: Sequence[LevelEstimate]
    time_s: Array
    weight: Array
    mean: Array
    best: Array
    share: Array
    """C of each level, shape (L, 1)."""
    off: list[Array]
    """Runs of each level less their mean, shape (R, P)."""

    @classmethod
    def of(cls, levels: Sequence[Level], estimates: Sequence[LevelEstimate]) -> Self:
        """The means of these levels."""
        points = [compress([level.time_s] * len(level.runs), list(level.runs)) for level in levels]
        width = max(p.y.shape[1] for p in points)

        def padded(rows: Sequence[Array]) -> Array:
            return np.array([np.pad(row, (0, width - len(row))) for row in rows])

        means = [np.sort(p.y, axis=0).mean(axis=0) for p in points]  # sorted: the order of runs changes no rounding
        best = [friction.step_response(one.curve, p.t_s[0]) for one, p in zip(estimates, points, strict=True)]
        off = [np.pad(p.y - mean, ((0, 0), (0, width - len(mean)))) for p, mean in zip(points, means, strict=True)]
        shares = np.array([[one.curve.C] for one in estimates])
        time_s, weight = padded([p.t_s[0] for p in points]), padded([p.w[0] for p in points])
        return cls(estimates, time_s, weight, padded(means), padded(best), shares, off)

    def tested(self, tau2_s: Array, theta: Array) -> tuple[Array, list[RunStatistics]]:
        """(log T_s, log τ1) at held τ2, shape (L, 2), and along both directions d̄ and the scatter of the runs."""
        fastest, slowest = np.log(1e-6 * tau2_s), np.log(tau2_s / 1.2)  # the fast part stays the fast one
        slow = np.exp(-self.time_s / tau2_s[:, None])
        for _ in range(STEPS):
            theta = np.stack([theta[:, 0], np.clip(theta[:, 1], fastest, slowest)], axis=1)
            steady, a = np.exp(theta[:, :1]), self.time_s / np.exp(theta[:, 1:])
            fast = self.share * np.exp(-a)
            f, bent = steady * (1 - fast - (1 - self.share) * slow), -steady * a * fast
            left = self.mean - f
            step = self._within(f, bent, left)
            if np.abs(step).max() < 1e-8:
                break
            theta = theta + np.clip(step, -0.7, 0.7)
        scores = -steady * (1 - self.share) * self.time_s / tau2_s[:, None] * slow
        ways = []
        for way in (scores, self.best - f):
            own = self._within(f, bent, way)
            ways.append(way - own[:, :1] * f - own[:, 1:] * bent)
        size = np.maximum([(self.weight * way**2).sum(axis=1) for way in ways], 1e-300)
        along = np.array(ways) * self.weight / size[:, :, None]
        shift = (along * left).sum(axis=2)
        tests = [
            RunStatistics(
                one.level,
                shift[:, i],
                np.eye(2),
                off @ along[:, i].T,
                float(np.mean(one.noise_nm**2)) / size[:, i],
                one.runs.duration_s,
            )
            for i, (one, off) in enumerate(zip(self.estimates, self.off, strict=True))
        ]
        return theta, tests

    def _within(self, f: Array, bent: Array, what: Array) -> Array:
        """Coefficients of f and ∂f/∂log τ1 that come nearest to `what` at each level, shape (L, 2)."""
        slopes = np.stack([f, bent], axis=1)
        weighted = slopes * self.weight[:, None]
        size = np.sqrt(np.maximum((weighted * slopes).sum(axis=2), 1e-300))
        cosine = (weighted[:, 0] * bent).sum(axis=1) / size.prod(axis=1)
        along = (weighted @ what[:, :, None])[:, :, 0] / size
        # by the inverse of ((1, c), (c, 1)); where both slopes have one direction, half along each
        apart = 1 - cosine[:, None] ** 2
        several = (along - cosine[:, None] * along[:, ::-1]) / np.maximum(apart, ROUNDING)
        return np.asarray(np.where(apart > ROUNDING, several, along / 2) / size)


def _statistics(
    tests: Sequence[RunStatistics], estimates: Sequence[LevelEstimate], variance: Array, degrees: Array
) -> tuple[Array, Array]:
    """t of both directions, shape (2, L), and their degrees of freedom, shape (L,)."""
    shift = np.array([test.log_theta for test in tests]).T
    if max(test.repeats for test in tests) > 1:
        scatter = pooled_scatter(tests)
        spread = (scatter.pooled + scatter.common).T
        return shift / np.sqrt(spread), np.full(len(tests), scatter.total_degrees)
    # a single run: the memory of its noise is that of its own best curve
    memory = np.array([one.memory for one in estimates])
    within = np.array([test.within for test in tests]).T * memory
    between = np.maximum(variance - np.array([one.runs.within[2] for one in estimates]), 0.0)
    return shift / np.sqrt(within + np.where(np.isfinite(between), between, 0.0)), degrees


def _ends(supposed: Array, t: Array, allowed: Mask, best: float) -> tuple[float, float]:
    """The hull of what is allowed: tried values, those between two of opposite sign, and the estimate's own place."""
    turns = np.not_equal(np.sign(t[1:]), np.sign(t[:-1])) & (allowed[1:] | allowed[:-1])
    place = int(np.searchsorted(supposed, best))
    inside = allowed | np.append(turns, False) | np.append(False, turns)
    inside[max(place - 1, 0) : place + 1] = True
    first, last = np.flatnonzero(inside)[[0, -1]]
    low = 0.0 if first == 0 and allowed[0] else supposed[max(first - 1, 0)]
    return float(low), float("inf" if last == len(t) - 1 else supposed[last + 1])
