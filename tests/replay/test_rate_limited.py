"""The taut path against a general solver, and against a case solved by hand."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import LinearConstraint, minimize

from eaid.replay.rate_limited import taut_path


def taut(reference, weight, fall, fall0, rise, rise0, start):
    path = np.empty(len(reference))
    n = len(reference)
    limits = [np.broadcast_to(np.asarray(value, float), n) for value in (fall, fall0, rise, rise0)]
    return taut_path(np.asarray(reference, float), np.asarray(weight, float), *limits, start, path), path


@given(st.integers(0, 10_000), st.integers(2, 12))
@settings(max_examples=60, deadline=None)
def test_nothing_cheaper_is_found_by_a_general_solver(seed: int, n: int) -> None:
    draw = np.random.default_rng(seed)
    reference = draw.normal(0, 1.5, n)
    weight = draw.choice([0.0, 1.0, 3.0], n)
    fall, rise = draw.uniform(0.5, 1.0, (2, n))
    fall0, rise0 = -draw.uniform(0, 1.0, n), draw.uniform(0, 1.0, n)
    # one limit stays below the other over all paths that are possible
    rise0 = np.maximum(rise0, fall0 + np.abs(fall - rise) * 12)
    cost, path = taut(reference, weight, fall, fall0, rise, rise0, 0.3)
    assert cost == pytest.approx(np.sum(weight * (path - reference) ** 2), rel=1e-12, abs=1e-15)
    low, high = fall[:-1] * path[:-1] + fall0[:-1], rise[:-1] * path[:-1] + rise0[:-1]
    assert np.all(path[1:] >= low - 1e-12) and np.all(path[1:] <= high + 1e-12) and path[0] == 0.3
    ahead, back = np.eye(n)[1:], np.eye(n)[:-1]
    found = minimize(
        lambda x: np.sum(weight * (x - reference) ** 2), path + 0.0,
        jac=lambda x: 2 * weight * (x - reference), method="SLSQP", options={"ftol": 1e-14, "maxiter": 500},
        constraints=[
            LinearConstraint(np.eye(n)[:1], 0.3, 0.3),
            LinearConstraint(ahead - fall[:-1, None] * back, fall0[:-1], np.inf),
            LinearConstraint(ahead - rise[:-1, None] * back, -np.inf, rise0[:-1]),
        ],
    )  # fmt: skip
    assert cost <= found.fun + 1e-7


def test_a_step_is_met_half_way_by_hand() -> None:
    # slope at most 0.1 a sample, step of 1, met half-way: errors 0.05, 0.15 … 0.45 before it and after it
    reference = np.repeat([0.0, 1.0], 20)
    cost, path = taut(reference, np.ones(40), 1.0, -0.1, 1.0, 0.1, 0.0)
    assert cost == pytest.approx(2 * (0.05**2 + 0.15**2 + 0.25**2 + 0.35**2 + 0.45**2), rel=1e-12)
    assert np.all(np.abs(np.diff(path)) <= 0.1 + 1e-12)


def test_what_is_within_reach_costs_nothing_and_what_does_not_count_is_free() -> None:
    reference = np.sin(np.arange(500) * 0.05)
    cost, path = taut(reference, np.ones(500), 1.0, -0.1, 1.0, 0.1, 0.0)
    assert cost == 0.0 and np.array_equal(path, reference)
    weight = np.r_[np.zeros(30), np.ones(470)]
    cost, path = taut(reference + 2.0, weight, 1.0, -0.1, 1.0, 0.1, 0.0)
    assert cost == 0.0 and path[30] == pytest.approx(reference[30] + 2.0)


def test_a_path_that_counts_no_more_stays_where_it_is() -> None:
    reference = np.r_[np.linspace(0, 1, 11), np.full(9, 5.0)]
    weight = np.r_[np.ones(11), np.zeros(9)]
    cost, path = taut(reference, weight, 1.0, -0.1, 1.0, 0.1, 0.0)
    assert cost == pytest.approx(0.0, abs=1e-20) and np.all(path[10:] == path[10]) and path[10] == pytest.approx(1.0)


def test_long_paths_lose_no_digits() -> None:
    # 200 time constants: the scales of the stacks would overflow
    n, decay = 60_000, np.exp(-1 / 300)
    reference = 2 + 1.9 * np.sign(np.sin(np.arange(n) * 2e-3))
    cost, path = taut(reference, np.ones(n), decay, 0.0, decay, 4.4 * (1 - decay), 0.0)
    assert np.sum((path - reference) ** 2) == pytest.approx(cost, rel=1e-12)
    again, _ = taut(reference[:20_000], np.ones(20_000), decay, 0.0, decay, 4.4 * (1 - decay), 0.0)
    # the first third, left to itself, can only be cheaper, and hardly is
    assert (
        0.999 * np.sum((path[:20_000] - reference[:20_000]) ** 2)
        <= again
        <= np.sum((path[:20_000] - reference[:20_000]) ** 2)
    )
