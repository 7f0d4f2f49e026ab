"""Cost and gradient over every sample of a log whose input is held, hold by hold, without derivatives in each row.

With q = e^(−t/τ), t since the hold began, a state is target + q (x − target): what a hold adds to the cost follows
from Σ r, Σ r q and Σ r q t of both states, and to the gradient from these and the adjoint of the states at its end.
"""

import numba
import numpy as np

from eaid.arrays import Array
from eaid.recorded.states import EXCESS, FALL, IDLE, REST, SHARE, START, Integers, Tables, acting_tau


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def hold_sums(dt_s: Array, y: Array, first: int, last: int, level: float, off: Array, tau: Array, sums: Array) -> float:
    """Σ r² of a hold; `sums` gets Σ r, Σ r q of both states, Σ r q t of both, and the length of the hold."""
    q1 = q2 = e1 = e2 = 1.0
    before, t = -1.0, 0.0
    squares = plain = fast = slow = fast_t = slow_t = 0.0
    for k in range(first, last):
        if y[k] == y[k]:
            r = level + off[0] * q1 + off[1] * q2 - y[k]
            squares += r * r
            plain += r
            fast += r * q1
            slow += r * q2
            fast_t += r * q1 * t
            slow_t += r * q2 * t
        step = dt_s[k] if len(dt_s) > 1 else dt_s[0]
        if step != before:
            e1, e2, before = np.exp(-step / tau[0]), np.exp(-step / tau[1]), step
        q1, q2 = q1 * e1, q2 * e2
        t += step
    sums[:] = plain, fast, slow, fast_t, slow_t, t
    return squares


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def by_holds(
    first: Integers, index: Integers, rising: Integers, dt_s: Array, y: Array, tables: Tables, scalars: Array
) -> tuple[float, Array, Array]:
    """Σ r², r = response − y where y is a number, and its halved derivatives by T_s, τ1, τ2 of the inputs, (3, m), and
    by `scalars`, (9,). `first` as in `Holds`; `dt_s` one step for all rows, or each row's."""
    count, rest, parts = len(index), tables.rest, np.array([scalars[SHARE], 1.0 - scalars[SHARE]])
    sums, off, x, tau = np.zeros((count, 6)), np.zeros((count, 2)), scalars[START:].copy(), np.zeros(2)
    taus = np.stack((tables.tau1, tables.tau2))
    totals = np.where(rising < 0, 1.0 + scalars[EXCESS], 1.0) * tables.steady[index]
    cost = 0.0
    for h in range(count):
        i = index[h]
        for s in range(2):
            off[h, s] = x[s] - parts[s] * totals[h]
            tau[s] = acting_tau(taus[s, i], off[h, s], rest[i], scalars[REST + s], scalars[FALL + s])[0]
        cost += hold_sums(dt_s, y, first[h], first[h + 1], totals[h] + scalars[IDLE], off[h], tau, sums[h])
        for s in range(2):
            x[s] += np.expm1(-sums[h, 5] / tau[s]) * off[h, s]
    by_input, by_scalar, adjoint = np.zeros((3, len(rest))), np.zeros(9), np.zeros(2)
    for h in range(count - 1, -1, -1):
        i, length, by_total = index[h], sums[h, 5], 0.0
        for s in range(2):
            own, by_risen, by_rest, by_fall = acting_tau(
                taus[s, i], off[h, s], rest[i], scalars[REST + s], scalars[FALL + s]
            )
            q_end = np.exp(-length / own)
            by_target = sums[h, 0] - sums[h, 1 + s] + (1.0 - q_end) * adjoint[s]
            by_tau = off[h, s] / own**2 * (sums[h, 3 + s] + q_end * length * adjoint[s])
            adjoint[s] = sums[h, 1 + s] + q_end * adjoint[s]
            by_total += parts[s] * by_target
            by_input[1 + s, i] += by_tau * by_risen
            by_scalar[SHARE] += (-by_target if s else by_target) * totals[h]
            by_scalar[REST + s] += by_tau * by_rest
            by_scalar[FALL + s] += by_tau * by_fall
        if rising[h] < 0:
            by_scalar[EXCESS] += by_total * tables.steady[i]
            by_total *= 1.0 + scalars[EXCESS]
        by_input[0, i] += by_total
    by_scalar[IDLE], by_scalar[START:] = sums[:, 0].sum(), adjoint
    return cost, by_input, by_scalar
