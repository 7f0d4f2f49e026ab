"""The friction curve of one level, Eq. (3): two exponentials that share one steady torque.

T(t) = (C (1 − e^(−t/τ1)) + (1 − C)(1 − e^(−t/τ2))) T_s
"""

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


def guess(t_s: Array, torque_nm: Array, share: float = SHARE, fast: int = 24, slow: int = 24) -> Friction:
    """First guess from data [N·m, s]: the best pair of time constants on a log grid, T_s ≥ 0 by a linear solve.

    `t_s` and `torque_nm` have shape (n,), at least three samples after t = 0.
    """
    return guess_weighted(t_s, torque_nm, np.ones_like(t_s), share, fast, slow)


def guess_weighted(
    t_s: Array, torque_nm: Array, weights: Array, share: float = SHARE, fast: int = 24, slow: int = 24
) -> Friction:
    """`guess` for weighted samples; a weight counts as that many samples, shape (n,)."""
    grid = tau_grid(t_s, fast + slow)
    tau1, tau2, steady = grid_minima(t_s[None], torque_nm[None], weights[None], grid, share)
    return Friction(float(steady[0]), float(tau1[0]), float(tau2[0]), share)


def tau_grid(t_s: Array, n: int) -> Array:
    """Time constants to try [s], on a log grid from half a sample to three times the record, shape (n,)."""
    positive = t_s[t_s > 0]
    return np.geomspace(0.5 * float(positive.min()), 3.0 * float(positive.max()), n)


def grid_minima(
    t_s: Array, torque_nm: Array, weights: Array, grid: Array, share: float, apart: int = 0
) -> tuple[Array, Array, Array]:
    """τ1 ≤ τ2 of least cost on a grid, and their T_s ≥ 0, for L levels at once: three arrays of shape (L,).

    The two are at least `apart` grid steps apart.

    `t_s`, `torque_nm`, `weights`: (L, n), or (1, n) times for all; padding has weight 0. For a pair of τ the amplitude
    is a linear solve, T_s = φ'y/φ'φ, and the cost falls by (φ'y)²/φ'φ; all pairs follow from the products of e^(−t/τ).
    """
    levels = len(torque_nm)
    shapes = -np.expm1(-t_s[:, None, :] / grid[:, None])  # (L or 1, K, n)
    weighted = shapes * weights[:, None, :]
    gram = weighted @ np.swapaxes(shapes, 1, 2)  # (L or 1, K, K)
    along = (weighted @ torque_nm[:, :, None])[:, :, 0]  # (L, K)
    own = np.diagonal(gram, axis1=1, axis2=2)
    c, d = share, 1 - share
    square = c * c * own[:, :, None] + d * d * own[:, None, :] + 2 * c * d * gram
    inner = c * along[:, :, None] + d * along[:, None, :]
    gain = np.where(np.triu(np.ones(gram.shape[1:], dtype=bool), apart), np.maximum(inner, 0) ** 2 / square, -1.0)
    best = gain.reshape(levels, -1).argmax(axis=1)
    first, second = np.unravel_index(best, gain.shape[1:])
    every = np.arange(levels)
    square = np.broadcast_to(square, inner.shape)
    steady = np.maximum(inner[every, first, second], 0) / square[every, first, second]
    return grid[first], grid[second], steady
