"""What all intervals stand on: each level's curve, what its runs say, and the variance that follows.

With repeats the scatter is pooled over levels. With one run a level the scatter shows only as the levels' distance from
a curve through them, which takes four levels more than the curve has terms. Else all that is left is what one run shows
within itself: a lower bound, and said to be one.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from eaid.arrays import Array, median
from eaid.fitting.data import Data, data_of
from eaid.fitting.levels import fit_levels
from eaid.results.friction import FrictionLevel
from eaid.steps.stepset import Level
from eaid.uncertainty.curve import Curve, at_levels, curve_of_single_runs, curve_with_repeats
from eaid.uncertainty.levels import CURVES, UNDETERMINED, LevelEstimate, constrained_parameters, level_estimate, usable
from eaid.uncertainty.scatter import Mask, PooledScatter, pooled_scatter
from eaid.uncertainty.student_t import satterthwaite, t_quantile
from eaid.uncertainty.tau2_range import Tau2Sets, tau2_sets

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

    def open_curves(self) -> tuple[str, ...]:
        """Parameters whose curve too few levels support: fewer than half, than it has terms, or with τ2 left open."""
        count = len(self.levels)
        if 2 * self.open_tau2.sum() > count:
            return tuple(TERMS)
        known = dict(zip(TERMS, self.determined.sum(axis=0).tolist(), strict=False))
        return tuple(name for name, n in known.items() if n < min(TERMS[name], count) or 2 * n < count)

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
    def unshared_variance(self) -> Array:
        """V without what all levels of a sweep share, shape (L, k)."""
        return self.variance if self.scatter is None else np.minimum(self.scatter.own, self.variance)

    @property
    def swept(self) -> bool:
        """Whether the repeats were recorded as sweeps, so that levels move together."""
        return self.scatter is not None and bool((self.scatter.common > 0).any())

    @property
    def total_degrees(self) -> float:
        """Degrees of freedom of what is pooled over all levels."""
        return self.scatter.total_degrees if self.scatter else median(self.degrees)

    def correlation(self) -> Array:
        """Correlation of the scatter of (T_s, τ1, τ2[, C]) within a level, pooled over levels, shape (k, k)."""
        k = self.variance.shape[1]
        total = np.zeros((k, k))
        for estimate, variance, known in zip(self.estimates, self.variance, self.determined, strict=True):
            if estimate.runs.repeats > 1 and known.all() and (variance > 0).all():
                scaled = estimate.runs.influence / np.sqrt(variance)
                total += scaled.T @ scaled
        size = np.sqrt(np.diag(total))
        if not (size > 0).all():
            return np.eye(k)
        return np.asarray(total / np.outer(size, size))

    def shifts(self) -> Array:
        """Covariance S of each level's log θ, for the joint fit, shape (L, k, k)."""
        sd = np.sqrt(self.unshared_variance)
        return np.asarray(self.correlation() * (sd[:, :, None] * sd[:, None, :]))


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
                curve = curve_of_single_runs(duty[row], theta[row, k], within[row, k], TERMS[name])
                between[k] = curve.between
                variance[:, k] = curve.between + within[:, k]
                degrees[:, k] = curve.degrees
                source = "curve"
    sets = tau2_sets(levels, estimates, variance[:, 2], degrees[:, 2])
    determined = _determined(estimates, counted, variance, degrees, sets)
    return LevelStatistics(
        tuple(levels), tuple(estimates), variance, degrees, determined, source, scatter, between, sets
    )


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


def curves(stats: LevelStatistics) -> dict[str, Curve]:
    """Polynomials of T_s, τ1, τ2 through the logarithms of the levels that determine them; none where none do."""
    result = {}
    for k, name in enumerate(CURVES):
        row = stats.determined[:, k]
        if not row.any():
            continue
        terms = min(TERMS[name], int(row.sum()))
        duty, theta = stats.duty_pct[row], stats.log_theta[row, k]
        if stats.source != "repeats" and row.sum() - terms >= SPARE_LEVELS:
            within = np.array([estimate.runs.within[k] for estimate in stats.estimates])[row]
            curve = curve_of_single_runs(duty, theta, within, terms)
        elif stats.scatter is None:
            curve = curve_with_repeats(duty, theta, stats.variance[row, k], float(stats.degrees[row, k].min()), terms)
        else:
            weigh, real = stats.scatter.pooled[row, k], stats.unshared_variance[row, k]
            curve = curve_with_repeats(duty, theta, weigh, stats.total_degrees, terms, real)
        components = None if stats.scatter is None else stats.scatter.components[k]
        result[name] = at_levels(curve, row, TERMS[name], components)
    return result


def curve_degrees(stats: LevelStatistics, curve: Curve, name: str) -> Array:
    """Degrees of freedom of a curve's band at each level, what sweeps have in common counted in (Satterthwaite)."""
    degrees = curve.degrees_at(stats.duty_pct)
    if stats.scatter is None or not stats.swept:
        return degrees
    common = float(stats.scatter.common[CURVES.index(name)])
    variance = curve.log_sd(stats.duty_pct) ** 2
    return satterthwaite((variance, common), (degrees, stats.scatter.common_degrees))
