"""The two states of the model under any input, exact while it is held (Eqs. (4)–(7)).

    x1 ← x1 + (1 − e^(−dt/τ1)) (C T_s − x1),   x2 ← x2 + (1 − e^(−dt/τ2)) ((1 − C) T_s − x2),   T = idle + x1 + x2

Nine numbers stand beside T_s, τ1 and τ2 of the inputs, in every array in the order of the constants below: C; τ1 and τ2
of a fall to rest (0: none); factors on τ1 and τ2 of a fall between levels; relative excess of T_s after a fall of the
input; idle output; x1 and x2 at the first row.
"""

from collections.abc import Callable
from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from eaid.arrays import Array

Integers = NDArray[np.int64]

SHARE, REST, FALL, EXCESS, IDLE, START = 0, 1, 3, 5, 6, 7


class Samples(NamedTuple):
    """A log in numbers, row by row, shapes (n,)."""

    dt_s: Array
    """How long a row's input acts [s]; 0 after the last."""
    which: Integers
    """Which of the different inputs acts."""
    rising: Integers
    """−1 while an input is held to which the log fell from a higher one, else 1."""
    y: Array
    w: Array
    """Weights; 0: a row that is not compared."""


class Tables(NamedTuple):
    """T_s, τ1, τ2 of the different inputs, shapes (m,), and their derivatives by the coefficients, (m, n)."""

    steady: Array
    tau1: Array
    tau2: Array
    rest: Array
    """u/u_low, at most 1: below 1 a fall goes over to the release constants."""
    by_steady: Array
    by_tau1: Array
    by_tau2: Array


@numba.njit(cache=True, error_model="numpy")
def acting_tau(tau: float, off: float, rest: float, at_rest: float, factor: float) -> tuple[float, float, float, float]:
    """τ of a state that lies `off` above its target, and its derivatives by the τ of rises, `at_rest` and `factor`."""
    if off > 0.0 and rest >= 1.0:
        return tau * factor, factor, 0.0, tau
    if off > 0.0 and at_rest > 0.0:
        return rest * tau + (1.0 - rest) * at_rest, rest, 1.0 - rest, 0.0
    return tau, 1.0, 0.0, 0.0


@numba.njit(cache=True, nogil=True, error_model="numpy")
def response(
    dt_s: Array, index: Integers, rising: Integers, steady: Array, tau1: Array, tau2: Array, rest: Array, scalars: Array
) -> Array:
    """Idle output and both states together at every row, (n,)."""
    out, x = np.empty(len(dt_s)), scalars[START:].copy()
    for k in range(len(dt_s)):
        out[k] = scalars[IDLE] + x[0] + x[1]
        i = index[k]
        total = steady[i] * (1.0 + scalars[EXCESS]) if rising[k] < 0 else steady[i]
        target = scalars[SHARE] * total
        for s in range(2):
            off = x[s] - target
            tau = tau2[i] if s else tau1[i]
            x[s] += np.expm1(-dt_s[k] / acting_tau(tau, off, rest[i], scalars[REST + s], scalars[FALL + s])[0]) * off
            target = total - target
    return out


def from_rest(
    inputs: Array,
    dt_s: Array,
    curves: Callable[[Array], tuple[Array, Array, Array]],
    share: float,
    release: tuple[float, float] | None,
    low: float,
) -> Array:
    """What a plant gives on any input, from rest, (n,): `curves` are T_s, τ1 and τ2 of the different inputs."""
    duty, index = np.unique(inputs, return_inverse=True)
    rest = np.clip(duty / low, 0, 1) if low > 0 else np.ones(len(duty))
    steady, tau1, tau2 = (np.ascontiguousarray(one, dtype=np.float64) for one in curves(duty))
    scalars = np.array([share, *(release or (0.0, 0.0)), 1.0, 1.0, 0.0, 0.0, 0.0, 0.0])
    rising = np.ones(len(index), dtype=np.int64)
    return np.asarray(response(dt_s, index.astype(np.int64), rising, steady, tau1, tau2, rest, scalars))
