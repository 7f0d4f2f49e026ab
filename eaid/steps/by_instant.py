"""A log whose step instant is given, or shows in its output alone → its step, and the release behind its window.

In the output alone the step is the first sample after its last visit to the idle band.
"""

import re
from dataclasses import replace

import numpy as np

from eaid.arrays import Array, median
from eaid.errors import DataError
from eaid.findings import finding
from eaid.logs.run import Run
from eaid.steps.baseline import first_samples, last_rest
from eaid.steps.by_input import NO_STEP, edge_between
from eaid.steps.noise import sample_noise, sampled
from eaid.steps.not_steps import refuse_to_cut, several_edges
from eaid.steps.plateaus import FEWEST, Plateau, end_of, plateaus, sample_s, tolerance, zero_of
from eaid.steps.step import sample_at


def no_level(run: Run) -> DataError:
    """Why a log without input and level is refused, with a pattern where its name holds a number."""
    number = re.search(r"([A-Za-z_=-]?)(\d+(?:\.\d+)?)([A-Za-z%]*)", run.name)
    hint = "with {level}"
    if number:
        hint = f'"{number[1]}{{level}}{number[3]}", if {number[2]} is the level'
    return DataError(f"{run.where}: nothing tells its level; give the input column, or «name_pattern» {hint}")


def cut_at(run: Run, at_s: float) -> list[Run]:
    """The step at an instant that the user, the dataset or the output gives, and the release behind its window."""
    until, level = _window(run, at_s)
    start = sample_at(run, at_s)
    now, zero, known = Plateau(start, until, level), zero_of(run), run.has_input
    step = replace(run, level=level)
    earlier = [p for p in plateaus(run.input[:start]) if p.count >= FEWEST] if known and start else []
    if earlier and abs(earlier[-1].level) > zero:
        step = edge_between(run, earlier[-1], now, zero, run.baseline)
    elif start and until > start and run.baseline is None:
        idle = run.output[:start]
        rest = last_rest(idle, end_of(run.output, now) - float(idle.mean()))
        step = replace(
            step, baseline=rest.value, held=None if rest.rests else rest.start, rest_s=rest.count * sample_s(run),
            rest_moved=rest.moved, findings=(*run.findings, *rest.findings(run.name)),
        )  # fmt: skip
    steps = [step.part(slice(until), step_s=float(run.time_s[start]), until_s=None, cut=True)]
    left = float(median(run.input[until:])) if known and until < len(run.time_s) else 0.0
    falls = abs(left) < abs(level) if known else run.until_s is not None and _falls(run, now)
    if len(run.time_s) - until >= FEWEST and step.edge == "rising" and falls:
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
    level = run.level
    if run.has_input and until > start:
        window = run.input[start:until]
        if level is None:
            holds = [plateau for plateau in plateaus(window) if plateau.count >= FEWEST]
            level = holds[0].level if holds else median(window)
        near = np.abs(window - level) <= max(tolerance(run.input), 0.01 * abs(level))
        if near.any():  # the window ends where the input leaves its level, once it has reached it
            reached = int(near.argmax())
            left = np.flatnonzero(~near[reached:])
            until = start + reached + int(left[0]) if len(left) else until
    if level is None:
        raise no_level(run)
    return until, level


def _falls(run: Run, now: Plateau) -> bool:
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
    from_start = rises_at_once(run.output, first_samples(run.output)) and bool(level)
    if constant is not None and not rig and not from_start:
        raise DataError(f"{run.where}: the input stays at {constant:g} {run.input_unit}: no step; {NO_STEP}")
    at = 0 if rises_at_once(run.output) or (from_start and not rig) else onset(run.output)
    if level is None or at is None:
        odd = several_edges(run.name, run.time_s, run.output)
        if odd is not None:
            raise refuse_to_cut(run, odd)
        if level is None:
            raise no_level(run)
        raise DataError(f"{run.where}: no step stands out of the output's noise; give its instant with «step_at»")
    if at == 0:
        said = finding("step-at-first-sample", run.name, start=first_samples(run.output), unit=run.output_unit)
    else:
        said = finding("step-from-output", run.name, step_s=float(run.time_s[at]))
    return cut_at(replace(run, level=level, findings=(*run.findings, said)), float(run.time_s[at]))


def rises_at_once(output: Array, start: float = 0.0) -> bool:
    """True where the output begins at `start` and leaves it from its first sample on, without an idle stretch before.

    At a quarter of the time to half of its end value a step response has long risen; an idle output has not.
    """
    count = len(output)
    if count < 2 * FEWEST:
        return False
    rise = output - start
    end = median(sampled(rise[-(count // 10) :]))
    noise = sample_noise(output)
    if abs(end) <= 8 * noise or abs(float(rise[:3].mean())) > 0.2 * abs(end):
        return False
    above = np.flatnonzero(np.sign(end) * rise >= 0.5 * abs(end))
    high = int(above[0]) if len(above) else count - 1
    quarter = np.sign(end) * rise[high // 4 : high // 4 + high // 8 + 1]
    return bool(quarter.mean() >= 0.05 * abs(end) + 4 * noise / np.sqrt(len(quarter)))


def onset(output: Array) -> int | None:
    """First sample after the output's last visit to its idle band before it is half-way up; None where none stands out.

    The idle band is the median of the first samples ± 4 standard deviations (from the median deviation), at least 1 %
    of the rise; the first samples are refined once by those before the onset found.
    """
    count = len(output)
    head = max(FEWEST, count // 50)
    if count < 2 * FEWEST:
        return None
    start = None
    for _ in range(3):
        idle = median(output[:head])
        noise = 1.4826 * median(np.abs(output[:head] - idle))
        away = np.abs(output - idle)
        rise = float(np.quantile(away, 0.9))
        if rise <= 8 * noise or rise == 0:
            return None
        half = np.flatnonzero(away >= 0.5 * rise)
        inside = np.flatnonzero(away[: half[0]] <= max(4 * noise, 0.01 * rise))
        if not len(inside):
            return None
        leaves = int(inside[-1]) + 1
        if leaves == start:
            break
        start, head = leaves, max(FEWEST, leaves * 9 // 10)
    return start
