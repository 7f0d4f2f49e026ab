"""Trends: Tables I and II return, merged rates take their limit, what is at the edge is said."""

import numpy as np
import pytest

from eaid.estimate.trends import fit_trend
from eaid.plant.trends import evaluate

STRESS = np.array([17, 34, 51, 68, 85, 102, 119, 136, 153, 170]) / 6.283e-3 / 1e3
SPEED = np.arange(5.0, 41.0, 5.0)


def test_rmse_by_hand() -> None:
    found = fit_trend(np.array([0.0, 1.0, 2.0]), np.array([0.0, 3.0, 0.0]), "stress_kpa", "linear")
    assert found.coefficients == pytest.approx((0.0, 1.0), abs=1e-12) and found.rmse == pytest.approx(np.sqrt(2))


@pytest.mark.parametrize("truth", [(2.0, 0.3, -0.06), (100.0, 0.0, -0.0507), (5.0, -0.1, 0.01)])
def test_merged_rates_are_reported_as_their_limit(truth: tuple[float, float, float]) -> None:
    found = fit_trend(SPEED, evaluate("merged-exponential", truth, SPEED), "speed_rpm", "double-exponential")
    if truth[1] == 0:  # one exponential: any second rate does, but never two huge weights
        assert max(abs(c) for c in found.coefficients) < 1e3 * truth[0]
    else:
        assert found.form == "merged-exponential"
        assert found.coefficients == pytest.approx(truth, rel=1e-4)
    assert found.rmse < 1e-6


def test_a_rate_as_steep_as_is_looked_for_is_said() -> None:
    y = np.where(SPEED[0] == SPEED, 5.0, 1.0 + 0.01 * SPEED)  # one odd point
    found = fit_trend(SPEED, y, "speed_rpm", "double-exponential")
    assert found.at_bounds


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_no_start_of_many_does_better(seed: int) -> None:
    rng = np.random.default_rng(seed)
    y = evaluate("double-exponential", (1.37, 0.0476, 40.25, -0.219), STRESS) * np.exp(0.05 * rng.normal(size=10))
    found = fit_trend(STRESS, y, "stress_kpa", "double-exponential")
    rates = np.linspace(-1.2, 0.4, 161)
    best = np.inf
    for i, r1 in enumerate(rates):
        for r2 in rates[i + 2 :]:
            design = np.exp(np.multiply.outer(STRESS, [r1, r2]))
            left = design @ np.linalg.lstsq(design, y, rcond=None)[0] - y
            best = min(best, float(left @ left))
    assert found.rmse**2 * 10 <= best * (1 + 1e-6)
