"""`intervals`: every parameter of a fit with its 95 % interval, by the way that was asked for, and what is left open.

robust     scatter of whole runs, pooled over levels; coloured residuals by Bartlett windows (the default)
bootstrap  the same, with the variances from refits to resampled runs (or blocks of a single run): a second opinion
profile    as robust, but single levels by the profile of their cost: lopsided where the data are (τ2)
white      the textbook: s² (J'J)⁻¹, as if every sample's error were its own
none       no intervals
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from eaid.errors import UsageError
from eaid.findings import sentences
from eaid.fitting.data import data_of
from eaid.fitting.levels import fit_levels
from eaid.fitting.result import Fit, FrictionFit
from eaid.models.parameters import SHARE
from eaid.steps.stepset import Level, StepSet
from eaid.uncertainty import friction_intervals, linear_intervals, nonlinear_intervals, weightings
from eaid.uncertainty.adequacy import Adequacy, adequacy
from eaid.uncertainty.bootstrap import Draws, bootstrap
from eaid.uncertainty.friction_intervals import Parameter
from eaid.uncertainty.identifiability import (
    Verdict,
    friction_verdict,
    linear_verdict,
    nonlinear_verdict,
    scatter_findings,
)
from eaid.uncertainty.joint import BLOCKS, with_white_covariance
from eaid.uncertainty.level_statistics import LevelStatistics, level_statistics, pooled_statistics, statistics_at_share
from eaid.uncertainty.levels import share_sensitivity
from eaid.uncertainty.noise import noise_json, noise_of
from eaid.uncertainty.profile import profile_interval
from eaid.uncertainty.share import Share, share_json, share_of, share_words
from eaid.uncertainty.student_t import t_quantile
from eaid.uncertainty.weightings import weights_array

METHODS: dict[str, str] = {
    "robust": "scatter of whole runs pooled over levels, coloured residuals allowed for",
    "bootstrap": "variances from refits to resampled whole runs, or to blocks of single runs",
    "profile": "as robust; single levels by the profile of their cost, so that intervals may be lopsided",
    "white": "textbook: every sample's error its own; far too narrow for friction, whose residuals are coloured",
    "none": "no intervals",
}
"""`--ci`, and what each says of itself."""


TOLD = ("at ", "a constraint holds")
"""How sentences of the nonlinear model begin that the single levels, or the fit itself, have told already."""
BELIEVE = {
    "joint": "the joint estimate",
    "two-stage": "the two-stage estimate",
    "neither": "neither of the two estimates",
    "equal": "the fit with equal weights",
    "sd": "the fit with sd weights",
}


@dataclass(frozen=True)
class IntervalOptions:
    """How intervals are found."""

    ci: str = "robust"
    seed: int = 0
    draws: int = 300
    """Bootstrap refits."""
    workers: int = 1
    """Processes that share the refits."""
    estimator: str = "joint"
    """joint or two-stage: which of the two stands as the nonlinear model in fit.json."""
    study_models: bool = True
    """Also judge whether the model is right (`adequacy`)."""


@dataclass(frozen=True, eq=False)
class Intervals:
    """What is put beside a fit in fit.json: by model, keys as CONTRACT.md has them."""

    friction: dict[str, Any] | None
    nonlinear: dict[str, Any] | None
    linear: dict[str, Any] | None
    uncertainty: dict[str, Any]
    """ci, why, where the scatter comes from, what is left open."""
    warnings: tuple[str, ...] = field(default=())


def intervals(
    stepset: StepSet,
    fit: Fit,
    options: IntervalOptions | None = None,
    advance: Callable[[], None] | None = None,
) -> Intervals:
    """Intervals of every model in `fit`, which was fitted to `stepset` (its held-out levels left out).

    `advance` is called once per bootstrap refit.
    """
    options = options or IntervalOptions()
    if options.ci not in METHODS:
        raise UsageError(f"--ci {options.ci}: must be one of {', '.join(METHODS)}")
    try:
        # curves of τ near 0 or far beyond the record overflow on the way; what is not finite in the end becomes none
        with np.errstate(all="ignore"):
            return _intervals(stepset, fit, options, advance)
    except (np.linalg.LinAlgError, ZeroDivisionError, OverflowError) as fault:
        word = f"no intervals: these data do not determine the curves well enough to compute any ({fault})"
        return Intervals(None, None, None, {"ci": options.ci, "why": word, "words": [word]}, (word,))


def _intervals(stepset: StepSet, fit: Fit, options: IntervalOptions, advance: Callable[[], None] | None) -> Intervals:
    fitted = fitted_levels(fit)
    held = tuple(level for level in stepset.levels if level.level not in fitted)
    stepset = replace(stepset, levels=tuple(level for level in stepset.levels if level.level in fitted))
    curves = _statistics(stepset, fit)
    free = fit.friction is not None and fit.friction.C is None
    draws = None
    if options.ci == "bootstrap":
        whole = fit if fit.friction is not None else _with_levels(stepset, fit)
        draws = bootstrap(stepset.levels, whole, options.seed, options.draws, options.workers, advance)
    if draws is not None:
        curves = _with_draws(curves, draws)
    found: dict[str, Any] = {"friction": None, "nonlinear": None, "linear": None}
    unit = stepset.input_unit
    if fit.friction is not None:
        found["friction"] = _friction(fit, curves, options, unit, stepset.output_unit)
    share = fit.nonlinear.parameters.C if fit.nonlinear is not None else None
    base = curves
    if free and share is not None:
        base = statistics_at_share(stepset.levels, share)
        base = base if draws is None else _with_draws(base, draws)
    if fit.nonlinear is not None:
        found["nonlinear"] = _nonlinear(stepset, held, fit, base, options, draws)
    if fit.linear is not None:
        found["linear"] = _linear(stepset, fit, base, options, draws)
    asked = share_of(curves) if options.ci != "none" else None
    judged = None
    if options.study_models and fit.friction is not None:
        judged = adequacy(stepset, fit, base, asked)
    words = sentences(scatter_findings(curves))
    if asked is not None and (asked.matters or asked.vague):
        words.append(share_words(asked))
    return Intervals(
        **found, uncertainty=_summary(curves, options, words, judged, asked), warnings=_warnings(found, words, judged)
    )


def fitted_levels(fit: Fit) -> tuple[float, ...]:
    """Levels that the fit rests on."""
    if fit.friction is not None:
        return tuple(one.level for one in fit.friction.levels)
    if fit.nonlinear is not None:
        return tuple(one.level for one in fit.nonlinear.per_level)
    return tuple(one.level for one in fit.linear.per_level) if fit.linear is not None else ()


def _statistics(stepset: StepSet, fit: Fit) -> LevelStatistics:
    if fit.friction is not None:
        return level_statistics(stepset.levels, fit.friction.levels, fit.friction.C is None)
    return statistics_at_share(stepset.levels, fit.nonlinear.parameters.C if fit.nonlinear is not None else SHARE)


def _with_levels(stepset: StepSet, fit: Fit) -> Fit:
    """The fit with the levels' own curves, which the refits start from, where the friction model was not asked for."""
    share = fit.nonlinear.parameters.C if fit.nonlinear is not None else SHARE
    rows = tuple(fit_levels(data_of(stepset.levels), share))
    part = FrictionFit(share, rows, {}, "level", (), (), rows[0].solver)
    return replace(fit, friction=part)


def _with_draws(base: LevelStatistics, draws: Draws) -> LevelStatistics:
    """The same statistics with the variances of the refits in place of the linear ones."""
    estimates = []
    for one, v in zip(base.estimates, draws.level_variance, strict=True):
        e = one.runs
        own = v[: len(e.log_theta)]
        if e.repeats > 1:
            factor = np.sqrt(own * e.repeats / np.maximum(e.scatter, 1e-300))
            e = replace(e, influence=e.influence * factor)
        else:
            e = replace(e, within=own)
        estimates.append(replace(one, runs=e))
    return pooled_statistics(base.levels, estimates)


def _friction(
    fit: Fit, curves: LevelStatistics, options: IntervalOptions, unit: str, output_unit: str
) -> dict[str, Any]:
    assert fit.friction is not None
    rows = friction_intervals.level_rows(curves, white=options.ci == "white")
    if options.ci == "profile":
        rows = [[_profiled(curves, i, k, p) for k, p in enumerate(own)] for i, own in enumerate(rows)]
    verdict = _verdict_json(friction_verdict(fit.friction, curves, unit, output_unit))
    if options.ci == "none":
        return {"levels": [{}] * len(rows), "trends": {}, **verdict}
    repeats = curves.source == "repeats" and options.ci != "white"
    return {
        "levels": friction_intervals.level_ci95(fit.friction, rows),
        "trends": friction_intervals.trend_ci95(fit.friction, rows, repeats, curves.total_degrees),
        **verdict,
    }


def _verdict_json(verdict: Verdict) -> dict[str, Any]:
    """The keys that a model's part of fit.json gets."""
    return {
        "identifiable": verdict.identifiable,
        "not_identifiable_because": sentences(verdict.reasons),
        "open": sentences(verdict.open),
    }


def _profiled(curves: LevelStatistics, i: int, k: int, p: Parameter) -> Parameter:
    """One level's parameter with the interval of its profile; as it was where scatter, not noise, makes its width."""
    one = curves.estimates[i]
    within = float(one.runs.within[k]) / one.runs.repeats
    if p.name in one.constrained or within < 0.5 * float(curves.variance[i, k]):
        # scatter from run to run (a gain, a τ1) knows nothing of the cost's shape: logs are its own scale
        return p
    if p.state == "open":
        return p  # not quoted, however its profile looks
    inverse = np.linalg.pinv(one.runs.information, rcond=1e-14, hermitian=True)
    if not inverse[k, k] > 0:
        return p
    t = t_quantile(float(curves.degrees[i, k]))
    rise = t**2 * float(curves.variance[i, k]) / float(inverse[k, k])
    points = data_of([curves.levels[i]]).points
    low, high = np.exp(profile_interval(points, one.curve, k, rise, curves.variance.shape[1] == 4))
    if p.name == "C":
        low, high = low / (1 + low), high / (1 + high) if np.isfinite(high) else 1.0
    if not np.isfinite(high) or low <= 0:
        return replace(p, interval=None, state="open")
    return replace(p, interval=(float(low), float(high)), state="fine" if p.interval is None else p.state)


def _nonlinear(
    stepset: StepSet,
    held: Sequence[Level],
    fit: Fit,
    base: LevelStatistics,
    options: IntervalOptions,
    draws: Draws | None,
) -> dict[str, Any]:
    own = fit.nonlinear
    assert own is not None
    found = nonlinear_intervals.estimates(own, base)
    alone, degrees = found.joint_alone, found.degrees
    if draws is not None and draws.joint is not None:
        found = nonlinear_intervals.with_joint(found, draws.joint)
    if options.ci == "white":
        joint, spare = with_white_covariance(found.joint, base.levels, weights_array(own.weights))
        found = replace(found, joint=joint, joint_alone=joint, degrees=dict.fromkeys(BLOCKS, spare))
    both = nonlinear_intervals.as_fit(found, base, held if own.hold_out is not None else ())
    shown = both if both is not None and options.estimator == "two-stage" else own
    unit = stepset.output_unit
    other = None if own.other is None else nonlinear_intervals.scattered(own.other, base)
    says = nonlinear_intervals.agreement(found, base, unit)
    says["weights"] = weightings.agreement(own, alone, other, degrees, base, unit)
    if says["weights"]["disagreements"] and says["believe"] == "neither":
        says["weights"] |= {"believe": "neither", "because": says["because"]}
    if says["weights"]["believe"] == "sd" and says["believe"] == "two-stage":
        says["weights"]["because"] += "; the two-stage estimate needs no such weights and is better than either"
    verdict = _verdict_json(nonlinear_verdict(shown, base, stepset.input_unit, unit))
    result: dict[str, Any] = {**verdict, "agreement": says}
    if options.ci != "none":
        result |= nonlinear_intervals.joint_json(found, base.levels, options.ci)
        if other is not None:
            result["other_weights"] = nonlinear_intervals.intervals_json(other, found.degrees, base.levels)
    if both is not None:
        source = "none" if options.ci == "none" else "robust"
        result["two_stage"] = nonlinear_intervals.two_stage_json(found, both, base, source)
    return result


def _linear(
    stepset: StepSet, fit: Fit, base: LevelStatistics, options: IntervalOptions, draws: Draws | None
) -> dict[str, Any]:
    assert fit.linear is not None
    pooled = linear_intervals.pooled_intervals(fit.linear, base)
    if len(base.levels) == 1:
        pooled.pop("c0")
    verdict: dict[str, Any] = _verdict_json(linear_verdict(fit.linear, base, pooled))
    beside = None if fit.linear.other is None else linear_intervals.pooled_intervals(fit.linear.other, base)
    verdict["agreement"] = {"weights": weightings.linear_agreement(fit.linear, pooled, beside, base)}
    if options.ci == "none":
        return verdict
    if beside is not None:
        verdict["other_weights"] = {"ci95": beside}
    if options.ci == "white":
        textbook = linear_intervals.white(fit.linear, stepset.levels)
        own = [row["ci95"] for row in textbook["per_level"]]
        result = {
            "ci95": textbook["pooled"]["ci95"],
            "sd": textbook["pooled"]["sd"],
            "per_level": textbook["per_level"],
        }
    else:
        own = linear_intervals.level_intervals(fit.linear, base)
        if draws is not None:
            pooled, own = linear_intervals.from_draws(fit.linear, draws.pooled, draws.own, base)
        result = {"ci95": pooled, "per_level": [{"ci95": row} for row in own]}
    pairs = [(row.level, ci["B"]) for row, ci in zip(fit.linear.per_level, own, strict=True)]
    result["bounds"] = {"ci95": linear_intervals.bound_intervals(fit.linear.bounds, pairs)}
    return {**result, **verdict}


def _summary(
    curves: LevelStatistics, options: IntervalOptions, words: list[str], judged: Adequacy | None, asked: Share | None
) -> dict[str, Any]:
    why = {
        "repeats": "each level has repeats: whole runs are compared, and their scatter is pooled over the levels",
        "curve": "one run a level: the scatter is taken from the levels' distance to a curve through them",
        "within": "one run a level and few levels: only the noise within each run is known, a lower bound",
    }[curves.source]
    names = ("Ts", "tau1", "tau2", "C")
    result: dict[str, Any] = {
        "ci": options.ci,
        "means": METHODS[options.ci],
        "why": why,
        "nominal": 0.95,
        "scatter_from": curves.source,
        "degrees_of_freedom": curves.total_degrees,
        "run_to_run_pct": {
            name: 100 * float(np.sqrt(a)) if np.isfinite(a) else None
            for name, a in zip(names, curves.between, strict=False)
        },
        "noise": noise_json(noise_of(curves)),
        "words": words,
    }
    if curves.variance.shape[1] == 3:
        result["share"] = {
            "held": curves.estimates[0].curve.C,
            "means": "intervals are for this C; change of the parameters [%] if it were larger by 0.01",
            "per_0.01_pct": share_sensitivity(curves.levels, curves.estimates),
        }
    if asked is not None:
        there = curves
        if asked.matters and asked.estimate is not None:
            there = statistics_at_share(curves.levels, asked.estimate)
        result["share"] |= share_json(asked, there)
    if options.ci == "bootstrap":
        result |= {"draws": options.draws, "seed": options.seed}
    if judged is not None:
        result["adequacy"] = judged.as_json()
    return result


def _warnings(found: dict[str, Any], words: list[str], judged: Adequacy | None) -> tuple[str, ...]:
    """What a user has to be told, in one line each."""
    said = [*words, *(judged.warnings if judged is not None else ())]
    for name in ("friction", "nonlinear", "linear"):
        part = found[name]
        if part is not None:
            said += [f"{name} model: {reason}" for reason in part["not_identifiable_because"]]
    shown = found["friction"] or found["nonlinear"]
    if shown is not None:
        said += shown["open"]
    if found["friction"] is not None and found["nonlinear"] is not None:
        said += [text for text in found["nonlinear"]["open"] if not text.startswith(TOLD)]
    part = found["nonlinear"]
    if part is not None and part["agreement"]["disagreements"]:
        says = part["agreement"]
        said += [one["words"] for one in says["disagreements"]]
        said.append(f"believe {BELIEVE[says['believe']]}: {says['because']}")
    for name in ("nonlinear", "linear"):
        if found[name] is not None:
            said += _weights_words(name, found[name]["agreement"]["weights"])
    return tuple(said)


def _weights_words(name: str, says: dict[str, Any]) -> list[str]:
    """One line where equal and sd weights disagree, and which of them to believe; nothing where they agree."""
    if not says["disagreements"]:
        return []
    apart = "; ".join(one["words"] for one in says["disagreements"])
    if says["believe"] == "neither":
        return [f"{name} model, {apart}: believe neither, for the reason just given"]
    return [f"{name} model, {apart}: of the two believe {BELIEVE[says['believe']]}: {says['because']}"]


def attach(result: dict[str, Any], found: Intervals, estimator: str = "joint") -> dict[str, Any]:
    """fit.json's dictionary with the intervals in their places; with two-stage, that estimate in the model's own."""
    done = dict(result)
    for name in ("friction", "linear", "nonlinear"):
        part = getattr(found, name)
        if part is not None and name in done:
            done[name] = _merged(done[name], part)
    if estimator == "two-stage" and found.nonlinear is not None and "two_stage" in found.nonlinear:
        done["nonlinear"] = _swapped(done["nonlinear"])
    done["uncertainty"] = found.uncertainty
    done["warnings"] = list(dict.fromkeys([*result.get("warnings", []), *found.warnings]))
    return done


def _merged(have: Any, more: Any) -> Any:
    """Two trees as one; lists of equal length row by row."""
    if isinstance(have, dict) and isinstance(more, dict):
        return {**have, **{key: _merged(have[key], part) if key in have else part for key, part in more.items()}}
    if (
        isinstance(have, list)
        and isinstance(more, list)
        and len(have) == len(more)
        and have
        and isinstance(have[0], dict)
    ):
        return [_merged(a, b) for a, b in zip(have, more, strict=True)]
    return more


OF_THE_JOINT = ("weights", "robust", "other_weights")
"""What only a joint fit has."""


def _swapped(part: dict[str, Any]) -> dict[str, Any]:
    """The nonlinear part with the two-stage estimate as the model, and the joint one beside it."""
    two = part["two_stage"]
    joint = {key: part[key] for key in (*two, *OF_THE_JOINT) if key in part}
    rest = {key: value for key, value in part.items() if key not in ("two_stage", *OF_THE_JOINT)}
    return {**rest, **two, "estimator": "two-stage", "joint": joint}
