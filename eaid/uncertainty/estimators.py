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
from eaid.uncertainty import nonlinear_intervals
from eaid.uncertainty.identifiability import identifiable, nonlinear_findings
from eaid.uncertainty.joint import BLOCKS, curves_apart, with_white_covariance
from eaid.uncertainty.level_statistics import LevelStatistics

OF_THE_JOINT_FIT = ("fit-not-converged", "constraint-holds", "starts-end-apart", "model-explains-little")
"""Codes that are said of the joint fit only, where that is the estimate that stands."""


def believed(
    fit: Fit, base: LevelStatistics, ci: str, estimator: str, held_out: Sequence[Level], draws: Array | None = None
) -> Fit:
    """The fit with intervals of its nonlinear model, the believed estimate in its place and the other beside it."""
    joint = fit.nonlinear
    assert joint is not None
    estimates = nonlinear_intervals.estimates(joint, base)
    if draws is not None:
        estimates = nonlinear_intervals.with_joint(estimates, draws)
    if ci == "white":
        white, spare = with_white_covariance(estimates.joint, base.levels)
        estimates = replace(estimates, joint=white, joint_alone=white, degrees=dict.fromkeys(BLOCKS, spare))
    held_out = held_out if joint.hold_out is not None else ()
    beside = nonlinear_intervals.two_stage_part(estimates, base, "none" if ci == "none" else "robust", held_out)
    two_stage, of_two_stage = (None, []) if beside is None else beside

    by_estimate = agreement(estimates, base)
    if ci != "none":
        beyond = None if ci == "white" else estimates.two_stage
        curves = nonlinear_intervals.level_curves(estimates.joint_alone, estimates.degrees, base.levels, beyond)
        joint = nonlinear_intervals.with_intervals(joint, estimates.joint, estimates.degrees, curves, ci)

    taken, because = chosen(estimator, by_estimate, two_stage)
    findings = _findings(estimator, taken, by_estimate, base, estimates.joint.open)
    if taken == "two-stage" and two_stage is not None:
        of_fit = [found for found in fit.findings if found.subject != "nonlinear" or found.code not in OF_THE_JOINT_FIT]
        told = {found.code for found in of_fit if found.subject == "nonlinear"}
        findings += [found for found in of_two_stage if found.code not in told]
        model = Nonlinear.of(two_stage, estimator="two-stage", robust=joint.robust, joint=joint.estimate)
    else:
        of_fit = list(fit.findings)
        model = msgspec.structs.replace(joint, two_stage=two_stage)
    data = fit.data
    left_open = nonlinear_findings(model, base, data.input_unit, data.output_unit, with_levels=fit.friction is None)
    model = msgspec.structs.replace(
        model, because=because, identifiable=identifiable(left_open), agreement=(by_estimate,)
    )
    return msgspec.structs.replace(fit, nonlinear=model, findings=(*of_fit, *left_open, *findings))


def agreement(estimates: nonlinear_intervals.Estimates, stats: LevelStatistics) -> Agreement:
    """Where the joint estimate lies outside the two-stage intervals, and which to believe."""
    between, two_stage = ("joint", "two-stage"), estimates.two_stage
    if two_stage is None:
        return Agreement(between, "joint", "alone")
    apart = curves_apart(estimates.joint, two_stage, estimates.degrees, stats.duty_pct, one_counts=False)
    beyond = []
    for disagreement in apart:
        ends = None if disagreement.parameter in two_stage.constrained else disagreement.ci95_other
        beyond.append(msgspec.structs.replace(disagreement, ci95=None, ci95_other=ends))
    if not beyond:
        return Agreement(between, "either", "agree")
    weak = estimates.joint.open
    return Agreement(between, "neither" if weak else "two-stage", "weak" if weak else "apart", tuple(beyond))


def chosen(estimator: str, agreed: Agreement, two_stage: Estimate | None) -> tuple[str, str]:
    """Which estimate is taken, joint or two-stage, and why: asked, alone, agree, apart or weak."""
    if two_stage is None:
        return "joint", "alone"
    if estimator != "auto":
        return estimator, "asked"
    return ("two-stage" if agreed.believe == "two-stage" else "joint"), agreed.because


def _findings(
    estimator: str, taken: str, agreed: Agreement, base: LevelStatistics, weak: Sequence[str]
) -> list[Finding]:
    """What is to be said of the two estimates: nothing where they agree, or where what is believed was asked for."""
    if estimator == "two-stage" and taken == "joint":
        return [finding("no-two-stage-estimate", "nonlinear")]
    if not agreed.disagreements or (estimator == taken == agreed.believe):
        return []
    worst = max(agreed.disagreements, key=_distance)
    low, high = worst.ci95_other or (None, None)
    values: dict[str, Value] = {"worst": worst.worst, "joint": worst.one, "two_stage": worst.other, "low": low}
    if agreed.believe == "neither":
        code = "estimates-part-and-neither-holds"
        extra: dict[str, Value] = {"weak": tuple(weak)}
    else:
        gain = base.between[0]
        code = "two-stage-estimate-taken" if taken == "two-stage" else "two-stage-estimate-is-better"
        extra = {"gain_pct": 100 * float(gain) ** 0.5 if gain > 0 else 0.0}
    return [finding(code, "nonlinear", worst.levels, parameter=worst.parameter, high=high, **values, **extra)]


def _distance(apart: Disagreement) -> float:
    """How far apart two estimates of a parameter are, as a ratio above 1."""
    first, second = abs(apart.one or 0.0), abs(apart.other or 0.0)
    return max(first, second) / max(min(first, second), 1e-300)
