"""Numbers in the precision of the target: the polynomial of 1 − e^(−x), and constants rounded to what the rig holds.

(1 − e^(−x))/x on 0…1: Taylor's series telescoped by Chebyshev polynomials, degree 13 in double (relative error
2e-16) and 6 in single precision (5e-9)
"""

from typing import Any, Literal

import numpy as np

from eaid.replay.lanes import telescoped

Precision = Literal["double", "single"]
DEGREE = {"double": 13, "single": 6}
"""Of P in 1 − e^(−x) = x P(x)."""


def series(precision: Precision) -> tuple[float, ...]:
    """Coefficients of P, lowest power first, as a double each."""
    return tuple(telescoped(DEGREE[precision]))


def rounded(value: Any, precision: Precision) -> Any:
    """A constant, or a NamedTuple of them, as the target holds it: floats stay, or become numpy.float32."""
    if isinstance(value, tuple):
        inner = [rounded(item, precision) for item in value]
        return type(value)(*inner) if hasattr(value, "_fields") else tuple(inner)
    if precision == "single" and isinstance(value, float):
        return np.float32(value)
    return value
