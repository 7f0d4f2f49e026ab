"""The C that runs ask for: found, told where it matters, and not asked of runs that cannot tell."""

from typing import Any

import numpy as np
import pytest

import eaid
from eaid.apparatus import Apparatus
from eaid.plant.dynamics import Step
from eaid.plant.steps import step_response
from eaid.steps.stepset import Level, StepSet

TOLD = {"runs-leave-the-share-open", "runs-reject-the-share"}


def test_a_share_that_agrees_needs_no_warning(sets: Any) -> None:
    made = sets.one_set(3, sets.VARIANTS["base"])
    sure = eaid.fit(made, model=("friction",))
    assert not sure.uncertainty.share.rejected and not TOLD & {one.code for one in sure.findings}


def test_short_records_cannot_tell_it() -> None:
    random = np.random.default_rng(0)
    t = np.arange(150) * 0.01
    levels = tuple(
        Level(10.0 * (i + 1), t, step_response(Step(1.0 + i, 0.2, 8.0), t)
              + 0.02 * random.standard_normal((3, len(t))), ("a", "b", "c"))
        for i in range(5)
    )  # fmt: skip
    made = StepSet("clutch", "%", "N·m", Apparatus(), levels)
    sure = eaid.fit(made, model=("friction",))
    said = sure.uncertainty.share
    assert not said.rejected
    assert "runs-leave-the-share-open" in {one.code for one in sure.findings}


@pytest.mark.slow
def test_of_single_runs_the_interval_is_as_wide_as_the_noise_makes_it() -> None:
    """White noise of one run a level: the standard deviation of C over sets, against t times it in each set."""
    t, told = np.arange(400) * 0.05, []
    for seed in range(8):
        noise = np.random.default_rng(seed).normal(0.0, 0.03, (4, len(t)))
        levels = tuple(
            Level(25.0 * k, t, (step_response(Step(1.0 * k, 0.3, 4.0), t) + noise[k - 1])[None], (f"{k}",))
            for k in (1, 2, 3, 4)
        )
        steps = StepSet("clutch", "%", "N·m", Apparatus(), levels)
        told.append(eaid.fit(steps, model=("friction",)).uncertainty.share)
    half = np.median([0.5 * (one.ci95[1] - one.ci95[0]) for one in told])
    assert half == pytest.approx(3.18 * np.std([one.estimate for one in told]), rel=0.6)
