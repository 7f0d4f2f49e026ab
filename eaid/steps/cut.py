"""A log → its steps: where the input leaves one plateau for the next, or where the user says.

t = 0 of a step is the first sample at which the input is at its new level, so a ramp between two plateaus belongs to
neither. Every step is a run of its own; the steps of a log share no sample, so a dataset of cut runs holds each sample
once. `level` is where a rising step goes and `from_level` where it comes from; a falling one comes from `level` and
goes to `from_level`; 0 is rest.
"""

import itertools
from dataclasses import replace

import numpy as np

from eaid.arrays import Array, median, read_only
from eaid.errors import DataError
from eaid.findings import Finding, finding
from eaid.logs.run import Run
from eaid.steps.baseline import BaselineRule, Rest, first_samples, last_rest
from eaid.steps.instead import looks_like, refuse_to_cut, several_edges
from eaid.steps.noise import sample_noise
from eaid.steps.onset import onset, rises_at_once
from eaid.steps.plateaus import FEWEST, Plateau, bridge, plateaus, stands_still, tolerance

OFFSET = 0.05
"""Share of its largest value within which a measured input counts as zero."""
WANDERS = 0.15
"""Range of a measured input, as a share of its median, up to which it is one load that wanders."""
UNSETTLED = 0.05
"""Share of a step's change by which the output may still move before a step from level to level."""
AUTO = BaselineRule()
_NO_STEP = "record the idle time before the step too, or give the step instant with «step_at»"


def cut(run: Run, rule: BaselineRule = AUTO) -> list[Run]:
    """The steps of a log, in the order of time, each with level, step instant, baseline and edge found.

    Raises DataError where the log has no step, or a level that cannot be told.
    """
    where = run.where
    if len(run.time_s) < FEWEST:
        raise DataError(
            f"{where}: holds {len(run.time_s)} samples, and a step takes at least {FEWEST}; record it longer"
        )
    if run.cut and run.step_s is not None:
        return [_ruled(run, rule)]
    if run.output.min() == run.output.max():
        raise DataError(
            f"{where}: the output never changes ({run.output[0]:g} {run.output_unit} throughout); check the sensor"
        )
    known = has_input(run)
    if known and run.input_unit == "%":
        _check_percent(run, where)
    if run.step_s is not None:
        steps = _cut_at(run, where, known)
    elif known and not _constant(run):
        steps = _cut_by_input(_up_to(run, where), where)
    else:
        steps = _cut_by_output(_up_to(run, where) if known else run, where, known)
    return _ruled_all(_with_baselines(steps), rule)


def has_input(run: Run) -> bool:
    """True where the log has an input column."""
    return bool(len(run.input)) and not bool(np.isnan(run.input[0]) and np.isnan(run.input[-1]))


def _constant(run: Run) -> bool:
    """True for an input that is held throughout: exactly, or as a measured one whose load wanders a little."""
    span = float(np.ptp(run.input))
    if span == 0:
        return True
    measured = run.input_unit != "%" and sample_noise(run.input) > 0
    return measured and span < WANDERS * abs(median(run.input))


def _up_to(run: Run, where: str) -> Run:
    """The log up to the end of the window that the user gives; the whole of it where none is given."""
    if run.until_s is None:
        return run
    stop = int(np.searchsorted(run.time_s, run.until_s - 1e-9 * max(1.0, abs(run.until_s))))
    if stop < FEWEST:
        raise DataError(f"{where}: the window ends at {run.until_s:g} s, before the log has begun; mend «until»")
    return replace(_part(run, 0, stop, until_s=None), cut=False)


def _check_percent(run: Run, where: str) -> None:
    for wrong, how in ((run.input > 100 + 1e-9, "above 100"), (run.input < -1e-9, "below 0")):
        if wrong.any():
            first = int(wrong.argmax())
            raise DataError(
                f"{where}: the input is {run.input[first]:g} % at {run.time_s[first]:.6g} s, {how}; "
                f"if it is not in %, say its unit with «units» input=UNIT"
            )


def _part(run: Run, start: int, stop: int, **changes: object) -> Run:
    reference = None if run.reference_nm is None else read_only(run.reference_nm[start:stop])
    return replace(
        run,
        time_s=read_only(run.time_s[start:stop]),
        input=read_only(run.input[start:stop]),
        output=read_only(run.output[start:stop]),
        reference_nm=reference,
        cut=True,
        **changes,  # type: ignore[arg-type]
    )


def _edge(run: Run, before: Plateau, now: Plateau, zero: float, fallback: float | None) -> dict[str, object]:
    """What a step between two plateaus is: edge, levels, its start and its baseline."""
    down = abs(now.level) < abs(before.level) and now.level * before.level >= -zero * zero
    level, other = (before.level, now.level) if down else (now.level, before.level)
    from_rest = abs(before.level) <= zero
    change = _end_of(run.output, now) - _end_of(run.output, before)
    # behind a hold, only its last quarter is taken
    first = before.start == 0
    hold = run.output[before.start if first else before.stop - before.count // 4 - 1 : before.stop]
    rest = last_rest(hold, change)
    facts: dict[str, object] = {
        "level": level,
        "from_level": 0.0 if abs(other) <= zero else other,
        "edge": "falling" if down else "rising",
        "held": _end_of(run.output, before) if not from_rest else rest.start,
    }
    found: tuple[Finding, ...] = ()
    if rest.left_out:
        found = (finding("spikes-before-step", run.name, samples=rest.left_out),)
    if from_rest:
        # a rest that still moves after an earlier step is no rest of its own: counted from the one before
        facts["baseline"] = rest.value if rest.rests or first or fallback is None else fallback
    elif down and abs(now.level) <= zero:
        facts["baseline"] = _settled_end(run.output, now) if fallback is None else fallback
    else:
        facts["baseline"] = rest.value
        off = abs(_still_to_go(hold, rest))
        if not rest.rests and off > UNSETTLED * abs(change):
            found += (
                finding(
                    "unsettled-before-step",
                    run.name,
                    (before.level, now.level),
                    share_pct=100 * off / max(abs(change), 1e-3 * off),
                ),
            )
    return {**facts, "findings": (*run.findings, *found)}


def _still_to_go(hold: Array, rest: Rest) -> float:
    """How far the output moved over the part of a hold that was to be a rest."""
    return rest.start - float(hold[: max(1, len(hold) // 4)].mean())


def _settled_end(output: Array, hold: Plateau) -> float:
    """Output at the end of a release: the last rest of its hold."""
    return last_rest(output[hold.stop - hold.count // 4 - 1 : hold.stop], 0.0).value


def _cut_by_input(run: Run, where: str) -> list[Run]:
    """Steps where the input goes from one plateau to another; towards zero is a falling edge."""
    found, bridged = bridge(plateaus(run.input))
    if not stands_still(found, run.input):
        raise refuse_to_cut(run)
    if (odd := looks_like(run)) is not None:
        raise refuse_to_cut(run, odd)
    zero = tolerance(run.input)
    if run.input_unit != "%":  # a commanded duty is exact, a measured input has an offset
        zero = max(zero, OFFSET * float(np.abs(run.input).max()))
    if len(found) < 2:
        raise DataError(f"{where}: the input stays at {found[0].level:g} {run.input_unit}: no step; {_NO_STEP}")
    if bridged:
        run = replace(run, findings=(*run.findings, finding("input-glitch", run.name, samples=bridged)))
    steps: list[Run] = []
    counts = {"rising": 0, "falling": 0}
    idle: float | None = run.baseline
    end = 0
    for i, (before, now) in enumerate(itertools.pairwise(found)):
        facts = _edge(run, before, now, zero, idle)
        if run.baseline is not None:
            facts["baseline"] = run.baseline
        elif abs(before.level) <= zero:
            idle = facts["baseline"]  # type: ignore[assignment]
        if i > 0:
            facts["findings"] = tuple(one for one in facts["findings"] if one not in run.findings)  # type: ignore[attr-defined]
        edge = str(facts["edge"])
        counts[edge] += 1
        name = run.name + ("-release" if edge == "falling" else "") + (f"-{counts[edge]}" if counts[edge] > 1 else "")
        # the ramp between two plateaus goes with the step that it leads to
        start, end = end, now.stop
        steps.append(
            _part(
                run, start, end, name=name, step_s=float(run.time_s[now.start]), until_s=None, **facts,
            )
        )  # fmt: skip
    return steps


def _end_of(output: Array, hold: Plateau) -> float:
    """Output at the end of a hold: mean of its last twentieth."""
    return float(output[hold.stop - max(1, hold.count // 20) : hold.stop].mean())


def _falls(run: Run, start: int, until: int, level: float) -> bool:
    """Whether the output comes back, by a hundredth of its rise or more, behind a window that only the user ended."""
    idle = median(run.output[:start]) if start else 0.0
    rise = _end_of(run.output, Plateau(start, until, level)) - idle
    left = median(run.output[until:]) - idle
    return bool(left * np.sign(rise) < 0.99 * abs(rise))


def _window(run: Run, where: str, known: bool) -> tuple[int, int, float | None]:
    """First sample of the step at the instant given, first sample behind its window, and its level."""
    time, step = run.time_s, float(run.step_s or 0.0)
    close = 1e-9 * max(1.0, abs(step))
    if not time[0] - close <= step <= time[-1]:
        raise DataError(
            f"{where}: the step at {step:g} s lies outside the log ({time[0]:.6g} to {time[-1]:.6g} s); mend «step_at»"
        )
    start = int(np.searchsorted(time, step - close))
    until = len(time)
    if run.until_s is not None:
        if run.until_s <= step:
            raise DataError(f"{where}: the window ends ({run.until_s:g} s) before it begins ({step:g} s); mend «until»")
        until = int(np.searchsorted(time, run.until_s - 1e-9 * max(1.0, abs(run.until_s))))
    level = run.level
    if known and until > start:
        held = run.input[start:until]
        if level is None:
            found = [plateau for plateau in plateaus(held) if plateau.count >= FEWEST]
            level = found[0].level if found else median(held)
        near = np.abs(held - level) <= max(tolerance(run.input), 0.01 * abs(level))
        if near.any():  # the window ends where the input leaves its level, once it has reached it
            reached = int(near.argmax())
            left = np.flatnonzero(~near[reached:])
            until = start + reached + int(left[0]) if len(left) else until
    return start, until, level


def _cut_at(run: Run, where: str, known: bool) -> list[Run]:
    """The step at the instant that the user or the dataset gives, and the release behind the end of its window."""
    start, until, level = _window(run, where, known)
    if level is None:
        raise DataError(f"{where}: nothing tells its level; give the input column, or «name_pattern» with {{level}}")
    time, output = run.time_s, run.output
    now = Plateau(start, until, level)
    facts: dict[str, object] = {"level": level}
    zero = max(tolerance(run.input), OFFSET * float(np.abs(run.input).max())) if known else 0.0
    earlier = [p for p in plateaus(run.input[:start]) if p.count >= FEWEST] if known and start else []
    if earlier and abs(earlier[-1].level) > zero:
        facts = _edge(run, earlier[-1], now, zero, run.baseline)
    elif start and until > start and run.baseline is None:
        rest = last_rest(output[:start], _end_of(output, now) - float(output[:start].mean()))
        facts |= {"baseline": rest.value} if rest.rests else {"baseline": rest.value, "held": rest.start}
        if rest.left_out:
            facts["findings"] = (*run.findings, finding("spikes-before-step", run.name, samples=rest.left_out))
    steps = [_part(run, 0, until, step_s=float(time[start]), until_s=None, **facts)]
    enough = len(time) - until >= FEWEST
    if facts.get("edge") == "falling":
        ended = False
    elif known:
        ended = enough and abs(median(run.input[until:])) < abs(level)
    else:
        ended = enough and run.until_s is not None and _falls(run, start, until, level)
    if ended:
        left = float(median(run.input[until:])) if known else 0.0
        steps.append(
            _part(
                run, until, len(time), name=f"{run.name}-release", level=level, step_s=float(time[until]), until_s=None,
                edge="falling", from_level=left if abs(left) > zero else 0.0, held=_end_of(output, now),
                findings=(),
            )
        )  # fmt: skip
    return steps


def _cut_by_output(run: Run, where: str, known: bool) -> list[Run]:
    """The step of a log without a moving input: where the output leaves its idle value for good."""
    constant = median(run.input) if known else None
    level = constant if run.level is None else run.level
    from_start = rises_at_once(run.output, first_samples(run.output)) and bool(level)
    if constant is not None and run.kind not in ("friction-force", "friction-speed") and not from_start:
        raise DataError(f"{where}: the input stays at {constant:g} {run.input_unit}: no step; {_NO_STEP}")
    if level is None:
        _refuse_several(run)
        raise DataError(f"{where}: nothing tells its level; give the input column, or «name_pattern» with {{level}}")
    if rises_at_once(run.output) or (run.kind not in ("friction-force", "friction-speed") and from_start):
        start = 0
        said = finding("step-at-first-sample", run.name, start=first_samples(run.output), unit=run.output_unit)
    else:
        found = onset(run.output)
        if found is None:
            _refuse_several(run)
            raise DataError(f"{where}: no step stands out of the output's noise; give its instant with «step_at»")
        start = found
        said = finding("step-from-output", run.name, step_s=float(run.time_s[start]))
    told = replace(run, level=level, step_s=float(run.time_s[start]), findings=(*run.findings, said))
    return _cut_at(told, where, known)


def _refuse_several(run: Run) -> None:
    """Raise DataError where an output alone shows several edges."""
    first = float(run.time_s[0])
    odd = several_edges(run.name, run.time_s - first, run.output, first)
    if odd is not None:
        raise refuse_to_cut(run, odd)


def _with_baselines(steps: list[Run]) -> list[Run]:
    """The steps with a baseline: what was found or stored, else the first samples; a release takes its step's."""
    finished: list[Run] = []
    for step in steps:
        if step.baseline is None and finished:
            step = replace(step, baseline=finished[0].baseline)
        elif step.baseline is None:
            active = step.output[int(np.searchsorted(step.time_s, step.step_s or 0.0)) :]
            start = first_samples(active)
            told = any(one.code == "step-at-first-sample" for one in step.findings)
            said = () if told else (finding("no-rest-before-step", step.name, start=start, unit=step.output_unit),)
            step = replace(step, baseline=start, findings=(*step.findings, *said))
        finished.append(step)
    return finished


def _ruled_all(steps: list[Run], rule: BaselineRule) -> list[Run]:
    """Steps with the baselines that the user asks for; a release has that of its own rise."""
    idle: float | None = None
    done: list[Run] = []
    for step in steps:
        ruled = _ruled(step, rule)
        if step.edge == "falling" and step.from_level == 0.0 and idle is not None:
            ruled = replace(ruled, baseline=idle)
        elif step.edge == "rising" and step.from_level == 0.0:
            idle = ruled.baseline
        done.append(ruled)
    return done


def _ruled(step: Run, rule: BaselineRule) -> Run:
    """A step with the baseline that the user asks for."""
    if rule.how == "auto":
        return step
    if rule.how in ("none", "value"):
        return replace(step, baseline=rule.value)
    if step.edge == "falling" and step.from_level == 0.0:
        return step  # it is counted from the idle output before its own rise
    at = step.step_s or 0.0
    if rule.how == "first":
        return replace(step, baseline=first_samples(step.output[int(np.searchsorted(step.time_s, at - 1e-9)) :]))
    low, high = rule.window_s
    inside = (step.time_s >= at + low) & (step.time_s <= at + high)
    if not inside.any():
        raise DataError(
            f"{step.where}: «baseline» {low:g}:{high:g} holds no sample of {step.name}, which runs from "
            f"{step.time_s[0] - at:.4g} to {step.time_s[-1] - at:.4g} s relative to its step"
        )
    return replace(step, baseline=float(step.output[inside].mean()))
