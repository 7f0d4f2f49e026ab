"""A log → its steps: where the input leaves one plateau for the next, where a position turns, or where the user says.

Every step is a run of its own; a dataset of cut runs holds each sample once. `level` is where a rising step goes and
`from_level` where it comes from; a falling one comes from `level` and goes to `from_level`; 0 is rest.
"""

from dataclasses import replace

import numpy as np

from eaid.arrays import median
from eaid.errors import DataError
from eaid.findings import finding
from eaid.logs.run import Run
from eaid.steps.baseline import BaselineRule, first_samples
from eaid.steps.by_input import cut_by_input
from eaid.steps.by_instant import cut_at, cut_by_output
from eaid.steps.noise import sample_noise
from eaid.steps.plateaus import FEWEST
from eaid.steps.reversals import cut_reversals
from eaid.steps.step import sample_at

WANDERS = 0.15
"""Range of a measured input, as a share of its median, up to which it is one load that wanders."""
AUTO = BaselineRule()


def cut(run: Run, rule: BaselineRule = AUTO) -> list[Run]:
    """The steps of a log, in the order of time, each with level, step instant, baseline and edge found.

    Raises DataError where the log has no step, or a level that cannot be told.
    """
    count = len(run.time_s)
    if count < FEWEST:
        raise DataError(f"{run.where}: holds {count} samples, and a step takes at least {FEWEST}; record it longer")
    if run.cut and run.step_s is not None:
        return [_ruled(run, rule)]
    if run.output.min() == run.output.max():
        raise DataError(
            f"{run.where}: the output never changes ({run.output[0]:g} {run.output_unit} throughout); check the sensor"
        )
    moves = run.has_input and not _constant(run)
    if run.has_input and run.input_unit == "%":
        _check_percent(run)
    if run.step_s is not None:
        steps = cut_at(run, run.step_s)
    elif run.position is not None:
        steps = cut_reversals(_up_to(run))
    elif moves:
        steps = cut_by_input(_up_to(run))
    else:
        steps = cut_by_output(_up_to(run) if run.has_input else run)
    return _with_baselines(steps, rule)


def _constant(run: Run) -> bool:
    """True for an input that is held throughout: exactly, or as a measured one whose load wanders a little."""
    span = float(np.ptp(run.input))
    if span == 0:
        return True
    measured = run.input_unit != "%" and sample_noise(run.input) > 0
    return measured and span < WANDERS * abs(median(run.input))


def _up_to(run: Run) -> Run:
    """The log up to the end of the window that the user gives; the whole of it where none is given."""
    if run.until_s is None:
        return run
    stop = sample_at(run, run.until_s)
    if stop < FEWEST:
        raise DataError(f"{run.where}: the window ends at {run.until_s:g} s, before the log has begun; mend «until»")
    return run.part(slice(stop), until_s=None)


def _check_percent(run: Run) -> None:
    for wrong, how in ((run.input > 100 + 1e-9, "above 100"), (run.input < -1e-9, "below 0")):
        if wrong.any():
            first = int(wrong.argmax())
            raise DataError(
                f"{run.where}: the input is {run.input[first]:g} % at {run.time_s[first]:.6g} s, {how}; "
                f"if it is not in %, say its unit with «units» input=UNIT"
            )


def _with_baselines(steps: list[Run], rule: BaselineRule) -> list[Run]:
    """The steps with their baselines: as the user asks, else as found or stored, else the first samples.

    A release to rest has that of its own rise.
    """
    finished: list[Run] = []
    idle: float | None = None
    for step in steps:
        if step.baseline is None and finished:  # a release behind the window of its step
            step = replace(step, baseline=finished[0].baseline)
        elif step.baseline is None:
            start = first_samples(step.output[sample_at(step, step.step_s or 0.0) :])
            known = any(said.code == "step-at-first-sample" for said in step.findings)
            doubt = () if known else (finding("no-rest-before-step", step.name, start=start, unit=step.output_unit),)
            step = replace(step, baseline=start, findings=(*step.findings, *doubt))
        if step.edge == "falling" and step.from_level == 0.0 and idle is not None:
            step = replace(step, baseline=idle)
        else:
            step = _ruled(step, rule)
        if step.edge == "rising" and step.from_level == 0.0:
            idle = step.baseline
        finished.append(step)
    return finished


def _ruled(step: Run, rule: BaselineRule) -> Run:
    """A step with the baseline that the user asks for."""
    if rule.how == "value":
        return replace(step, baseline=rule.value)
    if rule.how == "auto" or (step.edge == "falling" and step.from_level == 0.0):
        return step  # a release is counted from the idle output before its own rise
    at = step.step_s or 0.0
    if rule.how == "first":
        return replace(step, baseline=first_samples(step.output[sample_at(step, at) :]))
    low, high = rule.window_s
    inside = (step.time_s >= at + low) & (step.time_s <= at + high)
    if not inside.any():
        raise DataError(
            f"{step.where}: «baseline» {low:g}:{high:g} holds no sample of {step.name}, which runs from "
            f"{step.time_s[0] - at:.4g} to {step.time_s[-1] - at:.4g} s relative to its step"
        )
    return replace(step, baseline=float(step.output[inside].mean()))
