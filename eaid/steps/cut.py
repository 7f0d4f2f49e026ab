"""A log → its steps: where the input leaves one plateau for the next, where a position turns, or where the user says.

Every step is a run of its own; a dataset of cut runs holds each sample once. `level` is where a rising step goes and
`from_level` where it comes from; a falling one comes from `level` and goes to `from_level`; 0 is rest.
"""

import itertools
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from eaid.arrays import median, read_only
from eaid.errors import DataError
from eaid.findings import Finding, finding, say, stops
from eaid.logs.columns import MOTION, SWITCHES
from eaid.logs.run import Run, numbered
from eaid.logs.units import split_name, words_of
from eaid.options import ReadOptions
from eaid.steps.baseline import baseline_rule, first_samples, last_rest
from eaid.steps.checks import several_edges
from eaid.steps.noise import STANDARD_ERRORS, block_means, block_noise, sample_noise
from eaid.steps.onset import onset
from eaid.steps.plateaus import (
    BACK,
    FEWEST_HELD,
    Plateau,
    end_of,
    is_measured,
    plateaus,
    stands_still,
    tolerance,
    turns,
    zero_of,
)
from eaid.steps.step import Cut, sample_at
from eaid.steps.stepset import LevelStep

UNSETTLED = 0.05  # Share of a step's change by which the output may still move before a step from level to level
COUNTS = (255, 1023, 4095, 65535)  # The largest number of so many bits, which stands for the whole input
NO_STEP = "record the idle time before the step too, or give the step instant with «step_at»"
NEAR_EDGE = 0.1  # Share of a log within which its output answers to what switches it
WITH = 0.01  # Share of a log within which another channel moves with the step
CUT_BLOCKS = 4000  # Means of a position, between which its turns are looked for
BEGINS_AT = 0.1  # Share of its change by which an output may lie off its rest where a log begins with its step
AT_ONCE = 0.2  # Share of the time to its rise that an output under a constant input may rest, which is a dead time
SLOWS = 0.8  # Share of its usual speed below which a stroke slows down
WANDERS = 0.15  # Range of a measured input, as a share of its median, up to which it is one load that wanders
# Steps up to which a log that is fitted as it was recorded has each step fitted by itself, too, and changes of input up
# to which these are looked for
MOST_SETTLED, MOST_CHANGES = 60, 1000


def cut_by_input(run: Run) -> list[Run]:
    """Steps where the input goes from one plateau to another; towards zero is a falling edge."""
    holds = plateaus(run.input)
    if not stands_still(holds, run.input):
        raise DataError(f"{run.where}: {say(finding('input-moves', run.name))}")
    if len(holds) < 2:
        raise DataError(f"{run.where}: the input stays at {holds[0].level:g} {run.input_unit}: no step; {NO_STEP}")
    zero = zero_of(run)
    if begins_with_step(run, holds, zero):
        note = finding("step-at-first-sample", run.name, start=first_samples(run.output), unit=run.output_unit)
        return cut_at(replace(run, findings=(*run.findings, note)), float(run.time_s[0]))
    first = (*run.findings, *active_low(run, holds))
    steps: list[Run] = []
    idle: float | None = None
    end = 0
    for before, now in itertools.pairwise(holds):
        step = edge_between(replace(run, findings=() if steps else first), before, now, zero, idle)
        if abs(before.level) <= zero:
            idle = step.baseline
        count = 1 + sum(one.edge == step.edge for one in steps)
        name = run.name + ("-release" if step.edge == "falling" else "") + (f"-{count}" if count > 1 else "")
        # the ramp between two plateaus goes with the step that it leads to
        samples, end = slice(end, now.stop), now.stop
        at = float(run.time_s[now.start])
        steps.append(step.part(samples, name=name, step_s=at, until_s=None, cut=True))
    return steps


def begins_with_step(run: Run, holds: Sequence[Plateau], zero: float) -> bool:
    """Whether a log begins as its input comes, and ends released: its output rises from near where that ends."""
    if len(holds) != 2 or abs(holds[0].level) <= zero or abs(holds[1].level) > zero:
        return False
    start, held, left = first_samples(run.output), *(end_of(run.output, hold) for hold in holds)
    rises = onset(run.time_s[: holds[0].stop], run.output[: holds[0].stop]) is not None
    return rises and abs(start - left) < BEGINS_AT * abs(held - left)


def active_low(run: Run, holds: Sequence[Plateau]) -> tuple[Finding, ...]:
    """What is told of a log whose input only falls from where it begins, while the size of its output rises."""
    holds = [hold for hold in holds if hold.count >= FEWEST_HELD]
    if len(holds) < 2 or any(abs(hold.level) >= 0.99 * abs(holds[0].level) for hold in holds[1:]):
        return ()
    before, after = (abs(median(run.output[hold.start : hold.stop])) for hold in (holds[0], holds[1]))
    if after <= 2 * before + STANDARD_ERRORS * sample_noise(run.output):
        return ()
    return (finding("input-may-be-active-low", run.name, (holds[0].level,), unit=run.input_unit),)


def edge_between(run: Run, before: Plateau, now: Plateau, zero: float, idle: float | None = None) -> Run:
    """A log with what its step between two plateaus is; `idle`: rest before the step that led to the first of them."""
    down = abs(now.level) < abs(before.level) and now.level * before.level >= -zero * zero
    level, other = (before.level, now.level) if down else (now.level, before.level)
    from_rest = abs(before.level) <= zero
    change = end_of(run.output, now) - end_of(run.output, before)
    # behind a hold, only its last quarter is taken
    first = before.start == 0
    hold = run.output[before.start if first else before.stop - before.count // 4 - 1 : before.stop]
    rest = last_rest(hold, change)
    findings, rests = list(run.findings), rest.count
    if rest.left_out:
        findings.append(finding("spikes-before-step", run.name, samples=rest.left_out))
    if from_rest:
        # a rest that still moves after an earlier step is no rest of its own: counted from the one before
        baseline = rest.value if rest.rests or first or idle is None else idle
    elif down and abs(now.level) <= zero:
        baseline = last_rest(run.output[now.stop - now.count // 4 - 1 : now.stop], 0.0).value
        rests = max(1, before.count // 20)  # the output held before it is its start
    else:
        baseline = rest.value
        off = 0.0 if rest.rests else abs(rest.start - float(hold[: max(1, len(hold) // 4)].mean()))
        # what leaves its rest before the step, by more than its noise, is an input logged late
        if off > UNSETTLED * abs(change) or (rest.lead and off > 0):
            share = 100 * off / max(abs(change), 1e-3 * off)
            findings.append(finding("unsettled-before-step", run.name, (before.level, now.level), share_pct=share))
    return replace(
        run, level=level, from_level=0.0 if abs(other) <= zero else other, edge="falling" if down else "rising",
        held=rest.start if from_rest else end_of(run.output, before),
        baseline=baseline if run.baseline is None else run.baseline, rest_moved=rest.moved, findings=tuple(findings),
        rest_s=rests * (float(run.time_s[-1] - run.time_s[0]) / (len(run.time_s) - 1)),
    )  # fmt: skip


def no_level(run: Run) -> DataError:
    """Why a log without input and level is refused."""
    return DataError(f"{run.where}: nothing tells its level; give the input column, or «name_pattern» with {{level}}")


def cut_at(run: Run, at_s: float) -> list[Run]:
    """The step at an instant that the user, the dataset or the output gives, and the release behind its window."""
    until, level = _window(run, at_s)
    start = sample_at(run, at_s)
    now, zero, known = Plateau(start, until, level), zero_of(run), run.has_input
    if known and level == 0 and float(np.ptp(run.input)) > 0:
        raise DataError(
            f"{run.where}: its input is at rest from {at_s:g} s on, where its step was said to be; leave it out, or "
            "fit it apart, and say «step_at» for the logs without an input"
        )
    earlier = [p for p in plateaus(run.input[:start]) if p.count >= FEWEST_HELD] if known and start else []
    if start:
        loaded = bool(earlier) and abs(earlier[-1].level) > zero
        step = edge_between(run, earlier[-1] if loaded else Plateau(0, start, 0.0), now, zero)
    else:
        first, warning = first_samples(run.output[:until]), tuple[Finding, ...]()
        if run.baseline is None and all(one.code != "step-at-first-sample" for one in run.findings):
            warning = (finding("no-rest-before-step", run.name, start=first, unit=run.output_unit),)
        baseline = first if run.baseline is None else run.baseline
        step = replace(run, level=level, baseline=baseline, findings=(*run.findings, *warning))
    steps = [step.part(slice(until), step_s=float(run.time_s[start]), until_s=None, cut=True)]
    left = float(median(run.input[until:])) if known and until < len(run.time_s) else 0.0
    falls = abs(left) < abs(level) if known else run.until_s is not None and _comes_back(run, now)
    if len(run.time_s) - until >= FEWEST_HELD and step.edge == "rising" and falls:
        release = replace(run, level=level, edge="falling", findings=(), baseline=step.baseline)
        steps.append(
            release.part(
                slice(until, None), name=f"{run.name}-release", step_s=float(run.time_s[until]), until_s=None, cut=True,
                from_level=left if abs(left) > zero else 0.0, held=end_of(run.output, now),
            )
        )  # fmt: skip
    return steps


def _window(run: Run, step: float) -> tuple[int, float]:
    """First sample behind the window of a step at an instant, and its level."""
    time, close = run.time_s, 1e-9 * max(1.0, abs(step))
    if not time[0] - close <= step <= time[-1]:
        raise DataError(
            f"{run.where}: the step at {step:g} s lies outside the log ({time[0]:.6g} to {time[-1]:.6g} s); "
            "mend «step_at»"
        )
    if run.until_s is not None and run.until_s <= step:
        raise DataError(f"{run.where}: the window ends ({run.until_s:g} s) before it begins ({step:g} s); mend «until»")
    start = sample_at(run, step)
    until = len(time) if run.until_s is None else sample_at(run, run.until_s)
    if until <= start:
        ends = f"the end of what is taken of it, {time[max(until - 1, 0)]:g} s"
        raise DataError(
            f"{run.where}: no sample lies between its step at {step:g} s and {ends}; say the unit of the time with "
            "«units», as in time=us, or a later «until»"
        )
    level = run.level
    if run.has_input:
        window = run.input[start:until]
        if level is None:
            holds = [plateau for plateau in plateaus(window) if plateau.count >= FEWEST_HELD]
            level = holds[0].level if holds else median(window)
        near = np.abs(window - level) <= max(tolerance(run.input), 0.01 * abs(level))
        if near.any():  # the window ends where the input leaves its level, once it has reached it
            reached = int(near.argmax())
            left = np.flatnonzero(~near[reached:])
            until = start + reached + int(left[0]) if len(left) else until
    if level is None:
        raise no_level(run)
    return until, level


def _comes_back(run: Run, now: Plateau) -> bool:
    """Whether the output comes back, by a hundredth of its rise or more, behind a window that only the user ended."""
    idle = median(run.output[: now.start]) if now.start else 0.0
    rise = end_of(run.output, now) - idle
    left = median(run.output[now.stop :]) - idle
    return bool(left * np.sign(rise) < 0.99 * abs(rise))


def cut_by_output(run: Run) -> list[Run]:
    """The step of a log without a moving input: where the output leaves its idle value for good."""
    constant = median(run.input) if run.has_input else None
    level = constant if run.level is None else run.level
    rig = run.kind in ("friction-force", "friction-speed")  # its input is held while something else makes it slip
    rows = slice(None) if run.until_s is None else slice(sample_at(run, run.until_s))
    begins = onset(run.time_s[rows], run.output[rows])
    at = None if begins is None else begins.row
    if constant is not None and not rig:
        from_start = begins is not None and level and run.time_s[begins.row] - run.time_s[0] <= AT_ONCE * begins.high_s
        at = 0 if from_start else None
    if constant is not None and at is None and not rig:
        remedy = NO_STEP if constant else "nothing was switched on; give logs in which the input steps"
        raise DataError(f"{run.where}: the input stays at {constant:g} {run.input_unit}: no step; {remedy}")
    switched = [(at_s, column) for column, at_s in run.moves if _switches(column)]
    span = float(run.time_s[-1] - run.time_s[0])
    switched = [one for one in switched if at is None or abs(one[0] - run.time_s[at]) <= NEAR_EDGE * span]
    if switched and level is not None:
        at_s, column = min(switched)
        note = finding("step-from-command", run.name, step_s=at_s, column=column)
        return cut_at(replace(run, level=level, findings=(*run.findings, note)), at_s)
    if level is None or begins is None or at is None:
        odd = several_edges(run.name, run.time_s, run.output)
        if odd is not None:
            raise DataError(f"{run.where}: {say(odd)}")
        if level is None:
            raise no_level(run)
        raise DataError(f"{run.where}: no step stands out of the output's noise; give its instant with «step_at»")
    if at == 0:
        note = finding("step-at-first-sample", run.name, start=first_samples(run.output), unit=run.output_unit)
    else:
        note = finding("step-from-output", run.name, step_s=float(run.time_s[at]), error_s=begins.error_s)
    return cut_at(replace(run, level=level, findings=(*run.findings, note)), float(run.time_s[at]))


def moved_with(run: Run, step_s: float) -> list[Finding]:
    """The channels, besides what switches the input on, that leave their rest as the step comes."""
    near = WITH * float(run.time_s[-1] - run.time_s[0])
    others = [column for column, at_s in run.moves if abs(at_s - step_s) <= near]
    own = [column for column in others if not _switches(column)]
    return [finding("moves-with-step", run.name, column=column) for column in own[:1]]


def _switches(column: str) -> bool:
    """Whether a column switches the input on, and does not move the stand, by its name without its unit."""
    words = words_of(split_name(column)[0])
    return bool(words & SWITCHES) and not words & MOTION


def cut_reversals(run: Run) -> list[Run]:
    """The strokes of a log with a position, each from its turn to the next; its level is the input's."""
    assert run.position is not None
    means = block_means(run.position, CUT_BLOCKS)
    span, width = float(np.ptp(means)), len(run.position) / len(means)
    at: list[int] = []  # the extremes between which it goes by `BACK` of its range; none of mere noise
    for before, k in itertools.pairwise(turns(means, BACK * span)[:-1] if span > 20 * block_noise(means) else []):
        if abs(means[k] - means[before]) >= BACK * span:  # else noise at the very start
            low = int(max(0, (k - 1) * width))
            near = run.position[low : int((k + 2) * width) + 1]
            at.append(low + int(near.argmax() if means[k] > means[before] else near.argmin()))
    if not at:
        raise DataError(f"{run.where}: its position never turns; leave «columns» position out")
    known = bool(np.isfinite(run.input).all())
    if run.level is None and not known:
        raise no_level(run)
    strokes = []
    for a, b in itertools.pairwise([*at, len(run.time_s)]):
        lag = max(1, (b - a) // 40)
        speed = np.abs(run.position[a + lag : b] - run.position[a : b - lag])
        if len(speed):  # until it slows down for the next turn, for the friction then changes with the speed
            b = a + lag + int(np.flatnonzero(speed >= SLOWS * median(speed))[-1])
        strokes += [(a, b)] if b - a >= FEWEST_HELD else []
    steps = []
    for k, (start, stop) in enumerate(strokes):
        way = 1.0 if float(run.position[stop - 1]) > float(run.position[start]) else -1.0
        level = abs(median(run.input[start:stop])) if run.level is None else run.level
        stroke = run.part(
            slice(start, stop), name=f"{run.name}-{k + 1}", step_s=float(run.time_s[start]), until_s=None, cut=True,
            level=way * level, baseline=first_samples(run.output[start:stop]), repeat=None,
        )  # fmt: skip
        steps.append(replace(stroke, input=np.abs(stroke.input) * way if known else stroke.input))
    note = finding("cut-at-reversals", run.name, reversals=len(steps))
    return [replace(steps[0], findings=(*run.findings, note)), *(replace(one, findings=()) for one in steps[1:])]


def refuse_percent(run: Run, *wrong: tuple[NDArray[np.bool_], str]) -> None:
    """Refuse an input in % in rows where it is none."""
    for rows, how in wrong if run.input_unit == "%" else ():
        if rows.any():
            first, top = int(rows.argmax()), float(np.abs(run.input).max())
            counts = next((most for most in COUNTS if top <= most), COUNTS[0])
            raise DataError(
                f"{run.where}: the input is {run.input[first]:g} % at {run.time_s[first]:.6g} s, {how}; "
                f"if it is not in %, say its unit with «units» input=UNIT, or input=/{counts} of counts up to {counts}"
            )


def cut(run: Run, baseline: str = "auto", rest: float = 0.0) -> list[Run]:
    """The steps of a log, in the order of time; levels are counted from `rest`, the input at rest.

    Raises DataError where the log has no step, or a level that cannot be told.
    """
    count = len(run.time_s)
    if count < FEWEST_HELD:
        raise DataError(
            f"{run.where}: holds {count} samples, and a step takes at least {FEWEST_HELD}; record it longer"
        )
    if run.cut and run.step_s is not None:
        return [_ruled(run, baseline)]
    if run.output.min() == run.output.max():
        raise DataError(
            f"{run.where}: the output never changes ({run.output[0]:g} {run.output_unit} throughout); check the sensor"
        )
    moves = False
    if run.has_input:
        if not is_measured(run):
            refuse_percent(run, (run.input > 100 + 1e-9, "above 100"), (run.input < -1e-9, "below 0"))
        if rest != 0.0 and not run.cut:
            run = replace(run, input=read_only(run.input - rest))
        # a commanded input is held exactly; a measured one may wander a little
        wanders = is_measured(run) and sample_noise(run.input) > 0
        moves = float(np.ptp(run.input)) > 0 and not (
            wanders and float(np.ptp(run.input)) < WANDERS * abs(median(run.input))
        )
    if run.step_s is not None:
        steps = cut_at(run, run.step_s)
    elif run.position is not None:
        steps = cut_reversals(_up_to(run))
    elif moves:
        steps = cut_by_input(_up_to(run))
    else:
        steps = cut_by_output(_up_to(run) if run.has_input else run)
    if not run.has_input and steps[0].step_s is not None:
        steps[0] = replace(steps[0], findings=(*steps[0].findings, *moved_with(run, steps[0].step_s)))
    steps, idle = [_ruled(step, baseline) for step in steps], None
    for k, step in enumerate(steps):
        if step.from_level == 0.0 and step.edge == "rising":
            idle = step.baseline
        elif step.from_level == 0.0 and idle is not None:  # a fall to rest has the baseline of its rise
            steps[k] = replace(step, baseline=idle)
    return steps


def _up_to(run: Run) -> Run:
    """The log up to the end of the window that the user gives; the whole of it where none is given."""
    if run.until_s is None:
        return run
    stop = sample_at(run, run.until_s)
    if stop < FEWEST_HELD:
        raise DataError(f"{run.where}: the window ends at {run.until_s:g} s, before the log has begun; mend «until»")
    return run.part(slice(stop), until_s=None)


def _ruled(step: Run, baseline: str) -> Run:
    """A step with the baseline that the user asks for; a release counts from the idle output before its own rise."""
    how, low, high = baseline_rule(baseline)
    if how == "value":
        return replace(step, baseline=low)
    if how == "auto" or (step.edge == "falling" and step.from_level == 0.0):
        return step
    at = step.step_s or 0.0
    if how == "first":
        return replace(step, baseline=first_samples(step.output[sample_at(step, at) :]))
    inside = (step.time_s >= at + low) & (step.time_s <= at + high)
    if not inside.any():
        raise DataError(
            f"{step.where}: «baseline» {low:g}:{high:g} holds no sample of {step.name}, which runs from "
            f"{step.time_s[0] - at:.4g} to {step.time_s[-1] - at:.4g} s relative to its step"
        )
    return replace(step, baseline=float(step.output[inside].mean()))


def cut_runs(runs: Sequence[Run], options: ReadOptions) -> tuple[list[Run], list[str]]:
    """The steps of all logs, repeats counted, and the faults of those that have none."""
    steps: list[Run] = []
    faults: list[str] = []
    for run in runs:
        try:
            of_log = cut(run, options.baseline, options.rest)
        except DataError as fault:
            faults.extend(fault.sentences)
            continue
        good = [step for step in of_log if _samples(step) >= FEWEST_HELD]
        short = [step for step in of_log if _samples(step) < FEWEST_HELD]
        alone = [step for step in short if run.cut or step.edge == "rising"]
        if alone and (run.cut or not any(step.edge == "rising" for step in good)):
            few = f"{_samples(alone[0])} samples in its window, at least {FEWEST_HELD} are needed"
            faults.append(f"{run.where}: {few}; record it longer")
        elif short and good:  # a short one beside good ones is left out and told
            note = finding("short-pieces", good[0].name, pieces=len(short), fewest=FEWEST_HELD)
            good[0] = replace(good[0], findings=(*good[0].findings, note))
        steps += good
    return _number_repeats(steps), faults


def settled_steps(runs: Sequence[Run], options: ReadOptions) -> tuple[LevelStep, ...]:
    """The changes of input between settled holds in logs that are not cut otherwise; none of a log without steps."""
    if sum(len(plateaus(run.input)) for run in runs) > MOST_CHANGES:
        return ()
    settled = [step for step in cut_runs(runs, options)[0] if not stops(step.findings)]
    return level_steps(settled, {}) if len(settled) <= MOST_SETTLED else ()


def _samples(run: Run) -> int:
    """Samples in the active window of a cut run: from its step to its end."""
    return len(run.time_s) - Cut(run).start


def _number_repeats(steps: list[Run]) -> list[Run]:
    """Every step with a repeat number of its own level and edge, in the order given."""
    used: defaultdict[tuple[str, float, float], set[int]] = defaultdict(set)
    counted = []
    for step, name in zip(steps, numbered(step.name for step in steps), strict=True):
        key = (step.edge, round(abs(step.level or 0.0), 6), round(step.from_level, 6))
        repeat = step.repeat
        if repeat is None or repeat in used[key]:
            repeat = next(n for n in range(1, len(steps) + 2) if n not in used[key])
        used[key].add(repeat)
        counted.append(replace(step, repeat=repeat, name=name))
    return counted


def level_steps(runs: Sequence[Run], findings: Mapping[str, Sequence[Finding]]) -> tuple[LevelStep, ...]:
    """The changes of input of cut runs, with the findings of each name: upwards first, by the level they go to."""
    steps = []
    for run in (run for run in runs if _samples(run)):
        step, ends = Cut(run), (run.from_level, run.level or 0.0)
        before, after = ends[::-1] if run.edge == "falling" else ends
        held = run.held if run.edge == "falling" and run.from_level == 0.0 else None
        start = (run.baseline or 0.0) if held is None else held
        active = run.part(slice(step.start, None))
        steps.append(LevelStep(
            run.name, run.source, before, after, start, step.time_s, active.output, active.input, run.rest_s,
            run.rest_moved, run.start_s + (run.step_s or 0.0), tuple(findings.get(run.name, ())),
        ))  # fmt: skip
    return tuple(sorted(steps, key=lambda one: (one.edge != "up", one.level, one.from_level, one.name)))
