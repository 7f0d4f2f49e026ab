"""The curves of one step, y = start + change · s(t), with s one of four, each with or without a dead time θ.

With t' = max(t − θ, 0): one exponential, s = 1 − e^(−t'/τ1); two, s = 1 − C e^(−t'/τ1) − (1 − C) e^(−t'/τ2) with C held
(the paper's eq. (4)), free between 0 and 1, or beyond 1: a slow part that decays, an overshoot. Where on a grid they
lie near a record tells where a fit begins.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from eaid.arrays import Array
from eaid.plant.dynamics import Step
from eaid.plant.steps import decay, step_response, step_ways

SHAPES = ("one", "two", "free", "overshoot")
LARGEST_C = 3.0  # Largest C of an overshoot: beyond, two nearly equal parts of opposite sign imitate other shapes
TAUS_APART = 2.0  # Least τ2/τ1 of an overshoot
OVERSHOOT_SEEN = 0.02  # Share of its peak by which an overshoot has to come down within the record


def step_of(p: Array) -> Step:
    """The step from rest of p = (change, ln τ1, ln(τ2/τ1), C, θ), without its dead time."""
    return Step(p[0], np.exp(p[1]), np.exp(p[1] + p[2]), p[3])


def step_curve(p: Array, time_s: Array) -> Array:
    """change · s(t) of p, shape (n,)."""
    return step_response(step_of(p), np.maximum(time_s - p[4], 0.0))


def slopes(p: Array, time_s: Array) -> Array:
    """∂ curve / ∂p, shape (n, 5); where p is complex, its real part decides which samples lie behind the dead time."""
    behind, at = np.real(time_s - p[4]) > 0, step_of(p)
    after = np.where(behind, time_s - p[4], 0.0)
    by_size, by_fast, by_slow, by_share, rate = step_ways(at, after)
    return np.array((by_size, by_fast + by_slow, by_slow, by_share, -rate * behind)).T


def overshoots(p: Array, window: float) -> bool:
    """True where a curve passes its peak within the window, and is `OVERSHOOT_SEEN` of its peak below it at the end."""
    at = np.linspace(p[4], window, 400)
    s = step_curve(np.array([1.0, *p[1:]]), at)
    return bool(s.max() - s[-1] > OVERSHOOT_SEEN * s.max())


MOST_POINTS = 800  # To which a record is averaged for the choice of a shape; the chosen one is fitted to all samples
TAU_GRID = 28
STARTS_KEPT = 3
DELAYS_TRIED = 20
FAR_START = 1.0  # Distance in ln τ2 from which a start is another


@dataclass(frozen=True, eq=False)
class AveragedRecord:
    """A record averaged to fewer points: finely at first, then coarser."""

    time_s: Array
    output: Array
    weight: Array
    within: float = 0.0  # Sum of squares of the samples about the means that stand for them: no shape takes it away


def average_record(time_s: Array, y: Array) -> AveragedRecord:
    """A record as some `MOST_POINTS` means and what they leave out."""
    count = len(y)
    if count <= MOST_POINTS:
        return AveragedRecord(time_s, y, np.ones(count))
    edges = np.unique(np.round(np.geomspace(1, count, MOST_POINTS)).astype(np.intp)) - 1
    fine = np.linspace(0, count, MOST_POINTS // 2).astype(np.intp)
    edges = np.unique(np.concatenate((edges, fine[:-1], [0])))
    edges = edges[edges < count]
    weight = np.diff(np.append(edges, count)).astype(np.float64)
    means = np.add.reduceat(y, edges) / weight
    within = max(0.0, float(y @ y - weight @ means**2))
    return AveragedRecord(np.add.reduceat(time_s, edges) / weight, means, weight, within)


def delays_tried(points: AveragedRecord) -> list[float]:
    """Shares of the time to half of the change [s]."""
    half = np.flatnonzero(np.abs(points.output) >= 0.5 * np.abs(points.output[-1]))
    until = float(points.time_s[half[0]]) if len(half) else float(points.time_s[-1]) / 4
    return [until * (k + 0.5) / DELAYS_TRIED for k in range(DELAYS_TRIED)]


def starts_of(
    points: AveragedRecord, window: float, delays: Sequence[float], share: float, wanted: Sequence[str]
) -> dict[str, list[Array]]:
    """The best places on a grid of time constants and dead times, for each shape; amplitudes are linear there."""
    stride = max(1, len(points.time_s) // 300)
    t, y, w = points.time_s[::stride], points.output[::stride], points.weight[::stride]
    shortest = max(window / 3000, float(np.diff(points.time_s[: max(2, len(t))]).min()) / 3)
    tau, each = np.geomspace(shortest, 5 * window, TAU_GRID), np.arange(TAU_GRID)
    pairs, total = np.triu_indices(TAU_GRID, 1), float(w @ y**2)
    places: dict[str, list[list[tuple[float, Array]]]] = {shape: [] for shape in wanted}
    for delay in delays:
        rises = 1 - decay(np.maximum(t - delay, 0.0), tau[:, np.newaxis])
        gram, right = (rises * w) @ rises.T, rises @ (w * y)
        one = np.diag(gram)
        for shape, rows in places.items():
            i, j = (each, each) if shape == "one" else pairs
            if shape in ("one", "two"):
                C = np.full(len(i), 1.0 if shape == "one" else share)
                size = C**2 * one[i] + 2 * C * (1 - C) * gram[i, j] + (1 - C) ** 2 * one[j]
                along = C * right[i] + (1 - C) * right[j]
                change = along / np.maximum(size, 1e-300)
                cost = total - change * along
            else:
                det = np.maximum(one[i] * one[j] - gram[i, j] ** 2, 1e-12 * one[i] * one[j])
                a = (one[j] * right[i] - gram[i, j] * right[j]) / det
                b = (one[i] * right[j] - gram[i, j] * right[i]) / det
                change = a + b
                C = a / np.where(change == 0, 1.0, change)
                cost = total - a * right[i] - b * right[j]
                inside = (
                    (C > 0) & (C < 1) if shape == "free" else (C > 1) & (C < LARGEST_C) & (tau[j] > TAUS_APART * tau[i])
                )
                cost = np.where(inside, cost, np.inf)
            best = _pick_apart(cost, np.log(tau[j]))[: 1 if shape == "one" else None]
            p = np.stack([change, np.log(tau[i]), np.log(tau[j] / tau[i]), C, np.full(len(i), delay)], axis=1)
            rows.append([(float(cost[m]), p[m]) for m in best if np.isfinite(cost[m])])
    found = {}
    for shape, rows in places.items():  # of those delays whose neighbours have none as good
        least = [min((cost for cost, _ in row), default=np.inf) for row in rows]
        lower = [row for k, row in enumerate(rows) if least[k] <= min(least[max(k - 1, 0) : k + 2])]
        found[shape] = [
            p for _, p in sorted((one for row in lower for one in row), key=lambda one: one[0])[:STARTS_KEPT]
        ]
    return found


def _pick_apart(cost: Array, slow: Array) -> list[int]:
    """The best place, and the best of those whose ln τ2 is far from it, on either side: a grid is coarse for τ1."""
    best = int(cost.argmin())
    far = [np.where(side * (slow - slow[best]) > FAR_START, cost, np.inf) for side in (1, -1)]
    return [best, *(int(one.argmin()) for one in far if np.isfinite(one.min(initial=np.inf)))]
