"""What is found depends on no unit, offset, name or order."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.stop_findings import BAD, good
from eaid.arrays import read_only
from eaid.errors import DataError
from eaid.logs.run import Run
from eaid.steps import noise
from eaid.steps.build import build_stepset, direction
from eaid.steps.checks import slow_constant
from eaid.steps.cut import StepOptions, cut
from eaid.steps.edges import edges
from eaid.steps.noise import sample_noise, sampled
from eaid.steps.slip import slip_of

sys.path.insert(0, str(Path(__file__).parent))
from make import curve, log


def said(runs: list[Run]) -> list[tuple[str, str]]:
    try:
        made = build_stepset(runs)
    except DataError:
        return [("refused", "")]
    return sorted((one.code, one.subject) for row in made.runs for one in row.findings)


@pytest.mark.parametrize("kind", ["good", *BAD])
@pytest.mark.parametrize(("scale", "shift"), [(1e-4, 0.0), (1e4, 0.0), (1.0, -3.0)])
def test_neither_unit_nor_offset_of_the_output_matters(kind: str, scale: float, shift: float) -> None:
    random = np.random.default_rng(5)
    run = good(random)
    runs = [run] if kind == "good" else BAD[kind][0](random, run)
    # powers of two keep every rounding
    factor = 2.0 ** round(np.log2(scale))
    size = float(np.ptp(runs[0].output))
    offset = shift * 2.0 ** round(np.log2(size)) if size > 0 and kind not in ("saturated", "coarse-output") else 0.0
    changed = [replace(one, output=read_only(factor * one.output + factor * offset)) for one in runs]
    if kind in ("sign-differs",):
        changed = [replace(one, output=read_only(factor * one.output)) for one in runs]
    assert said(changed) == said(runs)


@pytest.mark.parametrize("kind", ["good", *BAD])
def test_the_order_of_logs_does_not_matter(kind: str) -> None:
    random = np.random.default_rng(6)
    run = good(random)
    runs = [run] if kind == "good" else BAD[kind][0](random, run)
    assert said(runs[::-1]) == said(runs)


def test_small_and_large_numbers_alike() -> None:
    t = np.arange(4000) / 500
    y = curve(t, 0.3, 6.0) + 0.005 * np.random.default_rng(0).normal(size=4000)
    found, short = slow_constant(y, 8.0)
    for factor in (2.0**-12, 2.0**12):
        assert slow_constant(factor * y, 8.0) == (pytest.approx(found), short)
    bump = y + 0.5 * np.exp(-((t - 2) ** 2))
    one, other = slip_of(t, bump), slip_of(t, 2.0**-10 * bump)
    assert one is not None and other is not None
    assert other.peak == pytest.approx(one.peak * 2.0**-10)
    assert other.peak_s == one.peak_s
    assert len(edges(t, bump)) == len(edges(t, 1e-6 * bump))


def test_small_inputs_have_signs_too() -> None:
    runs = [log([(0, 4), (u, 6)], gain=-4.0, noise=0.01, name=f"u{u}", input_unit="V") for u in (0.3, 0.6)]
    assert direction([step for run in runs for step in cut(run)]).signs == {False: -1.0, True: 1.0}


def test_levels_that_are_kept_keep_their_runs() -> None:
    runs = [log([(0, 2), (u, 4), (0, 9)], name=f"u{u}") for u in (30, 60, 90)]
    kept = build_stepset(runs, StepOptions(levels="60"))
    assert [run.name for run in kept.runs] == ["u60", "u60-release"]
    assert [level.level for level in kept.releases] == [60.0]
    assert [(step.from_level, step.level) for step in kept.level_steps] == [(0, 60), (60, 0)]


def test_a_fall_to_rest_starts_where_it_was_held() -> None:
    up, down = build_stepset([log([(0, 2), (50, 9), (0, 9)], offset=0.5)]).level_steps
    assert (up.start, up.change) == pytest.approx((0.5, 2.0), abs=0.01)
    assert (down.start, down.change) == pytest.approx((2.5, -2.0), abs=0.01)
    assert (up.edge, down.edge, up.start_known) == ("up", "down", True)
    assert (up.gain, down.gain) == pytest.approx((0.04, 0.04), rel=0.01)


def test_long_records_are_judged_by_stretches(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(noise, "LONG", 1 << 20)
    values = np.random.default_rng(0).normal(size=1 << 20)
    assert len(sampled(values)) == 32 << 14
    assert sample_noise(values) == pytest.approx(1.0, rel=0.02)
    assert sampled(values)[0] == values[0] and sampled(values)[-1] == values[-1]
    assert len(sampled(values[:-1])) == len(values) - 1
