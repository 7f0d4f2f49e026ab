"""Each check of a run at both sides of its limits, and the statistics behind them by hand."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.stop_findings import wander
from eaid.arrays import Array, read_only
from eaid.findings import Finding
from eaid.logs.run import Run
from eaid.steps.baseline import last_rest
from eaid.steps.build import build_stepset, direction
from eaid.steps.checks import disagreements, flat_top, sharpness
from eaid.steps.cut import cut, onset, rises_at_once
from eaid.steps.edges import looks_like, moving, several_edges
from eaid.steps.noise import block_error, block_means, block_noise, line, sample_noise, spikes
from eaid.steps.slip import slip_of
from eaid.steps.step import Step
from eaid.steps.stepset import Level

sys.path.insert(0, str(Path(__file__).parent))
from make import curve, log

RANDOM = np.random.default_rng(7)
PLAN = [(0.0, 4.0), (50.0, 8.0)]
RUN = log(PLAN)


def codes(run: Run) -> list[str]:
    return [one.code for row in build_stepset([run]).runs for one in row.findings]


def moved(change: np.ndarray, run: Run = RUN) -> Run:
    return replace(run, output=read_only(run.output + change))


# statistics


def test_noise_of_samples_and_blocks() -> None:
    white = 0.3 * RANDOM.normal(size=40_000)
    assert sample_noise(white) == pytest.approx(0.3, rel=0.03)
    assert block_error(white) == pytest.approx(0.3 / np.sqrt(2000), rel=0.3)
    assert block_error(white, 10) == pytest.approx(0.3 / np.sqrt(4000), rel=0.4)
    assert sample_noise(white[:1]) == 0.0
    assert block_error(white[:7]) == 0.0
    assert block_noise(white[:2]) == 0.0
    assert block_noise(np.array([0.0, 1.0, 0.0])) == pytest.approx(1.4826 * 2 / np.sqrt(6))
    assert block_noise(np.arange(100.0)) == 0.0  # a slope is no noise


def test_block_means_by_hand() -> None:
    np.testing.assert_allclose(block_means(np.arange(10.0), 5), [0.5, 2.5, 4.5, 6.5, 8.5])
    np.testing.assert_allclose(block_means(np.arange(3.0), 5), [0, 1, 2])


@pytest.mark.parametrize(("size", "count"), [(15.0, 0), (45.0, 1)])
def test_a_spike_is_25_standard_deviations(size: float, count: int) -> None:
    values = RANDOM.normal(size=2000)
    values[900] = size
    assert len(spikes(values, 0.0)) == count
    assert len(spikes(values, 60.0)) == 0


def test_a_line_and_its_error() -> None:
    x = np.arange(12.0)
    y = 0.3 * x + np.array([0.1, -0.2, 0.3, 0.0, -0.1, 0.2, -0.3, 0.1, 0.0, 0.2, -0.2, 0.1])
    slope, error, _ = line(x, y)
    (fitted, _), covariance = np.polyfit(x, y, 1, cov=True)
    assert slope == pytest.approx(fitted)
    assert error == pytest.approx(float(np.sqrt(covariance[0, 0])))


def test_the_line_of_a_rest_ends_at_the_step() -> None:
    rest = last_rest(np.arange(80.0), 1.0)
    assert (rest.value, rest.start, rest.rests, rest.lead) == (79.5, 79.5, False, 0)


def test_sharpness_of_a_settling_and_of_a_cut_off_rise() -> None:
    t = np.arange(10_000) / 1000
    assert sharpness(np.minimum(t, 3.0), t, 3.0) == pytest.approx(0.95, abs=1e-6)
    assert sharpness(1 - np.exp(-t), t, 1.0) == pytest.approx(0.21, abs=0.02)
    assert sharpness(t[:3], t[:3], 0.002) == 0.0


def test_onset_without_noise_is_exact_to_a_hundredth_of_the_rise() -> None:
    y = np.where(np.arange(1000) < 400, 0.0, np.minimum((np.arange(1000) - 400) / 1000, 0.3))
    assert onset(y) == 404  # 0.003 at 403 is the last within 1 % of the rise
    assert onset(y[:19]) is None


def test_rising_at_once() -> None:
    t = np.arange(2000) / 100
    rise = 1 - np.exp(-t / 2)
    assert rises_at_once(rise)
    assert not rises_at_once(rise + 0.3)
    assert rises_at_once(rise + 0.3, 0.3)
    assert not rises_at_once(np.where(t < 5, 0, 1 - np.exp(-(t - 5) / 2)))
    assert not rises_at_once(RANDOM.normal(size=2000))


# checks


@pytest.mark.parametrize(("share", "said"), [(0.045, False), (0.055, True)])
def test_left_after_a_release(share: float, said: bool) -> None:
    run = log([(0, 2), (50, 6), (0, 6)])
    held = 2 * float(curve(np.array([6.0])).item())
    assert ("left-after-release" in codes(moved(np.where(run.time_s >= 8, share * held, 0), run))) is said


@pytest.mark.parametrize(("lost", "said"), [(0.017, False), (0.03, True)])
def test_decay_under_hold(lost: float, said: bool) -> None:
    since = np.maximum(RUN.time_s - 4, 0)
    falls = moved(-2 * lost * np.maximum(since - 3, 0) / 5)
    assert ("decays-under-hold" in codes(falls)) is said


def test_wandering_is_no_decay() -> None:
    """A wave at the end that happens to go down is not told as a decay in many runs."""
    told = 0
    for k in range(40):
        run = log(PLAN, noise=0.02, seed=k)
        wave = 0.03 * np.sin(2 * np.pi * run.time_s / 2.3 + k)
        told += "decays-under-hold" in codes(moved(wave, run))
    assert told <= 6


@pytest.mark.parametrize(("steps", "said"), [(18, True), (32, False)])
def test_coarse(steps: int, said: bool) -> None:
    finest = 2.0 / steps
    assert ("coarse-output" in codes(replace(RUN, output=read_only(np.round(RUN.output / finest) * finest)))) is said


@pytest.mark.parametrize(("samples", "code"), [(12, None), (200, "sensor-stuck")])
def test_stuck(samples: int, code: str | None) -> None:
    run = log(PLAN, noise=0.01)
    y = run.output.copy()
    y[700 : 700 + samples] = y[700]
    found = [one for one in codes(replace(run, output=read_only(y))) if one.startswith("sensor-stuck")]
    assert found == ([] if code is None else [code])


def test_stuck_for_a_moment() -> None:
    run = log([(0, 4), (50, 20)], noise=0.01, rate_hz=200.0)
    y = run.output.copy()
    y[2000:2060] = y[2000]  # 60 of 4000 samples
    assert "sensor-stuck-briefly" in codes(replace(run, output=read_only(y)))


@pytest.mark.parametrize(("spread", "said"), [(0.095, False), (0.105, True)])
def test_repeats_disagree(spread: float, said: bool) -> None:
    runs = [log(PLAN, gain=0.04 * (1 + k * spread / (1 - spread / 2)), name=f"r{k}") for k in range(2)]
    found = [one.code for row in build_stepset(runs).runs for one in row.findings]
    assert ("repeats-disagree" in found) is said


def test_disagreement_by_hand() -> None:
    two = np.array([[0.0, 0, 0, 1.0], [9.0, 0, 0, 3.0]])
    assert _spread_and_own(two) == pytest.approx([100, -100, 100])  # each from the other, over their mean, 2
    three = np.array([[1.0], [1.0], [4.0]])
    assert _spread_and_own(three) == pytest.approx([150, -75, -75, 150])  # 1 − 2.5, 1 − 2.5, 4 − 1, over 2
    assert not _spread_and_own(np.zeros((2, 4))) and not _spread_and_own(np.array([[1.0], [-1.0]]))


def _spread_and_own(runs: Array) -> list[object]:
    """Spread of repeats, and the distance of each from the others [%]; nothing where they agree."""
    said = disagreements(Level(50.0, np.zeros(runs.shape[1]), runs, tuple(map(str, range(len(runs))))), "%")
    return [*{one.values["spread_pct"] for one in said}, *(one.values["own_pct"] for one in said)]


@pytest.mark.parametrize(("share", "said"), [(0.015, False), (0.03, True)])
def test_a_level_that_is_said_otherwise(share: float, said: bool) -> None:
    run = replace(RUN, level=50.0 * (1 + share), step_s=4.0)
    assert ("level-contradicts-input" in codes(run)) is said


@pytest.mark.parametrize(("span", "code"), [(0.12, "step-from-output"), (0.25, None)])
def test_a_load_that_wanders_is_one_load(span: float, code: str | None) -> None:
    load = 80 * (1 - span / 2) + 80 * span * (RUN.time_s >= 4) + 0.01 * RANDOM.normal(size=len(RUN.time_s))
    run = replace(RUN, input=read_only(load), input_unit="N", kind="friction-force")
    found = [one.code for step in cut(run) for one in step.findings]
    assert ("step-from-output" in found) is (code is not None)


@pytest.mark.parametrize(("end", "said"), [(0.985, False), (0.9, True)])
def test_a_window_that_holds_the_start_of_the_release(end: float, said: bool) -> None:
    t = np.arange(2000) / 100
    y = np.where(t < 20 * end, 1 - np.exp(-t / 0.5), 0.0)
    assert (several_edges("a", t, y) is not None) is said


def test_steps_upwards_without_an_input() -> None:
    t = np.arange(4000) / 100
    y = sum((1 - np.exp(-np.maximum(t - at, 0) / 0.3)) for at in (5.0, 15.0, 25.0))
    found = several_edges("a", t, np.asarray(y) + 0.005 * RANDOM.normal(size=4000))
    assert found is not None
    assert found.values["edges"] == 3
    assert found.values["at_s"] == pytest.approx((5.0, 15.0, 25.0), abs=0.4)
    assert found.values["rise_s"] == pytest.approx((0.66,) * 3, abs=0.25)


# inputs that are none of steps


def test_what_an_input_does() -> None:
    t = np.arange(20_000) / 100
    triangle = moving("a", t, np.abs((t / 20) % 2 - 1))
    assert (triangle.code, triangle.values["turns"]) == ("input-reverses", 9)
    sine = moving("a", t, np.sin(2 * np.pi * 0.05 * t))
    assert (sine.code, sine.values["hz"]) == ("input-is-periodic", pytest.approx(0.05, rel=0.01))
    sweep = moving("a", t, np.sin(2 * np.pi * (0.02 * t + 0.5 * 0.001 * t**2)))
    assert sweep.code == "input-sweeps"
    assert sweep.values["to_hz"] == pytest.approx(0.22, rel=0.1)
    assert moving("a", t, np.cumsum(np.random.default_rng(2).normal(size=20_000))).code in ("input-moves",)


def test_on_and_off_is_no_binary_sequence() -> None:
    plan = [(0.0, 1.0), (50.0, 2.0)] * 8
    assert looks_like(log(plan)) is None
    bits = np.repeat(np.random.default_rng(0).integers(0, 2, 60), 20)
    run = log([(0.0, 12.0)])
    run = replace(run, input=read_only(30.0 + 40.0 * bits))
    found = looks_like(run)
    assert found is not None and found.code == "input-is-binary"
    assert found.values["clock_s"] == pytest.approx(0.2, rel=0.01)


# signs


@pytest.mark.parametrize(("share", "odd"), [(0.15, 0), (0.3, 1)])
def test_a_small_sign_of_its_own_is_not_held_against_a_run(share: float, odd: int) -> None:
    runs = [log(PLAN, name=f"r{k}") for k in range(3)] + [log(PLAN, name="odd", gain=-0.04 * share)]
    way = direction([step for run in runs for step in cut(run)])
    assert [one.code for one in way.findings] == ["sign-differs"] * odd


@pytest.mark.parametrize(("fall", "turned"), [(0.03, False), (0.8, True)])
def test_beyond_the_slope_of_its_idle(fall: float, turned: bool) -> None:
    """The idle falls by 0.05 N·m/s; a change is evidence where it is beyond what that explains."""
    run = log([(0, 10), (50, 10)], gain=-fall / 50, noise=0.002)
    way = direction(cut(moved(-0.05 * run.time_s, run)))
    assert (way.signs[False] < 0) is turned


# slips


@pytest.mark.parametrize(("over", "slips"), [(0.03, False), (0.12, True)])
def test_a_slip_is_five_percent(over: float, slips: bool) -> None:
    t = np.arange(4000) / 1000
    y = np.where(t < 1, t * (1 + over), 1 + over * np.exp(-(t - 1) / 0.3))
    assert (slip_of(t, y) is not None) is slips


# what the last samples before a step tell in much noise


def test_a_late_input_behind_much_noise() -> None:
    """Six samples that are 0.3 off in noise of 0.06: no single one of them is beyond four deviations for certain."""
    told = 0
    for k in range(20):
        hold = 0.06 * np.random.default_rng(k).normal(size=400)
        assert last_rest(hold, 1.0).rests
        hold[-6:] += 0.3
        rest = last_rest(hold, 1.0)
        told += not rest.rests and rest.lead >= 4
    assert told >= 18


def test_a_rest_with_bursts_is_no_late_input() -> None:
    """The same six samples, where such groups came before."""
    told = 0
    for k in range(20):
        hold = 0.06 * np.random.default_rng(k).normal(size=400)
        for at in (50, 160, 270, 394):
            hold[at : at + 6] += 0.3
        told += last_rest(hold, 1.0).lead >= 4
    assert told <= 6


@pytest.mark.parametrize(("size", "left_out"), [(0.04, 0), (0.08, 1)])
def test_a_spike_before_a_step_is_a_twentieth_of_its_change(size: float, left_out: int) -> None:
    hold = 1e-4 * np.random.default_rng(0).normal(size=200)
    hold[100] = size
    assert last_rest(hold, 1.0).left_out == left_out


def test_what_is_left_is_that_of_the_last_block() -> None:
    run = log([(0, 2), (50, 9), (0, 10)])
    y = run.output + np.where(run.time_s >= 20.5, 0.4, 0.0)  # the last block of 0.5 s
    (release,) = (row for row in build_stepset([replace(run, output=read_only(y))]).runs if row.edge == "falling")
    assert release.left_pct == pytest.approx(20.0, rel=0.02)


@pytest.mark.parametrize(("off", "said"), [(0.015, None), (0.03, "not-at-rest"), (0.3, "not-at-rest")])
def test_a_start_is_a_stop_beyond_a_fiftieth(off: float, said: str | None) -> None:
    """Ten samples off by a share of the swing, where the noise is a hundredth of it: one of them shows nothing."""
    run = log([(0, 4), (50, 8)], noise=0.004, seed=3)
    found = [one.code for one in _raised(run, off) if one.code.endswith("at-rest")]
    assert found == ([said] if said else [])


def _raised(run: Run, share: float, samples: int = 10) -> tuple[Finding, ...]:
    at = (run.time_s > 3.995 - samples / 100) & (run.time_s < 3.995)
    return build_stepset([moved(np.where(at, 2.0 * share, 0.0), run)]).runs[0].findings


@pytest.mark.parametrize("seed", range(5))
def test_a_start_within_the_noise_is_no_start_of_its_own(seed: int) -> None:
    """The same 6 %, in noise that wanders by 3 % for as many samples as those ten."""
    random = np.random.default_rng(seed)
    run = log([(0, 4), (50, 8)])
    wanders = 2.0 * 0.03 * wander(random, len(run.time_s), 10.0)
    assert "not-at-rest" not in [one.code for one in _raised(moved(wanders, run), 0.06)]
    white = 2.0 * 0.03 * random.normal(size=len(run.time_s))
    assert "not-at-rest" in [one.code for one in _raised(moved(white, run), 0.09)]


def test_what_moves_in_one_sample_is_no_stop() -> None:
    """An instant is known to one sample: at 12 % a sample, an input that is one late is told, two are a stop."""
    time = np.arange(1200) / 100
    for late, said in ((0, []), (1, ["nearly-at-rest"]), (2, ["not-at-rest"])):
        y = np.where(time >= 4, 1 - np.exp(-np.maximum(time - 4 + 0.01, 0) / 0.08), 0.0)
        run = log([(0, 4), (50, 8)])
        run = replace(run, output=read_only(y), input=read_only(np.where(time >= 4 + late / 100 - 1e-9, 50.0, 0.0)))
        assert [one.code for one in build_stepset([run]).runs[0].findings if one.code.endswith("at-rest")] == said


@pytest.mark.parametrize(("rest", "starts"), [(0.045, 1), (0.06, 0)])
def test_a_measured_input_counts_as_zero_within_a_twentieth(rest: float, starts: int) -> None:
    run = log([(80.0 * rest, 4), (80.0, 8)], input_unit="N", kind="friction-force")
    stepset = build_stepset([run])
    assert len(stepset.levels) == starts
    assert [one.code for one in stepset.findings] == ([] if starts else ["level-to-level"])


def test_a_step_between_levels_goes_its_own_way() -> None:
    up, down = cut(log([(30, 6), (60, 6), (20, 6)]))
    way = direction([up, down])
    assert (way.of(up), way.of(down)) == (1.0, -1.0)
    assert way.findings == ()


def ramped(tau_s: float) -> Run:
    """A driver that takes its time, a plant that answers to the driver at once: input and output move together."""
    run = log([(0, 4), (50, 8)], input_unit="V")
    on_its_way = 50.0 * -np.expm1(-np.maximum(run.time_s - 4, 0) / tau_s) if tau_s else run.input
    return replace(run, input=read_only(on_its_way))


@pytest.mark.parametrize(
    ("tau_s", "codes_said"),
    [(0.0, []), (0.002, []), (0.012, ["input-ramps"]), (0.08, ["input-ramps-on"])],
)
def test_an_input_that_is_late_at_its_level(tau_s: float, codes_said: list[str]) -> None:
    """1 % of the level is left after 4.6 τ; the plant (0.2 s) has gone 1 − e^(−t/0.2) of its 85 % by then."""
    (row,) = build_stepset([ramped(tau_s)]).runs
    assert [one.code for one in row.findings] == codes_said
    for said in row.findings:
        gone = float(curve(np.array([np.ceil(460 * tau_s) / 100])).item())
        assert said.values["moved_pct"] == pytest.approx(100 * gone, rel=0.2)  # to a sample
        assert said.values["ramp_s"] == pytest.approx(4.6 * tau_s, abs=0.02)


def test_a_release_whose_input_is_late_is_told_too() -> None:
    run = log([(0, 2), (50, 6), (0, 6)], input_unit="V")
    slow = np.where(run.time_s < 8, run.input, 50.0 * np.exp(-np.maximum(run.time_s - 8, 0) / 0.08))
    rows = build_stepset([replace(run, input=read_only(slow))]).runs
    assert {row.edge: [one.code for one in row.findings] for row in rows} == {
        "rising": [],
        "falling": ["input-ramps-on"],
    }


@pytest.mark.parametrize(("samples", "said"), [(4.5, False), (5.5, True)])
def test_a_gap_before_the_step_is_that_of_its_own_two_samples(samples: float, said: bool) -> None:
    """The output has moved by 20 % when the record goes on, with the input at its level."""
    late = np.where(np.arange(1200) >= 400, (samples - 1) / 100, 0.0)
    y = 2.0 * curve(RUN.time_s - 3.99 + late)
    run = replace(RUN, time_s=read_only(RUN.time_s + late), output=read_only(np.where(np.arange(1200) < 400, 0.0, y)))
    assert ("step-in-gap" in codes(run)) is said


@pytest.mark.parametrize(("noise", "said"), [(0.05, True), (1.0, False)])
def test_a_flat_top_behind_noise_is_averaged(noise: float, said: bool) -> None:
    """A straight rise of 2 s that is cut off, 1 kHz: at blocks of 20 samples a noise of 0.05 leaves it sharp."""
    t = np.arange(10_000) / 1000
    output = np.clip((t - 2) / 2, 0.0, 1.0) + noise * np.random.default_rng(4).normal(size=len(t))
    step = Step(replace(log(PLAN), time_s=t, output=output, input=50.0 * (t >= 2), step_s=2.0, level=50.0, cut=True))
    assert (flat_top(step) is not None) is said
