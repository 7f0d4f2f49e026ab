"""Where a fit begins: one search over (τ1, τ2) for every kind of fit, the outputs' sizes solved for.

φ = C s(τ1) + (1 − C) s(τ2), s = 1 − e^(−t/τ), is linear in s, so the products of s on a grid of time constants give
what the cost of each level falls by for every pair, (φ'ȳ)²/φ'φ (variable projection). Forms τ1(u), τ2(u) are then
tried by their values at as many inputs as they have coefficients, one after the other, on that table.
"""

import itertools
from collections.abc import Callable
from functools import partial

import numpy as np

from eaid.arrays import Array, median
from eaid.estimate.data import Data
from eaid.estimate.forms import Model
from eaid.estimate.points import Points, level_normal
from eaid.plant.dynamics import TAU_FLOOR_S
from eaid.plant.steps import rise

START_SHARES = (0.3, 0.5, 0.7, 0.85, 0.95)  # Where a free C starts from
TABLE_SIZE = 140  # Time constants of the table
LONGEST_RECORDS = 30.0  # The longest, in records
TRIED_VALUES = 5  # Values tried at each input
# Ends of the ranges of τ2, in records, each of which a search begins in
BANDS = (0.0, 0.1, 0.35, 1.0, 3.0, LONGEST_RECORDS)
REACH = (10.0, 4.0, 1.5)  # How far up and down from the value before, in each round
MOST_STARTS = 6  # Starts handed on
TOUCHED = 20  # Levels that τ2(u) is let touch τ1 at, at every second where there are as many
MOST_LEVELS = 30  # Levels that are looked at


def gain_at(grid: Array, table: Array, tau1: Array, tau2: Array) -> Array:
    """Gain at time constants of each level, (N, L) each, linear in ln τ between those of the grid of a `gain_table`."""
    step, both = np.log(grid[1] / grid[0]), np.maximum([tau1, tau2], 1e-300)
    place = np.clip(np.log(both / grid[0]) / step, 0.0, len(grid) - 1.001)
    below = place.astype(np.intp)
    (i, j), (p, q), levels = below, place - below, np.arange(tau1.shape[1])
    near, far = ((1 - q) * table[levels, k, j] + q * table[levels, k, j + 1] for k in (i, i + 1))
    return np.asarray((1 - p) * near + p * far)


def gain_table(points: Points, share: float) -> tuple[Array, Array]:
    """A grid of time constants [s], (K,), and what the cost of levels falls by at τ1 and τ2 on it, (L, K, K)."""
    times = np.where((points.w > 0) & (points.t_s > 0), points.t_s, np.nan)
    grid = np.geomspace(0.3 * np.nanmin(times), LONGEST_RECORDS * np.nanmax(times), TABLE_SIZE)
    s = rise(points.t_s[:, None], grid[:, None])
    s = points.about_mean(s) if points.centred else s
    weighed = s * points.w[:, None]
    gram = weighed @ s.transpose(0, 2, 1)
    squares = np.einsum("lkk->lk", gram)
    along = (weighed @ points.y[:, :, None])[:, :, 0]
    square = share**2 * squares[:, :, None] + (1 - share) ** 2 * squares[:, None] + 2 * share * (1 - share) * gram
    inner = np.maximum(share * along[:, :, None] + (1 - share) * along[:, None], 0.0)
    return grid, inner**2 / np.maximum(square, 1e-300)


def time_constants(
    gain: Callable[[Array, Array], Array],
    pairs: Array,
    grid: Array,
    sizes: tuple[int, int],
    longest_s: float,
    tried: int = TRIED_VALUES,
) -> list[tuple[Array, Array]]:
    """Values of τ1 and of τ2 that fit best, at as many inputs as their forms have coefficients; the best first.

    `gain` says how good N such pairs of values are, (N, p1) and (N, p2) → (N,), `pairs` how good constant ones of a
    grid are, (K, K). The search begins in each of the `BANDS` of τ2.
    """
    ends: dict[tuple[float, ...], tuple[float, Array, Array]] = {}

    def better(values: list[Array], k: int, reach: float) -> float:
        """The gain at the best values of τ1 (k = 0) or τ2 (k = 1) within a factor, which replace the ones before."""
        steps = itertools.product(np.geomspace(1 / reach, reach, tried), repeat=sizes[k])
        candidates = values[k] * np.array(list(steps))
        both = [np.broadcast_to(one, (len(candidates), len(one))) for one in values]
        both[k] = candidates
        gains = gain(*both)
        values[k] = candidates[int(gains.argmax())]
        return float(gains.max())

    def keep(values: list[Array], size: float) -> None:
        key = tuple(np.round(np.log(np.concatenate(values)), 1).tolist())
        ends.setdefault(key, (size, values[0], values[1]))

    for low, high in itertools.pairwise(BANDS):
        slow = (grid > low * longest_s) & (grid <= high * longest_s)
        where = (grid[:, None] < grid) & slow
        if not where.any():
            continue
        i, j = np.unravel_index(np.where(where, pairs, -np.inf).argmax(), pairs.shape)
        values = [np.full(sizes[0], grid[i]), np.full(sizes[1], grid[j])]
        keep(values.copy(), max(better(values, 0, reach) for reach in REACH))
        keep(values, max(better(values, k, reach) for reach in REACH for k in (1, 0)))
    return [(tau1, tau2) for _, tau1, tau2 in sorted(ends.values(), key=lambda row: -row[0])][:MOST_STARTS]


def form_starts(model: Model, data: Data, weight: Array) -> list[Array]:
    """Unknowns to start from, best first, T_s(u) by least squares; `weight` of each level. τ2 may meet τ1 between."""
    back = [np.linalg.inv(form.rows(form.inputs)) for form in (model.tau1, model.tau2) if form is not None]
    some = slice(None, None, 1 + (len(weight) - 1) // MOST_LEVELS)
    one, two = (model.tau1.rows(data.u[some]) @ inverse for inverse in back)
    starts = []
    for share in START_SHARES if model.share is None else (model.share,):
        grid, table = gain_table(data.points, share)
        tables = partial(gain_at, grid, table[some])

        def gain(first: Array, second: Array, at: Callable[[Array, Array], Array] = tables) -> Array:
            tau1, tau2 = first @ one.T, second @ two.T
            sound = (tau1 >= TAU_FLOOR_S).all(axis=1) & (tau2 >= tau1).all(axis=1)
            return np.where(sound, at(tau1, tau2) @ weight[some], -1.0)

        pairs, grid = np.tensordot(weight[some], table[some], 1), np.maximum(grid, TAU_FLOOR_S)
        for values in time_constants(gain, pairs, grid, (one.shape[1], two.shape[1]), data.longest_s):
            x = np.full(model.size, share)  # where C is free, the last is C
            for part, inverse, tau in zip(model.slices[1:], back, values, strict=True):
                x[part] = inverse @ tau
            starts.append(x)
    return starts if model.Ts is None else [*solve_torque(np.array(starts), model, data, weight)[0]]


def touching_starts(x: Array, model: Model, data: Data, weight: Array) -> list[Array]:
    """The best two unknowns with the τ1(u) of `x` and a τ2(u) that touches τ1 at one level and is steep beside it.

    A joint fit may end so where the slow part is missing from the records of all but one level.
    """
    form, part = model.tau2, model.slices[2]
    if form is None or form.size < 3:
        return []
    typical = max(median(model.rows(data.u)[1] @ x), TAU_FLOOR_S)
    half = 0.5 * (model.high - model.low)
    back, tops = np.linalg.inv(form.rows(form.inputs)), np.unique(data.u)[:: 1 + len(data.u) // TOUCHED]
    sizes = LONGEST_RECORDS * data.longest_s * np.array([0.1, 10.0, 1e3])
    tried = np.tile(x, (len(tops), len(sizes), 1))
    bends = ((form.inputs - tops[:, None]) / half) ** 2
    tried[:, :, part] = (3 * typical + sizes[:, None] * bends[:, None]) @ back.T
    found, cost = solve_torque(tried.reshape(-1, len(x)), model, data, weight)
    best = cost.reshape(tried.shape[:2]).argmin(axis=1) + len(sizes) * np.arange(len(tops))
    return [*found[best[np.argsort(cost[best])[:2]]]]


def solve_torque(x: Array, model: Model, data: Data, weight: Array) -> tuple[Array, Array]:
    """N unknowns with T_s(u) by least squares, (N, n), and the weighted costs, (N,)."""
    M, part, points, count = model.rows(data.u), model.slices[0], data.points, len(x)
    theta = np.stack([model.theta(row, M) for row in x], axis=1)
    theta[0] = 0.0
    t_s, y, w = (np.tile(values, (count, 1)) for values in (points.t_s, points.y, points.w))
    at = level_normal(theta.reshape(4, -1), Points(t_s, y, w, points.centred))  # of T_s = 0: the score is −Σ w φ y
    square = at.information[:, 0, 0].reshape(count, -1)
    along, cost = -at.score[:, 0].reshape(count, -1), at.cost.reshape(count, -1)
    rows, x = M[0, :, part], x.copy()
    for one, size, wanted in zip(x, square, along, strict=True):
        root = np.sqrt(np.maximum(weight * size, 1e-300))
        one[part] = np.linalg.lstsq(rows * root[:, None], root * wanted / np.maximum(size, 1e-300), rcond=None)[0]
    Ts = x @ M[0].T
    return x, (cost + Ts**2 * square - 2 * Ts * along) @ weight
