"""Metrics, references and the plant at the edges of their definitions, each worked out by hand."""

import math
from dataclasses import replace

import numpy as np
import pytest

from eaid.errors import DataError, UsageError
from eaid.models.parameters import REFERENCE_PLANT, Nonlinear
from eaid.replay import metrics, references
from eaid.replay.plant import (
    INSTANT,
    Held,
    PlantParameters,
    falling_taus,
    hold_step,
    perturbed,
    plant_parameters,
    plant_step,
    plant_terms,
    rest,
    rounded,
)
from eaid.replay.references import MOST_SAMPLES, Reference, Tone

PLANT = plant_parameters(REFERENCE_PLANT)
RELEASING = replace(REFERENCE_PLANT, release=(1.5, 9.0))


# metrics


def test_a_rise_is_counted_from_the_first_sample_that_reaches_a_tenth() -> None:
    """0.1 and 0.9 of a step of 8 lie at 0.8 and 7.2: two tenths of the way from 0 to 4, and of that from 7 to 8."""
    found = metrics.step(np.array([0.0, 4.0, 7.0, 8.0, 6.0, 8.0]), 0.0, 8.0, 0.5)
    assert found.rise_time_s == pytest.approx(0.5 * (2 + 0.2 - 0.2), rel=1e-12)
    assert found.settling_s == 2.5 and found.settling_5pct_s == 2.5
    assert (found.from_nm, found.to_nm, found.overshoot_pct) == (0.0, 8.0, 0.0)


def test_a_torque_that_starts_above_nine_tenths_rises_in_no_time() -> None:
    found = metrics.step(np.array([0.95, 0.99, 1.03, 1.0]), 0.0, 1.0, 0.1)
    assert found.rise_time_s == 0.0 and found.overshoot_pct == pytest.approx(3.0)
    assert found.settling_s == pytest.approx(0.3) and found.settling_5pct_s == pytest.approx(0.1)


def test_a_torque_that_stands_at_a_tenth_or_at_nine_of_them_is_there_from_its_first_sample() -> None:
    found = metrics.step(np.array([0.0, 1.0, 1.0, 9.0, 9.0, 10.0]), 0.0, 10.0, 0.5)
    assert found.rise_time_s == 1.0
    assert metrics.step(np.array([0.0, 1.0, 9.0, 9.0]), 0.0, 10.0, 0.5).rise_time_s == 0.5


def test_what_reaches_a_tenth_and_no_more_has_no_rise_time() -> None:
    found = metrics.step(np.array([0.0, 0.5, 0.85]), 0.0, 1.0, 0.1)
    assert found.rise_time_s is None and found.overshoot_pct == 0.0


def test_a_step_that_leaves_its_band_at_the_end_has_not_settled() -> None:
    found = metrics.step(np.array([0.0, 1.0, 1.0, 1.03]), 0.0, 1.0, 0.1)
    assert found.settling_s is None and found.settling_5pct_s == pytest.approx(0.1)


def test_a_tone_by_hand() -> None:
    """Twice the reference a quarter of a period late: +6.02 dB and −90°; the error is |sin + 2 cos| on average."""
    angle = 2 * np.pi * np.arange(400) / 100
    found = metrics.tone(np.sin(angle), -2 * np.cos(angle), 2.5, 1 / 250)
    assert found.frequency_hz == 2.5 and found.gain_db == pytest.approx(20 * math.log10(2), abs=1e-9)
    assert found.phase_deg == pytest.approx(-90.0, abs=1e-9)
    assert found.mean_abs_error_nm == pytest.approx(math.sqrt(5) * 2 / math.pi, rel=1e-3)
    early = metrics.tone(np.sin(angle), np.sin(angle + 0.5), 2.5, 1 / 250)
    assert early.phase_deg == pytest.approx(math.degrees(0.5), abs=1e-9)


def test_a_cosine_is_a_quarter_ahead_of_the_sine() -> None:
    angle = 2 * np.pi * np.arange(40) / 20
    assert metrics.fundamental(3 * np.cos(angle) + 7, 5.0, 0.01) == pytest.approx(3j, abs=1e-12)


# references


def test_where_errors_count_from_and_how_steep_a_reference_is() -> None:
    made = Reference(np.array([0.0, 1.0, 4.0, 3.0]), 0.5, counted_from_s=1.2)
    assert made.begin == 2  # 2.4 samples
    assert made.steepest_nm_s == 4.0  # (4 − 0)/1.0 in the middle; 2 and −2 at the ends
    assert (Reference(np.zeros(2), 0.5).begin, Reference(np.zeros(2), 0.5).steps) == (0, ())


def test_the_default_lengths_and_levels() -> None:
    assert len(references.steps(0.01).torque_nm) == 4500
    assert references.steps(0.01).torque_nm[250::500].tolist() == [0.0, 1.0, 2.0, 3.0, 4.0, 3.0, 2.0, 1.0, 0.0]
    assert len(references.ramp(0.01).torque_nm) == 1000 and len(references.multisine(0.01).torque_nm) == 1200


def test_a_ramp_by_hand() -> None:
    assert references.ramp(0.5, 2.5).torque_nm.tolist() == [0.0, 2.0, 4.0, 2.0, 0.0]
    assert references.ramp(0.5, 2.5, top=0.25).torque_nm.tolist() == [0.0, 0.5, 1.0, 0.5, 0.0]
    assert len(references.ramp(0.5, pace=4.0).torque_nm) == 5


@pytest.mark.parametrize(("length", "counted"), [(4.0, 0.0), (5.0, 0.0), (5.5, 5.0), (12.0, 5.0)])
def test_a_multisine_that_ends_before_it_has_settled_counts_whole(length: float, counted: float) -> None:
    assert references.multisine(0.01, length).counted_from_s == counted
    assert references.multisine(0.005, length / 2, pace=2.0).counted_from_s == counted / 2


def test_a_multisine_at_another_pace_is_the_same_on_its_own_clock() -> None:
    paper, own = references.multisine(1e-3), references.multisine(5e-4, top=3.0, pace=2.0)
    np.testing.assert_allclose(own.torque_nm, 3.0 * paper.torque_nm, atol=1e-11)
    assert (own.begin, own.counted_from_s) == (5000, 2.5)


def test_a_sweep_at_another_pace_is_the_same_on_its_own_clock() -> None:
    paper, own = references.sweep(1e-2), references.sweep(2.5e-3, top=0.5, pace=4.0)
    np.testing.assert_allclose(own.torque_nm, 0.5 * paper.torque_nm, atol=1e-9)
    assert [(tone.begin, tone.end) for tone in own.tones] == [(tone.begin, tone.end) for tone in paper.tones]
    assert [tone.frequency_hz for tone in own.tones] == [4.0 * tone.frequency_hz for tone in paper.tones]
    assert own.counted_from_s == pytest.approx(paper.counted_from_s / 4)


def test_tones_by_hand() -> None:
    """0.15 Hz settles for 2 periods (13.3 s) and is measured for 2; 1 Hz for 10 and 5, each from its phase 0."""
    made = references.sweep(0.02, frequencies_hz=(0.15, 1.0))
    assert made.tones == (Tone(0.15, 667, 1333), Tone(1.0, 1833, 2083))
    time = np.arange(1333) * 0.02
    np.testing.assert_allclose(made.torque_nm[:1333], 2 + np.sin(2 * np.pi * 0.15 * time), atol=1e-12)
    assert made.torque_nm[1333] == 2.0 and made.torque_nm[1333 + 12] == pytest.approx(2 + np.sin(2 * np.pi * 0.24))
    assert made.counted_from_s == pytest.approx(13.34)


def test_a_tone_may_have_a_quarter_of_the_control_rate_and_no_more() -> None:
    assert references.sweep(0.25, frequencies_hz=(1.0,)).tones[0].frequency_hz == 1.0
    for frequency in (1.01, 4.0):
        with pytest.raises(UsageError, match=r"up to a quarter of the control rate, 1 Hz"):
            references.sweep(0.25, frequencies_hz=(0.5, frequency))


def test_how_many_samples_a_reference_may_have(monkeypatch: pytest.MonkeyPatch) -> None:
    assert references.samples_of(0.2, 0.1) == 2 and references.samples_of(MOST_SAMPLES * 0.5, 0.5) == MOST_SAMPLES
    assert references.samples_of(1.26, 0.1) == 13
    with pytest.raises(UsageError, match="fewer than two control samples"):
        references.samples_of(0.14, 0.1)
    with pytest.raises(UsageError, match=r"20,000,001 control samples .* replay takes 20,000,000"):
        references.samples_of((MOST_SAMPLES + 1) * 0.5, 0.5)
    monkeypatch.setattr(references, "MOST_SAMPLES", 1000)
    assert len(references.sampled(np.array([3.0, 252.75]), np.zeros(2), 0.25).torque_nm) == 1000
    with pytest.raises(UsageError, match="1,001 control samples"):
        references.sampled(np.array([3.0, 253.0]), np.zeros(2), 0.25)


def test_a_reference_of_the_users_own_lies_on_the_control_grid_from_its_first_instant() -> None:
    """0.3 s are three intervals of 0.1 s although 3·0.1 is a hair more; 0.39 s are three as well."""
    for end in (5.3, 5.39):
        made = references.sampled(np.array([5.0, 5.1, end]), np.array([0.0, 1.0, 1.0]), 0.1)
        np.testing.assert_allclose(made.torque_nm, [0.0, 1.0, 1.0, 1.0], atol=1e-9)
    with pytest.raises(DataError, match=r"my\.csv: lasts 0\.09 s, less than one control interval"):
        references.sampled(np.array([5.0, 5.09]), np.zeros(2), 0.1, "my.csv")


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        ("0,1\n\n1,2\n\n1,3\n", r"time does not rise at row 6 \(1 s after 1 s\)"),
        ("0,1\n1,2\n0.5,3\n", r"time does not rise at row 4 \(0.5 s after 1 s\)"),
        ("0,1\n\n1,inf\n2,x\n", "reference_nm in row 4 is 'inf'"),
        ("\n0,1\n", r"holds 1 row\(s\)"),
    ],
)
def test_a_fault_is_named_by_its_row_in_the_file(tmp_path, rows: str, said: str) -> None:
    path = tmp_path / "r.csv"
    path.write_text("time_s,reference_nm\n" + rows)
    with pytest.raises(DataError, match=said):
        references.read_reference(path)


def test_two_rows_are_a_reference_and_other_columns_are_passed_over(tmp_path) -> None:
    path = tmp_path / "r.csv"
    path.write_text("note, time_s ,reference_nm\na,0,1\nb,2,3\n", encoding="utf-8-sig")
    assert [column.tolist() for column in references.read_reference(path)] == [[0.0, 2.0], [1.0, 3.0]]


# the plant


def test_every_coefficient_has_its_power() -> None:
    """At u = 2 %: 1 + 2·2 + 3·4 = 17 s, 40 + 2·5 + 4·6 = 74 s, 7 + 2·8 + 4·9 + 8·10 = 139 N·m."""
    curved = Nonlinear(tau1=(1.0, 2.0, 3.0), tau2=(40.0, 5.0, 6.0), Ts=(7.0, 8.0, 9.0, 10.0), u_range=(0.0, 100.0))
    assert plant_terms(plant_parameters(curved), 2.0) == (17.0, 74.0, 139.0)
    short = replace(curved, tau1=(1.0,), tau2=(40.0, 5.0), Ts=(7.0,))
    assert plant_terms(plant_parameters(short), 2.0) == (1.0, 50.0, 7.0)


@pytest.mark.parametrize(("part", "most"), [("tau1", 3), ("tau2", 3), ("Ts", 4)])
def test_as_many_coefficients_as_the_equations_have(part: str, most: int) -> None:
    for count in (1, most):
        assert isinstance(plant_parameters(replace(REFERENCE_PLANT, **{part: (1.0,) * count})), PlantParameters)
    for count in (0, most + 1):
        with pytest.raises(DataError, match=f"nonlinear.{part} has {count} coefficients; the replay takes 1 to {most}"):
            plant_parameters(replace(REFERENCE_PLANT, **{part: (1.0,) * count}))


@pytest.mark.parametrize(("low", "high", "taken"), [(0.0, 0.5, True), (50.0, 50.0, True), (0.0, 0.0, False),
                                                    (-1.0, 50.0, False), (51.0, 50.0, False)])  # fmt: skip
def test_identified_duties_rise_from_nothing_or_above(low: float, high: float, taken: bool) -> None:
    plant = replace(REFERENCE_PLANT, u_range=(low, high))
    if taken:
        made = plant_parameters(plant)
        assert (made.u_low, made.u_high) == (low, high)
    else:
        with pytest.raises(DataError, match="must rise from 0 or above"):
            plant_parameters(plant)


def test_floors_one_by_one() -> None:
    """τ1 of 0.1 ms is 1 ms; τ2 below τ1 is τ1; T_s below 0 is 0; what lies above a floor stays."""
    for tau1, tau2, torque, found in (
        (1e-4, 2.0, 3.0, (1e-3, 2.0, 3.0)),
        (0.5, 0.4, 3.0, (0.5, 0.5, 3.0)),
        (0.5, 0.6, -1.0, (0.5, 0.6, 0.0)),
        (2e-3, 3e-3, 0.5, (2e-3, 3e-3, 0.5)),
    ):
        plant = Nonlinear(tau1=(tau1,), tau2=(tau2,), Ts=(torque,), u_range=(10.0, 100.0))
        assert plant_terms(plant_parameters(plant), 50.0) == found
    drawn = Nonlinear(tau1=(0.5,), tau2=(0.6,), Ts=(-1.0,), u_range=(10.0, 100.0))
    assert [plant_terms(plant_parameters(drawn), duty)[2] for duty in (-5.0, -0.5, 0.0, 5.0)] == [0.0] * 4


def test_nothing_drives_the_plant_below_a_duty_of_zero() -> None:
    plant = plant_parameters(replace(REFERENCE_PLANT, Ts=(2.0,)))
    assert [plant_terms(plant, duty)[2] for duty in (-1.0, 0.0, 2.5, 10.0)] == [0.0, 0.0, 0.5, 2.0]
    from_zero = plant_parameters(replace(REFERENCE_PLANT, Ts=(2.0,), u_range=(0.0, 100.0)))
    assert [plant_terms(from_zero, duty)[2] for duty in (-1.0, 0.0, 0.5)] == [0.0, 2.0, 2.0]


def test_where_falls_are_as_quick_as_the_release_every_fall_has_its_constants() -> None:
    every = plant_parameters(replace(RELEASING, falls_as_release=True))
    assert falling_taus(every, 50.0) == (1.5, 9.0) and falling_taus(every, 0.0) == (1.5, 9.0)
    assert plant_step(every, 0.0, 0.0, 50.0, 0.1) == plant_step(PLANT, 0.0, 0.0, 50.0, 0.1)  # a rise has its own
    to_rest = plant_parameters(RELEASING)
    assert falling_taus(to_rest, 50.0) == plant_terms(PLANT, 50.0)[:2] and falling_taus(to_rest, 0.0) == (1.5, 9.0)
    assert falling_taus(to_rest, -3.0) == (1.5, 9.0)
    assert falling_taus(PLANT, 0.0) == plant_terms(PLANT, 0.0)[:2]  # no release was fitted


def test_one_part_may_fall_while_the_other_rises() -> None:
    """At 5 % of the release's plant T_s is 0.7 N·m or so: the fast part falls from 2, the slow one rises from 0."""
    to_rest = plant_parameters(RELEASING)
    tau1, tau2, steady = plant_terms(PLANT, 5.0)
    x1, x2 = plant_step(to_rest, 2.0, 0.0, 5.0, 0.3)
    fast, slow = PLANT.C * steady, (1 - PLANT.C) * steady
    assert x1 == pytest.approx(fast + (2.0 - fast) * math.exp(-0.3 / (0.5 * tau1 + 0.5 * 1.5)), rel=1e-13)
    assert x2 == pytest.approx(slow * -math.expm1(-0.3 / tau2), rel=1e-13)


def test_factors_multiply_what_they_name() -> None:
    assert perturbed(RELEASING, {}) is RELEASING
    changed = perturbed(RELEASING, {"tau2": 3.0})
    assert changed.tau2 == tuple(3 * c for c in RELEASING.tau2) and changed.release == (1.5, 27.0)
    assert (changed.tau1, changed.Ts) == (RELEASING.tau1, RELEASING.Ts)
    assert perturbed(REFERENCE_PLANT, {"tau1": 2.0}).release is None


@pytest.mark.parametrize(
    ("duty", "given"), [(0.0, 0.0), (1.2, 0.0), (1.25, 2.5), (3.7, 2.5), (3.8, 5.0), (99.0, 100.0)]
)
def test_a_duty_is_rounded_to_the_nearest_that_the_output_has(duty: float, given: float) -> None:
    assert rounded(duty, 2.5) == given and rounded(duty, 0.0) == duty


# the latch


def at(k: int, pulse: int, period: float) -> tuple[Held, float]:
    """From sample k with 60 % asked, 20 % latched and so many pulses begun."""
    return hold_step(PLANT, period, 0.1, k, 60.0, Held(1.0, 0.2, 20.0, pulse))


def parts(*holds: tuple[float, float]) -> tuple[float, float]:
    x1, x2 = 1.0, 0.2
    for duty, seconds in holds:
        x1, x2 = plant_step(PLANT, x1, x2, duty, seconds)
    return x1, x2


@pytest.mark.parametrize(
    ("k", "pulse", "period", "mean", "latched", "then", "holds"),
    [
        (7, 3, 0.0, 60.0, 60.0, 3, [(60.0, 0.1)]),  # no PWM: at once
        (4, 2, 2.0, 60.0, 60.0, 3, [(60.0, 0.1)]),  # a pulse begins with the sample
        (5, 3, 2.0, 20.0, 20.0, 3, [(20.0, 0.1)]),  # the next begins with the next sample
        (2, 1, 2.25, 50.0, 60.0, 2, [(20.0, 0.025), (60.0, 0.075)]),  # a quarter of the sample later
        (3, 2, 2.25, 20.0, 20.0, 2, [(20.0, 0.1)]),
        (0, 0, 0.4, 60.0, 60.0, 3, [(60.0, 0.1)]),  # pulses at 0, 0.4, 0.8: the next sample's first is at 1.2
        (9, 3, 2.0, 60.0, 60.0, 5, [(60.0, 0.1)]),  # late: the pulse of sample 6 has begun
    ],
)  # fmt: skip
def test_a_pwm_latches_the_duty_at_its_next_pulse(
    k: int, pulse: int, period: float, mean: float, latched: float, then: int, holds: list[tuple[float, float]]
) -> None:
    held, applied = at(k, pulse, period)
    assert applied == pytest.approx(mean, rel=1e-12) and (held.latched, held.pulse) == (latched, then)
    assert (held.x1, held.x2) == pytest.approx(parts(*holds), rel=1e-12)


def test_instants_nearer_than_a_billionth_of_a_sample_are_one() -> None:
    held, applied = at(6, 2, 3.0 + 0.25 * INSTANT)  # the pulse begins half of it behind the sample
    assert applied == pytest.approx(60.0, rel=1e-8) and (held.latched, held.pulse) == (60.0, 3)
    held, applied = at(5, 2, 3.0 - 0.25 * INSTANT)  # … or half of it before the next: that is the next
    assert (applied, held.latched, held.pulse) == (20.0, 20.0, 2)


def test_at_rest_nothing_has_begun() -> None:
    assert rest() == (0.0, 0.0, 0.0, 0)
