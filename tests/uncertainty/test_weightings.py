"""Equal and sd weights side by side: both are optima, either order, and the advice follows the scatter."""

from dataclasses import replace
from typing import Any

import msgspec
import numpy as np
import pytest

from eaid.fitting.data import data_of
from eaid.fitting.fit import fit
from eaid.fitting.nonlinear import fit_nonlinear
from eaid.fitting.weights import spread_weights
from eaid.models import friction
from eaid.results.fit import FitOptions
from eaid.steps.stepset import StepSet
from eaid.uncertainty.intervals import with_intervals
from eaid.uncertainty.level_statistics import statistics_at_share
from eaid.uncertainty.linear_intervals import pooled_intervals
from eaid.uncertainty.weightings import rise_of_spread

QUICK = FitOptions(estimator="joint")


@pytest.fixture(scope="module")
def scattered(sets: Any) -> StepSet:
    found: StepSet = sets.one_set(3, sets.VARIANTS["base"], samples=400)
    return found


def told(stepset: StepSet, weights: str) -> tuple[Any, Any]:
    found = fit(stepset, FitOptions(weights=weights))
    return found, with_intervals(stepset, found, QUICK)


def test_the_other_weights_are_fitted_too_whichever_is_asked_for(scattered: StepSet) -> None:
    equal, sure = told(scattered, "equal")
    sd, turned = told(scattered, "sd")
    for one, two in ((equal, sd), (sd, equal)):
        assert one.nonlinear.other_weights.sse == pytest.approx(two.nonlinear.sse, rel=1e-6)
        assert one.linear.other_weights.parameters.a0 == pytest.approx(two.linear.parameters.a0, rel=1e-6)
        assert one.nonlinear.other_weights.solver.converged and one.linear.other_weights.solver.converged
    assert equal.nonlinear.other_weights.level_weights == sd.nonlinear.level_weights
    assert sd.nonlinear.other_weights.level_weights is None
    says, again = sure.nonlinear.agreement[1], turned.nonlinear.agreement[1]
    assert says.believe == again.believe
    for one, two in zip(says.disagreements, again.disagreements, strict=True):
        assert one.levels == two.levels and one.other == pytest.approx(two.other, rel=1e-4)
    assert sure.nonlinear.other_weights.curves[0].level == 10
    assert sure.linear.agreement[0].believe == turned.linear.agreement[0].believe


def test_the_other_fit_is_the_best_there_is(scattered: StepSet) -> None:
    """The fit beside it has no start that a fit of its own would not have had."""
    data = data_of(scattered.levels, spread_weights(scattered.levels))
    beside = fit(scattered).nonlinear
    assert beside is not None and beside.other_weights is not None
    own = fit_nonlinear(data, 0.85)
    cost = sum(w * one.sse for w, one in zip(data.weights, beside.other_weights.per_level, strict=True))
    assert cost <= own.cost * (1 + 1e-6)


def test_gain_scatter_means_sd_weights_white_noise_does_not(scattered: StepSet, sets: Any) -> None:
    assert rise_of_spread(statistics_at_share(scattered.levels, 0.85)) > 2
    random = np.random.default_rng(1)
    white = tuple(
        replace(
            level,
            runs=friction.step_response(sets.plant(level.level, sets.VARIANTS["base"]), level.time_s)
            + 0.02 * random.standard_normal(level.runs.shape),
        )
        for level in scattered.levels
    )
    assert abs(rise_of_spread(statistics_at_share(white, 0.85))) < 2
    _, sure = told(replace(scattered, levels=white), "equal")
    assert sure.nonlinear.agreement[1].believe in ("either", "equal")


def test_a_disagreement_is_one_line_with_which_to_believe_and_why(sets: Any) -> None:
    for seed in range(30):
        found = sets.one_set(seed, sets.VARIANTS["base"], samples=400)
        _, sure = told(found, "equal")
        says = sure.nonlinear.agreement[1]
        if says.disagreements:
            break
    row = says.disagreements[0]
    assert not row.ci95_other[0] <= row.one <= row.ci95_other[1]
    assert not row.ci95[0] <= row.other <= row.ci95[1]
    (one,) = [one for one in sure.findings if one.code == "weights-part"]  # of the linear model equal ones were asked
    assert one.subject == "nonlinear" and one.values["believe"] == "sd" and one.values["repeats"] == 3
    assert sure.linear.agreement[0].believe == "equal" and sure.linear.agreement[0].because == "one-time-constant"


def test_single_runs_have_no_sd_weights_and_it_says_so(scattered: StepSet) -> None:
    single = tuple(replace(one, runs=one.runs[:1], names=one.names[:1]) for one in scattered.levels)
    found, sure = told(replace(scattered, levels=single), "equal")
    assert found.nonlinear.other_weights is None
    assert "no-weights-for-single-runs" in {one.code for one in found.findings}
    assert sure.nonlinear.agreement[1].believe == "equal"
    assert sure.linear.agreement[0].because == "alone"


def test_the_linear_intervals_follow_the_weights(scattered: StepSet) -> None:
    """Against the change that a fit to shifted means really makes."""
    level = scattered.levels[4]
    data = spread_weights(scattered.levels)
    found = fit(scattered, FitOptions(weights="sd", models=("linear",))).linear
    assert found is not None
    from eaid.uncertainty.linear_influence import pooled_gain

    take, along = pooled_gain(scattered.levels, found.parameters, data)[4]
    bump = 1e-4 * np.sin(level.time_s)
    moved = replace(level, runs=level.runs + bump)
    levels = (*scattered.levels[:4], moved, *scattered.levels[5:])
    again = fit(replace(scattered, levels=levels), FitOptions(weights="sd", models=("linear",))).linear
    assert again is not None
    change = np.array([getattr(again.parameters, k) - getattr(found.parameters, k) for k in ("a0", "b0", "c0")])
    assert change == pytest.approx(take @ (along @ bump), rel=1e-2)
    stats = statistics_at_share(scattered.levels, 0.85)
    assert pooled_intervals(found, stats) != pooled_intervals(msgspec.structs.replace(found, level_weights=None), stats)
