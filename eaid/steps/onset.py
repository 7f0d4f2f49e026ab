"""When an output leaves its rest for good: the instant of a step that no input tells.

Until it has risen to `PART` of where it goes, a rest and an exponential behind an instant t0 are fitted to it,

    y = c + A (1 − e^(−(t − t0)/τ)),   t > t0,

on a grid of t0 and τ over ever fewer rows, each time so many means, then to all of them. An output that has left its
rest before t0, by more than noise, begins as no exponential does: then it is where it last was at rest.
"""

from typing import NamedTuple

import numpy as np

from eaid.arrays import Array, inverse, means_of, median
from eaid.plant.steps import decay, rise
from eaid.steps.noise import block_means, sample_noise
from eaid.steps.plateaus import FEWEST_HELD

PART = 0.6  # Of the change, up to which one exponential is the rise
MEANS, TAUS = 200, np.geomspace(0.1, 20.0, 12)  # Of the grid; τ in parts of the time that the rise takes
REST_PARTS = 4.0  # Rest that is kept before the rise, in parts of the time that the rise takes
CLEAR_CHANGE = 8.0  # Standard deviations of the noise by which a change stands out
BEGINS_LATE = 20.0  # Gain of squares, in variances of the noise, from which a rest before the rise is no chance
ERRORS = 3.0  # Of an instant, from which an output has left its rest before it
FALLS = 4, 24  # An output is let go, at once or not, where it falls within so many of twice `MEANS` blocks …
HELD, LEFT = 0.6, 0.25  # … from this share of its peak to that, and stays below for a twentieth of the log
NEWTON_STEPS = 5  # Of Gauss and Newton
GROUP = 8  # Means whose mean tells how far the noise is from white


class Onset(NamedTuple):
    """The first row of a step; row 0: no rest is recorded before it."""

    row: int
    error_s: float  # Standard error of its instant [s]
    high_s: float  # When it has risen by `PART`, from the first row on [s]


def onset(time_s: Array, output: Array) -> Onset | None:
    """Where an output leaves its rest; None where nothing stands out of its noise."""
    if len(output) < 2 * FEWEST_HELD:
        return None
    means = block_means(output, 2 * MEANS)
    first = median(means[:3])
    away = np.abs(means - first)
    change = float(np.quantile(away, 0.9))
    if change <= CLEAR_CHANGE * sample_noise(output) / max(1.0, np.sqrt(len(output) / len(means)) / 2) or change == 0:
        return None
    sign = 1.0 if float((means - first)[away >= PART * change].mean()) > 0 else -1.0
    risen, start, stop, best = sign * (output - first) / change, 0, len(output), (0.0, 0.0)
    while True:
        width = max(1, (stop - start) // MEANS)
        y, t = means_of(risen[start:stop], width), means_of(time_s[start:stop], width)
        high = np.flatnonzero(y >= PART)
        last = max(int(high[0]) + 1 if len(high) else len(y), min(len(y), 8))
        t, y = t[:last], y[:last]
        best, gain = _on_grid(t, y)
        at = int(np.searchsorted(time_s, best[0]))
        whole, stop = stop - start, min(len(output), start + (last + 1) * width)
        start = max(start, int(at - max(REST_PARTS * max(stop - at, 1), 4 * width)))
        if width == 1 or stop - start > whole / 2:
            break
    high_s = float(t[-1] - time_s[0])
    if at < FEWEST_HELD or gain < BEGINS_LATE:
        return Onset(0, 0.0, high_s)
    at_s, error_s = _refined(t, y, *best)
    row = min(max(int(np.searchsorted(time_s, at_s - (time_s[at] - time_s[at - 1]) / 2)), 1), len(output) - 1)
    off = np.abs(risen[: start + last * width] - median(risen[start:at]))
    rests = np.flatnonzero(off <= max(4 * 1.4826 * median(off[start:at]), 0.01))
    early = int(rests[-1]) + 1
    if time_s[early] < at_s - ERRORS * error_s - (time_s[row] - time_s[row - 1]):
        return Onset(early, float(at_s - time_s[early]), high_s)
    return Onset(row, error_s, high_s)


def _on_grid(t: Array, y: Array) -> tuple[tuple[float, float], float]:
    """The instant and τ of the best exponential on a grid, and what a rest before it gains, in variances of noise."""
    at = t[: max(2, len(t) - 3)]
    centred, best, start = y - y.mean(), (np.inf, 0.0, 1.0), np.inf
    for tau in TAUS * float(t[-1] - t[0]):
        bases = rise(np.maximum(t - at[:, None], 0.0), tau)
        bases -= bases.mean(axis=1, keepdims=True)
        sizes = np.maximum(np.vecdot(bases, bases), 1e-300)
        left = centred @ centred - np.maximum(bases @ centred, 0.0) ** 2 / sizes
        k = int(left.argmin())
        best, start = min(best, (float(left[k]), float(at[k]), tau)), min(start, float(left[0]))
    return (best[1], best[2]), (start - best[0]) / max(best[0] / max(1, len(t) - 4), 1e-24)


def _refined(t: Array, y: Array, at: float, tau: float) -> tuple[float, float]:
    """The instant of least squares, by a few steps from that of the grid, and its standard error by what is left."""
    ones, ends = np.ones_like(t), []
    for _ in range(NEWTON_STEPS):
        since = np.maximum(t - at, 0.0)
        g, slope = rise(since, tau), (t > at) * decay(since, tau) / tau
        (c, A), *_ = np.linalg.lstsq(np.stack((ones, g), axis=1), y, rcond=None)
        left, J = y - c - A * g, np.stack((-A * slope, -A * slope * since, g, ones), axis=1)
        ends.append((float(left @ left), at, left, J))
        step = np.linalg.lstsq(J, left, rcond=None)[0]
        at, tau = at + step[0], tau * float(np.exp(np.clip(step[1], -0.5, 0.5)))
    square, at, left, J = min(ends, key=lambda end: end[0])
    groups = means_of(left, GROUP)
    variance = max(square, GROUP**2 * float(groups @ groups)) / max(1, len(t) - 4)
    return at, float(np.sqrt(variance * inverse(J.T @ J)[0, 0]))


class LetGo(NamedTuple):
    """The time of the first row of an output's fall [s], and whether it falls at once."""

    at_s: float
    at_once: bool


def let_go(time_s: Array, output: Array) -> LetGo | None:
    """Where an output falls for good from its hold; None of one that stays, or comes back."""
    if len(output) < 2 * MEANS:
        return None
    means = block_means(output, 2 * MEANS)
    moved = np.abs(means - median(means[:4]))
    peak = float(np.quantile(moved, 0.95))
    held = np.flatnonzero(moved >= HELD * peak)
    last = int(held[-1]) if len(held) else 2 * MEANS
    low = [(moved[last + blocks :] < LEFT * peak).mean() > 0.95 for blocks in FALLS if last + blocks < 1.9 * MEANS]
    if last <= 4 or not any(low):
        return None
    block = len(output) / len(means)
    first = int((last + 1 - (last + 1 - int(held[0])) // 4) * block)  # the last quarter of the hold is its rest
    fall = onset(time_s[first:], output[first:])
    return LetGo(float(time_s[int((last + 1) * block) if fall is None or not fall.row else first + fall.row]), low[0])
