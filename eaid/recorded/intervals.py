"""Intervals of a recorded fit: what its residuals, coloured as they are, leave open about any function of its unknowns.

    V = H⁻¹ Ω H⁻¹',   H = Σ Z'J,   Ω = the variance of Σ_k Z_k' r_k

Z is J but where an instrument stands in for it. Ω is estimated in two ways:

    noise     r = white and coloured noise of the sensor, and noise that goes with the output: spectra S0(f) + T² S1(f),
              both smoothed; Ω = Σ_f S0 |F(Z)|² + S1 |F(Z T)|²
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
CURVES = ("Ts", "tau1", "tau2")
RIVAL = 4.0
"""A minimum above the best by less than so many times the noise's own unit of cost is not ruled out."""
FEWEST = 8
"""… and at least so many lines."""


@dataclass(frozen=True, eq=False)
class Scores:
    """One way of adding scores up."""

    covariance: Array
    groups: tuple[NDArray[np.intp], ...]
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
    """Z of every bin of every log, (n, p)."""
    engagements: int
    correlation_s: float
    """Integrated correlation time of the residuals [s], the longest of all logs."""
    rivals: tuple[Array, ...]
    """Other minima that the noise does not tell from the best: intervals of curves hold them too."""

    def variance(self, gradient: Array) -> tuple[float, float]:
        """Variance of a function with that gradient, and its degrees of freedom."""
        with np.errstate(over="ignore", invalid="ignore"):  # what nothing determines has no bound
            return self._variance(gradient)

    def _variance(self, gradient: Array) -> tuple[float, float]:
        along = self.pull.T @ gradient
        squares = [(slopes @ along) ** 2 for slopes in self.slopes]
        own = max(float(gradient @ self.noise @ gradient), 0.0)
        best = (own, PRIOR)
        widest = max(self.stretches, key=lambda one: float(gradient @ one.covariance @ gradient))
        best = _mixed(own, PRIOR, float(gradient @ widest.covariance @ gradient), _degrees(squares, widest.groups))
        if self.engaged is not None:
            V = float(gradient @ self.engaged.covariance @ gradient)
            if best[0] < V:
                best = _mixed(*best, V, _degrees(squares, self.engaged.groups), PRIOR)
        return best

    def of(self, gradient: Array) -> float:
        """Half-width of the 95 % interval of a function with that gradient."""
        variance, degrees = self.variance(gradient)
        return float(student.ppf(0.975, degrees) * variance**0.5)

    @property
    def covariance(self) -> Array:
        """One covariance for drawing, of all ways alike."""
        ways = [self.noise, *(one.covariance for one in self.stretches)]
        return np.asarray(sum(ways) / len(ways))


def _mixed(own: float, prior: float, other: float, degrees: float, most: float = np.inf) -> tuple[float, float]:
    prior = min(prior, most)
    total = prior + degrees
    return (prior * own + degrees * max(other, 0.0)) / total, total


def _degrees(squares: Sequence[Array], groups: Sequence[NDArray[np.intp]]) -> float:
    """How many groups decide a function: (Σ a)²/Σ a², a its squared influence in each group."""
    parts = [np.bincount(which, one) for one, which in zip(squares, groups, strict=True)]
    a = np.concatenate(parts).astype(np.float64)
    a = a / max(float(a.max()), 1e-300)
    square = float((a * a).sum())
    return max(float(a.sum()) ** 2 / square - 1.0, 0.5) if square > 0 else 0.5


@dataclass(frozen=True, eq=False)
class Piece:
    """One log in bins, (n, …)."""

    r: Array
    """Mean residual."""
    size: Array
    """Mean output above idle."""
    scores: Array
    """Σ Z r of each bin, (n, p)."""
    plain: Array
    """Σ Z, (n, p)."""
    scaled: Array
    """Σ Z T, (n, p)."""
    bin_s: float
    memory_s: float
    """Integrated correlation time of the residuals [s]."""
    engaged: NDArray[np.intp]


def piece_of(Z: Array, r: Array, at: NDArray[np.intp], n: int, drive: Drive, idle: float) -> Piece:
    """A log whose derivatives by the unknowns `at`, of n in all, are Z."""
    dt_s = float(drive.dt_s.sum()) / max(len(r), 1)
    step = -(-len(r) // BINS)
    starts = np.arange(0, len(r), step)
    count = np.diff(np.append(starts, len(r)))
    output = drive.y[drive.w > 0] - idle

    def binned(values: Array) -> Array:
        found = np.zeros((len(starts), n))
        found[:, at] = np.add.reduceat(values, starts)
        return found

    mean = np.add.reduceat(r, starts) / count
    return Piece(
        mean,
        np.add.reduceat(output, starts) / count,
        binned(Z * r[:, None]),
        binned(Z),
        binned(Z * output[:, None]),
        step * dt_s,
        correlation_s(mean, step * dt_s),
        engagements(drive)[drive.w > 0][starts],
    )


def spread(solved: Solved) -> Spread:
    """Everything that intervals need where a fit ended."""
    setup, x = solved.setup, solved.x
    clean = setup if solved.instruments is None else replace(setup, drives=solved.instruments)
    n = setup.size
    H = np.zeros((n, n))
    pieces = []
    for log, drive in enumerate(setup.drives):
        J, r = setup.jacobian(x, log)
        Z = J if solved.instruments is None else clean.jacobian(x, log)[0]
        at = setup.columns(log)
        H[np.ix_(at, at)] += Z.T @ J
        own = int(setup.own[log][0])
        pieces.append(piece_of(Z, r, at, n, drive, float(x[own]) if own >= 0 else 0.0))
    span = sum(one.bin_s * len(one.r) for one in pieces)
    memory = max(one.memory_s for one in pieces)
    free = directions(solved)
    middle = free.T @ H @ free
    scale = np.sqrt(np.maximum(np.abs(np.diagonal(middle)), 1e-300))
    pull = free @ (np.linalg.pinv(middle / np.outer(scale, scale), rcond=1e-13) / np.outer(scale, scale)) @ free.T
    worth = span / max(2 * memory, span / setup.samples)
    lost = worth / max(worth - free.shape[1], 0.25 * worth)
    noise = lost * pull @ sum((by_spectrum(one) for one in pieces), np.zeros((n, n))) @ pull.T
    stretches: list[Scores] = []
    for window in WINDOWS_S:
        if window > LONGEST * span and stretches:
            break
        wide = [max(1, round(window / one.bin_s)) for one in pieces]
        omega = sum((moving(one.scores, k) for one, k in zip(pieces, wide, strict=True)), np.zeros((n, n)))
        where = tuple(np.arange(len(one.r)) // k for one, k in zip(pieces, wide, strict=True))
        stretches.append(Scores(lost * pull @ omega @ pull.T, where))
    engaged, count = _engaged(pieces, pull, lost)
    unit = solved.cost / setup.samples * max(1.0, 2 * memory * setup.samples / span)
    rivals = tuple(x for x, cost in solved.rivals if cost - solved.cost <= RIVAL * unit)
    return Spread(noise, tuple(stretches), engaged, pull, tuple(one.plain for one in pieces), count, memory, rivals)


def _engaged(pieces: Sequence[Piece], pull: Array, lost: float) -> tuple[Scores | None, int]:
    """Scores added up over each engagement, where there are enough of them."""
    ends = [np.flatnonzero(np.append(True, np.diff(one.engaged) != 0)) for one in pieces]
    S = np.vstack([np.add.reduceat(one.scores, at) for one, at in zip(pieces, ends, strict=True)])
    count = len(S)
    if count < ENGAGEMENTS:
        return None, count
    S = S - S.mean(axis=0)
    covariance = lost * count / (count - 1) * pull @ (S.T @ S) @ pull.T
    return Scores(covariance, tuple(one.engaged for one in pieces)), count


def by_spectrum(piece: Piece) -> Array:
    """Variance of Σ Z r for noise S0(f) + T² S1(f), (p, p).

    The residuals are looked at through two windows, one that is wide where T is small and one that is T itself; the
    power of each is S0 Σ w² + S1 Σ w² T², two equations for two spectra.
    """
    n = len(piece.r)
    size = 2 ** int(np.ceil(np.log2(2 * n)))
    half = int(
        max(SMOOTH * size * piece.bin_s / (2 * np.pi * max(piece.memory_s, 0.5 * piece.bin_s)), FEWEST * size / n)
    )
    half = min(half, size // 2)
    T2 = piece.size**2
    middle = max(float(T2.mean()), 1e-300)
    windows = np.stack([1 / (1 + 9 * T2 / middle), np.sqrt(T2 / middle)])
    power = np.array([_smoothed(np.abs(np.fft.rfft(w * piece.r, size)) ** 2, half) for w in windows])
    A = np.array([[float((w * w).sum()), float((w * w * T2).sum())] for w in windows])
    if abs(np.linalg.det(A)) < 1e-3 * A[0, 0] * A[1, 1]:  # the output hardly changes: one spectrum
        spectra = np.stack([power.sum(axis=0) / A[:, 0].sum(), np.zeros(power.shape[1])])
    else:
        spectra = np.linalg.solve(A, power)
        alone = power.sum(axis=0) / A.sum(axis=0)[:, None]
        spectra[0] = np.where(spectra[1] < 0, alone[0], spectra[0])
        spectra[1] = np.where(spectra[0] < 0, alone[1], spectra[1])
        spectra = np.maximum(spectra, 0.0)
    twice = np.full(power.shape[1], 2.0)
    twice[0] = twice[-1] = 1.0
    total = np.zeros((piece.plain.shape[1],) * 2)
    for S, slopes in zip(spectra, (piece.plain, piece.scaled), strict=True):
        F = np.fft.rfft(slopes, size, axis=0)
        total += (F.conj().T @ (F * (twice * S)[:, None])).real / size
    return total


def _smoothed(values: Array, half: int) -> Array:
    """Mean over `half` lines to both sides, the spectrum mirrored at its ends."""
    mirrored = np.concatenate([values[half:0:-1], values, values[-2 : -half - 2 : -1]])
    total = np.append(0.0, np.cumsum(mirrored))
    return np.asarray((total[2 * half + 1 :] - total[: -2 * half - 1]) / (2 * half + 1))


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


def held(solved: Solved) -> set[str]:
    """Which of T_s, τ1, τ2 an active constraint holds at some input."""
    model = solved.setup.model
    if model.basis is None:
        return set()
    count = len(model.basis.duties)
    active = np.flatnonzero(model.A @ solved.coefficients - model.b < 1e-9 * (1 + np.abs(model.b)))
    return {("tau1", "tau2", "Ts", "tau2")[i // count] for i in active.tolist() if i < 4 * count}


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
    for k, name in enumerate(CURVES):  # what a constraint holds is not estimated
        if name in held(solved):
            half[k] = np.inf
    half = np.minimum(half, 700.0)
    low, high = values * np.exp(-half), values * np.exp(np.minimum(half, 50.0))
    for x in sure.rivals:
        other = np.stack([rows.steady @ x[:a], rows.tau1 @ x[a : a + b], rows.tau2 @ x[a + b : a + b + c]])
        low, high = np.minimum(low, other * np.exp(-half)), np.maximum(high, other * np.exp(np.minimum(half, 50.0)))
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        wide = np.where(low > 0, np.sqrt(high / low) - 1, np.inf)
    return CurveSpread(duty, values, low, high, wide)


def inputs_shown(levels: Sequence[float] | Array, low: float, high: float) -> Array:
    """The levels themselves where they are few, else eleven inputs from the lowest to the highest."""
    return np.asarray(levels, dtype=np.float64) if 0 < len(levels) <= 12 else np.linspace(low, high, 11)
