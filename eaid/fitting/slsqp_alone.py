"""SciPy's compiled SLSQP and NNLS, without the rest of `scipy.optimize`.

`import scipy.optimize` loads 300 modules, linear programming, transforms and geometry among them, in 0.2 s; a fit needs
two functions of one extension module. For versions of SciPy whose calls are known, that module is loaded by itself and
driven as `scipy.optimize._slsqp_py` (BSD licence) drives it; for any other the public functions are taken. Both ways
give the same bits.
"""

import sys
from collections.abc import Callable
from functools import cache
from importlib import util
from importlib.machinery import PathFinder
from pathlib import Path
from typing import Any

import numpy as np
import scipy

from eaid.arrays import Array

KNOWN = ("1.16.", "1.17.")
"""Versions of SciPy whose `_slsqplib` is called as here."""

Cost = Callable[[Array], tuple[float, Array]]
"""x → cost, gradient (n,)."""


@cache
def library() -> Any | None:
    """The extension module; None where this SciPy is not known to have it."""
    if not scipy.__version__.startswith(KNOWN):
        return None
    name = "scipy.optimize._slsqplib"
    if name in sys.modules:
        return sys.modules[name]
    spec = PathFinder.find_spec(name, [str(Path(scipy.__file__).parent / "optimize")])
    if spec is None or spec.loader is None:
        return None
    module = util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def minimum(cost: Cost, start: Array, rows: Array, slack: Array, ftol: float, maximum: int) -> tuple[Array, int]:
    """Where SLSQP ends from `start` under rows x + slack ≥ 0, after at most `maximum` iterations, and its evaluations.

    `rows` of shape (m, n) and `slack` of shape (m,), m = 0 for a free problem.
    """
    compiled = library()
    if compiled is None:
        return _public_minimum(cost, start, rows, slack, ftol, maximum)
    x = np.array(start, dtype=np.float64)
    n, m = len(x), len(slack)
    state: dict[str, float | int] = dict.fromkeys(("alpha", "f0", "gs", "h1", "h2", "h3", "h4", "t", "t0"), 0.0)
    state |= {"acc": ftol, "tol": 10.0 * ftol, "itermax": maximum, "m": m, "n": n}
    state |= dict.fromkeys(("exact", "inconsistent", "reset", "iter", "line", "meq", "mode"), 0)
    indices = np.zeros(m + 2 * n + 2, dtype=np.int32)
    work = n * (n + 1) // 2 + 3 * m * n + 9 * m + 8 * n * n + 35 * n + 28 + (0 if m else 2 * n * (n + 1))
    buffer, multipliers = np.zeros(work), np.zeros(m + 2 * n + 2)
    free = np.full(n, np.nan)
    normals = np.zeros((max(1, m), n), order="F")
    normals[:m] = rows
    values = np.zeros(max(1, m))
    values[:m] = rows @ x + slack
    seen = x.copy()
    f, gradient = cost(seen)
    g = gradient
    evaluations = 1
    while True:
        compiled.slsqp(state, f, g, normals, values, x, multipliers, free, free, buffer, indices)
        if abs(int(state["mode"])) != 1:
            return x, evaluations
        if not np.array_equal(x, seen):
            seen = x.copy()
            f, gradient = cost(seen)
            evaluations += 1
        if state["mode"] == 1:
            values[:m] = rows @ x + slack
        else:
            g = gradient


def _public_minimum(
    cost: Cost, start: Array, rows: Array, slack: Array, ftol: float, maximum: int
) -> tuple[Array, int]:
    from scipy.optimize import minimize

    constraints: tuple[dict[str, object], ...] = ()
    if len(slack):
        constraints = ({"type": "ineq", "fun": lambda x: rows @ x + slack, "jac": lambda _: rows},)
    end = minimize(  # type: ignore[call-overload]  # the stubs know no vector-valued constraint
        cost, start, jac=True, method="SLSQP", constraints=constraints, options={"ftol": ftol, "maxiter": maximum}
    )
    return end.x, int(end.nfev)


def nnls(A: Array, b: Array) -> Array:
    """The x ≥ 0 that minimises |A x − b|, shape (n,) for A of shape (m, n).

    Raises ValueError where an entry is not finite, RuntimeError after 3 n iterations.
    """
    compiled = library()
    if compiled is None:
        from scipy.optimize import nnls as public

        return np.asarray(public(A, b)[0])
    A, b = np.asarray_chkfinite(A, dtype=np.float64, order="C"), np.asarray_chkfinite(b, dtype=np.float64)
    x, _, outcome = compiled.nnls(A, b, 3 * A.shape[1])
    if outcome == 3:
        raise RuntimeError("Maximum number of iterations reached.")
    return np.asarray(x)
