"""Compression: the weighted points have the sum of squared residuals of all samples."""

import itertools

import numpy as np
import pytest

from eaid.fitting import sums as module
from eaid.fitting.data import Data, data_of
from eaid.fitting.levels import fit_levels
from eaid.fitting.sums import HEAD, SMALL, Record, blocks, compress, orthonormal
from eaid.models import friction
from eaid.models.parameters import Friction
from eaid.steps.stepset import Level


def _sum_of_squares(t: np.ndarray, y: np.ndarray, curve: Friction) -> tuple[float, float]:
    points = compress([t], [y])
    floor = y @ y - np.sum(points.w * points.y**2)
    whole = np.sum((y - friction.step_response(curve, t)) ** 2)
    return floor + np.sum(points.w * (points.y - friction.step_response(curve, points.t_s)) ** 2), whole


@pytest.mark.parametrize("n", [1, SMALL, SMALL + 1, 5000, 30_011, 100_000])
def test_blocks_cover_every_sample_once(n: int) -> None:
    cut = list(blocks(n))
    assert cut[0][0] == 0 and cut[-1][1] == n
    assert all(a[1] == b[0] for a, b in itertools.pairwise(cut))
    assert n < HEAD or all(stop - start >= HEAD for start, stop in cut)


def test_weights_count_samples_and_nodes_integrate_polynomials_exactly() -> None:
    nodes, weights, _ = orthonormal(np.arange(100.0), 8)
    assert weights.sum() == pytest.approx(100, rel=1e-13)
    for degree in range(16):  # a Gauss rule of m nodes is exact to degree 2m − 1
        assert weights @ (nodes / 99) ** degree == pytest.approx(np.sum((np.arange(100) / 99) ** degree), rel=1e-12)


def test_irregular_instants_have_a_rule_of_their_own() -> None:
    t = np.sort(np.random.default_rng(1).uniform(0, 3, 200))
    nodes, weights, _ = orthonormal(t, 6)
    for degree in range(12):
        assert weights @ nodes**degree == pytest.approx(np.sum(t**degree), rel=1e-11)


@pytest.mark.parametrize(
    "curve", [Friction(2.0, 0.25, 5.0), Friction(4.0, 0.6, 16.0), Friction(0.3, 0.1, 1.0), Friction(2.0, 5e-4, 0.02)]
)
def test_sum_of_squares_is_kept(curve: Friction) -> None:
    t = np.arange(30_000) / 1000
    y = friction.step_response(Friction(2.1, 0.3, 4.0), t) + 0.01 * np.random.default_rng(0).normal(size=len(t))
    short, whole = _sum_of_squares(t, y, curve)
    assert short == pytest.approx(whole, rel=1e-8)


def test_sum_of_squares_is_kept_on_a_jittering_clock() -> None:
    rng = np.random.default_rng(2)
    t = np.cumsum(rng.uniform(0.0005, 0.0015, 20_000))
    y = friction.step_response(Friction(2.1, 0.3, 4.0), t) + 0.01 * rng.normal(size=len(t))
    short, whole = _sum_of_squares(t, y, Friction(2.0, 0.25, 5.0))
    assert short == pytest.approx(whole, rel=1e-8)


def test_thirty_thousand_samples_become_about_a_hundred_points() -> None:
    t = np.arange(30_000) / 1000
    points = compress([t, t], [t, t], np.stack([t, t]))
    assert points.t_s.shape == (1, 104) and points.y.shape == (2, 104)


@pytest.mark.parametrize("n", [257, 33_000, 70_003])
@pytest.mark.parametrize("runs", [1, 3])
def test_the_mean_of_the_runs_is_what_is_compressed(n: int, runs: int) -> None:
    y = np.random.default_rng(n).normal(size=(runs, n))
    data = data_of([Level(10.0, np.arange(n) / 1e3, y, tuple("abc"[:runs]))])
    assert data.records[0].y == pytest.approx(y.mean(axis=0), abs=1e-15)
    assert data.points.w.sum() == pytest.approx(n)


def test_a_grid_that_is_only_nearly_even_has_the_same_points() -> None:
    t = np.arange(3000) / 100
    y = np.sin(t)
    even, uneven = compress([t], [y], uniform=[True]), compress([t + 1e-6 * np.cos(t)], [y])
    for a, b in ((even.t_s, uneven.t_s), (even.y, uneven.y), (even.w, uneven.w)):
        assert a == pytest.approx(b, rel=1e-5, abs=1e-4)


def test_short_records_keep_every_sample_and_unequal_ones_are_padded_with_weight_zero() -> None:
    a, b = np.arange(100) / 10, np.arange(60) / 10
    points = compress([a, b], [a, b])
    assert points.y.shape == (2, 100)
    assert points.w[0].sum() == 100 and points.w[1].sum() == 60 and not points.w[1, 60:].any()


@pytest.mark.parametrize("noise", [0.01, 0.1])
def test_the_fit_on_points_is_the_fit_on_all_samples(noise: float, monkeypatch: pytest.MonkeyPatch) -> None:
    t = np.arange(4000) / 200
    rng = np.random.default_rng(1)
    curves = [Friction(Ts, tau1, tau2) for Ts, tau1, tau2 in ((0.5, 0.2, 5.0), (1.5, 0.5, 9.0), (3.0, 0.6, 8.0))]
    records = tuple(Record(t, friction.step_response(c, t) + noise * rng.normal(size=len(t)), True) for c in curves)
    data = Data(np.array([20.0, 50.0, 80.0]), records)
    short = fit_levels(data, 0.85)
    monkeypatch.setattr(module, "SMALL", len(t))
    whole = fit_levels(Data(data.u, records), 0.85)
    assert data.points.y.shape[1] < 100
    for a, b in zip(short, whole, strict=True):
        assert a.sse == pytest.approx(b.sse, rel=1e-11)
        assert (a.curve.Ts, a.curve.tau1, a.curve.tau2) == pytest.approx(
            (b.curve.Ts, b.curve.tau1, b.curve.tau2), rel=1e-5
        )
