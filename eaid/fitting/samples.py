"""Sums of squared residuals and their gradient over every sample, to confirm what was found on compressed points.

On a uniform grid e^(−t/τ) is a geometric sequence: a stretch of it is tabulated and multiplied by what each stretch
begins with, so that the curve is one product of thin matrices.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from eaid.arrays import Array

TABLE = 128
"""Least length of the tabulated stretch of a geometric sequence."""
CHUNK = 1 << 15
"""Samples that are looked at together: what is made of them stays in the cache."""
LINE = 8
"""Numbers in a line of the cache: stretches are whole lines."""


@dataclass(frozen=True, eq=False)
class Record:
    """Every sample of one level: the full data that an end point is confirmed on."""

    t_s: Array
    y: Array
    uniform: bool


def full_sums(theta: Array, records: Sequence[Record], together: Array | None = None) -> tuple[Array, Array]:
    """Σ (f − y)² per level, (L,), and its gradient by θ, (4, L).

    `together` holds all outputs, (L, n), where the levels share one grid.
    """
    if together is not None:
        sums = _sums(theta, records[0], together)
    else:
        sums = np.concatenate([_sums(theta[:, i : i + 1], r, r.y[None]) for i, r in enumerate(records)])
    cost, along, by_e1, by_e2, t_e1, t_e2 = sums.T
    Ts, tau1, tau2, share = theta
    slopes = (along, -Ts * share / tau1**2 * t_e1, Ts * (share - 1.0) / tau2**2 * t_e2, Ts * (by_e2 - by_e1))
    return cost, 2.0 * np.stack(slopes)


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
    """The same on a uniform grid, `t` of shape (stretches, length), `y` of shape (L, stretches, length)."""
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
    """e^(−t/τ) at every sample, shape (n,)."""
    if not record.uniform or len(record.t_s) < 4 * TABLE:
        return np.exp(record.t_s / -tau)
    heads = np.exp(record.t_s[::TABLE] / -tau)
    stretch = np.exp((record.t_s[:TABLE] - record.t_s[0]) / -tau)
    return np.asarray(np.multiply.outer(heads, stretch).ravel()[: len(record.t_s)])
