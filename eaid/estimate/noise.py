"""The noise of recorded logs: residuals in bins, their two spectra, engagements.

r = noise of the sensor + noise that goes with the output T:   S(f) = S0(f) + T² S1(f)
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from eaid.arrays import Array
from eaid.estimate.from_logs import Solved, idle_of
from eaid.estimate.response import Drive
from eaid.findings import Finding, finding

BINS = 16_384  # Derivatives and residuals are first added up over so many short bins of a log, at most
SMOOTH = 0.25  # Half-width over which the noise's spectrum is smoothed, as a part of its corner frequency …
LEAST_LEFT = 0.25  # A line keeps at least this part of its power
SMALL = 9.0  # An output is small or large beside its mean square over this
FEWEST = 8  # … and at least so many lines


@dataclass(frozen=True, eq=False)
class Piece:
    """One log in bins, (n, …)."""

    r: Array  # Mean residual
    size: Array  # Mean output above idle
    plain: Array  # Σ Z, (n, p)
    scaled: Array  # Σ Z T, (n, p)
    rows: int  # Samples of a bin
    bin_s: float
    memory_s: float  # Integrated correlation time of the residuals [s]
    engaged: NDArray[np.intp]


def piece_of(Z: Array, r: Array, at: NDArray[np.intp], n: int, drive: Drive, idle: float) -> Piece:
    """A log whose derivatives by the unknowns `at`, of n in all, are Z."""
    dt_s = float(drive.dt_s.sum()) / max(len(r), 1)
    step = -(-len(r) // BINS)
    starts = np.arange(0, len(r), step)
    count = np.diff(np.append(starts, len(r)))
    output = drive.y[drive.w > 0] - idle

    def binned(values: Array) -> Array:
        bins = np.zeros((len(starts), n))
        bins[:, at] = np.add.reduceat(values, starts)
        return bins

    mean = np.add.reduceat(r, starts) / count
    return Piece(
        mean,
        np.add.reduceat(output, starts) / count,
        binned(Z),
        binned(Z * output[:, None]),
        step,
        step * dt_s,
        correlation_s(mean, step * dt_s),
        engagements(drive)[drive.w > 0][starts],
    )


@dataclass(frozen=True, eq=False)
class Lines:
    """Noise by its two spectra, S0 and T² S1, line by line (m of them)."""

    slopes: NDArray[np.complex128]  # √S F(Z) and √S1 F(Z T), (2, m, p)
    # Part of the lines that are independent of each other, of both: the log's length over that with its zeros, less
    # where the noise is small, (2,)
    apart: Array
    left: Array  # Part of their power that the fit leaves, (2, m)
    half: int  # Half-width over which they were smoothed

    @property
    def total(self) -> Array:
        """Variance of Σ Z r, (p, p)."""
        F = self.slopes
        return np.asarray(np.tensordot(F.conj(), F, axes=((0, 1), (0, 1))).real)

    def degrees(self, along: Array) -> tuple[float, float]:
        """Variance of Σ Z r along a direction, and its degrees of freedom: two for each line that carries it.

        With V = Σ b S, S the power of a line, of χ² with two degrees, they are 2 (Σ b S)²/Σ (b S)² (Satterthwaite).
        """
        parts = np.abs(self.slopes @ along) ** 2
        total = float(parts.sum())
        if not 0 < total < np.inf:
            return total, 1.0
        even = (_smoothed(part / total, self.half) for part in parts)
        spread = sum(
            float((one**2 / left).sum()) / apart for one, apart, left in zip(even, self.apart, self.left, strict=True)
        )
        return total, max(2 / spread, 1.0)


def by_spectrum(piece: Piece, pull: Array) -> Lines:
    """The variance of Σ Z r for noise S0(f) + T² S1(f); `pull` is H⁻¹.

    The residuals are looked at through two windows w, one that is wide where T is small and one that is 1/T where T is
    large, so that noise that goes with T counts alike there; the power of each is S0 Σ w² + S1 Σ w² T², two equations
    for two spectra. The fit takes power out of the residuals where its unknowns act, mostly at low frequencies: of each
    line Σ w² − F(w Z)* H⁻¹ F(w Z) of Σ w² is left.
    """
    n = len(piece.r)
    size = 2 ** int(np.ceil(np.log2(2 * n)))
    half = int(
        max(SMOOTH * size * piece.bin_s / (2 * np.pi * max(piece.memory_s, 0.5 * piece.bin_s)), FEWEST * size / n)
    )
    half = min(half, size // 2)
    T2 = piece.size**2
    middle = max(float(T2.mean()), 1e-300)
    windows = np.stack([1 / (1 + SMALL * T2 / middle), np.sqrt(T2 * middle) / (middle / SMALL + T2)])
    power, lefts = np.empty((2, size // 2 + 1)), np.empty((2, size // 2 + 1))
    for k, w in enumerate(windows):
        F = np.fft.rfft(w[:, None] * piece.plain, size, axis=0)
        taken = ((F.conj() @ pull) * F).sum(axis=1).real / piece.rows / float(w @ w)
        lefts[k] = np.maximum(1 - _smoothed(taken, half), LEAST_LEFT)
        power[k] = _smoothed(np.abs(np.fft.rfft(w * piece.r, size)) ** 2, half) / lefts[k]
    A = np.array([[float((w * w).sum()), float((w * w * T2).sum())] for w in windows])
    if abs(np.linalg.det(A)) < 1e-3 * A[0, 0] * A[1, 1]:  # the output hardly changes: one spectrum
        spectra = np.stack([power.sum(axis=0) / A[:, 0].sum(), np.zeros(power.shape[1])])
    else:
        spectra = np.linalg.solve(A, power)
        alone = power.sum(axis=0) / A.sum(axis=0)[:, None]
        spectra[0] = np.where(spectra[1] < 0, alone[0], spectra[0])
        spectra[1] = np.where(spectra[0] < 0, alone[1], spectra[1])
        spectra = np.maximum(spectra, 0.0)
    twice = np.full(power.shape[1], 2.0 / size)
    twice[0] = twice[-1] = 1.0 / size
    lines = np.stack(
        [np.fft.rfft(slopes, size, axis=0) * np.sqrt(twice * S)[:, None]
         for S, slopes in zip(spectra, (piece.plain, piece.scaled), strict=True)]
    )  # fmt: skip
    seen = [w**2 * own for w, own in zip(windows, (np.ones(n), T2), strict=True)]
    apart = [float(v.sum() ** 2 / max(float(v @ v), 1e-300)) / size for v in seen]
    return Lines(lines, np.array(apart), lefts, half)


def _smoothed(values: Array, half: int) -> Array:
    """Mean over `half` lines to both sides, the spectrum mirrored at its ends."""
    mirrored = np.concatenate([values[half:0:-1], values, values[-2 : -half - 2 : -1]])
    total = np.append(0.0, np.cumsum(mirrored))
    return np.asarray((total[2 * half + 1 :] - total[: -2 * half - 1]) / (2 * half + 1))


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
    loaded = drive.duty[drive.which] > 0
    begins = np.append(loaded[0], loaded[1:] & ~loaded[:-1])
    return np.asarray(np.maximum(np.cumsum(begins) - 1, 0))


WINDOW_S = 2.0  # Stretch over which the density of the noise is taken [s]
FEWEST_ENGAGEMENTS = 4  # Fewest engagements whose scatter counts
CHANCE = 1e-3  # Gains that noise makes so different more rarely than this are told
LEAST_LOAD = 0.02  # An engagement with less than this part of the mean ∫ T² tells no gain


@dataclass(frozen=True, eq=False)
class Scatter:
    """Noise and scatter of a fit's residuals."""

    sensor_nm2_s: float
    ripple_s: float
    gain: float  # Standard deviation of the gain between engagements beyond what noise makes of it
    count: int
    chance: float  # That noise alone makes gains so different
    residuals: tuple[Array, ...]  # Model less recorded, without what the gains explain, of each log


def scatter_of(solved: Solved) -> Scatter:
    """Gains of all engagements, and the noise about them."""
    gains, squares, fourths, cleaned, outputs, steps = [], [], [], [], [], []
    for k, drive in enumerate(solved.setup.drives):
        r = solved.missed[k]
        T = solved.outputs[k] - idle_of(solved, k) + r
        which = engagements(drive)[drive.w > 0]
        square = np.bincount(which, T**2)
        loaded = square > LEAST_LOAD * square.mean()
        gain = np.where(loaded, np.bincount(which, T * r) / np.maximum(square, 1e-300), 0.0)
        steps.append(float(drive.dt_s.sum()) / len(r))
        gains.append(gain[loaded])
        squares.append(square[loaded] * steps[-1])
        fourths.append(np.bincount(which, T**4)[loaded] * steps[-1])
        cleaned.append(r - gain[which] * T)
        outputs.append(T)
    gamma, T2, T4 = np.concatenate(gains), np.concatenate(squares), np.concatenate(fourths)
    if len(gamma) < FEWEST_ENGAGEMENTS:
        return Scatter(*densities(solved.missed, outputs, steps), 0.0, len(gamma), 1.0, solved.missed)
    s0, s1 = densities(cleaned, outputs, steps)
    own = np.maximum((s0 * T2 + s1 * T4) / T2**2, 1e-300)
    mean = float((gamma / own).sum() / (1 / own).sum())
    chance = float(chdtrc(len(gamma) - 1, float(((gamma - mean) ** 2 / own).sum())))
    gain = max(float(gamma.var(ddof=1)) - float(own.mean()), 0.0) ** 0.5
    return Scatter(s0, s1, gain, len(gamma), chance, tuple(cleaned))


def scatter_findings(scatter: Scatter) -> list[Finding]:
    """Whether the output differs between engagements, where there are enough to see it."""
    if scatter.count < FEWEST_ENGAGEMENTS:
        return [finding("engagements-few", "data", count=scatter.count)]
    if scatter.chance < CHANCE and scatter.gain > 0:
        return [finding("engagements-scatter", "data", scatter_pct=100 * scatter.gain, count=scatter.count)]
    return []


def densities(residuals: Sequence[Array], outputs: list[Array], steps: list[float]) -> tuple[float, float]:
    """s0 and s1 of S = s0 + s1 T², from squared sums of the residuals over short stretches."""
    squares, powers = [], []
    for r, T, dt_s in zip(residuals, outputs, steps, strict=True):
        width = max(1, round(WINDOW_S / dt_s))
        count = len(r) // width
        squares.append(np.mean(T[: count * width].reshape(count, width) ** 2, axis=1))
        powers.append(r[: count * width].reshape(count, width).sum(axis=1) ** 2 * dt_s / width)
    x, S = np.concatenate(squares), np.concatenate(powers)
    design = np.column_stack([np.ones_like(x), x])
    weight = 1 / np.maximum(S.mean() * (0.1 + x / max(x.mean(), 1e-300)), 1e-300)
    s0, s1 = np.linalg.lstsq(design * weight[:, None], S * weight, rcond=None)[0].tolist()
    if s1 < 0:
        return float(S.mean()), 0.0
    if s0 < 0:
        return 0.0, float((S * weight).sum() / max((x * weight).sum(), 1e-300))
    return s0, s1
