"""The order and the names of logs change no value: shuffled repeats give the same curves, to the bit."""

from dataclasses import replace
from typing import Any

import pytest

import eaid
from eaid.steps.stepset import Level


def shuffled(level: Level, order: list[int]) -> Level:
    return Level(level.level, level.time_s, level.runs[order], tuple(f"x{i}" for i in order))


@pytest.mark.slow
def test_shuffled_repeats_give_the_same_fit(sets: Any) -> None:
    made = sets.one_set(5, sets.VARIANTS["base"], samples=600)
    turned = replace(made, levels=tuple(shuffled(level, [2, 0, 1]) for level in made.levels))
    one, two = eaid.fit(made), eaid.fit(turned)
    assert [row.curve for row in one.friction.levels] == [row.curve for row in two.friction.levels]
    assert (one.nonlinear.tau1, one.nonlinear.tau2, one.nonlinear.Ts) == (
        two.nonlinear.tau1, two.nonlinear.tau2, two.nonlinear.Ts,
    )  # fmt: skip
    assert (one.linear.a0, one.linear.b0, one.linear.c0) == (two.linear.a0, two.linear.b0, two.linear.c0)
    for first, second in zip(one.friction.levels, two.friction.levels, strict=True):
        for name in ("Ts", "tau1", "tau2"):
            assert (getattr(first.ci95, name) or ()) == pytest.approx(getattr(second.ci95, name) or (), rel=1e-12)
    assert [f.code for f in one.findings] == [f.code for f in two.findings]
