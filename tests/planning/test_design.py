import numpy as np
import pytest

from eaid.models.nonlinear import at_duty
from eaid.models.parameters import REFERENCE_PLANT, Friction
from eaid.planning.design import Experiment, Session, half_widths, level_sets, quickest, within_runs
from eaid.planning.recordings import input_changes, run_order
from eaid.uncertainty.rig_noise import ASSUMED, Noise, cautious, unit_variances
from eaid.uncertainty.runs import t_quantile

SMALL = Experiment((10.0, 50.0), (20.0, 30.0), 3, {}, 0.0, True)


def curve_at(duty: float) -> Friction:
    return at_duty(REFERENCE_PLANT, duty)


def test_widths_of_pure_scatter_by_hand() -> None:
    """No noise within a run: t σ/√R at a level, exp(·) − 1 in percent."""
    noise = Noise(0.0, 0.0, (0.03, 0.05, 0.1))
    levels = np.array([20.0, 50.0, 80.0])
    curves = [curve_at(u) for u in levels]
    found = half_widths(within_runs(curves, np.full(3, 30.0), noise), curves, levels, 4, noise, polynomial=False)
    t = t_quantile(9)
    for name, sd in (("Ts", 0.03), ("tau1", 0.05), ("tau2", 0.1)):
        assert found[name] == pytest.approx(100 * np.expm1(t * sd / 2))


def test_information_grows_with_the_hold() -> None:
    short, long = (unit_variances(curve_at(50.0), hold)[:, 0] for hold in (5.0, 60.0))
    assert (long < short).all() and long[2] < short[2] / 50


def test_information_is_the_sum_over_samples() -> None:
    from eaid.uncertainty.level_statistics import log_jacobian

    t = (np.arange(40_000) + 0.5) * 1e-3
    J = log_jacobian(curve_at(50.0), t)
    inverse = np.linalg.inv(J.T @ J * 1e-3)
    found = unit_variances(curve_at(50.0), 40.0)
    assert found[:, 0] == pytest.approx(np.diag(inverse), rel=1e-2)
    scores = inverse @ (J.T * J[:, 0]) * np.sqrt(1e-3)  # noise of density 1 times the torque itself
    assert found[:, 1] == pytest.approx((scores**2).sum(axis=1), rel=1e-2)


def test_the_plan_reaches_what_is_wanted_and_no_cheaper_one_does() -> None:
    session = Session()
    wanted = {"tau2": 10.0, "Ts": 3.0}
    sets = level_sets((10.0, 100.0), 12)
    found = quickest(curve_at, sets, wanted, ASSUMED, session)
    assert found.met
    assert found.half_width_pct["tau2"] <= 10 and found.half_width_pct["Ts"] <= 3
    curves = [curve_at(u) for u in found.levels]
    within = within_runs(curves, np.array(found.hold_s), ASSUMED)
    fewer = half_widths(within, curves, np.array(found.levels), found.repeats - 1, ASSUMED)
    assert fewer["tau2"] > 10 or fewer["Ts"] > 3
    easier = quickest(curve_at, sets, {"tau2": 20.0, "Ts": 6.0}, ASSUMED, session)
    assert easier.time_s < found.time_s


def test_what_cannot_be_reached_is_said() -> None:
    hopeless = quickest(curve_at, level_sets((10.0, 100.0), 6), {"Ts": 0.01}, ASSUMED, Session())
    assert not hopeless.met and hopeless.repeats == 20


@pytest.mark.parametrize(
    ("known", "first"),
    [((10.0, 100.0), 10.0), ((0.010, 0.015), 0.01), ((30.0, 300.0), 30.0), ((1e-6, 3e-6), 1e-6)],
)
def test_levels_are_apart_in_every_unit(known: tuple[float, float], first: float) -> None:
    """Levels of 0.010 to 0.015 were rounded to 0.0 and planned eight times over."""
    for levels in level_sets(known, 12):
        assert levels[0] == first and levels[-1] == known[1] and len(set(levels)) >= 8
        assert np.diff(levels) == pytest.approx((known[1] - known[0]) / (len(levels) - 1), rel=0.11)


def test_one_level_is_planned_once() -> None:
    assert level_sets((50.0, 50.0), 12) == [[50.0]]


def test_every_block_has_every_level_once_in_an_order_of_its_own() -> None:
    levels = tuple(float(u) for u in range(10, 101, 10))
    runs = run_order(Experiment(levels, (20.0,) * 10, 3, {}, 0.0, True), Session(), seed=0)
    blocks = [[s.level for s in runs if s.repeat == r] for r in (1, 2, 3)]
    assert all(sorted(block) == sorted(levels) for block in blocks)
    assert blocks[0] != blocks[1] != blocks[2] and all(block != sorted(block) for block in blocks)
    assert [s.order for s in runs] == list(range(1, 31))
    assert run_order(SMALL, Session(), 4) == run_order(SMALL, Session(), 4)


def test_duty_file_holds_idle_level_release() -> None:
    changes = input_changes(run_order(SMALL, Session(idle_s=5, release_s=7), seed=1)[:2])
    first, second = [level for _, level in changes if level > 0]
    hold = {10.0: 20.0, 50.0: 30.0}
    ends = 5 + hold[first] + 7
    assert changes == [
        (0.0, 0.0), (5.0, first), (5 + hold[first], 0.0), (ends + 5, second), (ends + 5 + hold[second], 0.0),
        (ends + 5 + hold[second] + 7, 0.0),
    ]  # fmt: skip


def test_scatter_that_is_known_from_few_runs_is_taken_larger() -> None:
    """√(ν/χ²) at 20 %: 1.17 for 20 degrees of freedom, by hand from χ²₀.₂(20) = 14.578."""
    assert cautious(ASSUMED, 20.0).scatter[0] == pytest.approx(0.03 * np.sqrt(20 / 14.578), rel=1e-4)
    assert cautious(ASSUMED, 0.0) == ASSUMED
