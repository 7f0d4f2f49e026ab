"""Closed forms that decide: degrees of freedom, quoted intervals, AICc and BIC, sweeps, linear intervals."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy import stats

from eaid.fitting.fit import fit
from eaid.models import friction
from eaid.options import FitOptions
from eaid.uncertainty import linear_intervals
from eaid.uncertainty.adequacy import adequacy, effective_samples
from eaid.uncertainty.level_statistics import log_jacobian, statistics_at_share
from eaid.uncertainty.linear_intervals import combined_variance, level_terms, pooled_gain
from eaid.uncertainty.runs import (
    RunStatistics,
    common_shifts,
    interval_of,
    log_interval_of,
    pooled_scatter,
    satterthwaite,
    t_quantile,
)


def test_t_is_that_of_scipy_stats() -> None:
    degrees = np.array([1.0, 2.5, 20.0, 1e7])
    assert t_quantile(degrees) == pytest.approx(stats.t.ppf(0.975, degrees), rel=1e-9)
    assert t_quantile(7.0, 0.999) == pytest.approx(stats.t.ppf(0.9995, 7.0))
    assert t_quantile(0.0) == np.inf and t_quantile(np.inf) == pytest.approx(1.959964, abs=1e-6)


def test_a_sum_of_alike_variances_has_all_their_degrees() -> None:
    assert satterthwaite((2.0, 2.0), (3.0, 3.0)) == pytest.approx(6.0)
    assert satterthwaite((3.0, 1.0), (4.0, 2.0)) == pytest.approx(16 / (9 / 4 + 1 / 2))
    assert satterthwaite((np.array([1.0, 0.0]), 1.0), (5.0, 7.0)) == pytest.approx([4 / (1 / 5 + 1 / 7), 7.0])


def test_quoted_intervals_by_hand() -> None:
    t = stats.t.ppf(0.975, 6)
    assert interval_of(5.0, 4.0, 6.0) == pytest.approx((5 - 2 * t, 5 + 2 * t))
    assert log_interval_of(5.0, 0.04, 6.0) == pytest.approx((5 * np.exp(-0.2 * t), 5 * np.exp(0.2 * t)))
    assert log_interval_of(-1.0, 0.04, 6.0) is None and log_interval_of(None, 0.04, 6.0) is None
    assert log_interval_of(5.0, 1e6, 6.0) is None


def test_welch_of_two_levels_by_hand() -> None:
    """Three runs and two: V = 3/2 Σψ² + 2 Σψ², ν = V²/(v₁²/2 + v₂²/1), at least the fewest."""
    first, second = np.array([1.0, -2.0, 1.0]), np.array([3.0, -3.0])
    variance, degrees = combined_variance([first, second, np.array([7.0])])
    assert variance == pytest.approx(1.5 * 6 + 2 * 18)
    assert degrees == pytest.approx(45**2 / (81 / 2 + 36**2))
    assert combined_variance([first * 0, second * 0]) == (0.0, 3.0)


def runs_of(influence: np.ndarray) -> list[RunStatistics]:
    """Levels whose runs would move one parameter so, shape (L, R), with hardly any noise within a run."""
    return [
        RunStatistics(float(i), np.zeros(1), np.eye(1), row[:, None] - row.mean(), np.full(1, 1e-12), 20.0)
        for i, row in enumerate(influence)
    ]


def test_sweeps_count_as_many_observations_as_there_are_sweeps() -> None:
    """m_r common to L levels: V = Σ m²/(R − 1)/R with R − 1 degrees of freedom beside each level's own."""
    random = np.random.default_rng(2)
    shift = np.array([0.3, -0.1, 0.4, -0.6])
    own = 0.01 * random.standard_normal((8, 4))
    levels = runs_of(shift + own)
    common = common_shifts(levels, 0)
    assert common == pytest.approx(shift + own.mean(axis=0) - (shift + own).mean(), abs=1e-12)
    found = pooled_scatter(levels)
    assert found.common[0] == pytest.approx(common @ common / 3 / 4) and found.common_degrees == 3
    assert found.degrees[:, 0] == pytest.approx(np.full(8, 3.0), rel=0.02)
    left = own - own.mean(axis=0) - own.mean(axis=1, keepdims=True) + own.mean()
    pooled = (left**2).sum() / (7 * 3) / 4
    assert found.own[:, 0].mean() == pytest.approx(pooled, rel=0.3) and found.pooled[0, 0] == pytest.approx(pooled)


def test_independent_repeats_are_no_sweeps() -> None:
    random = np.random.default_rng(3)
    sets = [runs_of(random.standard_normal((8, 3))) for _ in range(200)]
    assert sum(common_shifts(levels, 0) is not None for levels in sets) <= 6
    assert common_shifts(sets[0][:2], 0) is None


def test_white_noise_has_as_many_samples_as_it_has_and_a_memory_fewer() -> None:
    """AR(1) of φ leaves n (1 − φ)/(1 + φ)."""
    random = np.random.default_rng(0)
    e = random.standard_normal(20_000)
    for k in range(1, len(e)):
        e[k] += 0.8 * e[k - 1]
    count, first = effective_samples(e)
    assert count == pytest.approx(20_000 * 0.2 / 1.8, rel=0.15) and first == pytest.approx(0.8, abs=0.02)


@pytest.fixture(scope="module")
def judged(sets: Any) -> Any:
    made = sets.one_set(5, sets.VARIANTS["base"])
    base = statistics_at_share(made.levels, 0.85)
    return made, base, adequacy(made, fit(made), base)[0]


def test_scores_of_orders_and_shapes_by_their_formulas(judged: Any) -> None:
    made, base, found = judged
    for one in found.orders:
        p, L = one.order + 1, len(base.levels)
        assert one.aicc == pytest.approx(one.chi_square + 2 * p + 2 * p * (p + 1) / (L - p - 1))
    shape = found.shapes[1]
    left = [level.mean - row for level, row in zip(made.levels, fitted(base), strict=True)]
    bic = aicc = 0.0
    for residual in left:
        n = effective_samples(residual)[0]
        score = n * np.log(np.mean(residual**2))
        bic += score + 4 * np.log(n)
        aicc += score + 8 + 2 * 4 * 5 / (n - 5)
    assert shape.bic == pytest.approx(bic) and shape.aicc == pytest.approx(aicc)
    assert shape.rmse == pytest.approx(np.sqrt(np.mean(np.concatenate(left) ** 2)))


def fitted(base: Any) -> list[np.ndarray]:
    return [
        friction.step_response(one.curve, level.time_s) for one, level in zip(base.estimates, base.levels, strict=True)
    ]


@pytest.mark.slow
def test_variances_of_single_runs_are_those_of_moved_levels(sets: Any) -> None:
    """B of each level answers to the levels' log T_s, τ1, τ2 as refits to moved means do."""
    made = sets.one_set(1, sets.VARIANTS["single"])
    options = FitOptions(model=("friction", "linear"))
    found = fit(made, options).linear
    base = statistics_at_share(made.levels, 0.85)
    rows = linear_intervals.level_intervals(found, base)
    changes = np.zeros((10, 3))
    for i, (level, one) in enumerate(zip(made.levels, base.estimates, strict=True)):
        for k in range(3):
            step = 1e-4 * log_jacobian(one.curve, level.time_s)[:, k]
            levels = list(made.levels)
            levels[i] = replace(level, runs=level.runs + step)
            again = fit(replace(made, levels=tuple(levels)), options).linear
            changes[i, k] = (1 / again.per_level[4].B - 1 / found.per_level[4].B) / 1e-4
    sd = np.sqrt((changes**2 * base.variance).sum())
    t = t_quantile(base.total_degrees)
    row, ends = found.per_level[4], rows[4].B
    assert np.log(ends[1] / ends[0]) / 2 == pytest.approx(t * sd * row.B, rel=0.03)


def test_textbook_intervals_of_the_linear_model_by_lstsq(sets: Any) -> None:
    made = sets.one_set(1, sets.VARIANTS["base"])
    found = fit(made, FitOptions(model=("linear",))).linear
    pooled, rows = linear_intervals.white(found, made.levels)
    level, row = made.levels[3], found.per_level[3]
    J = level_terms(level, row.a0, row.gain)[0] / [row.a0, row.gain]
    left = level.mean - row.gain * -np.expm1(-row.a0 * level.time_s)
    sd = np.sqrt(np.diag(np.linalg.inv(J.T @ J)) * (left @ left) / (len(left) - 2))
    reach = stats.t.ppf(0.975, len(left) - 2) * sd
    assert rows[3].a0 == pytest.approx((row.a0 - reach[0], row.a0 + reach[0]), rel=1e-6)
    assert rows[3].gain == pytest.approx((row.gain - reach[1], row.gain + reach[1]), rel=1e-6)
    assert pooled.a0[0] < found.a0 < pooled.a0[1]


def test_pooled_gain_is_what_a_refit_does(sets: Any) -> None:
    made = sets.one_set(1, sets.VARIANTS["base"])
    found = fit(made, FitOptions(model=("linear",))).linear
    take, along = pooled_gain(made.levels, found.parameters)[6]
    level = made.levels[6]
    bump = 1e-4 * np.cos(3 * level.time_s)
    levels = (*made.levels[:6], replace(level, runs=level.runs + bump), *made.levels[7:])
    again = fit(replace(made, levels=levels), FitOptions(model=("linear",))).linear
    change = [getattr(again.parameters, k) - getattr(found.parameters, k) for k in ("a0", "b0", "c0")]
    assert change == pytest.approx(take @ (along @ bump), rel=1e-2)
