"""Clocks of runs, and that runs which share a time axis share what is found of it."""

import numpy as np
import pytest

from eaid.arrays import read_only
from eaid.steps.clock import Clocks, clock_of

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


def test_one_axis_is_judged_once_however_it_is_held():
    clocks = Clocks()
    assert clocks.clock(TIME) is clocks.clock(TIME[:])
    assert clocks.window(TIME, 500) is clocks.window(TIME[:], 500)
    assert clocks.window(TIME, 500) is not clocks.window(TIME, 501)
    assert clocks.window(TIME, 0).time_s[0] == 0
    assert clocks.window(TIME, 501).time_s[0] == 0
    assert clocks.window(TIME, 500).step_s == pytest.approx(1e-3)


def test_other_axes_are_told_apart():
    both = np.stack((TIME, 2 * TIME), axis=1)  # columns of a matrix, each with gaps between its values
    clocks = Clocks()
    assert clocks.clock(both[:, 0]).usual_s == pytest.approx(1e-3)
    assert clocks.clock(both[:, 1]).usual_s == pytest.approx(2e-3)
    flat = np.sort(np.random.default_rng(1).uniform(size=100))
    assert clocks.clock(flat[::2]).usual_s != clocks.clock(flat[:50]).usual_s


def test_the_place_of_an_axis_that_is_gone_is_not_mistaken():
    clocks = Clocks()
    for factor in (1.0, 2.0, 3.0):
        assert clocks.clock(np.arange(1000) * factor).usual_s == factor  # each array is dropped at once
