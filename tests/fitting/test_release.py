"""Release constants: what the two states had reached shares out the fall; rising and falling side by side."""

import numpy as np
import pytest

from eaid.fitting import release
from eaid.fitting.data import data_of
from eaid.fitting.levels import fit_levels
from eaid.fitting.release import release_fit, share_reached
from eaid.models import friction
from eaid.models.parameters import Friction
from eaid.results.fit import ReleaseLevel
from eaid.steps.stepset import Level

TIME = np.arange(1000) / 100
HELD_S = 8.0
RISES = {40.0: Friction(0.8, 0.6, 12.0), 80.0: Friction(2.8, 0.55, 17.0)}


def release_curve(row: ReleaseLevel, time_s: np.ndarray) -> np.ndarray:
    e1, e2 = np.exp(-time_s / row.tau1), np.exp(-time_s / row.tau2)
    return row.residual + row.amplitude * (row.share * e1 + (1 - row.share) * e2)


def _fall(rise: Friction, tau1: float, tau2: float, left: float = 0.0) -> np.ndarray:
    """The states of specification 4.1 after HELD_S at the level, let go to zero."""
    x1 = rise.C * rise.Ts * -np.expm1(-HELD_S / rise.tau1)
    x2 = (1 - rise.C) * rise.Ts * -np.expm1(-HELD_S / rise.tau2)
    return left + x1 * np.exp(-TIME / tau1) + x2 * np.exp(-TIME / tau2)


def _level(u: float, y: np.ndarray) -> Level:
    return Level(u, TIME, y[None], (f"{u}",))


def _rising() -> list:
    return fit_levels(data_of([_level(u, friction.step_response(rise, TIME)) for u, rise in RISES.items()]), 0.85)


def test_truth_returns_and_rising_stands_beside_falling() -> None:
    falls = [_level(u, _fall(rise, 0.25, 5.0)) for u, rise in RISES.items()]
    found, _ = release_fit(falls, _rising(), dict.fromkeys(RISES, HELD_S))
    assert found.solver.converged
    assert (found.tau1, found.tau2) == pytest.approx((0.25, 5.0), rel=1e-5)
    for row in found.levels:
        assert (row.tau1, row.tau2) == pytest.approx((0.25, 5.0), rel=1e-5)
        assert (row.rising_tau1, row.rising_tau2) == pytest.approx(
            (RISES[row.level].tau1, RISES[row.level].tau2), rel=1e-5
        )
        assert row.residual == pytest.approx(0, abs=1e-6)
        assert release_curve(row, TIME) == pytest.approx(_fall(RISES[row.level], 0.25, 5.0), abs=1e-6)


def test_torque_that_is_left_is_told() -> None:
    falls = [_level(u, _fall(rise, 0.2, 1.0, left=0.3 * rise.Ts)) for u, rise in RISES.items()]
    found, told = release_fit(falls, _rising(), dict.fromkeys(RISES, HELD_S))
    assert [row.residual for row in found.levels] == pytest.approx([0.24, 0.84], rel=1e-4)
    assert [(one.code, one.levels) for one in told] == [("release-leaves-output", (40.0, 80.0))]


def test_the_share_of_the_fast_state_falls_with_the_time_held() -> None:
    rise = Friction(2.0, 0.5, 10.0)
    assert share_reached(rise, 1e6, 0.85) == pytest.approx(0.85)
    assert share_reached(rise, 5.0, 0.85) == pytest.approx(
        0.85 * (1 - np.exp(-10)) / (0.85 * (1 - np.exp(-10)) + 0.15 * (1 - np.exp(-0.5)))
    )
    assert share_reached(None, 5.0, 0.85) == 0.85


def test_a_release_too_short_for_its_slow_part_is_told() -> None:
    falls = [_level(80.0, _fall(RISES[80.0], 0.25, 60.0))]
    _, told = release_fit(falls, _rising(), dict.fromkeys(RISES, HELD_S))
    assert "release-beyond-record" in {one.code for one in told}


def _noisy(times: list[np.ndarray]) -> list[Level]:
    random = np.random.default_rng(3)
    found = []
    for u, time_s in zip((40.0, 60.0, 80.0), times, strict=True):
        y = 0.1 + 0.03 * u * (0.8 * np.exp(-time_s / 0.25) + 0.2 * np.exp(-time_s / 4.0))
        found.append(Level(u, time_s, (y + 0.02 * random.normal(size=len(y)))[None], ("one",)))
    return found


@pytest.mark.slow
@pytest.mark.parametrize("times", [[TIME] * 3, [TIME, TIME[:700], TIME[:500]]], ids=["one grid", "three grids"])
def test_levels_together_end_where_the_solver_takes_each(times: list[np.ndarray]) -> None:
    levels = _noisy(times)
    together, _ = release_fit(levels, [], {})
    for level, own in zip(levels, together.levels, strict=True):
        data = data_of([level])
        solved = release.solve(data, np.array([0.85]), np.log([[0.1, 1.0], [0.4, 9.0]]))
        assert own.sse == pytest.approx(solved.solver.costs[0], rel=1e-12)
        assert (own.tau1, own.tau2) == pytest.approx(tuple(solved.tau), rel=1e-6)
        left = level.mean - release_curve(own, level.time_s)
        assert own.sse == pytest.approx(left @ left, rel=1e-12)


def test_gradient_and_second_derivatives_against_differences() -> None:
    data, shares = data_of(_noisy([TIME] * 3)), np.array([0.7, 0.8, 0.9])
    x, points = np.log([0.3, 4.0]), data.points
    _, gradient, _, exact = release._projected(x, points, shares)
    assert release._on_every_sample(x, data, shares)[1] == pytest.approx(gradient, rel=1e-6)
    for k in (0, 1):
        step = 1e-5 * np.eye(2)[k]
        up, down = (release._projected(x + sign * step, points, shares) for sign in (1, -1))
        assert gradient[k] == pytest.approx((up[0] - down[0]) / 2e-5, rel=1e-5)
        assert exact[:, k] == pytest.approx((up[1] - down[1]) / 2e-5, rel=1e-4)


@pytest.mark.slow
def test_a_release_faster_than_the_samples_stays_within_the_limits() -> None:
    time_s = np.arange(8) * 1e-3
    truth = (0.3, (0.41, 0.22)), (0.6, (0.53, 0.31)), (1.2, (0.45, 0.17))
    falls = []
    for i, (fast, (amplitude, slow)) in enumerate(truth):
        y = 1e9 * (amplitude * np.exp(-time_s / (fast * 1e-3)) + slow * np.exp(-time_s / 8e-3))
        falls.append(Level(10.0 * (i + 1), time_s, y[None], (f"{i}",)))
    found, _ = release_fit(falls, (), {})
    pairs = np.log([(a, b) for a in np.geomspace(1e-3, 7e3, 60) for b in np.geomspace(a, 7e3, 60)])
    for row, fall in zip(found.levels, falls, strict=True):
        assert row.solver.converged and 0.001 - 1e-10 <= row.tau1 <= row.tau2 + 1e-10
        points = data_of([fall]).points
        assert row.sse <= (1 + 1e-9) * min(release._projected(x, points, np.array([0.85]))[0] for x in pairs)


@pytest.mark.parametrize(("tau1", "tau2", "fast"), [(87.2, 58781.0, 0.65), (86.7, 21114.0, 0.77)])
def test_a_start_still_on_its_way_down_is_a_rival(tau1: float, tau2: float, fast: float) -> None:
    time_s = np.arange(300) + 0.4
    y = 2900.0 * (fast * np.exp(-time_s / tau1) + (1 - fast) * np.exp(-time_s / tau2))
    (row,) = release_fit([Level(80.0, time_s, y[None], ("a",))], (), {})[0].levels
    assert row.solver.converged and row.sse < 1e-4  # another minimum, τ1 and τ2 close together, lies at 0.3 and more
    assert row.tau1 == pytest.approx(tau1, rel=1e-4)
