"""Forms of T_s(u), τ1(u), τ2(u): linear in their coefficients, with one rule for inputs that no log showed.

Below the lowest identified input, u_low, τ1 and τ2 keep their edge value and T_s goes linearly to 0 at rest; above the
highest, all keep their edge value. Of an input of both signs T_s has a form on each side of rest, over |u|; τ1 and τ2
have one over |u|. In fits of steps the first coefficient of a form is its constant: their feasible points rest on it.

Once solved T_s is a row of cubics, each from its own input on (`Pieces`): a polynomial is one of them, a curve through
the levels has one between each two. Replays, margins and exports take any such row.
"""

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, TypeAlias

import numpy as np
from numpy.polynomial import Legendre, Polynomial
from numpy.polynomial.legendre import legvander
from numpy.polynomial.polynomial import polyder, polyval

from eaid.arrays import Array
from eaid.errors import DataError

Range = tuple[float, float]  # Lowest and highest identified input, by size
# From which input on, and the cubic that holds from there, of the input above it, lowest power first
CubicPiece = tuple[float, float, float, float, float]
Pieces = tuple[CubicPiece, ...]
RESTING = 0.02  # Part of the largest output up to which that of an input stays at rest
QUARTILES = 5  # Knots of a spline, with both ends
LEAST_APART_KNOTS = 0.02  # Part of the range by which two knots lie apart at least, as the inputs of the logs have them
KnownPoints = tuple[tuple[float, float], ...]  # Inputs, rising, and a value at each


@dataclass(frozen=True)
class LegendreForm:
    """A polynomial over the identified inputs, low to high, in Legendre polynomials."""

    degree: int
    low: float
    high: float

    @property
    def size(self) -> int:
        """Number of coefficients."""
        return self.degree + 1

    @property
    def inputs(self) -> Array:
        """As many inputs as coefficients: values there give the form."""
        return np.linspace(self.low, self.high, self.size)

    def rows(self, u: Array) -> Array:
        """∂ value/∂ coefficients at some inputs, (m, size)."""
        half = 0.5 * (self.high - self.low)
        return np.asarray(legvander((np.asarray(u) - 0.5 * (self.high + self.low)) / (half or 1.0), self.degree))

    def powers(self, c: Array) -> Array:
        """The same polynomial in powers of u, lowest first, (size,)."""
        domain = [self.low, self.high] if self.high > self.low else [self.low - 1, self.low + 1]
        powers = Legendre(c, domain).convert(kind=Polynomial).coef
        return np.pad(powers, (0, self.size - len(powers)))


@dataclass(frozen=True)
class Proportional:
    """One gain for all inputs, of both signs, g u; of a higher degree a polynomial through rest."""

    low: float
    high: float
    degree: int = 1

    @property
    def size(self) -> int:
        """Number of coefficients."""
        return self.degree

    @property
    def inputs(self) -> Array:
        """As many inputs as coefficients."""
        return self.high * np.arange(1, self.size + 1) / self.size

    def rows(self, u: Array) -> Array:
        """∂ value/∂ coefficients at some inputs, (m, size)."""
        u = np.asarray(u, dtype=np.float64)[:, None]
        return u * (u / self.high) ** np.arange(self.size)

    def powers(self, c: Array) -> Array:
        """The same in powers of u, lowest first."""
        return np.append(0.0, c / self.high ** np.arange(self.size))


@dataclass(frozen=True)
class Sides:
    """A form on each side of rest: the coefficients of inputs above 0 first, then those of inputs below, over |u|."""

    up: LegendreForm | Proportional
    down: LegendreForm | Proportional

    @property
    def size(self) -> int:
        """Number of coefficients."""
        return self.up.size + self.down.size

    @property
    def inputs(self) -> Array:
        """As many inputs as coefficients."""
        return np.append(self.up.inputs, -self.down.inputs)

    def rows(self, u: Array) -> Array:
        """∂ value/∂ coefficients at some inputs, (m, size)."""
        below = np.asarray(u) < 0
        rows = np.zeros((len(below), self.size))
        rows[~below, : self.up.size] = self.up.rows(np.asarray(u)[~below])
        rows[below, self.up.size :] = self.down.rows(-np.asarray(u)[below])
        return rows


@dataclass(frozen=True)
class PerLevel:
    """A value at each level; an input between two has the nearer one's."""

    levels: tuple[float, ...]

    @property
    def size(self) -> int:
        """Number of coefficients."""
        return len(self.levels)

    @property
    def inputs(self) -> Array:
        """The levels."""
        return np.array(self.levels)

    def rows(self, u: Array) -> Array:
        """∂ value/∂ coefficients at some inputs, (m, size)."""
        edges = 0.5 * (self.inputs[1:] + self.inputs[:-1])
        return np.asarray(np.eye(self.size)[np.searchsorted(edges, u)])

    def points(self, values: Array) -> KnownPoints:
        """The curve that they make, as a plant goes through it."""
        return tuple(zip(self.levels, values.tolist(), strict=True))


@dataclass(frozen=True)
class Knots(PerLevel):
    """A value at each of some inputs; cubics between them, whose slope at one is that of the parabola through it and
    its neighbours."""

    told: ClassVar[int] = 4  # Points of each cubic by which it is told a plant that goes through them

    def rows(self, u: Array) -> Array:
        """∂ value/∂ coefficients at some inputs, (m, size)."""
        from scipy.interpolate import CubicHermiteSpline

        each = np.eye(self.size)
        return np.asarray(
            CubicHermiteSpline(self.inputs, each, np.gradient(each, self.inputs, axis=0, edge_order=2))(u)
        )

    def points(self, values: Array) -> KnownPoints:
        """So many that a plant's own way between two hardly differs; none below 0."""
        at = np.arange(self.told * (self.size - 1) + 1) / self.told
        parts = np.interp(at, np.arange(self.size), self.inputs)
        return tuple(zip(parts.tolist(), np.maximum(self.rows(parts) @ values, 0.0).tolist(), strict=True))


@dataclass(frozen=True)
class NaturalSpline(Knots):
    """The same by a natural cubic spline: its curvature does not jump, and is 0 at both ends."""

    told: ClassVar[int] = 12

    def rows(self, u: Array) -> Array:
        """∂ value/∂ coefficients at some inputs, (m, size)."""
        from scipy.interpolate import CubicSpline

        return np.asarray(CubicSpline(self.inputs, np.eye(self.size), bc_type="natural")(u))


def knots_at(shown: Array, low: float, high: float, count: int) -> tuple[float, ...]:
    """Inputs that part those that were shown alike; or, where most of the time goes to few of them, these."""
    for each in (shown, np.unique(shown)):
        at = np.array([low, *np.quantile(each, np.linspace(0, 1, count)[1:-1]), high])
        if (np.diff(at) >= LEAST_APART_KNOTS * (high - low)).all():
            return tuple(at.tolist())
    return tuple(np.linspace(low, high, count).tolist())


def natural_spline(shown: Array) -> "Form | None":
    """With knots at the quartiles of the inputs that were shown, fewer where there are fewer; None of a single one."""
    count = min(QUARTILES, len(np.unique(shown)))
    return NaturalSpline(knots_at(shown, float(shown.min()), float(shown.max()), count)) if count > 1 else None


# Forms of T_s(u) over inputs that were shown, by the name of the option «curve»; the paper's cubic is none of them, nor
# is what goes through the levels' own values
TORQUE_FORMS: dict[str, Callable[[Array], "Form | None"]] = {"spline": natural_spline}


def torque_form(curve: str, shown: Array) -> "Form | None":
    """The form of T_s(u) that a user holds; None where it is the paper's."""
    return TORQUE_FORMS[curve](shown) if curve in TORQUE_FORMS else None


Form: TypeAlias = LegendreForm | Proportional | Sides | PerLevel


def above_rest(u: Array | float, u_range: Range) -> Array:
    """How far inputs are from rest to u_low, at most 1: what T_s has of its edge value there, shape of `u`."""
    at = np.asarray(u, dtype=np.float64)
    return np.clip(at / u_range[0], 0.0, 1.0) if u_range[0] > 0 else np.ones_like(at)


def curve(coefficients: tuple[float, ...], u: Array | float, u_range: Range) -> Array:
    """A polynomial, lowest power first, with its edge values outside the identified range, shape of `u`."""
    return np.asarray(polyval(np.clip(u, *u_range), coefficients))


def cubic(name: str, coefficients: tuple[float, ...]) -> CubicPiece:
    """A polynomial as the piece that holds from 0 on; DataError where it has more coefficients than Eq. (7)."""
    if len(coefficients) > 4:
        raise DataError(f"nonlinear.{name} has {len(coefficients)} coefficients; a plant takes 1 to 4")
    c0, c1, c2, c3 = [*map(float, coefficients), 0.0, 0.0, 0.0, 0.0][:4]
    return 0.0, c0, c1, c2, c3


def pieces_through(points: KnownPoints) -> Pieces:
    """Cubics through some values with a slope that does not jump, and no overshoot between two (Fritsch, Carlson); a
    constant through one."""
    inputs, values = np.array(points).T
    if len(inputs) == 1:
        return (cubic("Ts_through", (float(values[0]),)),)
    from scipy.interpolate import PchipInterpolator

    found = PchipInterpolator(inputs, values)
    rows = zip(found.x[:-1].tolist(), found.c[::-1].T.tolist(), strict=True)
    return tuple((at, c0, c1, c2, c3) for at, (c0, c1, c2, c3) in rows)


def refuse_unordered(points: KnownPoints) -> None:
    """`ValueError` where the inputs of some values do not rise."""
    if any(a >= b for (a, _), (b, _) in itertools.pairwise(points)):
        raise ValueError("the inputs of Ts_through have to rise")


def piecewise(pieces: Pieces, u: Array | float, u_range: Range, order: int = 0) -> Array:
    """A row of cubics, or its derivative, with edge values outside the identified range, shape of `u`."""
    table, inside = np.array(pieces).T, np.clip(u, *u_range)
    k = np.maximum(np.searchsorted(table[0], inside, side="right") - 1, 0)
    return np.asarray(polyval(inside - table[0, k], polyder(table[1:], order)[:, k], tensor=False))


def terms(u: Array | float, count: int, u_range: Range) -> Array:
    """Derivatives of a polynomial by its coefficients of u/100, which covariances are of, (n, count); those of u follow
    by `scales`. Edge values outside the identified range."""
    return np.vander(np.atleast_1d(np.clip(u, *u_range)) / 100, count, increasing=True)


def scales(count: int) -> Array:
    """Coefficients of u/100 over those of u, (count,)."""
    return np.asarray(100.0 ** np.arange(count))
