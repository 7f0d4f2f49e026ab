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
from eaid.fitting.result import LevelFit
from eaid.steps.stepset import Level
from eaid.uncertainty.curve import Curve, at_levels, curve_of_single_runs, curve_with_repeats
from eaid.uncertainty.levels import LevelEvidence, held_parameters, level_evidence, scatter_of, usable
from eaid.uncertainty.scatter import Mask, Scatter

TERMS = {"Ts": 4, "tau1": 3, "tau2": 3}
"""Terms of the paper's polynomials, Eqs. (5)–(7)."""
SPARE_LEVELS = 4
"""Levels beyond the terms of a curve that are needed to see the scatter of single runs in it."""
FEW_DEGREES = 4.0
"""Degrees of freedom given to the within-run variance where nothing else is known."""


@dataclass(frozen=True, eq=False)
class Ground:
    """Levels with their evidence, and the variance V of the logarithms of their parameters."""

    levels: tuple[Level, ...]
    evidence: tuple[LevelEvidence, ...]
    variance: Array
    """V, shape (L, k)."""
    degrees: Array
    """Degrees of freedom of V, shape (L, k)."""
    known: Mask
    """Where a level determines a parameter, shape (L, k)."""
    source: str
    """repeats, curve or within: where V comes from."""
    scatter: Scatter | None
    """The pooled scatter, with repeats."""
    between: Array
    """a: variance between runs, shape (k,); NaN where it cannot be seen."""
    converged: bool = True
    """Whether every level's own curve passed our verdict."""

    @property
    def expected(self) -> Array:
        """V as one scatter for all levels would give it, shape (L, k); `variance` itself without repeats."""
        if self.scatter is None:
            return self.variance
        pooled = self.scatter.pooled + self.scatter.common
        return np.where(np.isfinite(pooled), pooled, self.variance)

    @cached_property
    def data(self) -> Data:
        """The levels' mean curves."""
        return data_of(self.levels)

    @property
    def duty_pct(self) -> Array:
        """Input of each level, shape (L,)."""
        return np.array([level.level for level in self.levels])

    @property
    def log_theta(self) -> Array:
        """Logarithms of the levels' parameters, shape (L, k)."""
        return np.array([one.evidence.log_theta for one in self.evidence])

    @property
    def own_variance(self) -> Array:
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
        for one, v, known in zip(self.evidence, self.variance, self.known, strict=True):
            if one.evidence.repeats > 1 and known.all() and (v > 0).all():
                d = one.evidence.influence / np.sqrt(v)
                total += d.T @ d
        size = np.sqrt(np.diag(total))
        if not (size > 0).all():
            return np.eye(k)
        return np.asarray(total / np.outer(size, size))

    def shifts(self) -> Array:
        """Covariance S of each level's log θ, for the joint fit, shape (L, k, k)."""
        sd = np.sqrt(self.own_variance)
        return np.asarray(self.correlation() * (sd[:, :, None] * sd[:, None, :]))


def ground(levels: Sequence[Level], fits: Sequence[LevelFit], share_free: bool = False) -> Ground:
    """The ground of these levels and their friction curves."""
    found = [
        level_evidence(level, fit.curve, held_parameters(fit), share_free)
        for level, fit in zip(levels, fits, strict=True)
    ]
    return replace(from_evidence(levels, found), converged=all(fit.solver.converged for fit in fits))


def ground_at_share(levels: Sequence[Level], share: float) -> Ground:
    """The ground of the levels' own curves with C held at `share`."""
    return ground(levels, fit_levels(data_of(levels), share))


def from_evidence(levels: Sequence[Level], found: Sequence[LevelEvidence]) -> Ground:
    """Pool what the levels say: by repeats, by a curve through single runs, or not at all."""
    counted = usable(found)
    within = np.array([one.evidence.within for one in found])
    repeats = np.array([one.evidence.repeats for one in found], dtype=float)
    records = np.array([one.evidence.duration_s for one in found])
    theta = np.array([one.evidence.log_theta for one in found])
    known = counted & (np.arange(theta.shape[1]) != 2) | (counted & (np.exp(theta[:, 2]) <= records)[:, None])
    if repeats.max() > 1:
        scatter = scatter_of(found)
        spoken = np.isfinite(scatter.variance).all(axis=0)
        variance = np.where(spoken, scatter.variance, within / repeats[:, None])
        degrees = np.where(spoken, scatter.degrees, FEW_DEGREES)
        return Ground(tuple(levels), tuple(found), variance, degrees, known, "repeats", scatter, scatter.between)
    between = np.full(theta.shape[1], np.nan)
    variance, degrees = within.copy(), np.full(within.shape, FEW_DEGREES)
    duty = np.array([level.level for level in levels])
    source = "within"
    for k, name in enumerate(("Ts", "tau1", "tau2")):
        row = known[:, k]
        if row.sum() - TERMS[name] >= SPARE_LEVELS:
            curve = curve_of_single_runs(duty[row], theta[row, k], within[row, k], TERMS[name])
            between[k] = curve.between
            variance[:, k] = curve.between + within[:, k]
            degrees[:, k] = curve.degrees
            source = "curve"
    return Ground(tuple(levels), tuple(found), variance, degrees, known, source, None, between)


def curves(ground: Ground) -> dict[str, Curve]:
    """Polynomials of T_s, τ1, τ2 through the logarithms of the levels that determine them; none where none do."""
    result = {}
    for k, name in enumerate(("Ts", "tau1", "tau2")):
        row = ground.known[:, k]
        if not row.any():
            continue
        terms = min(TERMS[name], int(row.sum()))
        duty, theta = ground.duty_pct[row], ground.log_theta[row, k]
        if ground.source != "repeats" and row.sum() - terms >= SPARE_LEVELS:
            within = np.array([one.evidence.within[k] for one in ground.evidence])[row]
            curve = curve_of_single_runs(duty, theta, within, terms)
        elif ground.scatter is None:
            curve = curve_with_repeats(duty, theta, ground.variance[row, k], float(ground.degrees[row, k].min()), terms)
        else:
            weigh, real = ground.scatter.pooled[row, k], ground.own_variance[row, k]
            curve = curve_with_repeats(duty, theta, weigh, ground.total_degrees, terms, real)
        result[name] = at_levels(curve, row, TERMS[name], None if ground.scatter is None else ground.scatter.worth[k])
    return result


def curve_degrees(ground: Ground, curve: Curve, name: str) -> Array:
    """Degrees of freedom of a curve's band at each level, what sweeps have in common counted in (Satterthwaite)."""
    degrees = curve.degrees_at(ground.duty_pct)
    if ground.scatter is None or not ground.swept:
        return degrees
    common = float(ground.scatter.common[("Ts", "tau1", "tau2").index(name)])
    own = curve.log_sd(ground.duty_pct) ** 2
    return np.asarray((own + common) ** 2 / (own**2 / degrees + common**2 / ground.scatter.common_degrees))
