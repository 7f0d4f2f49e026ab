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


def test_degrees_are_satterthwaites() -> None:
    """A level and halves of two neighbours, 2 degrees each: 2 · 2²/(1 + ¼ + ¼); all ten alike: all twenty."""
    components = VarianceComponents(np.full(10, 0.3), neighbours(np.full(10, 2.0)), np.full(10, 2.0))
    assert components.degrees(np.eye(10))[4] == pytest.approx(16 / 3)
    assert components.degrees(np.ones((1, 10)))[0] == pytest.approx(20, rel=0.01)
