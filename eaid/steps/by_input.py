"""A log with a moving input → its steps: where the input leaves one plateau for the next.

t = 0 of a step is the first sample at which the input is at its new level, so a ramp between two plateaus belongs to
neither. The steps of a log share no sample.
"""

import itertools
from dataclasses import replace

from eaid.errors import DataError
from eaid.findings import finding
from eaid.logs.run import Run
from eaid.steps.baseline import last_rest
from eaid.steps.not_steps import looks_like, refuse_to_cut
from eaid.steps.plateaus import Plateau, bridge, end_of, plateaus, sample_s, stands_still, zero_of

UNSETTLED = 0.05
"""Share of a step's change by which the output may still move before a step from level to level."""
NO_STEP = "record the idle time before the step too, or give the step instant with «step_at»"


def cut_by_input(run: Run) -> list[Run]:
    """Steps where the input goes from one plateau to another; towards zero is a falling edge."""
    holds, bridged = bridge(plateaus(run.input))
    if not stands_still(holds, run.input) or looks_like(run) is not None:
        raise refuse_to_cut(run)
    if len(holds) < 2:
        raise DataError(f"{run.where}: the input stays at {holds[0].level:g} {run.input_unit}: no step; {NO_STEP}")
    zero = zero_of(run)
    first = (*run.findings, finding("input-glitch", run.name, samples=bridged)) if bridged else run.findings
    steps: list[Run] = []
    idle: float | None = run.baseline
    end = 0
    for before, now in itertools.pairwise(holds):
        step = edge_between(replace(run, findings=() if steps else first), before, now, zero, idle)
        if run.baseline is not None:
            step = replace(step, baseline=run.baseline)
        elif abs(before.level) <= zero:
            idle = step.baseline
        count = 1 + sum(one.edge == step.edge for one in steps)
        name = run.name + ("-release" if step.edge == "falling" else "") + (f"-{count}" if count > 1 else "")
        # the ramp between two plateaus goes with the step that it leads to
        samples, end = slice(end, now.stop), now.stop
        at = float(run.time_s[now.start])
        steps.append(step.part(samples, name=name, step_s=at, until_s=None, cut=True))
    return steps


def edge_between(run: Run, before: Plateau, now: Plateau, zero: float, fallback: float | None) -> Run:
    """A log with what its step between two plateaus is: edge, levels, baseline, output before it, findings.

    `fallback` is the rest before the step that led to the first plateau.
    """
    down = abs(now.level) < abs(before.level) and now.level * before.level >= -zero * zero
    level, other = (before.level, now.level) if down else (now.level, before.level)
    from_rest = abs(before.level) <= zero
    change = end_of(run.output, now) - end_of(run.output, before)
    # behind a hold, only its last quarter is taken
    first = before.start == 0
    hold = run.output[before.start if first else before.stop - before.count // 4 - 1 : before.stop]
    rest = last_rest(hold, change)
    findings, rests = rest.findings(run.name), rest.count
    if from_rest:
        # a rest that still moves after an earlier step is no rest of its own: counted from the one before
        baseline = rest.value if rest.rests or first or fallback is None else fallback
    elif down and abs(now.level) <= zero:
        released = last_rest(run.output[now.stop - now.count // 4 - 1 : now.stop], 0.0)
        baseline = released.value if fallback is None else fallback
        rests = max(1, before.count // 20)  # the output held before it is its start
    else:
        baseline = rest.value
        off = 0.0 if rest.rests else abs(rest.start - float(hold[: max(1, len(hold) // 4)].mean()))
        # what leaves its rest before the step, by more than its noise, is an input logged late
        if off > UNSETTLED * abs(change) or (rest.lead and off > 0):
            share = 100 * off / max(abs(change), 1e-3 * off)
            findings += (finding("unsettled-before-step", run.name, (before.level, now.level), share_pct=share),)
    return replace(
        run,
        level=level,
        from_level=0.0 if abs(other) <= zero else other,
        edge="falling" if down else "rising",
        held=rest.start if from_rest else end_of(run.output, before),
        baseline=baseline,
        rest_s=rests * sample_s(run),
        rest_moved=rest.moved,
        findings=(*run.findings, *findings),
    )
