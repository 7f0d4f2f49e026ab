"""Recorded logs → a fit: the one entry of this package.

The nonlinear model first, then whether falls differ from rises, then the linear model and the levels by themselves;
intervals from the residuals as they are; what the inputs never asked about is said. Logs of ordinary steps are fitted
with them as their mean curves, each sample of each repeat alike.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from eaid.arrays import Array
from eaid.findings import Finding, finding, ranked
from eaid.logs.run import Run
from eaid.models.parameters import Linear as Eq8
from eaid.recorded import checks, model
from eaid.recorded.as_results import data_part, friction_part, linear_part, nonlinear_part, uncertainty_part
from eaid.recorded.closed_loop import judged_loops
from eaid.recorded.curve_intervals import CurveSpread, curves, inputs_shown, widened
from eaid.recorded.falls import CHANCE, tested, tested_by_level
from eaid.recorded.frequency import LEAST_ROWS, frequency_response
from eaid.recorded.instrument import with_instrument
from eaid.recorded.intervals import spread
from eaid.recorded.late import delay_findings
from eaid.recorded.log import RecordedLog, levels_of, logs_of_steps, recorded_log
from eaid.recorded.log_results import log_parts
from eaid.recorded.options import RecordedOptions, check
from eaid.recorded.problem import setup_of
from eaid.recorded.scatter import FEWEST, Scatter
from eaid.recorded.solve import Solved, model_of, solve
from eaid.results.fit import Fit
from eaid.results.friction import Release
from eaid.results.linear import Linear
from eaid.results.recorded import Asked, Falls, Recorded, Response
from eaid.steps.stepset import StepSet

SWITCHES = 50
"""Changes of a two-level input that make a binary sequence of it."""
MANY = 60
"""Levels beyond which inputs count as moving."""
FRICTION_LEVELS = 20
"""Levels that are fitted by themselves, at most."""
TAIL = 0.01
"""Part of the acting time that a moving input may spend below, and above, the identified range."""
LIMITS_PCT = {"Ts": 10.0, "tau1": 30.0, "tau2": 50.0}
"""Half-widths beyond which an input was never asked about."""


@dataclass(frozen=True, eq=False)
class Inputs:
    """What the logs excite."""

    levels: Array
    """Held levels, or the ends of the range where the inputs move."""
    low: float
    high: float
    stepwise: bool


def fit_recorded(
    runs: Sequence[RecordedLog | Run], options: RecordedOptions | None = None, steps: StepSet | None = None
) -> Fit:
    """Fit recorded logs, with or without ordinary steps.

    Parameters
    ----------
    runs : logs as they were recorded; a `Run` has its input counted from `options.rest`.
    options : choices, all with defaults.
    steps : step logs of the same clutch, fitted with the others.

    Returns
    -------
    Fit
        The content of fit.json, with the part `recorded`.

    Raises
    ------
    DataError
        Where no model can be fitted to a log: one sentence for each.
    """
    options = options or RecordedOptions()
    check(options)
    logs = [run if isinstance(run, RecordedLog) else recorded_log(run, options.rest) for run in runs]
    checks.refuse(logs)
    every = [*logs, *(logs_of_steps(steps) if steps is not None else [])]
    inputs = inputs_of(every, options.u_range)
    found = checks.input_findings(logs, inputs.levels, inputs.stepwise)
    rests = any(log.starts_idle or bool((log.input == 0).any()) or log.baseline is not None for log in every)
    if not rests:
        found += [finding("idle-not-seen", log.name) for log in logs]
    spans = [log.dt_s[:-1] for log in every]
    longest, shortest = max(float(one.sum()) for one in spans), float(np.median(np.concatenate(spans)))
    wanted = options.models or ("friction", "nonlinear", "linear")

    setup = setup_of(model.nonlinear(_basis_levels(inputs), options.share, longest), every, rests)

    def solved_for(one: model.Model) -> Solved:
        return solve(replace(setup, model=one))

    base = solve(setup)
    falls: Falls | None = None
    differs: tuple[str, ...] = ()
    if options.falls == "auto":
        outcome = tested(base, inputs.stepwise)
        base, falls, differs = outcome.solved, outcome.falls, outcome.kept
        found += outcome.findings
    loops = [k for k, log in enumerate(logs) if log.reference is not None]
    if options.instrument and loops:
        base = with_instrument(base, logs)
    sure = spread(base) if options.ci != "none" else None
    shown = inputs_shown(_basis_levels(inputs) if inputs.stepwise else (), inputs.low, inputs.high)
    judged, more, bias = judged_loops(base, logs, options)
    found += more
    known = None if sure is None else curves(base, sure, shown)
    if known is not None and bias is not None:
        known = widened(known, bias)
    found += _verdicts(base, known)
    if base.instruments is None:
        found += delay_findings(base, logs, known)
    if sure is not None:
        found += _scatter(sure.scatter)
    linear, friction, by_level = None, None, None
    if "linear" in wanted:
        on = _basis_levels(inputs)
        linear = linear_part(solved_for(model.linear(on, shortest, longest)), base, on)
    if "friction" in wanted and inputs.stepwise and len(inputs.levels) <= FRICTION_LEVELS and options.share is not None:
        by_level = tested_by_level(solved_for(model.friction(inputs.levels, options.share, longest)), differs)
        friction = friction_part(by_level.solved)
        found += by_level.findings if options.falls == "auto" else ()
    return Fit(
        findings=ranked(found),
        seed=options.seed,
        data=data_part(every, runs, steps, inputs.levels if inputs.stepwise else np.zeros(0)),
        converged=base.solver.converged,
        nonlinear=nonlinear_part(base, sure, known, shown) if "nonlinear" in wanted else None,
        linear=linear,
        friction=friction,
        release=_release(base, falls),
        uncertainty=None if sure is None else uncertainty_part(base, sure),
        recorded=Recorded(
            logs=log_parts(base, logs),
            steps=len(every) - len(logs),
            u_range=(inputs.low, inputs.high),
            asked=_asked(known, every),
            falls=falls,
            friction_falls=None if by_level is None else by_level.falls,
            loops=judged,
            responses=_responses(base, linear, logs),
            engagements=0 if sure is None else sure.scatter.count,
            correlation_s=None if sure is None else sure.correlation_s,
        ),
    )


def inputs_of(logs: Sequence[RecordedLog], wanted: tuple[float, float] | None) -> Inputs:
    """Levels and range that the logs excite, or the range that was asked for."""
    levels = levels_of(logs)
    stepwise = all(log.stepwise for log in logs) and len(levels) <= MANY
    if wanted is not None:
        inside = levels[(levels >= wanted[0]) & (levels <= wanted[1])]
        return Inputs(inside if stepwise else np.array(wanted), *wanted, stepwise)
    if stepwise:
        return Inputs(levels, float(levels[0]), float(levels[-1]), True)
    values, weights = [np.concatenate(part) for part in zip(*((log.input, log.dt_s) for log in logs), strict=True)]
    acting = values > 0
    values, weights = values[acting], weights[acting]
    order = np.argsort(values)
    share = np.cumsum(weights[order]) / weights.sum()
    ends = np.minimum(np.searchsorted(share, [TAIL, 1 - TAIL]), len(order) - 1)
    low, high = values[order][ends].tolist()
    return Inputs(np.array([low, high]) if high > low else np.array([low]), low, high, False)


def _basis_levels(inputs: Inputs) -> Array:
    if inputs.stepwise:
        ends = np.array([inputs.low, inputs.high])
        return np.unique(np.concatenate([inputs.levels, ends])) if len(inputs.levels) > 1 else inputs.levels
    return np.linspace(inputs.low, inputs.high, 11) if inputs.high > inputs.low else np.array([inputs.low])


def _release(base: Solved, falls: Falls | None) -> Release | None:
    if falls is None or not falls.release_fitted or falls.release_tau1 is None or falls.release_tau2 is None:
        return None
    share = base.setup.model.share
    return Release(tau1=falls.release_tau1, tau2=falls.release_tau2, C=0.85 if share is None else share)


def _verdicts(base: Solved, known: CurveSpread | None) -> list[Finding]:
    found = []
    if not base.solver.converged:
        found.append(finding("recorded-not-converged", "nonlinear", predicted_decrease=base.solver.predicted_decrease))
    if known is not None:
        for name, half in zip(LIMITS_PCT, known.half_width, strict=True):
            wide = known.duty[~(100 * half <= LIMITS_PCT[name])]
            if len(wide):
                found.append(finding("never-asked", "nonlinear", wide, parameter=name, limit_pct=LIMITS_PCT[name]))
    return found


def _scatter(seen: Scatter) -> list[Finding]:
    """Whether the output differs between engagements, where there are enough to see it."""
    if seen.count < FEWEST:
        return [finding("engagements-few", "data", count=seen.count)]
    if seen.chance < CHANCE and seen.gain > 0:
        return [finding("engagements-scatter", "data", scatter_pct=100 * seen.gain, count=seen.count)]
    return []


def _responses(base: Solved, linear: Linear | None, logs: Sequence[RecordedLog]) -> tuple[Response, ...]:
    """Of logs whose input moves all the time or switches often; a loop's duty answers the output and has none."""
    line = None if linear is None else Eq8(linear.a0, linear.b0, linear.c0)
    found = []
    for log in logs:
        switches = log.stepwise and len(log.changes) >= SWITCHES and len(np.unique(log.input)) <= 3
        if log.reference is not None or (log.stepwise and not switches) or len(log.input) < 4 * LEAST_ROWS:
            continue
        found.append(frequency_response(log, model_of(base), line))
    return tuple(found)


def _asked(known: CurveSpread | None, logs: Sequence[RecordedLog]) -> tuple[Asked, ...]:
    if known is None:
        return ()
    edges = 0.5 * (known.duty[1:] + known.duty[:-1])
    time_s = np.zeros(len(known.duty))
    for log in logs:
        acting = log.input > 0
        np.add.at(time_s, np.searchsorted(edges, log.input[acting]), log.dt_s[acting])
    rows = []
    for i, level in enumerate(known.duty.tolist()):
        widths = [100 * float(h) if np.isfinite(h) and h < 10 else None for h in known.half_width[:, i]]
        rows.append(Asked(level, widths[0], widths[1], widths[2], float(time_s[i])))
    return tuple(rows)
