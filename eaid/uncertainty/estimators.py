"""Which estimate of the nonlinear model is believed: the joint fit, or the two-stage one.

Where the joint curves leave the two-stage intervals, run-to-run scatter of the gain has bent them, and the two-stage
estimate is taken, unless too few levels determine a parameter for a curve through them. The estimate that was asked for
is taken whatever the evidence says; a finding then tells what it says.
"""

from collections.abc import Sequence
from dataclasses import replace

import msgspec

from eaid.arrays import Array
from eaid.findings import Finding, Value, finding
from eaid.results.fit import Fit
from eaid.results.nonlinear import Agreement, Disagreement, Estimate, Nonlinear
from eaid.steps.stepset import Level
from eaid.uncertainty import nonlinear_intervals, weightings
from eaid.uncertainty.identifiability import identifiable, nonlinear_findings
from eaid.uncertainty.joint import BLOCKS, curves_apart, with_white_covariance
from eaid.uncertainty.level_statistics import LevelStatistics
from eaid.uncertainty.weightings import weights_array

OF_THE_JOINT_FIT = ("fit-not-converged", "constraint-holds", "starts-end-apart", "model-explains-little")
"""Codes that are said of the joint fit only, where that is the estimate that stands."""


def believed(
    fit: Fit, base: LevelStatistics, ci: str, estimator: str, held_out: Sequence[Level], draws: Array | None = None
) -> Fit:
    """The fit with intervals of its nonlinear model, the believed estimate in its place and the other beside it."""
    joint = fit.nonlinear
    assert joint is not None
    found = nonlinear_intervals.estimates(joint, base)
    alone, degrees = found.joint_alone, found.degrees
    if draws is not None:
        found = nonlinear_intervals.with_joint(found, draws)
    if ci == "white":
        white, spare = with_white_covariance(found.joint, base.levels, weights_array(joint))
        found = replace(found, joint=white, joint_alone=white, degrees=dict.fromkeys(BLOCKS, spare))
    wanted = held_out if joint.hold_out is not None else ()
    beside = nonlinear_intervals.two_stage_part(found, base, "none" if ci == "none" else "robust", wanted)
    says = agreement(found, base)
    other = joint.other_weights
    reweighted = None if other is None else nonlinear_intervals.scattered(other, base)
    weighted = weightings.agreement(joint, alone, reweighted, degrees, base)
    if ci != "none":
        beyond = None if ci == "white" else found.two_stage
        curves = nonlinear_intervals.level_curves(found.joint_alone, found.degrees, base.levels, beyond)
        joint = nonlinear_intervals.with_intervals(joint, found.joint, found.degrees, curves, ci)
        if other is not None and reweighted is not None:
            curves = nonlinear_intervals.level_curves(reweighted, found.degrees, base.levels)
            other = nonlinear_intervals.with_intervals(other, reweighted, found.degrees, curves)
    two_stage, doubts = (None, []) if beside is None else beside
    taken, because = chosen(estimator, says, two_stage)
    more = _findings(estimator, taken, says, base, found.joint.open)
    if taken == "two-stage" and two_stage is not None:
        kept = [one for one in fit.findings if one.subject != "nonlinear" or one.code not in OF_THE_JOINT_FIT]
        known = {one.code for one in kept if one.subject == "nonlinear"}
        more += [one for one in doubts if one.code not in known]
        model = Nonlinear.of(two_stage, estimator="two-stage", robust=joint.robust, joint=joint.estimate)
    else:
        kept, model = list(fit.findings), msgspec.structs.replace(joint, two_stage=two_stage)
        more += weightings.findings("nonlinear", joint, weighted, base)
    data = fit.data
    left_open = nonlinear_findings(model, base, data.input_unit, data.output_unit, with_levels=fit.friction is None)
    model = msgspec.structs.replace(
        model, because=because, identifiable=identifiable(left_open), other_weights=other, agreement=(says, weighted)
    )
    return msgspec.structs.replace(fit, nonlinear=model, findings=(*kept, *left_open, *more))


def agreement(found: nonlinear_intervals.Estimates, stats: LevelStatistics) -> Agreement:
    """Where the joint estimate lies outside the two-stage intervals, and which to believe."""
    between = ("joint", "two-stage")
    if found.two_stage is None:
        return Agreement(between, "joint", "alone")
    beyond = tuple(
        msgspec.structs.replace(one, ci95=None, ci95_other=None if held else one.ci95_other)
        for one in curves_apart(found.joint, found.two_stage, found.degrees, stats.duty_pct, one_counts=False)
        for held in [one.parameter in found.two_stage.constrained]
    )
    if not beyond:
        return Agreement(between, "either", "agree")
    weak = found.joint.open
    return Agreement(between, "neither" if weak else "two-stage", "weak" if weak else "apart", beyond)


def chosen(estimator: str, says: Agreement, two_stage: Estimate | None) -> tuple[str, str]:
    """Which estimate is taken, joint or two-stage, and why: asked, alone, agree, apart or weak."""
    if two_stage is None:
        return "joint", "alone"
    if estimator != "auto":
        return estimator, "asked"
    return ("two-stage" if says.believe == "two-stage" else "joint"), says.because


def _findings(estimator: str, taken: str, says: Agreement, base: LevelStatistics, weak: Sequence[str]) -> list[Finding]:
    """What is to be said of the two estimates: nothing where they agree, or where what is believed was asked for."""
    if estimator == "two-stage" and taken == "joint":
        return [finding("no-two-stage-estimate", "nonlinear")]
    if not says.disagreements or (estimator == taken == says.believe):
        return []
    worst = max(says.disagreements, key=_distance)
    low, high = worst.ci95_other or (None, None)
    values: dict[str, Value] = {"worst": worst.worst, "joint": worst.one, "two_stage": worst.other, "low": low}
    if says.believe == "neither":
        code = "estimates-part-and-neither-holds"
        extra: dict[str, Value] = {"weak": tuple(weak)}
    else:
        gain = base.between[0]
        code = "two-stage-estimate-taken" if taken == "two-stage" else "two-stage-estimate-is-better"
        extra = {"gain_pct": 100 * float(gain) ** 0.5 if gain > 0 else 0.0}
    return [finding(code, "nonlinear", worst.levels, parameter=worst.parameter, high=high, **values, **extra)]


def _distance(one: Disagreement) -> float:
    """How far apart two estimates of a parameter are, as a ratio above 1."""
    first, second = abs(one.one or 0.0), abs(one.other or 0.0)
    return max(first, second) / max(min(first, second), 1e-300)
