"""Trends of fitted values over stress or speed, SPEC §3: a line, a sum of two exponentials, and what it becomes
when its two rates merge.

linear: slope·x + offset. double-exponential: p e^(r1 x) + q e^(r2 x). merged-exponential: (p + q x) e^(r x), the limit
of the second for r2 → r1, where two huge weights of opposite sign would otherwise be printed.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from eaid.arrays import Array


def line(c: Array, x: Array) -> Array:
    """slope·x + offset, `c` = [slope, offset], shape of `x`."""
    return np.asarray(c[0] * x + c[1])


def line_gradient(c: Array, x: Array) -> Array:
    """Derivatives by slope and offset, shape (2, n)."""
    return np.stack([x + 0 * c[0], np.ones_like(x) + 0 * c[0]])


def line_guess(x: Array, y: Array) -> Array:
    """The least-squares line, [slope, offset]."""
    return np.asarray(np.linalg.lstsq(np.stack([x, np.ones_like(x)], axis=1), y, rcond=None)[0])


def double(c: Array, x: Array) -> Array:
    """p e^(r1 x) + q e^(r2 x), `c` = [p, r1, q, r2], shape of `x`."""
    return np.asarray(c[0] * np.exp(c[1] * x) + c[2] * np.exp(c[3] * x))


def double_gradient(c: Array, x: Array) -> Array:
    """Derivatives by p, r1, q, r2, shape (4, n)."""
    e1, e2 = np.exp(c[1] * x), np.exp(c[3] * x)
    return np.stack([e1, c[0] * x * e1, e2, c[2] * x * e2])


def double_guess(x: Array, y: Array) -> Array:
    """Best pair of rates on a grid, p and q by a linear solve, [p, r1, q, r2]."""
    return double_guesses(x, y, 1)[0]


def double_guesses(x: Array, y: Array, most: int) -> list[Array]:
    """The best few pairs of rates on a grid, neighbours of a better one left out, each [p, r1, q, r2]."""
    rates = rate_grid(x)
    basis = np.exp(np.multiply.outer(rates, x))
    basis /= np.linalg.norm(basis, axis=1)[:, None]
    n = len(rates)
    gram, along = basis @ basis.T, basis @ y
    first, second = np.triu_indices(n, 1)
    g, a, b = gram[first, second], along[first], along[second]
    gain = (a * a + b * b - 2 * g * a * b) / np.maximum(1 - g * g, 1e-12)
    grid = np.full((n, n), -np.inf)
    grid[first, second] = gain
    found: list[Array] = []
    for _ in range(most):
        i, j = np.unravel_index(grid.argmax(), grid.shape)
        design = np.exp(np.multiply.outer(x, rates[[i, j]]))
        p, q = np.linalg.lstsq(design, y, rcond=None)[0]
        found.append(np.array([p, rates[i], q, rates[j]]))
        grid[max(i - 3, 0) : i + 4, max(j - 3, 0) : j + 4] = -np.inf
    return found


def merged(c: Array, x: Array) -> Array:
    """(p + q x) e^(r x), `c` = [p, q, r], shape of `x`."""
    return np.asarray((c[0] + c[1] * x) * np.exp(c[2] * x))


def merged_gradient(c: Array, x: Array) -> Array:
    """Derivatives by p, q, r, shape (3, n)."""
    e = np.exp(c[2] * x)
    return np.stack([e, x * e, (c[0] + c[1] * x) * x * e])


def merged_guess(x: Array, y: Array) -> Array:
    """Best rate on a grid, p and q by a linear solve, [p, q, r]."""
    best: tuple[float, Array] | None = None
    for rate in rate_grid(x):
        e = np.exp(rate * (x - x[0]))
        design = np.stack([e, x * e], axis=1)
        p, q = np.linalg.lstsq(design, y, rcond=None)[0]
        left = float(np.sum((design @ np.array([p, q]) - y) ** 2))
        if best is None or left < best[0]:
            back = np.exp(-rate * x[0])
            best = (left, np.array([p * back, q * back, rate]))
    assert best is not None
    return best[1]


STEEPEST = 40.0
"""Rates are looked for up to this many e-folds over the range of x; steeper ones live between two points."""


def rate_grid(x: Array) -> Array:
    """Rates to try, from −40 to 15 e-folds over the range of x, denser about zero, falling, shape (61,)."""
    return np.sinh(np.linspace(np.arcsinh(15.0), -np.arcsinh(STEEPEST), 61)) / float(np.ptp(x))


@dataclass(frozen=True)
class Form:
    """One form of trend: its curve, the derivatives of it, a first guess."""

    curve: Callable[[Array, Array], Array]
    gradient: Callable[[Array, Array], Array]
    guess: Callable[[Array, Array], Array]
    coefficients: tuple[str, ...]


FORMS: dict[str, Form] = {
    "linear": Form(line, line_gradient, line_guess, ("slope", "offset")),
    "double-exponential": Form(double, double_gradient, double_guess, ("p", "r1", "q", "r2")),
    "merged-exponential": Form(merged, merged_gradient, merged_guess, ("p", "q", "r")),
}


def evaluate(form: str, coefficients: tuple[float, ...], x: Array) -> Array:
    """A trend's values, shape of `x`."""
    return FORMS[form].curve(np.array(coefficients), x)
