"""For given τ1(u), τ2(u) and C: the best of everything that the response is linear in, of many shapes in one pass.

These are the coefficients of T_s, the idle outputs, and the start states of the logs.
"""

from collections.abc import Sequence

import numba
import numpy as np

from eaid.arrays import Array
from eaid.recorded.model import LEAST_TAU_S
from eaid.recorded.problem import Setup
from eaid.recorded.states import Samples


def linear_parts(setup: Setup, shapes: Sequence[Array] | Array) -> tuple[Array, Array]:
    """Costs (K,) of some x, (K, n), and places (K, n) with what enters linearly solved for."""
    model, x = setup.model, np.array(shapes)
    a, b, c = model.sizes
    own = np.concatenate([place.own[place.own >= 0] for place in setup.places]).astype(np.intp)
    free = np.concatenate([np.arange(a), own]).astype(np.intp)
    share = x[:, model.size - 1] if model.share is None else np.full(len(x), model.share)
    size = len(free)
    sums = np.zeros((len(x), size + 1, size + 1))
    for drive, rows, place in zip(setup.drives, setup.maps, setup.places, strict=True):
        tau1 = np.maximum(x[:, a : a + b] @ rows.tau1.T, LEAST_TAU_S)
        tau2 = np.maximum(x[:, a + b : a + b + c] @ rows.tau2.T, LEAST_TAU_S) if c else np.ones_like(tau1)
        found = linear_sums(drive.rows, rows.steady, tau1, tau2, share)
        known = np.concatenate([np.arange(a), np.where(place.own >= 0, np.searchsorted(free, place.own), -1), [size]])
        at = np.flatnonzero(known >= 0)
        sums[:, known[at][:, None], known[at]] += found[:, at[:, None], at]
    scale = np.sqrt(np.maximum(np.diagonal(sums, axis1=1, axis2=2)[:, :size], 1e-300))
    A = sums[:, :size, :size] / (scale[:, :, None] * scale[:, None, :])
    v = sums[:, :size, size] / scale
    z = np.linalg.solve(A + 1e-10 * np.eye(size), v[:, :, None])[:, :, 0]
    x[:, free] = z / scale
    return sums[:, size, size] + np.einsum("kij,ki,kj->k", A, z, z) - 2 * (v * z).sum(axis=1), x


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def linear_sums(samples: Samples, by_steady: Array, tau1: Array, tau2: Array, share: Array) -> Array:
    """Σ w s s' of K shapes, (K, n + 4, n + 4), for τ1 and τ2 of every input, (K, m), and C, (K,).

    s are the derivatives by the n coefficients of T_s, idle output, x1 and x2 at the first row; then y.
    """
    n, rows = by_steady.shape[1], len(samples.w)
    sums, columns = np.empty((len(share), n + 4, n + 4)), np.empty((rows, n + 4))
    for k in range(len(share)):
        fast, slow = np.zeros(n), np.zeros(n)
        start1 = start2 = 1.0
        for row in range(rows):
            root, i = np.sqrt(samples.w[row]), samples.which[row]
            for j in range(n):
                columns[row, j] = root * (fast[j] + slow[j])
            columns[row, n], columns[row, n + 1] = root, root * start1
            columns[row, n + 2], columns[row, n + 3] = root * start2, root * samples.y[row]
            g1, g2 = -np.expm1(-samples.dt_s[row] / tau1[k, i]), -np.expm1(-samples.dt_s[row] / tau2[k, i])
            for j in range(n):
                fast[j] += g1 * (share[k] * by_steady[i, j] - fast[j])
                slow[j] += g2 * ((1.0 - share[k]) * by_steady[i, j] - slow[j])
            start1 -= g1 * start1
            start2 -= g2 * start2
        sums[k] = columns.T @ columns
    return sums
