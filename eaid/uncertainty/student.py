"""Quantiles of Student's t: what multiplies a standard deviation to make a 95 % interval."""

import math

from scipy.special import stdtrit

NOMINAL = 0.95
"""Coverage that every interval of eaid claims."""


def t_quantile(degrees: float, nominal: float = NOMINAL) -> float:
    """Two-sided quantile of Student's t [1]; infinite degrees of freedom give the normal one."""
    if degrees <= 0:
        return math.inf
    return float(stdtrit(min(degrees, 1e6), 0.5 + nominal / 2))
