import numpy as np
import pytest

from eaid.errors import UsageError
from eaid.models.nonlinear import at_duty
from eaid.models.parameters import REFERENCE_PLANT, Friction
from eaid.results import codec
from eaid.uncertainty.design import (
    Plan,
    Rig,
    Wanted,
    duty_breaks,
    half_widths,
    level_sets,
    plan,
    run_order,
    wanted_of,
)
from eaid.uncertainty.noise import ASSUMED, Noise, inverse_information, noise_from_json, noise_part
from eaid.uncertainty.student_t import t_quantile

SMALL = Plan((10.0, 50.0), (20.0, 30.0), 3, {}, 0.0, True)


def curve_at(duty: float) -> Friction:
    return at_duty(REFERENCE_PLANT, duty)


def test_widths_of_pure_scatter_by_hand() -> None:
    """No noise within a run: t σ/√R at a level, exp(·) − 1 in percent."""
    noise = Noise(0.0, 0.0, (0.03, 0.05, 0.1))
    levels = np.array([20.0, 50.0, 80.0])
    curves = [curve_at(u) for u in levels]
    found = half_widths(curves, levels, np.full(3, 30.0), 4, noise, polynomial=False)
    t = t_quantile(9)
    for name, sd in (("Ts", 0.03), ("tau1", 0.05), ("tau2", 0.1)):
        assert found[name] == pytest.approx(100 * np.expm1(t * sd / 2))


def test_information_grows_with_the_hold() -> None:
    short, long = (np.diag(inverse_information(curve_at(50.0), hold)) for hold in (5.0, 60.0))
    assert (long < short).all() and long[2] < short[2] / 50


def test_information_is_the_sum_over_samples() -> None:
    from eaid.uncertainty.levels import log_jacobian

    t = (np.arange(40_000) + 0.5) * 1e-3
    J = log_jacobian(curve_at(50.0), t)
    assert inverse_information(curve_at(50.0), 40.0) == pytest.approx(np.linalg.inv(J.T @ J * 1e-3), rel=1e-2)


def test_the_plan_reaches_what_is_wanted_and_no_cheaper_one_does() -> None:
    rig = Rig()
    wanted = [Wanted("tau2", 10.0), Wanted("Ts", 3.0)]
    sets = level_sets((10.0, 100.0), 12)
    found = plan(curve_at, sets, wanted, ASSUMED, rig)
    assert found.met
    assert found.half_width_pct["tau2"] <= 10 and found.half_width_pct["Ts"] <= 3
    curves = [curve_at(u) for u in found.levels]
    fewer = half_widths(curves, np.array(found.levels), np.array(found.hold_s), found.repeats - 1, ASSUMED)
    assert fewer["tau2"] > 10 or fewer["Ts"] > 3
    easier = plan(curve_at, sets, [Wanted("tau2", 20.0), Wanted("Ts", 6.0)], ASSUMED, rig)
    assert easier.time_s < found.time_s


def test_what_cannot_be_reached_is_said() -> None:
    hopeless = plan(curve_at, level_sets((10.0, 100.0), 6), [Wanted("Ts", 0.01)], ASSUMED, Rig())
    assert not hopeless.met and hopeless.repeats == 20


def test_every_block_has_every_level_once_in_an_order_of_its_own() -> None:
    levels = tuple(float(u) for u in range(10, 101, 10))
    steps = run_order(Plan(levels, (20.0,) * 10, 3, {}, 0.0, True), Rig(), seed=0)
    blocks = [[s.level for s in steps if s.repeat == r] for r in (1, 2, 3)]
    assert all(sorted(block) == sorted(levels) for block in blocks)
    assert blocks[0] != blocks[1] != blocks[2] and all(block != sorted(block) for block in blocks)
    assert [s.order for s in steps] == list(range(1, 31))
    assert run_order(SMALL, Rig(), 4) == run_order(SMALL, Rig(), 4)


def test_duty_file_holds_idle_level_release() -> None:
    breaks = duty_breaks(run_order(SMALL, Rig(idle_s=5, release_s=7), seed=1)[:2])
    first, second = [level for _, level in breaks if level > 0]
    hold = {10.0: 20.0, 50.0: 30.0}
    ends = 5 + hold[first] + 7
    assert breaks == [
        (0.0, 0.0), (5.0, first), (5 + hold[first], 0.0), (ends + 5, second), (ends + 5 + hold[second], 0.0),
        (ends + 5 + hold[second] + 7, 0.0),
    ]  # fmt: skip


@pytest.mark.parametrize("text", ["tau2", "tau3=5", "Ts=0", "Ts=150", "Ts=2,,", "tau2=x"])
def test_bad_wishes_are_refused(text: str) -> None:
    with pytest.raises(UsageError, match="--want"):
        wanted_of(text)


def test_wishes() -> None:
    assert wanted_of("tau2=10, Ts=2%") == [Wanted("tau2", 10.0), Wanted("Ts", 2.0)]


def test_noise_survives_the_file_and_is_assumed_aloud_without_one() -> None:
    noise = Noise(1e-6, 2e-5, (0.02, 0.03, 0.04))
    assert noise_from_json({"uncertainty": {"noise": codec.to_plain(noise_part(noise))}}) == (noise, None)
    found, word = noise_from_json({"nonlinear": {}})
    assert found == ASSUMED and word is not None and "assumed" in word
