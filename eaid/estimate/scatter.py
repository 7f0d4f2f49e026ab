"""What the runs of each level say about its curve: how far each alone would move it, and how noisy one run is.

With J = ∂f/∂(ln T_s, ln τ1, ln τ2[, logit C]) on the n samples of a level, A = J'J and ȳ the mean of its R runs:

    shift of a run      d_r = A⁻¹ J' (y_r − ȳ),      of the level   δ = A⁻¹ J' (ȳ − f)
    noise within a run  h = mean over runs of diag(A⁻¹ Ω A⁻¹), Ω the Bartlett sum over J e_r, e_r the run's residual
                        about its own curve; the largest over windows of 0.1, 0.3, 1 and 2 s (in proportion for
                        records shorter than 5 s or longer than 60 s, so that no unit of time matters)
    scatter             Σ d_r²/(R − 1) is expected to be a + h; a by Paule and Mandel, over all levels

Levels of a single run show a in their distance to a polynomial through the levels, where there are enough of them.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, nnls
from scipy.special import fdtrc

from eaid.arrays import Array, Mask, inverse, median
from eaid.estimate.forms import RECORDS, RECORDS_FREE
from eaid.estimate.spread import FEW_DEGREES, LevelScatter, t_quantile
from eaid.plant.dynamics import TAU_FLOOR_S, Step
from eaid.plant.steps import step_slopes
from eaid.results.models import Noise
from eaid.steps.stepset import Level, RunRecord

# Parameters of one level, in the order of every array here; C only where it was free
LEVEL_NAMES = ("Ts", "tau1", "tau2", "C")
CURVES = LEVEL_NAMES[:3]
MEETING = 1e-4  # A limit this close holds a parameter; τ1 and τ2 this close are one
UNDETERMINED = 3.0  # Factor up or down from which a parameter counts as not determined
WINDOWS_S = (0.1, 0.3, 1.0, 2.0)  # Bartlett windows [s]: from the friction ripple's memory to a third of a rotor turn
LIKE_S = (5.0, 60.0)  # Length of the records that these windows are for [s]
# Scores are summed over a tenth of the shortest window before the Bartlett sum; no memory is that short
BINS_PER_WINDOW = 10
TERMS = {"Ts": 4, "tau1": 3, "tau2": 3}  # Terms of the paper's polynomials, Eqs. (5)–(7)
SPARE_LEVELS = 4  # Levels beyond the terms of a curve that are needed to see the scatter of single runs in it
# Degrees of freedom that a level's scatter takes from its neighbourhood: itself and both neighbours where R = 3
NEIGHBOURS = 4.5
SWEEPS_CHANCE = 0.01  # Probability at which independent repeats would be taken for sweeps
SWEPT_LEVELS = 3  # Levels at least that show sweeps
# Levels beyond the coefficients of a curve from which single runs show their scatter in the levels' distance to it
LEVELS_TO_SPARE = 2
USUAL = 0.03  # Scatter of T_s from run to run [part of it] by which levels are weighed where none is seen
USUAL_TAU = 0.05  # The same of time constants


def log_jacobian(curve: Step, time_s: Array, share_free: bool = False) -> Array:
    """∂f/∂(ln T_s, ln τ1, ln τ2[, logit C]), shape (n, 3 or 4), Eq. (3)."""
    scale = np.array([curve.Ts, curve.tau1, curve.tau2, curve.C * (1 - curve.C)])
    return np.asarray((step_slopes(curve, time_s) * scale[:, None])[: 4 if share_free else 3].T)


def held_parameters(curve: Step, record_s: float, share_free: bool) -> tuple[str, ...]:
    """Which of T_s, τ1, τ2 a constraint holds."""
    names: list[str] = []
    if curve.tau1 <= TAU_FLOOR_S * (1 + MEETING):
        names.append("tau1")
    if curve.tau2 >= (RECORDS_FREE if share_free else RECORDS) * record_s * (1 - MEETING):
        names.append("tau2")
    if curve.tau2 <= curve.tau1 * (1 + MEETING):
        names += ["tau1", "tau2"]
    if curve.Ts <= 0:
        names += ["Ts", "tau1", "tau2"]
    return tuple(dict.fromkeys(names))


def pace(record_s: float, like_s: tuple[float, float]) -> float:
    """By what windows in seconds are stretched for a record: 1 within `like_s`, in proportion beyond."""
    return record_s / min(max(record_s, like_s[0]), like_s[1])


def windows_of(time_s: Array) -> list[float]:
    """The Bartlett windows of a record, the shortest first [s]."""
    return [pace(float(time_s[-1] - time_s[0]), LIKE_S) * window_s for window_s in WINDOWS_S]


def window_sums(time_s: Array, scores: Array) -> Iterator[tuple[tuple[Array, ...], int]]:
    """Of each window, half a record at most: sums of scores (n, k) over m bins, before, inside, after; and m."""
    duration_s, windows_s = float(time_s[-1] - time_s[0]), windows_of(time_s)
    bin_s = min(windows_s) / BINS_PER_WINDOW
    if duration_s > 4 * len(time_s) * bin_s:  # a slow clock, or one in another unit: no more bins than data
        bin_s = duration_s / len(time_s)
    bins = np.floor((time_s - time_s[0]) / bin_s + 1e-6).astype(np.int64)
    sums = np.zeros((scores.shape[1], int(bins[-1]) + 1))
    starts = np.flatnonzero(np.r_[True, bins[1:] != bins[:-1]])
    sums[:, bins[starts]] = scores.T if len(starts) == len(bins) else np.add.reduceat(scores.T, starts, axis=1)
    running = np.cumsum(sums, axis=1)
    inside, last = np.empty_like(running), running[:, -1:]
    for window_s in windows_s:
        m = max(1, min(round(window_s / bin_s), round(duration_s / 2 / bin_s)))
        between = np.subtract(running[:, m:], running[:, :-m], out=inside[:, m:])
        yield (running[:, :m], between, last - running[:, -m:-1]), m


def bartlett_variance(time_s: Array, scores: Array) -> Array:
    """Variance of the sum of correlated scores (n, k), shape (windows, k).

    Σ_|j|<m (1 − |j|/m) Γ_j equals the mean square of all sums over m neighbours, zeros beyond the ends.
    """
    return np.array([sum(np.vecdot(x, x) for x in parts) / m for parts, m in window_sums(time_s, scores)])


def run_residuals(runs: Array, fitted: Array, jacobian: Array) -> Array:
    """Residuals of each run about its own curve, one linear step from the level's curve, shape (R, n)."""
    left = runs - fitted
    basis, triangle = np.linalg.qr(jacobian)
    turn, size, _ = np.linalg.svd(triangle)
    basis = basis @ turn[:, size > 1e-10 * size[0]]  # where τ1 meets τ2 two columns are one, and the third is rounding
    return np.asarray(left - (left @ basis) @ basis.T)


@dataclass(frozen=True, eq=False)
class RunStatistics:
    """One level's k numbers and what its R runs say about them."""

    shift: Array  # How far each run alone would move them, shape (R, k); the rows sum to zero
    within: Array  # Variance h of a single run's numbers by its own noise, shape (k,)


def run_statistics(level: Level, noise: Array, jacobian: Array) -> RunStatistics:
    """Of one level whose curve goes with k numbers as `jacobian` (n, k), `noise` (R, n) being what its runs leave."""
    directions = jacobian @ inverse(jacobian.T @ jacobian)  # how the level's numbers answer to its samples
    scores = (noise[:, None] * np.ascontiguousarray(directions.T)).reshape(-1, len(level.time_s)).T
    variances = bartlett_variance(level.time_s, scores).reshape(len(WINDOWS_S), len(noise), -1)
    # sorted: the order of the runs changes no rounding
    within = np.asarray(np.sort(variances, axis=1).mean(axis=1).max(axis=0))
    return RunStatistics((level.runs - level.mean) @ directions, within)


def correlate_by_noise(runs: Sequence[RunStatistics], jacobians: Sequence[Array], pooled: LevelScatter) -> Array:
    """Correlations of the levels' numbers, (L, k, k): what noise within runs makes of them goes together."""
    noise = np.array([one.within / len(one.shift) for one in runs])
    part = np.sqrt(np.clip(noise / np.maximum(pooled.expected, 1e-300), 0.0, 1.0))
    white = np.array([inverse(J.T @ J) for J in jacobians])
    size = np.sqrt(np.maximum(np.einsum("lkk->lk", white), 1e-300))
    alike = white / (size[:, :, None] * size[:, None, :]) * part[:, :, None] * part[:, None, :]
    np.einsum("lkk->lk", alike)[:] = 1.0
    return np.asarray(alike)


def paule_mandel(total: Callable[[float], float], wanted: float, scale: float) -> tuple[float, float]:
    """The a ≥ 0 at which the falling function `total` meets `wanted`, and q (1, or below it where a = 0)."""
    at_zero = total(0.0)
    if at_zero <= wanted:
        return 0.0, at_zero / wanted
    low, high = 0.0, max(scale, 1e-300)
    while total(high) > wanted:
        low, high = high, 4 * high
    return float(brentq(lambda a: total(a) - wanted, low, high, xtol=1e-13 * high, rtol=1e-12)), 1.0


def pool_scatter(levels: Sequence[RunStatistics], usable: Mask | None = None) -> LevelScatter:
    """Scatter of levels' numbers with repeats; levels of a single run borrow it. Needs one level with R ≥ 2.

    Where `usable`, shape (L, k), is false, a number has no say in the pool and borrows from it. Where repeats were
    recorded as sweeps, what a sweep's levels have in common is no part of it.
    """
    repeats = np.array([len(level.shift) for level in levels], dtype=float)
    # Σ d²/(R − 1) of each level, 0 for a single run; sorted: the order of the runs changes no rounding
    squares = [np.sort(level.shift**2, axis=0).sum(axis=0) for level in levels]
    v = np.array(squares) / np.maximum(repeats - 1, 1)[:, None]
    h = np.array([np.maximum(level.within, 1e-300) for level in levels])
    counted = np.ones(v.shape, dtype=bool) if usable is None else usable
    count, between, common = v.shape[1], np.zeros(v.shape[1]), np.zeros(v.shape[1])
    expected, relative = h / repeats[:, None], np.ones(v.T.shape)
    mixed = np.zeros((count, len(levels), len(levels)))
    for k in range(count):
        own = (repeats - 1) * counted[:, k]
        shared = common_shifts(levels, k) if counted[:, k].all() else None
        if shared is not None:
            common[k] = shared @ shared / (len(shared) - 1) / len(shared)
            own = own * (len(levels) - 1) / len(levels)
            left = np.array([level.shift[:, k] for level in levels]) - shared
            v[:, k] = (left**2).sum(axis=1) / (len(shared) - 1) * len(levels) / (len(levels) - 1)
        mixed[k] = weigh_neighbours(own) if own.sum() else weigh_neighbours(repeats - 1)
        if own.sum() == 0:
            continue
        chi_square = partial(lambda s, h, a: float((s / (a + h)).sum()), own * v[:, k], h[:, k])
        between[k], q = paule_mandel(chi_square, float(own.sum()), float(v[own > 0, k].max()))
        expected[:, k] = q * (between[k] + h[:, k]) / repeats
        relative[k] = np.where(own > 0, v[:, k] / np.maximum(repeats * expected[:, k], 1e-300), 0.0)
    return LevelScatter(expected, unrelated(expected), mixed, relative, repeats - 1, between, common)


def scatter_about(levels: Sequence[Level], jacobians: Sequence[Array]) -> LevelScatter:
    """How k numbers of levels scatter, ∂f/∂numbers of each being a Jacobian (n, k), ln T_s the first of them."""
    pairs = zip(levels, jacobians, strict=True)
    runs = [run_statistics(level, run_residuals(level.runs, J[:, 0], J), J) for level, J in pairs]
    pooled = pool_scatter(runs)
    return replace(pooled, alike=correlate_by_noise(runs, jacobians, pooled))


def scatter_of_singles(levels: Sequence[Level], jacobians: Sequence[Array], terms: Array, usual: Array) -> LevelScatter:
    """The same of levels of a single run, by their distance to the estimate, which has so many `terms` of each number,
    (k,); as runs of a rig usually scatter, `usual`, where too few levels are left."""
    pairs = list(zip(levels, jacobians, strict=True))
    runs = [run_statistics(level, run_residuals(level.runs, J[:, 0], J), J) for level, J in pairs]
    off = np.clip([inverse(J.T @ J) @ (J.T @ (level.mean - J[:, 0])) for level, J in pairs], -1.0, 1.0)
    spare = len(levels) - terms
    seen = np.where(spare >= LEVELS_TO_SPARE, (off**2).sum(axis=0) / np.maximum(spare, 1), usual**2)
    known = min(spare[spare >= LEVELS_TO_SPARE], default=np.inf)
    pooled = scatter_of_all(np.broadcast_to(seen, off.shape), float(known), np.full(len(terms), np.nan))
    return replace(pooled, alike=correlate_by_noise(runs, jacobians, pooled))


def scatter_of_all(variance: Array, degrees: float, between: Array) -> LevelScatter:
    """The scatter of levels of a single run, which all of them show together, of variances (L, k)."""
    alone, none = np.ones((variance.shape[1], len(variance), 1)), np.zeros(variance.shape[1])
    return LevelScatter(variance, unrelated(variance), alone, alone[:, 0], np.array([degrees]), between, none)


def unrelated(variance: Array) -> Array:
    """Correlations of numbers that have nothing to do with each other, (L, k, k), for variances (L, k)."""
    return np.broadcast_to(np.eye(variance.shape[1]), (*variance.shape, variance.shape[1]))


def common_shifts(levels: Sequence[RunStatistics], k: int) -> Array | None:
    """m_r, what every level's run r has in common in number k, shape (R,); None where repeats are independent.

    Runs are matched by their place: the first run of each level was one sweep, and so on. A two-way analysis of
    variance of the runs' shifts (levels × repeats): F = L Σ m_r²/(R − 1) against what is left.
    """
    counts = {len(level.shift) for level in levels}
    if len(levels) < SWEPT_LEVELS or len(counts) != 1 or counts == {1}:
        return None
    d = np.array([level.shift[:, k] for level in levels])
    if not np.isfinite(d).all():
        return None
    count, repeats = d.shape
    mean = d.mean(axis=0)
    together = count * float(mean @ mean) / (repeats - 1)
    apart = float(((d - mean) ** 2).sum()) / ((count - 1) * (repeats - 1))
    chance = fdtrc(repeats - 1, (count - 1) * (repeats - 1), together / apart) if apart > 0 else 1.0
    return mean if chance < SWEEPS_CHANCE else None


def weigh_neighbours(own: Array) -> Array:
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


@dataclass(frozen=True, eq=False)
class Scatter:
    """What the runs of L levels say about their curves of Eq. (3)."""

    levels: tuple[Level, ...]
    theta: Array  # T_s, τ1, τ2, C of the levels, (4, L)
    share_free: bool = False  # Whether C of each level is a parameter too

    @cached_property
    def curves(self) -> tuple[Step, ...]:
        """The same as curves of Eq. (3)."""
        return tuple(Step(*row) for row in self.theta.T.tolist())

    @cached_property
    def jacobians(self) -> tuple[Array, ...]:
        """∂f/∂(ln T_s, ln τ1, ln τ2[, logit C]) of each level, (n, k)."""
        pairs = zip(self.curves, self.levels, strict=True)
        return tuple(log_jacobian(curve, level.time_s, self.share_free) for curve, level in pairs)

    @cached_property
    def noise(self) -> tuple[Array, ...]:
        """Residuals of the runs about their own curves, (R, n) of each level."""
        return tuple(run_residuals(one.runs, J[:, 0], J) for one, J in zip(self.levels, self.jacobians, strict=True))

    @cached_property
    def runs(self) -> tuple[RunStatistics, ...]:
        """Shifts and noise of each level's runs."""
        rows = zip(self.levels, self.noise, self.jacobians, strict=True)
        return tuple(run_statistics(level, noise, J) for level, noise, J in rows)

    @property
    def repeats(self) -> NDArray[np.int64]:
        """Runs of each level, (L,)."""
        return np.array([len(level.runs) for level in self.levels])

    @property
    def duty(self) -> Array:
        """Input of each level, (L,)."""
        return np.array([level.level for level in self.levels])

    @cached_property
    def held(self) -> tuple[tuple[str, ...], ...]:
        """Parameters that a constraint holds at each level."""
        pairs = zip(self.curves, self.levels, strict=True)
        return tuple(held_parameters(curve, float(level.time_s[-1]), self.share_free) for curve, level in pairs)

    @cached_property
    def usable(self) -> Mask:
        """Which parameters of which levels show the scatter: held by no constraint, and determined by their record."""
        names = LEVEL_NAMES[: 4 if self.share_free else 3]
        free = np.array([[name not in held for name in names] for held in self.held])
        within = np.array([runs.within for runs in self.runs])
        return np.asarray(free & (np.sqrt(within / self.repeats[:, None]) < np.log(UNDETERMINED)))

    @cached_property
    def shift(self) -> Array:
        """δ of each level's mean, its own curve less the one that it has here; a factor e at most, (L, k)."""
        rows = zip(self.levels, self.jacobians, strict=True)
        steps = [inverse(J.T @ J) @ (J.T @ (level.mean - J[:, 0])) for level, J in rows]
        return np.clip(steps, -1.0, 1.0)

    @property
    def source(self) -> str:
        """repeats, curve or within: what the variance rests on."""
        if (self.repeats > 1).any():
            return "repeats"
        return "curve" if np.isfinite(self.pooled.between).any() else "within"

    @cached_property
    def pooled(self) -> LevelScatter:
        """How the levels' own parameters scatter."""
        if (self.repeats > 1).any():
            return pool_scatter(self.runs, self.usable)
        within = np.array([runs.within for runs in self.runs])
        between, degrees = np.full(within.shape[1], np.nan), []
        theta = np.log(np.maximum(self.theta[:3].T, 1e-300)) + self.shift[:, :3]
        records = np.log([level.time_s[-1] for level in self.levels])
        for k, name in enumerate(CURVES):
            row = self.usable[:, k] & ((name != "tau2") | (theta[:, k] <= records))  # beyond its record: no scatter
            if row.sum() - TERMS[name] >= SPARE_LEVELS:
                between[k] = _between(self.duty[row], theta[row, k], within[row, k], TERMS[name])
                degrees.append(float(row.sum() - TERMS[name]))
        known = min(degrees, default=FEW_DEGREES)
        usual = np.array([USUAL, *[USUAL_TAU] * (len(between) - 1)]) * t_quantile(np.inf) / t_quantile(known)
        return scatter_of_all(within + np.where(np.isfinite(between), between, usual**2), known, between)

    @cached_property
    def of_levels(self) -> LevelScatter:
        """The same as intervals take it: what noise within runs makes of a level's parameters goes together."""
        shifts = tuple(runs.shift for runs in self.runs) if self.swept else ()
        return replace(self.pooled, alike=correlate_by_noise(self.runs, self.jacobians, self.pooled), shifts=shifts)

    @property
    def swept(self) -> bool:
        """Whether the repeats were recorded as sweeps, so that levels move together."""
        return bool((self.pooled.common > 0).any())

    @property
    def degrees(self) -> float:
        """Degrees of freedom of what is pooled over all levels."""
        return float(self.pooled.degrees.sum())


def _between(u: Array, log_values: Array, within: Array, p: int) -> float:
    """Scatter a of single runs about a polynomial of p terms through the logarithms: Σ res²/(a + h) equals L − p."""
    design = np.vander((u - u.mean()) / np.ptp(u), p)

    def total(a: float) -> float:
        root = 1 / np.sqrt(np.maximum(within + a, 1e-18))
        left = log_values - design @ np.linalg.lstsq(design * root[:, None], log_values * root, rcond=None)[0]
        return float(((left * root) ** 2).sum())

    return paule_mandel(total, float(len(u) - p), float(np.var(log_values)) + 1e-12)[0]


# Where a fit says nothing: 0.03 N·m of white noise at 1 kHz, ripple of 1 % with a memory of 0.05 s, 3 % and 5 %
ASSUMED = Noise(sensor_nm2_s=1e-6, ripple_s=1e-5, scatter={"Ts": 0.03, "tau1": 0.05, "tau2": 0.0})


def unit_variances(curve: Step, hold_s: float) -> Array:
    """Variance of (ln T_s, ln τ1, ln τ2) of a run under s0 = 1, and under s1 = 1, shape (3, 2).

    With A = ∫ J J' dt those of noise of the density s0 + s1 f² are the diagonal of A⁻¹ (∫ J J' (s0 + s1 f²) dt) A⁻¹.
    """
    edges = np.concatenate([[0.0], np.geomspace(hold_s * 1e-5, hold_s, 400)])
    middle, width = 0.5 * (edges[1:] + edges[:-1]), np.diff(edges)
    jacobian = log_jacobian(curve, middle)
    weighed = jacobian.T * width
    unit = inverse(weighed @ jacobian)
    ripple = unit @ (weighed * jacobian[:, 0] ** 2) @ jacobian @ unit  # ∂f/∂ln T_s is f itself
    return np.stack([np.diag(unit), np.diag(ripple)], axis=1)


def noise_of(of_runs: Scatter, records: Sequence[RunRecord]) -> Noise:
    """`uncertainty.noise` of a fit; the sensor's density is the median of idle runs, where some idle long enough."""
    idle = [run.idle_density for run in records if run.idle_density is not None]
    sensor = median(idle) if idle else None
    known = np.flatnonzero(of_runs.usable[:, :3].all(axis=1)).tolist()
    units = np.reshape([unit_variances(of_runs.curves[i], float(of_runs.levels[i].time_s[-1])) for i in known], (-1, 2))
    within = np.ravel([of_runs.runs[i].within[:3] for i in known])
    pairs = zip(CURVES, of_runs.pooled.between.tolist(), strict=False)
    scatter = {name: float(np.sqrt(a)) if np.isfinite(a) else ASSUMED.scatter[name] for name, a in pairs}
    if not len(within):
        return Noise(ASSUMED.sensor_nm2_s if sensor is None else sensor, ASSUMED.ripple_s, scatter)
    design = units / np.maximum(within, 1e-300)[:, None]  # `within` = `units` (s0, s1), relative errors alike
    if sensor is not None:
        ripple = float(design[:, 1] @ (1 - sensor * design[:, 0]) / (design[:, 1] @ design[:, 1]))
        return Noise(sensor, max(0.0, ripple), scatter)
    scale = np.sqrt((design**2).sum(axis=0))
    s0, s1 = (nnls(design / scale, np.ones(len(design)))[0] / scale).tolist()
    return Noise(s0, s1, scatter)
