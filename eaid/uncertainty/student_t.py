"""Intervals by Student's t, and how many degrees of freedom a sum of variances has (Satterthwaite)."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias, overload

import numpy as np
from scipy.special import stdtrit

from eaid.arrays import Array
from eaid.results.common import Interval

NOMINAL = 0.95
"""Coverage that every interval of eaid claims."""

FARTHEST = 50.0
"""Logarithm beyond which an end is none."""

Degrees: TypeAlias = dict[str, "float | Array"]
"""Degrees of freedom by parameter; arrays have one entry a level."""


@overload
def t_quantile(degrees: float, nominal: float = NOMINAL) -> float: ...
@overload
def t_quantile(degrees: Array, nominal: float = NOMINAL) -> Array: ...
def t_quantile(degrees: float | Array, nominal: float = NOMINAL) -> float | Array:
    """Two-sided quantile of Student's t; infinite degrees of freedom give the normal one, none give infinity."""
    many = np.asarray(degrees, dtype=np.float64)
    t = np.where(many > 0, stdtrit(np.clip(many, 1e-3, 1e12), (1 + nominal) / 2), np.inf)
    return t if isinstance(degrees, np.ndarray) else float(t)


def interval_of(value: float, variance: float, degrees: float) -> tuple[float, float]:
    """value ± t √V."""
    reach = t_quantile(degrees) * float(np.sqrt(variance))
    return value - reach, value + reach


def log_interval_of(value: float | None, variance: float, degrees: float) -> Interval:
    """value · exp(±t √V), V of the logarithm; None of what is not above 0, or where the interval has no end."""
    if value is None or value <= 0:
        return None
    reach = t_quantile(degrees) * float(np.sqrt(variance))
    return (value * float(np.exp(-reach)), value * float(np.exp(reach))) if reach < FARTHEST else None


def satterthwaite(parts: Sequence[Array | float], degrees: Sequence[Array | float]) -> Array:
    """Degrees of freedom of the sum of independent variances: (Σ v)²/Σ(v²/ν), elementwise."""
    spread = sum(np.square(v) / df for v, df in zip(parts, degrees, strict=True))
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.square(sum(parts)) / spread)


@dataclass(frozen=True, eq=False)
class VarianceComponents:
    """What the variances of levels are made of, V_l = e_l Σ_m w_lm χ²_m/ν_m, to count the degrees of their sums."""

    expected: Array
    """e: variance that one scatter for all levels gives, shape (L,)."""
    weights: Array
    """w: how much level m counts for level l, rows of sum 1, shape (L, L)."""
    own_degrees: Array
    """ν: degrees of freedom of each level's own runs, shape (L,)."""

    def degrees(self, squares: Array) -> Array:
        """Satterthwaite's degrees of freedom of Σ_l s_l V_l, for rows s of `squares`, shape (n, L); shape (n,)."""
        finite = np.isfinite(self.expected)
        parts = (squares * np.where(finite, self.expected, 0.0)) @ self.weights
        spread = (parts**2 / np.where(self.own_degrees > 0, self.own_degrees, np.inf)).sum(axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            degrees = parts.sum(axis=1) ** 2 / spread
        return np.asarray(np.where(spread > 0, degrees, self.own_degrees.sum()))
