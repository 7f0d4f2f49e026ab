import numpy as np
import pytest
from scipy.special import stdtr, stdtrit

from eaid.models import friction
from eaid.models.parameters import Friction
from eaid.steps.stepset import Level
from eaid.uncertainty.level_statistics import level_estimate, log_jacobian
from eaid.uncertainty.runs import (
    VarianceComponents,
    bartlett_variance,
    neighbours,
    paule_mandel,
    pooled_scatter,
    run_residuals,
    smoothed,
    t_quantile,
)

CURVE = Friction(Ts=2.0, tau1=0.4, tau2=6.0)
T = np.arange(2000) * 0.01


def level_of(runs: np.ndarray, level: float = 50.0) -> Level:
    return Level(level, T[: runs.shape[1]], runs, tuple(str(i) for i in range(len(runs))))


def test_t_quantile_is_student_and_normal() -> None:
    assert t_quantile(2) == pytest.approx(4.302652729911275)
    assert t_quantile(20) == pytest.approx(2.0859634472658364)
    assert stdtr(7, t_quantile(7)) == pytest.approx(0.975)
    assert t_quantile(np.inf) == pytest.approx(1.959964, abs=1e-5)
    assert t_quantile(0) == np.inf
    every = np.geomspace(1, 1e7, 60)
    assert t_quantile(every) == pytest.approx(stdtrit(every, 0.975), rel=1e-11)
    assert [t_quantile(float(one)) for one in every] == pytest.approx(t_quantile(every), rel=1e-13)


def test_bartlett_sum_is_the_weighted_autocovariance() -> None:
    random = np.random.default_rng(0)
    scores = random.standard_normal((400, 2))
    time_s = np.arange(400) * 0.01  # bins of a tenth of the shortest window: one sample each
    m = 30
    weights = 1 - np.arange(m) / m
    direct = [sum((1 if j == 0 else 2) * weights[j] * (s[j:] @ s[: len(s) - j]) for j in range(m)) for s in scores.T]
    assert bartlett_variance(time_s, scores, (0.1, 0.3))[1] == pytest.approx(direct, rel=1e-10)


def test_bartlett_window_of_white_noise_is_its_variance() -> None:
    random = np.random.default_rng(1)
    scores = random.standard_normal((20_000, 1))
    found = bartlett_variance(np.arange(20_000) * 1e-3, scores)
    assert found[0, 0] == pytest.approx(20_000, rel=0.1)


def test_log_jacobian_against_complex_steps() -> None:
    t = np.linspace(0, 20, 50)
    h = 1e-30
    theta = np.log([2.0, 0.4, 6.0]).astype(complex)
    for k in range(3):
        moved = theta.copy()
        moved[k] += 1j * h
        Ts, tau1, tau2 = np.exp(moved)
        curve = Ts * (0.85 * (1 - np.exp(-t / tau1)) + 0.15 * (1 - np.exp(-t / tau2)))
        assert log_jacobian(CURVE, t)[:, k] == pytest.approx(curve.imag / h, rel=1e-10, abs=1e-14)


def test_influence_is_what_each_run_alone_would_change() -> None:
    """A run that is 1 % high pulls log T_s by 0.01 and leaves the time constants alone."""
    clean = friction.step_response(CURVE, T)
    found = level_estimate(level_of(np.array([clean * 1.01, clean * 0.99])), CURVE).runs
    assert found.influence[0] == pytest.approx([0.01, 0, 0], abs=1e-9)
    assert found.influence.sum(axis=0) == pytest.approx(0, abs=1e-12)
    assert found.scatter[0] == pytest.approx(2e-4)


def test_own_residuals_forget_what_the_curve_can_follow() -> None:
    clean = friction.step_response(CURVE, T)
    jacobian = log_jacobian(CURVE, T)
    noise = np.random.default_rng(2).standard_normal(len(T))
    noise -= jacobian @ np.linalg.lstsq(jacobian, noise, rcond=None)[0]
    left = run_residuals((clean * 1.0 + 0.02 * jacobian[:, 1] + noise)[None], clean, jacobian)
    assert left[0] == pytest.approx(noise, abs=1e-9)


def test_within_run_variance_grows_with_the_noise_memory() -> None:
    random = np.random.default_rng(3)
    clean = friction.step_response(CURVE, T)
    white = random.standard_normal((2, len(T)))
    slow = np.repeat(random.standard_normal((2, len(T) // 50)), 50, axis=1)
    h = [level_estimate(level_of(clean + 0.01 * noise), CURVE).runs.within for noise in (white, slow)]
    assert (h[1] > 8 * h[0]).all()


def test_paule_mandel_by_hand() -> None:
    # two levels of one degree each, h = 1 and 3, v = 6 and 10: 6/(a + 1) + 10/(a + 3) = 2 gives a = 2 + sqrt(15)
    a, q = paule_mandel(lambda a: 6 / (a + 1) + 10 / (a + 3), 2.0, 10.0)
    assert (a, q) == (pytest.approx(2 + np.sqrt(15)), 1.0)
    assert paule_mandel(lambda a: 1 / (a + 1), 2.0, 1.0) == (0.0, 0.5)


def test_pooled_scatter_finds_the_run_to_run_part() -> None:
    random = np.random.default_rng(4)
    clean = friction.step_response(CURVE, T)
    levels = []
    for i in range(40):
        gains = 1 + 0.03 * random.standard_normal(3)
        runs = clean * gains[:, None] + 0.01 * random.standard_normal((3, len(T)))
        levels.append(level_estimate(level_of(runs, float(i + 1)), CURVE).runs)
    found = pooled_scatter(levels)
    assert np.sqrt(found.between[0]) == pytest.approx(0.03, rel=0.2)
    assert np.sqrt(found.between[1]) < 0.01
    assert found.total_degrees == 80
    assert found.pooled[:, 0] == pytest.approx(found.between[0] / 3, rel=0.05)


def test_scatter_that_grows_towards_low_levels_is_followed() -> None:
    random = np.random.default_rng(5)
    clean = friction.step_response(CURVE, T)
    levels = []
    for i in range(30):
        size = 0.06 if i < 15 else 0.015
        runs = clean * (1 + size * random.standard_normal(3))[:, None]
        runs = runs + 1e-4 * random.standard_normal(runs.shape)
        levels.append(level_estimate(level_of(runs, float(i + 1)), CURVE).runs)
    found = pooled_scatter(levels)
    step = found.jumps[0]
    assert step is not None and step.place == 14 and step.ratio == pytest.approx(4, rel=0.35)
    low, high = found.variance[:15, 0].mean(), found.variance[16:, 0].mean()  # 15 borrows from 14, beyond the step
    assert low == pytest.approx(0.06**2 / 3, rel=0.5) and 8 < low / high < 32
    assert found.jumps[1] is None


def test_neighbours_are_the_narrowest_triangle_of_enough_runs() -> None:
    three = neighbours(np.full(10, 2.0))
    assert three[4, 3:6] == pytest.approx([0.25, 0.5, 0.25]) and three[0, :2] == pytest.approx([2 / 3, 1 / 3])
    assert np.count_nonzero(three[4]) == 3
    assert np.count_nonzero(neighbours(np.full(10, 1.0))[4]) == 7  # two repeats each
    assert neighbours(np.full(10, 5.0)) == pytest.approx(np.eye(10))  # six repeats need no neighbour
    borrowed = neighbours(np.array([2.0, 2, 0, 2, 2]))  # one level has a single run
    assert borrowed.sum(axis=1) == pytest.approx(1) and (borrowed[:, 2] == 0).all()


def test_degrees_are_satterthwaites() -> None:
    """A level and halves of two neighbours, 2 degrees each: 2 · 2²/(1 + ¼ + ¼); all ten alike: all twenty."""
    components = VarianceComponents(np.full(10, 0.3), neighbours(np.full(10, 2.0)), np.full(10, 2.0))
    assert components.degrees(np.eye(10))[4] == pytest.approx(16 / 3)
    assert components.degrees(np.ones((1, 10)))[0] == pytest.approx(20, rel=0.01)


def test_within_run_variance_is_smoothed_over_levels() -> None:
    x = np.arange(1.0, 11)
    true = np.exp(1 - 0.3 * x + 0.02 * x**2)
    chance = np.exp(0.3 * np.random.default_rng(0).standard_normal(10))
    found = smoothed(true * chance, x, np.ones(10, dtype=bool))
    assert np.abs(np.log(found / true)).mean() < 0.7 * np.abs(np.log(chance)).mean()
    assert smoothed(true[:4] * chance[:4], x[:4], np.ones(4, dtype=bool)) == pytest.approx(true[:4] * chance[:4])


def test_what_a_constraint_holds_has_no_say() -> None:
    clean = friction.step_response(CURVE, T)
    levels = []
    for i in range(5):
        runs = clean * np.array([1.0, 1.01, 0.99])[:, None] * (1 if i else 1.0)
        if i == 0:
            runs = clean * np.array([0.5, 1.0, 1.5])[:, None]
        levels.append(level_estimate(level_of(runs, float(i + 1)), CURVE).runs)
    usable = np.ones((5, 3), dtype=bool)
    usable[0] = False
    found = pooled_scatter(levels, usable)
    assert found.pooled[0, 0] == pytest.approx(1e-4 / 3, rel=0.01)
    assert pooled_scatter(levels).pooled[0, 0] > 100 * found.pooled[0, 0]
