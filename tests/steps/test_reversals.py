"""A position that goes to and fro: each stroke from its turn, in time, change, direction, displacement of its peak."""

from dataclasses import replace

import numpy as np
import pytest

from eaid.arrays import read_only
from eaid.errors import DataError
from eaid.logs.run import Run
from eaid.steps.build import build_stepset
from eaid.steps.cut import cut, turns_of

RATE, STROKE_S, SPEED = 200.0, 3.0, 10.0


def strokes(count: int = 7, noise: float = 0.0, slow_s: float = 0.2, peak: float = 0.0) -> Run:
    """Friction of ±5 N at 10 mm/s that turns over within 0.1 s of each reversal, and peaks after 0.6 s."""
    time = np.arange(round(count * STROKE_S * RATE)) / RATE
    since = time % STROKE_S
    way = np.where((time // STROKE_S) % 2 == 0, 1.0, -1.0)
    speed = SPEED * way * np.minimum(1.0, np.minimum(since, STROKE_S - since) / slow_s + 1e-6)
    position = np.concatenate(([0.0], np.cumsum(speed)[:-1])) / RATE
    bump = peak * np.exp(-((since - 0.6) ** 2) / 0.02)
    force = way * (5.0 - 10.0 * np.exp(-since / 0.1) + bump)
    force = 30.0 + force + noise * np.random.default_rng(0).normal(size=len(time))
    return Run(
        name="a", time_s=read_only(time), input=read_only(np.full(len(time), 3.0)), output=read_only(force),
        input_unit="bar", output_unit="N", source="a.csv", sha256="0", kind="friction-force",
        position=read_only(position), position_unit="mm",
    )  # fmt: skip


@pytest.mark.parametrize("noise", [0.0, 0.05])
def test_each_stroke_is_a_step_of_its_own(noise: float) -> None:
    steps = cut(strokes(noise=noise))
    assert [step.step_s for step in steps] == pytest.approx([3.0, 6.0, 9.0, 12.0, 15.0, 18.0], abs=0.02)
    assert [step.level for step in steps] == [-3.0, 3.0, -3.0, 3.0, -3.0, 3.0]
    assert [step.baseline for step in steps] == pytest.approx([35, 25, 35, 25, 35, 25], abs=0.5)
    stepset = build_stepset([strokes(noise=noise)])
    (level,) = stepset.levels
    assert (level.level, len(level.names)) == (3.0, 6)
    assert float(level.mean[-50:].mean()) == pytest.approx(10.0, abs=0.3)
    assert level.time_s[-1] == pytest.approx(STROKE_S - 0.14, abs=0.04)  # until it slows down
    assert [one.code for one in stepset.findings] == ["signs-turned"]
    assert "cut-at-reversals" in [one.code for one in stepset.runs[0].findings]
    assert not [one for one in stepset.all_findings if one.severity == "stop"]


def test_the_peak_of_each_stroke_over_its_displacement() -> None:
    for row in build_stepset([strokes(peak=2.0)]).runs:
        assert row.slip is not None and row.slip.moved is not None
        assert (row.slip.peak, row.slip.after) == pytest.approx((12.0, 10.0), rel=0.02)
        assert row.slip.moved == pytest.approx(10.0 * (0.6 - 0.1), abs=0.4)  # 0.2 s to its speed
        assert row.slip.unit == "mm"


def test_a_stroke_without_a_peak_is_told_too() -> None:
    assert all(row.slip is not None for row in build_stepset([strokes()]).runs)


def test_a_level_from_the_file_name() -> None:
    run = strokes()
    named = replace(run, input=read_only(np.full(len(run.time_s), np.nan)), level=7.0)
    assert [level.level for level in build_stepset([named]).levels] == [7.0]
    with pytest.raises(DataError, match="nothing tells its level"):
        cut(replace(named, level=None))


def test_positions_that_do_not_turn() -> None:
    run = strokes()
    for position in (run.time_s, 1.0 + 1e-3 * np.random.default_rng(0).normal(size=len(run.time_s))):
        assert turns_of(read_only(position)) == []
        with pytest.raises(DataError, match="never turns"):
            cut(replace(run, position=read_only(position)))


def test_turns_behind_noise() -> None:
    run = strokes(11)
    assert run.position is not None
    noisy = run.position + 0.2 * np.random.default_rng(1).normal(size=len(run.time_s))
    found = run.time_s[turns_of(read_only(noisy))]
    assert found == pytest.approx(3.0 * np.arange(1, 11), abs=0.12)


@pytest.mark.parametrize(("last", "strokes"), [(10, 2), (11, 3)])
def test_a_stroke_of_ten_samples_counts(last: int, strokes: int) -> None:
    """The last stroke ends with the log; its first sample is the turn."""
    legs = (np.arange(200) / 200, 1 - np.arange(200) / 200, np.arange(200) / 200, 1 - 0.06 * np.arange(last))
    position = np.concatenate(legs)
    time = np.arange(len(position)) / 100
    run = Run(
        name="a", time_s=read_only(time), input=read_only(np.full(len(time), np.nan)), output=read_only(np.sin(time)),
        input_unit="bar", output_unit="N", source="a.csv", sha256="0", level=2.0, position=read_only(position),
    )  # fmt: skip
    assert [step.level for step in cut(run)] == [-2.0, 2.0, -2.0][:strokes]
