"""Recorded logs → a fit: the one entry of this package.

The nonlinear model first, then whether falls differ from rises, then the linear model and the levels by themselves;
intervals from the residuals as they are; what the inputs do not fix is said.
"""

import contextlib
import statistics
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import msgspec
import numpy as np

from eaid.arrays import Array, extremes, median, white_squares
from eaid.errors import DataError, UsageError
from eaid.estimate import forms
from eaid.estimate.coefficients import map_unknowns, with_intervals
from eaid.estimate.data import data_of, errors
from eaid.estimate.own_level import AS_LIMITED
from eaid.estimate.recorded_log import RecordedLog, changes_in_gaps, recorded_log, split_at_gaps
from eaid.findings import Finding, finding, merged, ranked
from eaid.levels import workflow
from eaid.levels.from_steps import fit_linear
from eaid.levels.linear import bounds_findings, bounds_of, parameters, single_levels
from eaid.levels.nonlinear import with_errors
from eaid.levels.unseen import judge_unseen
from eaid.logs.run import Run
from eaid.options import FitOptions
from eaid.plant.dynamics import SHARE
from eaid.plant.forms import PerLevel
from eaid.plant.respond import from_rest, respond
from eaid.recorded.begins import add_rest_before, count_from_rest, mark_resting_start, set_up_above_idle
from eaid.recorded.beside import choose_plant
from eaid.recorded.closed_loop import free_share_by_instruments, judge_loops, refit_by_instruments
from eaid.recorded.clutch_form import Chosen
from eaid.recorded.creep import creep_findings
from eaid.recorded.curve_intervals import CurveSpread, curves
from eaid.recorded.engagements import FEWEST_ENGAGEMENTS, log_that_differs
from eaid.recorded.fall_tests import fit_with_falls
from eaid.recorded.from_logs import Setup, Solved, fit_setup, fit_through, idle_found, plant_found, start_states
from eaid.recorded.held_out import held_out
from eaid.recorded.inputs import FEW_LEVELS, Experiment, find_inputs, input_findings, refuse
from eaid.recorded.jump import jump_findings
from eaid.recorded.left_over import change_findings, column_findings, drift_findings, left_over_findings
from eaid.recorded.log_intervals import Spread, spread, spread_by_runs
from eaid.recorded.plant_part import LevelsOwn, OwnRow, find_own_lags, find_own_levels, intervals, plant_part
from eaid.results.common import LevelError, Source
from eaid.results.fit import Fit
from eaid.results.models import (
    FittedData,
    Friction,
    FrictionLevel,
    LevelIntervals,
    Linear,
    Noise,
    Nonlinear,
    PooledIntervals,
    Release,
    Uncertainty,
)
from eaid.results.recorded import LogCurve, LogFit, Recorded
from eaid.results.residuals import correlation_of
from eaid.results.verdict import judged
from eaid.shapes.each_step import fit_single_steps
from eaid.steps.levels import wanted_levels
from eaid.steps.noise import sample_noise, stretches
from eaid.steps.stepset import Level, StepSet

DRAWN_STRETCHES = 150  # Of a long log, each with the rows of its extremes
DIGITS = 6  # Of the values that are drawn
MOST_HIDDEN = 0.2  # Part of the changes of an input that gaps may hide
NOISE_ALONE = 0.9  # Part of what an output moves that is white noise, from which on it does not move
CHECK_A_CURVE = 4  # Levels that tell whether T_s(u) between them is that of its curve
EXPLAINED_PCT = 80.0  # Of each log, from which on its steps by themselves are not asked


def log_part(solved: Solved, k: int, log: RecordedLog, fitted: RecordedLog) -> LogFit:
    """The result of one log of a fit, from whose output a creep, or a drift of its gain, may have been taken off."""
    drive = solved.setup.drives[k]
    counted = drive.w > 0
    missed, y = solved.missed[k], solved.outputs[k]
    about = float(np.linalg.norm(y - y.mean()))
    span = float(log.time_s[-1] - log.time_s[0])
    known = slice(None) if counted.all() else counted
    time_s, level, measured = (column[known] for column in (log.time_s, log.input, log.output))
    at = extremes([level, measured, missed], DRAWN_STRETCHES)  # rows to be drawn
    columns = (time_s[at], level[at], measured[at], measured[at] + missed[at], -missed[at])
    return LogFit(
        name=log.name,
        path=log.source,
        sha256=log.sha256,
        samples=len(y),
        duration_s=span,
        rate_hz=(len(log.time_s) - 1) / span,
        input_kind="stepwise" if log.stepwise else "moving",
        idle=idle_found(solved, k) + (log.baseline or 0.0),
        start=start_states(solved, k),
        creep=fitted.creep,
        drift=fitted.drift,
        jump=fitted.jump,
        counted_from_s=float(time_s[0] - log.time_s[np.isfinite(log.output)][0]),
        rmse=float(np.sqrt(np.mean(missed * missed))),
        fit_pct=100 * (1 - float(np.linalg.norm(missed)) / about) if about > 0 else None,
        one_step_pct=100 * (1 - float(np.linalg.norm(np.diff(missed))) / about) if about > 0 else None,
        curve=LogCurve(*(tuple(float(f"{x:.{DIGITS}g}") for x in column) for column in columns)),
        correlation=correlation_of([-missed], log.usual_s, level),
    )


STEP_RECORDS = 3.0  # Levels' own linear models are of steps of the fitted model, so many of its longest τ2 long …
LONGEST_STEP_S = 60.0  # … and no longer than this
STEPS_ROWS = 2000


def data_of_logs(experiment: Experiment) -> FittedData:
    """What was fitted."""
    logs, inputs = experiment.logs, experiment.inputs
    told = FittedData() if experiment.steps is None else workflow.data_of_steps(experiment.steps)
    sources = [
        Source(log.source, log.sha256, log.name, baseline_nm=log.baseline, samples=len(log.time_s), edge="recorded")
        for k, log in enumerate(logs)
        if log.source and log.sha256 not in {one.sha256 for one in logs[:k] if one.sha256}  # parts of one are one
    ]
    return msgspec.structs.replace(
        told,
        levels=tuple(inputs.levels.tolist()) if inputs.stepwise else (),
        repeats=(),
        samples=(),
        record_s=(),
        sample_rate_hz=max((len(log.time_s) - 1) / float(log.time_s[-1] - log.time_s[0]) for log in logs),
        sources=(*sources, *told.sources),
        synthetic=experiment.synthetic or told.synthetic,
    )


def nonlinear_of_logs(
    solved: Solved, uncertainty: Spread | None, known: CurveSpread | None, shown: Array, own: LevelsOwn | None
) -> Nonlinear:
    """The ten coefficients, with errors by level and intervals."""
    total, model = errors(solved.outputs, solved.missed), solved.setup.model
    part = with_errors(plant_found(solved), model.free_share, total, _level_errors(solved, shown), solved.solver)
    if uncertainty is None or known is None:
        return part
    if own is not None:
        part = msgspec.structs.replace(part, level_scatter=own.scatter)
    turn = map_unknowns(model)
    covariance = turn @ uncertainty.covariance[: turn.shape[1], : turn.shape[1]] @ turn.T
    return with_intervals(part, known.rows, covariance, {**degrees_of(solved, uncertainty)})


def _level_errors(solved: Solved, shown: Array) -> tuple[LevelError, ...]:
    """Errors of the rows whose input is nearest to each of some levels; rests are left out."""
    duty = np.concatenate([drive.duty[drive.which][drive.w > 0] for drive in solved.setup.drives])
    y, missed = np.concatenate(solved.outputs), np.concatenate(solved.missed)
    nearest = np.where(duty > 0, np.searchsorted(0.5 * (shown[1:] + shown[:-1]), duty), -1)
    rows = []
    for i, level in enumerate(shown.tolist()):
        at = nearest == i
        row = errors([y[at]], [missed[at]]).at(level) if at.any() else LevelError(level)
        # one that has settled has nothing to be explained
        if at.any() and white_squares(y[at]) > NOISE_ALONE * float(np.sum((y[at] - y[at].mean()) ** 2)):
            row = msgspec.structs.replace(row, fit_pct=None, R2=None)
        rows.append(row)
    return tuple(rows)


def degrees_of(solved: Solved, uncertainty: Spread) -> dict[str, float]:
    """Degrees of freedom of T_s, τ1, τ2 at the middle of the range."""
    model = solved.setup.model
    slopes = solved.setup.slopes(np.array([0.5 * (model.low + model.high)]))
    return {name: uncertainty.variance(slopes[k, 0])[1] for name, k in (("tau1", 1), ("tau2", 2), ("Ts", 0))}


def uncertainty_part(solved: Solved, uncertainty: Spread) -> Uncertainty:
    """Where the intervals come from, and the noise that further recordings can be planned with."""
    scatter = uncertainty.scatter
    return Uncertainty(
        ci="robust",
        scatter_from="engagements" if scatter.count >= FEWEST_ENGAGEMENTS else "within",
        degrees_of_freedom=min(degrees_of(solved, uncertainty).values()),
        noise=Noise(scatter.sensor_nm2_s, scatter.ripple_s, {"Ts": scatter.gain, "tau1": scatter.tau1, "tau2": 0.0}),
    )


def linear_of_logs(experiment: Experiment, chosen: Chosen) -> Linear:
    """Eq. (8) of the logs, behind the plant's dead time, with what they leave open; and of each level by itself: of
    steps of the fitted model."""
    base, inputs, wanted = chosen.solved, experiment.inputs, experiment.options.bounds_levels
    levels, of_plant = inputs.basis, base.setup.model
    setup = bare(base) if of_plant.kind == "parallel" else set_up_above_idle(base, chosen.logs)
    model = forms.linear(np.array([-inputs.high, inputs.high]) if of_plant.signed else levels)
    solved = fit_setup(replace(setup, model=model))
    pooled, ends = parameters(model, solved.coefficients), None
    if experiment.options.ci != "none":
        known = spread_by_runs(spread(solved, with_lags=True), solved, experiment.repeats)

        def numbers(x: Array) -> Array:
            one = parameters(model, x[: model.size])
            return np.array([one.a0, one.b0, one.c0])

        ends = PooledIntervals(*intervals(numbers, solved.x, known, signed=(2,)))
    total = errors(solved.outputs, solved.missed)
    p = replace(plant_found(base), dead_time_s=0.0)  # steps from rest of it to each level, behind its dead time
    slowest = p.slowest_s(levels)
    longest = LONGEST_STEP_S if p.kind == "parallel" else np.inf  # a τ2 that no log shows may be endless
    t = np.linspace(0.0, min(STEP_RECORDS * slowest, longest), STEPS_ROWS)
    of_model = data_of([Level(u, t, from_rest(p, t, u)[None], (f"{u:g}",)) for u in levels.tolist()])
    rows = single_levels(of_model, [fit_linear(of_model.only([i])) for i in range(len(levels))])
    no_data = {"rmse": None, "sse": None, "fit_pct": None, "R2": None}  # of the model's own steps
    rows = tuple(msgspec.structs.replace(row, **no_data) for row in rows)
    return Linear(
        a0=pooled.a0,
        b0=pooled.b0,
        c0=pooled.c0,
        solver=solved.solver,
        ci95=ends,
        per_level=rows,
        bounds=bounds_of(rows, None if wanted is None else wanted_levels(wanted, levels.tolist(), "bounds_levels")),
        **total.scores,
    )


def friction_of_logs(
    experiment: Experiment, base: Solved, known: CurveSpread | None, own: Sequence[OwnRow], of_model: bool
) -> Friction | None:  # fmt: skip
    """T_s, τ1, τ2 of the levels: those `of_model` with their intervals, each level's own where the logs tell it, or
    each level's by itself; None where inputs move, or C is free."""
    inputs, share = experiment.inputs, experiment.options.held_share
    few = inputs.stepwise and len(inputs.levels) <= FEW_LEVELS
    if not few or share is None or base.setup.model.kind != "parallel":
        return None
    solved, levels = base, inputs.levels
    if not of_model:
        known, own = None, []
        solved = fit_setup(replace(bare(base), model=forms.friction(levels, share)))
        if extras := tuple(name for name in base.fitted.extras if name != "dead"):
            solved = fit_with_falls(solved, extras)
    share, tables = plant_found(solved).C, solved.curves(levels)
    ends = {row.level: row.ci95 for row in (() if known is None else known.rows)}
    numbers = {"Ts": tables.steady, "tau1": tables.tau1, "tau2": tables.tau2}
    for name, low, value, high in own:
        numbers[name] = value
        for u, least, most in zip(levels.tolist(), low.tolist(), high.tolist(), strict=True) if known else ():
            ends[u] = msgspec.structs.replace(ends.get(u) or LevelIntervals(), **{name: (least, most)})
    values = np.stack([*numbers.values()], axis=1).tolist()
    rows = [
        FrictionLevel(
            one.level, Ts, tau1, tau2, share, rmse=one.rmse, sse=one.sse, fit_pct=one.fit_pct, R2=one.R2,
            ci95=ends.get(one.level),
        )
        for one, (Ts, tau1, tau2) in zip(_level_errors(solved, levels), values, strict=True)
    ]  # fmt: skip
    return Friction(C=share, levels=tuple(rows), solver=solved.solver)


def fit_whole(stepset: StepSet, options: FitOptions) -> Fit:
    """Fit the recorded logs of a set; raises UsageError for options that only steps have."""
    if options.loss != "squares":
        raise UsageError(f"«loss» {options.loss}: logs fitted as recorded take squares; or say «logs_as» steps")
    if options.hold_out:
        raise UsageError("«hold_out»: logs fitted as recorded hold no single levels; or say «logs_as» steps")
    if options.ci not in ("robust", "none"):
        raise UsageError(f"«ci» {options.ci}: logs fitted as recorded take robust or none; or say «logs_as» steps")
    refuse_mixed_units(stepset)
    rest = float(stepset.reading.get("rest", 0.0))
    logs = [recorded_log(run, rest) for run in stepset.recorded]
    refuse(logs)
    shapes = fit_single_steps(stepset, options)
    dead_s = statistics.median_low([one.dead_time_s for one in shapes if one.edge == "up"] or [0.0])
    fit = fit_recorded(logs, options, stepset, dead_time_s=dead_s)
    # what a whole log explains a step of it by itself, which begins on the tail of another, tells no better
    explained = all((log.fit_pct or 0.0) >= EXPLAINED_PCT for log in fit.logs)
    whole = fit.plant_ is not None and (explained or fit.plant_.another)
    of_shapes = () if whole else merged([one for shape in shapes for one in shape.findings])
    findings = (*stepset.all_findings, *fit.findings, *of_shapes)
    told = msgspec.structs.replace(
        fit, options=workflow.list_options(options, stepset), steps=shapes, findings=ranked(findings)
    )
    known = workflow.keep_quotable(told)
    beyond = [] if known is told else [finding("numbers-beyond-measure", "data")]
    return judged(msgspec.structs.replace(known, findings=ranked((*known.findings, *beyond))))


def refuse_mixed_units(stepset: StepSet) -> None:
    """Refuse logs whose numbers are not of one kind; DataError tells all faults."""
    faults = []
    for run in stepset.recorded:
        pairs = (("input", run.input_unit, stepset.input_unit), ("output", run.output_unit, stepset.output_unit))
        for what, own, of_others in pairs:
            if own != of_others:
                faults.append(
                    f"{run.where}: its {what} is in {own or 'no unit'}, that of other logs in {of_others or 'none'}; "
                    f"fit it apart, or say one unit of all with «units» {what}=UNIT"
                )
    if faults:
        raise DataError(*faults)


def fit_recorded(
    runs: Sequence[RecordedLog | Run],
    options: FitOptions | None = None,
    steps: StepSet | None = None,
    rest: float = 0.0,
    *,
    falls: bool = True,
    dead_time_s: float = 0.0,
) -> Fit:
    """Fit recorded logs, of a set of `steps` that says how they were recorded.

    The input of a `Run` is counted from `rest`. With `falls`, falls get unknowns of their own where they differ from
    rises; `dead_time_s` of single steps is taken over where the logs are fitted better with it.
    """
    logs = [run if isinstance(run, RecordedLog) else recorded_log(run, rest) for run in runs]
    made = (run.synthetic for run in runs if isinstance(run, Run) and run.synthetic)
    experiment = experiment_of(logs, options or FitOptions(), steps, falls=falls)
    experiment = replace(experiment, dead_time_s=dead_time_s, synthetic=next(made, None))
    chosen = choose_plant(experiment)
    within = replace(experiment, logs=[without_largest(log) for log in experiment.logs])
    if any(one.limit != log.limit for one, log in zip(within.logs, experiment.logs, strict=True)):
        with contextlib.suppress(DataError):  # of which too little is left
            other = choose_plant(within)
            if goes_beyond(other, within.logs, experiment.logs):
                experiment, chosen = within, other
    return fit_of(experiment, chosen)


# An output that ends below what the plant would give, with noise behind its limit, so that no row repeats another. It
# comes to its largest value as steeply as it rises, and stays there. A fast plant does so, too: which of both it is,
# a fit without the rows at that value tells, by whether it goes well beyond.
NEAR, LARGEST = 4.0, 0.995  # Deviations of the noise about the largest value, which is a quantile of the output
AT_LIMIT_ROWS, AT_LIMIT = 20, 0.02  # Rows of a stretch at the largest value, and part of all rows in such stretches
RISE, STEEP = 5, 8.0  # Rows before a stretch over which the output rises by so many deviations of the noise
LEAST_BEYOND = 0.03  # Part of the largest value by which the plant goes beyond it there


def without_largest(log: RecordedLog) -> RecordedLog:
    """A log without the rows at its largest output, if it comes there as at a limit; itself where it does not."""
    y, known = log.output, np.isfinite(log.output)
    if log.limit is not None or log.reference is not None or not known.all():
        return log
    noise, top = sample_noise(y), float(np.quantile(y, LARGEST))
    limit = median(y[y > top - NEAR * noise])
    starts, stops = stretches(y > limit - NEAR * noise)
    long = (stops - starts >= AT_LIMIT_ROWS) & (starts >= RISE)
    starts, stops = starts[long], stops[long]
    if not len(starts) or (stops - starts).sum() < AT_LIMIT * len(y):
        return log
    if median(y[starts] - y[starts - RISE]) < STEEP * noise:
        return log
    there = y > limit - NEAR * noise
    share_pct = 100 * float(there.mean())
    return replace(log, output=np.where(there, np.nan, y), limit=limit, at_limit_pct=share_pct)


def goes_beyond(chosen: Chosen, logs: Sequence[RecordedLog], whole: Sequence[RecordedLog]) -> bool:
    """Whether the plant that was fitted to logs without their largest outputs goes beyond these in the mean."""
    solved, plant = chosen.solved, plant_found(chosen.solved)
    for k, (log, before, acting) in enumerate(zip(logs, whole, chosen.logs, strict=True)):
        if log is before or log.limit is None:
            continue
        changes_s, start = acting.time_s - acting.late_s, start_states(solved, k)
        y = respond(plant, changes_s, acting.input, acting.time_s, start, acting.stepwise)
        y = y + idle_found(solved, k) + (acting.baseline or 0.0)
        rows = np.isin(acting.time_s, log.time_s[np.isnan(log.output)])
        if float(y[rows].mean()) > (1 + LEAST_BEYOND) * log.limit:
            return True
    return False


def experiment_of(
    logs: Sequence[RecordedLog], options: FitOptions, steps: StepSet | None = None, repeats: Sequence[Level] = (),
    falls: bool = True,
) -> Experiment:  # fmt: skip
    """Logs as they are fitted, of a set of `steps` that says how they were recorded; `DataError` for those that tell
    nothing."""
    refuse(logs)
    logs = [part for log in logs for part in split_at_gaps(log)]
    inputs = find_inputs(logs, options.duty, goes_on=True)
    if options.through and not (inputs.stepwise and 1 < len(inputs.levels) <= FEW_LEVELS):
        raise UsageError("«curve» levels: these logs hold no levels, or too many; leave it out")
    resting = [mark_resting_start(add_rest_before(log, inputs), inputs) for log in logs]
    resting = [count_from_rest(log, len(logs)) for log in resting] if len(logs) > 1 else resting
    return Experiment(resting, inputs, options, repeats, falls, steps)


def fit_of(experiment: Experiment, chosen: Chosen) -> Fit:
    """The whole fit with a plant that was chosen."""
    options, logs, model = experiment.options, experiment.logs, chosen.solved.setup.model
    wanted = options.model or ("friction", "nonlinear", "linear")
    findings = [*input_findings(experiment), *find_parted_logs(logs)]
    if experiment.inputs.stepwise and 1 < (count := len(experiment.inputs.levels)) < CHECK_A_CURVE:
        sizes = [form.size for form in (model.Ts, model.tau1, model.tau2) if form is not None and form.size > 1]
        bent = max(sizes, default=0) >= count * (1 + model.signed)
        findings += [finding("few-levels-for-polynomials", "nonlinear", count=count)] if bent else []
    if not experiment.rests:  # another kind's T_s goes through rest, and tells the idle output so
        code = "idle-not-seen" if model.kind == "parallel" else "rest-not-seen"
        findings += [finding(code, log.name) for log in logs]
    if experiment.of_loops:
        direct_s, solved = chosen.solved.dead_time_s, refit_by_instruments(chosen.solved, chosen.logs)
        if options.share == SHARE and (free := free_share_by_instruments(solved, chosen.logs)) is not None:
            solved, half = free
            C = float(solved.coefficients[-1])
            said = {"held": SHARE, "C": C, "low": C - half, "high": C + half}
            findings.append(finding("share-by-evidence", "nonlinear", (), **said))
        chosen = replace(chosen, solved=solved)
        if (theta_s := chosen.solved.dead_time_s) > direct_s:
            findings += [finding("dead-time", log.name, dead_time_s=theta_s) for log in logs]
    base, over = chosen.solved, replace(experiment, inputs=experiment.inputs.over(model.low, model.high))
    inputs, spreads = over.inputs, None
    if options.ci != "none" or inputs.stepwise:  # which value a level has is no matter of intervals
        spreads = spread_by_runs(spread(base, with_lags=True), base, experiment.repeats)
    own = find_own_levels(base, spreads, inputs, experiment.repeats)
    if own is not None and own.by_form and options.curve == "auto":
        return fit_of(*follow_levels(experiment, chosen, own))
    lags, of_lags = find_own_lags(base, inputs, experiment.repeats)
    uncertainty, known = None if options.ci == "none" else spreads, None
    if uncertainty is not None and model.kind in ("parallel", "lag"):
        known = curves(base, uncertainty, inputs.shown)
    recorded, told = judge_logs(over, chosen, 0 if uncertainty is None else uncertainty.scatter.count)
    findings += [*chosen.findings, *told, *of_lags]
    findings += [] if own is None else own.told
    findings += [] if uncertainty is None else uncertainty.scatter.findings
    if known is not None:
        of_curves = [one for one in known.findings if own is None or one.values["parameter"] != "Ts"]
        findings += [*([] if own is None else own.wide), *of_curves]
    data = data_of_logs(over)
    findings += creep_findings(base, chosen.logs, uncertainty, data.output_unit)
    findings += jump_findings(chosen.logs, data.output_unit)
    linear = linear_of_logs(over, chosen) if "linear" in wanted else None
    findings += [] if linear is None or linear.bounds is None else bounds_findings(linear.per_level, linear.bounds)
    by_model, friction = "nonlinear" in wanted, None
    if "friction" in wanted:
        of_levels = lags if own is None else [own.row, *lags]
        friction = friction_of_logs(over, base, known, of_levels, by_model)
    shown = by_model and model.kind in ("parallel", "lag") and not model.signed
    release = plant_found(base).release
    return Fit(
        findings=ranked(findings),
        seed=options.seed,
        data=data,
        plant_=plant_part(base, data, uncertainty, chosen.kinds, inputs, own) if by_model else None,
        converged=base.solver.converged,
        nonlinear=nonlinear_of_logs(base, uncertainty, known, inputs.shown, own) if shown else None,
        linear=linear,
        friction=friction,
        release=None if release is None or base.setup.falls_as_left else Release(*release, plant_found(base).C),
        uncertainty=None if uncertainty is None else uncertainty_part(base, uncertainty),
        recorded=recorded,
    )


def follow_levels(experiment: Experiment, chosen: Chosen, own: LevelsOwn) -> tuple[Experiment, Chosen]:
    """The plant of logs whose levels no cubic follows: of a range that ends where its output levels off, where the
    drive's limit explains them as well, or with T_s(u) through them."""
    through, flat = take_levels(chosen, own), own.told[0]
    if flat.code != "output-levels-off" or (experiment.options.duty or experiment.repeats):
        return experiment, through
    inputs = find_inputs(experiment.logs, (experiment.inputs.low, flat.levels[0]))
    within = replace(experiment, inputs=inputs, dead_time_s=0.0)
    clipped = choose_plant(within)
    if clipped.solved.cost > AS_LIMITED * through.solved.cost:
        return experiment, through
    told = msgspec.structs.replace(flat, values={**flat.values, "how": "limit"})
    return within, replace(clipped, findings=[*clipped.findings, told])


def take_levels(chosen: Chosen, own: LevelsOwn) -> Chosen:
    """The plant of logs with T_s(u) through the levels that they hold, which no cubic follows."""
    told = [msgspec.structs.replace(one, values={**one.values, "how": "levels"}) for one in own.told]
    if told[0].code == "output-levels-off":  # which says why they scatter
        told = [one for one in told if one.code != "levels-scatter"]
    told = [one if one.code != "levels-scatter" else msgspec.structs.replace(one, severity="note") for one in told]
    solved = own.through or fit_through(chosen.solved, PerLevel(tuple(own.u.tolist())))
    return replace(chosen, solved=solved, findings=[*chosen.findings, *told])


def find_parted_logs(logs: Sequence[RecordedLog]) -> list[Finding]:
    """Logs that gaps part."""
    files = Counter(log.sha256 for log in logs if log.sha256)
    names = {log.sha256: log.name for log in reversed(logs)}
    hidden = sum(len(changes_in_gaps(log)) for log in logs)
    if hidden > MOST_HIDDEN * sum(len(log.changes) - 1 for log in logs):
        return [finding("changes-in-gaps", logs[0].name, count=hidden)]
    return [finding("log-in-parts", names[sha256], parts=count) for sha256, count in files.items() if count > 1]


def judge_logs(experiment: Experiment, chosen: Chosen, engagements: int) -> tuple[Recorded, list[Finding]]:
    """Each log, its loop and what the model makes of what it has not seen; findings of loops, unseen, and left."""
    base, logs = chosen.solved, experiment.logs
    loops, findings = judge_loops(base, chosen.logs)
    unseen = held_out(base, chosen.logs) if base.beside is None else held_out(base.beside, base.beside.logs)
    if unseen is not None:
        findings += judge_unseen(unseen.fit_pct, unseen.held_pct, unseen.of)
    if not loops:
        findings += log_that_differs(base, [log.name for log in logs])
    if not experiment.of_loops:  # whose input follows what is left
        for left in (drift_findings, left_over_findings, change_findings, column_findings):
            findings += left(base, chosen.logs)
    rows = zip(logs, chosen.logs, chosen.late, strict=True)
    off_s = base.dead_time_s if base.fitted.between_rows else 0.0
    return Recorded(
        logs=tuple(
            msgspec.structs.replace(log_part(base, k, log, without), late_rows=late.rows - off_s / log.usual_s)
            for k, (log, without, late) in enumerate(rows)
        ),
        u_range=(experiment.inputs.low, experiment.inputs.high),
        engagements=engagements,
        falls=chosen.falls,
        loops=loops,
        dead_time_s=base.fitted.dead_time_of_plant(base.x),
        hold_out=unseen,
    ), findings


def bare(base: Solved) -> Setup:
    """The logs of a fit behind its dead time, for a model without falls and creeps of its own."""
    return replace(base.fitted, extras=(), creeping=0, dead_time_s=base.dead_time_s)
