"""Response of the two-state model to any input, and its derivatives by every unknown, in one pass over the samples.

    x1 ← x1 + (1 − e^(−dt/τ1)) (C T_s − x1),   x2 ← x2 + (1 − e^(−dt/τ2)) ((1 − C) T_s − x2),   T = idle + x1 + x2

exact while the input is held (Eqs. (4)–(7)). The derivatives obey the same recursions (sensitivity equations):

    ∂x1/∂p ← e^(−dt/τ1) ∂x1/∂p + (1 − e^(−dt/τ1)) C ∂T_s/∂p + (x1 − C T_s) dt/τ1² e^(−dt/τ1) ∂τ1/∂p

Columns, in this order: coefficients of T_s, τ1, τ2; C; τ1 and τ2 of a fall to rest; factors on τ1 and τ2 of a fall
between levels; relative excess of T_s after a fall of the input; idle output; x1 and x2 at the first row; and last the
residual. `reference` holds the same in plain Python, without derivatives.
"""

import numba
import numpy as np

from eaid.arrays import Array

CHUNK = 256
"""Rows that are multiplied together."""


@numba.njit(cache=True, nogil=True, error_model="numpy")
def rows(
    first: int, last: int, dt: Array, index: Array, rising: Array, y: Array, w: Array,
    steady: Array, tau1: Array, tau2: Array, rest: Array, by_steady: Array, by_tau1: Array, by_tau2: Array,
    scalars: Array, place: Array, state: Array, sens: Array, out: Array,
) -> int:  # fmt: skip
    """Advance from row `first` to `last`, write one row of `out` for each sample that counts, and return how many.

    `scalars`: C, τ1 and τ2 of a fall to rest (0: none), factors of a fall between levels, excess of T_s, idle, last dt.
    `place`: column of C, rest 1, rest 2, fall 1, fall 2, excess, idle, start 1, start 2; −1 where it is no unknown.
    `state`: x1, x2; `sens`: rows 0 and 1, derivatives of x1 and x2 by every column. Both are carried on.
    """
    share, rest1, rest2, fall1, fall2, excess, idle = scalars[:7]
    n_s, n_1, n_2 = by_steady.shape[1], by_tau1.shape[1], by_tau2.shape[1]
    p = sens.shape[1]
    x1, x2 = state[0], state[1]
    before, before_dt = -1, -1.0
    g1 = g2 = e1 = e2 = slope1 = slope2 = target1 = target2 = 0.0
    down1 = down2 = before_down1 = before_down2 = False
    written = 0
    for k in range(first, last):
        if w[k] > 0.0:
            root = np.sqrt(w[k])
            for j in range(p):
                out[written, j] = root * (sens[0, j] + sens[1, j])
            if place[6] >= 0:
                out[written, place[6]] = root
            out[written, p] = root * (x1 + x2 + idle - y[k])
            written += 1
        i, step = index[k], dt[k]
        if step <= 0.0:
            continue
        up = rising[k]
        total = steady[i] * (1.0 + excess) if up < 0 else steady[i]
        target1 = share * total
        target2 = total - target1
        down1, down2 = target1 < x1, target2 < x2
        if i != before or step != before_dt or down1 != before_down1 or down2 != before_down2:
            t1, t2 = tau1[i], tau2[i]
            if down1:
                if rest[i] < 1.0:
                    if rest1 > 0.0:
                        t1 = rest[i] * t1 + (1.0 - rest[i]) * rest1
                else:
                    t1 *= fall1
            if down2:
                if rest[i] < 1.0:
                    if rest2 > 0.0:
                        t2 = rest[i] * t2 + (1.0 - rest[i]) * rest2
                else:
                    t2 *= fall2
            g1, g2 = -np.expm1(-step / t1), -np.expm1(-step / t2)
            e1, e2 = 1.0 - g1, 1.0 - g2
            slope1, slope2 = e1 * step / (t1 * t1), e2 * step / (t2 * t2)
            before, before_dt, before_down1, before_down2 = i, step, down1, down2
        off1, off2 = x1 - target1, x2 - target2
        for j in range(p):
            sens[0, j] *= e1
            sens[1, j] *= e2
        scale = 1.0 + excess if up < 0 else 1.0
        h1, h2 = g1 * share * scale, g2 * (1.0 - share) * scale
        for j in range(n_s):
            sens[0, j] += h1 * by_steady[i, j]
            sens[1, j] += h2 * by_steady[i, j]
        d1, d2 = off1 * slope1, off2 * slope2
        if down1:
            if rest[i] >= 1.0:
                if place[3] >= 0:
                    sens[0, place[3]] += d1 * tau1[i]
                d1 *= fall1
            elif rest1 > 0.0:
                if place[1] >= 0:
                    sens[0, place[1]] += d1 * (1.0 - rest[i])
                d1 *= rest[i]
        if down2:
            if rest[i] >= 1.0:
                if place[4] >= 0:
                    sens[1, place[4]] += d2 * tau2[i]
                d2 *= fall2
            elif rest2 > 0.0:
                if place[2] >= 0:
                    sens[1, place[2]] += d2 * (1.0 - rest[i])
                d2 *= rest[i]
        for j in range(n_1):
            sens[0, n_s + j] += d1 * by_tau1[i, j]
        for j in range(n_2):
            sens[1, n_s + n_1 + j] += d2 * by_tau2[i, j]
        if place[0] >= 0:
            sens[0, place[0]] += g1 * total
            sens[1, place[0]] -= g2 * total
        if place[5] >= 0 and up < 0:
            sens[0, place[5]] += g1 * share * steady[i]
            sens[1, place[5]] += g2 * (1.0 - share) * steady[i]
        x1 -= g1 * off1
        x2 -= g2 * off2
    state[0], state[1] = x1, x2
    return written


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath={"reassoc", "contract"})
def add_squares(columns: Array, written: int, total: Array) -> None:
    """total += columns columns' over the first `written` entries: no BLAS, whose threads fight over so small a task."""
    p = columns.shape[0]
    for i in range(p):
        for j in range(i + 1):
            along = 0.0
            for k in range(written):
                along += columns[i, k] * columns[j, k]
            total[i, j] += along


@numba.njit(cache=True, nogil=True, error_model="numpy")
def products(
    dt: Array, index: Array, rising: Array, y: Array, w: Array,
    steady: Array, tau1: Array, tau2: Array, rest: Array, by_steady: Array, by_tau1: Array, by_tau2: Array,
    scalars: Array, place: Array, state: Array, sens: Array,
) -> Array:  # fmt: skip
    """Σ w s s' over all rows, (p + 1, p + 1): s the derivatives of the response by p unknowns, then the residual."""
    p = sens.shape[1]
    total = np.zeros((p + 1, p + 1))
    buffer = np.zeros((CHUNK, p + 1))
    columns = np.zeros((p + 1, CHUNK))
    n = len(dt)
    for first in range(0, n, CHUNK):
        written = rows(
            first, min(first + CHUNK, n), dt, index, rising, y, w, steady, tau1, tau2, rest,
            by_steady, by_tau1, by_tau2, scalars, place, state, sens, buffer,
        )  # fmt: skip
        for j in range(p + 1):
            for k in range(written):
                columns[j, k] = buffer[k, j]
        add_squares(columns, written, total)
    for i in range(p + 1):
        for j in range(i):
            total[j, i] = total[i, j]
    return total


@numba.njit(cache=True, nogil=True, error_model="numpy")
def response(
    dt: Array, index: Array, rising: Array, steady: Array, tau1: Array, tau2: Array, rest: Array,
    scalars: Array, start: Array, out: Array,
) -> None:  # fmt: skip
    """The response alone, idle output and both states together, at every row: fills `out`, shape (n,)."""
    share, rest1, rest2, fall1, fall2, excess, idle = scalars[:7]
    x1, x2 = start[0], start[1]
    for k in range(len(dt)):
        out[k] = x1 + x2 + idle
        i, step = index[k], dt[k]
        if step <= 0.0:
            continue
        total = steady[i] * (1.0 + excess) if rising[k] < 0 else steady[i]
        target1 = share * total
        target2 = total - target1
        t1, t2 = tau1[i], tau2[i]
        if target1 < x1:
            if rest[i] >= 1.0:
                t1 *= fall1
            elif rest1 > 0.0:
                t1 = rest[i] * t1 + (1.0 - rest[i]) * rest1
        if target2 < x2:
            if rest[i] >= 1.0:
                t2 *= fall2
            elif rest2 > 0.0:
                t2 = rest[i] * t2 + (1.0 - rest[i]) * rest2
        x1 -= np.expm1(-step / t1) * (target1 - x1)
        x2 -= np.expm1(-step / t2) * (target2 - x2)
