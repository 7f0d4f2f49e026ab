"""Intervals of a recorded fit: what its residuals, coloured as they are, leave open about any function of its unknowns.

    V = H⁻¹ Ω H⁻¹',   H = Σ Z'J,   Ω = the variance of Σ_k Z_k' r_k

Z is J but where an instrument stands in for it. Ω is estimated in two ways:

    noise     r_k = σ(T_k) z_k, σ² = a + b T², z stationary with a smoothed spectrum: Ω = Σ_f |F(Z σ)|² S_z(f)
    stretches Σ over moving stretches of several lengths of s s', s = Σ Z_k' r_k over the stretch (Bartlett weights)

The first is precise and leans on the noise being alike everywhere; the second leans on nothing, and is worth no more
than the stretches in which a function is decided. A function's variance is their mean, weighted by these degrees of
freedom and `PRIOR` for the first. Where the logs hold four engagements or more (stretches under load between returns to
rest, and whole logs), scores summed over each of them count too, so that scatter between engagements does. Directions
that an active constraint holds are left out.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from eaid.arrays import Array
from eaid.recorded.drive import Drive
from eaid.recorded.solve import Solved

WINDOWS_S = (0.3, 1.0, 3.0, 10.0)
"""Lengths of the stretches [s]."""
LONGEST = 1 / 24
"""Longest stretch, as a part of all logs together."""
BINS = 16_384
"""Derivatives and residuals are first added up over so many short bins of a log, at most."""
PRIOR = 20.0
"""Degrees of freedom that the noise's own estimate counts as."""
ENGAGEMENTS = 4
"""Fewest engagements whose scatter counts."""
SMOOTH = 0.25
"""Half-width over which the noise's spectrum is smoothed, as a part of its corner frequency …"""
FEWEST = 8
"""… and at least so many lines."""


@dataclass(frozen=True, eq=False)
class Scores:
    """One way of adding scores up."""

    covariance: Array
    groups: tuple[Array, ...]
    """For each log, the group of every bin, (n,)."""


@dataclass(frozen=True, eq=False)
class Spread:
    """What is needed for the variance of any function of the unknowns."""

    noise: Array
    """Covariance of the unknowns by the noise's own estimate."""
    stretches: tuple[Scores, ...]
    engaged: Scores | None
    pull: Array
    """H⁻¹ where the constraints leave it free."""
    slopes: tuple[Array, ...]
    """σ Z of every bin of every log, (n, p)."""
    engagements: int
    correlation_s: float
    """Integrated correlation time of the residuals [s], the longest of all logs."""

    def variance(self, gradient: Array) -> tuple[float, float]:
        """Variance of a function with that gradient, and its degrees of freedom."""
        along = self.pull.T @ gradient
        squares = [(slopes @ along) ** 2 for slopes in self.slopes]
        own = max(float(gradient @ self.noise @ gradient), 0.0)
        best = (own, PRIOR)
        widest = max(self.stretches, key=lambda one: float(gradient @ one.covariance @ gradient))
        best = _mixed(own, PRIOR, float(gradient @ widest.covariance @ gradient), _degrees(squares, widest.groups))
        if self.engaged is not None:
            V = float(gradient @ self.engaged.covariance @ gradient)
            if V > best[0]:
                best = _mixed(*best, V, _degrees(squares, self.engaged.groups), PRIOR)
        return best

    def of(self, gradient: Array) -> float:
        """Half-width of the 95 % interval of a function with that gradient."""
        variance, degrees = self.variance(gradient)
        return float(student.ppf(0.975, degrees)) * variance**0.5

    @property
    def covariance(self) -> Array:
        """One covariance for drawing, of all ways alike."""
        ways = [self.noise, *(one.covariance for one in self.stretches)]
        return np.asarray(sum(ways) / len(ways))


def _mixed(own: float, prior: float, other: float, degrees: float, most: float = np.inf) -> tuple[float, float]:
    prior = min(prior, most)
    total = prior + degrees
    return (prior * own + degrees * max(other, 0.0)) / total, total


def _degrees(squares: Sequence[Array], groups: Sequence[Array]) -> float:
    """How many groups decide a function: (Σ a)²/Σ a², a its squared influence in each group."""
    parts = [np.bincount(which.astype(np.intp), one) for one, which in zip(squares, groups, strict=True)]
    a = np.concatenate(parts)
    square = float((a * a).sum())
    return max(float(a.sum()) ** 2 / square - 1.0, 0.5) if square > 0 else 0.5


def spread(solved: Solved) -> Spread:
    """Everything that intervals need where a fit ended."""
    setup, x = solved.setup, solved.x
    clean = setup if solved.instruments is None else replace(setup, drives=solved.instruments)
    n = setup.size
    H, omega = np.zeros((n, n)), np.zeros((n, n))
    scores, slopes, bins_s, groups = [], [], [], []
    span, memory = 0.0, 0.0
    for log, drive in enumerate(setup.drives):
        J, r = setup.jacobian(x, log)
        Z = J if solved.instruments is None else clean.jacobian(x, log)[0]
        at = setup.columns(log)
        H[np.ix_(at, at)] += Z.T @ J
        dt_s = float(drive.dt_s.sum()) / max(len(r), 1)
        size = deviation(r, drive)
        step = -(-len(r) // BINS)
        starts = np.arange(0, len(r), step)
        own = np.zeros((len(starts), n))
        own[:, at] = np.add.reduceat(Z * r[:, None], starts)
        scores.append(own)
        sloped = np.zeros((len(starts), n))
        sloped[:, at] = np.add.reduceat(Z * size[:, None], starts)
        slopes.append(sloped)
        z = np.add.reduceat(r / size, starts) / np.diff(np.append(starts, len(r)))
        corner = correlation_s(z, step * dt_s)
        omega += by_spectrum(sloped, z, corner / (step * dt_s))
        span += dt_s * len(r)
        memory = max(memory, corner)
        bins_s.append(step * dt_s)
        groups.append(engagements(drive)[drive.w > 0][starts])
    free = directions(solved)
    middle = free.T @ H @ free
    scale = np.sqrt(np.maximum(np.abs(np.diagonal(middle)), 1e-300))
    pull = free @ (np.linalg.pinv(middle / np.outer(scale, scale), rcond=1e-13) / np.outer(scale, scale)) @ free.T
    worth = span / max(2 * memory, span / setup.samples)
    lost = worth / max(worth - free.shape[1], 0.25 * worth)
    stretches = []
    for window in WINDOWS_S:
        if window > LONGEST * span and stretches:
            break
        own = np.zeros((n, n))
        for one, bin_s in zip(scores, bins_s, strict=True):
            own += moving(one, max(1, round(window / bin_s)))
        pairs = zip(scores, bins_s, strict=True)
        where = tuple(np.arange(len(one)) // max(1, round(window / bin_s)) for one, bin_s in pairs)
        stretches.append(Scores(lost * pull @ own @ pull.T, where))
    engaged, count = _engaged(scores, groups, pull, lost)
    noise = lost * pull @ omega @ pull.T
    return Spread(noise, tuple(stretches), engaged, pull, tuple(slopes), count, memory)


def _engaged(
    scores: Sequence[Array], groups: Sequence[NDArray[np.intp]], pull: Array, lost: float
) -> tuple[Scores | None, int]:
    """Scores added up over each engagement, where there are enough of them."""
    sums = []
    for one, which in zip(scores, groups, strict=True):
        sums.append(np.add.reduceat(one, np.flatnonzero(np.append(True, np.diff(which) != 0))))
    S = np.vstack(sums)
    count = len(S)
    if count < ENGAGEMENTS:
        return None, count
    S = S - S.mean(axis=0)
    covariance = lost * count / (count - 1) * pull @ (S.T @ S) @ pull.T
    return Scores(covariance, tuple(np.asarray(one, dtype=np.float64) for one in groups)), count


def deviation(r: Array, drive: Drive) -> Array:
    """Standard deviation of the residuals as the output's size has it, σ² = a + b T², (n,)."""
    T = np.abs(drive.y[drive.w > 0])
    T = T**2
    squares = r * r
    mean = float(squares.mean())
    if mean == 0.0 or T.max() == 0.0:
        return np.full(len(r), max(mean, 1e-300) ** 0.5)
    step = max(1, len(r) // 2000)
    count = len(r) // step
    x = T[: count * step].reshape(count, step).mean(axis=1)
    y = squares[: count * step].reshape(count, step).mean(axis=1)
    weight = 1.0 / (0.2 + x / x.mean())
    design = np.column_stack([np.ones(count), x]) * weight[:, None]
    a, b = np.linalg.lstsq(design, y * weight, rcond=None)[0].tolist()
    least = 0.02 * mean
    if b < 0 or a < 0:
        a, b = (mean, 0.0) if b < 0 else (least, mean / float(T.mean()))
    return np.sqrt(np.maximum(a + b * T, least))


def by_spectrum(slopes: Array, z: Array, memory: float) -> Array:
    """Variance of Σ_k slopes_k z_k for stationary z of the smoothed spectrum of the given ones, (p, p).

    `memory` is their integrated correlation time in samples.
    """
    n = len(z)
    size = 2 ** int(np.ceil(np.log2(2 * n)))
    power = np.abs(np.fft.rfft(z, size)) ** 2 / n
    half = int(max(SMOOTH * size / (2 * np.pi * max(memory, 0.5)), FEWEST * size / n))
    half = min(half, len(power) - 1)
    mirrored = np.concatenate([power[half:0:-1], power, power[-2 : -half - 2 : -1]])
    total = np.append(0.0, np.cumsum(mirrored))
    smooth = (total[2 * half + 1 :] - total[: -2 * half - 1]) / (2 * half + 1)
    F = np.fft.rfft(slopes, size, axis=0)
    twice = np.full(len(power), 2.0)
    twice[0] = twice[-1] = 1.0
    weighted = F * (twice * smooth[: len(power)])[:, None]
    return np.asarray((F.conj().T @ weighted).real / size)


def moving(sums: Array, width: int) -> Array:
    """Σ over moving stretches of `width` bins of s s', over the width: Bartlett weights, (p, p)."""
    width = min(width, len(sums))
    total = np.vstack([np.zeros(sums.shape[1]), np.cumsum(sums, axis=0)])
    padded = np.vstack([np.repeat(total[:1], width - 1, axis=0), total, np.repeat(total[-1:], width - 1, axis=0)])
    stretches = padded[width:] - padded[:-width]
    return np.asarray(stretches.T @ stretches / width)


def correlation_s(r: Array, dt_s: float) -> float:
    """Integrated correlation time of residuals [s]: half of what one independent sample takes."""
    n = len(r)
    if n < 8 or not r.any():
        return 0.5 * dt_s
    rho = np.fft.irfft(np.abs(np.fft.rfft(r - r.mean(), 2 * n)) ** 2)[:n]
    if rho[0] <= 0:
        return 0.5 * dt_s
    rho /= rho[0]
    below = np.flatnonzero(rho < 0.05)
    end = int(below[0]) if len(below) else n
    return float((0.5 + rho[1:end].sum()) * dt_s)


def engagements(drive: Drive) -> NDArray[np.intp]:
    """Number of the engagement that a row belongs to, (n,): each begins where the input leaves rest."""
    loaded = drive.duty[drive.index] > 0
    begins = np.append(loaded[0], loaded[1:] & ~loaded[:-1])
    return np.asarray(np.maximum(np.cumsum(begins) - 1, 0))


def directions(solved: Solved) -> Array:
    """Directions that the active constraints leave free, (n, k)."""
    problem = solved.setup.problem()
    held = np.flatnonzero(problem.A @ solved.x - problem.b < 1e-9 * (1 + np.abs(problem.b)))
    n = len(solved.x)
    if not len(held):
        return np.eye(n)
    _, size, ways = np.linalg.svd(problem.A[held])
    rank = int((size > 1e-10 * size.max(initial=0.0)).sum())
    return np.asarray(ways[rank:].T)


@dataclass(frozen=True, eq=False)
class CurveSpread:
    """T_s, τ1, τ2 at some inputs with their 95 % intervals; shapes (3, L)."""

    duty: Array
    values: Array
    low: Array
    high: Array
    half_width: Array
    """Relative half-widths, e^h − 1; infinite where nothing is known."""


def curves(solved: Solved, sure: Spread, duty: Array) -> CurveSpread:
    """Intervals of log T_s, log τ1, log τ2 at some inputs within the range."""
    model = solved.setup.model
    rows = model.rows_of(duty)
    a, b, c = model.sizes
    values, half = np.full((3, len(duty)), np.nan), np.full((3, len(duty)), np.inf)
    for k, (part, first, count) in enumerate(((rows.steady, 0, a), (rows.tau1, a, b), (rows.tau2, a + b, c))):
        for i in range(len(duty)):
            if not count:
                continue
            gradient = np.zeros(solved.setup.size)
            gradient[first : first + count] = part[i]
            value = float(part[i] @ solved.x[first : first + count])
            values[k, i] = value
            if value > 0:
                half[k, i] = min(sure.of(gradient) / value, 50.0)
    return CurveSpread(duty, values, values * np.exp(-half), values * np.exp(half), np.expm1(half))


def inputs_shown(levels: Sequence[float] | Array, low: float, high: float) -> Array:
    """The levels themselves where they are few, else eleven inputs from the lowest to the highest."""
    return np.asarray(levels, dtype=np.float64) if 0 < len(levels) <= 12 else np.linspace(low, high, 11)
