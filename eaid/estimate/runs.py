"""What the runs of one level say about its parameters: information, influence of each run, within-run variance.

With J = ∂f/∂log θ on the n samples of a level and A = J'J:

- influence of a run, how far it alone would move the fit:  d_r = A⁻¹ J' (y_r − ȳ);
- within-run variance of a single run:  h = mean over runs of diag(A⁻¹ Ω A⁻¹), Ω the Bartlett sum over J e_r, where
  e_r is the residual about the run's own fit; the largest over windows of 0.1, 0.3, 1 and 2 s.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TypeAlias, overload

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.special import fdtrc, stdtrit

from eaid.arrays import Array, inverse, median
from eaid.results.common import Interval

WINDOWS_S = (0.1, 0.3, 1.0, 2.0)
"""Bartlett windows [s]: from the friction ripple's memory to a third of a rotor turn."""

BINS_PER_WINDOW = 10
"""Scores are summed over a tenth of the shortest window before the Bartlett sum; no memory is that short."""


@dataclass(frozen=True, eq=False)
class RunStatistics:
    """One level's parameters in logs (k of them), and what its R runs say about them."""

    level: float
    log_theta: Array
    """Logarithms of the fitted parameters, shape (k,)."""
    information: Array
    """A = J'J of one run, shape (k, k) [output²]."""
    influence: Array
    """Shift that each run alone would give, shape (R, k); the rows sum to zero."""
    within: Array
    """Within-run variance h of a single run's parameters, shape (k,)."""
    duration_s: float
    """Length of the record after the step [s]."""

    @property
    def repeats(self) -> int:
        """R, the number of runs."""
        return len(self.influence)

    @property
    def inverse(self) -> Array:
        """A⁻¹, the covariance of the parameters under noise of variance 1 without memory, shape (k, k)."""
        return inverse(self.information)

    @property
    def scatter(self) -> Array:
        """v = Σ d²/(R − 1): variance between runs, shape (k,); NaN for a single run."""
        if self.repeats < 2:
            return np.full(len(self.log_theta), np.nan)
        return np.asarray(np.sort(self.influence**2, axis=0).sum(axis=0) / (self.repeats - 1))


def bartlett_variance(time_s: Array, scores: Array) -> Array:
    """Variance of the sum of correlated scores, by Bartlett windows; shape (windows, k) for scores (n, k).

    Σ_|j|<m (1 − |j|/m) Γ_j equals the mean square of all sums over m neighbours (zeros beyond the ends), so running
    sums give it in O(n). Windows longer than half the record are cut to it.
    """
    return np.array([np.einsum("ij,ij->i", sums, sums) / m for sums, m in _moving_sums(time_s, scores)])


def bartlett_covariance(time_s: Array, scores: Array) -> Array:
    """The same as covariances, shape (windows, k, k)."""
    return np.array([sums @ sums.T / m for sums, m in _moving_sums(time_s, scores)])


def _moving_sums(time_s: Array, scores: Array) -> Iterator[tuple[Array, int]]:
    """Sums of the scores over m neighbouring bins, (k, n + m − 1), and m, of each window."""
    duration_s = float(time_s[-1] - time_s[0])
    bin_s = min(WINDOWS_S) / BINS_PER_WINDOW
    if duration_s > 4 * len(time_s) * bin_s:  # a slow clock, or one in another unit: no more bins than data
        bin_s = duration_s / len(time_s)
    bins = np.floor((time_s - time_s[0]) / bin_s + 1e-6).astype(np.int64)
    sums = np.zeros((scores.shape[1], int(bins[-1]) + 1))
    starts = np.flatnonzero(np.r_[True, bins[1:] != bins[:-1]])
    sums[:, bins[starts]] = np.add.reduceat(scores.T, starts, axis=1)
    running = np.cumsum(sums, axis=1)
    for window_s in WINDOWS_S:
        m = max(1, min(round(window_s / bin_s), round(duration_s / 2 / bin_s)))
        before = np.zeros((len(sums), m))
        padded = np.concatenate([before, running, np.repeat(running[:, -1:], m - 1, axis=1)], axis=1)
        yield padded[:, m:] - padded[:, :-m], m


def run_statistics(
    level: float,
    time_s: Array,
    runs_nm: Array,
    jacobian: Array,
    log_theta: Array,
    *,
    noise_nm: Array,
    mean_nm: Array,
    hessian: Array | None = None,
) -> RunStatistics:
    """The statistics of one level from its runs (R, n) and ∂f/∂log θ (n, k).

    `noise_nm`, shape (R, n), are the residuals of each run about its own best curve (`run_residuals`); `mean_nm` is the
    mean of the runs. A model that is wrong by design gives its full `hessian` Σ (J'J − e ∇²f), shape (k, k), in place
    of J'J.
    """
    information = jacobian.T @ jacobian if hessian is None else hessian
    directions = jacobian @ inverse(information)
    return RunStatistics(
        level=level,
        log_theta=log_theta,
        information=information,
        influence=(runs_nm - mean_nm) @ directions,
        within=within_variance(time_s, noise_nm, directions),
        duration_s=float(time_s[-1] - time_s[0]),
    )


def within_variance(time_s: Array, noise_nm: Array, directions: Array) -> Array:
    """h, shape (k,), from residuals (R, n) and how the parameters answer to the samples, J A⁻¹, shape (n, k)."""
    scores = (noise_nm[:, None] * np.ascontiguousarray(directions.T)).reshape(-1, len(time_s)).T
    variances = bartlett_variance(time_s, scores).reshape(len(WINDOWS_S), len(noise_nm), -1)
    # sorted: the order of the runs changes no rounding
    return np.asarray(np.sort(variances, axis=1).mean(axis=1).max(axis=0))


def textbook(jacobians: Sequence[Array], residuals: Sequence[Array], parameters: int) -> tuple[Array, float, float]:
    """Σ J'J, the noise's variance s² = Σ r'r/(N − P) as if every sample's error were its own, and N − P."""
    information = sum(J.T @ J for J in jacobians)
    spare = sum(map(len, residuals)) - parameters
    cost = sum(float(r @ r) for r in residuals)
    return np.asarray(information), cost / max(spare, 1), float(spare)


def run_residuals(runs_nm: Array, fitted_nm: Array, jacobian: Array) -> Array:
    """Residuals of each run about its own fit [output], one linear step from the level's fit, shape (R, n)."""
    left = runs_nm - fitted_nm
    basis, triangle = np.linalg.qr(jacobian)
    turn, size, _ = np.linalg.svd(triangle)
    basis = basis @ turn[:, size > 1e-10 * size[0]]  # where τ1 meets τ2 two columns are one, and the third is rounding
    return np.asarray(left - (left @ basis) @ basis.T)


NOMINAL = 0.95
"""Coverage that every interval of eaid claims."""

FARTHEST = 50.0
"""Logarithm beyond which an end is none."""

Degrees: TypeAlias = dict[str, "float | Array"]
"""Degrees of freedom by parameter; arrays have one entry a level."""


@overload
def t_quantile(degrees: float, nominal: float = NOMINAL) -> float: ...
@overload
def t_quantile(degrees: Array, nominal: float = NOMINAL) -> Array: ...
def t_quantile(degrees: float | Array, nominal: float = NOMINAL) -> float | Array:
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
    return (value * float(np.exp(-reach)), value * float(np.exp(reach))) if reach < FARTHEST else None


def satterthwaite(parts: Sequence[Array | float], degrees: Sequence[Array | float]) -> Array:
    """Degrees of freedom of the sum of independent variances: (Σ v)²/Σ(v²/ν), elementwise."""
    spread = sum(np.square(v) / df for v, df in zip(parts, degrees, strict=True))
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.square(sum(parts)) / spread)


@dataclass(frozen=True, eq=False)
class VarianceComponents:
    """What the variances of levels are made of, V_l = e_l Σ_m w_lm χ²_m/ν_m, to count the degrees of their sums."""

    expected: Array
    """e: variance that one scatter for all levels gives, shape (L,)."""
    weights: Array
    """w: how much level m counts for level l, rows of sum 1, shape (L, L)."""
    own_degrees: Array
    """ν: degrees of freedom of each level's own runs, shape (L,)."""

    def degrees(self, squares: Array) -> Array:
        """Satterthwaite's degrees of freedom of Σ_l s_l V_l, for rows s of `squares`, shape (n, L); shape (n,)."""
        finite = np.isfinite(self.expected)
        parts = (squares * np.where(finite, self.expected, 0.0)) @ self.weights
        spread = (parts**2 / np.where(self.own_degrees > 0, self.own_degrees, np.inf)).sum(axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            degrees = parts.sum(axis=1) ** 2 / spread
        return np.asarray(np.where(spread > 0, degrees, self.own_degrees.sum()))


Mask: TypeAlias = NDArray[np.bool_]

NEIGHBOURS = 4.5
"""Degrees of freedom that a level's scatter takes from its neighbourhood: itself and both neighbours where R = 3."""
SMOOTH_LEVELS, SMOOTH_TERMS = 5, 4
"""From so many levels on the within-run variance is a smooth function of the level, log h a polynomial of four terms:
a τ2 that came out low by chance must not look well determined as well."""
CHANCE = 0.01
"""Probability at which scatter that is alike over the levels would be told to change, and independent repeats be taken
for sweeps."""
SWEPT_LEVELS = 3
"""Levels at least that show sweeps."""


@dataclass(frozen=True, eq=False)
class PooledScatter:
    """Variance of the levels' parameters, with the degrees of freedom that their intervals take."""

    between: Array
    """a: variance between runs beyond what one run shows within itself, shape (k,)."""
    variance: Array
    """V of each level's log θ, shape (L, k)."""
    degrees: Array
    """Degrees of freedom of V, shape (L, k)."""
    pooled: Array
    """V of each level's log θ as one scatter for all levels gives it, shape (L, k)."""
    total_degrees: float
    """Σ(R − 1) over the levels, or L − p with one run a level."""
    own: Array
    """V without what all levels of a sweep have in common, shape (L, k)."""
    components: tuple[VarianceComponents, ...]
    """What `own` is made of, one a parameter."""
    common: Array
    """Variance that all levels share because repeats were sweeps, shape (k,); 0 where they were not."""
    common_degrees: float
    """R − 1, the degrees of freedom of `common`."""


def paule_mandel(total: Callable[[float], float], wanted: float, scale: float) -> tuple[float, float]:
    """The a ≥ 0 at which the falling function `total` meets `wanted`, and q (1, or below it where a = 0)."""
    at_zero = total(0.0)
    if at_zero <= wanted:
        return 0.0, at_zero / wanted
    low, high = 0.0, max(scale, 1e-300)
    while total(high) > wanted:
        low, high = high, 4 * high
    return float(brentq(lambda a: total(a) - wanted, low, high, xtol=1e-13 * high, rtol=1e-12)), 1.0


def pooled_scatter(levels: Sequence[RunStatistics], usable: Mask | None = None) -> PooledScatter:
    """Scatter of levels with repeats; levels of a single run borrow it. Needs one level with R ≥ 2.

    Where `usable`, shape (L, k), is false, a parameter has no say in the pool (a constraint holds it there) and borrows
    from it. Where repeats were recorded as sweeps, what a sweep's levels have in common is taken out first and added to
    V at the end.
    """
    repeats = np.array([level.repeats for level in levels], dtype=float)
    v = np.array([np.nan_to_num(level.scatter) for level in levels])
    h = np.array([np.maximum(level.within, 1e-300) for level in levels])
    x = np.array([level.level for level in levels])
    counted = np.ones(v.shape, dtype=bool) if usable is None else usable
    count = v.shape[1]
    between, common = np.zeros(count), np.zeros(count)
    pooled, variance, degrees = np.zeros_like(v), np.zeros_like(v), np.zeros_like(v)
    components: list[VarianceComponents] = []
    for k in range(count):
        own = (repeats - 1) * counted[:, k]
        shared = common_shifts(levels, k) if counted[:, k].all() else None
        if shared is not None:
            common[k] = shared @ shared / (len(shared) - 1) / len(shared)
            own = own * (len(levels) - 1) / len(levels)
            left = np.array([level.influence[:, k] for level in levels]) - shared
            v[:, k] = (left**2).sum(axis=1) / (len(shared) - 1) * len(levels) / (len(levels) - 1)
        total = float(own.sum())
        if total == 0:
            pooled[:, k] = variance[:, k] = np.inf
            components.append(VarianceComponents(np.full(len(levels), np.inf), np.eye(len(levels)), own))
            continue
        within = smoothed(h[:, k], x, own > 0)
        sums = own * v[:, k]
        chi_square = partial(lambda s, h, a: float((s / (a + h)).sum()), sums, within)
        between[k], q = paule_mandel(chi_square, total, float(v[own > 0, k].max()))
        pooled[:, k] = q * (between[k] + within) / repeats
        relative = v[:, k] / np.maximum(repeats * pooled[:, k], 1e-300)
        mixed = neighbours(own)
        components.append(VarianceComponents(pooled[:, k], mixed, own))
        variance[:, k] = pooled[:, k] * (mixed @ relative)
        degrees[:, k] = components[k].degrees(np.eye(len(levels)))
    most = float(repeats.max() - 1)
    with np.errstate(divide="ignore", invalid="ignore"):
        together = satterthwaite((variance, common), (degrees, most))
    return PooledScatter(
        between=between,
        variance=variance + common,
        degrees=np.where(common > 0, together, degrees),
        pooled=pooled,
        total_degrees=float((repeats - 1).sum()),
        own=variance,
        components=tuple(components),
        common=common,
        common_degrees=most,
    )


def common_shifts(levels: Sequence[RunStatistics], k: int) -> Array | None:
    """m_r, what every level's run r has in common in parameter k, shape (R,); None where repeats are independent.

    Runs are matched by their place: the first run of each level was one sweep, and so on. A two-way analysis of
    variance of the runs' influences (levels × repeats): F = L Σ m_r²/(R − 1) against what is left.
    """
    counts = {level.repeats for level in levels}
    if len(levels) < SWEPT_LEVELS or len(counts) != 1 or counts == {1}:
        return None
    d = np.array([level.influence[:, k] for level in levels])
    if not np.isfinite(d).all():
        return None
    count, repeats = d.shape
    mean = d.mean(axis=0)
    together = count * float(mean @ mean) / (repeats - 1)
    apart = float(((d - mean) ** 2).sum()) / ((count - 1) * (repeats - 1))
    if apart == 0:
        return None
    chance = fdtrc(repeats - 1, (count - 1) * (repeats - 1), together / apart)
    return mean if chance < CHANCE else None


def smoothed(within: Array, x: Array, counted: Mask) -> Array:
    """h as a smooth function of the level where enough levels count; else as it is; shape (L,)."""
    size = int(counted.sum())
    if size < SMOOTH_LEVELS or np.ptp(x[counted]) == 0:
        return within
    design = np.vander((x - x.mean()) / np.ptp(x), min(SMOOTH_TERMS, size - 3), increasing=True)
    coefficients = np.linalg.lstsq(design[counted], np.log(within[counted]), rcond=None)[0]
    return np.where(counted, np.exp(np.clip(design @ coefficients, -690, 690)), within)


def neighbours(own: Array) -> Array:
    """How much each level's runs, of `own` degrees of freedom, count for each level's scatter: rows of sum 1, (L, L).

    The narrowest triangle about a level that gives half of the levels `NEIGHBOURS` degrees of freedom.
    """
    apart = np.abs(np.subtract.outer(np.arange(len(own)), np.arange(len(own))))
    for width in range(2 * len(own)):
        weight = np.maximum(1 - apart / (width + 1), 0) * own
        total = weight.sum(axis=1)
        square = (weight**2 / np.where(own > 0, own, 1)).sum(axis=1)
        if (total > 0).all() and median(total**2 / square) >= NEIGHBOURS:
            break
    weight[total == 0], total[total == 0] = own, own.sum()
    return np.asarray(weight / total[:, None])
