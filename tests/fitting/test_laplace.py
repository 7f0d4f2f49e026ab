"""Tabulated Laplace transforms give the sums over the points."""

import numpy as np
import pytest

from eaid.fitting.compress import Points
from eaid.fitting.kernel import level_normal
from eaid.fitting.laplace import transforms

RNG = np.random.default_rng(4)
T = np.sort(RNG.uniform(0, 20, (3, 60)))
Y = RNG.normal(1, 0.3, (3, 60))
W = RNG.uniform(0.5, 40, (3, 60))


@pytest.mark.parametrize("points", [Points(T[:1], Y, W[:1]), Points(T, Y, W)], ids=["one clock", "clocks of their own"])
@pytest.mark.parametrize("share", [0.85, 0.4])
def test_sums_are_those_of_the_points(points: Points, share: float) -> None:
    sums = transforms(points)
    places = 5
    theta = np.stack(
        [
            RNG.uniform(0.1, 4, (places, 3)),
            np.exp(RNG.uniform(-4, 0, (places, 3))),
            np.exp(RNG.uniform(-1, 6, (places, 3))),
            np.full((places, 3), share),
        ]
    )
    cost, gradient, curvature = sums.normal(theta)
    for k in range(places):
        want, slope, bent = level_normal(theta[:, k], points)
        assert np.abs(cost[k] - want).max() < 1e-6 * sums.squares.max()
        for i in range(4):
            assert gradient[i, k] == pytest.approx(slope[i], rel=1e-4, abs=1e-5 * np.abs(slope[i]).max())
            assert curvature[k, :, i, i] == pytest.approx(bent[:, i, i], rel=2e-3, abs=2e-4 * bent[:, i, i].max())
        assert np.abs(curvature[k] - curvature[k].transpose(0, 2, 1)).max() == 0


def test_a_slow_part_that_is_missing_from_the_record_stays_missing() -> None:
    sums = transforms(Points(T[:1], Y, W[:1]))
    endless = [sums.normal(np.array([[[2.0] * 3], [[0.3] * 3], [[tau] * 3], [[0.85] * 3]]))[0] for tau in (1e8, 1e12)]
    assert endless[0] == pytest.approx(endless[1], rel=1e-12)
