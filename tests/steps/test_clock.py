"""Clocks of runs."""

import numpy as np
import pytest

from eaid.arrays import read_only
from eaid.steps.step import clock_of

TIME = read_only(np.arange(2000) / 1000)


def test_a_plain_clock():
    clock = clock_of(TIME)
    assert clock.usual_s == pytest.approx(1e-3, rel=1e-9)
    assert clock.longest_s == pytest.approx(1e-3, rel=1e-9)
    assert clock.spread_s is None


def test_a_gap_and_where_it_is():
    time = np.concatenate((TIME[:700], TIME[700:] + 0.25))
    clock = clock_of(time)
    assert clock.longest_s == pytest.approx(0.251)
    assert clock.longest_at == 699
    assert clock.spread_s is None  # one gap is no jitter


def test_jitter_is_the_spread_without_its_ends():
    rng = np.random.default_rng(0)
    gaps = 1e-3 * (1 + 0.3 * rng.uniform(-1, 1, 5000))
    clock = clock_of(np.cumsum(gaps))
    low, high = np.quantile(np.diff(np.cumsum(gaps)), (0.01, 0.99))
    assert clock.spread_s == (low, high)
    assert clock_of(np.cumsum(1e-3 * (1 + 0.09 * rng.uniform(-1, 1, 5000)))).spread_s is None
