"""Odd logs, each right, refused, or a stop finding: a row per kind."""

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from eaid.arrays import read_only
from eaid.findings import Finding
from eaid.logs.run import Run
from eaid.steps.build import build_stepset, direction
from eaid.steps.cut import StepOptions
from eaid.steps.levels import same_level
from eaid.steps.noise import spikes

sys.path.insert(0, str(Path(__file__).parent))
from make import curve, log

PLAN = [(0.0, 2.0), (50.0, 10.0)]
RUN = log(PLAN, noise=0.005)


def changed(y: np.ndarray, run: Run = RUN) -> list[Run]:
    return [replace(run, output=read_only(y))]


def stops(runs: list[Run]) -> list[Finding]:
    made = build_stepset(runs)
    found = [*made.findings, *(one for run in made.runs for one in run.findings)]
    return [one for one in found if one.severity == "stop"]


def _stuck() -> list[Run]:
    y = RUN.output.copy()
    y[400:770] = y[400]  # 3.7 s
    return changed(y)


def _saturated_with_noise() -> list[Run]:
    random = np.random.default_rng(0)
    runs = []
    for level in (20.0, 40.0, 60.0, 80.0, 100.0):
        run = log([(0.0, 2.0), (level, 10.0)], name=f"u{level:g}")
        y = np.minimum(run.output, 1.3) + 0.005 * random.normal(size=len(run.output))
        runs += changed(y, run)
    return runs


def _gap() -> list[Run]:
    keep = (RUN.time_s < 1.6) | (RUN.time_s >= 2.4)
    return [
        replace(
            RUN,
            time_s=read_only(RUN.time_s[keep]),
            input=read_only(RUN.input[keep]),
            output=read_only(RUN.output[keep]),
        )
    ]


def _spike() -> list[Run]:
    y = RUN.output.copy()
    y[700] = 1000.0
    return changed(y)


def _one_sign() -> list[Run]:
    runs = [log(PLAN, name=f"r{k}", noise=0.005, seed=k) for k in range(4)]
    return [*runs[:3], *changed(-runs[3].output, runs[3])]


def _stored_level() -> list[Run]:
    return [replace(RUN, level=5.0, step_s=2.0)]


STOPS: dict[str, tuple[Callable[[], list[Run]], str]] = {
    "input logged 0.1 s late": (
        lambda: [replace(RUN, input=read_only(np.where(RUN.time_s >= 2.1 - 1e-9, 50.0, 0.0)))],
        "not-at-rest",
    ),
    "a step inside a gap": (_gap, "step-in-gap"),
    "coarse torque steps": (lambda: changed(np.round(log(PLAN).output / 0.15) * 0.15), "coarse-output"),
    "stuck for 3.7 s": (_stuck, "sensor-stuck"),
    "saturated": (lambda: changed(np.minimum(RUN.output, 1.2)), "saturated"),
    "saturated, with noise": (_saturated_with_noise, "same-ceiling"),
    "one spike under hold": (_spike, "spikes"),
    "one log of the other sign": (_one_sign, "sign-differs"),
    "a stored level that the input contradicts": (_stored_level, "level-contradicts-input"),
}


@pytest.mark.parametrize("kind", STOPS)
def test_a_stop(kind: str) -> None:
    make, code = STOPS[kind]
    assert code in [one.code for one in stops(make())]


@pytest.mark.parametrize("noise", [0.005, 0.02])
@pytest.mark.parametrize("share", [0.4, 0.55, 0.7])
def test_one_run_alone_that_is_saturated_behind_noise(noise: float, share: float) -> None:
    """Cut off in mid-rise, noise behind it: told; a stop where the noise is less than the idle's."""
    clean = log(PLAN, tau1=1.0, tau2=3.0)
    random = np.random.default_rng(0)
    cut_off = np.minimum(clean.output, share * 2.0)
    same = build_stepset(changed(cut_off + noise * random.normal(size=len(cut_off)), clean))
    (told,) = (one for one in same.runs[0].findings if one.code == "flat-topped")
    assert told.levels == (50.0,)
    assert told.values["limit"] == pytest.approx(share * 2.0, rel=0.01)
    quiet = np.where(cut_off < share * 2.0, noise, 0.2 * noise)
    found = stops(changed(cut_off + quiet * random.normal(size=1200), clean))
    assert "saturated-behind-noise" in [one.code for one in found]


@pytest.mark.parametrize("tau1", [0.05, 0.2, 1.0])
@pytest.mark.parametrize("noise", [0.0, 0.005, 0.05])
def test_a_settled_step_is_not_flat_topped(tau1: float, noise: float) -> None:
    for seed in range(10):
        run = log([(0.0, 2.0), (50.0, 20.0)], tau1=tau1, tau2=4 * tau1, noise=noise, seed=seed)
        found = {one.code for one in build_stepset([run]).runs[0].findings}
        assert not {"flat-topped", "saturated-behind-noise"} & found


@pytest.mark.parametrize(
    ("quiet", "settles", "said"),
    [(0.4, False, {"saturated-behind-noise"}), (0.6, False, {"flat-topped"}), (0.3, True, set())],
)
def test_less_noise_at_the_top_is_a_stop_where_the_rise_is_cut_off(quiet: float, settles: bool, said: set[str]) -> None:
    """A contact that holds still is as quiet as a sensor that has stopped: its rise settles."""
    clean = log(PLAN, tau1=0.5, tau2=0.5) if settles else log(PLAN, tau1=1.0, tau2=3.0)
    noise = np.where(clean.time_s < 4.8, 0.01, 0.01 * quiet) * np.random.default_rng(1).normal(size=1200)
    y = clean.output if settles else np.minimum(clean.output, 1.0)
    found = {one.code for one in build_stepset(changed(y + noise, clean)).runs[0].findings}
    assert found & {"flat-topped", "saturated-behind-noise"} == said


def test_a_quiet_top_behind_a_rise_of_few_samples_is_told() -> None:
    clean = log(PLAN, tau1=0.02, tau2=0.05)
    noise = np.where(clean.time_s < 4.0, 0.01, 0.003) * np.random.default_rng(1).normal(size=1200)
    found = [one.code for one in build_stepset(changed(np.minimum(clean.output, 1.0) + noise, clean)).runs[0].findings]
    assert "flat-topped" in found and "saturated-behind-noise" not in found


def test_the_odd_one_is_named_and_no_other() -> None:
    (said,) = stops(_one_sign())
    assert (said.code, said.subject, said.values) == ("sign-differs", "r3", {"siblings": 3})


def test_what_is_said_of_a_stuck_sensor() -> None:
    (said,) = stops(_stuck())
    assert said.values["for_s"] == pytest.approx(3.7, abs=0.02)
    assert said.values["at_s"] == pytest.approx(4.0, abs=0.02)


def test_a_settled_coarse_sensor_is_not_stuck() -> None:
    run = log(PLAN)
    for finest in (0.01, 0.002):
        assert stops(changed(np.round(run.output / finest) * finest)) == []


# levels


def test_levels_that_the_input_tells_apart_are_levels() -> None:
    levels = np.linspace(30.0, 100.0, 300)
    stepset = build_stepset([log([(0, 0.5), (float(u), 1)], name=f"u{u:.3f}") for u in levels])
    assert len(stepset.levels) == 300
    close = build_stepset([log([(0, 2), (u, 4)], name=f"u{u}") for u in (99.0, 100.0)])
    assert [level.level for level in close.levels] == [99.0, 100.0]


def test_a_measured_load_is_one_level_within_its_noise() -> None:
    runs = []
    for k, load in enumerate((86.0, 86.4, 99.0)):
        run = log([(0, 2), (load, 4)], name=f"r{k}", input_unit="N", kind="friction-force")
        noise = 0.1 * np.random.default_rng(k).normal(size=len(run.input))
        runs.append(replace(run, input=read_only(run.input + noise)))
    stepset = build_stepset(runs)
    assert [len(level.names) for level in stepset.levels] == [2, 1]
    assert stepset.levels[0].level == pytest.approx(86.2, abs=0.05)


@pytest.mark.parametrize(
    ("a", "b", "noise", "same"),
    [
        (99.0, 100.0, 0.0, False),
        (99.95, 100.0, 0.0, True),
        (99.85, 100.0, 0.0, False),
        (99.3, 100.0, 0.1, True),
        (98.9, 100.0, 0.1, False),
        (99.05, 100.0, 5.0, True),
        (98.5, 100.0, 5.0, False),
        (0.0, 0.0, 0.0, True),
    ],
)
def test_one_level_or_two(a: float, b: float, noise: float, same: bool) -> None:
    assert same_level(a, b, noise) is same
    assert same_level(b, a, noise) is same


def test_levels_are_chosen_as_closely() -> None:
    runs = [log([(0, 2), (u, 4)], name=f"u{u}") for u in (99.0, 100.0)]
    assert [x.level for x in build_stepset(runs, StepOptions(levels="100")).levels] == [100.0]
    assert [x.level for x in build_stepset(runs, StepOptions(levels="99.2")).levels] == [99.0]


# signs


def test_an_idle_slope_turns_no_sign() -> None:
    """Cooling that goes on: the fall after the step is what the slope before it foretells."""
    runs = []
    for k in range(5):
        run = log([(0, 5), (50, 5)], gain=0.0, name=f"r{k}")
        runs += changed(20.0 * np.exp(-run.time_s / 60.0) + 0.01 * np.random.default_rng(k).normal(size=1000), run)
    found = direction(build_and_cut(runs))
    assert found.signs == {False: 1.0, True: 1.0}
    assert found.findings == ()


def build_and_cut(runs: list[Run]) -> list[Run]:
    from eaid.steps.cut import cut

    return [step for run in runs for step in cut(run)]


def test_turned_signs_are_said_once_and_may_be_forbidden() -> None:
    runs = [log(PLAN, gain=-0.04, noise=0.01, name=f"r{k}", seed=k) for k in range(4)]
    stepset = build_stepset(runs)
    assert [(one.code, one.values) for one in stepset.findings] == [("signs-turned", {"runs": 4})]
    assert stepset.levels[0].mean[-1] == pytest.approx(2.0, abs=0.03)
    kept = build_stepset(runs, StepOptions(keep_sign=True))
    assert kept.findings == ()
    assert kept.levels[0].mean[-1] == pytest.approx(-2.0, abs=0.03)


def test_one_spike_in_one_idle_turns_nothing() -> None:
    runs = [log(PLAN, noise=0.01, name=f"r{k}", seed=k) for k in range(4)]
    y = runs[0].output.copy()
    y[100] = 1000.0
    stepset = build_stepset([*changed(y, runs[0]), *runs[1:]])
    assert stepset.findings == ()
    assert stepset.levels[0].runs[0][-1] == pytest.approx(2.0, abs=0.05)


def test_spikes_are_single_samples() -> None:
    values = 0.01 * np.random.default_rng(0).normal(size=1000)
    values[[100, 500]] = (3.0, -2.0)
    values[700:] += 5.0  # a step is none
    assert spikes(values, 0.5).tolist() == [100, 500]
    assert spikes(values, 2.5).tolist() == [100]


# from level to level


def test_a_run_whose_first_duty_is_not_zero() -> None:
    stepset = build_stepset([log([(30, 6), (60, 6), (20, 6)])])
    assert stepset.levels == ()
    up, down = stepset.level_steps
    assert (up.from_level, up.level, up.edge) == (30.0, 60.0, "up")
    assert (down.from_level, down.level, down.edge) == (60.0, 20.0, "down")
    assert up.start == pytest.approx(1.2, abs=0.01)
    assert up.change == pytest.approx(0.04 * 30, rel=0.02)
    assert (up.gain, down.gain) == pytest.approx((0.04, 0.04), rel=0.02)


def test_a_falling_step_is_no_release_because_the_input_rises_later() -> None:
    """With the instant given, too: 60 → 30 % at 8 s, and 80 % behind it."""
    run = log([(0, 2), (60, 6), (30, 6), (80, 6)])
    steps = {step.name: step for step in build_stepset([run]).level_steps}
    assert [(s.from_level, s.level) for s in steps.values()] == [(0, 60), (30, 80), (60, 30)]
    (given,) = build_stepset([replace(run, step_s=8.0, until_s=14.0)]).level_steps[:1]
    assert (given.from_level, given.level, given.edge) == (60.0, 30.0, "down")
    assert given.change == pytest.approx(-1.2, rel=0.02)
    assert build_stepset([replace(run, step_s=8.0, until_s=14.0)]).releases == ()


def test_steps_from_rest_stand_beside_steps_between_levels() -> None:
    stepset = build_stepset([log([(0, 2), (50, 8), (0, 9), (50, 8), (80, 8)])])
    assert [(level.level, len(level.names)) for level in stepset.levels] == [(50.0, 2)]
    assert sorted((s.from_level, s.level) for s in stepset.level_steps) == [(0, 50), (0, 50), (50, 0), (50, 80)]
    t = np.arange(800) / 100
    np.testing.assert_allclose(stepset.level_steps[-2].output[:700], 2 + 1.2 * curve(t)[:700], atol=0.02)


def test_settled_steps_of_a_log_that_is_not_cut() -> None:
    from eaid.steps.cut import settled_steps

    stairs = log([(0, 2), (20, 8), (60, 8), (40, 8)])
    found = settled_steps([stairs], StepOptions())
    assert [(one.from_level, one.level) for one in found] == [(0, 20), (20, 60), (60, 40)]
    hasty = log([(0, 2), (20, 0.8), (60, 0.8), (40, 8)])
    # 7 % of the rise to 60 are still to come when it falls to 40: 13 % of that fall
    assert [(one.from_level, one.level) for one in settled_steps([hasty], StepOptions())] == [(0, 20), (20, 60)]
    wave = replace(stairs, input=read_only(50 + 40 * np.sin(stairs.time_s)))
    assert settled_steps([wave], StepOptions()) == ()
