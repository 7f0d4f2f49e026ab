"""Quantiles of Student's t, and how many degrees of freedom a sum of variances has."""

import math
from dataclasses import dataclass
from typing import Any, TypeAlias, overload

import numpy as np

from eaid.arrays import Array, median
from eaid.uncertainty.tails import t_reach

NOMINAL = 0.95
"""Coverage that every interval of eaid claims."""

Degrees: TypeAlias = dict[str, "float | Array"]
"""Degrees of freedom by parameter; arrays have one entry a level."""

LOG_T = (
    1.533874183165565,
    0.9401080094822627,
    0.07414875203239332,
    -0.005719475081384529,
    -0.0005049495306879272,
    0.0001982094781428299,
    -1.044457541221147e-05,
    -4.693300023845971e-06,
    7.679067026736609e-07,
    1.23501563797806e-07,
    -4.732090133848803e-08,
    -3.589356186244733e-09,
    5.159138563806107e-09,
    -1.44139618855428e-09,
    1.537464820699065e-10,
    4.364067898301984e-11,
    -3.484642430769572e-11,
    1.590668320523021e-11,
    -5.940305531653764e-12,
    1.742715779109681e-12,
)
"""Chebyshev coefficients of log t(ν) of `NOMINAL` over 2/ν − 1, ν ≥ 1: to 4e-13; hundreds are needed in one fit."""


@overload
def t_quantile(degrees: float, nominal: float = NOMINAL) -> float: ...
@overload
def t_quantile(degrees: Array, nominal: float = NOMINAL) -> Array: ...
def t_quantile(degrees: float | Array, nominal: float = NOMINAL) -> float | Array:
    """Two-sided quantile of Student's t [1]; infinite degrees of freedom give the normal one, none give infinity."""
    if isinstance(degrees, np.ndarray):
        if nominal == NOMINAL and (degrees >= 1).all():
            return np.asarray(np.exp(_chebyshev(2 / degrees - 1)))
        return np.where(degrees > 0, t_reach(np.clip(degrees, 1e-3, 1e6), nominal), np.inf)
    if degrees <= 0:
        return math.inf
    if nominal == NOMINAL and degrees >= 1:
        return math.exp(float(_chebyshev(2 / degrees - 1)))
    return t_reach(min(degrees, 1e6), nominal)


def _chebyshev(x: Any) -> Any:
    """Clenshaw's sum of `LOG_T` at x."""
    last = before = 0.0 * x
    for c in LOG_T[:0:-1]:
        last, before = 2 * x * last - before + c, last
    return x * last - before + LOG_T[0]


def middle(degrees: float | Array) -> float:
    """One number for the degrees of freedom of a curve: their median over the levels."""
    return median(degrees)


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
