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


def double(c: Array, x: Array) -> Array:
    """p e^(r1 x) + q e^(r2 x), `c` = [p, r1, q, r2], shape of `x`."""
    return np.asarray(c[0] * np.exp(c[1] * x) + c[2] * np.exp(c[3] * x))


def merged_exponential(c: Array, x: Array) -> Array:
    """(p + q x) e^(r x), `c` = [p, q, r], shape of `x`."""
    return np.asarray((c[0] + c[1] * x) * np.exp(c[2] * x))


@dataclass(frozen=True)
class TrendCurve:
    """One form of trend."""

    curve: Callable[[Array, Array], Array]
    coefficients: tuple[str, ...]


FORMS: dict[str, TrendCurve] = {
    "linear": TrendCurve(straight_line, ("slope", "offset")),
    "double-exponential": TrendCurve(double, ("p", "r1", "q", "r2")),
    "merged-exponential": TrendCurve(merged_exponential, ("p", "q", "r")),
}


def evaluate(form: str, coefficients: tuple[float, ...], x: Array) -> Array:
    """A trend's values, shape of `x`."""
    return FORMS[form].curve(np.array(coefficients), x)


def gradient(form: str, coefficients: Array, x: Array) -> Array:
    """Derivatives of a trend's values by its coefficients, exact by complex steps, (p, n)."""
    steps = 1e-30j * np.eye(len(coefficients))
    return np.array([FORMS[form].curve(coefficients + step, x).imag for step in steps]) / 1e-30
