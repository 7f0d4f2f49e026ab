"""Tails and quantiles of the F distribution and of Student's t, in a page of `math`.

The upper tail of F is an incomplete beta function, P(F > x) = I_w(d2/2, d1/2) with w = d2 / (d2 + d1 x), by its
continued fraction (DLMF 8.17.22). A quantile is its inverse, by Newton steps in log x on the log of the smaller tail,
which is concave. They agree with `scipy.special` to about 1e-12 for up to a million degrees of freedom; importing that
instead takes 0.1 s, more than all the intervals of a fit.
"""

import math
from collections.abc import Callable
from typing import overload

import numpy as np
from numpy.typing import ArrayLike

from eaid.arrays import Array


def _stirling(x: float) -> float:
    """What Stirling's formula for log Γ lacks, for x ≥ 10 (DLMF 5.11.1)."""
    z = 1 / (x * x)
    return (1 / 12 - z * (1 / 360 - z * (1 / 1260 - z * (1 / 1680 - z * (1 / 1188 - z * 691 / 360360))))) / x


def log_beta(a: float, b: float) -> float:
    """log B(a, b) for a, b > 0, without the cancellation of large log Γ."""
    p, q = min(a, b), max(a, b)
    if q < 10:
        return math.lgamma(p) + math.lgamma(q) - math.lgamma(p + q)
    rest = _stirling(q) - _stirling(p + q)
    if p < 10:
        return math.lgamma(p) + rest + p - p * math.log(p + q) + (q - 0.5) * math.log1p(-p / (p + q))
    # log(p / (p + q)) and log(q / (p + q)), each from what is small
    return (
        0.5 * math.log(2 * math.pi / q)
        + _stirling(p)
        + rest
        + (p - 0.5) * math.log(p / (p + q))
        + q * math.log1p(-p / (p + q))
    )


def _fraction(a: float, b: float, x: float) -> float:
    """The continued fraction of I_x(a, b) by the modified Lentz method; quick for x < (a + 1) / (a + b + 2)."""
    tiny = 1e-300
    f, c, d = 1.0, 1.0, 0.0
    for k in range(1, 20_000):
        m = k // 2
        if k % 2:
            term = -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1))
        else:
            term = m * (b - m) * x / ((a + 2 * m - 1) * (a + 2 * m))
        d = 1 / ((1 + term * d) or tiny)
        c = (1 + term / c) or tiny
        f *= c * d
        if abs(c * d - 1) < 1e-16:
            break
    return 1 / f


def _log_tails(d1: float, d2: float, s: float) -> tuple[float, float, float]:
    """Logs of P(F < e^s), of P(F > e^s), and of the density over s."""
    a, b = d2 / 2, d1 / 2
    odds = s + math.log(d1 / d2)  # log of (1 − w) / w
    log_w = -odds - math.log1p(math.exp(-odds)) if odds > 0 else -math.log1p(math.exp(odds))
    log_v = odds + log_w
    density = a * log_w + b * log_v - log_beta(a, b)
    w = math.exp(log_w)
    if w < (a + 1) / (a + b + 2):
        upper = min(density - math.log(a) + math.log(_fraction(a, b, w)), 0.0)
        return _log_rest(upper), upper, density
    lower = min(density - math.log(b) + math.log(_fraction(b, a, math.exp(log_v))), 0.0)
    return lower, _log_rest(lower), density


def _log_rest(log_p: float) -> float:
    """log(1 − p) from log p."""
    return math.log(-math.expm1(log_p)) if log_p < 0 else -math.inf


def _f_tail(d1: float, d2: float, x: float) -> float:
    if not (d1 > 0 and d2 > 0 and x >= 0):
        return math.nan
    if x == 0 or x == math.inf:
        return 1.0 if x == 0 else 0.0
    return math.exp(_log_tails(d1, d2, math.log(x))[1])


def _log_quantile(d1: float, d2: float, p: float) -> float:
    """log x with P(F < x) = p."""
    if not (d1 > 0 and d2 > 0 and 0 <= p <= 1):
        return math.nan
    if p in (0, 1):
        return -math.inf if p == 0 else math.inf
    above = p > 0.5
    wanted = math.log(1 - p if above else p)
    low, high = -math.inf, math.inf
    s = 0.0
    for _ in range(200):
        lower, upper, density = _log_tails(d1, d2, s)
        tail = upper if above else lower
        gap = tail - wanted
        if (gap > 0) == above:
            low = s
        else:
            high = s
        step = gap / math.exp(density - tail)
        to = s + min(max(step if above else -step, -1e6), 1e6)
        if not low <= to <= high:
            to = (low + high) / 2
        if abs(to - s) <= 1e-15 * max(1.0, abs(s)):
            return to
        s = to
    return s


def _exp(s: float) -> float:
    return math.exp(s) if not s > 709.78 else math.inf


def _f_quantile(d1: float, d2: float, p: float) -> float:
    return _exp(_log_quantile(d1, d2, p))


def _t_reach(degrees: float, nominal: float) -> float:
    return _exp(_log_quantile(1.0, degrees, nominal) / 2)


def _over(one: Callable[..., float], *given: ArrayLike) -> float | Array:
    if all(isinstance(value, int | float) for value in given):
        return one(*map(float, given))  # type: ignore[arg-type]
    return np.asarray(np.vectorize(one, otypes=[float])(*given))


@overload
def f_tail(d1: float, d2: float, x: float) -> float: ...
@overload
def f_tail(d1: ArrayLike, d2: ArrayLike, x: ArrayLike) -> Array: ...
def f_tail(d1: ArrayLike, d2: ArrayLike, x: ArrayLike) -> float | Array:
    """P(F > x) with d1 and d2 degrees of freedom, of numbers or of arrays that broadcast; NaN outside its domain."""
    return _over(_f_tail, d1, d2, x)


@overload
def f_quantile(d1: float, d2: float, p: float) -> float: ...
@overload
def f_quantile(d1: ArrayLike, d2: ArrayLike, p: ArrayLike) -> Array: ...
def f_quantile(d1: ArrayLike, d2: ArrayLike, p: ArrayLike) -> float | Array:
    """The x with P(F < x) = p, of numbers or of arrays that broadcast; NaN outside its domain."""
    return _over(_f_quantile, d1, d2, p)


@overload
def t_reach(degrees: float, nominal: float) -> float: ...
@overload
def t_reach(degrees: ArrayLike, nominal: ArrayLike) -> Array: ...
def t_reach(degrees: ArrayLike, nominal: ArrayLike) -> float | Array:
    """The t with P(|T| < t) = nominal, from t² ~ F(1, degrees)."""
    return _over(_t_reach, degrees, nominal)


def chi2_quantile(degrees: float, p: float) -> float:
    """The x with P(χ² < x) = p, right to 1e-6: F with 10⁸ degrees of freedom below it."""
    return degrees * _f_quantile(degrees, 1e8, p)


def trigamma(x: Array) -> Array:
    """ψ₁(x), the second derivative of log Γ, for x > 0: by recurrence to x ≥ 12, then its series (DLMF 5.15.8)."""
    x = np.array(x, dtype=np.float64)
    total = np.zeros_like(x)
    for _ in range(12):
        total += x**-2.0
        x += 1.0
    z = x**-2
    return np.asarray(total + 1 / x + z / 2 + z / x * (1 / 6 - z * (1 / 30 - z * (1 / 42 - z / 30))))
