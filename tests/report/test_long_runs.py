"""Hours at 10 kHz: block means that begin at the step, rates and counts as recorded."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from eaid.logs.read import read_runs
from eaid.options import ReadOptions
from eaid.report import live
from eaid.report.results import read_results


def test_a_short_run_stays_as_it_is(files: dict[str, Path]):
    run = read_runs([files["clutch.h5"]], ReadOptions())[0]
    assert live.shortened(run) == (run, 1)


def test_blocks_are_means_and_begin_at_the_step(files: dict[str, Path], monkeypatch: pytest.MonkeyPatch):
    run = read_runs([files["clutch.h5"]], ReadOptions())[0]
    monkeypatch.setattr(live, "MOST", 150)
    short, every = live.shortened(run)
    start = int(np.searchsorted(run.time_s, run.step_s))
    assert every == -(-len(run.time_s) // 150) and len(short.time_s) <= 150
    first = int(np.searchsorted(short.time_s, run.step_s))
    for k in (first, first + 7):
        block = slice(start + (k - first) * every, start + (k - first + 1) * every)
        assert short.output[k] == pytest.approx(np.mean(run.output[block]), rel=1e-12)
        assert short.time_s[k] == pytest.approx(np.mean(run.time_s[block]), rel=1e-12)
        assert short.input[k] == run.input[block][0]
    assert short.input[first - 1] == run.input[start - 1] != short.input[first]
    assert live.shortened(replace(run, step_s=None))[1] == 1


@pytest.mark.slow
def test_rates_and_counts_are_those_that_were_recorded(files: dict[str, Path], monkeypatch: pytest.MonkeyPatch):
    whole = read_results([files["clutch.h5"]]).data[0].result
    monkeypatch.setattr(live, "MOST", 400)
    short = read_results([files["clutch.h5"]]).data[0].result
    assert [one.level for one in short.levels] == [one.level for one in whole.levels]
    for one, other in zip(short.runs, whole.runs, strict=True):
        assert one.rate_hz == pytest.approx(other.rate_hz, rel=0.01)
        assert one.samples == pytest.approx(other.samples, rel=0.02)
    assert short.levels[-1].mean[-1] == pytest.approx(whole.levels[-1].mean[-5:].mean(), rel=0.02)


def test_a_dataset_of_many_long_runs_keeps_fewer_samples_of_each(files: dict[str, Path]):
    run = read_runs([files["clutch.h5"]], ReadOptions())[0]
    count = 100_000
    time_s = np.linspace(0, 60, count)
    long = replace(run, time_s=time_s, output=np.sin(time_s), input=np.where(time_s < 5, 0.0, 50.0), step_s=5.0)
    assert live.shortened(long) == (long, 1)
    assert live.shortened(long, 250)[1] == count // (live.MOST_OF_ALL // 250)
    assert live.shortened(long, 5_000)[1] == count // live.LEAST
