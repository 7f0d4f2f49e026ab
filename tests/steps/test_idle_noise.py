import numpy as np
import pytest

from eaid.steps.noise import idle_density


def test_white_noise_has_the_density_of_its_variance_over_the_rate() -> None:
    random = np.random.default_rng(0)
    for rate in (100.0, 1000.0):
        t = np.arange(int(200 * rate)) / rate
        drift = 0.3 * t  # an idle output that drifts is not noise
        assert idle_density(t, 0.02 * random.standard_normal(len(t)) + drift) == pytest.approx(4e-4 / rate, rel=0.15)


def test_a_short_idle_tells_nothing() -> None:
    t = np.arange(100) / 100
    assert idle_density(t, np.ones(100)) is None and idle_density(t[:3], np.ones(3)) is None
