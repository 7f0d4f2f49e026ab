"""Derivatives of the response by every unknown, along with the states, in one pass over the samples.

They obey the recursions of the states themselves (sensitivity equations):

    ∂x1/∂p ← e^(−dt/τ1) ∂x1/∂p + (1 − e^(−dt/τ1)) C ∂T_s/∂p + (x1 − C T_s) dt/τ1² e^(−dt/τ1) ∂τ1/∂p
"""

import numba
import numpy as np

from eaid.arrays import Array
from eaid.recorded.states import EXCESS, FALL, IDLE, REST, SHARE, START, Integers, Samples, Tables, acting_tau


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def derivatives(samples: Samples, tables: Tables, scalars: Array, place: Integers, count: int) -> Array:
    """√w times the derivatives by `count` unknowns, then √w times the residual, of the rows that count, (N, count + 1).

    The coefficients of T_s, τ1 and τ2 come first. `place` has the columns of `scalars`, (9,); what is no unknown has
    the column −1, the last, which nobody reads.
    """
    n_s, weights, share = tables.by_steady.shape[1], samples.w, scalars[SHARE]
    x, before, g, last_step = scalars[START:].copy(), np.zeros(2), np.zeros(2), 0.0
    sens = np.zeros((2, count + 1))
    sens[0, place[START]] = sens[1, place[START + 1]] = 1.0
    out, row = np.empty((np.count_nonzero(weights), count + 1)), 0
    for k in range(len(weights)):
        if weights[k] > 0.0:
            root = np.sqrt(weights[k])
            for j in range(count):
                out[row, j] = root * (sens[0, j] + sens[1, j])
            if place[IDLE] >= 0:
                out[row, place[IDLE]] = root
            out[row, count] = root * (x[0] + x[1] + scalars[IDLE] - samples.y[k])
            row += 1
        i, step, fallen = samples.which[k], samples.dt_s[k], samples.rising[k] < 0
        excess = 1.0 + scalars[EXCESS] if fallen else 1.0
        total, first = tables.steady[i] * excess, n_s
        for s in range(2):
            by_curve = tables.by_tau2 if s else tables.by_tau1
            part, risen = (1.0 - share, tables.tau2[i]) if s else (share, tables.tau1[i])
            off = x[s] - part * total
            tau, by_risen, by_rest, by_fall = acting_tau(
                risen, off, tables.rest[i], scalars[REST + s], scalars[FALL + s]
            )
            if tau != before[s] or step != last_step:
                g[s], before[s] = -np.expm1(-step / tau), tau
            by_tau = off * (1.0 - g[s]) * step / (tau * tau)
            for j in range(count + 1):
                sens[s, j] *= 1.0 - g[s]
            for j in range(n_s):
                sens[s, j] += g[s] * part * excess * tables.by_steady[i, j]
            for j in range(by_curve.shape[1]):
                sens[s, first + j] += by_tau * by_risen * by_curve[i, j]
            sens[s, place[SHARE]] += -g[s] * total if s else g[s] * total
            sens[s, place[REST + s]] += by_tau * by_rest
            sens[s, place[FALL + s]] += by_tau * by_fall
            if fallen:
                sens[s, place[EXCESS]] += g[s] * part * tables.steady[i]
            x[s] -= g[s] * off
            first += by_curve.shape[1]
        last_step = step
    return out
