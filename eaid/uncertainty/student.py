"""Quantiles of Student's t, and how many degrees of freedom a sum of variances has."""

import math
from dataclasses import dataclass
from typing import TypeAlias, overload

import numpy as np

from eaid.arrays import Array
from eaid.uncertainty.tails import t_reach

NOMINAL = 0.95
"""Coverage that every interval of eaid claims."""

Degrees: TypeAlias = dict[str, "float | Array"]
"""Degrees of freedom by parameter; arrays have one entry a level."""


@overload
def t_quantile(degrees: float, nominal: float = NOMINAL) -> float: ...
@overload
def t_quantile(degrees: Array, nominal: float = NOMINAL) -> Array: ...
def t_quantile(degrees: float | Array, nominal: float = NOMINAL) -> float | Array:
    """Two-sided quantile of Student's t [1]; infinite degrees of freedom give the normal one, none give infinity."""
    if isinstance(degrees, np.ndarray):
        return np.where(degrees > 0, t_reach(np.clip(degrees, 1e-3, 1e6), nominal), np.inf)
    if degrees <= 0:
        return math.inf
    return t_reach(min(degrees, 1e6), nominal)


def middle(degrees: float | Array) -> float:
    """One number for the degrees of freedom of a curve: their median over the levels."""
    return float(np.median(degrees))


@dataclass(frozen=True, eq=False)
class Worth:
    """What the variances of levels are made of, V_l = e_l Σ_m w_lm χ²_m/ν_m, to count the degrees of their sums."""

    expected: Array
    """e: variance that one scatter for all levels gives, shape (L,)."""
    mixed: Array
    """w: how much level m counts for level l, rows of sum 1, shape (L, L)."""
    own: Array
    """ν: degrees of freedom of each level's own runs, shape (L,)."""

    def degrees(self, squares: Array) -> Array:
        """Satterthwaite's degrees of freedom of Σ_l s_l V_l, for rows s of `squares`, shape (n, L); shape (n,)."""
        known = np.isfinite(self.expected)
        parts = (squares * np.where(known, self.expected, 0.0)) @ self.mixed
        spread = (parts**2 / np.where(self.own > 0, self.own, np.inf)).sum(axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            found = parts.sum(axis=1) ** 2 / spread
        return np.asarray(np.where(spread > 0, found, self.own.sum()))
