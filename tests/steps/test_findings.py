"""What is doubtful in a log: a row a log, with all that is told of it and its numbers, by hand.

Rows in pairs lie at both sides of what docs/formats.md promises, or of what a user would call the same log.
"""

from typing import Any

import numpy as np
import pandas as pd
import pytest

import eaid
from eaid.errors import DataError
from eaid.findings import say

from .make import curve, log, plus, read, told, values, white, with_input, without_input

PLAN = [(0.0, 4.0), (50.0, 8.0)]
RUN = log(PLAN)
T = np.arange(1200) / 100
NOISY = log(PLAN, noise=0.01)
SWING = 2.0 * float(curve(np.arange(760, 800) / 100).mean())
"""Mean of the last of twenty blocks of the window."""
SLOW = log(PLAN, tau1=1.0, tau2=3.0)


def near(value: float, rel: float = 1e-3) -> Any:
    return pytest.approx(value, rel=rel)


def output(values: Any, frame: Any = RUN) -> Any:
    return frame.assign(torque_nm=values)


def at_samples(start: int, stop: int, value: float, frame: Any = NOISY) -> Any:
    """An output that is one value from sample `start` to `stop`."""
    y = frame.torque_nm.to_numpy().copy()
    y[start:stop] = value
    return output(y, frame)


def delayed(from_sample: int, by_s: float) -> Any:
    """A clock that leaps."""
    return RUN.assign(time_s=T + np.where(np.arange(1200) >= from_sample, by_s, 0.0))


def late(by_s: float, frame: Any = RUN) -> Any:
    """An input that is logged late."""
    return with_input(frame, np.where(frame.time_s >= 4 + by_s - 1e-9, 50.0, 0.0))


def lagging(tau_s: float) -> Any:
    """A driver that takes its time: 1 % of the level is left after 4.6 τ."""
    return with_input(log(PLAN, "V"), 50.0 * -np.expm1(-np.maximum(T - 4, 0) / tau_s))


def gone(until_s: float) -> Any:
    """How much of the change came until then [%]."""
    return near(100 * float(curve(np.array([until_s])).item()), 0.2)


def ramped(*ramps: tuple[int, int, float, float], tau: float = 0.05) -> Any:
    """Stairs of a quick plant whose input goes straight from one value to another between two samples."""
    frame = log([(0, 4), (30, 4), (60, 4), (0, 4)], "V", tau1=tau, tau2=tau)
    u = frame.voltage_V.to_numpy().copy()
    for a, b, before, after in ramps:
        u[a:b] = before + (after - before) * np.arange(b - a) / (b - a)
    return with_input(frame, u)


def ramp_of(samples: int, ramp_s: float, tau: float = 0.05) -> dict[str, Any]:
    return {"ramp_s": near(ramp_s), "moved_pct": near(100 * -np.expm1(-samples / 100 / tau), 0.02)}


def gap_at_step(samples: int) -> Any:
    """A gap of so many sample times that the step falls into, the output 0.3 of the way behind it."""
    late_s = np.where(np.arange(1200) >= 400, (samples - 1) / 100, 0.0)
    return RUN.assign(time_s=T + late_s, torque_nm=np.where(T < 4, 0.0, 2 * curve(T - 3.99 + late_s)))


def released(frame: Any, left: float) -> Any:
    """A step that is let go at 12 s, by so much not to where it came from."""
    return plus(frame, np.where(frame.time_s >= 12, left, 0.0))


HELD = log([(0, 4), (50, 8), (0, 8)])
STUCK = {"unit": "N·m", "value": 1.75, "at_s": near(7.0), "for_s": near(1.99)}
TOP = {"limit": near(1.0, 0.02), "unit": "N·m"}
FAR_OFF = "not-at-rest"

CASES: dict[str, tuple[Any, dict[str, Any]]] = {
    "a good log": (RUN, {}),
    "a good log with noise": (NOISY, {}),
    "a good log, longer and quicker": (log([(0, 10), (50, 30)], tau1=0.5, tau2=8.0, noise=0.02, rate_hz=200.0), {}),
    # the clock
    "a gap behind the step": (
        delayed(900, 0.25), {"gap": {"gap_s": near(0.26), "at_s": near(8.99), "sample_s": near(0.01)}}),
    "a gap of four samples": (delayed(900, 0.03), {}),
    "a slow clock": (RUN.assign(time_s=T * 60), {}),
    "jitter": (RUN.assign(time_s=np.cumsum(np.where(np.arange(1200) % 4 == 1, 0.011, 0.01))), {}),
    "a step in a gap": (gap_at_step(20), {
        "step-in-gap": {"gap_s": near(0.2), "at_s": near(3.99), "moved_pct": gone(0.2)},
        "gap": {"gap_s": near(0.2), "at_s": near(3.99), "sample_s": near(0.01)}}),
    "a step in a gap of four samples": (gap_at_step(4), {}),
    # the idle time
    "an idle that drifts": (  # 0.1 in the 4 s before the step, 0.2 more by the end of the 8 s behind it
        plus(RUN, np.where(T < 4, 0.025 * (T - 4), 0.0)),
        {"idle-drifts": {"drift": near(0.1), "unit": "N·m", "share_pct": near(10 / (SWING + 0.025))}}),
    "an idle that hardly drifts": (plus(RUN, np.where(T < 4, 0.008 * (T - 4), 0.0)), {}),
    "a spike before the step": (
        plus(NOISY, np.where(np.arange(1200) == 150, 1000.0, 0.0)), {"spikes-before-step": {"samples": 1}}),
    "a small one": (plus(RUN, np.where(np.arange(1200) == 150, 0.05, 0.0)), {}),
    # the start
    "off its rest by 4 % of the change": (
        plus(RUN, np.where((T >= 3.9) & (T < 4), 0.04 * SWING, 0.0)),
        {FAR_OFF: {"off": near(0.04 * SWING), "unit": "N·m", "share_pct": near(4.0)}}),
    "off its rest by 1.5 %": (plus(RUN, np.where((T >= 3.9) & (T < 4), 0.015 * SWING, 0.0)), {}),
    "an input that is logged 0.1 s late": (
        late(0.1), {FAR_OFF: {"off": near(1.7 * -np.expm1(-0.5), 0.1), "unit": "N·m", "share_pct": near(34, 0.1)}}),
    "one sample late of a quick plant": (  # an instant is known to one sample, and 12 % of the change come in one
        output(2 * -np.expm1(-np.maximum(T - 3.98, 0) / 0.08)), {}),
    "two samples late of it": (
        output(2 * -np.expm1(-np.maximum(T - 3.97, 0) / 0.08)), {FAR_OFF: {"share_pct": near(22, 0.1)}}),
    "a rest too short behind a step": (
        log([(0, 2), (50, 3), (0, 0.5), (50, 3)], tau1=1.0, tau2=1.0), {
            FAR_OFF: {"off": near(1.15, 0.03)}, "left-after-release": {"left_pct": near(61, 0.1)}}),
    "a staircase that is left before it settles": (
        log([(0, 2), (20, 1), (40, 8)], tau1=1.0, tau2=1.0),
        {"level-to-level": {"steps": 1, "of": 2}, "unsettled-before-step": {"share_pct": near(7.4, 0.1)}}),
    "a staircase whose input is 0.03 s late": (
        with_input(log([(0, 1), (20, 8), (50, 8)], noise=0.002, tau1=0.6, tau2=1.5),
                   np.where(np.arange(1700) < 100, 0, np.where(np.arange(1700) < 903, 20.0, 50.0))),
        {"level-to-level": {"steps": 1, "of": 2}, "unsettled-before-step": {"share_pct": near(3.0, 0.15)}}),
    "nothing is recorded before the step": (
        RUN[400:], {"step-at-first-sample": {"start": 0.0, "unit": "N·m"}}),
    # an input on its way
    "a driver of 1 ms": (lagging(0.001), {}),
    "a driver of 12 ms": (lagging(0.012), {"input-ramps": {"ramp_s": near(0.06, 0.2), "moved_pct": gone(0.06)}}),
    "a driver of 80 ms": (lagging(0.08), {"input-ramps-on": {"ramp_s": near(0.37, 0.05), "moved_pct": gone(0.37)}}),
    "a ramp to the first level": (
        ramped((400, 410, 0.0, 30.0)), {"input-ramps-on": ramp_of(10, 0.1), "level-to-level": {}}),
    "a ramp to the second": (  # the last sample of the hold before belongs to the step before
        ramped((800, 820, 30.0, 60.0)), {"input-ramps-on": ramp_of(20, 0.19), "level-to-level": {}}),
    "a sample half-way between two holds": (
        ramped((800, 801, 45.0, 45.0), tau=0.01), {"input-ramps-on": ramp_of(1, 0.01, 0.01), "level-to-level": {}}),
    # the sensor
    "saturated": (output(np.minimum(NOISY.torque_nm, 1.2)), {"saturated": {
        "samples": int((NOISY.torque_nm >= 1.2).sum()), "limit": 1.2, "unit": "N·m"}}),
    "saturated below": (output(np.maximum(-NOISY.torque_nm, -1.2)), {"signs-turned": {"runs": 1}, "saturated": {
        "samples": int((NOISY.torque_nm >= 1.2).sum()), "limit": -1.2, "unit": "N·m"}}),
    "rounded to 1 mN·m, it settles on one value": (output(np.round(RUN.torque_nm, 3)), {}),
    "cut off in mid-rise, behind noise": (
        plus(output(np.minimum(SLOW.torque_nm, 1.0)), white(1200, 0.01)), {"flat-topped": TOP}),
    "a contact that settles and then holds still": (
        plus(log(PLAN, tau1=0.5, tau2=0.5), white(1200, 0.01) * np.where(T < 5.5, 1, 0.3)), {}),
    "a sensor that stands still for 2 s": (at_samples(700, 900, 1.75), {"sensor-stuck": STUCK}),
    "for 0.6 s of 40": (
        at_samples(1000, 1120, 1.99, log([(0, 4), (50, 40)], noise=0.01, rate_hz=200.0)),
        {"sensor-stuck-briefly": {"for_s": near(0.595), "at_s": near(5.0), "value": 1.99, "unit": "N·m"}}),
    "half a second written twice, the clock regenerated": (
        output(np.insert(NOISY.torque_nm.to_numpy(), 800, NOISY.torque_nm[750:800])[:1200]),
        {"block-written-twice": {"rows": 50, "at_s": near(7.5), "again_s": near(8.0)}}),
    "ten rows, in noise of ten of the sensor's digits": (
        output(np.round(np.insert(NOISY.torque_nm.to_numpy(), 800, NOISY.torque_nm[790:800])[:1200], 3)),
        {"block-written-twice": {"rows": 10, "at_s": near(7.9), "again_s": near(8.0)}}),
    "14 rows written twice, as chance may": (
        output(np.round(np.insert(NOISY.torque_nm.to_numpy(), 800, NOISY.torque_nm[786:800])[:1200], 2)), {}),
    "a sensor of 0.02 in noise of half of it": (output(np.round(NOISY.torque_nm * 50) / 50), {}),
    "steps of an eighth": (output(np.round(RUN.torque_nm / 0.125) * 0.125), {
        "coarse-output": {"resolution": 0.125, "unit": "N·m", "steps": near(16.0)}}),
    "steps of a fortieth": (output(np.round(RUN.torque_nm / 0.05) * 0.05), {}),
    "one spike under hold, and a larger one": (
        plus(RUN, np.where(np.isin(np.arange(1200), (600, 700)), np.where(T < 6.5, 5.0, 7.0), 0.0)), {
            "spikes": {"samples": 2, "value": near(9.0, 0.01), "unit": "N·m", "at_s": near(7.0)}}),
    "two rows of glitches at the step": (
        plus(RUN, np.where(np.isin(np.arange(1200), (400, 401)), 2.6, 0.0)), {
            "spikes": {"samples": 2, "value": near(2.686), "unit": "N·m", "at_s": near(4.01)}}),
    "two rows of glitches in the input": (
        with_input(RUN, np.where((T < 4) | np.isin(np.arange(1200), (700, 701)), 0.0, 50.0)),
        {"input-glitches": {"rows": 2, "at_s": near(7.0)}}),
    "one before the step": (with_input(RUN, np.where((T < 4) & (np.arange(1200) != 200), 0.0, 50.0)), {}),
    "a spike of 0.2": (plus(NOISY, np.where(np.arange(1200) == 700, 0.2, 0.0)), {}),
    # the hold and what is left of it
    "a fifth is left behind a release": (
        released(HELD, 0.4), {"left-after-release": {"left_pct": near(20.0, 0.02), "after_s": near(7.99)}}),
    "a thirtieth is left": (released(HELD, 0.06), {}),
    # several edges
    "bumped under hold": (
        plus(log([(0, 3), (50, 17)], noise=0.01), np.where(np.arange(2000) // 500 == 2, 1.5, 0)),
                          {"several-edges": {"edges": 3}}),
    "an end that holds the first of the release": (RUN.assign(torque_nm=RUN.torque_nm.where(T < 11.9, 0.0)), {}),
    "a swing by less than half": (
        output(2 * (1 - np.exp(-np.maximum(T - 4, 0) / 0.5) * np.cos(3 * np.maximum(T - 4, 0))) * (T >= 4)), {}),
    # sets
    "repeats that differ by 5 %": ([log(PLAN, gain=gain) for gain in (0.04, 0.042)], {}),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_what_is_told_of_a_log(name: str) -> None:
    logs, expected = CASES[name]
    steps = read(logs)
    found = {one.code: one for one in (*steps.findings, *(one for run in steps.runs for one in run.findings))}
    assert set(found) == set(expected)
    for code, numbers in expected.items():
        assert {key: found[code].values[key] for key in numbers} == numbers, code
    sentences = [*steps.warnings, *(text for run in steps.runs for text in run.warnings)]
    assert len(sentences) == len(told(steps)) and not [text for text in sentences if "{" in text or "«" in text]


def only(steps: Any, code: str) -> Any:
    """The finding of a code, where there is one."""
    (found,) = (one for run in steps.runs for one in run.findings if one.code == code)
    return found.values


def scattered(sd: float, odd: float = 1.0, levels: int = 5, repeats: int = 4) -> Any:
    """A set whose repeats scatter, one of them off by a factor."""
    rng = np.random.default_rng(3)
    gains = np.exp(sd * rng.normal(size=levels * repeats))
    gains[9] *= odd
    logs = {f"a{k}": log([(0.0, 4.0), (10.0 * (1 + k // repeats), 8.0)], gain=0.04 * g) for k, g in enumerate(gains)}
    return read({name: plus(frame, white(1200, 1e-3, k)) for k, (name, frame) in enumerate(logs.items())})


def test_repeats_that_disagree_beyond_what_repeats_scatter() -> None:
    """Ends of 2, 2 and 2.5: the spread over their mean, and the odd one from the mean of the others."""
    steps = read([log(PLAN, gain=gain, noise=1e-6, seed=k) for k, gain in enumerate((0.04, 0.04, 0.05))])
    assert [len(run.findings) for run in steps.runs] == [0, 0, 1]
    assert only(steps, "repeats-disagree") == {"spread_pct": near(23.08), "own_pct": near(23.08), "unit": "%"}
    assert told(read([log(PLAN, gain=gain) for gain in (0.04, 0.045)])) == ["repeats-disagree"] * 2
    for sd, odd, code in ((0.06, 1.0, None), (0.06, 1.6, "repeats-disagree"), (0.18, 1.0, "repeats-scatter")):
        steps = scattered(sd, odd)
        assert told(steps) == ([] if code is None else [code])
    assert values(steps, "repeats-scatter")["sd_pct"] == near(20.0, 0.25)


def broken(levels: tuple[float, ...], first_s: float) -> Any:
    """Three repeats of each level of 8 s, the first of each of another length."""
    lasts = {f"u{u:g}_{k}": (u, first_s if k == 1 else 8.0) for u in levels for k in (1, 2, 3)}
    return read({name: log([(0.0, 4.0), (u, s)], noise=0.01, seed=k) for k, (name, (u, s)) in enumerate(lasts.items())})


def test_a_repeat_that_is_broken_off_shortens_no_other() -> None:
    steps = broken((20.0, 40.0), 1.5)
    assert [float(level.time_s[-1]) for level in steps.levels] == [near(7.99)] * 2
    assert [run.name for run in steps.runs if run.left_out] == ["u20_1", "u40_1"]
    (out,) = (one for one in steps.all_findings if one.code == "runs-left-out")
    assert "2 of 6 runs left out of the fit" in say(out) and "ends 1.49 s behind its step" in say(out)
    assert [len(level.names) for level in broken((20.0, 40.0), 6.0).levels] == [3, 3]


def test_a_log_at_rest_throughout_is_left_out_and_named() -> None:
    logs = {"blank": log([(0.0, 12.0)], noise=0.01), "a": NOISY, "b": log([(0.0, 4.0), (1.0, 8.0)], noise=1e-4)}
    steps = read(logs)
    assert [level.level for level in steps.levels] == [1.0, 50.0]
    (out,) = (one for one in steps.findings if one.code == "runs-left-out")
    assert out.values["runs"] == ("blank",)
    with pytest.raises(DataError, match="the input stays at 0 %: no step"):
        read({"blank": logs["blank"]})


@pytest.mark.parametrize("ramp_s", [0.05, pytest.param(0.6, marks=pytest.mark.slow)])
def test_slow_ramps_to_each_level_are_fitted_as_they_were_recorded(ramp_s: float) -> None:
    fine = np.arange(24_000) / 2000
    logs = []
    for u in (20.0, 40.0, 60.0, 80.0):
        ramp = u * np.clip((fine - 4) / ramp_s, 0, 1)
        y = np.convolve(np.diff(ramp, prepend=0.0), 0.04 * curve(np.arange(len(fine)) / 2000))[: len(fine)][::20]
        logs.append(with_input(log([(0.0, 12.0)]), ramp[::20]).assign(torque_nm=y + white(1200, 0.002, int(u))))
    fit = eaid.fit(logs)
    assert fit.verdict.usable and (fit.recorded is not None) is (ramp_s > 0.1)
    assert fit.plant.time_constants(np.array([50.0]))[0] == near(0.2, 0.1)
    assert fit.plant.steady(80.0) == near(3.2, 0.03)


def test_what_options_bring_up() -> None:
    named = {"name_pattern": "u{level}", "step_at": 4.0}
    steps = read({"u50": without_input(RUN)[400:]}, **named)
    assert only(steps, "no-rest-before-step") == {"start": 0.0, "unit": "N·m"}
    assert told(read({"u50": without_input(RUN)}, **named)) == ["unit-unknown"]
    assert told(read({"u50": without_input(RUN)}, units={"input": "%"}, **named)) == []
    assert "not-at-rest" in told(read({"u50": without_input(RUN)}, **named | {"step_at": 4.3}))
    steps = read(with_input(RUN, RUN.duty_pct + 5), rest=5.0)
    assert told(steps) == [] and steps.levels[0].level == 50.0


@pytest.mark.parametrize("sign", [1, -1])
def test_repair_bridges_rows_that_stand_far_out_up_to_one_in_a_hundred(sign: int) -> None:
    """Two rows at the step itself and one in the hold; the fit is then that of the record without them."""
    plain = RUN.assign(torque_nm=sign * RUN.torque_nm)

    def spiked(rows: Any, size: float = 5.0) -> Any:
        return plus(plain, sign * size * np.isin(np.arange(1200), rows))

    steps = read(spiked((400, 401, 700)), repair=True)
    assert only(steps, "rows-dropped") == {"dropped": 3, "count": 1200} and told(steps).count("spikes") == 0
    rise = steps.levels[0].mean
    assert np.abs(rise - read(plain).levels[0].mean).max() < 0.03 * SWING
    assert rise[:2] == pytest.approx([0.333 * rise[2], 0.667 * rise[2]], rel=0.01)
    (whole,) = eaid.read({"a": spiked((700,))}, logs_as="recorded", repair=True).recorded
    assert [one.code for one in whole.findings] == ["rows-dropped"] and abs(whole.output).max() < 1.01 * SWING
    assert "spikes" in told(read(spiked(range(410, 810, 20)), repair=True))  # too many


CLOCK = np.arange(8000) / 100
PHASE = CLOCK % 5
MOVES: dict[str, Any] = {
    "to and fro at constant speed": 40 * np.abs((CLOCK / 8) % 2 - 1) + 5,
    "a sine": 50 + 40 * np.sin(2 * np.pi * 0.05 * CLOCK),
    "unequal halves": 50 - 40 * np.where(
        PHASE < 1.5, np.cos(np.pi * PHASE / 1.5), -np.cos(np.pi * (PHASE - 1.5) / 3.5)),
    "a sweep": 50 + 30 * np.sin(2 * np.pi * (0.1 * CLOCK + 0.9 * CLOCK**2 / 160)),
    "a ramp of 80 s": np.linspace(0, 100, 8000),
}  # fmt: skip
BINARY = np.repeat(np.random.default_rng(3).integers(0, 2, 160), 50)


def answering(u: Any) -> Any:
    """A plant of 0.3 s behind any input, with noise."""
    decay = np.exp(-np.arange(400) / 30)
    return pd.DataFrame({
        "time_s": np.arange(len(u)) / 100, "duty_pct": u,
        "torque_nm": np.convolve(0.04 * u, decay / decay.sum())[: len(u)] + white(len(u), 0.01),
    })  # fmt: skip


@pytest.mark.parametrize("kind", MOVES)
def test_an_input_without_steps_is_refused_and_taken_whole(kind: str) -> None:
    u = MOVES[kind]
    with pytest.raises(DataError, match=r"the input moves most of the time, .* eaid fit takes such a log whole"):
        read(answering(u))
    assert [run.name for run in eaid.read({"a": answering(u)}).recorded] == ["a"]
    with pytest.raises(DataError, match="the input moves"):  # a friction rig is not fitted whole
        eaid.read({"a": answering(u).rename(columns={"duty_pct": "force_n"})})


@pytest.mark.parametrize(("u", "stop"), [(30.0 + 40.0 * BINARY, "unsettled-before-step"), (60.0 * BINARY, FAR_OFF)])
def test_a_binary_sequence_is_taken_whole_and_its_steps_are_too_short(u: Any, stop: str) -> None:
    assert [run.name for run in eaid.read({"a": answering(u)}).recorded] == ["a"]
    short = [run for run in read(answering(u)).runs if stop in [one.code for one in run.findings]]
    assert len(short) > 10 and all(run.left_out for run in short)


def test_on_and_off_is_no_binary_sequence() -> None:
    assert len(read(log([(0.0, 1.0), (50.0, 2.0)] * 8)).runs) == 15


def test_several_edges_of_an_output_without_input() -> None:
    t = np.arange(4000) / 100
    y = sum(-np.expm1(-np.maximum(t - at, 0) / 0.3) for at in (5.0, 15.0, 25.0)) + white(4000, 0.005)
    with pytest.raises(DataError, match=r"3 edges, the first at 5\.\d+ s, the last at 25\.\d+ s: several steps"):
        read(pd.DataFrame({"time_s": t, "torque_nm": y}))


def test_what_rings_has_no_flat_top() -> None:
    """Its first swing is gone from twenty means of a hold, and what it ended at "stopped at full slope"."""
    t = np.arange(0.0, 4.0, 0.002)
    since = np.maximum(t - 1.0, 0.0)
    rings = 1 - np.exp(-10 * since) * (np.cos(38.7 * since) + 10 / 38.7 * np.sin(38.7 * since))
    torque = 3 * rings + white(len(t), 0.02)
    log = pd.DataFrame({"time_s": t, "duty_pct": np.where(t < 1.0, 0.0, 50.0), "torque_nm": torque})
    assert "flat-topped" not in {one.code for one in eaid.read(log).all_findings}


@pytest.mark.parametrize("creep", [0.0, 0.01])
def test_a_creep_that_each_rest_hides_is_told_by_all_and_noise_makes_no_flat_top(creep: float) -> None:
    """2.5 % of the top in a hold: τ2 was a third too long, and the runs asked for another C."""
    random, t = np.random.default_rng(6), np.arange(0.0, 12.0, 0.005)
    since, logs = np.maximum(t - 2.0, 0.0), []
    for u in np.repeat([20.0, 60.0, 100.0], 3):
        torque = 0.04 * u * (1 - 0.85 * np.exp(-since / 0.3) - 0.15 * np.exp(-since / 4)) + creep * t
        torque += 0.04 * random.standard_normal(len(t))
        logs.append(pd.DataFrame({"time_s": t, "duty_pct": np.where(t < 2.0, 0.0, u), "torque_nm": torque}))
    steps = eaid.read(logs)
    fit = eaid.fit(steps, ci="none")
    told = {one.code: one.values for one in steps.all_findings}
    assert ("output-creeps" in told) == bool(creep) and "flat-topped" not in told
    assert ("creep-taken-off" in {one.code for one in fit.findings}) == bool(creep)
    if creep:
        assert told["output-creeps"]["slope"] == pytest.approx(creep, rel=0.2)
        assert not any("the runs ask for C" in one for one in fit.warnings)


def test_a_coarse_sensor_that_goes_to_and_fro_between_two_values_has_no_spikes() -> None:
    """116 of 600 idle rows were "spikes before the step"."""
    t = np.arange(0.0, 20.0, 0.005)
    since = np.maximum(t - 3, 0.0)
    torque = 0.3 * (1 - 0.85 * np.exp(-since / 0.4) - 0.15 * np.exp(-since / 7)) + white(len(t), 0.006) + 0.005
    log = pd.DataFrame({"time_s": t, "duty_pct": np.where(t < 3, 0.0, 20.0), "torque_nm": 0.02 * np.round(50 * torque)})
    assert not {"spikes", "spikes-before-step"} & {one.code for one in eaid.read(log).all_findings}


def test_a_flat_top_counts_its_own_rows_and_a_noise_at_the_end_of_a_sensor_is_no_limit() -> None:
    """Idle outputs that end at 0 were "saturated: 1001 samples at 1.2", and their runs left out."""
    random, t = np.random.default_rng(0), np.arange(0, 12, 0.002)
    logs = []
    for u in (40.0, 60.0, 80.0, 100.0):
        for _ in range(3):
            y = np.where(t > 2, u / 50 * -np.expm1(-(t - 2) / 0.8), 0.0)
            y = np.maximum(np.minimum(y, 1.2) + 0.003 * random.standard_normal(len(t)), 0.0)
            logs.append(pd.DataFrame({"time_s": t, "duty_pct": np.where(t > 2, u, 0.0), "torque_nm": y}))
    runs = eaid.read(logs).runs
    assert not any(run.left_out for run in runs)
    told = {run.level: {one.code for one in run.findings} for run in runs}
    assert told == {40.0: set(), 60.0: set(), 80.0: {"flat-topped"}, 100.0: {"flat-topped"}}


def test_an_idle_output_at_the_end_of_its_sensor_is_told() -> None:
    """A zero 0.05 N·m below what a sensor shows made T_s as much too small, and only falls were left out."""
    random, t, logs = np.random.default_rng(0), np.arange(0, 16, 0.005), []
    for u in (20.0, 40.0, 60.0, 80.0, 100.0):
        for _ in range(4):
            y = np.where(t < 10, -np.expm1(-np.maximum(t - 2, 0) / 0.5), np.exp(-(t - 10) / 0.5)) * u / 25
            y = np.maximum(y - 0.05 + 0.01 * random.standard_normal(len(t)), 0.0)
            logs.append(pd.DataFrame({"time_s": t, "duty_pct": np.where((t >= 2) & (t < 10), u, 0.0), "torque_nm": y}))
    assert "idle-at-limit" in {one.code for one in eaid.read(logs).findings}
