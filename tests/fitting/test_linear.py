"""The linear model: specification 6 to its digits, NIST's certified values, B of single levels, bounds of B."""

from collections.abc import Callable

import numpy as np
import pytest

from eaid.fitting.data import Data, data_of
from eaid.fitting.linear import bounds_of, fit_each_level, fit_first_order, fit_linear, single_levels
from eaid.fitting.sums import Record
from eaid.models import linear
from eaid.models.parameters import PAPER_LINEAR, Linear, Nonlinear
from eaid.steps.stepset import StepSet

Maker = Callable[..., StepSet]
PUBLISHED_B = [23.044, 36.505, 41.142, 40.831, 37.706, 32.974, 27.340, 21.221, 14.854, 8.349]

# NIST StRD, public domain: y = b1 (1 − e^(−b2 x)); certified b1, b2, residual sum of squares.
NIST = {
    "BoxBOD": (
        [1, 2, 3, 5, 7, 10],
        [109, 149, 149, 191, 213, 224],
        (2.1380940889e02, 5.4723748542e-01, 1.1680088766e03),
    ),
    "Misra1a": (
        [77.6, 114.9, 141.1, 190.8, 239.9, 289.0, 332.8, 378.4, 434.8, 477.3, 536.8, 593.1, 689.1, 760.0],
        [10.07, 14.73, 17.94, 23.93, 29.61, 35.18, 40.02, 44.82, 50.76, 55.05, 61.01, 66.40, 75.47, 81.78],
        (2.3894212918e02, 5.5015643181e-04, 1.2455138894e-01),
    ),
}


@pytest.mark.parametrize("name", NIST)
def test_nist_certified_values_to_eight_digits(name: str) -> None:
    x, y, (b1, b2, squares) = NIST[name]
    data = Data(np.array([1.0]), (Record(np.array(x, float), np.array(y, float), False),))
    (found,) = fit_each_level(data)
    assert found.solver.converged
    assert found.coefficients[0] == pytest.approx(b1, rel=1e-8)
    assert 1 / found.tau == pytest.approx(b2, rel=1e-8)
    assert found.cost == pytest.approx(squares, rel=1e-9)


def test_reference_plant_twenty_seconds(clutch_set: Maker) -> None:
    data = data_of(clutch_set().levels)
    pooled = fit_linear(data)
    p = pooled.parameters
    assert (round(p.a0, 5), round(p.b0, 7), round(p.c0, 6)) == (1.84393, 0.0782825, -1.343124)
    assert np.sqrt(pooled.cost / data.samples) == pytest.approx(0.300604, abs=5e-7)
    rows = single_levels(data)
    assert [row.B for row in rows] == pytest.approx(PUBLISHED_B, abs=5e-4)
    bounds = bounds_of(rows)
    assert (bounds.B_m, bounds.B_M) == pytest.approx((8.349, 41.142), abs=5e-4)


def test_reference_plant_sixty_seconds_from_thirty_percent(clutch_set: Maker) -> None:
    data = data_of(clutch_set(levels=range(30, 101, 10), duration_s=60.0).levels)
    p = fit_linear(data).parameters
    assert (round(p.a0, 5), round(p.b0, 7), round(p.c0, 6)) == (1.55135, 0.0814392, -2.113226)
    bounds = bounds_of(single_levels(data))
    assert (bounds.B_m, bounds.B_M) == pytest.approx((9.597, 45.875), abs=5e-4)


def _linear_data() -> Data:
    t = np.arange(1000) / 100
    duties = np.array([40.0, 70.0, 100.0])
    return Data(duties, tuple(Record(t, linear.step_response(PAPER_LINEAR, t, u), True) for u in duties))


def test_zero_offset_puts_the_offset_into_b0() -> None:
    data = _linear_data()
    p = fit_linear(data).parameters
    assert (p.a0, p.b0, p.c0) == pytest.approx((1.36, 0.08, -2.42), rel=1e-9)
    rows = single_levels(data)
    assert [row.b0 for row in rows] == pytest.approx([0.08 - 2.42 / u for u in (40, 70, 100)], rel=1e-8)
    assert all(row.c0 == 0 for row in rows)


def test_bounds_over_the_kept_levels_only() -> None:
    data = _linear_data()
    bounds = bounds_of(single_levels(data), (70.0, 100.0))
    assert bounds.levels == (70.0, 100.0)
    assert pytest.approx(1 / (0.08 - 2.42 / 70), rel=1e-8) == bounds.B_M


def test_a_level_without_positive_b0_has_no_b() -> None:
    t = np.arange(500) / 100
    (row,) = single_levels(Data(np.array([50.0]), (Record(t, np.exp(-t) - 1, True),)))
    assert row.b0 == pytest.approx(-1 / 50, rel=1e-6) and row.B is None
    assert bounds_of([row]).B_m is None


def test_one_level_has_no_offset(clutch_set: Maker) -> None:
    found = fit_linear(data_of(clutch_set(levels=[60], duration_s=5.0).levels))
    assert found.parameters.c0 == 0.0 and found.parameters.b0 > 0


@pytest.mark.parametrize("seed", range(6))
def test_the_best_rate_of_a_fine_search(seed: int, clutch_set: Maker) -> None:
    rng = np.random.default_rng(seed)
    plant = Nonlinear((0.1 + rng.uniform(), 0, 0), (3.0, 0.05, 0), (rng.uniform(), 0.02, 0, 0), (10, 100))
    data = data_of(clutch_set(plant, duration_s=8.0, rate_hz=50.0, noise_nm=0.05, seed=seed).levels)
    found = fit_linear(data)
    design = np.stack([data.u, np.ones_like(data.u)], axis=1)

    def cost(a0: float) -> float:
        rise = 1 - np.exp(-a0 * data.records[0].t_s)
        y = np.stack([r.y for r in data.records])
        gains = np.linalg.lstsq(design, y @ rise / (rise @ rise), rcond=None)[0]
        return float(np.sum((np.outer(design @ gains, rise) - y) ** 2))

    best = min(cost(a0) for a0 in found.parameters.a0 * np.geomspace(0.2, 5, 401))
    assert found.cost <= best * (1 + 1e-9)


def test_levels_fitted_together_are_those_fitted_alone() -> None:
    t = np.arange(1500) / 100
    rng = np.random.default_rng(3)
    rises = [(0.2, 0.5), (3.0, 2.0), (1.0, 30.0), (0.0, 1.0)]  # gain, τ: the last has no signal
    records = tuple(Record(t, g * -np.expm1(-t / tau) + 0.05 * rng.normal(size=len(t)), True) for g, tau in rises)
    data = Data(np.array([20.0, 50.0, 80.0, 90.0]), records)
    for i, together in enumerate(fit_each_level(data)):
        alone = fit_first_order(data.one(i), np.ones((1, 1)))
        assert together.solver.converged and together.cost == pytest.approx(alone.cost, rel=1e-9)
        assert together.tau == pytest.approx(alone.tau, rel=1e-4)


@pytest.mark.parametrize("seed", [6, 16, 30])
def test_a_rise_lost_in_noise_ends_at_the_fastest_that_is_looked_for(seed: int) -> None:
    t_s = np.arange(100) * 0.01
    noise = 2.0 * np.random.default_rng(seed).standard_normal(100)
    data = Data(np.array([50.0]), (Record(t_s, 0.5 * (1 - np.exp(-t_s / 0.02)) + noise, True),))
    (found,) = fit_each_level(data)
    assert found.solver.converged and found.tau == pytest.approx(1e-4, rel=1e-6)  # 0.01 of the first sample
    assert found.coefficients[0] == pytest.approx(data.records[0].y[1:].mean(), rel=1e-9)


def test_levels_of_a_fraction_of_a_volt_have_a_b0_and_a_c0() -> None:
    """What tells b0 from c0 is that levels differ, not by how much."""
    p = Linear(0.5, 3.0, 0.4)
    t = np.arange(400) / 20.0
    rows = tuple(Record(t, linear.step_response(p, t, u), True) for u in (0.2, 0.5, 0.8))
    found = fit_linear(Data(np.array([0.2, 0.5, 0.8]), rows)).parameters
    assert (found.a0, found.b0, found.c0) == pytest.approx((0.5, 3.0, 0.4), rel=1e-8)
