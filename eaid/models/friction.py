"""The friction curve of one level, Eq. (3): two exponentials that share one steady torque.

T(t) = (C (1 − e^(−t/τ1)) + (1 − C)(1 − e^(−t/τ2))) T_s
"""

from collections.abc import Sequence

import numpy as np

from eaid.arrays import Array
from eaid.models.parameters import SHARE, Friction


def step_response(p: Friction, t_s: Array) -> Array:
    """Torque after a step from rest [N·m], Eq. (3), shape of `t_s`."""
    # expm1 keeps precision when t << tau, where 1 - exp(-x) cancels.
    return -(p.C * np.expm1(-t_s / p.tau1) + (1 - p.C) * np.expm1(-t_s / p.tau2)) * p.Ts


def gradient(p: Friction, t_s: Array) -> Array:
    """Derivatives of the torque by T_s, τ1, τ2 and C, shape (4, n), Eq. (3)."""
    e1, e2 = np.exp(-t_s / p.tau1), np.exp(-t_s / p.tau2)
    return np.stack(
        [
            -(p.C * np.expm1(-t_s / p.tau1) + (1 - p.C) * np.expm1(-t_s / p.tau2)),
            -p.Ts * p.C * e1 * t_s / p.tau1**2,
            -p.Ts * (1 - p.C) * e2 * t_s / p.tau2**2,
            p.Ts * (e2 - e1),
        ]
    )


def guess(t_s: Array, torque_nm: Array, share: float = SHARE, tried: int = 48) -> Friction:
    """First guess from data [N·m, s]: the best pair of time constants on a log grid, T_s ≥ 0 by a linear solve.

    `t_s` and `torque_nm` have shape (n,), at least three samples after t = 0.
    """
    grid = tau_grid(t_s, tried)
    tau1, tau2, steady = grid_minima(t_s[None], torque_nm[None], np.ones((1, len(t_s))), grid, share)
    return Friction(float(steady[0, 0]), float(tau1[0, 0]), float(tau2[0, 0]), share)


def tau_grid(t_s: Array, n: int) -> Array:
    """Time constants to try [s], on a log grid from half a sample to three times the record, shape (n,)."""
    positive = t_s[t_s > 0]
    return np.geomspace(0.5 * float(positive.min()), 3.0 * float(positive.max()), n)


def grid_minima(
    t_s: Array,
    torque_nm: Array,
    weights: Array,
    grid: Array,
    share: float,
    bands: Sequence[tuple[int, int]] = ((0, 1_000),),
    offset: bool = False,
) -> tuple[Array, Array, Array]:
    """τ1 ≤ τ2 of least cost on a grid, and their T_s ≥ 0, for L levels at once: three arrays of shape (bands, L).

    A band (a, b) looks at pairs at least a and less than b grid steps apart. `t_s`, `torque_nm`, `weights`: (L, n), or
    (1, n) times for all; padding has weight 0. With `offset` a constant is free as well.
    """
    inner, square = grid_fits(t_s, torque_nm, weights, grid, share, offset)
    gain = inner**2 / square
    count = len(grid)
    apart = np.arange(count) - np.arange(count)[:, None]
    every = np.arange(len(inner))
    square = np.broadcast_to(square, inner.shape)
    found = []
    for a, b in bands:
        best = np.where((apart >= a) & (apart < b), gain, -1.0).reshape(len(inner), -1).argmax(axis=1)
        first, second = np.divmod(best, count)
        found.append((grid[first], grid[second], inner[every, first, second] / square[every, first, second]))
    tau1, tau2, steady = zip(*found, strict=True)
    return np.stack(tau1), np.stack(tau2), np.stack(steady)


def grid_fits(
    t_s: Array, torque_nm: Array, weights: Array, grid: Array, share: float, offset: bool = False
) -> tuple[Array, Array]:
    """φ'y ≥ 0, (L, K, K), and φ'φ, (L or 1, K, K), for τ1 = grid[i] and τ2 = grid[j]; shapes as in `grid_minima`.

    T_s = φ'y/φ'φ is the best amplitude, and the cost falls by (φ'y)²/φ'φ.
    """
    weighted, square = grid_table(t_s, weights, grid, share, offset)
    return grid_inner(grid_along(torque_nm, weighted), share), square


def grid_table(t_s: Array, weights: Array, grid: Array, share: float, offset: bool = False) -> tuple[Array, Array]:
    """What pairs of time constants need of the times alone: weighted 1 − e^(−t/τ), (L or 1, K, n), and φ'φ, (…, K, K).

    All pairs follow from the products of the single ones. With `offset` those are orthogonal to a constant.
    """
    shapes = -np.expm1(-t_s[:, None, :] / grid[:, None])
    if offset:
        whole = weights.sum(axis=1)
        shapes = shapes - ((shapes * weights[:, None, :]).sum(axis=2) / whole[:, None])[:, :, None]
    weighted = shapes * weights[:, None, :]
    gram = weighted @ np.swapaxes(shapes, 1, 2)
    c, d = share, 1 - share
    own = np.diagonal(gram, axis1=1, axis2=2)
    return weighted, (c * c * own)[:, :, None] + (d * d * own)[:, None, :] + (2 * c * d) * gram


def grid_along(torque_nm: Array, weighted: Array) -> Array:
    """Products of the data with the weighted shapes of `grid_table`, (L, K)."""
    if len(weighted) == 1:
        return np.asarray(torque_nm @ weighted[0].T)
    return np.asarray((weighted @ torque_nm[:, :, None])[:, :, 0])


def grid_inner(along: Array, share: float) -> Array:
    """φ'y of every pair, 0 where it is negative, (L, K, K)."""
    inner = (share * along)[:, :, None] + ((1 - share) * along)[:, None, :]
    return np.maximum(inner, 0.0, out=inner)
