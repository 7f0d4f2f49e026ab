"""Intervals from whole runs (cluster sandwich): how runs move an estimate, and how sure any number of it is.

Near its minimum an estimate answers to the own estimate θ_l of a level by G_l = H⁻¹ Σ_t w ∂f/∂x ∂f/∂θ_l, H the
curvature of half the cost. A number with the gradient g then has the variance V = Σ_l g'G_l S_l G_l'g, S_l the
covariance of θ_l: how its runs scatter, pooled over the levels about it, and V's degrees of freedom by Satterthwaite.
Where repeats were recorded as sweeps, the excess of Σ_r (Σ_l g'G_l d_lr)²/R/(R − 1) is added, with R − 1, d_lr how far
run r alone would move θ_l.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.special import stdtrit

from eaid.arrays import Array
from eaid.results.common import Interval

NOMINAL = 0.95  # Coverage that every interval of eaid claims
# Degrees of freedom given to the noise within single runs: where nothing else is known, and beside what levels show
FEW_DEGREES, NOISE_DEGREES = 4.0, 12.0
FARTHEST_END = 50.0  # Logarithm beyond which an end is none


def t_quantile(degrees: float | Array, nominal: float = NOMINAL) -> Any:
    """Two-sided quantile of Student's t; infinite degrees of freedom give the normal one, none give infinity."""
    many = np.asarray(degrees, dtype=np.float64)
    t = np.where(many > 0, stdtrit(np.clip(many, 1e-3, 1e12), (1 + nominal) / 2), np.inf)
    return t if isinstance(degrees, np.ndarray) else float(t)


def interval_of(value: float, variance: float, degrees: float) -> tuple[float, float]:
    """value ± t √V."""
    reach = t_quantile(degrees) * float(np.sqrt(variance))
    return value - reach, value + reach


def log_interval_of(value: float | None, variance: float, degrees: float) -> Interval:
    """value · exp(±t √V), V of the logarithm; None of what is not above 0, or where the interval has no end."""
    if value is None or value <= 0:
        return None
    reach = t_quantile(degrees) * float(np.sqrt(variance))
    return (value * float(np.exp(-reach)), value * float(np.exp(reach))) if reach < FARTHEST_END else None


def satterthwaite(parts: Sequence[Array | float], degrees: Sequence[Array | float]) -> Array:
    """Degrees of freedom of the sum of independent variances: (Σ v)²/Σ(v²/ν), elementwise."""
    spread = sum(np.square(v) / df for v, df in zip(parts, degrees, strict=True))
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.square(sum(parts)) / spread)


def textbook(residuals: Sequence[Array], parameters: int) -> tuple[float, float]:
    """The noise's variance s² = Σ r'r/(N − P) as if every sample's error were its own, and N − P."""
    spare = sum(map(len, residuals)) - parameters
    return sum(float(r @ r) for r in residuals) / max(spare, 1), float(spare)


@dataclass(frozen=True, eq=False)
class LevelScatter:
    """How k numbers of L levels (T_s, τ1, …) scatter in logarithms; M groups show it: levels with repeats or all."""

    expected: Array  # Variance of each level's own estimate as one scatter for all levels gives it, (L, k)
    alike: Array  # Correlations within a level, (L, k, k)
    mixed: Array  # How much each group counts for the scatter of each level, rows of sum 1, (k, L, M)
    relative: Array  # Scatter that each group shows, as a part of the expected, (k, M)
    degrees: Array  # Degrees of freedom of each group, (M,)
    # a: variance between runs beyond what one run shows within itself, (k,); NaN where it cannot be seen
    between: Array
    common: Array  # Variance that all levels share because repeats were sweeps, (k,); 0 where they were not
    # Where repeats were sweeps: how far each run alone would move its level's estimate, (R, k) of each level
    shifts: tuple[Array, ...] = ()

    def alone(self, i: int) -> "LevelScatter":
        """The same of one level."""
        one = slice(i, i + 1)
        parts = {"expected": self.expected[one], "alike": self.alike[one], "mixed": self.mixed[:, one]}
        return replace(self, **parts, shifts=self.shifts[one])

    def covariance(self, actual: bool) -> Array:
        """Of each level's own estimate, (L, k, k): as expected, or as its neighbourhood shows it."""
        variance = self.expected
        if actual:
            variance = variance * np.einsum("klm,km->lk", self.mixed, self.relative)
        sd = np.sqrt(variance)
        return np.asarray(self.alike * sd[:, :, None] * sd[:, None, :])


@dataclass(frozen=True, eq=False)
class Influence:
    """How n numbers answer to the levels that they were estimated from."""

    gain: Array  # Change of the numbers where the own estimates of a level change, (L, k, n)
    levels: LevelScatter
    singles: Array  # Independent parts of what levels of a single run contribute, (parts, n)
    single_degrees: float  # Degrees of freedom of those
    # What they contribute at least, by the noise within them: how few levels depart hides it where one tells a number
    least: Array | None = None

    def of(self, rows: Array) -> "Influence":
        """The same for other numbers, whose gradients are `rows`, shape (m, n)."""
        least = None if self.least is None else self.least @ rows.T
        return replace(self, gain=self.gain @ rows.T, singles=self.singles @ rows.T, least=least)

    def variance(self) -> tuple[Array, Array]:
        """Variance of each number and its degrees of freedom, (n,) each (Satterthwaite)."""
        levels, gain = self.levels, self.gain
        by_level = np.einsum("lin,lij,ljn->ln", gain, levels.covariance(actual=False), gain)
        along = gain**2 * levels.expected[:, :, None]
        share = along * (by_level / np.maximum(along.sum(axis=1), 1e-300))[:, None]
        expected = np.einsum("lkn,klm->kmn", share, levels.mixed)
        part = np.einsum("kmn,km->mn", expected, levels.relative)
        total, usual = part.sum(axis=0), expected.sum(axis=0)
        with np.errstate(all="ignore"):  # where nothing tells an unknown, its gain is endless
            known = levels.degrees[:, None] > 0
            spread = np.where(known, usual**2 / np.where(known, levels.degrees[:, None], 1.0), 0.0).sum(axis=0)
            degrees = np.where(spread > 0, usual.sum(axis=0) ** 2 / spread, levels.degrees.sum())
            alone = (self.singles**2).sum(axis=0)
            excess = np.maximum((self._sweeps() ** 2).sum(axis=0) - total, 0.0) if levels.shifts else 0.0 * total
            sweeps = max(len(levels.shifts[0]) - 1.0, 1.0) if levels.shifts else 1.0
            within = 0.0 * total if self.least is None else np.maximum((self.least**2).sum(axis=0) - alone, 0.0)
            counts = (np.maximum(degrees, 1e-300), max(self.single_degrees, 1e-300), sweeps, NOISE_DEGREES)
            degrees = satterthwaite((total, alone, excess, within), counts)
        whole = total + alone + excess + within
        return whole, np.where(whole > 0, degrees, levels.degrees.sum() + self.single_degrees * bool(len(self.singles)))

    def covariance(self) -> Array:
        """Covariance of the numbers, (n, n)."""
        V = np.einsum("lin,lij,ljm->nm", self.gain, self.levels.covariance(actual=True), self.gain)
        alone = self.singles.T @ self.singles
        if self.least is not None:
            alone = _at_least(alone, self.least)
        return _at_least(V + alone, self._sweeps()) if self.levels.shifts else np.asarray(V + alone)

    def _sweeps(self) -> Array:
        """Rows whose squares sum to the variance where every sweep is one observation, (R, n)."""
        together = np.einsum("lrk,lkn->rn", np.array(self.levels.shifts), self.gain)
        return np.asarray(together / np.sqrt(len(together) * (len(together) - 1)))


def _at_least(V: Array, rows: Array) -> Array:
    """A covariance, larger where rows whose squares sum to another are, (n, n)."""
    scale = np.sqrt(np.maximum(np.diag(V), 1e-300))
    size, ways = np.linalg.eigh((rows.T @ rows - V) / np.outer(scale, scale))
    return np.asarray(V + (ways * np.maximum(size, 0.0)) @ ways.T * np.outer(scale, scale))


def standard_errors(covariance: Array) -> Array:
    """Independent moves by one standard error each whose squares sum to a covariance, as rows, (n, n)."""
    size, ways = np.linalg.eigh(covariance)
    return np.asarray((ways * np.sqrt(np.maximum(size, 0.0))).T)


def gains_of(information: Array, along: Array, take: Array, held: Array) -> tuple[Array, Array]:
    """How n unknowns answer to the levels' own estimates, (L, k, n), and the inverse of half the cost's curvature.

    `information` is Σ w s s' of each level, (L, j, j), s the slopes of its curve by j numbers, `along` the same with
    its own parameters' slopes, (L, k, j), and `take` how the numbers go with the unknowns, (L, j, n). `held` are rows
    of active constraints, (m, n).
    """
    curvature = np.einsum("lin,lij,ljm->nm", take, information, take, optimize=True)
    unseen = np.flatnonzero(np.diag(curvature) == 0)
    curvature[unseen, unseen] = 1.0
    back = free_inverse(curvature, held)
    return along @ (take @ back), back


def free_inverse(curvature: Array, held: Array) -> Array:
    """Inverse of a curvature in the directions that no row of `held` blocks, in scaled form, (n, n)."""
    size = np.diag(curvature)
    scale = 1 / np.sqrt(np.where(size > 0, size, 1.0))
    ways = np.diag(scale)
    if len(held):
        _, size, right = np.linalg.svd(held * scale)
        ways = ways @ right[int((size > 1e-9 * size[0]).sum()) :].T
    ways = ways / np.sqrt(np.maximum(np.diag(ways.T @ curvature @ ways), 1e-300))
    return np.asarray(ways @ np.linalg.pinv(ways.T @ curvature @ ways, rcond=1e-13) @ ways.T)


OUTWARD = (0.5, 0.8, 1.2, 1.8, 2.7, 4.0, 6.0)  # How far out the score test looks for an end, in half-widths


def score_test_end(at: Callable[[float], tuple[Array, float] | None]) -> Array | None:
    """Values where a number has been moved outward until the data reject it; None: they never do.

    Neyman's score test: from a supposed place the Newton step leads back by more than t standard deviations there.
    `at` gives the values so many half-widths out, and that ratio; None where no model goes.
    """
    nearest = at(0.0)
    assert nearest is not None
    last, before = nearest[0], 0.0
    for factor in OUTWARD:
        here = at(factor)
        if here is None:
            return last if before > 0 else None  # a constraint that meets the estimate is no end that data give
        values, ratio = here
        if ratio >= 1:
            return np.asarray(last + (values - last) * (1 - before) / (ratio - before))
        last, before = values, ratio
    return None
