"""Intervals of a recorded fit: what its residuals, coloured as they are, leave open about any function of its unknowns.

    V = H⁻¹ Ω H⁻¹',   H = Σ Z'J,   Ω = Σ_f S0 |F(Z)|² + S1 |F(Z T)|²,   the variance of Σ_k Z_k' r_k

Z is J but where an instrument stands in for it. r is white and coloured noise of the sensor, and noise that goes with
the output T: S(f) = S0(f) + T² S1(f), both spectra smoothed. A function's variance has two degrees of freedom for each
line of the spectra that carries it (Satterthwaite). Where the logs hold four engagements or more (stretches under load
between returns to rest, and whole logs) and their gains differ, these are taken out of r, and what they do is added:
σ² H⁻¹ Σ s s' H⁻¹, s = Σ Z T of an engagement. Directions that an active constraint holds are left out.

Of another kind of plant from steps: a run of a level has a gain and dynamics of its own: with J = ∂f/∂(ln gain,
dynamics) on the samples of a level, each run alone moves them by (J'J)⁻¹ J' (y_r − ȳ). That scatter, pooled over the
levels, gives the unknowns' as it gives the clutch's (`eaid.estimate.spread`); the dynamics are one for all levels, and
so are their units here.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from eaid.arrays import Array, scaled_inverse
from eaid.estimate.scatter import USUAL, USUAL_TAU, scatter_about, scatter_of_singles
from eaid.estimate.spread import Influence, free_inverse, t_quantile
from eaid.recorded.engagements import (
    GAINS_SEEN,
    EngagementScatter,
    FreedLog,
    engagement_starts,
    free_gains,
    gains_weight,
    lag_scatter,
    scatter_of,
)
from eaid.recorded.few_rows import BINS
from eaid.recorded.from_logs import Setup, Solved, idle_found
from eaid.recorded.late import differ_by_a_row
from eaid.steps.noise import correlation_s, left_open
from eaid.steps.stepset import Level

SMOOTH_PART = 0.25  # Half-width over which the noise's spectrum is smoothed, as a part of its corner frequency …
LEAST_LEFT = 0.25  # A line keeps at least this part of its power
SMALL_OUTPUT = 9.0  # An output is small or large beside its mean square over this
FEWEST_LINES = 8  # … and at least so many lines


@dataclass(frozen=True, eq=False)
class BinnedLog:
    """One log in bins, (n, …)."""

    starts: NDArray[np.intp]  # First row of each bin
    size: Array  # Mean output above idle
    plain: Array  # Σ Z, (n, p)
    scaled: Array  # Σ Z T, (n, p)
    squares: Array  # Σ T²
    rows: int  # Samples of a bin
    bin_s: float
    engaged: NDArray[np.intp]

    def means(self, r: Array) -> Array:
        """Of a value of every sample, (n,)."""
        return np.asarray(np.add.reduceat(r, self.starts) / np.diff(np.append(self.starts, len(r))))

    def of_engagements(self, values: Array) -> Array:
        """Sums over each engagement of a value of every bin, (n, …) → (engagements, …)."""
        return np.asarray(np.add.reduceat(values, np.flatnonzero(np.diff(self.engaged, prepend=-1) != 0)))


def bin_log(solved: Solved, clean: Setup, log: int, freed: "FreedLog | None" = None) -> tuple[BinnedLog, Array]:
    """One log in bins, its derivatives Z those of a `clean` drive, or `freed` of gains, and its part of H, (n, n)."""
    setup, x, drive = solved.setup, solved.x, solved.setup.drives[log]
    counted, columns = drive.w > 0, setup.places[log].columns
    output = drive.y[counted] - idle_found(solved, log)
    step = -(-len(output) // BINS)
    starts = np.arange(0, len(output), step)
    (plain, scaled), H = np.zeros((2, len(starts), setup.size)), np.zeros((setup.size, setup.size))
    if freed is not None:
        both = iter([(freed.Z, freed.J)])
    elif clean is not setup:  # in one piece: their rows where inputs change are not the same
        both = iter([(clean.jacobian(x, log)[0], setup.jacobian(x, log)[0])])
    elif (few := few_in_bins(solved, log, step)) is not None:
        Z, J, first, T = few
        H[np.ix_(columns, columns)], both = J.T @ J, iter(())
        plain[:, columns], scaled[:, columns] = np.add.reduceat(Z, first), np.add.reduceat(Z * T[:, None], first)
    else:
        both = ((piece, piece) for piece in setup.derivatives(x, log))
    at = 0
    for Z, J in both:
        Z, J = Z[:, : len(columns)], J[:, : len(columns)]
        H[np.ix_(columns, columns)] += Z.T @ J
        rows = slice(at % step, at % step + len(Z))  # in whole bins, the first begun before
        bins = -(-rows.stop // step)
        whole, factors = np.zeros((bins * step, len(columns))), np.zeros((2, bins * step))
        whole[rows], factors[0, rows], factors[1, rows] = Z, 1.0, output[at : at + len(Z)]
        sums = factors.reshape(2, bins, 1, step) @ whole.reshape(bins, step, len(columns))
        into = np.ix_(np.arange(bins) + at // step, columns)
        plain[into] += sums[0, :, 0]
        scaled[into] += sums[1, :, 0]
        at += len(Z)
    sizes = np.add.reduceat(output, starts) / np.diff(np.append(starts, len(output)))
    bin_s = step * float(drive.dt_s.sum()) / max(len(output), 1)
    squares = np.add.reduceat(output * output, starts)
    engaged = np.searchsorted(engagement_starts(drive), starts, side="right")
    return BinnedLog(starts, sizes, plain, scaled, squares, step, bin_s, engaged), H


def few_in_bins(solved: Solved, log: int, step: int) -> tuple[Array, Array, NDArray[np.intp], Array] | None:
    """Of a long log whose input is held the derivatives of a few rows times how many stand for each, and times the root
    of that, (m, p), the first of each bin of `step` rows, and the output above idle, (m,); None of others."""
    setup = solved.fitted
    copy = None if setup.model.kind == "swing" or not setup.copies else setup.copies[log]
    if copy is None or (few := copy.in_bins) is None:
        return None
    used, t = few.w > 0, copy.log.time_s
    drives = (*setup.drives[:log], few, *setup.drives[log + 1 :])
    J, known = replace(setup, drives=drives).jacobian(solved.x, log)[0], np.cumsum(np.isfinite(copy.log.output))
    row = np.searchsorted(t, t[0] + np.append(0.0, np.cumsum(few.dt_s[:-1]))[used], side="right") - 1
    which = np.maximum(known[row] - 1, 0) // step
    if which[-1] + 1 != -(-int(known[-1]) // step) or np.diff(which, prepend=-1).max() > 1:
        return None
    Z = J * np.sqrt(few.w[used] / copy.log.weight)[:, None]
    return Z, J, np.flatnonzero(np.diff(which, prepend=-1)), few.y[used] - idle_found(solved, log)


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
        even = (_smooth_lines(part / total, self.half) for part in parts)
        spread = sum(
            float((one**2 / left).sum()) / apart for one, apart, left in zip(even, self.apart, self.left, strict=True)
        )
        return total, max(2 / spread, 1.0)


def find_lines(piece: BinnedLog, r: Array, pull: Array) -> Lines:
    """The variance of Σ Z r for noise S0(f) + T² S1(f); `pull` is H⁻¹, r the mean residuals of the bins.

    The residuals are looked at through two windows w, one that is wide where T is small and one that is 1/T where T is
    large, so that noise that goes with T counts alike there; the power of each is S0 Σ w² + S1 Σ w² T², two equations
    for two spectra. The fit takes power out of the residuals where its unknowns act, mostly at low frequencies: of each
    line Σ w² − F(w Z)* H⁻¹ F(w Z) of Σ w² is left.
    """
    n, memory_s = len(r), correlation_s(r, piece.bin_s)
    size = 2 ** int(np.ceil(np.log2(2 * n)))
    half = int(
        max(SMOOTH_PART * size * piece.bin_s / (2 * np.pi * max(memory_s, 0.5 * piece.bin_s)), FEWEST_LINES * size / n)
    )
    half = min(half, size // 2)
    T2 = piece.size**2
    middle = max(float(T2.mean()), 1e-300)
    windows = np.stack([1 / (1 + SMALL_OUTPUT * T2 / middle), np.sqrt(T2 * middle) / (middle / SMALL_OUTPUT + T2)])
    power, lefts = np.empty((2, size // 2 + 1)), np.empty((2, size // 2 + 1))
    for k, w in enumerate(windows):
        F = np.fft.rfft(w[:, None] * piece.plain, size, axis=0)
        taken = ((F.conj() @ pull) * F).sum(axis=1).real / piece.rows / float(w @ w)
        lefts[k] = np.maximum(1 - _smooth_lines(taken, half), LEAST_LEFT)
        power[k] = _smooth_lines(np.abs(np.fft.rfft(w * r, size)) ** 2, half) / lefts[k]
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


def _smooth_lines(values: Array, half: int) -> Array:
    """Mean over `half` lines to both sides, the spectrum mirrored at its ends; SciPy's takes long to import."""
    mirrored = np.concatenate([values[half:0:-1], values, values[-2 : -half - 2 : -1]])
    total = np.append(0.0, np.cumsum(mirrored))
    return np.asarray((total[2 * half + 1 :] - total[: -2 * half - 1]) / (2 * half + 1))


@dataclass(frozen=True, eq=False)
class Spread:
    """What is needed for the variance of any function of the unknowns."""

    noise: Array  # Covariance of the unknowns by the noise
    lines: tuple[Lines, ...]  # What it rests on, log by log
    between: Array  # Covariance by scatter between engagements
    scatter: EngagementScatter
    pull: Array  # H⁻¹ where the constraints leave it free
    runs: Influence | None = None  # How the unknowns answer to the runs whose means were fitted, in place of all that

    @np.errstate(over="ignore", invalid="ignore")  # what nothing determines has no bound
    def variance(self, gradient: Array) -> tuple[float, float]:
        """Variance of a function with that gradient, and its degrees of freedom."""
        if self.runs is not None:
            of_runs, known = self.runs.of(gradient[None]).variance()
            return float(of_runs[0]), float(known[0])
        along = self.pull.T @ gradient
        within = max(float(gradient @ self.noise @ gradient), 0.0)
        parts = np.array([one.degrees(along) for one in self.lines])  # variance and degrees of freedom of each log
        share = parts[:, 0] / max(float(parts[:, 0].sum()), 1e-300)
        degrees = 1 / max(float((share**2 / parts[:, 1]).sum()), 1e-3)
        between = max(float(gradient @ self.between @ gradient), 0.0)
        if between == 0.0:
            return within, degrees
        total = within + between  # degrees of freedom of a sum of variances (Satterthwaite), in parts of the whole
        own, others = within / total, between / total
        return total, 1 / (own**2 / degrees + others**2 / self.scatter.spare)

    def of(self, gradient: Array) -> float:
        """Half-width of the 95 % interval of a function with that gradient."""
        variance, degrees = self.variance(gradient)
        return float(t_quantile(degrees) * np.sqrt(variance))

    @property
    def covariance(self) -> Array:
        """One covariance for drawing."""
        return np.asarray(self.noise + self.between) if self.runs is None else self.runs.covariance()


@np.errstate(over="ignore", invalid="ignore")  # what nothing determines has no bound
def spread(solved: Solved, with_lags: bool = False) -> Spread:
    """Everything that intervals need where a fit ended, with how its lags scatter from engagement to engagement."""
    of_gains, solved = scatter_of(solved, 1.0)[0] if solved.beside is not None else None, solved.beside or solved
    setup = solved.setup
    clean = setup if solved.instruments is None else replace(setup, drives=solved.instruments)
    n = setup.size
    H = np.zeros((n, n))
    weight = None if of_gains is None else gains_weight(solved, of_gains)
    pieces, freed = [], None if weight is None else free_gains(setup, solved.x, weight)
    for log in range(len(setup.drives)):
        piece, part = bin_log(solved, clean, log, None if freed is None else freed[log])
        H += part
        pieces.append(piece)
    pull = free_inverse(H, solved.setup.problem().A[solved.active])
    # what gains of 1 do, one an engagement: H⁻¹ Σ_e s s' H⁻¹, s = Σ Z T of an engagement
    S = np.vstack([one.of_engagements(one.scaled) for one in pieces])
    squares = np.concatenate([one.of_engagements(one.squares) for one in pieces])
    scatter, residuals = scatter_of(solved, float((((S @ pull) * S).sum(axis=1) / np.maximum(squares, 1e-300)).sum()))
    residuals = residuals if scatter.chance <= GAINS_SEEN else solved.missed
    lines = []
    for one, r, drive in zip(pieces, residuals, setup.drives, strict=True):
        lines.append(find_lines(one, one.means(r * np.sqrt(drive.w[drive.w > 0])), pull))
    noise = pull @ sum((one.total for one in lines), np.zeros((n, n))) @ pull.T
    S = S @ pull.T
    between = S.T @ S * scatter.gain**2 * (scatter.chance <= GAINS_SEEN)
    if setup.between_rows:
        between += pull @ by_changes(solved, freed) @ pull.T
    noise += pull @ by_standing(solved, freed) @ pull.T
    if of_gains is not None and freed is not None and weight is not None:
        told = 0.0  # Unknowns that gains tell: T_s as a whole, or its curve
        for place, of_log in zip(setup.places, freed, strict=True):
            moves = of_log.by_gains @ pull[:, place.columns].T
            between = between + of_gains.gain**2 * moves.T @ moves
            told += float((moves[:, place.columns] * of_log.by_gains).sum()) / weight
        scatter = replace(of_gains, spare=max(of_gains.count - told, 1.0), beside=True)
    if with_lags and solved.instruments is None:
        sd, moves = lag_scatter(solved, pull, scatter, weight)
        between, scatter = between + sd**2 * moves.T @ moves, replace(scatter, tau1=sd)
    return Spread(noise, tuple(lines), between, scatter, pull)


def by_changes(solved: Solved, freed: "Sequence[FreedLog] | None") -> Array:
    """Variance of Σ Z r by inputs that change at any instant between two rows: Σ s s'/12, s = Σ Z D of a change, D what
    one row later makes of the residuals."""
    setup, total = solved.setup, np.zeros((solved.setup.size, solved.setup.size))
    for log, drive in enumerate(setup.drives):
        columns, counted = setup.places[log].columns, np.cumsum(drive.w > 0)
        starts = np.unique(counted[np.flatnonzero(np.diff(drive.which) != 0)])
        D = differ_by_a_row(setup, solved.x[columns], drive)
        s = sums_of_parts(solved, log, freed, np.searchsorted(starts, np.arange(len(D)), side="right"), D)
        total[np.ix_(columns, columns)] += s[1:].T @ s[1:] / 12  # the first is of rows before any change
    return total


def by_standing(solved: Solved, freed: "Sequence[FreedLog] | None") -> Array:
    """Variance of Σ Z r by a sensor that is coarser than its noise: Σ s s'/12, s = Σ Z (q − d) of the stretches for
    which one input leaves it on one count, q its step, d by how much the model moves in a stretch: the output may lie
    anywhere in what is left of q."""
    setup, total = solved.setup, np.zeros((solved.setup.size, solved.setup.size))
    for log, drive in enumerate(setup.drives):
        y, columns, counted = solved.outputs[log], setup.places[log].columns, drive.w > 0
        room = left_open(y, y + solved.missed[log])
        if not room.any():
            continue
        # the same wherever one input holds it on one count
        counts, which = np.unique(y, return_inverse=True)[1], drive.which[counted]
        alike = np.unique(counts * (which.max() + 1) + which, return_inverse=True)[1]
        s = sums_of_parts(solved, log, freed, alike, np.sqrt(drive.w[counted]) * room)
        total[np.ix_(columns, columns)] += s.T @ s / 12
    return total


def sums_of_parts(
    solved: Solved, log: int, freed: "Sequence[FreedLog] | None", part: NDArray[np.intp], factor: Array
) -> Array:
    """Σ Z times a factor over the rows of each part of a log, (parts, p); Z of its own columns, or `freed` of gains."""
    setup, at = solved.setup, 0
    sums = np.zeros((int(part.max()) + 1, len(setup.places[log].columns)))
    for piece in setup.derivatives(solved.x, log) if freed is None else (freed[log].Z,):
        rows = slice(at, at + len(piece))
        first = np.flatnonzero(np.diff(part[rows], prepend=-1))
        Z = piece[:, : sums.shape[1]] * factor[rows, None]
        np.add.at(sums, part[rows][first], np.add.reduceat(Z, first))
        at += len(piece)
    return sums


def spread_by_runs(plain: Spread, solved: Solved, levels: Sequence[Level]) -> Spread:
    """The spread of a fit to the mean curves of some levels, by their runs, single ones by how they lie about it; as it
    is where the logs are no levels."""
    if not levels:
        return plain
    setup, x, first = solved.setup, solved.x, solved.setup.model.slices[0].stop
    units = np.where(x[first:] != 0, np.abs(x[first:]), 1.0)  # logarithms, but for what is 0
    H, along, own = np.zeros((2, setup.size, setup.size)), [], []  # of one gain curve; of levels with a gain each
    for k in range(len(levels)):
        J, root = setup.jacobian(x, k)[0], np.sqrt(float(setup.drives[k].w.max()))
        own.append(np.column_stack([solved.outputs[k] + solved.missed[k], J[:, first:] / root * units]))
        f = own[-1][:, 0]
        each = J - np.outer(f, f @ J) / max(float(f @ f), 1e-300)
        H += J.T @ J, each.T @ each
        along.append([own[-1].T @ J * root, own[-1].T @ each * root])
    held, answers = setup.problem().A[solved.active], np.array(along)
    gain = answers[:, 0] @ free_inverse(H[0], held)
    if solved.levels_each:  # the lags answer so, the gain to what they leave of its levels
        of_lags = answers[:, 1, :, first:] @ free_inverse(H[1, first:, first:], held[:, first:])
        of_gain = (answers[:, 0, :, :first] - of_lags @ H[0, first:, :first]) @ scaled_inverse(H[0, :first, :first])
        gain = np.concatenate([of_gain, of_lags], axis=2)
    if max(len(level.runs) for level in levels) > 1:
        seen = scatter_about(levels, own)
    else:
        lags = [part.stop - part.start for part in setup.model.slices[1:]]
        terms = np.array([first, *np.repeat(lags, lags), *np.ones(len(x) - first - sum(lags))])
        usual = np.array([USUAL, *np.full(len(x) - first, USUAL_TAU)])
        seen = scatter_of_singles(levels, own, terms, usual)
    return replace(plain, runs=Influence(gain, seen, np.zeros((0, setup.size)), 0.0))
