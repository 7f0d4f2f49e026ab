"""What enters an output linearly (gain, idle output, start states) in sums of products over a log.

They are all that is needed to solve for it at given time constants (variable projection), one pass over the log.
"""

import numpy as np

from eaid.arrays import Array
from eaid.plant.derivatives import NEXT_TO_NOTHING, swung
from eaid.plant.drive import Drive
from eaid.plant.machine_code import machine_code


@machine_code(nogil=True, fastmath={"contract"})
def linear_sums(drive: Drive, by_steady: Array, tau1: Array, tau2: Array, share: Array) -> Array:
    """Σ w s s' of K shapes, (K, n + 4, n + 4), for τ1 and τ2 of every input, (K, m), and C, (K,).

    s are the derivatives by the n coefficients of T_s, idle output, x1 and x2 at the first row; then y.
    """
    n, rows = by_steady.shape[1], len(drive.w)
    sums, columns = np.empty((len(share), n + 4, n + 4)), np.empty((rows, n + 4))
    for k in range(len(share)):
        fast, slow = np.zeros(n), np.zeros(n)
        start1 = start2 = 1.0
        for row in range(rows):
            root, i = np.sqrt(drive.w[row]), drive.which[row]
            for j in range(n):
                columns[row, j] = root * (fast[j] + slow[j])
            columns[row, n], columns[row, n + 1] = root, root * start1
            columns[row, n + 2], columns[row, n + 3] = root * start2, root * drive.y[row]
            g1, g2 = -np.expm1(-drive.dt_s[row] / tau1[k, i]), -np.expm1(-drive.dt_s[row] / tau2[k, i])
            for j in range(n):
                fast[j] += g1 * (share[k] * by_steady[i, j] - fast[j])
                slow[j] += g2 * ((1.0 - share[k]) * by_steady[i, j] - slow[j])
            start1 = start1 - g1 * start1 if start1 > NEXT_TO_NOTHING else 0.0
            start2 = start2 - g2 * start2 if start2 > NEXT_TO_NOTHING else 0.0
        sums[k] = columns.T @ columns
    return sums


@machine_code(nogil=True, fastmath={"contract"})
def swinging_sums(drive: Drive, gains: Array, tau: float, zeta: float) -> Array:
    """Σ w s s', (6, 6), of two lags in series or ringing: s the answer to the different `gains` of the inputs, idle
    output, both states at the first row; of the state's rate the answer; then y."""
    sums, s = np.zeros((6, 6)), np.zeros(6)
    x1, x2, f1, f2, g1, g2, last = 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, -1.0
    c, n = 1.0, 0.0
    s[1] = 1.0
    for k in range(len(drive.w)):
        if drive.w[k] > 0.0:
            s[0], s[2], s[3], s[4], s[5] = x1, f1, g1, x2, drive.y[k]
            for i in range(6):
                weighed = drive.w[k] * s[i]
                for j in range(i + 1):
                    sums[i, j] += weighed * s[j]
        step = drive.dt_s[k]
        if step != last:
            c, n = swung(zeta, step / tau)
            last = step
        f11, f22, w = c + zeta * n, c - zeta * n, gains[drive.which[k]]
        x1, x2 = w + f11 * (x1 - w) + n * x2, f22 * x2 - n * (x1 - w)
        if abs(f1) + abs(f2) + abs(g1) + abs(g2) > NEXT_TO_NOTHING:
            f1, f2 = f11 * f1 + n * f2, f22 * f2 - n * f1
            g1, g2 = f11 * g1 + n * g2, f22 * g2 - n * g1
        else:
            f1, f2, g1, g2 = 0.0, 0.0, 0.0, 0.0
    for i in range(6):
        sums[:i, i] = sums[i, :i]
    return sums


LAG = np.array([0, 1, 2, 3, 5])  # Where sums of two lags in parallel lie among `swinging_sums`


def lag_sums(drive: Drive, taus: Array) -> Array:
    """The same of one lag with each of some τ, (n, 6, 6), two in parallel with C = 1; without the rate of the state."""
    ones, sums = np.ones((len(taus), len(drive.duty))), np.zeros((len(taus), 6, 6))
    found = linear_sums(drive, drive.duty[:, None], taus[:, None] * ones, ones, np.ones(len(taus)))
    sums[:, LAG[:, None], LAG] = found
    return sums


@machine_code(nogil=True)
def lagged(values: Array, dt_s: float, tau: float) -> Array:
    """Columns of values at equal steps, (n, k), behind one lag that has settled at the first row."""
    gone, found = -np.expm1(-dt_s / tau), values.copy()
    for row in range(1, len(values)):
        for j in range(values.shape[1]):
            found[row, j] = found[row - 1, j] + gone * (values[row, j] - found[row - 1, j])
    return found


def unforeseen(values: Array, coefficients: Array) -> Array:
    """What an autoregression does not foresee of columns of values, (n, k)."""
    left = values.copy()
    for lag, one in enumerate(coefficients.tolist(), 1):
        left[lag:] -= one * values[:-lag]
    return left


@machine_code(nogil=True)
def follow_play(values: Array, width: float) -> Array:
    """What follows values through a play of a width, (n,): it moves where they have crossed the gap."""
    found, at = values.copy(), values[0]
    for row in range(len(values)):
        at = min(max(at, values[row] - 0.5 * width), values[row] + 0.5 * width)
        found[row] = at
    return found
