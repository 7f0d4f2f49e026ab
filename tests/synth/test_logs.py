"""The simulated logs against the plant's own step, by closed form, and against the statistics they claim."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import eaid
from eaid.errors import UsageError
from eaid.models.nonlinear import step_response
from eaid.models.parameters import REFERENCE_PLANT, Friction
from eaid.replay.plant import plant_parameters, plant_step
from eaid.results.codec import from_plain
from eaid.results.fit import Fit
from eaid.synth import plants
from eaid.synth.logs import (
    NONE,
    PROTOCOLS,
    Disturbance,
    Protocol,
    coloured,
    measured,
    response,
    sample_times,
    synthesise,
    synthesise_input,
)
from eaid.synth.synthesize import SynthOptions, synthesize

SHORT = Protocol(levels=(40.0, 90.0), repeats=2, idle_s=0.5, hold_s=2.0, release_s=1.0, rate_hz=200.0)


def test_a_clean_clutch_run_is_equation_4_after_its_step() -> None:
    run = synthesise(plants.clutch(), replace(SHORT, idle_s=10.0), NONE, seed=3)[-1]
    held = (run.time_s >= 10.0) & (run.time_s < 12.0)
    expected = step_response(REFERENCE_PLANT, run.time_s[held] - 10.0, 90.0)
    np.testing.assert_allclose(run.output[held], expected, atol=1e-13)
    assert np.all(run.output[run.time_s < 10.0] == 0.0)
    assert run.step_s == 10.0 and run.level == 90.0 and run.repeat == 2


@given(st.lists(st.tuples(st.integers(1, 300), st.floats(0, 100)), min_size=1, max_size=6))
@settings(max_examples=30, deadline=None)
def test_any_stepwise_duty_moves_the_states_as_the_replay_does(holds: list[tuple[int, float]]) -> None:
    released = replace(REFERENCE_PLANT, release=(0.7, 3.0))
    for model in (REFERENCE_PLANT, released):
        parameters, dt = plant_parameters(model), 0.01
        x1 = x2 = 0.0
        torque, changes, samples = [], [], 0
        for length, duty in holds:
            changes.append((samples * dt, duty))
            for _ in range(length):
                torque.append(x1 + x2)
                x1, x2 = plant_step(parameters, x1, x2, duty, dt)
            samples += length
        time_s = np.arange(samples) * dt
        # stamps a hair late, so that k·dt rounded below a change never takes the input before it
        got = response(plants.clutch(model), changes, time_s + 1e-12)
        np.testing.assert_allclose(got, torque, atol=1e-10)


def test_the_release_of_the_log_falls_with_the_plants_own_constants_at_zero_duty() -> None:
    run = synthesise(plants.clutch(), replace(SHORT, hold_s=20.0, release_s=5.0), NONE, seed=0)[0]
    after = run.time_s >= 20.5
    share = step_response(REFERENCE_PLANT, np.array([20.0]), 40.0)[0]
    assert run.output[after][0] == pytest.approx(share, rel=1e-12)
    # specification 4.2: below 10 % the time constants keep the values they have there
    tau1, tau2 = 6.74e-3 + 2.39e-1 - 2.13e-2, 0.93 + 4.1 - 0.264
    u = np.array([0.032 + 9.2e-3 * 40 + 2.1e-4 * 1600 + 1.32e-6 * 64000])[0]
    a = 6.74e-3 + 2.39e-2 * 40 - 2.13e-4 * 1600, 0.93 + 0.41 * 40 - 2.64e-3 * 1600
    x1, x2 = 0.85 * u * -np.expm1(-20 / a[0]), 0.15 * u * -np.expm1(-20 / a[1])
    since = run.time_s[after] - 20.5
    np.testing.assert_allclose(run.output[after], x1 * np.exp(-since / tau1) + x2 * np.exp(-since / tau2), atol=1e-12)


def test_tables_one_and_two_by_hand() -> None:
    at = plants.table_i(170.0)  # 27.056 kPa
    assert at.Ts == pytest.approx(2.4645, abs=2e-4)
    assert at.tau1 == pytest.approx(0.4164, abs=2e-4)
    assert at.tau2 == pytest.approx(5.0745, abs=2e-3)
    at = plants.table_ii(15.0)
    assert at.Ts == pytest.approx(0.349 * 0.031746 + 1.042 * 1.095488, rel=1e-5)
    assert at.tau1 == pytest.approx(0.04383, abs=1e-5)
    assert at.tau2 == pytest.approx(4.641, abs=1e-3)  # specification 5: Table I has 4.64 s at 15 RPM and 86 N
    assert plants.table_i(86.0).tau2 == pytest.approx(4.64, abs=5e-3)
    assert plants.table_i(0.0).Ts == 0.0 and plants.table_ii(0.0).Ts == 0.0


@pytest.mark.parametrize("kind", ["friction-force", "friction-speed"])
def test_a_clean_friction_run_is_equation_3(kind: str) -> None:
    plant = plants.REFERENCE[kind]()
    run = synthesise(plant, replace(PROTOCOLS[kind], levels=plant.levels, rate_hz=50.0), NONE, seed=0)[-1]
    step = plant.at(plant.levels[-1])
    t = run.time_s[run.time_s >= 2.0] - 2.0
    expected = step.Ts * (0.85 * -np.expm1(-t / step.tau1) + 0.15 * -np.expm1(-t / step.tau2))
    np.testing.assert_allclose(run.output[run.time_s >= 2.0], expected, atol=1e-13)
    assert run.time_s[-1] == pytest.approx(62.0 - 0.02) and run.input[-1] == plant.levels[-1]


def test_the_same_seed_gives_the_same_run_and_another_seed_another() -> None:
    first, again = (synthesise(plants.clutch(), SHORT, Disturbance(), seed=5) for _ in range(2))
    other = synthesise(plants.clutch(), SHORT, Disturbance(), seed=6)
    assert [run.sha256 for run in first] == [run.sha256 for run in again]
    assert not {run.sha256 for run in first} & {run.sha256 for run in other}
    more = synthesise(plants.clutch(), replace(SHORT, repeats=3), Disturbance(), seed=5)
    assert more[0].sha256 == first[0].sha256 and more[3].sha256 == first[2].sha256


def test_every_run_says_that_it_is_synthetic() -> None:
    for run in synthesise(plants.clutch(), SHORT, Disturbance(), seed=1):
        assert run.synthetic == (
            "eaid synth of the reference plant (docs/synthetic.md); white_nm 0.01, coloured 0.01, coloured_s 0.05, "
            "ripple 0.01, "
            "gain_scatter 0.03, tau1_scatter 0.05, offset_nm 0.02, resolution_nm 0.000976562; seed 1; "
            "recorded on no rig"
        )
        assert run.name.startswith("synthetic-clutch-") and run.kind == "clutch" and run.input_unit == "%"


def test_an_undisturbed_run_says_so() -> None:
    (run, *_) = synthesise(plants.clutch(), SHORT, NONE, seed=1)
    said = "eaid synth of the reference plant (docs/synthetic.md); undisturbed; seed 1; recorded on no rig"
    assert run.synthetic == said


def test_white_noise_offset_and_digits_are_as_asked() -> None:
    draw = np.random.default_rng(0)
    size = replace(NONE, white_nm=0.02, offset_nm=0.3, resolution_nm=0.0)
    seen = measured(np.zeros(100_000), np.arange(100_000) / 1e3, np.zeros(100_000), size, draw)
    assert seen.mean() == pytest.approx(0.3, abs=3e-4) and seen.std() == pytest.approx(0.02, rel=0.02)
    rounded = measured(np.linspace(0, 1, 999), np.arange(999.0), np.zeros(999), replace(NONE, resolution_nm=0.25), draw)
    assert set(rounded) == {0.0, 0.25, 0.5, 0.75, 1.0}


def test_ripple_turns_with_the_rotor_and_grows_with_the_torque() -> None:
    time_s = np.arange(60_000) / 1e3
    seen = measured(np.full_like(time_s, 2.0), time_s, np.full_like(time_s, 1 / 6), replace(NONE, ripple=0.01),
                    np.random.default_rng(1))  # fmt: skip
    spectrum = np.abs(np.fft.rfft(seen - 2.0)) * 2 / time_s.size
    assert int(np.argmax(spectrum)) == 10  # 10 turns in 60 s
    assert spectrum[10] == pytest.approx(0.02, rel=1e-9)


def test_coloured_noise_has_unit_variance_and_its_time_constant() -> None:
    noise = coloured(400_000, 1e-3, 0.05, np.random.default_rng(2))
    assert noise.std() == pytest.approx(1.0, abs=0.03)
    lag = np.mean(noise[:-50] * noise[50:]) / np.mean(noise**2)
    assert lag == pytest.approx(np.exp(-1.0), abs=0.03)


def test_scatter_between_runs_is_as_asked() -> None:
    size = replace(NONE, gain_scatter=0.03, tau1_scatter=0.05)
    protocol = Protocol(levels=(50.0,), repeats=1000, idle_s=0.0, hold_s=0.4, release_s=0.0, rate_hz=50.0)
    runs = synthesise(plants.clutch(), protocol, size, seed=0)
    clean = synthesise(plants.clutch(), replace(protocol, repeats=1), NONE, seed=0)[0]
    # at first T ≈ gain · C T_s t / τ1 · …: gain and log τ1 both scatter the torque, in square 0.03² + 0.05² nearly
    early = np.array([run.output[1] for run in runs]) / clean.output[1]
    assert early.mean() == pytest.approx(1.0, abs=0.01)
    assert early.std() == pytest.approx(np.hypot(0.03, 0.05 * 0.94), rel=0.08)


def test_jitter_keeps_time_rising_and_samples_the_torque_where_the_stamp_says() -> None:
    size = replace(NONE, jitter_s=2e-4)
    run = synthesise(plants.clutch(), replace(SHORT, rate_hz=1000.0), size, seed=0)[0]
    steps = np.diff(run.time_s)
    assert steps.min() > 0 and steps.std() == pytest.approx(2e-4 * np.sqrt(2), rel=0.05)
    held = (run.time_s >= 0.5) & (run.time_s < 2.5)
    np.testing.assert_allclose(
        run.output[held], step_response(REFERENCE_PLANT, run.time_s[held] - 0.5, 40.0), atol=1e-13
    )


def test_jitter_that_whole_microseconds_cannot_hold_is_refused() -> None:
    with pytest.raises(UsageError, match="lower the rate"):
        sample_times(0.01, 4e6, 1e-3, np.random.default_rng(0))


def test_a_given_input_is_followed_row_by_row() -> None:
    changes = [(0.0, 80.0), (1.0, 30.0), (1.5, 0.0)]
    protocol = Protocol(levels=(1.0,), repeats=2, idle_s=0.0, hold_s=2.0, release_s=0.0, rate_hz=100.0)
    runs = synthesise_input(plants.clutch(), changes, protocol, NONE, seed=0)
    assert len(runs) == 2 and runs[0].level is None and runs[0].time_s.size == 200
    assert [runs[0].input[k] for k in (0, 99, 100, 149, 150)] == [80, 80, 30, 30, 0]


def test_a_fits_release_constants_are_used_when_the_duty_falls() -> None:
    plant = plants.clutch(replace(REFERENCE_PLANT, release=(1.0, 1.0)), "x")
    run = synthesise(plant, SHORT, NONE, seed=0)[0]
    after = run.output[run.time_s >= 2.5]
    assert after[100] / after[0] == pytest.approx(np.exp(-0.5), rel=1e-12)


VOLTS = {
    "data": {"input_unit": "V", "output_unit": "N", "levels": [30.0, 150.0, 300.0]},
    "nonlinear": {"tau1": [0.2, 1e-3, 0.0], "tau2": [3.0, 0.0, 0.0], "Ts": [0.0, 0.01, 0.0, 0.0], "u_range": [30, 300]},
    "release": {"tau1": 0.5, "tau2": 4.0},
}


def test_a_plant_in_volts_and_newtons_is_recorded_in_them() -> None:
    fit = from_plain(VOLTS, Fit, "f.json")
    runs = synthesize(
        SynthOptions(clean=True, repeats=1, idle_s=1.0, hold_s=20.0, release_s=5.0, rate_hz=100.0), fit, "f.json"
    )
    assert [run.level for run in runs] == [30.0, 150.0, 300.0]
    assert {(run.input_unit, run.output_unit) for run in runs} == {("V", "N")}
    held = runs[2].output[(runs[2].time_s >= 1.0) & (runs[2].time_s < 21.0)]
    t = np.arange(held.size) / 100
    np.testing.assert_allclose(held, 3.0 * (1 - 0.85 * np.exp(-t / 0.5) - 0.15 * np.exp(-t / 3.0)), atol=1e-12)
    rough = synthesize(SynthOptions(repeats=1, hold_s=1.0), fit, "f.json")[0]
    assert "white_nm 0.00686" in (rough.synthetic or "")  # 0.01 N·m of 4.372 N·m, for 3 N at the top
    assert len(synthesize(SynthOptions(levels=(200.0,), repeats=1, hold_s=1.0), fit, "f")) == 1  # no limit of 100


def test_friction_levels_of_a_fit_and_of_none_other() -> None:
    fit = {
        "data": {"kind": "friction-force"},
        "friction": {"C": 0.8, "levels": [{"level": 50, "Ts": 1, "tau1": 0.1, "tau2": 2}]},
    }
    fit = from_plain(fit, Fit, "my.json")
    plant = plants.of_fit(fit, "friction-force", "my.json")
    assert plant.at(50.0) == Friction(1.0, 0.1, 2.0, 0.8) and plant.levels == (50.0,)
    with pytest.raises(UsageError, match=r"levels= 60: is not in my.json, which holds 50"):
        plant.at(60.0)
    with pytest.raises(UsageError, match="ask for kind= friction-force"):
        plants.of_fit(fit, "friction-speed", "my.json")


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"levels": ()}, "levels=: give at least one level"),
        ({"levels": (10.0, 10.0)}, "stands there twice"),
        ({"levels": (0.0,)}, "levels= 0: give a number above 0"),
        ({"levels": (120.0,)}, "a duty is at most 100 %"),
        ({"repeats": 0}, "repeats= 0: give a whole number from 1"),
        ({"hold_s": 0.0}, "hold_s= 0: give a number above 0"),
        ({"hold_s": 0.01, "rate_hz": 100.0}, "hold_s= 0.01: fewer than 10 samples at 100 Hz; .*raise rate_hz="),
        ({"idle_s": -1.0}, "idle_s= -1: give a number from 0"),
        ({"release_s": float("nan")}, "release_s= nan: give a number"),
        ({"rate_hz": 0.0}, "rate_hz= 0: give a number from 0.001 to 100000"),
        ({"rate_hz": 1e5, "hold_s": 2000.0}, "million samples, 20 million at most"),
        ({"white_nm": -1.0}, "white_nm= -1: give a number from 0"),
        ({"coloured": 0.1, "coloured_s": 0.0}, "coloured_s= 0: coloured noise needs"),
        ({"gain_scatter": 0.5}, "gain_scatter= 0.5: give a number from 0 to 0.3"),
        ({"offset_nm": float("inf")}, "offset_nm= inf: give a number from"),
        ({"kind": "friction-force", "release_s": 1.0}, "release_s=: nobody has published"),
        ({"seed": -1}, "seed= -1: give a whole number from 0"),
    ],
)
def test_what_cannot_be_recorded_is_refused(options: dict[str, object], sentence: str) -> None:
    with pytest.raises(UsageError, match=sentence):
        eaid.synth(**options)
