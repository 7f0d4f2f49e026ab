"""Numbers in the precision of the target, and as its languages write them; heads and units that break no source.

(1 − e^(−x))/x on 0…1: Taylor's series telescoped by Chebyshev polynomials, degree 13 in double (relative error
2e-16) and 6 in single precision (5e-9)
"""

import math
import re
from fractions import Fraction
from typing import Any, Literal

import numpy as np
from numpy.polynomial import Polynomial
from numpy.polynomial.chebyshev import cheb2poly, chebadd, chebmulx
from numpy.polynomial.polynomial import polyval

Precision = Literal["double", "single"]
DEGREE = {"double": 13, "single": 6}
"""Of P in 1 − e^(−x) = x P(x)."""


def series(precision: Precision) -> tuple[float, ...]:
    """Coefficients of P, lowest power first, as a double each: Taylor's series, written in the Chebyshev polynomials
    T_n(2x − 1) and cut after the degree; in exact fractions, rounded once."""
    taylor = [Fraction((-1) ** n, math.factorial(n + 1)) for n in range(26)]
    x, y = Polynomial([Fraction(1, 2), Fraction(1, 2)]), Polynomial([Fraction(-1), Fraction(2)])  # y = 2x − 1
    in_y: Any = polyval(x, taylor)  # a polynomial of a polynomial is one
    chebyshev: Any = [Fraction(0)]
    for coefficient in in_y.coef[::-1]:
        chebyshev = chebadd(chebmulx(chebyshev), [coefficient])
    in_x: Any = polyval(y, cheb2poly(chebyshev[: DEGREE[precision] + 1]))
    return tuple(float(value) for value in in_x.coef)


def rounded(value: Any, precision: Precision) -> Any:
    """A constant, or a NamedTuple of them, as the target holds it: floats stay, or become numpy.float32."""
    if isinstance(value, tuple):
        inner = [rounded(item, precision) for item in value]
        return type(value)(*inner) if hasattr(value, "_fields") else tuple(inner)
    if precision == "single" and isinstance(value, float):
        return np.float32(value)
    return value


def hexadecimal(value: Any) -> str:
    """A C99 hex float, exact: float for a numpy.float32, double for a float; integers as unsigned."""
    if isinstance(value, int):
        return f"{value}U"
    suffix = "F" if isinstance(value, np.float32) else ""
    number = float(value)
    if math.isnan(number):
        return "EAID_NAN"
    if math.isinf(number):
        return "EAID_INF" if number > 0 else "-EAID_INF"
    mantissa, exponent = number.hex().split("p")
    head, _, rest = mantissa.partition(".")
    rest = rest.rstrip("0")
    return f"{head}.{rest or '0'}p{exponent}{suffix}"


def decimal(value: Any) -> str:
    """The shortest decimal that gives the number back, always with a point: YAML and C both take it for a real one."""
    if isinstance(value, int):
        return str(value)
    number = float(value)
    text = str(value) if isinstance(value, np.float32) else repr(number)
    if not math.isfinite(number):
        return {"nan": "NaN", "inf": "Inf", "-inf": "-Inf"}[text]
    mantissa, mark, exponent = text.partition("e")
    return f"{mantissa if '.' in mantissa else mantissa + '.0'}{mark}{exponent}"


def commented(lines: list[str], before: str) -> str:
    """The head's lines behind a comment mark; nothing in them can end the comment."""
    return "\n".join((before + harmless(line)).rstrip() for line in lines)


def harmless(text: str) -> str:
    """A text of one line that ends no comment and goes on to no next line, whatever a file or a unit is called."""
    return " ".join(text.split()).replace("*/", "* /").replace("/*", "/ *").rstrip("\\ ")


def unit_name(text: str) -> str:
    """A unit as any language may hold it: one short word, no quotes."""
    return harmless(re.sub(r"[\"'\\{}<>]", "", text))[:20] or "1"
