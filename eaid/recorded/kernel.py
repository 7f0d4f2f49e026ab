"""Response of the two-state model to any input, and its derivatives by every unknown, in one pass over the samples.

    x1 ← x1 + (1 − e^(−dt/τ1)) (C T_s − x1),   x2 ← x2 + (1 − e^(−dt/τ2)) ((1 − C) T_s − x2),   T = idle + x1 + x2

exact while the input is held (Eqs. (4)–(7)). The derivatives obey the same recursions (sensitivity equations):

    ∂x1/∂p ← e^(−dt/τ1) ∂x1/∂p + (1 − e^(−dt/τ1)) C ∂T_s/∂p + (x1 − C T_s) dt/τ1² e^(−dt/τ1) ∂τ1/∂p

Columns, in this order: coefficients of T_s, τ1, τ2; C; τ1 and τ2 of a fall to rest; factors on τ1 and τ2 of a fall
between levels; relative excess of T_s after a fall of the input; idle output; x1 and x2 at the first row; and last the
residual.
"""

import numba
import numpy as np
from numpy.typing import NDArray

from eaid.arrays import Array

Integers = NDArray[np.int64]

CHUNK = 256
"""Rows that are multiplied together."""


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def rows(
    first: int, last: int, dt: Array, index: Array, rising: Array, y: Array, w: Array,
    steady: Array, tau1: Array, tau2: Array, rest: Array, by_steady: Array, by_tau1: Array, by_tau2: Array,
    scalars: Array, place: Array, state: Array, sens: Array, out: Array,
) -> int:  # fmt: skip
    """Advance from row `first` to `last`, write one row of `out` for each sample that counts, and return how many.

    `scalars`: C, τ1 and τ2 of a fall to rest (0: none), factors of a fall between levels, excess of T_s, idle.
    `place`: column of C, rest 1, rest 2, fall 1, fall 2, excess, idle, start 1, start 2; −1 where it is no unknown.
    `state`: x1, x2; `sens`: rows 0 and 1, derivatives of x1 and x2 by every column, 0 beyond (whole vectors of the
    processor are quicker), the residual last. Both are carried on. While an input is held, derivatives go as
    s ← e^(−dt/τ) s + add + (x − target) turn: `moves` holds add and turn of both states.
    """
    n_s, n_1, n_2 = by_steady.shape[1], by_tau1.shape[1], by_tau2.shape[1]
    share, idle, width = scalars[0], scalars[6], sens.shape[1]
    moves = np.zeros((4, width))
    x1, x2 = state[0], state[1]
    before, before_dt, before_way = -1, -1.0, -1
    g1 = g2 = 0.0
    written = 0
    for k in range(first, last):
        if w[k] > 0.0:
            root = np.sqrt(w[k])
            for j in range(width):
                out[written, j] = root * (sens[0, j] + sens[1, j])
            if place[6] >= 0:
                out[written, place[6]] = root
            out[written, width] = root * (x1 + x2 + idle - y[k])
            written += 1
        i, step = index[k], dt[k]
        if step <= 0.0:
            continue
        lower = rising[k] < 0
        excess = 1.0 + scalars[5] if lower else 1.0
        total = steady[i] * excess
        off1, off2 = x1 - share * total, x2 - (total - share * total)
        way = 4 * lower + 2 * (off1 > 0.0) + (off2 > 0.0)
        if rest[i] < 1.0:
            way += 8
        if i != before or step != before_dt or way != before_way:
            if way != before_way:
                moves[:, :] = 0.0
            for slow in range(2):
                own, by_own, part = (tau2[i], 1.0, 1.0 - share) if slow else (tau1[i], 1.0, share)
                down = (off2 if slow else off1) > 0.0
                let_go = down and rest[i] < 1.0 and scalars[1 + slow] > 0.0
                fell = down and rest[i] >= 1.0
                as_risen = own
                if let_go:
                    own, by_own = rest[i] * own + (1.0 - rest[i]) * scalars[1 + slow], rest[i]
                elif fell:
                    own, by_own = own * scalars[3 + slow], scalars[3 + slow]
                g = -np.expm1(-step / own)
                slope = (1.0 - g) * step / (own * own)
                if slow:
                    g2 = g
                    for j in range(n_2):
                        moves[3, n_s + n_1 + j] = slope * by_own * by_tau2[i, j]
                else:
                    g1 = g
                    for j in range(n_1):
                        moves[1, n_s + j] = slope * by_own * by_tau1[i, j]
                add = 2 * slow
                for j in range(n_s):
                    moves[add, j] = g * part * excess * by_steady[i, j]
                if place[0] >= 0:
                    moves[add, place[0]] = -g * total if slow else g * total
                if lower and place[5] >= 0:
                    moves[add, place[5]] = g * part * steady[i]
                if fell and place[3 + slow] >= 0:
                    moves[add + 1, place[3 + slow]] = slope * as_risen
                if let_go and place[1 + slow] >= 0:
                    moves[add + 1, place[1 + slow]] = slope * (1.0 - rest[i])
            before, before_dt, before_way = i, step, way
        e1, e2 = 1.0 - g1, 1.0 - g2
        for j in range(width):
            sens[0, j] = e1 * sens[0, j] + moves[0, j] + off1 * moves[1, j]
            sens[1, j] = e2 * sens[1, j] + moves[2, j] + off2 * moves[3, j]
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
    scalars: Array, place: Array, state: Array, sens: Array, unknowns: int,
) -> Array:  # fmt: skip
    """Σ w s s' over all rows, (p + 1, p + 1): s the derivatives of the response by p unknowns, then the residual."""
    p = unknowns
    total = np.zeros((p + 1, p + 1))
    buffer = np.zeros((CHUNK, sens.shape[1] + 1))
    columns = np.zeros((p + 1, CHUNK))
    n = len(dt)
    for first in range(0, n, CHUNK):
        written = rows(
            first, min(first + CHUNK, n), dt, index, rising, y, w, steady, tau1, tau2, rest,
            by_steady, by_tau1, by_tau2, scalars, place, state, sens, buffer,
        )  # fmt: skip
        for j in range(p + 1):
            at = j if j < p else sens.shape[1]
            for k in range(written):
                columns[j, k] = buffer[k, at]
        add_squares(columns, written, total)
    for i in range(p + 1):
        for j in range(i):
            total[j, i] = total[i, j]
    return total


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def by_holds(
    first: Integers, index: Integers, rising: Integers, dt: Array, y: Array,
    steady: Array, tau1: Array, tau2: Array, rest: Array, scalars: Array, start: Array,
) -> tuple[float, Array, Array]:  # fmt: skip
    """Σ r², r = response − y where y is a number, and its halved derivatives by T_s, τ1, τ2 of the inputs, (3, m), and
    by `scalars`, x1 and x2 at the first row, (9,): the adjoint of a log hold by hold.

    `first` as in `Holds`; `dt` one step for all rows, or each row's. With q = e^(−t/τ), t since the hold began, a state
    is target + q (x − target): what a hold adds follows from Σ r, Σ r q and Σ r q t.
    """
    share, idle, count = scalars[0], scalars[6], len(index)
    sums, off, lasts = np.zeros((count, 5)), np.zeros((count, 2)), np.zeros(count)
    own, by_own, q_end = np.zeros((count, 2)), np.zeros((count, 2)), np.zeros((count, 2))
    x, cost = start.copy(), 0.0
    for h in range(count):
        i = index[h]
        total = steady[i] * (1.0 + scalars[5]) if rising[h] < 0 else steady[i]
        off[h, 0], off[h, 1] = x[0] - share * total, x[1] - (total - share * total)
        for s in range(2):
            tau = tau2[i] if s else tau1[i]
            own[h, s], by_own[h, s] = tau, 1.0
            if off[h, s] > 0.0 and rest[i] >= 1.0:
                own[h, s], by_own[h, s] = tau * scalars[3 + s], scalars[3 + s]
            elif off[h, s] > 0.0 and scalars[1 + s] > 0.0:
                own[h, s], by_own[h, s] = rest[i] * tau + (1.0 - rest[i]) * scalars[1 + s], rest[i]
        level, off1, off2 = total + idle, off[h, 0], off[h, 1]
        q1 = q2 = e1 = e2 = 1.0
        before, t = -1.0, 0.0
        plain = fast = slow = fast_t = slow_t = 0.0
        for k in range(first[h], first[h + 1]):
            if y[k] == y[k]:
                r = level + off1 * q1 + off2 * q2 - y[k]
                cost += r * r
                plain += r
                fast += r * q1
                slow += r * q2
                fast_t += r * q1 * t
                slow_t += r * q2 * t
            step = dt[k] if len(dt) > 1 else dt[0]
            if step != before:
                e1, e2, before = np.exp(-step / own[h, 0]), np.exp(-step / own[h, 1]), step
            q1, q2 = q1 * e1, q2 * e2
            t += step
        sums[h] = plain, fast, slow, fast_t, slow_t
        lasts[h] = t
        for s in range(2):
            q_end[h, s] = np.exp(-t / own[h, s])
            x[s] += np.expm1(-t / own[h, s]) * off[h, s]
    by_input, by_scalar, adjoint = np.zeros((3, len(steady))), np.zeros(9), np.zeros(2)
    for h in range(count - 1, -1, -1):
        i, lower = index[h], rising[h] < 0
        excess = 1.0 + scalars[5] if lower else 1.0
        by_total = 0.0
        for s in range(2):
            part = 1.0 - share if s else share
            by_target = sums[h, 0] - sums[h, 1 + s] + (1.0 - q_end[h, s]) * adjoint[s]
            by_tau = off[h, s] / own[h, s] ** 2 * (sums[h, 3 + s] + q_end[h, s] * lasts[h] * adjoint[s])
            adjoint[s] = sums[h, 1 + s] + q_end[h, s] * adjoint[s]
            by_total += part * by_target
            by_scalar[0] += (-by_target if s else by_target) * steady[i] * excess
            by_input[1 + s, i] += by_tau * by_own[h, s]
            if off[h, s] > 0.0 and rest[i] >= 1.0:
                by_scalar[3 + s] += by_tau * (tau2[i] if s else tau1[i])
            elif off[h, s] > 0.0 and scalars[1 + s] > 0.0:
                by_scalar[1 + s] += by_tau * (1.0 - rest[i])
        by_input[0, i] += by_total * excess
        if lower:
            by_scalar[5] += by_total * steady[i]
    by_scalar[6] = sums[:, 0].sum()
    by_scalar[7:] = adjoint
    return cost, by_input, by_scalar


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


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def looks(
    dt: Array, index: Array, y: Array, w: Array, by_steady: Array, tau1: Array, tau2: Array, share: Array
) -> Array:  # fmt: skip
    """Σ w s s' of K looks at once, (K, n + 4, n + 4), for τ1 and τ2 of every input, (K, m), and C, (K,).

    s holds everything that the response is linear in: the n coefficients of T_s, idle output, x1 and x2 at the first
    row; then y.
    """
    n = by_steady.shape[1]
    c = n + 4
    found = np.zeros((len(tau1), c, c))
    columns = np.zeros((c, CHUNK))
    for k in range(len(tau1)):
        s1, s2 = np.zeros(n), np.zeros(n)
        start1 = start2 = 1.0
        written = 0
        for row in range(len(dt)):
            if w[row] > 0.0:
                root = np.sqrt(w[row])
                for j in range(n):
                    columns[j, written] = root * (s1[j] + s2[j])
                columns[n, written], columns[n + 1, written] = root, root * start1
                columns[n + 2, written], columns[n + 3, written] = root * start2, root * y[row]
                written += 1
            if written == CHUNK or row == len(dt) - 1:
                add_squares(columns, written, found[k])
                written = 0
            i, step = index[row], dt[row]
            if step <= 0.0:
                continue
            g1, g2 = -np.expm1(-step / tau1[k, i]), -np.expm1(-step / tau2[k, i])
            for j in range(n):
                s1[j] += g1 * (share[k] * by_steady[i, j] - s1[j])
                s2[j] += g2 * ((1.0 - share[k]) * by_steady[i, j] - s2[j])
            start1 -= g1 * start1
            start2 -= g2 * start2
        for i in range(c):
            for j in range(i):
                found[k, j, i] = found[k, i, j]
    return found
