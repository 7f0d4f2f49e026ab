"""SciPy's compiled SLSQP taken alone walks the same way, bit for bit, as through scipy.optimize."""

import subprocess
import sys

import numpy as np
import pytest

from eaid.fitting import slsqp_alone
from eaid.fitting.slsqp_alone import library, minimum, nnls


def rosenbrock(x):
    """Σ 100 (x_{i+1} − x_i²)² + (1 − x_i)² and its gradient."""
    low, high = x[:-1], x[1:]
    r = high - low**2
    g = np.zeros_like(x)
    g[:-1] = -400 * low * r - 2 * (1 - low)
    g[1:] += 200 * r
    return float((100 * r**2 + (1 - low) ** 2).sum()), g


def both_ways(monkeypatch, call):
    """Results of the compiled module alone and of the public functions, and how often the cost was asked."""
    results = []
    for compiled in (library(), None):
        monkeypatch.setattr(slsqp_alone, "library", lambda compiled=compiled: compiled)
        results.append(call())
    return results


@pytest.mark.skipif(library() is None, reason="this SciPy is not known to have the module")
@pytest.mark.parametrize("seed", range(20))
def test_same_bits_as_the_public_function(monkeypatch, seed):
    rng = np.random.default_rng(seed)
    n, m = int(rng.integers(2, 11)), int(rng.integers(0, 8))
    start, rows = rng.normal(size=n), rng.normal(size=(m, n))
    slack = rng.uniform(0.1, 2, m) - rows @ start  # the start is feasible
    maximum = int(rng.choice([3, 40, 200]))
    asked = []

    def cost(x):
        asked.append(x.copy())
        return rosenbrock(x)

    (x, used), (y, other) = both_ways(monkeypatch, lambda: minimum(cost, start, rows, slack, 1e-13, maximum))
    assert x.tobytes() == y.tobytes()
    assert used == other
    assert len(asked) == used + other
    if not m and maximum == 200:
        assert x == pytest.approx(np.ones(n), abs=1e-5) or rosenbrock(x)[0] < 5  # or its other minimum
    assert (rows @ x + slack).min(initial=0.0) > -1e-6


@pytest.mark.skipif(library() is None, reason="this SciPy is not known to have the module")
@pytest.mark.parametrize("seed", range(10))
def test_same_least_squares(monkeypatch, seed):
    rng = np.random.default_rng(seed)
    A, b = rng.normal(size=(12, 7)), rng.normal(size=12)
    x, y = both_ways(monkeypatch, lambda: nnls(A, b))
    assert x.tobytes() == y.tobytes()
    assert x.min() == 0.0 < x.max()


def test_what_is_not_finite_is_refused(monkeypatch):
    for broken in (np.nan, np.inf):
        with pytest.raises(ValueError):
            nnls(np.array([[1.0, broken], [0.0, 1.0]]), np.ones(2))


def test_a_wall_is_kept():
    # (x − 2)² + (y − 1)² with x + y ≤ 2 ends at (1.5, 0.5)
    def bowl(x):
        r = x - np.array([2.0, 1.0])
        return float(r @ r), 2 * r

    x, used = minimum(bowl, np.zeros(2), np.array([[-1.0, -1.0]]), np.array([2.0]), 1e-12, 50)
    assert x == pytest.approx([1.5, 0.5], abs=1e-9)
    assert used < 20


def test_another_scipy_takes_the_public_function(monkeypatch):
    monkeypatch.setattr(slsqp_alone.scipy, "__version__", "9.9.9")
    library.cache_clear()
    try:
        assert library() is None
        x, _ = minimum(rosenbrock, np.array([-1.2, 1.0]), np.zeros((0, 2)), np.zeros(0), 1e-13, 200)
        assert x == pytest.approx([1, 1], abs=1e-5)
    finally:
        library.cache_clear()


@pytest.mark.skipif(library() is None, reason="this SciPy is not known to have the module")
def test_a_fit_does_not_load_scipy_optimize_and_may_afterwards():
    code = """
import sys, numpy as np
from eaid.fitting.solver import Problem, slsqp
bowl = Problem(lambda x: (float(x @ x) + 1, 2 * x), lambda x: 2 * np.eye(2), np.array([[1.0, 0]]), np.ones(1), str)
assert abs(slsqp(bowl, np.array([3.0, 4])).x - [1, 0]).max() < 1e-6
assert "scipy.optimize" not in sys.modules and "scipy.linalg" not in sys.modules
from scipy.optimize import minimize
assert minimize(lambda x: x @ x, np.ones(2), method="SLSQP").success
assert abs(slsqp(bowl, np.array([3.0, 4])).x - [1, 0]).max() < 1e-6
"""
    subprocess.run([sys.executable, "-c", code], check=True)
