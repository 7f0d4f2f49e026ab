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
CHUNK = 1 << 15
"""Samples that are looked at together: what is made of them stays in the cache."""
LINE = 8
"""Numbers in a line of the cache: stretches are whole lines."""


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


def level_costs(theta: Array, points: Points) -> Array:
    """Σ w (f − y)² alone, shape (…, L), for θ of shape (4, …, L)."""
    Ts, tau1, tau2, share = theta[..., None]
    e1, e2 = np.exp(points.t_s / -tau1), np.exp(points.t_s / -tau2)
    e1 -= e2
    e1 *= share
    e1 += e2
    residual = Ts - Ts * e1
    residual -= points.y
    residual *= points.root_w
    return np.asarray(np.einsum("...p,...p->...", residual, residual))


def _gradient(theta: Array, along: Array, by_e1: Array, by_e2: Array, t_e1: Array, t_e2: Array) -> Array:
    Ts, tau1, tau2, share = theta
    twice = Ts + Ts
    gradient = np.empty((4, len(Ts)), dtype=along.dtype)
    gradient[0] = along + along
    gradient[1] = t_e1 * (-twice * share / (tau1 * tau1))
    gradient[2] = t_e2 * (twice * (share - 1.0) / (tau2 * tau2))
    gradient[3] = twice * (by_e2 - by_e1)
    return gradient


def level_normal(theta: Array, points: Points) -> tuple[Array, Array, Array]:
    """Cost (L,), gradient by θ (4, L) and Gauss–Newton curvature 2 J'WJ (L, 4, 4), all of one product of slopes."""
    Ts, tau1, tau2, share = theta
    t, y = points.t_s, points.y
    decay = np.exp(t * (-1.0 / theta[1:3])[:, :, None])
    slopes = np.empty((len(Ts), 5, y.shape[1]))  # by T_s, τ1, τ2, C, the middle ones yet to be scaled; the residual
    slopes[:, 0] = 1.0 - share[:, None] * decay[0] - (1.0 - share)[:, None] * decay[1]
    np.multiply(t, decay[0], out=slopes[:, 1])
    np.multiply(t, decay[1], out=slopes[:, 2])
    np.subtract(decay[1], decay[0], out=slopes[:, 3])
    np.subtract(Ts[:, None] * slopes[:, 0], y, out=slopes[:, 4])
    product = (slopes * points.w[:, None, :]) @ slopes.transpose(0, 2, 1)
    scale = np.empty((len(Ts), 4))
    scale[:, 0] = 1.0
    scale[:, 1] = -Ts * share / (tau1 * tau1)
    scale[:, 2] = Ts * (share - 1.0) / (tau2 * tau2)
    scale[:, 3] = Ts
    scaled = scale + scale
    return (
        product[:, 4, 4],
        (product[:, 4, :4] * scaled).T,
        product[:, :4, :4] * (scaled[:, :, None] * scale[:, None, :]),
    )


def log_products(theta: Array, shares: Array, points: Points) -> Array:
    """Σ w s s' per level, (L, 4, 4), with s = ∂f/∂T_s, then ∂f/∂ln τ1 and ∂f/∂ln τ2 over T_s, and f − y.

    `shares` are what `weighted_shares` gives. With ln τ the fewest operations are needed.
    """
    s, _ = _log_slopes(theta, shares, points)
    s = s.transpose(1, 0, 2)
    return s @ s.transpose(0, 2, 1)


def by_tau(theta: Array, products: Array) -> tuple[Array, Array, Array]:
    """What `log_products` gave as `level_normal` does, by (T_s, τ1, τ2) alone: (L,), (3, L), (L, 3, 3)."""
    scale = np.ones((len(products), 3))
    scale[:, 1:] = (theta[0] / theta[1:3]).T
    scaled = scale + scale
    curvature = products[:, :3, :3] * (scaled[:, :, None] * scale[:, None, :])
    return products[:, 3, 3], (products[:, 3, :3] * scaled).T, curvature


def weighted_shares(share: Array, points: Points) -> Array:
    """√w C and √w (1 − C) at the points, (2, L, P), from C of each level, (L,), or of all, (1,)."""
    return np.asarray(np.stack([share, 1.0 - share])[:, :, None] * points.root_w)


def log_curvature(theta: Array, shares: Array, points: Points) -> tuple[Array, Array]:
    """Half the gradient, (L, 3), and half the second derivatives, (L, 3, 3), of the cost.

    They are by T_s, and by ln τ1 and ln τ2 over T_s; `shares` as in `log_products`.
    """
    s, x = _log_slopes(theta, shares, points)
    bent = np.einsum("klp,lp->kl", x * s[1:3], s[3])
    s = s.transpose(1, 0, 2)
    P = s @ s[:, :3].transpose(0, 2, 1)
    H, slope = P[:, :3], P[:, 3]
    own = slope[:, 1:] / theta[0, :, None]
    H[:, 0, 1:] += own
    H[:, 1:, 0] += own
    own += bent.T / theta[0, :, None]
    H[:, 1, 1] -= own[:, 0]
    H[:, 2, 2] -= own[:, 1]
    return slope, H


def _log_slopes(theta: Array, shares: Array, points: Points) -> tuple[Array, Array]:
    """√w s of `log_products`, (4, L, P), and −t/τ1, −t/τ2, (2, L, P)."""
    x = points.t_s * (-1.0 / theta[1:3])[:, :, None]
    decay = np.exp(x)
    decay *= shares
    s = np.empty((4, *points.y.shape))
    np.subtract(points.root_w, decay[0], out=s[0])
    s[0] -= decay[1]
    np.multiply(x, decay, out=s[1:3])
    np.multiply(theta[0, :, None], s[0], out=s[3])
    s[3] -= points.root_y
    return s, x


def level_curvature(theta: Array, points: Points) -> Array:
    """Second derivatives of `level_sums` by θ, (L, 4, 4), the residuals' own part included."""
    curvature = level_normal(theta, points)[2]
    Ts, tau1, tau2, share = theta
    t = points.t_s
    e1, e2 = np.exp(t / -tau1[:, None]), np.exp(t / -tau2[:, None])
    shape = 1.0 - share[:, None] * e1 - (1.0 - share[:, None]) * e2
    twice = 2.0 * points.w * (Ts[:, None] * shape - points.y)
    if len(t) == 1:
        powers = np.stack([np.ones_like(t[0]), t[0], t[0] * t[0]], axis=1)
        by1, by2 = (twice * e1) @ powers, (twice * e2) @ powers  # Σ 2 w r t^k e, (L, 3)
    else:
        powers = np.stack([np.ones_like(t), t, t * t], axis=2)
        by1, by2 = (((twice * e)[:, None] @ powers)[:, 0] for e in (e1, e2))
    own = np.zeros_like(curvature)
    own[:, 0, 1] = by1[:, 1] * -share / tau1**2
    own[:, 0, 2] = by2[:, 1] * (share - 1.0) / tau2**2
    own[:, 0, 3] = by2[:, 0] - by1[:, 0]
    own[:, 1, 3] = by1[:, 1] * -Ts / tau1**2
    own[:, 2, 3] = by2[:, 1] * Ts / tau2**2
    own += own.transpose(0, 2, 1)
    own[:, 1, 1] = Ts * share * (2.0 * by1[:, 1] - by1[:, 2] / tau1) / tau1**3
    own[:, 2, 2] = Ts * (1.0 - share) * (2.0 * by2[:, 1] - by2[:, 2] / tau2) / tau2**3
    return np.asarray(curvature + own)


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
    Ts, _, _, share = theta
    start, local = t[:, 0], t[0] - t[0, 0]
    table, heads = _decays(theta, local), _decays(theta, start)  # e^(−t/τ) = heads · table, t = start + local
    amplitudes = np.stack([Ts, -Ts * share, Ts * (share - 1.0)], axis=1)
    curves = (heads[:, :3] * amplitudes[:, :, None]).transpose(0, 2, 1)
    rows = min(len(start), max(CHUNK // len(local), 1))
    cost, inner, buffer = np.zeros(len(y)), np.zeros((len(y), 5, len(local))), _lined(rows, len(local))
    for i, (curve, shapes, data) in enumerate(zip(curves, table[:, :3], y, strict=True)):
        for first in range(0, len(start), rows):
            part = slice(first, first + rows)
            r = buffer[: len(data[part])]  # stays in the cache
            np.matmul(curve[part], shapes, out=r)
            np.subtract(r, data[part], out=r)
            inner[i] += heads[i, :, part] @ r
            flat = r.ravel()
            cost[i] += flat @ flat
    s = inner @ table.transpose(0, 2, 1)  # (L, 5, 5): sums over samples of r · head · table
    by_e1, by_e2 = s[:, 1, 1], s[:, 2, 2]
    along = s[:, 0, 0] - share * by_e1 - (1.0 - share) * by_e2
    return np.stack([cost, along, by_e1, by_e2, s[:, 1, 3] + s[:, 3, 1], s[:, 2, 4] + s[:, 4, 2]], axis=1)


def _decays(theta: Array, t: Array) -> Array:
    """1, e1, e2, t e1, t e2 at some times, shape (L, 5, len(t))."""
    found = np.empty((theta.shape[1], 5, len(t)))
    found[:, 0] = 1.0
    np.exp(t * (-1.0 / theta[1:3].T)[:, :, None], out=found[:, 1:3])
    np.multiply(found[:, 1:3], t, out=found[:, 3:])
    return found


@lru_cache(maxsize=64)
def stretch(n: int) -> int:
    """Length of a tabulated stretch for n samples, 128 to 248, that leaves fewest over; 0 for short records."""
    if n < 4 * TABLE:
        return 0
    return min(range(TABLE, 2 * TABLE, LINE), key=lambda length: (n % length, length))


def _lined(rows: int, columns: int) -> Array:
    """An array that begins with a line of the cache: vector instructions on others take a third longer."""
    raw = np.empty(rows * columns + LINE)
    first = -raw.ctypes.data % (8 * LINE) // 8
    return raw[first : first + rows * columns].reshape(rows, columns)


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
