"""Medians of what may hold nothing."""

import numpy as np
import pytest

from eaid.arrays import median


@pytest.mark.parametrize("count", [1, 2, 3, 10, 11])
def test_median_is_numpys(count: int) -> None:
    values = np.random.default_rng(count).normal(size=count)
    before = values.copy()
    assert median(values) == np.median(values)
    assert (values == before).all()


def test_median_of_a_table_a_number_and_what_has_none() -> None:
    assert median([[4.0, 1.0], [2.0, 8.0]]) == 3.0
    assert median(7.0) == 7.0
    assert median([1.0, np.inf]) == np.inf
    assert np.isnan(median([1.0, np.nan, 2.0]))
    assert np.isnan(median([]))
