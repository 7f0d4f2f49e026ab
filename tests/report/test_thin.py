import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from eaid.report.live import thinned, thinned_at


def test_a_spike_of_one_sample_survives():
    y = np.zeros(100_000)
    y[54_321] = 7.0
    y[77_777] = -3.0
    t, thin = thinned(np.arange(100_000.0), y, 500)
    assert thin.max() == 7.0 and thin.min() == -3.0
    assert len(thin) <= 502
    assert t[thin.argmax()] == 54_321  # every 200th sample would have lost it


def test_short_curves_are_left_alone():
    y = np.sin(np.arange(100.0))
    assert np.array_equal(thinned(np.arange(100.0), y, 100)[1], y)


@given(st.integers(2, 5000), st.integers(4, 200), st.integers(0, 2**32 - 1))
def test_ends_and_extremes_are_kept_in_order(n: int, points: int, seed: int):
    y = np.random.default_rng(seed).normal(size=n)
    keep = thinned_at(y, points)
    assert keep[0] == 0 and keep[-1] == n - 1
    assert np.all(np.diff(keep) > 0)
    assert y[keep].max() == y.max() and y[keep].min() == y.min()
    assert len(keep) <= max(n if n <= points else 0, points + 2)
