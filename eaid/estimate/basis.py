"""The unknowns of the joint fit: Legendre coefficients of τ1(u), τ2(u), T_s(u) over the levels, and their limits.

Constraints, specification 3, at 101 equally spaced duties over the levels: τ1 ≥ 1 ms, τ2 ≥ τ1, T_s ≥ 0.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.polynomial import Legendre, Polynomial
from numpy.polynomial.polynomial import polyval

from eaid.arrays import Array, read_only
from eaid.models.nonlinear import CHECKED_DUTIES
from eaid.models.parameters import TAU_FLOOR_S, Nonlinear

RECORDS = 1e6
"""τ2 is looked for up to this many record lengths: no data can tell it from endless."""
RECORDS_FREE = 100.0
"""τ2 is looked for up to this many record lengths where C is free: T_s then grows with τ2, all but straight."""
DEGREES = (3, 2, 2)
"""Degrees of T_s, τ1, τ2."""
CONSTRAINTS = ("tau1-floor", "tau2-meets-tau1", "Ts-zero", "tau2-endless")
"""Codes of the constraints, in the order of their rows, 101 of each."""


LEGENDRE = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [-0.5, 0.0, 1.5, 0.0], [0.0, -1.5, 0.0, 2.5]])
"""Coefficients of the first four Legendre polynomials, lowest power first, one in a row."""


def limits(
    Ts: Array, tau1: Array, tau2: Array, longest_tau2_s: float | None = None, free_share: bool = False
) -> tuple[Array, Array]:
    """A and b of A c ≥ b, specification 3: τ1 ≥ 1 ms, τ2 ≥ τ1 and T_s ≥ 0 at n inputs, and an end of τ2 where asked.

    T_s, τ1 and τ2 at these inputs are `Ts` c, `tau1` c and `tau2` c, shapes (n, P). Where C is free it is the last of
    the coefficients c, and lies between 0 and 1.
    """
    A, least = [tau1, tau2 - tau1, Ts], [TAU_FLOOR_S, 0.0, 0.0]
    if longest_tau2_s is not None:
        A, least = [*A, -tau2], [*least, -longest_tau2_s]
    b = np.repeat(least, len(Ts))
    if free_share:
        C = np.eye(1, Ts.shape[1], Ts.shape[1] - 1)
        A, b = [*A, C, -C], np.append(b, [0.0, -1.0])
    return np.concatenate(A), b


@dataclass(frozen=True, eq=False)
class Basis:
    """The map between the unknowns x and θ = (T_s, τ1, τ2, C) of each level: θ = M x + k."""

    degrees: tuple[int, int, int]
    """Of T_s, τ1, τ2; below (3, 2, 2) where the levels are too few."""
    lowest: float
    highest: float
    free_share: bool
    share: float
    u: Array
    """The levels, shape (L,)."""

    @cached_property
    def M(self) -> Array:
        """`rows` of the levels, (4, L, n)."""
        return read_only(self.rows(self.u))

    @cached_property
    def duties(self) -> Array:
        """Where the constraints hold, shape (101,)."""
        return np.linspace(self.lowest, self.highest, CHECKED_DUTIES if self.highest > self.lowest else 1)

    @cached_property
    def M_of_duties(self) -> Array:
        """`rows` of the duties, (4, 101, n)."""
        return read_only(self.rows(self.duties))

    @cached_property
    def to_powers(self) -> Array:
        """The powers of the duty in each Legendre polynomial, lowest first, one polynomial in a row, (4, 4)."""
        middle, half = 0.5 * (self.lowest + self.highest), 0.5 * (self.highest - self.lowest) or 1.0
        rows = np.zeros((4, 4))
        for k in range(4):
            rows[k, : k + 1] = Legendre.basis(k, [middle - half, middle + half]).convert(kind=Polynomial).coef
        return rows

    @property
    def slices(self) -> tuple[slice, slice, slice]:
        """Where the coefficients of T_s, τ1, τ2 lie in x."""
        a, b, c = (degree + 1 for degree in self.degrees)
        return slice(0, a), slice(a, a + b), slice(a + b, a + b + c)

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return sum(self.degrees) + 3 + int(self.free_share)

    def scaled(self, u: Array) -> Array:
        """Duty mapped to −1…1 over the fitted levels."""
        half = 0.5 * (self.highest - self.lowest)
        return (np.asarray(u) - 0.5 * (self.highest + self.lowest)) / (half if half else 1.0)

    def rows(self, u: Array) -> Array:
        """M for some duties, shape (4, len(u), n); the row of C is its own unknown, or 0."""
        M = np.zeros((4, len(u), self.size))
        values = self.scaled(u)[:, None] ** np.arange(4) @ LEGENDRE.T
        for k, (degree, part) in enumerate(zip(self.degrees, self.slices, strict=True)):
            M[k, :, part] = values[:, : degree + 1]
        if self.free_share:
            M[3, :, -1] = 1.0
        return M

    def theta(self, x: Array, M: Array) -> Array:
        """θ of the levels whose rows are M, shape (4, L); (4, L, N) for N columns of x."""
        theta = M @ x
        if not self.free_share:
            theta[3] = self.share
        # Between the 101 duties a quadratic may dip a little below its floor; a level's τ is kept off zero there.
        np.maximum(theta[1:3], 0.1 * TAU_FLOOR_S, out=theta[1:3])
        return theta

    def parameters(self, x: Array) -> Nonlinear:
        """The polynomials in powers of the duty, lowest first, padded with zeros to the paper's degrees."""
        found = []
        for part, degree in zip(self.slices, DEGREES, strict=True):
            powers = x[part] @ self.to_powers[: part.stop - part.start]
            found.append(tuple(powers[: degree + 1].tolist()))
        Ts, tau1, tau2 = found
        share = float(x[-1]) if self.free_share else self.share
        return Nonlinear(tau1, tau2, Ts, (self.lowest, self.highest), share)

    def unknowns(self, p: Nonlinear) -> Array:
        """x of a model, by interpolation at as many duties as it has coefficients."""
        x = np.zeros(self.size)
        for part, degree, coefficients in zip(self.slices, self.degrees, (p.Ts, p.tau1, p.tau2), strict=True):
            at = np.linspace(self.lowest, self.highest, degree + 1)
            x[part] = np.linalg.solve(self.rows(at)[0, :, : degree + 1], polyval(at, coefficients))
        if self.free_share:
            x[-1] = p.C
        return x


def basis_of(u: Array, share: float | None) -> Basis:
    """The basis that these levels allow: a polynomial has at most as many coefficients as there are levels."""
    return _basis_of(tuple(u.tolist()), share)


@lru_cache(maxsize=8)
def _basis_of(u: tuple[float, ...], share: float | None) -> Basis:
    """One for each set of levels: its fits under other weights, and of its resamples, have the same."""
    most = len(set(u)) - 1
    a, b, c = (min(degree, most) for degree in DEGREES)
    return Basis((a, b, c), min(u), max(u), share is None, 0.85 if share is None else share, np.array(u))


@lru_cache(maxsize=32)
def constraints(basis: Basis, longest_s: float) -> tuple[Array, Array, Callable[[int], str]]:
    """A x ≥ b at the 101 duties, and what each row says; τ2 ends at `RECORDS` times the longest record."""
    longest_tau2_s = (RECORDS_FREE if basis.free_share else RECORDS) * longest_s
    Ts, tau1, tau2, _ = basis.M_of_duties
    A, b = limits(Ts, tau1, tau2, longest_tau2_s, basis.free_share)
    return read_only(A), read_only(b), lambda i: _code(basis, i)


def _code(basis: Basis, i: int) -> str:
    count = len(CONSTRAINTS) * len(basis.duties)
    return CONSTRAINTS[i // len(basis.duties)] if i < count else ("C-zero", "C-one")[i - count]


def active_at(basis: Basis, active: Sequence[int]) -> dict[str, tuple[float, ...]]:
    """Active constraints by code, and the inputs at which each holds."""
    found: dict[str, list[float]] = {}
    for i in active:
        at = found.setdefault(_code(basis, i), [])
        if i < len(CONSTRAINTS) * len(basis.duties):
            at.append(float(basis.duties[i % len(basis.duties)]))
    return {code: tuple(at) for code, at in found.items()}
