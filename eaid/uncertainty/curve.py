"""Curves over the duty: polynomials whose logarithms pass through the levels' log values by weighted least squares.

Minimise Σ_l (θ̂_l − log p(u_l))² / V_l over the coefficients of p. With g = ∂ log p/∂coefficients the coefficients have
the covariance (Σ g g'/V)⁻¹, inflated where the levels lie off the curve by more than their V.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import fdtri

from eaid.arrays import Array
from eaid.uncertainty.scatter import paule_mandel
from eaid.uncertainty.student import t_quantile


@dataclass(frozen=True, eq=False)
class Curve:
    """One polynomial of u/100 through the logarithms of the levels' values."""

    coefficients: Array
    """Of (u/100 %)^k, lowest power first, shape (p,)."""
    covariance: Array
    """Of those coefficients, inflation included, shape (p, p)."""
    degrees: float
    """Degrees of freedom of the covariance."""
    misfit: float
    """Σ res²/V/(L − p): about 1 where the polynomial follows the levels; NaN where L = p."""
    between: float
    """a, run-to-run variance of a single run, where it was found from the curve itself; NaN otherwise."""

    def at(self, duty_pct: Array) -> Array:
        """Value of the polynomial, shape of `duty_pct`."""
        return powers(duty_pct, len(self.coefficients)) @ self.coefficients

    def log_sd(self, duty_pct: Array) -> Array:
        """Standard deviation of log p(u), shape of `duty_pct`."""
        g = powers(duty_pct, len(self.coefficients)) / self.at(duty_pct)[:, None]
        return np.asarray(np.sqrt(np.einsum("ij,jk,ik->i", g, self.covariance, g)))

    def band(self, duty_pct: Array) -> Array:
        """95 % interval of p(u), shape (n, 2)."""
        reach = t_quantile(self.degrees) * self.log_sd(duty_pct)
        return np.asarray(self.at(duty_pct)[:, None] * np.exp(np.stack([-reach, reach], axis=1)))


def powers(duty_pct: Array, p: int) -> Array:
    """1, v, v² … of v = u/100, shape (n, p)."""
    return np.asarray(np.vander(np.asarray(duty_pct, dtype=np.float64) / 100, p, increasing=True))


def through(duty_pct: Array, log_values: Array, variance: Array, p: int) -> Array:
    """Coefficients of (u/100)^k of the polynomial of p terms whose logarithm fits best, shape (p,); needs L ≥ p.

    Gauss–Newton from the weighted fit of the values themselves, halving a step that does not help.
    """
    design = powers(duty_pct, p)
    weight = 1 / np.sqrt(np.maximum(variance, 1e-18))
    values = np.exp(log_values)
    if not np.isfinite(design * (weight / values)[:, None]).all():
        raise np.linalg.LinAlgError("a level's value is zero or without end")
    coefficients = np.asarray(
        np.linalg.lstsq(design * (weight / values)[:, None], weight, rcond=None)[0], dtype=np.float64
    )
    if (design @ coefficients <= 0).any():
        coefficients = np.zeros(p)
        coefficients[0] = np.exp(np.average(log_values, weights=weight**2))

    def residual(c: Array) -> Array | None:
        now = design @ c
        return np.asarray(weight * (log_values - np.log(now))) if (now > 0).all() else None

    left = residual(coefficients)
    assert left is not None
    for _ in range(100):
        step = np.linalg.lstsq(design * (weight / (design @ coefficients))[:, None], left, rcond=None)[0]
        for halving in range(30):
            trial = residual(coefficients + step / 2**halving)
            if trial is not None and trial @ trial <= left @ left:
                break
        else:
            break
        gained = left @ left - trial @ trial
        coefficients, left = coefficients + step / 2**halving, trial
        if gained <= 1e-14 * (trial @ trial):
            break
    return np.asarray(coefficients)


def information(duty_pct: Array, variance: Array, coefficients: Array) -> Array:
    """Σ g g'/V with g = ∂ log p/∂coefficients, shape (p, p)."""
    design = powers(duty_pct, len(coefficients))
    g = design / (design @ coefficients)[:, None]
    return np.asarray((g / np.maximum(variance, 1e-18)[:, None]).T @ g)


def curve_with_repeats(duty_pct: Array, log_values: Array, variance: Array, degrees: float, p: int) -> Curve:
    """The curve where V is known from repeats, with the degrees of freedom of V."""
    coefficients = through(duty_pct, log_values, variance, p)
    covariance = _inverse(information(duty_pct, variance, coefficients))
    spare = len(duty_pct) - p
    if spare == 0:
        return Curve(coefficients, covariance, degrees, np.nan, np.nan)
    misfit = _chi_square(duty_pct, log_values, variance, coefficients) / spare
    return Curve(coefficients, covariance * inflation(misfit, spare, degrees), degrees, misfit, np.nan)


def inflation(misfit: float, spare: float, degrees: float) -> float:
    """What the covariance is multiplied by where the levels lie off the curve by `misfit` = Σ res²/V/spare.

    Beyond chance (one in a thousand) the curve is wrong, and its misfit counts whole. Within chance it is one more
    estimate of the levels' variance, of `spare` degrees of freedom beside the scatter's own.
    """
    if misfit > float(fdtri(spare, max(degrees / 2, 1.0), 0.999)):
        return misfit
    return max(1.0, (degrees + spare * misfit) / (degrees + spare))


def curve_of_single_runs(duty_pct: Array, log_values: Array, within: Array, p: int) -> Curve:
    """The curve where each level has one run: its scatter a makes Σ res²/(a + h) equal L − p; needs L > p."""
    spare = len(duty_pct) - p
    state = {"c": through(duty_pct, log_values, within + 1e-4, p)}

    def total(a: float) -> float:
        state["c"] = through(duty_pct, log_values, within + a, p)
        return _chi_square(duty_pct, log_values, within + a, state["c"])

    between, q = paule_mandel(total, float(spare), float(np.var(log_values)) + 1e-12)
    # h is the largest over the windows, q the luck of L − p levels: where they differ, halfway (in logs) is closest
    variance = np.sqrt(q) * (between + within)
    coefficients = through(duty_pct, log_values, variance, p)
    covariance = _inverse(information(duty_pct, variance, coefficients))
    return Curve(coefficients, covariance, float(spare), 1.0, between)


def _inverse(matrix: Array) -> Array:
    """Inverse in scaled form: its condition is that of the correlations, not of the units."""
    scale = 1 / np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    inverse = np.linalg.pinv(matrix * np.outer(scale, scale), rcond=1e-13, hermitian=True)
    return np.asarray(scale[:, None] * inverse * scale)


def _chi_square(duty_pct: Array, log_values: Array, variance: Array, coefficients: Array) -> float:
    left = log_values - np.log(powers(duty_pct, len(coefficients)) @ coefficients)
    return float((left**2 / np.maximum(variance, 1e-18)).sum())


def covariance_between(
    duty_pct: Array, curves: Sequence[Curve], variance: Sequence[Array], correlation: Array
) -> Array:
    """Covariance of all curves' coefficients together, from the correlation of their scatter, shape (Σp, Σp).

    Coefficients are linear in the levels' logarithms, δc_k = (Σ g g'/V_k)⁻¹ Σ_l g_l/V_kl δθ_kl, and the scatter of two
    parameters at one level has the covariance ρ √(V_kl V_ml). A level that says nothing of a parameter has V = ∞ there.
    """
    gains = []
    for curve, v in zip(curves, variance, strict=True):
        free = np.diag(curve.covariance) > 0
        if not free.any():
            gains.append(np.zeros((len(free), len(duty_pct))))
            continue
        design = powers(duty_pct, len(curve.coefficients))
        g = (design / (design @ curve.coefficients)[:, None])[:, free]
        scaled = g / np.sqrt(np.maximum(v, 1e-18))[:, None]
        root = _inverse(scaled.T @ scaled) @ scaled.T
        inflation = np.trace(curve.covariance) / max(np.trace(root @ root.T), 1e-300)
        full = np.zeros((len(free), len(duty_pct)))
        full[free] = np.sqrt(inflation) * root
        gains.append(full)
    return np.block([[correlation[i, j] * gains[i] @ gains[j].T for j in range(len(gains))] for i in range(len(gains))])
