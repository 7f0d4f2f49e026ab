"""Steps of one level, their average, their sign; the set in words, as a table, and as a dataset that others write."""

from pathlib import Path

import numpy as np
import pytest

import eaid
from eaid.errors import UsageError

from .make import curve, log, plus, read, told, values, white, with_input

PLAN = [(0.0, 2.0), (50.0, 6.0)]


def levels(*inputs: float, **more: float) -> dict[str, object]:
    return {f"u{u:g}": log([(0, 2), (u, 4)], **more) for u in inputs}


def test_mean_and_spread_of_equal_repeats() -> None:
    logs = [log(PLAN, noise=0.05, seed=k) for k in range(3)]
    (level,) = read(logs).levels
    stack = np.stack([one.torque_nm[200:] - one.torque_nm[:200].mean() for one in logs])
    assert level.runs.shape == (3, 600) and level.names == ("a", "b", "c")
    np.testing.assert_allclose(level.mean, stack.mean(axis=0), rtol=1e-12)
    np.testing.assert_allclose(level.sd, stack.std(axis=0, ddof=1), rtol=1e-12)
    np.testing.assert_allclose(level.time_s, np.arange(600) * 0.01, atol=1e-12)
    (alone,) = read(logs[0]).levels
    assert (alone.sd == 0).all() and alone.sd.shape == (600,)


def test_other_rates_are_interpolated_to_the_finest() -> None:
    """Linear interpolation is off by h²/8 · |f''|: (0.01)² / 8 · 2 · 0.85 / 0.2² = 5.3e-4."""
    logs = [log(PLAN, rate_hz=rate, gain=gain) for rate, gain in ((100.0, 0.0404), (1000.0, 0.04), (250.0, 0.0402))]
    (level,) = read(logs).levels
    np.testing.assert_allclose(np.diff(level.time_s), 1e-3, rtol=1e-9)
    assert len(level.time_s) == 5991  # to 5.99 s, the last sample of the coarsest
    np.testing.assert_allclose(level.runs[0], 2.02 * curve(level.time_s), atol=6e-4)
    np.testing.assert_allclose(level.runs[1], 2 * curve(level.time_s), atol=1e-12)


def test_rounded_times_are_even_and_jittered_ones_are_kept() -> None:
    frame = log(PLAN)
    rounded = read(frame.assign(time_s=np.round(np.arange(800) / 128.0, 5)))
    np.testing.assert_allclose(np.diff(rounded.levels[0].time_s), 1 / 128, rtol=1e-9)
    assert rounded.runs[0].rate_hz == pytest.approx(128, rel=1e-3)
    times = frame.time_s + 0.004 * np.random.default_rng(5).uniform(size=800)
    steps = read(frame.assign(time_s=times))
    assert told(steps) == []
    np.testing.assert_allclose(steps.levels[0].time_s, times[200:] - times[200], atol=1e-12)


@pytest.mark.parametrize(
    ("low", "noise", "found"),
    [(99.95, 0, [2]), (99.8, 0, [1, 1]), (99.3, 0.1, [2]), (98.8, 0.1, [1, 1]), (99.5, 3.0, [2]), (97.0, 3.0, [1, 1])],
)
def test_one_level_or_two(low: float, noise: float, found: list[int]) -> None:
    """Within 0.1 %, or within 1 % and ten standard deviations of the input's noise; the level is their mean."""
    logs = [log([(0, 2), (u, 4)], unit="N") for u in (low, 100.0)]
    logs = [with_input(one, one.force_n + (white(600, noise, k) if noise else 0)) for k, one in enumerate(logs)]
    steps = read(logs)
    assert [len(level.names) for level in steps.levels] == found
    if found == [2]:
        assert steps.levels[0].level == pytest.approx((low + 100) / 2, abs=0.3 * noise + 1e-9)


@pytest.mark.parametrize(
    ("text", "kept"),
    [("50:100", [60, 90, 91]), ("10:30,60", [30, 60]), ("90.7", [91]), ("60:60", [60]), ("60.5", [60])],
)
def test_levels_that_are_kept(text: str, kept: list[float]) -> None:
    steps = read(levels(30, 60, 90, 91), levels=text)
    assert [level.level for level in steps.levels] == kept
    assert [run.name for run in steps.runs] == [f"u{u}" for u in kept] == [run.name for run in steps.steps]


@pytest.mark.parametrize("text", ["a", "20:10", "10:20:30", "", "30,"])
def test_levels_that_are_no_levels(text: str) -> None:
    with pytest.raises(UsageError, match=f"levels= {text}: write 30:100 or 30,40,90"):
        read(levels(30, 60), levels=text)


def test_a_level_that_is_kept_keeps_its_releases_and_steps() -> None:
    steps = read({f"u{u}": log([(0, 2), (u, 4), (0, 9)]) for u in (30, 60, 90)}, levels="60")
    assert [run.name for run in steps.runs] == ["u60", "u60-release"]
    assert [level.level for level in steps.releases] == [60.0]
    assert [(step.from_level, step.level) for step in steps.level_steps] == [(0, 60), (60, 0)]


def test_an_output_that_falls_is_turned_and_told_once() -> None:
    steps = read(levels(1.5, 50, 80, gain=-0.04, offset=0.2, noise=0.01))
    assert [float(level.mean[-1]) for level in steps.levels] == pytest.approx([0.06, 2.0, 3.2], abs=0.05)
    assert values(steps, "signs-turned") == {"runs": 3}


def test_small_inputs_and_negative_ones_have_signs_of_their_own() -> None:
    up = {f"u{u}": log([(0, 4), (u, 6)], "V", gain=-4.0, noise=0.01) for u in (0.3, 0.6)}
    steps = read(up | {"down": log([(0, 4), (-0.6, 6)], "V", gain=-4.0, noise=0.01, seed=1)})
    assert [(level.level, len(level.names)) for level in steps.levels] == [(0.3, 1), (0.6, 2)]
    assert (steps.levels[1].runs[:, -1] > 2).all()
    assert values(steps, "signs-turned") == {"runs": 2}


@pytest.mark.parametrize(("gain", "odd"), [(-0.004, None), (-0.04, {"siblings": 3})])
def test_one_log_of_the_other_sign(gain: float, odd: dict[str, int] | None) -> None:
    """Below a fifth of the usual change a sign is not held against a log; beyond, it alone is named."""
    steps = read([*(log(PLAN, noise=0.005, seed=k) for k in range(3)), log(PLAN, noise=0.005, gain=gain)])
    stops = {run.name: one.values for run in steps.runs for one in run.findings if one.severity == "stop"}
    assert stops == ({"d": odd} if odd else {})
    assert steps.levels[0].runs[0, -1] == pytest.approx(2.0, abs=0.05)


def test_a_log_in_another_unit_and_sign_does_not_outvote_the_others() -> None:
    steps = read([*(log(PLAN, noise=0.005, seed=k) for k in range(2)), log(PLAN, gain=-40.0)])
    odd = [run.name for run in steps.runs for one in run.findings if one.code == "sign-differs"]
    assert odd == ["c"] and "signs-turned" not in told(steps)


def test_a_step_between_levels_goes_its_own_way() -> None:
    steps = read(log([(30, 6), (60, 6), (20, 6)], gain=-0.04))
    assert told(steps) == ["level-to-level"]
    assert [(s.edge, round(s.change, 1)) for s in steps.level_steps] == [("up", -1.2), ("down", 1.6)]


def test_a_set_in_words_and_as_a_table() -> None:
    steps = read([log([(0, 4), (50, 8)]), log([(0, 4), (80, 8), (0, 4)])])
    assert steps.summary().splitlines()[0] == "clutch: 2 levels, 50 … 80 %, 3 runs"
    table = steps.to_frame()
    assert list(table.index) == ["a", "b", "b-release"] and list(table["level"]) == [50.0, 80.0, 80.0]
    assert table.loc["b-release"].dropna().drop(["sha256", "idle_density"], errors="ignore").to_dict() == {
        "source": "b", "level": 80.0, "repeat": 1, "baseline_nm": 0.0, "step_s": 12.0, "samples": 400,
        "rate_hz": pytest.approx(100.0), "edge": "falling", "findings": "", "from_level": 0.0, "left_out": False,
        "left_pct": pytest.approx(0.3, abs=0.05),
    }  # fmt: skip
    turned = read(log([(0, 4), (50, 8)], gain=-0.04))
    assert len(turned.warnings) == 1 and "with its sign turned" in turned.warnings[0] and not turned.runs[0].warnings


def test_findings_of_a_set_the_gravest_first_and_each_once() -> None:
    plain = log(PLAN, rate_hz=1000.0)
    spiked = [plus(plain, np.where(np.arange(8000) == 2000 * size, size, 0.0)) for size in (2.5, 3.0)]
    steps = read([*spiked, log([(0, 2), (80, 6)])])
    found = steps.all_findings
    assert [(one.code, one.severity) for one in found] == [("runs-left-out", "caution")]
    told = found[0].values
    assert (told["runs"], told["of"]) == (("a", "b"), 3) and "far out of" in told["why"]
    assert [level.level for level in steps.levels] == [80.0]
    assert [run.left_out for run in steps.runs] == [True, True, False]
    alone = read(spiked)  # nothing sound is left: all are fitted, and the stop stands
    assert [(one.code, one.severity) for one in alone.all_findings] == [("spikes", "stop")] and len(alone.levels) == 1


@pytest.mark.parametrize(
    ("unit", "kind", "surfaces"), [("%", "clutch", 2), ("N", "friction-force", 1), ("V", "clutch", None)]
)
def test_a_clutch_has_two_surfaces_a_friction_rig_one_and_of_another_rig_nothing_is_known(
    unit: str, kind: str, surfaces: int | None
) -> None:
    steps = read(log(PLAN, unit))
    assert (steps.kind, steps.input_unit, steps.output_unit) == (kind, unit, "N·m")
    assert (steps.apparatus and steps.apparatus.surfaces) == surfaces
    assert (eaid.fit(steps).data.apparatus is None) is (surfaces is None)
    assert read(log(PLAN, unit), apparatus="surfaces=4").apparatus.surfaces == 4


def test_the_density_of_the_idle_noise() -> None:
    """White noise of standard deviation σ at a rate f has S = σ²/f; a drift is none; an idle of 1.9 s tells nothing."""
    for rate in (100.0, 1000.0):
        frame = log([(0, 100), (50, 5)], rate_hz=rate, noise=0.02)
        (run,) = read(plus(frame, 0.01 * frame.time_s)).runs
        assert run.idle_density == pytest.approx(4e-4 / rate, rel=0.2)
    assert read(log([(0, 1.9), (50, 5)], noise=0.02)).runs[0].idle_density is None


def test_a_release_that_stands_still_is_read_again(tmp_path: Path) -> None:
    """What is constant in one stored piece was checked with its log."""
    frame = log([(0, 2), (50, 5), (0, 2)])
    read(frame.assign(torque_nm=frame.torque_nm.where(frame.time_s < 7, 0.0))).save(tmp_path / "data.h5")
    assert [run.edge for run in eaid.read(tmp_path / "data.h5").runs] == ["rising", "falling"]


def test_a_fit_of_the_few_runs_that_are_left_must_not_be_used() -> None:
    """Of a rig whose load ramps 21 of 24 runs were left out, and the other three "usable"."""
    plain = log([(0, 4), (50, 8)])
    since = np.maximum(np.asarray(plain.time_s) - 4, 0)
    ramping = with_input(plain, np.where(since > 0, -50 * np.expm1(-since / 0.08), 0.0))
    for count, severity in ((2, "caution"), (4, "stop")):
        steps = read([*[plus(ramping, white(1200, 0.001, seed)) for seed in range(count)], log([(0, 4), (80, 8)])])
        (one,) = [each for each in steps.all_findings if each.code == "runs-left-out"]
        assert (len(one.values["runs"]), one.severity) == (count, severity)
        assert severity == "caution" or not eaid.fit(steps).verdict.usable
