"""The rehabilitation of §VII: specification 7's numbers over ten seeds, the limb in closed form, statistics by hand."""

import dataclasses

import msgspec
import numpy as np
import pytest
from scipy import stats

from eaid.control.gains import paper_gains
from eaid.errors import GainsError, UsageError
from eaid.models.parameters import PAPER_LINEAR, REFERENCE_PLANT, Nonlinear
from eaid.replay.controllers import CONTROLLERS, Knowledge
from eaid.replay.plant import plant_parameters
from eaid.replay.rehab import (
    MODES,
    Session,
    box,
    by_cycles,
    by_samples,
    cycle_means,
    independent,
    limb_steps,
    rehabilitate,
    statistics,
)
from eaid.replay.rig import Rig, noise
from eaid.results.replay import Exercise

PLANT = plant_parameters(REFERENCE_PLANT)
KNOWN = Knowledge(REFERENCE_PLANT, PAPER_LINEAR, *paper_gains())
RC = CONTROLLERS["rc"](KNOWN)


def session(seed: int = 0, rig: Rig | None = None, **changes: float) -> Session:
    return rehabilitate(PLANT, RC, msgspec.structs.replace(Exercise(), **changes), rig or Rig(), 1e-3, seed)


@pytest.fixture(scope="module")
def ten() -> list[Session]:
    return [session(seed) for seed in range(10)]


def test_ten_seeds_give_the_numbers_of_spec_7(ten: list[Session]) -> None:
    position = np.array([[np.median(np.abs(s.position_error_deg[s.counted(mode)])) for mode in MODES] for s in ten])
    torque = np.array([[np.abs(s.torque_error_nm[s.counted(mode)]).mean() for mode in MODES] for s in ten])
    soft, hard, assisted = position.T
    # 2…4° (soft): one seed of these ten, the worst of sixty tried, has 4.4°
    assert np.sum((soft > 2) & (soft < 4)) >= 9 and soft.max() < 4.5
    assert abs(hard.mean() - 7.5) < 0.5 and hard.min() > 5.5 and hard.max() < 9
    np.testing.assert_allclose(assisted, 2.3, atol=0.1)
    assert np.sum(soft > assisted) >= 8 and np.all(hard > soft)
    np.testing.assert_allclose(torque.mean(axis=0), [0.027, 0.035, 0.024], atol=0.0015)


def test_the_session_is_what_section_7_says_sample_by_sample(ten: list[Session]) -> None:
    s = ten[3]
    t = s.replay.time_s
    np.testing.assert_allclose(s.target_deg, 35 - 25 * np.cos(2 * np.pi * 0.15 * t), atol=1e-9)
    assert s.angle_deg[0] == pytest.approx(10.0) and s.angle_deg[1] == pytest.approx(10.0, abs=0.01)
    theta = np.radians(s.angle_deg)
    bent = np.maximum(0, theta - np.radians(10))
    # far from the blends each mode stands alone
    soft, hard = (t > 10) & (t < 25), (t > 40) & (t < 55)
    np.testing.assert_allclose(s.desired_nm[soft], -1.0 * bent[soft], atol=1e-9)
    np.testing.assert_allclose(s.desired_nm[hard], -3.0 * bent[hard], atol=1e-9)
    error = np.radians(s.position_error_deg)
    late = (t >= 70) & (t < 89)
    slope = np.diff(s.desired_nm[late]) - 3.0 * np.diff(error[late])
    np.testing.assert_allclose(slope, 10.0 * 1e-3 * error[late][:-1], atol=1e-9)
    # extension until the middle of the blend, then flexion
    assert np.all(s.rendered_nm[t < 60] <= 0) and np.all(s.rendered_nm[t >= 60] >= 0)
    assert set(s.mode[(t >= 30) & (t < 60)]) == {1}


def test_no_step_of_torque_reaches_the_limb(ten: list[Session]) -> None:
    for s in ten:
        assert np.abs(np.diff(s.replay.reference_nm)).max() <= 20.0 * 1e-3 * (1 + 1e-9)
        # but for the slow part of the clutch, still there when the rotor turns round
        steps = np.abs(np.diff(s.rendered_nm))
        assert steps[59_999] == s.turn_step_nm < 0.4
        steps[59_999] = 0.0
        assert steps.max() < 0.03


def test_the_hard_mode_loses_no_torque_tracking(ten: list[Session]) -> None:
    for s in ten:
        error = {mode: np.abs(s.torque_error_nm[s.counted(mode)]).mean() for mode in MODES}
        assert error["hard"] < 2 * error["soft"]


def test_a_diverging_limb_is_refused_in_words() -> None:
    with pytest.raises(
        GainsError, match=r"rehab with rc: the (soft|hard) mode diverges, the forearm passes -?\d+° at "
    ) as fault:
        session(1, damping_nms=0.5)
    assert fault.value.exit_code == 5 and "limb damping 0.5 N·m·s/rad" in str(fault.value)


@pytest.mark.slow
def test_the_loop_diverges_where_the_linear_one_is_unstable() -> None:
    # I s² + d s + K + (k + b s) e^(−0.12 s) has its roots on the axis at d = 0.515 (soft) and 0.580 (hard)
    for stiffness, damping, frequency in ((1.0, 0.51456, 11.784919), (3.0, 0.58036, 12.671664)):
        s = 1j * frequency
        assert abs(0.1 * s**2 + damping * s + stiffness + (8 + s) * np.exp(-0.12 * s)) < 1e-3
    with pytest.raises(GainsError, match="the hard mode diverges"):
        session(1, damping_nms=0.55)
    assert np.abs(session(1, damping_nms=0.6).position_error_deg).max() < 30


@pytest.mark.slow
def test_the_same_seed_gives_the_same_session_and_noise_of_its_own(ten: list[Session]) -> None:
    np.testing.assert_array_equal(session(3).angle_deg, ten[3].angle_deg)
    assert not np.array_equal(ten[3].angle_deg, ten[4].angle_deg)
    noisy = session(3, rig=Rig(noise_nm=0.01))
    assert noisy.replay.measured_nm is not None
    spread = noisy.replay.measured_nm - noisy.replay.torque_nm
    assert spread.std() == pytest.approx(0.01, rel=0.03)
    user = noise(Rig(noise_nm=0.3, noise_correlation_s=0.5), 90_000, 1e-3, 3)
    assert abs(np.corrcoef(spread, user)[0, 1]) < 0.2


@pytest.mark.slow
def test_a_finer_control_interval_changes_little() -> None:
    coarse = session(0, tremor_nm=0.0, mode_s=8.0)
    fine = rehabilitate(PLANT, RC, Exercise(tremor_nm=0.0, mode_s=8.0), Rig(), 2e-4, 0)
    np.testing.assert_allclose(coarse.angle_deg, fine.angle_deg[::5], atol=0.15)


@pytest.mark.parametrize("damping", [0.0, 1e-9, 0.05, 0.8])
def test_the_limb_moves_exactly_under_a_held_moment(damping: float) -> None:
    keep, push, drift, lift = limb_steps(0.2, damping, 0.01)
    angle, speed = 0.0, 0.3
    for _ in range(100):
        angle, speed = angle + drift * speed + lift * 0.7, keep * speed + push * 0.7
    if damping < 1e-6:  # free: θ = v t + M t²/(2 I)
        expected = 0.3 * 1.0 + 0.7 / 0.2 / 2, 0.3 + 0.7 / 0.2
    else:
        rate, final = damping / 0.2, 0.7 / damping
        expected = final + (0.3 - final) * (1 - np.exp(-rate)) / rate, final + (0.3 - final) * np.exp(-rate)
    np.testing.assert_allclose((angle, speed), expected, rtol=2e-7)


def test_a_mode_that_leaves_nothing_to_count_is_refused() -> None:
    with pytest.raises(UsageError, match="leaves nothing after the first 5 s"):
        session(mode_s=5.0)
    with pytest.raises(UsageError, match="too short for a control interval"):
        rehabilitate(PLANT, RC, Exercise(mode_s=6.0), Rig(), 0.7)


def test_box_by_hand() -> None:
    found = box(np.array([1.0, 2.0, 3.0, 4.0, 5.0, 20.0]))
    # quartiles by linear interpolation: 2.25, 3.5, 4.75; whiskers reach to 2.25 − 3.75 and 4.75 + 3.75
    assert (found.q1, found.median, found.q3) == (2.25, 3.5, 4.75)
    assert (found.whisker_low, found.whisker_high, found.outliers, found.n) == (1.0, 5.0, 1, 6)
    assert found.mean == pytest.approx(35 / 6)


def test_samples_of_a_slow_series_are_worth_few_observations() -> None:
    draw = np.random.default_rng(0)
    assert independent(draw.standard_normal(20_000)) > 15_000
    slow = noise(Rig(noise_nm=1.0, noise_correlation_s=0.05), 100_000, 1e-3, 1)
    # an AR(1) with e^(−1/50): n (1 − a)/(1 + a)
    keep = np.exp(-1 / 50)
    assert independent(slow) == pytest.approx(100_000 * (1 - keep) / (1 + keep), rel=0.25)
    assert independent(np.ones(5)) == 1.0


def test_tests_on_cycles_by_hand_and_against_scipy() -> None:
    first, second = np.array([1.0, 2.0, 3.0]), np.array([7.0, 9.0, 8.5])
    found = by_cycles(first, second)
    own = stats.ttest_ind(first, second, equal_var=False)
    assert found.t == pytest.approx(own.statistic) and found.p_welch == pytest.approx(own.pvalue)
    assert found.U == 0.0 and found.p_rank == pytest.approx(0.1)  # 2 of the 20 orders of three against three
    assert found.least_p_rank == pytest.approx(0.1)
    assert by_cycles(first, np.array([])).p_rank is None
    assert by_cycles(np.ones(2), np.ones(2)).p_welch is None
    assert cycle_means(np.arange(7.0), 3).tolist() == [1.0, 4.0]
    assert by_samples(first, second).p == pytest.approx(stats.ttest_ind(first, second).pvalue)


def test_the_statistics_of_a_session(ten: list[Session]) -> None:
    found = statistics(ten[0])
    assert found.modes["soft"].abs_position_error_deg.n == 25_000
    assert found.modes["soft"].abs_position_error_deg.independent < 500
    assert len(found.modes["hard"].cycle_means_deg) == 3  # 25 s hold three whole cycles of 6.67 s
    assert all(found.normality[mode].rejected for mode in MODES)  # as the paper's p < 0.001 says, too
    pairs = {tuple(test.modes): test for test in found.tests}
    assert set(pairs) == {("soft", "hard"), ("soft", "assisted"), ("hard", "assisted")}
    assert pairs["soft", "hard"].samples.p < 1e-10 and pairs["soft", "hard"].cycles.p_welch < 0.05
    assert pairs["soft", "hard"].cycles.p_rank == pytest.approx(0.1)


@pytest.mark.slow
def test_a_limb_in_proportion_moves_as_the_paper_s_does() -> None:
    """A clutch of a tenth of the torque, with a limb and a user of a tenth of the strength: the same angles."""
    tenth = dataclasses.replace(REFERENCE_PLANT, Ts=tuple(0.1 * c for c in REFERENCE_PLANT.Ts))

    def angles(plant: Nonlinear, exercise: Exercise) -> np.ndarray:
        law = CONTROLLERS["inverse"](dataclasses.replace(KNOWN, plant=plant))
        return rehabilitate(plant_parameters(plant), law, exercise, Rig(), 1e-3, 1).angle_deg

    short = msgspec.structs.replace(Exercise(), mode_s=8.0)
    np.testing.assert_allclose(angles(tenth, short.scaled(0.1)), angles(REFERENCE_PLANT, short), atol=1e-6)
