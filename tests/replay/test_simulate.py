"""What a replay says of itself: doubts on the reference, units of gains, what is seen by nobody."""

from dataclasses import replace

import msgspec
import numpy as np
import pytest

import eaid
from eaid.control.design import design
from eaid.control.gains import plant_of
from eaid.control.options import DesignOptions
from eaid.errors import DataError, UsageError
from eaid.logs.run import Run
from eaid.options import SimulateOptions
from eaid.replay.compare import driven
from eaid.replay.plant import plant_parameters
from eaid.replay.references import multisine
from eaid.replay.rig import Rig
from eaid.replay.simulate import simulate
from eaid.results.codec import from_plain, to_plain
from eaid.results.fit import Fit
from eaid.results.gains import Gains
from eaid.uncertainty.draw import draw

FIT = from_plain(
    {
        "nonlinear": {
            "C": 0.85, "tau1": [6.74e-3, 2.39e-2, -2.13e-4], "tau2": [0.93, 0.41, -2.64e-3],
            "Ts": [0.032, 9.2e-3, 2.1e-4, 1.32e-6], "u_range": [10, 100],
        },
        "linear": {"a0": 1.36, "b0": 0.08, "c0": -2.42, "bounds": {"B_m": 12.4, "B_M": 42.6}},
    },
    Fit, "f",
)  # fmt: skip
T = np.linspace(0, 2, 201)


def gains(Q_M: float) -> Gains:
    return design(FIT, DesignOptions(Q_M=Q_M))


def codes(*arguments: object, signal: np.ndarray = 1.0 + 0.0 * T, **options: object) -> dict[str, dict[str, object]]:
    found = simulate(FIT, *arguments, SimulateOptions(**options), (T, signal))  # type: ignore[arg-type]
    return {one.code: dict(one.values) for one in found.findings}


@pytest.mark.slow
def test_a_reference_steeper_than_the_gains_were_made_for_is_told() -> None:
    slope = np.abs(np.sin(2 * T))
    steepest = float(np.abs(np.gradient(np.interp(np.arange(0, 2, 1e-3), T, slope), 1e-3)).max())
    told = codes(gains(1.0), signal=slope)["reference-above-q-max"]
    assert told["slope"] == pytest.approx(steepest, rel=1e-3) and told["Q_M"] == 1.0
    assert "reference-above-q-max" not in codes(gains(2.5), signal=slope)
    assert "reference-above-q-max" not in codes(None, signal=slope)
    steps = simulate(FIT, gains(1.0), SimulateOptions(scenario="steps", duration=9.0))  # steps have no slope
    assert "reference-above-q-max" not in {one.code for one in steps.findings}


def test_a_reference_above_the_plant_is_told() -> None:
    assert codes(None, signal=5.0 + 0.0 * T)["reference-above-plant"]["highest"] == pytest.approx(4.372, abs=1e-3)
    assert "reference-above-plant" not in codes(None, signal=4.3 + 0.0 * T)


@pytest.mark.slow
def test_without_gains_it_is_said_and_the_others_are_replayed() -> None:
    found = simulate(FIT, None, SimulateOptions(), (T, 1.0 + 0.0 * T))
    assert set(found.records) == {"open-loop", "inverse"} and "no-gains" in {one.code for one in found.findings}
    assert set(simulate(FIT, gains(5.0), SimulateOptions(), (T, 1.0 + 0.0 * T)).records) == {"rc", "pi"}
    swept = simulate(FIT, gains(5.0), SimulateOptions(scenario="sweep", rate_hz=200.0))
    assert set(swept.records) == {"rc", "pi", "open-loop"}


def test_the_rate_is_the_rigs() -> None:
    assert simulate(FIT, None, SimulateOptions(), (T, T)).head.dt_s == 1e-3
    assert simulate(FIT, None, SimulateOptions(rate_hz=250.0), (T, T)).head.dt_s == 4e-3
    volts = {"input_unit": "V", "levels": [30.0, 300.0]}
    for data, dt_s in (
        ({**volts, "sample_rate_hz": 250.0}, 4e-3), (volts, 1e-3),
        ({"sample_rate_hz": 250.0}, 1e-3), ({"output_unit": "N", "levels": [50.0], "sample_rate_hz": 250.0}, 1e-3),
    ):  # fmt: skip
        fit = from_plain({"data": data, "nonlinear": plain()}, Fit, "f")
        assert simulate(fit, None, SimulateOptions(controller=("inverse",)), (T, T)).head.dt_s == dt_s


def test_what_contradicts_itself_is_refused() -> None:
    with pytest.raises(UsageError, match="exclude each other"):
        eaid.simulate(FIT, None, "steps", reference="reference.csv")
    with pytest.raises(UsageError, match="scenario= loops: must be one of multisine, steps"):
        SimulateOptions(scenario="loops")
    with pytest.raises(UsageError, match="controller=: names inverse twice"):
        SimulateOptions(controller=("inverse", "inverse"))
    with pytest.raises(DataError, match="the gains are for an input in % and an output in N·m"):
        volts = from_plain({"data": {"input_unit": "V"}, "nonlinear": {**plain()}}, Fit, "v")
        simulate(volts, gains(5.0), SimulateOptions(), (T, T))


def plain() -> dict[str, object]:
    return {"tau1": [0.3, 0, 0], "tau2": [3, 0, 0], "Ts": [0, 0.01, 0, 0], "u_range": [30, 300], "C": 0.85}


def test_scenarios_count_from_where_they_have_settled() -> None:
    found = simulate(FIT, None, SimulateOptions(duration=7.0))
    reference = multisine(1e-3, 7.0)
    one = found.records["inverse"]
    error = (one.columns["torque_nm"] - reference.torque_nm)[5000:]
    assert one.metrics.rms_error_nm == pytest.approx(float(np.sqrt(np.mean(error**2))), rel=1e-12)
    assert found.head.counted_from_s == 5.0


SD = np.array([0.005, 0.05, 0.01, 0.05, 0.5, 0.1, 0.001, 0.02, 0.05, 0.02])


def uncertain() -> Fit:
    model = {**to_plain(FIT.nonlinear), "covariance": {"matrix": np.diag(SD**2).tolist()}}
    return from_plain({"nonlinear": model, "linear": to_plain(FIT.linear)}, Fit, "f")


def test_drawn_plants_are_kept_with_their_numbers() -> None:
    options = SimulateOptions(controller=("inverse",), plants=5, seed=3, perturb={"Ts": 0.9}, rate_hz=200.0)
    found = simulate(uncertain(), None, options, (T, 1.0 + np.sin(2 * T)))
    assert found.head.plants == 5 and found.head.plants_from == "covariance"
    assert "plants-all-alike" not in {one.code for one in found.findings}
    one = found.records["inverse"]
    drawn = draw(uncertain(), 5, 3).plants
    np.testing.assert_allclose(one.tables["plants/parameters/Ts"], [np.multiply(0.9, p.Ts) for p in drawn])
    np.testing.assert_allclose(one.tables["plants/parameters/tau2"], [p.tau2 for p in drawn])
    values, told = one.tables["plants/metrics/rms_error_nm"], one.metrics.plants.metrics["rms_error_nm"]
    assert told.mean == pytest.approx(values.mean()) and told.sd == pytest.approx(values.std(ddof=1))
    assert told.worst.plant == values.argmax() and one.metrics.plants.count == 5
    assert one.tables["plants/band_nm"].shape == (7, len(one.tables["plants/band_time_s"]))


def test_a_fit_without_uncertainty_has_plants_that_are_all_alike() -> None:
    found = simulate(FIT, None, SimulateOptions(controller=("inverse",), plants=3, rate_hz=100.0), (T, T))
    assert found.head.plants_from == "fitted-plant"
    assert "plants-all-alike" in {one.code for one in found.findings}
    assert found.records["inverse"].metrics.plants.metrics["rms_error_nm"].sd == 0.0


def test_more_steps_than_a_day_of_work_are_refused() -> None:
    options = SimulateOptions(controller=("inverse",), plants=100_000)
    with pytest.raises(UsageError, match="ask for 71,423 at most"):
        simulate(FIT, None, options, (7 * T, T))


def test_where_replays_leave_what_was_identified_is_told_in_shares() -> None:
    fall = np.where(T < 1.0, 2.0, 1.0)
    options = SimulateOptions(controller=("open-loop",), rate_hz=100.0)
    found = simulate(FIT, None, options, (T, fall))
    told = {one.code: dict(one.values) for one in found.findings}["replay-leaves-identified"]
    columns = found.records["open-loop"].columns
    duty, torque = columns["duty_pct"], columns["torque_nm"]
    assert told["below_pct"] == told["above_pct"] == 0.0 and duty.min() > 10
    assert told["falling_pct"] == pytest.approx(100 * np.mean(np.diff(torque) < 0)) and told["falling_pct"] > 40
    low = simulate(FIT, None, replace(options, controller=("inverse",)), (T, 0.05 + 0.0 * T))
    told = {one.code: dict(one.values) for one in low.findings}["replay-leaves-identified"]
    duty = low.records["inverse"].columns["duty_pct"]
    assert told["below_pct"] == pytest.approx(100 * np.mean((duty > 0) & (duty < 10))) and told["below_pct"] > 90
    assert told["falling_pct"] < 1.0  # falls below the lowest level have constants of their own
    quiet = simulate(FIT, None, options, (T, 2.0 + 0.0 * T)).findings
    assert "replay-leaves-identified" not in {one.code for one in quiet}
    for level, duty in ((4.3, 100.0), (0.0, 0.0)):  # at the highest identified duty, and at rest, nothing is left
        held = simulate(FIT, None, replace(options, controller=("inverse",)), (T, level + 0.0 * T))
        assert np.mean(held.records["inverse"].columns["duty_pct"] == duty) > 0.3
        assert "replay-leaves-identified" not in {one.code for one in held.findings}


def test_what_a_replay_stands_on_is_said() -> None:
    shaky = from_plain({"nonlinear": {**to_plain(FIT.nonlinear), "identifiable": False}}, Fit, "f")
    found = simulate(shaky, None, SimulateOptions(controller=("inverse",), rate_hz=100.0), (T, T))
    assert "plant-not-identifiable" in {one.code for one in found.findings} and set(found.head.unidentified) == {
        "plant"
    }
    marked = msgspec.structs.replace(gains(5.0), unidentified="one level")
    found = simulate(FIT, marked, SimulateOptions(rate_hz=100.0), (T, T))
    assert "gains-not-identifiable" in {one.code for one in found.findings}
    assert found.head.unidentified == {"gains": "one level"}


@pytest.mark.parametrize(
    ("options", "what", "said"),
    [
        ({"plants": 2}, "log", "«plants»"), ({"plants": 2}, "rehab", "«plants»"),
        ({"rate_hz": 10.0}, "log", "«rate_hz»"),
        ({"duration": 3.0}, "log", "«duration»"), ({"duration": 3.0}, "reference", "«duration»"),
        ({"keep_baseline": True}, "steps", "«keep_baseline»"),
    ],
)  # fmt: skip
def test_what_does_nothing_for_a_kind_of_replay_is_refused(options: dict, what: str, said: str) -> None:
    with pytest.raises(UsageError, match=said.replace("«", "").replace("»", "=?")):
        SimulateOptions(**options).check_for(what)
    SimulateOptions().check_for(what)


@pytest.mark.parametrize(
    ("options", "what"),
    [
        ({"plants": 2}, "sweep"), ({"rate_hz": 10.0}, "rehab"), ({"duration": 3.0}, "rehab"),
        ({"keep_baseline": True}, "log"), ({"plants": 2, "threads": 1}, "reference"),
        ({"noise": "residuals", "scenario": "steps"}, "steps"),
        ({"scenario": "rehab", "limb_damping": 0.5, "limb_inertia": 0.2}, "rehab"),
    ],
)  # fmt: skip
def test_what_serves_is_taken(options: dict, what: str) -> None:
    SimulateOptions(**options).check_for(what)


@pytest.mark.parametrize(
    "options",
    [
        {"threads": 2}, {"limb_damping": 1.0}, {"limb_inertia": 0.1, "scenario": "steps"},
        {"noise": "residuals", "rig": Rig(noise_nm=0.1)},
        {"rig": Rig(noise_correlation_s=0.1)},
    ],
)  # fmt: skip
def test_options_that_contradict_each_other_are_refused(options: dict) -> None:
    with pytest.raises(UsageError):
        SimulateOptions(**options)


def test_a_rehabilitation_is_scaled_to_the_rig_and_has_the_limb_that_is_given() -> None:
    options = SimulateOptions(
        scenario="rehab", controller=("inverse",), duration=18.0, limb_damping=0.9, limb_inertia=0.12, seed=2
    )
    found = simulate(FIT, None, options)
    exercise = found.head.exercise
    assert (exercise.mode_s, exercise.damping_nms, exercise.inertia_kgm2) == (6.0, 0.9, 0.12)
    assert exercise.soft_nm_rad == 1.0 and found.head.counted_from_s == 5.0 and found.head.dt_s == 1e-3
    one = found.records["inverse"]
    assert set(one.metrics.modes) == {"soft", "hard", "assisted"} and len(one.columns["angle_deg"]) == 18_000
    data = {"output_unit": "Nm", "input_unit": "V", "levels": [10.0, 100.0]}
    weaker = {**to_plain(FIT.nonlinear), "Ts": [0.5 * c for c in FIT.nonlinear.Ts]}
    half = from_plain({"nonlinear": weaker, "data": data}, Fit, "f")
    scaled = simulate(half, None, replace(options, limb_damping=None, limb_inertia=None)).head.exercise
    assert scaled.hard_nm_rad == pytest.approx(1.5, rel=1e-3) and scaled.damping_nms == pytest.approx(0.4, rel=1e-3)
    assert scaled.mode_s == 6.0 and scaled.blend_s == 0.5
    force = from_plain({"nonlinear": plain(), "data": {"output_unit": "N"}}, Fit, "f")
    with pytest.raises(DataError, match="rehab needs a torque, and the fit's output is in N"):
        simulate(force, None, options)


def log(name: str, closed: bool = False) -> Run:
    t = np.arange(0.0, 3.0, 0.01)
    duty = np.where(t < 0.5, 0.0, 60.0)
    torque = driven(plant_parameters(plant_of(FIT)), t, duty)
    return Run(name=name, time_s=t, input=duty, output=torque, input_unit="%", output_unit="N·m", source="x.csv",
               sha256="", reference_nm=torque + 0.1 if closed else None)  # fmt: skip


def test_logs_are_replayed_and_closed_loops_laid_over() -> None:
    known = gains(5.0)
    found = simulate(FIT, known, SimulateOptions(controller=("pi",)), runs=[log("a")])
    assert {name: one.role for name, one in found.records.items()} == {"a": "recorded-input"}
    assert found.records["a"].metrics.max_abs_difference_nm < 1e-12 and found.head.scenario == "log"
    one = simulate(FIT, known, SimulateOptions(controller=("pi",)), runs=[log("a"), log("b", True)])
    assert {name: record.role for name, record in one.records.items()} == {
        "a": "recorded-input", "b": "recorded-input", "recorded": "recorded-loop", "pi": "controller",
    }  # fmt: skip
    assert one.records["recorded"].metrics.mean_abs_error_nm == pytest.approx(0.1)
    two = simulate(FIT, known, SimulateOptions(controller=("pi",)), runs=[log("a", True), log("b", True)])
    assert {"a recorded", "a pi", "b recorded", "b pi"} < set(two.records)
    noisy = SimulateOptions(controller=("pi",), rig=Rig(noise_nm=0.1))
    with pytest.raises(UsageError, match="noise_nm=?: does nothing with logs of an open loop"):
        simulate(FIT, known, noisy, runs=[log("a")])
    assert simulate(FIT, known, noisy, runs=[log("a"), log("b", True)]).head.rig.noise_nm == 0.1
    assert set(simulate(FIT, None, SimulateOptions(), runs=[log("a")]).records) == {"a"}


def test_without_a_linear_model_the_open_loop_takes_the_straight_line() -> None:
    bare = msgspec.structs.replace(FIT, linear=None)
    found = simulate(bare, None, SimulateOptions(controller=("open-loop",), rate_hz=100.0), (T, 1.0 + T / 2))
    assert "open-loop-on-straight-line" in {one.code for one in found.findings}
    duties = np.linspace(10, 100, 101)
    slope, offset = np.polyfit(duties, np.polyval(FIT.nonlinear.Ts[::-1], duties), 1)
    columns = found.records["open-loop"].columns
    np.testing.assert_allclose(columns["duty_pct"], (columns["reference_nm"] - offset) / slope, rtol=1e-9)
    named = simulate(FIT, None, SimulateOptions(controller=("open-loop",), rate_hz=100.0), (T, 1.0 + T / 2))
    assert "open-loop-on-straight-line" not in {one.code for one in named.findings}
    assert set(simulate(bare, None, SimulateOptions(rate_hz=100.0), (T, T)).records) == {"inverse"}
    falling = from_plain({"nonlinear": {**plain(), "Ts": [4.0, -0.01, 0, 0]}}, Fit, "f")
    with pytest.raises(UsageError, match="does not rise with the duty"):
        simulate(falling, None, SimulateOptions(controller=("open-loop",)), (T, T))


def test_a_fit_without_a_plant_is_refused() -> None:
    with pytest.raises(DataError, match="holds no nonlinear model, which the replay's plant is"):
        simulate(msgspec.structs.replace(FIT, nonlinear=None), None, SimulateOptions(), (T, T))


def test_a_controller_without_gains_and_one_that_nobody_knows_are_refused() -> None:
    with pytest.raises(UsageError, match="controller pi-feedforward needs gains|controller pi needs gains"):
        simulate(FIT, None, SimulateOptions(controller=("pi-feedforward",)), (T, T))
    with pytest.raises(UsageError, match="controller= pid: must be one of rc, pi"):
        SimulateOptions(controller=("pid",))


def test_a_dead_time_of_the_steps_is_replayed_as_a_delay() -> None:
    class Late(Fit, frozen=True):
        @property
        def dead_time_s(self) -> float:
            return 0.02

    late = Late(nonlinear=FIT.nonlinear, linear=FIT.linear)
    found = simulate(late, None, SimulateOptions(controller=("inverse",), rate_hz=100.0), (T, T))
    assert found.head.rig.delay_samples == 2 and "dead-time-replayed" in {one.code for one in found.findings}
    given = SimulateOptions(controller=("inverse",), rate_hz=100.0, rig=Rig(delay_samples=1))
    found = simulate(late, None, given, (T, T))
    assert found.head.rig.delay_samples == 1 and "dead-time-replayed" not in {one.code for one in found.findings}
