"""Recorded logs → a fit: the one entry of this package.

The nonlinear model first, then whether falls differ from rises, then the linear model and the levels by themselves;
intervals from the residuals as they are; what the inputs never asked about is said. Logs of ordinary steps are fitted
with them as their mean curves, each sample of each repeat alike.
"""

from collections.abc import Sequence
from dataclasses import replace

import msgspec
import numpy as np

from eaid.errors import UsageError
from eaid.findings import finding, ranked
from eaid.logs.run import Run
from eaid.models.parameters import Linear as Eq8
from eaid.recorded import checks, model
from eaid.recorded.as_results import (
    data_part,
    friction_part,
    linear_part,
    nonlinear_part,
    release_part,
    uncertainty_part,
)
from eaid.recorded.closed_loop import judged_loops
from eaid.recorded.curve_intervals import asked, curves, never_asked, widened
from eaid.recorded.falls import tested, tested_by_level
from eaid.recorded.frequency import responses
from eaid.recorded.inputs import inputs_of
from eaid.recorded.instrument import with_instrument
from eaid.recorded.intervals import spread
from eaid.recorded.late import delay_findings
from eaid.recorded.log import RecordedLog, logs_of_steps, recorded_log
from eaid.recorded.log_results import log_parts
from eaid.recorded.options import RecordedOptions, check
from eaid.recorded.problem import setup_of
from eaid.recorded.scatter import scatter_findings
from eaid.recorded.solve import model_of, solve
from eaid.results.fit import Fit, FitOptions
from eaid.results.recorded import Recorded
from eaid.steps.stepset import StepSet
from eaid.uncertainty import workflow

FRICTION_LEVELS = 20
"""Levels that are fitted by themselves, at most."""


def fit_whole(
    stepset: StepSet, options: FitOptions, duty: tuple[float, float] | None = None, instrument: bool = False
) -> Fit:
    """Fit the recorded logs of a set with its steps, with the options of step fits.

    Raises
    ------
    UsageError
        Options that only steps have: a loss, held-out levels.
    DataError
        A log that no model can be fitted to.
    """
    if options.loss != "squares":
        raise UsageError(f"«loss» {options.loss}: logs fitted as recorded take squares; or say «logs_as» steps")
    if options.hold_out:
        raise UsageError("«hold_out»: logs fitted as recorded hold no single levels; or say «logs_as» steps")
    how = RecordedOptions(
        models=options.models,
        share=options.held_share,
        u_range=duty,
        rest=float(stepset.reading.get("rest", 0.0)),
        instrument=instrument,
        ci="none" if options.ci == "none" else "robust",
        seed=options.seed,
    )
    fit = fit_recorded(stepset.recorded, how, stepset if stepset.levels else None)
    shapes = workflow.shapes_of(stepset, options)
    doubts = tuple(doubt for shape in shapes for doubt in shape.findings)
    return msgspec.structs.replace(
        fit, options=workflow.asked(options, stepset), steps=shapes, findings=ranked((*fit.findings, *doubts))
    )


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

    setup = setup_of(model.nonlinear(inputs.basis, options.share, longest), every, rests)
    base = solve(setup)
    falls = tested(base, inputs.stepwise) if options.falls == "auto" else None
    if falls is not None:
        base = falls.solved
        found += falls.findings
    if options.instrument and any(log.reference is not None for log in logs):
        base = with_instrument(base, logs)
    if not base.solver.converged:
        found.append(finding("recorded-not-converged", "nonlinear", predicted_decrease=base.solver.predicted_decrease))
    loops, of_loops, bias = judged_loops(base, logs, options)
    found += of_loops
    uncertainty, known = None, None
    if options.ci != "none":
        uncertainty = spread(base)
        known = curves(base, uncertainty, inputs.shown)
        known = known if bias is None else widened(known, bias)
        found += never_asked(known) + scatter_findings(uncertainty.scatter)
    if base.instruments is None:
        found += delay_findings(base, logs, known)
    linear, friction, by_level, line = None, None, None, None
    if "linear" in wanted:
        solved = solve(replace(setup, model=model.linear(inputs.basis, shortest, longest)))
        linear = linear_part(solved, base, inputs.basis)
        line = Eq8(linear.a0, linear.b0, linear.c0)
    if "friction" in wanted and inputs.stepwise and len(inputs.levels) <= FRICTION_LEVELS and options.share is not None:
        solved = solve(replace(setup, model=model.friction(inputs.levels, options.share, longest)))
        by_level = tested_by_level(solved, () if falls is None else falls.kept)
        friction = friction_part(by_level.solved)
        found += by_level.findings if falls is not None else ()
    return Fit(
        findings=ranked(found),
        seed=options.seed,
        data=data_part(every, runs, steps, inputs.levels if inputs.stepwise else np.zeros(0)),
        converged=base.solver.converged,
        nonlinear=nonlinear_part(base, uncertainty, known, inputs.shown) if "nonlinear" in wanted else None,
        linear=linear,
        friction=friction,
        release=None if falls is None else release_part(base, falls.falls),
        uncertainty=None if uncertainty is None else uncertainty_part(base, uncertainty),
        recorded=Recorded(
            logs=log_parts(base, logs),
            steps=len(every) - len(logs),
            u_range=(inputs.low, inputs.high),
            asked=() if known is None else asked(known, every),
            falls=None if falls is None else falls.falls,
            friction_falls=None if by_level is None else by_level.falls,
            loops=loops,
            responses=responses(logs, model_of(base), line),
            engagements=0 if uncertainty is None else uncertainty.scatter.count,
            correlation_s=None if uncertainty is None else uncertainty.correlation_s,
        ),
    )
