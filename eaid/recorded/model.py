"""What each model makes of an input: linear maps from its coefficients to T_s, τ1 and τ2 of every different input.

    nonlinear   T_s(u) cubic, τ1(u) and τ2(u) quadratic, Eqs. (5)–(7), in the Legendre basis of the step fits
    linear      T_s = (b0 u + c0)/a0, τ1 = 1/a0, C = 1, Eq. (8)
    friction    T_s, τ1, τ2 of each level by itself, Eq. (3)

Below the lowest identified input, u_low, τ1 and τ2 keep their edge value and T_s goes linearly to 0 at rest; above the
highest, all keep their edge value. Constraints are those of the step fits.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from eaid.arrays import Array
from eaid.estimate.basis import CONSTRAINTS, RECORDS, Basis, basis_of, constraints, limits
from eaid.recorded.response import Tables

LEAST_TAU_S = 1e-4
"""A τ is kept off zero by this much [s]: between the 101 duties a quadratic may dip below its floor."""


@dataclass(frozen=True, eq=False)
class Model:
    """A model over a range of inputs."""

    name: str
    low: float
    """Lowest identified input."""
    high: float
    rows: Callable[[Array], tuple[Array, Array, Array]]
    """Inputs within the range, (m,) → derivatives of T_s, τ1, τ2 by their coefficients, (m, n) each."""
    sizes: tuple[int, int, int]
    A: Array
    b: Array
    names: Callable[[int], str]
    share: float | None
    """C; None: an unknown, the last coefficient."""
    basis: Basis | None = None
    """Of the nonlinear model."""
    levels: Array | None = None
    """Of the friction model."""

    @property
    def size(self) -> int:
        """Number of coefficients, C among them where it is free."""
        return sum(self.sizes) + (self.share is None)

    def tables(self, rows: "Rows", x: Array) -> Tables:
        """The quantities at the inputs behind `rows`, for the coefficients `x`."""
        a, b, c = self.sizes
        tau1, by_tau1 = _floored(rows.tau1, x[a : a + b])
        tau2, by_tau2 = _floored(rows.tau2, x[a + b : a + b + c])
        return Tables(rows.steady @ x[:a], tau1, tau2, rows.rest, rows.steady, by_tau1, by_tau2)

    def slopes(self, duty: Array, size: int) -> Array:
        """Derivatives of T_s, τ1, τ2 at some inputs by `size` unknowns, the coefficients first; (3, L, size)."""
        rows, found, first = self.rows_of(duty), np.zeros((3, len(duty), size)), 0
        for k, part in enumerate((rows.steady, rows.tau1, rows.tau2)):
            found[k, :, first : first + part.shape[1]] = part
            first += part.shape[1]
        return found

    def rows_of(self, duty: Array) -> "Rows":
        """Rows for any inputs, edges included."""
        rest = np.clip(duty / self.low, 0.0, 1.0) if self.low > 0 else np.ones_like(duty)
        steady, tau1, tau2 = self.rows(np.clip(duty, self.low, self.high))
        return Rows(rest, np.ascontiguousarray(steady * rest[:, None]), tau1, tau2)


@dataclass(frozen=True, eq=False)
class Rows:
    """Linear maps from the coefficients to T_s, τ1, τ2 of some inputs."""

    rest: Array
    steady: Array
    tau1: Array
    tau2: Array


def _floored(rows: Array, x: Array) -> tuple[Array, Array]:
    """τ and its derivatives; 1 s, which no state feels, where a model has no such τ."""
    if rows.shape[1] == 0:
        return np.ones(len(rows)), rows
    tau = rows @ x
    low = tau < LEAST_TAU_S
    if low.any():
        return np.where(low, LEAST_TAU_S, tau), np.where(low[:, None], 0.0, rows)
    return tau, rows


def nonlinear(levels: Array, share: float | None, longest_s: float) -> Model:
    """Eqs. (4)–(7) over the range of `levels`; the degrees fall where these are too few."""
    basis = basis_of(levels, share)
    A, b, names = constraints(basis, longest_s)

    def rows(duty: Array) -> tuple[Array, Array, Array]:
        M = basis.rows(duty)
        s, one, two = (np.ascontiguousarray(M[k, :, part]) for k, part in enumerate(basis.slices))
        return s, one, two

    s, one, two = (part.stop - part.start for part in basis.slices)
    return Model("nonlinear", basis.lowest, basis.highest, rows, (s, one, two), A, b, names, share, basis)


def linear(levels: Array, shortest_s: float, longest_s: float) -> Model:
    """Eq. (8) over the range of `levels`; with one level c0 is 0."""
    low, high = float(levels.min()), float(levels.max())
    middle, half = 0.5 * (low + high), 0.5 * (high - low)

    def rows(duty: Array) -> tuple[Array, Array, Array]:
        one = np.ones((len(duty), 1))
        steady = np.column_stack([one, (duty - middle) / half]) if half > 0 else duty[:, None] / middle
        return np.ascontiguousarray(steady), one, np.zeros((len(duty), 0))

    count = 2 if half > 0 else 1
    A = np.zeros((2, count + 1))
    A[0, -1], A[1, -1] = 1.0, -1.0
    least, most = 0.01 * shortest_s, 1e3 * longest_s
    names = ("a0-fastest", "a0-slowest").__getitem__
    return Model("linear", low, high, rows, (count, 1, 0), A, np.array([least, -most]), names, 1.0, levels=levels)


def friction(levels: Array, share: float, longest_s: float) -> Model:
    """Eq. (3) with T_s, τ1, τ2 of every level by itself; an input between two levels has the nearer one's."""
    count = len(levels)
    edges = 0.5 * (levels[1:] + levels[:-1])
    eye = np.eye(count)

    def rows(duty: Array) -> tuple[Array, Array, Array]:
        nearest = eye[np.searchsorted(edges, duty)]
        return nearest, nearest, nearest

    Ts, tau1, tau2 = np.eye(3 * count).reshape(3, count, 3 * count)
    A, b = limits(Ts, tau1, tau2, RECORDS * longest_s)
    low, high = float(levels[0]), float(levels[-1])
    sizes = (count, count, count)
    return Model("friction", low, high, rows, sizes, A, b, lambda i: CONSTRAINTS[i // count], share, levels=levels)
