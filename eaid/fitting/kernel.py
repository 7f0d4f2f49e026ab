"""Sums over samples of the friction curve, Eq. (3), for all levels at once: cost, gradient, curvature.

Every fit of the curve needs, per level, only the sum of squared residuals and its derivatives by θ = (T_s, τ1, τ2, C);
the chain rule carries them to whatever unknowns a fit has. θ has shape (4, L).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from eaid.arrays import Array
from eaid.fitting.compress import Points

TABLE = 128
"""Least length of the tabulated stretch of a geometric sequence."""


def level_sums(theta: Array, points: Points) -> tuple[Array, Array]:
    """Σ w (f − y)² per level, shape (L,), and its gradient by θ, shape (4, L)."""
    Ts, tau1, tau2, share = theta[:, :, None]
    e1, e2 = np.exp(points.t_s / -tau1), np.exp(points.t_s / -tau2)
    shape = 1.0 - share * e1 - (1.0 - share) * e2
    residual = Ts * shape - points.y
    weighted = points.w * residual
    cost = np.einsum("lp,lp->l", weighted, residual)
    e1 *= weighted
    e2 *= weighted
    if len(points.t_s) == 1:
        (by_e1, t_e1), (by_e2, t_e2) = (e1 @ points.moments).T, (e2 @ points.moments).T
    else:
        by_e1, by_e2 = e1.sum(axis=1), e2.sum(axis=1)
        t_e1, t_e2 = np.einsum("lp,lp->l", e1, points.t_s), np.einsum("lp,lp->l", e2, points.t_s)
    along = np.einsum("lp,lp->l", weighted, shape)
    return cost, _gradient(theta, along, by_e1, by_e2, t_e1, t_e2)


def _gradient(theta: Array, along: Array, by_e1: Array, by_e2: Array, t_e1: Array, t_e2: Array) -> Array:
    Ts, tau1, tau2, share = theta
    twice = Ts + Ts
    gradient = np.empty((4, len(Ts)), dtype=along.dtype)
    gradient[0] = along + along
    gradient[1] = t_e1 * (-twice * share / (tau1 * tau1))
    gradient[2] = t_e2 * (twice * (share - 1.0) / (tau2 * tau2))
    gradient[3] = twice * (by_e2 - by_e1)
    return gradient


def level_curvature(theta: Array, points: Points, exact: bool = False) -> Array:
    """Second derivatives of `level_sums` by θ, (L, 4, 4): Gauss–Newton 2 J'WJ, or with the residuals' own part."""
    Ts, tau1, tau2, share = theta[:, :, None]
    t = points.t_s
    e1, e2 = np.exp(t / -tau1), np.exp(t / -tau2)
    slopes = np.empty((len(e1), 4, e1.shape[1]), dtype=theta.dtype)
    slopes[:, 0] = shape = 1.0 - share * e1 - (1.0 - share) * e2
    np.multiply(t * e1, -Ts * share / tau1**2, out=slopes[:, 1])
    np.multiply(t * e2, -Ts * (1.0 - share) / tau2**2, out=slopes[:, 2])
    np.multiply(Ts, e2 - e1, out=slopes[:, 3])
    curvature = (slopes * points.w[:, None, :]) @ np.swapaxes(slopes, 1, 2)
    if exact:
        r = points.w * (Ts * shape - points.y)
        own = np.zeros_like(curvature)
        own[:, 0, 1] = (r * -share * t * e1 / tau1**2).sum(axis=1)
        own[:, 0, 2] = (r * -(1.0 - share) * t * e2 / tau2**2).sum(axis=1)
        own[:, 0, 3] = (r * (e2 - e1)).sum(axis=1)
        own[:, 1, 3] = (r * -Ts * t * e1 / tau1**2).sum(axis=1)
        own[:, 2, 3] = (r * Ts * t * e2 / tau2**2).sum(axis=1)
        own += np.swapaxes(own, 1, 2)
        own[:, 1, 1] = (r * -Ts * share * e1 * (t / tau1 - 2.0) * t / tau1**3).sum(axis=1)
        own[:, 2, 2] = (r * -Ts * (1.0 - share) * e2 * (t / tau2 - 2.0) * t / tau2**3).sum(axis=1)
        curvature = curvature + own
    return np.asarray(2.0 * curvature)


@dataclass(frozen=True, eq=False)
class Record:
    """Every sample of one level: the full data that an end point is confirmed on."""

    t_s: Array
    y: Array
    uniform: bool


def full_sums(theta: Array, records: Sequence[Record], together: Array | None = None) -> tuple[Array, Array]:
    """As `level_sums`, over every sample; `together` holds all outputs, (L, n), where the levels share one grid."""
    if together is not None:
        sums = _sums(theta, records[0], together)
    else:
        sums = np.concatenate([_sums(theta[:, i : i + 1], r, r.y[None]) for i, r in enumerate(records)])
    return sums[:, 0], _gradient(theta, *sums[:, 1:].T)


def _sums(theta: Array, record: Record, y: Array) -> Array:
    """Per level: cost, Σ r φ, Σ r e1, Σ r e2, Σ r t e1, Σ r t e2 with r = f − y and φ = f/T_s; shape (L, 6)."""
    n = len(record.t_s)
    length = stretch(n) if record.uniform else 0
    whole = n // length * length if length else 0
    sums = np.zeros((len(y), 6))
    if whole:
        sums += _stretched(theta, record.t_s[:whole].reshape(-1, length), y[:, :whole].reshape(len(y), -1, length))
    if whole < n:
        sums += _plain(theta, record.t_s[whole:], y[:, whole:])
    return sums


def residuals(theta: Array, records: Sequence[Record]) -> list[Array]:
    """f − y at every sample of each level, shapes (n_l,)."""
    found = []
    for (Ts, tau1, tau2, share), record in zip(theta.T, records, strict=True):
        r = (-Ts * share) * decay(record, tau1)
        r -= (Ts * (1.0 - share)) * decay(record, tau2)
        r += Ts
        r -= record.y
        found.append(r)
    return found


def _plain(theta: Array, t: Array, y: Array) -> Array:
    Ts, tau1, tau2, share = theta[:, :, None]
    e1, e2 = np.exp(t / -tau1), np.exp(t / -tau2)
    shape = 1.0 - share * e1 - (1.0 - share) * e2
    r = Ts * shape - y
    rt = r * t
    pairs = ((r, r), (r, shape), (r, e1), (r, e2), (rt, e1), (rt, e2))
    return np.stack([np.einsum("ln,ln->l", a, b) for a, b in pairs], axis=1)


def _stretched(theta: Array, t: Array, y: Array) -> Array:
    """The same on a uniform grid, `t` of shape (stretches, length), `y` of shape (L, stretches, length).

    e^(−t/τ) is a geometric sequence: the first stretch is tabulated and multiplied by what each stretch starts with, so
    that the curve is one product of thin matrices.
    """
    Ts, tau1, tau2, share = theta[:, :, None]
    start, local = t[:, 0], t[0] - t[0, 0]
    table = np.ones((theta.shape[1], 5, len(local)))  # 1, e1, e2, t' e1, t' e2
    np.exp(local / -tau1, out=table[:, 1])
    np.exp(local / -tau2, out=table[:, 2])
    np.multiply(table[:, 1:3], local, out=table[:, 3:])
    head1, head2 = np.exp(start / -tau1), np.exp(start / -tau2)
    heads = np.stack([np.broadcast_to(Ts, head1.shape), -Ts * share * head1, -Ts * (1.0 - share) * head2], axis=2)
    levels = len(y)
    cost, inner, r = np.empty(levels), np.empty((levels, len(start), 5)), np.empty(y.shape[1:])
    for i in range(levels):  # one buffer that stays in the cache
        np.matmul(heads[i], table[i, :3], out=r)
        np.subtract(r, y[i], out=r)
        np.matmul(r, table[i].T, out=inner[i])
        cost[i] = r.ravel() @ r.ravel()
    by_e1, by_e2 = (head1 * inner[:, :, 1]).sum(axis=1), (head2 * inner[:, :, 2]).sum(axis=1)
    t_e1 = (head1 * (inner[:, :, 3] + start * inner[:, :, 1])).sum(axis=1)
    t_e2 = (head2 * (inner[:, :, 4] + start * inner[:, :, 2])).sum(axis=1)
    along = inner[:, :, 0].sum(axis=1) - share[:, 0] * by_e1 - (1.0 - share[:, 0]) * by_e2
    return np.stack([cost, along, by_e1, by_e2, t_e1, t_e2], axis=1)


@lru_cache(maxsize=64)
def stretch(n: int) -> int:
    """Length of a tabulated stretch for n samples, 128 to 255, that leaves fewest over; 0 for short records."""
    if n < 4 * TABLE:
        return 0
    return min(range(TABLE, 2 * TABLE), key=lambda length: (n % length, length))


def decay(record: Record, tau: float) -> Array:
    """e^(−t/τ) at every sample, shape (n,).

    On a uniform grid it is a geometric sequence: one stretch of 128 is tabulated and multiplied by the first value of
    every stretch.
    """
    if not record.uniform or len(record.t_s) < 4 * TABLE:
        return np.exp(record.t_s / -tau)
    heads = np.exp(record.t_s[::TABLE] / -tau)
    stretch = np.exp((record.t_s[:TABLE] - record.t_s[0]) / -tau)
    return np.asarray(np.multiply.outer(heads, stretch).ravel()[: len(record.t_s)])
