"""A polynomial through the logarithms of levels' values, min Σ_l (θ_l − ln p(u_l))²/V_l, and how it answers to them."""

from dataclasses import dataclass

import numpy as np

from eaid.arrays import Array, scaled_inverse
from eaid.estimate.coefficients import powers

ROUNDING = 1e-15
"""Part of the sum of squares that its rounding may be."""


@dataclass(frozen=True, eq=False)
class LogPolynomial:
    """A polynomial of u/100."""

    coefficients: Array
    """Lowest power first, (p,)."""
    gains: Array
    """How the coefficients answer to the levels' logarithms, (p, L)."""
    chi_square: float
    """Σ (θ_l − ln p(u_l))²/V_l."""

    def log_at(self, u: Array) -> Array:
        """ln p(u)."""
        return np.log(np.maximum(powers(u, len(self.coefficients)) @ self.coefficients, 1e-6))

    def left_out(self, u: Array, log_values: Array) -> Array:
        """ln p(u_l) − θ_l if the level were left out, residual/(1 − h) with h its own say in the curve, (L,)."""
        design = powers(u, len(self.coefficients))
        own = np.einsum("lp,pl->l", design / (design @ self.coefficients)[:, None], self.gains)
        return np.asarray((self.log_at(u) - log_values) / np.maximum(1 - own, 1e-9))


def through(u: Array, log_values: Array, variance: Array, p: int) -> LogPolynomial:
    """The polynomial of p terms; needs L ≥ p. Gauss–Newton, halving a step that does not help."""
    design = powers(u, p)
    weight = 1 / np.sqrt(np.maximum(variance, 1e-18))
    values = np.exp(log_values)
    if not np.isfinite(design * (weight / values)[:, None]).all():
        raise np.linalg.LinAlgError("a level's value is zero or without end")
    c = np.asarray(np.linalg.lstsq(design * (weight / values)[:, None], weight, rcond=None)[0], dtype=np.float64)
    if (design @ c <= 0).any():
        c = np.zeros(p)
        c[0] = np.exp(np.average(log_values, weights=weight**2))

    def residual(c: Array) -> Array:
        return np.asarray(weight * (log_values - np.log(np.maximum(design @ c, 1e-300))))

    left = residual(c)
    for _ in range(100):
        J = design * (weight / (design @ c))[:, None]
        step = np.linalg.lstsq(J, left, rcond=None)[0]
        least = max(float(left @ left), ROUNDING * float(np.sum(weight**2 * (1 + log_values**2))))
        if np.sum((J @ step) ** 2) <= ROUNDING * least:
            break
        lengths = (0.5**k for k in range(30))
        length = next((k for k in lengths if residual(c + k * step) @ residual(c + k * step) <= left @ left), 0.0)
        if length == 0.0:
            break
        c, left = c + length * step, residual(c + length * step)
    g = design / (design @ c)[:, None] * weight[:, None]
    return LogPolynomial(c, scaled_inverse(g.T @ g) @ (g * weight[:, None]).T, float(left @ left))
