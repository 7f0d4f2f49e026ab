"""Curves over the duty: polynomials whose logarithms pass through the levels' log values by weighted least squares.

Minimise Σ_l (θ̂_l − log p(u_l))² / W_l over the coefficients of p. With g = ∂ log p/∂coefficients they answer to the
levels as δc = G δθ, G = (Σ g g'/W)⁻¹ g/W, and have the covariance G diag(V) G', V the levels' variance; W is what V
would be if all levels scattered alike. Where the levels lie off the curve by more than chance, it is inflated.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import fdtri

from eaid.arrays import Array, scaled_inverse
from eaid.uncertainty.runs import Mask, VarianceComponents, paule_mandel

SETTLED = 1e-10
"""Relative step at which a curve has settled: its place then does not depend on the rounding of the levels."""

ROUNDING = 1e-15
"""Part of the logarithms, and of the sum of squares, that their rounding may be."""


@dataclass(frozen=True, eq=False)
class Curve:
    """One polynomial of u/100 through the logarithms of the levels' values."""

    coefficients: Array
    """Of (u/100 %)^k, lowest power first, shape (p,)."""
    gains: Array
    """G: how the coefficients answer to the levels' logarithms, shape (p, L)."""
    sd: Array
    """Standard deviation of the levels' logarithms, inflation included, shape (L,)."""
    degrees: float
    """Degrees of freedom of `sd`, where `components` does not say more."""
    misfit: float
    """Σ res²/W/(L − p): about 1 where the polynomial follows the levels; NaN where L = p."""
    between: float
    """a, run-to-run variance of a single run, where it was found from the curve itself; NaN otherwise."""
    components: VarianceComponents | None = None
    """What the levels' variances are made of, where repeats say so."""

    @property
    def covariance(self) -> Array:
        """Of the coefficients, shape (p, p)."""
        root = self.gains * self.sd
        return np.asarray(root @ root.T)

    def at(self, duty_pct: Array) -> Array:
        """Value of the polynomial, shape of `duty_pct`."""
        return powers(duty_pct, len(self.coefficients)) @ self.coefficients

    def slopes(self, duty_pct: Array) -> Array:
        """∂ log p(u)/∂coefficients, shape (n, p)."""
        return np.asarray(powers(duty_pct, len(self.coefficients)) / self.at(duty_pct)[:, None])

    def _answers(self, duty_pct: Array) -> Array:
        """∂ log p(u)/∂ log of each level, shape (n, L)."""
        return np.asarray(self.slopes(duty_pct) @ self.gains)

    def log_sd(self, duty_pct: Array) -> Array:
        """Standard deviation of log p(u), shape of `duty_pct`."""
        return np.asarray(np.sqrt(((self._answers(duty_pct) * self.sd) ** 2).sum(axis=1)))

    def degrees_at(self, duty_pct: Array) -> Array:
        """Degrees of freedom of log p(u), shape of `duty_pct`: at an end few levels, so few runs, make the curve."""
        if self.components is None:
            return np.full(len(duty_pct), self.degrees)
        return self.components.degrees(self._answers(duty_pct) ** 2)


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
    rounding = (ROUNDING * np.linalg.norm(weight * (1 + np.abs(log_values)))) ** 2
    for _ in range(100):
        J = design * (weight / (design @ coefficients))[:, None]
        step = np.linalg.lstsq(J, left, rcond=None)[0]
        if np.sum((J @ step) ** 2) <= max(ROUNDING * (left @ left), rounding):
            break  # what the step would gain is lost in rounding
        for halving in range(30):
            trial = residual(coefficients + step / 2**halving)
            if trial is not None and trial @ trial <= left @ left:
                break
        else:
            break
        coefficients, left = coefficients + step / 2**halving, trial
        if np.abs(step).max() <= SETTLED * np.abs(coefficients).max():
            break
    return np.asarray(coefficients)


def _gains(duty_pct: Array, weigh: Array, coefficients: Array) -> Array:
    """G = (Σ g g'/W)⁻¹ g/W with g = ∂ log p/∂coefficients, shape (p, L)."""
    design = powers(duty_pct, len(coefficients))
    g = design / (design @ coefficients)[:, None]
    weighed = g / np.maximum(weigh, 1e-18)[:, None]
    return scaled_inverse(weighed.T @ g) @ weighed.T


def curve_with_repeats(
    duty_pct: Array, log_values: Array, weigh: Array, degrees: float, p: int, variance: Array | None = None
) -> Curve:
    """The curve where the scatter is known from repeats: weights 1/`weigh`; their V is `variance`, or the same."""
    coefficients = through(duty_pct, log_values, weigh, p)
    gains = _gains(duty_pct, weigh, coefficients)
    sd = np.sqrt(weigh if variance is None else variance)
    spare = len(duty_pct) - p
    if spare == 0:
        return Curve(coefficients, gains, sd, degrees, np.nan, np.nan)
    misfit = _chi_square(duty_pct, log_values, weigh, coefficients) / spare
    return Curve(coefficients, gains, sd * np.sqrt(inflation(misfit, spare, degrees)), degrees, misfit, np.nan)


def inflation(misfit: float, spare: float, degrees: float) -> float:
    """What variances are multiplied by where levels lie off a curve by `misfit` = Σ res²/W/spare: 1 within chance.

    Beyond chance (one in a thousand) the curve is wrong, and its misfit counts whole.
    """
    return misfit if misfit > fdtri(spare, max(degrees / 2, 1.0), 0.999) else 1.0


def curve_of_single_runs(duty_pct: Array, log_values: Array, within: Array, p: int) -> Curve:
    """The curve where each level has one run: its scatter a makes Σ res²/(a + h) equal L − p; needs L > p."""
    spare = len(duty_pct) - p

    def total(a: float) -> float:
        return _chi_square(duty_pct, log_values, within + a, through(duty_pct, log_values, within + a, p))

    between, q = paule_mandel(total, float(spare), float(np.var(log_values)) + 1e-12)
    # h is the largest over the windows, q the luck of L − p levels: where they differ, halfway (in logs) is closest
    variance = np.sqrt(q) * (between + within)
    coefficients = through(duty_pct, log_values, variance, p)
    gains = _gains(duty_pct, variance, coefficients)
    return Curve(coefficients, gains, np.sqrt(variance), float(spare), 1.0, between)


def at_levels(curve: Curve, row: Mask, p: int, components: VarianceComponents | None) -> Curve:
    """The curve through the levels of `row` as one over all levels, shape (L,), padded to p terms."""
    gains, sd = np.zeros((p, len(row))), np.zeros(len(row))
    gains[: len(curve.coefficients), row], sd[row] = curve.gains, curve.sd
    padded = np.zeros(p)
    padded[: len(curve.coefficients)] = curve.coefficients
    return replace(curve, coefficients=padded, gains=gains, sd=sd, components=components)


def _chi_square(duty_pct: Array, log_values: Array, variance: Array, coefficients: Array) -> float:
    left = log_values - np.log(powers(duty_pct, len(coefficients)) @ coefficients)
    return float((left**2 / np.maximum(variance, 1e-18)).sum())


def covariance_between(curves: Sequence[Curve], correlation: Array) -> Array:
    """Covariance of all curves' coefficients together, from the correlation of their scatter, shape (Σp, Σp).

    The scatter of two parameters at one level has the covariance ρ √(V_k V_m).
    """
    roots = [curve.gains * curve.sd for curve in curves]
    return np.block([[correlation[i, j] * a @ b.T for j, b in enumerate(roots)] for i, a in enumerate(roots)])
