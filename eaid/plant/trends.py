"""Trends of fitted values over stress or speed, specification 3: a line, a sum of two exponentials, and what it becomes
when its two rates merge.

linear: slope·x + offset. double-exponential: p e^(r1 x) + q e^(r2 x). merged-exponential: (p + q x) e^(r x), the limit
of the second for r2 → r1, where two huge weights of opposite sign would otherwise be printed.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from eaid.arrays import Array


def straight_line(c: Array, x: Array) -> Array:
    """slope·x + offset, `c` = [slope, offset], shape of `x`."""
    return np.asarray(c[0] * x + c[1])


def line_gradient(c: Array, x: Array) -> Array:
    """Derivatives by slope and offset, shape (2, n)."""
    return np.stack([x + 0 * c[0], np.ones_like(x) + 0 * c[0]])


def double(c: Array, x: Array) -> Array:
    """p e^(r1 x) + q e^(r2 x), `c` = [p, r1, q, r2], shape of `x`."""
    return np.asarray(c[0] * np.exp(c[1] * x) + c[2] * np.exp(c[3] * x))


def double_gradient(c: Array, x: Array) -> Array:
    """Derivatives by p, r1, q, r2, shape (4, n)."""
    e1, e2 = np.exp(c[1] * x), np.exp(c[3] * x)
    return np.stack([e1, c[0] * x * e1, e2, c[2] * x * e2])


def merged_exponential(c: Array, x: Array) -> Array:
    """(p + q x) e^(r x), `c` = [p, q, r], shape of `x`."""
    return np.asarray((c[0] + c[1] * x) * np.exp(c[2] * x))


def merged_gradient(c: Array, x: Array) -> Array:
    """Derivatives by p, q, r, shape (3, n)."""
    e = np.exp(c[2] * x)
    return np.stack([e, x * e, (c[0] + c[1] * x) * x * e])


@dataclass(frozen=True)
class TrendCurve:
    """One form of trend: its curve, and its derivatives."""

    curve: Callable[[Array, Array], Array]
    gradient: Callable[[Array, Array], Array]
    coefficients: tuple[str, ...]


FORMS: dict[str, TrendCurve] = {
    "linear": TrendCurve(straight_line, line_gradient, ("slope", "offset")),
    "double-exponential": TrendCurve(double, double_gradient, ("p", "r1", "q", "r2")),
    "merged-exponential": TrendCurve(merged_exponential, merged_gradient, ("p", "q", "r")),
}


def evaluate(form: str, coefficients: tuple[float, ...], x: Array) -> Array:
    """A trend's values, shape of `x`."""
    return FORMS[form].curve(np.array(coefficients), x)
