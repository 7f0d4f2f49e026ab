import numpy as np
import pytest

from eaid.models.parameters import REFERENCE_PLANT
from eaid.uncertainty.curve import powers, through

DUTY = np.arange(10.0, 101.0, 10.0)
TAU2 = np.polynomial.polynomial.polyval(DUTY, REFERENCE_PLANT.tau2)


def test_a_polynomial_comes_back_through_its_logarithms() -> None:
    found = through(DUTY, np.log(TAU2), np.full(10, 1e-4), 3)
    assert found == pytest.approx(np.array(REFERENCE_PLANT.tau2) * 100.0 ** np.arange(3), rel=1e-9)


def test_it_is_the_least_squares_of_logs() -> None:
    """Against a blind minimiser of the same sum."""
    from scipy.optimize import minimize

    random = np.random.default_rng(0)
    variance = np.linspace(1, 9, 10) * 1e-3
    theta = np.log(TAU2) + np.sqrt(variance) * random.standard_normal(10)

    def cost(c: np.ndarray) -> float:
        value = powers(DUTY, 3) @ c
        return float(((theta - np.log(value)) ** 2 / variance).sum()) if (value > 0).all() else 1e9

    ours = through(DUTY, theta, variance, 3)
    blind = minimize(cost, ours * 1.1, method="Nelder-Mead", options={"xatol": 1e-10, "fatol": 1e-12, "maxiter": 9999})
    assert cost(ours) <= blind.fun * (1 + 1e-9)
