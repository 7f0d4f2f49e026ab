"""How noisy a record is: block means, their standard error, straight lines, the noise of samples, isolated spikes.

Noise is taken from differences between neighbours, so that slow changes do not count as noise. The density S of slow
noise is b var(block means), blocks of b = 0.25 s: white noise of standard deviation σ at a rate f has S = σ²/f.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from eaid.arrays import Array, means_of, median

BLOCKS = 20  # A window is judged by the means of this many equal parts
STANDARD_ERRORS = 5.0  # Standard errors beyond which a difference is told
# Part of a range below which a value has not moved; part of a step by which whole ones are off; steps of a spike
ROUNDED, WHOLE, MORE_STEPS = 1e-9, 1e-3, 3.5
MOST_PAIRS = 1_000_000  # Of neighbours that tell how noisy samples are, or somewhat more
SPIKE = 25.0  # Standard deviations of the noise beyond which a single sample is a spike
MOST_SPIKES = 0.05  # Part of the samples that spikes are at most
IDLE_BLOCK_S = 0.25
IDLE_BLOCKS = 8  # Blocks of `IDLE_BLOCK_S` below which an idle record tells no density


class FittedLine(NamedTuple):
    """A straight line by least squares."""

    slope: float
    error: float  # Standard error of the slope, of residuals that are independent
    left: Array  # Residuals, shape (n,)


def fit_line(at: NDArray[Any], values: Array, taken: int = 2) -> FittedLine:
    """The straight line through values at some places, shapes (n,), from which so many numbers are `taken` out."""
    x = at - at.mean()
    slope = float(x @ values / (x @ x))
    left = values - values.mean() - slope * x
    return FittedLine(slope, float(np.sqrt((left @ left) / max(1, len(left) - taken) / (x @ x))), left)


def stretches(mask: NDArray[np.bool_]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Where a mask is true: the first sample of each stretch, and the sample behind its last."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], mask.astype(np.int8), [0]))))
    return edges[::2], edges[1::2]


def block_means(values: Array, blocks: int = BLOCKS) -> Array:
    """Means of equal parts of the last axis, shape (…, blocks), fewer where there are fewer samples."""
    samples = values.shape[-1]
    edges = np.linspace(0, samples, min(blocks, samples) + 1).astype(np.intp)
    return np.asarray(np.add.reduceat(values, edges[:-1], axis=-1) / np.diff(edges))


def block_error(values: Array) -> float:
    """Standard error of the mean of one of `BLOCKS` parts, from how far neighbouring means of a fine division differ.

    0 of fewer than 8 samples.
    """
    means = block_means(values, 4 * BLOCKS)
    return block_noise(means) * float(np.sqrt(BLOCKS / len(means))) if len(means) >= 8 else 0.0


def block_noise(means: Array) -> float:
    """Standard deviation of the noise of single values, from their second differences; 0 of fewer than three."""
    if len(means) < 3:
        return 0.0
    bends = means[2:] - 2 * means[1:-1] + means[:-2]
    return float(1.4826 * median(np.abs(bends)) / np.sqrt(6))


def sample_noise(values: Array) -> float:
    """Standard deviation of the noise of single samples, from the median difference of neighbours, of a long record of
    some of them; 0 of one sample."""
    every = 1 + len(values) // MOST_PAIRS
    steps = np.abs(values[1::every] - values[:-1:every])
    if 2 * np.count_nonzero(steps) < len(steps):  # a commanded input: the median is 0
        return 0.0
    return float(1.4826 * median(steps) / np.sqrt(2)) if len(steps) else 0.0


LONGEST_RIPPLE = 64  # Samples of the longest ripple that is told from noise


def noise_beside_ripple(values: Array) -> float:
    """Standard deviation of the noise of single samples beside a ripple that comes again: by the differences at the
    distance at which they are least, a slope taken off."""
    apart = range(1, min(LONGEST_RIPPLE, len(values) // 4) + 1)
    steps = [values[k:] - values[:-k] for k in apart]
    return min((float(1.4826 * median(np.abs(one - median(one))) / np.sqrt(2)) for one in steps), default=0.0)


def resolution(values: Array) -> float:
    """The step that a sensor's values move by, all of them whole ones of it; 0 where none is told."""
    moves = np.abs(np.diff(values))
    moves = moves[moves > ROUNDED * float(np.ptp(values))]
    finest = float(moves.min()) if len(moves) else 0.0
    return finest if len(moves) and np.abs(moves / finest - np.round(moves / finest)).max() < WHOLE else 0.0


FEWEST_STANDING = 4  # Rows of an output that stands still, its sensor being coarser than its noise


def coarse_step(y: Array) -> float:
    """The step of a sensor that is coarser than its noise; 0 where most rows differ, or no step is told."""
    return resolution(y) if sample_noise(y) == 0 else 0.0


def left_open(y: Array, curve: Array) -> Array:
    """How far off the values of a sensor coarser than its noise may be, (n,): where they stand on one count c while the
    curve f through them goes from a to b, f + d lies within c ± q/2, q being a step, d thus in a width of q − |b − a|
    about c − (a + b)/2. The width of even chances with that mean square about 0; 0 where they do not stand."""
    if not (q := coarse_step(y)):
        return np.zeros(len(y))
    first = np.flatnonzero(np.append(True, np.diff(y) != 0))
    last = np.append(first[1:], len(y)) - 1
    a, b = curve[first], curve[last]
    width, off = np.maximum(q - np.abs(b - a), 0.0), np.clip(y[first] - 0.5 * (a + b), -0.5 * q, 0.5 * q)
    return np.repeat(np.sqrt(width**2 + 12 * off**2) * (last - first >= FEWEST_STANDING - 1), last - first + 1)


def spikes(values: Array, least: float) -> NDArray[np.intp]:
    """Samples that stand out of both neighbours, in one direction, by `SPIKE` of the noise, by `least` and by more than
    a step of the sensor; none where so many do."""
    if len(values) < 8:
        return np.empty(0, dtype=np.intp)
    steps, least = np.diff(values), max(least, MORE_STEPS * resolution(values))
    before, after = steps[:-1], steps[1:]
    sizes = np.minimum(np.abs(before), np.abs(after))
    out = np.flatnonzero((sizes > least) & (before * after < 0))
    found = out[sizes[out] > SPIKE * sample_noise(values)] + 1 if len(out) else out
    return found if len(found) <= MOST_SPIKES * len(values) else found[:0]


def medians_of_five(values: Array) -> Array:
    """Medians of each sample with two neighbours on both sides, those at the ends repeated, shape (n,)."""
    return np.asarray(np.partition(sliding_window_view(np.pad(values, 2, mode="edge"), 5), 2)[:, 2])


def glitch(values: Array) -> NDArray[np.intp]:
    """One row or two, one behind the other, beyond all others by a fifth, and back by half of those in one row."""
    sizes, drop = np.abs(values), 8 * sample_noise(values)
    far, left = list[int](), sizes.copy()
    for _ in range(min(3, len(sizes))):
        far.append(int(left.argmax()))
        left[far[-1]] = -1.0
    for rows in (1, 2) if len(far) == 3 else ():
        at, rest = np.sort(far[:rows]), float(sizes[far[rows]])
        together = at[-1] - at[0] == rows - 1 and at[-1] + 1 < len(values)
        if together and sizes[at].min() > 1.2 * rest and sizes[at[-1] + 1] < sizes[at[-1]] - max(0.5 * rest, drop):
            return at
    return np.empty(0, dtype=np.intp)


def idle_density(time_s: Array, idle: Array) -> float | None:
    """S of an idle record [output²·s], its drift taken out as a straight line; None where it is too short to tell."""
    if len(idle) < 2 * IDLE_BLOCKS or time_s[-1] - time_s[0] < IDLE_BLOCKS * IDLE_BLOCK_S:
        return None
    place, block = np.unique(np.floor((time_s - time_s[0]) / IDLE_BLOCK_S), return_inverse=True)
    count = np.bincount(block)
    full = count >= 0.5 * median(count)
    means = (np.bincount(block, idle) / count)[full]
    if len(means) < IDLE_BLOCKS:
        return None
    left = fit_line(place[full], means).left
    return float(IDLE_BLOCK_S * (left @ left) / (len(means) - 2))


QUICK_LAGS, ALL_LAG_ROWS = 16, 10**6  # Lags of a correlation that are looked at first; rows in which all are


def correlation_s(r: Array, dt_s: float) -> float:
    """Integrated correlation time of residuals [s]: half of what one independent sample takes."""
    n, r = len(r), r - r.mean()
    if n < 8 or not r @ r > 0:
        return 0.5 * dt_s
    rho = np.array([float(r[k:] @ r[: n - k]) for k in range(min(QUICK_LAGS, n))])  # a tenth of the time of all lags
    if rho.min() >= 0.05 * rho[0] and n > QUICK_LAGS:
        if n > ALL_LAG_ROWS:  # what lasts for so many rows is seen in means of some
            return correlation_s(means_of(r, -(-n // ALL_LAG_ROWS)), -(-n // ALL_LAG_ROWS) * dt_s)
        rho = np.fft.irfft(np.abs(np.fft.rfft(r, 2 * n)) ** 2)[:n]
    below = np.flatnonzero(rho < 0.05 * rho[0])
    end = int(below[0]) if len(below) else n
    return float((0.5 + rho[1:end].sum() / rho[0]) * dt_s)


def effective_samples(r: Array, dt_s: float) -> float:
    """How many samples of residuals are worth one each."""
    return len(r) * dt_s / max(2 * correlation_s(r, dt_s), dt_s)
