"""Each change of input by itself, a step from level to level behind the tail of the one before it in its log."""

import math
from collections.abc import Sequence
from dataclasses import replace

import msgspec
import numpy as np

from eaid.options import FitOptions
from eaid.plant.steps import decay, rise
from eaid.results.models import FrictionLevel, LevelIntervals, StepShape
from eaid.shapes.intervals import WIDEST_FACTOR, TailTerms, add_intervals, mean_before
from eaid.shapes.shape import fit_step
from eaid.steps.stepset import StepSet

LEAST_TAIL = 1e-6  # Part of a step's change below which what it has left is nothing
FEW_STEPS = 3  # Steps up to which each is shown by itself, too


def fit_single_steps(stepset: StepSet, options: FitOptions) -> tuple[StepShape, ...]:
    """The shape of each change of input, where some go from level to level, where they are few, or where it is asked.

    Steps from rest are fitted together, as levels, too; these are beside them, with their intervals. Each carries the
    tail of the step before it in its log: what a hold too short has left to go.
    """
    steps = stepset.level_steps
    between = any(0.0 not in (step.from_level, step.level) for step in steps)
    asked = options.shape != "auto" or options.held_dead_time_s is not None
    if not (between or asked or len(steps) <= FEW_STEPS):
        return ()
    found: dict[int, StepShape] = {}
    before: int = -1
    tail: TailTerms = ()
    for k in sorted(range(len(steps)), key=lambda k: (steps[k].source, steps[k].at_s)):
        step, last = steps[k], steps[before]
        lasted, until = step.at_s - last.at_s, float(last.time_s[-1]) * (1 + 2 / len(last.time_s))
        follows = before >= 0 and last.source == step.source and last.level == step.from_level and 0 < lasted <= until
        tail = tail_of(found[before], tail, lasted) if follows else ()
        rest_s, output, start, moved = step.rest_s or 0.0, step.output, step.start, step.rest_moved
        for size, tau, _ in tail:  # as it would have been behind a hold that had settled
            output = output - size * decay(step.time_s, tau)
            start -= size * mean_before(rest_s, tau)
            moved -= abs(size * mean_before(rest_s / 2, tau) * float(rise(np.array(-rest_s / 2), tau)))
        alone = replace(step, output=output, start=start, rest_moved=max(moved, 0.0)) if tail else step
        shape = add_intervals(alone, fit_step(alone, options), options, tail)
        found[k] = msgspec.structs.replace(shape, tail=tuple((size, tau) for size, tau, _ in tail))
        before = k
    return tuple(found[k] for k in range(len(steps)))


def tail_of(shape: StepShape, before: TailTerms, lasted_s: float) -> TailTerms:
    """What a fitted step, and the tail before it, have left to go after a hold."""
    left = [(part, float(decay(np.array(lasted_s), part[1]))) for part in before]
    parts = [(size * of, tau, half * of) for (size, tau, half), of in left]
    if any(one.code == "shape-explains-little" for one in shape.findings):
        return tuple(parts)
    after, ci = max(lasted_s - shape.dead_time_s, 0.0), shape.ci95
    ends = ci.change if shape.change else None
    of_change = 1.0 if ends is None else 0.5 * (ends[1] - ends[0]) / abs(shape.change)
    of_share = 0.5 * (ci.C[1] - ci.C[0]) if ci.C is not None else 0.0
    moved = abs(float(shape.predict(np.array([lasted_s]))[0]) - shape.start)
    for share, tau, ends in ((shape.C, shape.tau1, ci.tau1), (1 - shape.C, shape.tau2, ci.tau2)):
        if tau is not None and share != 0:
            size = -shape.change * share * float(decay(np.array(after), tau))
            of_tau = 0.5 * math.log(ends[1] / ends[0]) if ends is not None else math.log(WIDEST_FACTOR)
            half = abs(size) * math.hypot(of_change, of_share / share, after / tau * of_tau)
            # a part that outlasts the hold is no more known than what the output has done in it
            parts.append((size, tau, half) if tau <= lasted_s else (0.0, tau, moved))
    return tuple(part for part in parts if abs(part[0]) + part[2] > LEAST_TAIL * abs(shape.change))


def fit_another_shape(stepset: StepSet, options: FitOptions) -> tuple[StepShape, ...]:
    """The first rise to each level that asks for another shape than the paper's, with intervals, where most do."""
    first_rises = {step.level: step for step in reversed(stepset.level_steps) if step.edge == "up"}
    asking: list[StepShape] = []
    for k, step in enumerate(first_rises[level] for level in sorted(first_rises)):
        shape = fit_step(step, options)
        if any(found.code == "other-shape-fits-better" for found in shape.findings):
            asking.append(add_intervals(step, shape, options))
        elif 2 * (k + 1 - len(asking)) >= len(first_rises):  # it can be most of them no more
            return ()
    return tuple(asking)


def between_rows(shapes: Sequence[StepShape]) -> tuple[FrictionLevel, ...]:
    """Those that neither begin nor end at rest as rows of the friction model; a single constant stands there twice."""
    return tuple(
        FrictionLevel(
            one.level, one.change, one.tau1, one.tau1 if one.tau2 is None else one.tau2, one.C,
            from_=one.from_, start=one.start, shape=one.shape, delay_s=one.dead_time_s,
            rmse=one.rmse, samples=one.samples, fit_pct=one.fit_pct, R2=one.R2,
            ci95=LevelIntervals(Ts=one.ci95.change, tau1=one.ci95.tau1, tau2=one.ci95.tau2, C=one.ci95.C),
        )
        for one in shapes if one.from_ != 0 and one.level != 0
    )  # fmt: skip
