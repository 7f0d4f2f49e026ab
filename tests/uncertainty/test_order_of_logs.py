"""The order and the names of logs change no value: shuffled repeats give the same curves, to the bit."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from eaid.steps.build import build_stepset
from eaid.steps.stepset import Level
from eaid.synth.logs import NONE, Protocol, synthesise
from eaid.synth.plants import clutch
from eaid.uncertainty.workflow import fit_steps


def shuffled(level: Level, order: list[int]) -> Level:
    return Level(level.level, level.time_s, level.runs[order], tuple(f"x{i}" for i in order))


@pytest.mark.slow
def test_shuffled_repeats_give_the_same_fit(sets: Any) -> None:
    made = sets.one_set(5, sets.VARIANTS["base"], samples=600)
    turned = replace(made, levels=tuple(shuffled(level, [2, 0, 1]) for level in made.levels))
    one, two = fit_steps(made), fit_steps(turned)
    assert [row.curve for row in one.friction.levels] == [row.curve for row in two.friction.levels]
    assert (one.nonlinear.tau1, one.nonlinear.tau2, one.nonlinear.Ts) == (
        two.nonlinear.tau1, two.nonlinear.tau2, two.nonlinear.Ts,
    )  # fmt: skip
    assert (one.linear.a0, one.linear.b0, one.linear.c0) == (two.linear.a0, two.linear.b0, two.linear.c0)
    for first, second in zip(one.friction.levels, two.friction.levels, strict=True):
        for name in ("Ts", "tau1", "tau2"):
            assert (getattr(first.ci95, name) or ()) == pytest.approx(getattr(second.ci95, name) or (), rel=1e-12)
    assert [f.code for f in one.findings] == [f.code for f in two.findings]


def test_clocks_that_differ_by_a_millionth_give_one_grid_in_any_order() -> None:
    """The grid was the first log's: values changed by 6e-7 when files were renamed."""
    runs = synthesise(clutch(), Protocol((50.0,), 3, 1.0, 4.0, 0.0, 100.0), NONE, 0)
    slow = [replace(run, time_s=np.asarray(run.time_s) * (1 + 4e-7 * i)) for i, run in enumerate(runs)]
    forth, back = (build_stepset(logs).levels[0] for logs in (slow, slow[::-1]))
    assert np.array_equal(forth.time_s, back.time_s) and np.array_equal(forth.mean, back.mean)
