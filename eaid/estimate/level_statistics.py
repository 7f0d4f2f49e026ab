"""What all intervals stand on: each level's curve, what its runs say, and the variance that follows.

With repeats the scatter is pooled over levels. With one run a level the scatter shows only as the levels' distance from
a curve through them, which takes four levels more than the curve has terms. Else all that is left is what one run shows
within itself: a lower bound, and said to be one.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from eaid.arrays import Array, inverse, median
from eaid.estimate.basis import RECORDS, RECORDS_FREE
from eaid.estimate.data import Data, data_of
from eaid.estimate.levels import fit_levels
from eaid.estimate.points import Points, compress, level_normal
from eaid.estimate.runs import (
    Mask,
    PooledScatter,
    RunStatistics,
    paule_mandel,
    pooled_scatter,
    run_residuals,
    run_statistics,
    t_quantile,
)
from eaid.estimate.solver import Descent, descend
from eaid.models import friction
from eaid.models.parameters import TAU_FLOOR_S, Friction
from eaid.results.fit import FrictionLevel
from eaid.steps.stepset import Level

NAMES = ("Ts", "tau1", "tau2", "C")
"""Parameters of one level, in the order of every array here; C only where it was free."""
CURVES = NAMES[:3]
"""Those that are curves over the duty."""
MEETING = 1e-4
"""A limit this close holds a parameter; τ1 and τ2 this close are one."""
UNDETERMINED = 3.0
"""Factor up or down beyond which a parameter counts as not determined."""


@dataclass(frozen=True, eq=False)
class LevelEstimate:
    """One level's friction curve with what its runs say about it."""

    curve: Friction
    runs: RunStatistics
    noise_nm: Array
    """Residuals of each run about its own best curve [output], shape (R, n)."""
    constrained: tuple[str, ...]
    """Parameters that a constraint holds: not estimable."""

    @property
    def level(self) -> float:
        """Input of the level."""
        return self.runs.level

    @property
    def share_free(self) -> bool:
        """Whether C is a parameter too."""
        return len(self.runs.log_theta) == 4

    @property
    def memory(self) -> float:
        """How many times larger than under white noise the within-run variance is, at most over the parameters."""
        white = np.diag(self.runs.inverse) * float(np.mean(self.noise_nm**2))
        return float(max(1.0, np.max(self.runs.within / np.maximum(white, 1e-300))))


def log_jacobian(curve: Friction, time_s: Array, share_free: bool = False) -> Array:
    """∂f/∂(log T_s, log τ1, log τ2[, logit C]), shape (n, 3 or 4), Eq. (3)."""
    scale = np.array([curve.Ts, curve.tau1, curve.tau2, curve.C * (1 - curve.C)])
    count = 4 if share_free else 3
    return np.asarray((friction.gradient(curve, time_s) * scale[:, None])[:count].T)


def log_theta(curve: Friction, share_free: bool = False) -> Array:
    """(log T_s, log τ1, log τ2[, logit C]); what is zero or at its edge is kept finite."""
    share = min(max(curve.C, 1e-12), 1 - 1e-12)
    values = np.log(np.maximum([curve.Ts, curve.tau1, curve.tau2, share / (1 - share)], 1e-300))
    return np.asarray(values[: 4 if share_free else 3])


def level_estimate(
    level: Level, curve: Friction, constrained: Sequence[str] = (), share_free: bool = False
) -> LevelEstimate:
    """What the runs of one level say about its friction curve."""
    jacobian = log_jacobian(curve, level.time_s, share_free)
    noise = run_residuals(level.runs, jacobian[:, 0], jacobian)  # ∂f/∂log T_s is f itself
    theta = log_theta(curve, share_free)
    found = run_statistics(level.level, level.time_s, level.runs, jacobian, theta, noise_nm=noise, mean_nm=level.mean)
    return LevelEstimate(curve, found, noise, tuple(constrained))


def constrained_parameters(fit: FrictionLevel, record_s: float, share_free: bool) -> tuple[str, ...]:
    """Which of T_s, τ1, τ2, C a constraint holds in this level's fit."""
    found: list[str] = []
    if fit.tau1 <= TAU_FLOOR_S * (1 + MEETING):
        found.append("tau1")
    if fit.tau2 >= (RECORDS_FREE if share_free else RECORDS) * record_s * (1 - MEETING):
        found.append("tau2")
    if fit.tau2 <= fit.tau1 * (1 + MEETING):
        found += ["tau1", "tau2"]
    if fit.Ts <= 0:
        found += ["Ts", "tau1", "tau2"]
    return tuple(dict.fromkeys(found))


def usable(levels: Sequence[LevelEstimate]) -> Mask:
    """Which parameters of which levels show the scatter: held by no constraint, and determined by their record."""
    rows = []
    for level in levels:
        names = NAMES[: len(level.runs.log_theta)]
        known = np.sqrt(level.runs.within / level.runs.repeats) < np.log(UNDETERMINED)
        rows.append(known & np.array([name not in level.constrained for name in names]))
    return np.array(rows)


def share_sensitivity(levels: Sequence[Level], found: Sequence[LevelEstimate]) -> dict[str, float]:
    """How far T_s, τ1, τ2 would move [%] if the held C were larger by 0.01; median over the levels, linear."""
    moves = []
    for level, one in zip(levels, found, strict=True):
        slopes = friction.gradient(one.curve, level.time_s)
        along = np.array([one.curve.Ts, one.curve.tau1, one.curve.tau2]) * (slopes[:3] @ slopes[3])
        moves.append(-inverse(one.runs.information[:3, :3]) @ along)
    return dict(zip(NAMES[:3], map(median, np.transpose(moves)), strict=True))


NEWTON_STEPS, ENOUGH = 25, 1e-10


def refit(points: Points, theta: Array, free: NDArray[np.bool_]) -> Descent:
    """Least costs over the parameters that are `free`, shape (4,), from θ, shape (L, 4), one row a level of `points`.

    τ1 and τ2 that cross are exchanged, unless one of them is held.
    """
    both = np.outer(free, free)

    def look(x: Array) -> tuple[Array, Array, Array]:
        natural = np.exp(np.clip(x, -60, 60)).T
        share = natural[3] = 1 / (1 + 1 / natural[3])
        cost, gradient, curvature = level_normal(natural, points)
        scale = natural.T.copy()
        scale[:, 3] *= 1 - share
        curvature = np.where(both, curvature * (scale[:, :, None] * scale[:, None, :]), np.eye(4))
        return cost, np.where(free, gradient.T * scale, 0.0), curvature

    def within(x: Array, move: Array) -> Array:
        tried = x - np.clip(move, -1.0, 1.0)
        if free[1] and free[2]:
            tried[:, 1:3] = np.sort(tried[:, 1:3], axis=1)
        if free[3]:
            tried[:, 3] = np.clip(tried[:, 3], -7.0, 7.0)
        return tried

    return descend(look, theta, NEWTON_STEPS, ENOUGH, within)


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


TERMS = {"Ts": 4, "tau1": 3, "tau2": 3}
"""Terms of the paper's polynomials, Eqs. (5)–(7)."""
SPARE_LEVELS = 4
"""Levels beyond the terms of a curve that are needed to see the scatter of single runs in it."""
FARTHEST_RECORDS = 3.0
"""Record lengths beyond which no τ2 is quoted: it would rest on the model's form and its C alone."""
FEW_DEGREES = 4.0
"""Degrees of freedom given to the within-run variance where nothing else is known."""


@dataclass(frozen=True, eq=False)
class LevelStatistics:
    """Levels with what their runs say, and the variance V of the logarithms of their parameters."""

    levels: tuple[Level, ...]
    estimates: tuple[LevelEstimate, ...]
    variance: Array
    """V, shape (L, k)."""
    degrees: Array
    """Degrees of freedom of V, shape (L, k)."""
    determined: Mask
    """Where a level determines a parameter, shape (L, k)."""
    source: str
    """repeats, curve or within: where V comes from."""
    scatter: PooledScatter | None
    """The pooled scatter, with repeats."""
    between: Array
    """a: variance between runs, shape (k,); NaN where it cannot be seen."""
    tau2_sets: Tau2Sets
    """What the runs allow τ2 to be, NaN where a constraint holds it or C is free."""
    converged: bool = True
    """Whether every level's own curve passed our verdict."""

    @property
    def open_tau2(self) -> Mask:
        """Levels whose record leaves τ2 open, held by no constraint, shape (L,)."""
        return _free_tau2(self.estimates) & ~self.determined[:, 2]

    @property
    def expected(self) -> Array:
        """V as one scatter for all levels would give it, shape (L, k); `variance` itself without repeats."""
        if self.scatter is None:
            return self.variance
        pooled = self.scatter.pooled + self.scatter.common
        return np.where(np.isfinite(pooled), pooled, self.variance)

    @property
    def repeats(self) -> Array:
        """Runs of each level, shape (L,)."""
        return np.array([estimate.runs.repeats for estimate in self.estimates])

    @cached_property
    def data(self) -> Data:
        """The levels' mean curves."""
        return data_of(self.levels)

    @property
    def share_free(self) -> bool:
        """Whether C of each level is a parameter too."""
        return bool(self.variance.shape[1] == 4)

    @property
    def duty_pct(self) -> Array:
        """Input of each level, shape (L,)."""
        return np.array([level.level for level in self.levels])

    @property
    def log_theta(self) -> Array:
        """Logarithms of the levels' parameters, shape (L, k)."""
        return np.array([estimate.runs.log_theta for estimate in self.estimates])

    @property
    def swept(self) -> bool:
        """Whether the repeats were recorded as sweeps, so that levels move together."""
        return self.scatter is not None and bool((self.scatter.common > 0).any())

    @property
    def total_degrees(self) -> float:
        """Degrees of freedom of what is pooled over all levels."""
        return self.scatter.total_degrees if self.scatter else median(self.degrees)


def level_statistics(
    levels: Sequence[Level], fits: Sequence[FrictionLevel], share_free: bool = False
) -> LevelStatistics:
    """The statistics of these levels and their friction curves."""
    estimates = []
    for level, fit in zip(levels, fits, strict=True):
        constrained = constrained_parameters(fit, float(level.time_s[-1]), share_free)
        estimates.append(level_estimate(level, fit.curve, constrained, share_free))
    converged = all(fit.solver is None or fit.solver.converged for fit in fits)
    return replace(pooled_statistics(levels, estimates), converged=converged)


def statistics_at_share(levels: Sequence[Level], share: float) -> LevelStatistics:
    """The statistics of the levels' own curves with C held at `share`."""
    return level_statistics(levels, fit_levels(data_of(levels), share))


def pooled_statistics(levels: Sequence[Level], estimates: Sequence[LevelEstimate]) -> LevelStatistics:
    """Pool what the levels say: by repeats, by a curve through single runs, or not at all."""
    per_level = [estimate.runs for estimate in estimates]
    counted = usable(estimates)
    within = np.array([runs.within for runs in per_level])
    scatter, source = None, "within"
    between = np.full(within.shape[1], np.nan)
    variance, degrees = within.copy(), np.full(within.shape, FEW_DEGREES)
    if any(runs.repeats > 1 for runs in per_level):
        scatter, source = pooled_scatter(per_level, counted), "repeats"
        repeats = np.array([runs.repeats for runs in per_level], dtype=float)
        finite = np.isfinite(scatter.variance).all(axis=0)
        variance = np.where(finite, scatter.variance, within / repeats[:, None])
        degrees = np.where(finite, scatter.degrees, FEW_DEGREES)
        between = scatter.between
    else:
        duty, theta = np.array([level.level for level in levels]), np.array([runs.log_theta for runs in per_level])
        records = np.array([runs.duration_s for runs in per_level])
        for k, name in enumerate(CURVES):
            row = counted[:, k]
            if name == "tau2":  # beyond its record it shows no scatter
                row = row & (np.exp(theta[:, k]) <= records)
            if row.sum() - TERMS[name] >= SPARE_LEVELS:
                between[k] = _between(duty[row], theta[row, k], within[row, k], TERMS[name])
                variance[:, k] = between[k] + within[:, k]
                degrees[:, k] = row.sum() - TERMS[name]
                source = "curve"
    sets = tau2_sets(levels, estimates, variance[:, 2], degrees[:, 2])
    determined = _determined(estimates, counted, variance, degrees, sets)
    return LevelStatistics(
        tuple(levels), tuple(estimates), variance, degrees, determined, source, scatter, between, sets
    )


def _between(u: Array, log_values: Array, within: Array, p: int) -> float:
    """Scatter a of single runs about a polynomial of p terms through the logarithms: Σ res²/(a + h) equals L − p."""
    design = np.vander((u - u.mean()) / np.ptp(u), p)

    def total(a: float) -> float:
        root = 1 / np.sqrt(np.maximum(within + a, 1e-18))
        left = log_values - design @ np.linalg.lstsq(design * root[:, None], log_values * root, rcond=None)[0]
        return float(((left * root) ** 2).sum())

    return paule_mandel(total, float(len(u) - p), float(np.var(log_values)) + 1e-12)[0]


def _free_tau2(estimates: Sequence[LevelEstimate]) -> Mask:
    return np.array(["tau2" not in estimate.constrained for estimate in estimates])


def _determined(
    estimates: Sequence[LevelEstimate], counted: Mask, variance: Array, degrees: Array, sets: Tau2Sets
) -> Mask:
    """Where a level determines a parameter, shape (L, k); `counted`: it shows the parameter's scatter.

    τ2 is known within a factor of three, at most three records long, and no τ2 beyond that and beyond the record is
    allowed; where most levels fail in that, those that do not have come out short by chance. T_s and τ1 rest on τ2: a
    level that leaves it open has no say in them where the others have.
    """
    records = np.array([estimate.runs.duration_s for estimate in estimates])
    tau2 = np.exp([estimate.runs.log_theta[2] for estimate in estimates])
    known = counted[:, 2] & (t_quantile(degrees[:, 2]) * np.sqrt(variance[:, 2]) < np.log(UNDETERMINED))
    tested = np.isfinite(sets.tau2_s[:, 0])
    known &= tau2 <= FARTHEST_RECORDS * records
    known &= np.where(tested, sets.tau2_s[:, 1] < np.maximum(UNDETERMINED * tau2, records), tau2 <= records)
    free = _free_tau2(estimates)
    if 2 * known.sum() < free.sum():
        known[:] = False
    determined = counted.copy()
    determined[:, 2] = known
    if known.any():
        determined[:, :2] &= (known | ~free)[:, None]
    return determined
