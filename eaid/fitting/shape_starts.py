"""Where the fits of a step's shape begin: the best places on a grid of time constants, of a record made shorter."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from eaid.arrays import Array
from eaid.fitting.shape_curves import APART, MOST, Shape

FEW = 800
"""Points to which a record is averaged for the choice of a shape; the chosen one is fitted to all samples."""
GRID = 28
STARTS = 3
DELAYS = 20
LOOKED_AT = 300_000
"""Half of the values of the curve that are worked out to find a dead time, at most."""
FAR = 1.0
"""Distance in ln τ2 from which a start is another."""


@dataclass(frozen=True, eq=False)
class AveragedRecord:
    """A record averaged to fewer points: finely at first, then coarser."""

    time_s: Array
    output: Array
    weight: Array
    within: float = 0.0
    """Sum of squares of the samples about the means that stand for them: no shape takes it away."""


def averaged(time_s: Array, y: Array) -> AveragedRecord:
    """A record as at most FEW means and what they leave out."""
    count = len(y)
    if count <= FEW:
        return AveragedRecord(time_s, y, np.ones(count))
    edges = np.unique(np.round(np.geomspace(1, count, FEW)).astype(np.intp)) - 1
    fine = np.linspace(0, count, FEW // 2).astype(np.intp)
    edges = np.unique(np.concatenate((edges, fine[:-1], [0])))
    edges = edges[edges < count]
    weight = np.diff(np.append(edges, count)).astype(np.float64)
    means = np.add.reduceat(y, edges) / weight
    within = max(0.0, float(y @ y - weight @ means**2))
    return AveragedRecord(np.add.reduceat(time_s, edges) / weight, means, weight, within)


def delays_of(points: AveragedRecord, window: float) -> list[float]:
    """Dead times to start from: shares of the time to half of the change."""
    half = np.flatnonzero(np.abs(points.output) >= 0.5 * np.abs(points.output[-1]))
    until = float(points.time_s[half[0]]) if len(half) else window / 4
    return [until * (k + 0.5) / DELAYS for k in range(DELAYS)]


def best_delay(points: AveragedRecord, p: Array) -> float:
    """The middle between the two samples between which a dead time leaves least, the time constants and C as in `p`.

    Of a long record those near the dead time of `p` are looked at.
    """
    middle = 0.5 * (points.time_s[1:] + points.time_s[:-1])
    middle = middle[middle < 0.9 * points.time_s[-1]]
    at, reach = int(np.searchsorted(middle, p[4])), max(2, LOOKED_AT // len(points.time_s))
    middle = middle[max(at - reach, 0) : at + reach]
    after = np.maximum(points.time_s - middle[:, np.newaxis], 0.0)
    shape = 1 - p[3] * np.exp(-after / np.exp(p[1])) - (1 - p[3]) * np.exp(-after / np.exp(p[1] + p[2]))
    along, square = shape @ (points.weight * points.output), (shape**2) @ points.weight
    return float(middle[np.argmax(along**2 / np.maximum(square, 1e-300))])


def starts_of(
    points: AveragedRecord, window: float, delays: Sequence[float], share: float, wanted: Sequence[Shape]
) -> dict[Shape, list[Array]]:
    """The best places on a grid of time constants and dead times, for each shape; amplitudes are linear there."""
    stride = max(1, len(points.time_s) // 300)
    t, y, w = points.time_s[::stride], points.output[::stride], points.weight[::stride]
    shortest = max(window / 3000, float(np.diff(points.time_s[: max(2, len(t))]).min()) / 3)
    tau = np.geomspace(shortest, 5 * window, GRID)
    i, j = np.triu_indices(GRID, 1)
    total = float(w @ y**2)
    places: dict[Shape, list[list[tuple[float, Array]]]] = {shape: [] for shape in wanted}
    for delay in delays:
        for rows in places.values():
            rows.append([])
        rises = -np.expm1(-np.maximum(t - delay, 0.0) / tau[:, np.newaxis])
        gram, right = (rises * w) @ rises.T, rises @ (w * y)
        one = np.diag(gram)
        for shape in wanted:
            if shape == "one":
                ok = one > 0
                change = np.where(ok, right / np.where(ok, one, 1.0), 0.0)
                cost = total - change * right
                k = cost.argsort()[:1]
                places[shape][-1] += [
                    (float(cost[m]), np.array([change[m], np.log(tau[m]), 1.0, 1.0, delay])) for m in k
                ]
                continue
            if shape == "two":
                size = share**2 * one[i] + 2 * share * (1 - share) * gram[i, j] + (1 - share) ** 2 * one[j]
                along = share * right[i] + (1 - share) * right[j]
                change = along / np.maximum(size, 1e-300)
                cost, C = total - change * along, np.full(len(i), share)
            else:
                det = np.maximum(one[i] * one[j] - gram[i, j] ** 2, 1e-12 * one[i] * one[j])
                a = (one[j] * right[i] - gram[i, j] * right[j]) / det
                b = (one[i] * right[j] - gram[i, j] * right[i]) / det
                change = a + b
                C = a / np.where(change == 0, 1.0, change)
                cost = total - a * right[i] - b * right[j]
                inside = (C > 0) & (C < 1) if shape == "free" else (C > 1) & (C < MOST) & (tau[j] > APART * tau[i])
                cost = np.where(inside, cost, np.inf)
            for m in _apart(cost, np.log(tau[j])):
                if np.isfinite(cost[m]):
                    start = np.array([change[m], np.log(tau[i[m]]), np.log(tau[j[m]] / tau[i[m]]), C[m], delay])
                    places[shape][-1].append((float(cost[m]), start))
    return {shape: _best(rows) for shape, rows in places.items()}


def _best(rows: Sequence[Sequence[tuple[float, Array]]]) -> list[Array]:
    """The best of the places of those delays whose neighbours have none as good; `rows` holds those of each delay."""
    least = [min((cost for cost, _ in row), default=np.inf) for row in rows]
    lower = [row for k, row in enumerate(rows) if least[k] <= min(least[max(k - 1, 0) : k + 2])]
    return [p for _, p in sorted((one for row in lower for one in row), key=lambda one: one[0])[:STARTS]]


def _apart(cost: Array, slow: Array) -> list[int]:
    """The best place, and the best of those whose ln τ2 is far from it, on either side: a grid is coarse for τ1."""
    best = int(cost.argmin())
    far = [np.where(side * (slow - slow[best]) > FAR, cost, np.inf) for side in (1, -1)]
    return [best, *(int(one.argmin()) for one in far if np.isfinite(one.min(initial=np.inf)))]
