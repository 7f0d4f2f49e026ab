"""Intervals of a recorded fit: what its residuals, coloured as they are, leave open about any function of its unknowns.

    V = H⁻¹ Ω H⁻¹',   H = Σ Z'J,   Ω = Σ_k Σ_l w(k − l) s_k s_l',   s_k = Z_k' r_k

Z is J but where an instrument stands in for it. Ω is taken over moving stretches of several lengths (Bartlett weights),
and the widest V counts. Where the logs hold four engagements or more (stretches under load between returns to rest, and
whole logs), the scores are summed over each of these too, so that scatter from engagement to engagement counts.
Directions that an active constraint holds are left out. Degrees of freedom are those of the stretches or of the
engagements.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from eaid.arrays import Array
from eaid.recorded.drive import Drive
from eaid.recorded.solve import Solved

WINDOWS_S = (0.1, 0.3, 1.0, 3.0, 10.0)
"""Lengths of the stretches [s]."""
LONGEST = 1 / 12
"""Longest stretch, as a part of all logs together."""
BINS = 4000
"""Scores are first added up over so many short bins of a log, at most."""
ENGAGEMENTS = 4
"""Fewest engagements whose scatter counts."""
OVERLAP = 1.5
"""Degrees of freedom of overlapping stretches over those of the stretches that fit beside one another."""


@dataclass(frozen=True, eq=False)
class Spread:
    """Covariances of the unknowns by every way of adding scores up, each with its degrees of freedom."""

    covariances: tuple[Array, ...]
    degrees: tuple[float, ...]
    white: Array
    """Covariance that white residuals would have."""
    engagements: int
    correlation_s: float
    """Integrated correlation time of the residuals [s], the longest of all logs."""

    def of(self, gradient: Array) -> tuple[float, float]:
        """Half-width of the 95 % interval of a function with that gradient, and its standard error."""
        best = (0.0, 0.0)
        for V, df in zip(self.covariances, self.degrees, strict=True):
            error = max(float(gradient @ V @ gradient), 0.0) ** 0.5
            width = float(student.ppf(0.975, df)) * error
            best = (width, error) if width > best[0] else best
        return best

    @cached_property
    def covariance(self) -> Array:
        """One covariance for drawing: that of the window under which the unknowns are least certain altogether."""
        scale = np.sqrt(np.maximum(np.diagonal(self.white), 1e-300))
        sizes = [float(np.trace(V / np.outer(scale, scale))) for V in self.covariances]
        return self.covariances[int(np.argmax(sizes))]


def spread(solved: Solved) -> Spread:
    """Covariances of the unknowns where a fit ended."""
    setup, x = solved.setup, solved.x
    clean = setup if solved.instruments is None else replace(setup, drives=solved.instruments)
    H = np.zeros((setup.size, setup.size))
    binned: list[tuple[Array, float]] = []
    clusters: list[Array] = []
    span, memory = 0.0, 0.0
    for log, drive in enumerate(setup.drives):
        J, r = setup.jacobian(x, log)
        Z = J if solved.instruments is None else clean.jacobian(x, log)[0]
        at = setup.columns(log)
        H[np.ix_(at, at)] += Z.T @ J
        scores = np.zeros((len(r), setup.size))
        scores[:, at] = Z * r[:, None]
        dt_s = float(drive.dt_s.sum()) / max(len(r), 1)
        span += dt_s * len(r)
        memory = max(memory, correlation_s(r, dt_s))
        step = -(-len(r) // BINS)
        starts = np.arange(0, len(r), step)
        binned.append((np.add.reduceat(scores, starts), step * dt_s))
        which = engagements(drive)[drive.w > 0]
        clusters += list(np.add.reduceat(scores, np.flatnonzero(np.append(True, np.diff(which) != 0))))
    free = directions(solved)
    middle = free.T @ H @ free
    scale = np.sqrt(np.maximum(np.abs(np.diagonal(middle)), 1e-300))
    inverse = free @ (np.linalg.pinv(middle / np.outer(scale, scale), rcond=1e-13) / np.outer(scale, scale)) @ free.T
    worth = span / max(2 * memory, span / setup.samples)
    lost = worth / max(worth - free.shape[1], 0.25 * worth)
    covariances: list[Array] = []
    degrees: list[float] = []
    for window in WINDOWS_S:
        if window > LONGEST * span and covariances:
            break
        omega = np.zeros_like(H)
        for sums, bin_s in binned:
            omega += moving(sums, max(1, round(window / bin_s)))
        covariances.append(lost * inverse @ omega @ inverse.T)
        degrees.append(max(OVERLAP * span / window - free.shape[1], 3.0))
    count = len(clusters)
    if count >= ENGAGEMENTS:
        S = np.array(clusters)
        S = S - S.mean(axis=0)
        covariances.append(lost * count / (count - 1) * inverse @ (S.T @ S) @ inverse.T)
        degrees.append(count - 1.0)
    white = inverse * solved.cost / max(setup.samples - free.shape[1], 1)
    return Spread(tuple(covariances), tuple(degrees), white, count, memory)


def moving(sums: Array, width: int) -> Array:
    """Σ over moving stretches of `width` bins of s s', over the width: Bartlett weights, (p, p)."""
    width = min(width, len(sums))
    total = np.vstack([np.zeros(sums.shape[1]), np.cumsum(sums, axis=0)])
    padded = np.vstack([np.repeat(total[:1], width - 1, axis=0), total, np.repeat(total[-1:], width - 1, axis=0)])
    stretches = padded[width:] - padded[:-width]
    return np.asarray(stretches.T @ stretches / width)


def correlation_s(r: Array, dt_s: float) -> float:
    """Integrated correlation time of residuals [s]: half of what one independent sample takes."""
    step = max(1, len(r) // 20_000)
    r = r[: len(r) // step * step].reshape(-1, step).mean(axis=1)
    n = len(r)
    if n < 8 or not r.any():
        return 0.5 * dt_s * step
    spectrum = np.fft.rfft(r - r.mean(), 2 * n)
    rho = np.fft.irfft(np.abs(spectrum) ** 2)[:n]
    if rho[0] <= 0:
        return 0.5 * dt_s * step
    rho /= rho[0]
    below = np.flatnonzero(rho < 0.05)
    end = int(below[0]) if len(below) else n
    return float((0.5 + rho[1:end].sum()) * dt_s * step)


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
                half[k, i] = min(sure.of(gradient)[0] / value, 50.0)
    return CurveSpread(duty, values, values * np.exp(-half), values * np.exp(half), np.expm1(half))


def inputs_shown(levels: Sequence[float] | Array, low: float, high: float) -> Array:
    """The levels themselves where they are few, else eleven inputs from the lowest to the highest."""
    return np.asarray(levels, dtype=np.float64) if 0 < len(levels) <= 12 else np.linspace(low, high, 11)
