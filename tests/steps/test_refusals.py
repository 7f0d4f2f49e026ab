"""Logs and options that the steps refuse, each with its sentence; what a set says of itself."""

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from eaid.arrays import Array, read_only
from eaid.errors import DataError, UsageError
from eaid.logs.run import Run
from eaid.steps.build import build_stepset, stepset_of
from eaid.steps.cut import onset
from eaid.steps.edges import asked_edges, jumps
from eaid.steps.levels import wanted_levels
from eaid.steps.slip import slip_of

sys.path.insert(0, str(Path(__file__).parent))
from make import curve, log

PLAN = [(0.0, 4.0), (50.0, 8.0)]
RUN = log(PLAN)
NO_INPUT = replace(RUN, input=read_only(np.full(1200, np.nan)))


@pytest.mark.parametrize(
    ("runs", "sentence"),
    [
        ([RUN.part(slice(9))], "holds 9 samples, and a step takes at least 10"),
        ([RUN, replace(RUN, input_unit="V")], "different input units [(]%, V[)]; say one with units= input=UNIT"),
        ([RUN, replace(RUN, output_unit="")], "different output units [(]N·m, none[)]"),
        ([RUN, replace(RUN, kind="friction-force")], "different experiments [(]clutch, friction-force[)]"),
        ([NO_INPUT], "nothing tells its level"),
        ([replace(NO_INPUT, name="run_60V")], '"_{level}V", if 60 is the level'),
        ([replace(NO_INPUT, step_s=4.0)], "nothing tells its level"),
        ([replace(RUN, step_s=12.5)], "the step at 12.5 s lies outside the log [(]0 to 11.99 s[)]"),
        ([replace(RUN, step_s=4.0, until_s=4.0)], "the window ends [(]4 s[)] before it begins [(]4 s[)]"),
        ([replace(RUN, step_s=4.0, level=50.0, cut=True).part(slice(409))], "9 samples in its window, at least 10"),
        ([replace(RUN, input=read_only(np.full(1200, 50.0)))], "the input stays at 50 %: no step"),
        ([replace(RUN, output=read_only(np.full(1200, 0.5)))], "the output never changes [(]0.5 N·m throughout[)]"),
    ],
)
def test_logs_without_a_step(runs: list[Run], sentence: str) -> None:
    with pytest.raises(DataError, match=sentence):
        build_stepset(runs)


def test_ten_samples_are_enough() -> None:
    short = replace(RUN, step_s=4.0, level=50.0, cut=True, baseline=0.0).part(slice(410))
    assert build_stepset([short]).runs[0].samples == 10


def test_no_logs() -> None:
    with pytest.raises(DataError, match="no log holds a step"):
        stepset_of([])


@pytest.mark.parametrize("text", ["a", "20:10", "10:20:30", "", "30,"])
def test_levels_that_are_none(text: str) -> None:
    with pytest.raises(UsageError, match="bounds_levels= .*: write 30:100 or 30,40,90"):
        wanted_levels(text, [10.0, 20.0, 30.0], "bounds_levels")


def test_levels_by_range_and_name() -> None:
    assert wanted_levels("20:30,10", [10.0, 20.0, 30.0, 40.0]) == [10.0, 20.0, 30.0]
    assert wanted_levels("10:10", [10.0, 20.0]) == [10.0]


def test_a_stored_idle_output_counts() -> None:
    run = build_stepset([replace(log([(0.0, 4.0), (50.0, 8.0), (0.0, 8.0)]), baseline=0.25)])
    assert [row.baseline_nm for row in run.runs] == [0.25, 0.25]


def test_a_set_in_words_and_as_a_table() -> None:
    steps = build_stepset([RUN, log([(0.0, 4.0), (80.0, 8.0)], name="b")])
    assert steps.summary().splitlines()[0] == "clutch: 2 levels, 50 … 80 %, 2 runs"
    table = steps.to_frame()
    assert list(table.index) == ["a", "b"] and list(table["level"]) == [50.0, 80.0]
    assert replace(steps, runs=()).to_frame().empty
    with pytest.raises(DataError, match="holds averaged levels only"):
        steps.save("a.h5")


T = np.arange(3000) / 100
STAIRS = np.select([T < 5, T < 12, T < 20], [0.0, 2.0, 1.0], 3.0)


def _ramped(steps: Array, lag: int) -> Array:
    """A reference that goes to each value in `lag` equal parts."""
    return np.convolve(np.concatenate((np.zeros(lag - 1), steps)), np.ones(lag) / lag, "valid")


def test_jumps_of_a_reference() -> None:
    assert jumps(STAIRS) == [500, 1200, 2000]
    assert jumps(np.where(T < 20.0, STAIRS, 1.21)) == [500, 1200, 2000]  # a tenth of the range is 0.2
    assert jumps(np.where(T < 20.0, STAIRS, 1.19)) == [500, 1200]
    assert jumps(_ramped(STAIRS, 3)) == [500, 1200, 2000]  # each jump in three parts is one
    assert jumps(_ramped(STAIRS, 4)) == [500, 2000]  # a quarter of 1 is no tenth of 3
    assert jumps(np.sin(T)) == jumps(np.zeros(3000)) == []
    twice = np.where(T >= 5.31, 4.0, np.where(T >= 5.0, 2.0, 0.0))
    assert jumps(twice) == [500, 531] and jumps(np.where(T >= 5.29, twice + (T < 5.31), twice)) == [500]


def test_edges_that_a_reference_asks_for() -> None:
    output = 0.5 + 2 * curve(T - 5, 0.2, 0.2) - curve(T - 12, 0.4, 0.4) + 2 * curve(T - 20, 0.8, 0.8)
    found = asked_edges(T, output, STAIRS)
    assert [edge.before for edge in found] == pytest.approx([0.5, 2.5, 1.5], abs=1e-3)
    assert [edge.after for edge in found] == pytest.approx([2.5, 1.5, 3.5], abs=1e-3)
    rises = [np.log(9) * tau for tau in (0.2, 0.4, 0.8)]
    assert [edge.rise_s for edge in found] == pytest.approx(rises, abs=0.03)
    assert [edge.settling_s for edge in found] == pytest.approx([np.log(18) * tau for tau in (0.2, 0.4, 0.8)], abs=0.06)
    assert not asked_edges(T, output[:2009], STAIRS[:2009])[2:]  # 9 samples behind the last jump
    assert len(asked_edges(T, output[:2010], STAIRS[:2010])) == 3
    assert asked_edges(T, np.zeros(3000), STAIRS) == ()


@pytest.mark.parametrize("make", [np.zeros, lambda n: np.where(np.arange(n) < 1, 0.0, 1.0)])
def test_no_onset(make: Callable[[int], Array]) -> None:
    assert onset(make(400)) is None


def test_a_slip_without_noise_has_no_stick_slip() -> None:
    y = np.where(T < 3, T / 3, 0.5)
    slip = slip_of(T, y)
    assert slip is not None and slip.stick_slip is None and slip.stick_slip_hz is None
    assert slip.peak == pytest.approx(1.0, abs=0.03) and slip.after == 0.5
    assert slip.stiffness_per_s == pytest.approx(1 / 3)


def test_warnings_are_the_sentences_of_the_findings() -> None:
    steps = build_stepset([replace(RUN, output=read_only(-RUN.output))])
    assert len(steps.warnings) == len(steps.findings) == 1 and steps.runs[0].warnings == ()
