"""A set of steps → a finished fit: the estimate and its intervals, the models, what is to be known of them.

The one entry that the command line and a notebook share.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from operator import attrgetter
from typing import Any

import msgspec
import numpy as np
from threadpoolctl import threadpool_limits

from eaid.arrays import median
from eaid.declared import forms
from eaid.errors import DataError, UsageError
from eaid.estimate.data import Data, data_of
from eaid.estimate.scatter import Scatter, noise_of
from eaid.findings import Finding, finding, merged, ranked
from eaid.levels.adequacy import adequacy, no_steps, scatter_findings, share_of
from eaid.levels.bootstrap import bootstrap, drawn_ends
from eaid.levels.certainty import Estimate, estimate_levels_first
from eaid.levels.creep import find_share_and_creep
from eaid.levels.drive_limit import flat_levels, limit_at, limit_explains_as_well
from eaid.levels.each_level import OwnLevels, own_levels
from eaid.levels.fade import find_fade
from eaid.levels.friction import friction_part, quote_each, white_ends
from eaid.levels.from_steps import fit_levels_first, fit_nonlinear, refit_nonlinear
from eaid.levels.jitter import Starts, find_starts_apart, lay_in_step
from eaid.levels.linear import linear_part
from eaid.levels.nonlinear import find_flat_levels, nonlinear_part
from eaid.levels.release import release_fit
from eaid.levels.tails import (
    TAIL_MATTERS,
    Tails,
    are_sound,
    data_on_tails,
    find_tails,
    largest_part,
    settle_tails,
    take_off_tails,
)
from eaid.levels.task import FitTask, fit_with_loss
from eaid.options import MODELS, FitOptions, typed
from eaid.plant.dynamics import SHARE, Plant
from eaid.plant.forms import torque_form
from eaid.results.common import Input, Source
from eaid.results.fit import Fit, FitGiven
from eaid.results.models import CreepFound, FittedData, Friction, LackOfFit, Release, Uncertainty
from eaid.results.plant import FittedPlant, PlantIntervals, with_release
from eaid.results.verdict import judged
from eaid.shapes.delay import Begin, cut_behind, dead_time_of
from eaid.shapes.each_step import between_rows, fit_another_shape, fit_single_steps
from eaid.steps.stepset import Creep, Level, StepSet

LARGEST_NUMBER = 1e60  # Largest size of a number that a result may hold; its cube is still a number
# Findings that no creep leaves behind it
WRONG_FORM = ("taus-meet", "output-decays-under-hold", "repeats-miss-alike", "polynomials-too-low")
NO_STEP_CODES = ("output-stays-at-rest", "curve-explains-little")  # What no step response explains
UNSEEN_ROWS = 3.0  # Rows within which a fast part is over that no one sees for a lag
LARGE_TAIL = 0.2  # Part of its level's output, from which on a tail puts a run off the others


def keep_quotable(value: Any) -> Any:
    """The same with unknown numbers as None, intervals with such an end as a whole; itself where all are known."""
    if isinstance(value, msgspec.Struct):
        old = {name: getattr(value, name) for name in value.__struct_fields__}
        changed = {name: new for name, have in old.items() if (new := keep_quotable(have)) is not have}
        return msgspec.structs.replace(value, **changed) if changed else value
    if isinstance(value, tuple):
        if len(value) == 2 and all(isinstance(end, float) for end in value):
            return value if all(map(_is_known, value)) else None
        items = tuple(map(keep_quotable, value))
        return value if all(a is b for a, b in zip(items, value, strict=True)) else items
    if isinstance(value, dict):
        entries = {name: keep_quotable(item) for name, item in value.items()}
        return value if all(entries[name] is value[name] for name in value) else entries
    return None if isinstance(value, float) and not _is_known(value) else value


def _is_known(value: float) -> bool:
    return -LARGEST_NUMBER <= value <= LARGEST_NUMBER


def fit_steps(
    stepset: StepSet, options: FitOptions, progress: Callable[[], None] | None = None, starts: Starts | None = None
) -> Fit:
    """Fit a set of steps and find how sure the result is: what `eaid.fit` calls.

    `progress` is called once per bootstrap refit. `UsageError` for an option that is none, or a model that the kind of
    experiment does not allow; `DataError` without a rising step.
    """
    # the products here are small: threads of BLAS would wait for each other, and round otherwise than one does
    with threadpool_limits(1, user_api="blas"):
        begin, as_given = Begin(), stepset
        if stepset.levels or not stepset.level_steps:
            begin = dead_time_of(stepset, options)
            recorded = cut_behind(stepset.noted_late(-begin.dead_time_s), begin.dead_time_s)
            stepset, result, scatter = _fit_without_tails(recorded, options, progress)
            if starts is None and (found := find_starts_apart(scatter)) is not None:
                return fit_steps(lay_in_step(as_given, found), options, progress, found)
            no_step = [one for one in result.findings if one.code in NO_STEP_CODES]
            if no_step and sum(len(one.levels) for one in no_step) < len(recorded.levels) - len(options.hold_out):
                recorded = recorded.without(no_step)
                stepset, result, _ = _fit_without_tails(recorded, options, progress)
            if options.curve == "auto" and (flat := flat_levels(result)) is not None:
                recorded, stepset, result = _fit_within_limit(recorded, stepset, result, flat, options, progress)
            stepset, result = _fit_beside(recorded, stepset, result, options, progress)
        else:  # a staircase that never rests: no model of steps from rest
            result = Fit(data=data_of_steps(stepset), uncertainty=Uncertainty("none"))
        shapes = fit_single_steps(stepset, options)
        if not (stepset.levels or shapes):
            raise DataError(
                "the logs hold no rise, from rest or between levels, and a fall alone does not tell what was held; "
                "record the rise before it, too, or say when the input came with «step_at», if the log begins then"
            )
        codes = {one.code for one in (*result.findings, *stepset.all_findings)}
        if another := not shapes and bool(codes & OTHER_SHAPES):
            shapes = fit_another_shape(stepset, options)
        of_C = bool(codes & {"runs-reject-the-share", "share-by-evidence"})  # which says it of all steps
        of_shapes = [
            warning for shape in shapes for warning in shape.findings
            if not of_C or warning.values.get("shape") != "free" or shape.dead_time_s > 0
            if not begin.dead_time_s or warning.values.get("shape") not in ("one", "two")  # which the model has, too
        ]  # fmt: skip
        of_shapes = list(merged(of_shapes)) if another else of_shapes
        rows = between_rows(shapes) if "friction" in (options.model or ("friction",)) else ()
        if rows:
            part = result.friction or Friction(options.held_share)
            result = msgspec.structs.replace(
                result, friction=msgspec.structs.replace(part, levels=(*part.levels, *rows))
            )
        told = add_plant(msgspec.structs.replace(result, steps=shapes), stepset, begin)
        result = keep_quotable(told)
        beyond_measure = [] if result is told else [finding("numbers-beyond-measure", "data")]
        of_logs = [repeat_options(one, options) for one in stepset.all_findings]
        of_logs += [] if starts is None else [starts.told]
        late_s, missed = begin.dead_time_s, "repeats-miss-alike" in codes
        of_filter = [finding("filter-not-dead-time", "steps", dead_time_s=late_s)] if late_s > 0 and missed else []
        every = (*of_logs, *result.findings, *begin.findings, *of_filter, *of_shapes, *beyond_measure)
        return judged(
            msgspec.structs.replace(
                result,
                options=list_options(options, stepset),
                seed=options.seed,
                converged=has_converged(result),
                findings=ranked(add_release(one, result.release) for one in every),
            )
        )


def _fit_within_limit(
    recorded: StepSet, stepset: StepSet, result: Fit, flat: Finding, options: FitOptions,
    progress: Callable[[], None] | None,
) -> tuple[StepSet, StepSet, Fit]:  # fmt: skip
    """The set as recorded, without tails, and its fit: of a drive that ends where levels are `flat`, where that
    explains them as well."""
    if options.hold_out or options.bounds_levels:  # which may name levels beyond it
        return recorded, stepset, result
    limited = limit_at(recorded, msgspec.structs.replace(flat, values={**flat.values, "how": "limit"}))
    if limited is None:
        return recorded, stepset, result
    without, within, _ = _fit_without_tails(limited, options, progress)
    as_well = limit_explains_as_well(within, result, stepset.levels)
    return (limited, without, within) if as_well else (recorded, stepset, result)


@np.errstate(all="ignore")  # tails of rounds that run away overflow
def _fit_without_tails(
    stepset: StepSet, options: FitOptions, progress: Callable[[], None] | None, near: Fit | None = None
) -> tuple[StepSet, Fit, Scatter]:
    """The set without the tails of the steps before, where these matter, its fit, and how runs scatter; `near` is a fit
    without tails of steps that differ little, in place of one with them."""
    plain = None
    if near is None or not near.on_tails:
        plain = _fit_levels(stepset, options, progress)
        near = plain[0]
    if near.nonlinear is not None:
        begin = with_release(near.nonlinear.parameters, near.release)
        found = find_tails(begin, stepset)
        if largest_part(stepset, found)[0] >= TAIL_MATTERS and are_sound(stepset, found):
            return _fit_on_tails(stepset, begin, near.release, options, progress)
    return (stepset, *(plain or _fit_levels(stepset, options, progress)))


def _fit_on_tails(
    stepset: StepSet, begin: Plant, release: Release | None, options: FitOptions, progress: Callable[[], None] | None
) -> tuple[StepSet, Fit, Scatter]:
    """The set without its tails, which are settled from where they begin, and its fit on these."""
    recorded, _ = split_held_out(stepset.levels, options.hold_out)

    def estimate(tails: Tails, without: StepSet) -> Estimate:
        kept, _ = split_held_out(without.levels, options.hold_out)
        solved = fit_levels_first(data_on_tails(recorded, tails), options.held_share)
        return Estimate(kept, solved, torque_form(options.curve, solved.steps.data.u))

    tails, plant, falls = settle_tails(stepset, begin, release, lambda *of: estimate(*of).parameters)
    without, release = take_off_tails(stepset, plant, tails), falls.release
    errors = [with_release(one, release) for one in estimate(tails, without).moved]
    errors += [with_release(plant, one) for one in falls.moved]
    data = data_on_tails(recorded, tails, [find_tails(one, stepset) for one in errors])
    result, scatter = _fit_levels(without, options, progress, data)
    part, level = largest_part(stepset, tails)
    told = [finding("tails-taken-off", "data", [level], pct=100 * part, unit=stepset.input_unit)]
    parts = {one.level: largest_part(replace(stepset, levels=(one,)), tails)[0] for one in stepset.levels}
    large = {u for u, of_level in parts.items() if of_level > LARGE_TAIL}
    told += [  # a run on a large tail lies off by what is not known of that
        one for one in result.findings
        if one.subject != "release" and not (one.code == "repeat-is-off" and large.issuperset(one.levels))
    ]  # fmt: skip
    told += [finding("release-as-left", "release")] if release is not None and release.as_left else []
    return without, msgspec.structs.replace(result, release=release, findings=tuple(told)), scatter


def _fit_beside(
    recorded: StepSet, stepset: StepSet, result: Fit, options: FitOptions, progress: Callable[[], None] | None
) -> tuple[StepSet, Fit]:
    """The set and its fit, with a C of its own and without a creep of its output where the runs show them, and nobody
    has held C; `stepset` is that of the fit so far, without the tails of the one `recorded`."""
    share, codes = None if result.uncertainty is None else result.uncertainty.share, {x.code for x in result.findings}
    decays = "output-decays-under-hold" in codes
    unheld = options.share == SHARE and options.estimator != "joint"  # that is the paper's own fit
    single = all(len(level.runs) == 1 for level in stepset.levels)  # which do not say what C they ask for
    so_far = stepset, result
    if share is None or not unheld or "rise-of-the-rig" in codes:
        return so_far
    asked = share.rejected or decays or single
    if not asked and "repeats-miss-alike" not in codes:
        return so_far
    of_clutch = asked and result.nonlinear is not None
    free, creep = find_share_and_creep(stepset, share, SHARE) if of_clutch else (False, None)
    fade, surely = find_fade(stepset, SHARE, creep)
    told = list[Finding]()
    if fade is not None:
        free, creep = (False, fade) if surely else (free, None)
        told = [] if surely or decays else [_tell_creep(fade, result.data, "fade-possible")]
    if creep is None and (decays or not free):
        return stepset, msgspec.structs.replace(result, findings=(*result.findings, *told))
    if creep is not None:
        recorded = replace(recorded.without_creep(creep.rate, creep.t0_s, creep.in_proportion), creep=creep)
        told.append(_tell_creep(creep, result.data))
    options = replace(options, share="free") if free else options
    stepset, result, _ = _fit_without_tails(recorded, options, progress, result)
    wrong = {one.code for one in result.findings}.intersection(WRONG_FORM)
    if creep is not None and creep.in_proportion:  # which bends no curve over the levels
        wrong -= codes & {"polynomials-too-low"}
    if creep is not None and wrong:
        return so_far  # it is of the form that is wrong, as that of a plant which rings
    if free and result.nonlinear is not None and (unseen := _fast_part_unseen(result, stepset)):
        stepset, result = so_far
        return stepset, msgspec.structs.replace(result, findings=(*result.findings, unseen))
    if free and result.nonlinear is not None:
        C, known = result.nonlinear.C, result.nonlinear.ci95
        low, high = (known and known.C) or (C, C)
        told.append(finding("share-by-evidence", "nonlinear", held=SHARE, C=C, low=low, high=high))
    told += [one for one in result.findings if one.code != "share-free"]
    return stepset, msgspec.structs.replace(result, findings=tuple(told))


def tell_within_row(fit: Fit) -> Fit:
    """The fit, a dead time below the time from row to row told: the input may have been switched anywhere in one."""
    late_s, row_s = fit.dead_time_s, 1 / (fit.data.sample_rate_hz or np.inf)
    if not 0 < late_s < row_s:
        return fit
    one = finding("dead-time-within-row", "nonlinear", dead_time_s=late_s, row_s=row_s, most_s=late_s + row_s)
    return msgspec.structs.replace(fit, findings=ranked((*fit.findings, one)))


def _fast_part_unseen(free: Fit, stepset: StepSet) -> Finding | None:
    """Said where the fast part of a C that was set free is over within `UNSEEN_ROWS`: an input noted late looks so."""
    fast_s = float(free.plant.time_constants(np.array([one.level for one in stepset.levels]))[0].max())
    row_s = median([float(one.time_s[-1]) / (len(one.time_s) - 1) for one in stepset.levels])
    if free.nonlinear is None or fast_s > UNSEEN_ROWS * row_s:
        return None
    return finding("fast-part-unseen", "nonlinear", C=free.nonlinear.C, fast_s=fast_s, rows=fast_s / row_s, held=SHARE)


def _tell_creep(creep: Creep, data: FittedData, fades: str = "fade-taken-off") -> Finding:
    """That it was taken off, or of one in proportion what `fades` says."""
    rate, low, high = creep.rate, creep.rate - creep.half, creep.rate + creep.half
    if not creep.in_proportion:
        return finding("creep-taken-off", "data", rate=rate, low=low, high=high, unit=data.output_unit)
    hold_s = max(data.record_s)
    pct, least, most = (-100 * hold_s * one for one in (rate, high, low))
    return finding(fades, "data", pct=pct, low=least, high=most, hold_s=hold_s)


def _fit_levels(
    stepset: StepSet, options: FitOptions, progress: Callable[[], None] | None, on_tails: Data | None = None
) -> tuple[Fit, Scatter]:
    """The models of steps from rest, with intervals, and how the runs scatter; curves of τ near 0 or far beyond a
    record overflow on the way. `on_tails`: their mean curves with the tails that the steps are without."""
    if not stepset.levels:
        raise DataError("no rising step was found in the logs; give «step_at», or check the input column")
    models = choose_models(stepset.kind, options.model)
    if options.loss == "huber" and options.ci == "bootstrap":
        raise UsageError("«ci» bootstrap: refits by squares, not by «loss» huber; take robust")
    if options.holds_curve:
        refuse_curve(stepset, options, models)
    kept, held_out = split_held_out(stepset.levels, options.hold_out)
    plain, whole = data_of(kept, stepset.creep), stepset
    data = plain if on_tails is None else replace(plain, compressed=on_tails.points)
    stepset = replace(stepset, levels=kept)
    task = FitTask(stepset, data, options, held_out, progress)
    with np.errstate(all="ignore"):
        fitted = _fit_model if "nonlinear" in models else _fit_each_level
        result, near = fitted(task, models)
        scatter, share = near.scatter, None
        findings = [*result.findings, *scatter_findings(scatter, stepset.runs), *no_steps(scatter)]
        misfits: tuple[LackOfFit, ...] = ()
        if "friction" in models or "nonlinear" in models:
            misfits, more = adequacy(scatter, stepset.input_unit)
            findings += more
            if options.held_share is not None:  # which values are right is no matter of intervals
                share, more = share_of(near, data)
                findings += more
        if "linear" in models:
            linear, more = linear_part(replace(task, data=plain), scatter)
            result = msgspec.structs.replace(result, linear=linear)
            findings += more
    summary = Uncertainty(
        ci=options.ci,
        scatter_from=scatter.source,
        degrees_of_freedom=scatter.degrees,
        noise=noise_of(scatter, stepset.runs),
        draws=options.draws if options.ci == "bootstrap" else None,
        share=share,
        lack_of_fit=misfits,
    )
    result = msgspec.structs.replace(result, data=data_of_steps(whole), uncertainty=summary)
    if stepset.releases:
        release, more = release_fit(stepset.releases, kept, scatter.curves, options.held_share or SHARE)
        result, findings = msgspec.structs.replace(result, release=release), [*findings, *more]
    return msgspec.structs.replace(result, findings=tuple(findings)), scatter


def _fit_model(task: FitTask, models: Sequence[str]) -> tuple[Fit, Estimate | OwnLevels]:
    """The nonlinear model, and the friction curves that it gives at the levels; the estimate behind them."""
    options, levels, share = task.options, task.stepset.levels, task.options.held_share
    form = torque_form(options.curve, task.data.u)
    first, huber = fit_with_loss(task, "nonlinear", lambda d, near: estimate_levels_first(levels, d, share, near, form))
    joint, of_joint = fit_with_loss(
        task, "nonlinear", lambda d, near: refit_nonlinear(d, near) if near else fit_nonlinear(d, share)
    )
    papers, draws = options.estimator == "joint", None
    if options.curve == "auto" and not papers and bool((first.scatter.repeats > 1).any()) and find_flat_levels(first):
        task = replace(task, options=replace(options, curve="levels"))
    if options.ci == "bootstrap":
        refit = (lambda again: refit_nonlinear(again, joint).x) if papers else first.refit
        draws = bootstrap(task, first.scatter, refit)
    model, values, findings = nonlinear_part(task, first, joint, draws)
    findings += of_joint if papers else huber
    result = Fit(nonlinear=model)
    if "friction" in models:
        part, more = friction_part(task, values)
        findings += more
        result = msgspec.structs.replace(result, friction=part)
    return msgspec.structs.replace(result, findings=tuple(findings)), first


def _fit_each_level(task: FitTask, models: Sequence[str]) -> tuple[Fit, Estimate | OwnLevels]:
    """Every level by itself, with trends over the levels; their estimates."""
    options, levels, share = task.options, task.stepset.levels, task.options.held_share
    own, huber = fit_with_loss(task, "friction", lambda d, near: own_levels(levels, d, share, near))
    if "friction" not in models:
        return Fit(), own
    ends = None
    if options.ci == "white":
        ends = white_ends(own)
    elif options.ci == "bootstrap":  # refits that run away count by rank
        draws = bootstrap(task, own.scatter, lambda d: own_levels(levels, d, share, own).logs)
        ends = drawn_ends(own.logs, draws, own.intervals[2])
    part, findings = friction_part(task, quote_each(own, ends), own)
    return Fit(friction=part, findings=(*findings, *huber)), own


def usual_idle(stepset: StepSet) -> float:
    """The output before the steps of a set, which was subtracted; of most runs alike."""
    known = [run.baseline_nm for run in stepset.runs if run.baseline_nm is not None and not run.left_out]
    return median(known) if known else 0.0


def add_plant(result: Fit, stepset: StepSet, begin: Begin) -> Fit:
    """A fit of steps with the plant that every later command reads; curves of levels behind their dead time, too."""
    dead_time_s = begin.dead_time_s
    if result.friction is not None and dead_time_s:
        rows = [
            row if row.from_ else msgspec.structs.replace(row, delay_s=dead_time_s) for row in result.friction_levels
        ]
        result = msgspec.structs.replace(result, friction=msgspec.structs.replace(result.friction, levels=tuple(rows)))
    if result.nonlinear is None:
        return result
    plant = with_release(result.nonlinear.parameters, result.release, result.friction_levels)
    timed = replace(plant, dead_time_s=max(dead_time_s, 0.0), idle=usual_idle(stepset))
    ci95 = None if begin.ends is None else PlantIntervals(dead_time_s=begin.ends)
    units = (result.data.input_unit, result.data.output_unit)
    return msgspec.structs.replace(result, plant_=FittedPlant.of(timed, units, ci95))


def has_converged(result: Fit) -> bool:
    """Whether every model that was fitted passed our verdict."""
    parts = (result.friction, result.nonlinear, result.linear, result.release)
    return all(part.solver is None or part.solver.converged for part in parts if part is not None)


def choose_models(kind: str, wanted: Sequence[str] | None) -> tuple[str, ...]:
    """The models to fit; raises UsageError for one that the kind does not allow."""
    allowed = MODELS if kind == "clutch" else ("friction",)
    for name in wanted or ():
        if name not in allowed:
            raise UsageError(f"«model» {name}: {kind} logs can be fitted with {', '.join(allowed)}")
    return tuple(name for name in allowed if wanted is None or name in wanted)


def refuse_curve(stepset: StepSet, options: FitOptions, models: Sequence[str]) -> None:
    """Refuse a T_s(u) through the levels where no level has a value of its own, and any where no curve is fitted."""
    said = f"«curve» {options.curve}"
    if "nonlinear" not in models:
        raise UsageError(f"{said}: belongs to the nonlinear model, which is not fitted here; leave it out")
    if options.estimator == "joint":
        raise UsageError(f"{said}: the joint fit is that of the paper's cubic; leave «estimator» joint out")
    if options.through and all(len(level.runs) == 1 for level in stepset.levels):
        raise UsageError("«curve» levels: needs repeats, for a single run does not tell its level from itself")


def split_held_out(levels: Sequence[Level], hold_out: Sequence[float]) -> tuple[tuple[Level, ...], tuple[Level, ...]]:
    """The levels to fit and those held out; raises UsageError where a held-out level is not there."""
    there = [level.level for level in levels]
    for wanted in hold_out:
        if not any(np.isclose(wanted, level) for level in there):
            raise UsageError(f"«hold_out» {wanted:g}: no such level; there are {', '.join(f'{u:g}' for u in there)}")
    held = tuple(level for level in levels if any(np.isclose(level.level, u) for u in hold_out))
    kept = tuple(level for level in levels if not any(np.isclose(level.level, u) for u in hold_out))
    if not kept:
        raise UsageError("«hold_out»: every level is held out; leave some to be fitted")
    return kept, held


def data_of_steps(stepset: StepSet) -> FittedData:
    """What a fit is made from: kind, units, levels, the rig and the runs."""
    of_source = attrgetter("source", "sha256", "name", "level", "repeat", "baseline_nm", "step_s", "samples", "edge")
    rates = [run.rate_hz for run in stepset.runs if not run.left_out]
    if not rates:
        rates = [(len(level.time_s) - 1) / float(level.time_s[-1] - level.time_s[0]) for level in stepset.levels]
    creep = stepset.creep
    ends = (0.0, 0.0) if creep is None else (creep.rate - creep.half, creep.rate + creep.half)
    return FittedData(
        creep=None if creep is None else CreepFound(creep.rate, ends, creep.t0_s, creep.in_proportion),
        kind=stepset.kind,  # type: ignore[arg-type]  # one of the three
        input_unit=stepset.input_unit,
        output_unit=stepset.output_unit,
        levels=tuple(level.level for level in stepset.levels),
        repeats=tuple(len(level.runs) for level in stepset.levels),
        samples=tuple(len(level.time_s) for level in stepset.levels),
        record_s=tuple(float(level.time_s[-1]) for level in stepset.levels),
        sample_rate_hz=max(rates, default=None),
        apparatus=stepset.apparatus,
        sources=tuple(Source(*of_source(run)) for run in stepset.runs if not run.left_out),
        inputs=tuple(Input(path, sha256) for path, sha256 in stepset.inputs),
        synthetic=stepset.synthetic,
    )


OTHER_SHAPES = {"repeats-miss-alike", "output-decays-under-hold"}  # Findings that ask what shape single steps have


def repeat_options(found: Finding, options: FitOptions) -> Finding:
    """A finding whose commands repeat this call, with the options of the fit beside those of reading."""
    if "options" not in found.values:
        return found
    both = f"{found.values['options']} {typed(options.given())}".strip()
    return msgspec.structs.replace(found, values={**found.values, "options": both})


def add_release(found: Finding, release: Release | None) -> Finding:
    """A creep downwards, with the release that may be behind it."""
    falls = found.values.get("slope", found.values.get("rate"))
    if found.code not in ("output-creeps", "creep-taken-off") or release is None or not float(falls or 0) < 0:  # type: ignore[arg-type]
        return found
    return msgspec.structs.replace(found, values={**found.values, "release_s": release.tau2})


def list_options(options: FitOptions, stepset: StepSet) -> FitGiven:
    """The options as fit.json keeps them, beside those of reading."""
    values = {name: getattr(options, name) for name in forms(FitOptions)}
    return FitGiven(**values, reading=dict(stepset.reading))
