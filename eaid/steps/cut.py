"""A log → its steps: where the input leaves one plateau for the next, or where the user says (SPEC §2).

A plateau is a stretch in which the input stands still within `tolerance`; t = 0 of a step is the first sample at which
the input is at its new level, so a ramp between two plateaus belongs to neither. Every step is a run of its own; the
steps of a log share no sample, so a dataset of cut runs holds each sample once.
"""

import itertools
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from eaid.arrays import Array, median, read_only
from eaid.errors import DataError
from eaid.logs.run import Run
from eaid.logs.spool import extent, mean, pieces, release, sample, sample_steps

OFFSET = 0.05
"""Share of its largest value within which a measured input counts as zero."""
FEWEST = 10
"""Samples in the active window below which a step is refused (CONTRACT.md)."""


@dataclass(frozen=True)
class Plateau:
    """A stretch of constant input: samples start … stop − 1."""

    start: int
    stop: int
    level: float


def tolerance(values: Array) -> float:
    """How far an input may stray on a plateau: 1 % of its range, or six times its noise, whichever is more."""
    low, high = extent(values)
    steps = sample_steps(values)
    noise = 1.4826 * median(np.abs(steps)) / np.sqrt(2) if len(steps) else 0.0
    return max(0.01 * (high - low), 6.0 * noise)


def plateaus(values: Array) -> list[Plateau]:
    """The stretches on which the input stands still, ramps left out; a short one at the very end is kept."""
    allowed = tolerance(values)
    if allowed == 0.0:
        return [Plateau(0, len(values), float(values[0]))]
    jumps = _jumps(values, allowed)
    if len(jumps) > max(1000, len(values) // (2 * FEWEST)):
        return []  # it never stands still
    parts: list[Plateau] = []
    for start, stop in itertools.pairwise([0, *jumps, len(values)]):
        parts.extend(_without_slow_ramps(values, start, stop, allowed))
        release(values)
    found: list[Plateau] = []
    for i, piece in enumerate(parts):
        short = piece.stop - piece.start < FEWEST
        on_a_ramp = 0 < i < len(parts) - 1 and (
            (parts[i + 1].level - piece.level) * (piece.level - parts[i - 1].level) > 0
        )
        if short and on_a_ramp:
            continue
        if found and abs(found[-1].level - piece.level) <= allowed and found[-1].stop == piece.start:
            found[-1] = Plateau(found[-1].start, piece.stop, found[-1].level)
        else:
            found.append(piece)
    return found


def _jumps(values: Array, allowed: float) -> list[int]:
    """First samples behind the jumps of an input."""
    found: list[int] = []
    for place, (piece,) in pieces(values, overlap=1):
        found.extend((np.flatnonzero(np.abs(np.diff(piece)) > allowed) + place.start + 1).tolist())
    return found


def _without_slow_ramps(values: Array, start: int, stop: int, allowed: float) -> list[Plateau]:
    """A stretch without jumps as plateaus: one where it stands still, the parts between ramps where it does not."""
    part = values[start:stop]
    low, high = extent(part)
    if high - low <= 4 * allowed or len(part) < 4 * FEWEST:
        return [Plateau(start, stop, median(sample(part)))]
    lag = FEWEST
    moves = np.abs(part[lag:] - part[:-lag]) > allowed
    while not moves.any() and 2 * lag < len(part) // 2:
        lag *= 2
        moves = np.abs(part[lag:] - part[:-lag]) > allowed
    # a sample moves where any pair `lag` apart that spans it differs: pairs that begin in i − lag … i
    sums = np.concatenate(([0], np.cumsum(moves)))
    at = np.arange(len(part))
    moving = sums[np.minimum(at + 1, len(moves))] - sums[np.clip(at - lag, 0, len(moves))] > 0
    edges = np.flatnonzero(np.diff(np.concatenate(([1], moving.astype(np.int8), [1]))))
    still = [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a >= FEWEST]
    found = []
    for a, b in still:
        level = median(part[a:b])
        near = np.abs(part - level) <= allowed
        while a > 0 and near[a - 1]:
            a -= 1
        while b < len(part) and near[b]:
            b += 1
        found.append(Plateau(start + a, start + b, level))
    return found


def _check_stands_still(found: list[Plateau], count: int, where: str) -> None:
    still = sum(plateau.stop - plateau.start for plateau in found if plateau.stop - plateau.start >= FEWEST)
    if still < count / 2:
        raise DataError(f"{where}: the input moves most of the time, so it holds no steps; record one level at a time")


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


def cut(run: Run, keep_baseline: bool = False) -> list[Run]:
    """The steps of a log, in the order of time, each with level, step instant, baseline and edge found.

    Raises DataError where the log has no step, or a level that cannot be told.
    """
    where = run.where
    if len(run.time_s) < FEWEST:
        raise DataError(
            f"{where}: holds {len(run.time_s)} samples, and a step takes at least {FEWEST}; record it longer"
        )
    if run.cut and run.step_s is not None:
        return [run]
    low, high = extent(run.output)
    if low == high:
        raise DataError(
            f"{where}: the output never changes ({run.output[0]:g} {run.output_unit} throughout); check the sensor"
        )
    known = has_input(run)
    if known and run.input_unit == "%":
        _check_percent(run, where)
    if run.step_s is not None:
        steps = _cut_at(run, where, known)
    elif known and np.ptp(extent(run.input)) > 0:
        steps = _cut_by_input(_up_to(run, where), where)
    else:
        steps = _cut_by_output(run, where, known)
    return _with_baselines(steps, keep_baseline)


def _up_to(run: Run, where: str) -> Run:
    """The log up to the end of the window that the user gives; the whole of it where none is given."""
    if run.until_s is None:
        return run
    stop = int(np.searchsorted(run.time_s, run.until_s - 1e-9 * max(1.0, abs(run.until_s))))
    if stop < FEWEST:
        raise DataError(f"{where}: the window ends at {run.until_s:g} s, before the log has begun; mend --until")
    return replace(_part(run, 0, stop, until_s=None), cut=False)


def has_input(run: Run) -> bool:
    """True where the log has an input column."""
    return bool(len(run.input)) and not bool(np.isnan(run.input[0]) and np.isnan(run.input[-1]))


def _check_percent(run: Run, where: str) -> None:
    for place, (piece,) in pieces(run.input):
        for wrong, how in ((piece > 100 + 1e-9, "above 100"), (piece < -1e-9, "below 0")):
            if wrong.any():
                first = place.start + int(wrong.argmax())
                raise DataError(
                    f"{where}: the input is {run.input[first]:g} % at {run.time_s[first]:.6g} s, {how}; "
                    f"if it is not in %, say its unit with --units input=UNIT"
                )


def _cut_by_input(run: Run, where: str) -> list[Run]:
    """Steps where the input goes from one plateau to another; towards zero is a falling edge."""
    found, bridged = bridge(plateaus(run.input))
    _check_stands_still(found, len(run.input), where)
    zero = tolerance(run.input)
    if run.input_unit != "%":  # a commanded duty is exact, a measured input has an offset
        zero = max(zero, OFFSET * float(np.abs(extent(run.input)).max()))
    if len(found) < 2:
        raise DataError(f"{where}: the input stays at {found[0].level:g} {run.input_unit}: no step; {_NO_STEP}")
    notes = run.notes
    if bridged:
        notes = (*notes, f"the input leaves its level for {bridged} samples and comes back: passed over")
    steps: list[Run] = []
    counts = {"rising": 0, "falling": 0}
    baseline = run.baseline
    end = 0
    for i, (before, now) in enumerate(itertools.pairwise(found)):
        down = abs(now.level) < abs(before.level) and now.level * before.level >= -zero * zero
        edge: Literal["rising", "falling"] = "falling" if down else "rising"
        counts[edge] += 1
        name = run.name + ("-release" if down else "") + (f"-{counts[edge]}" if counts[edge] > 1 else "")
        level, other = (before.level, now.level) if down else (now.level, before.level)
        if baseline is None and abs(before.level) <= zero:
            # behind a hold, only the last quarter of the idle time is taken for idle
            start = before.start if i == 0 else before.stop - (before.stop - before.start) // 4 - 1
            baseline = mean(run.output[start : before.stop])
        release(run.output)
        # the ramp between two plateaus goes with the step that it leads to
        start, end = end, now.stop
        steps.append(
            _part(
                run,
                start,
                end,
                name=name,
                level=level,
                from_level=0.0 if abs(other) <= zero else other,
                step_s=float(run.time_s[now.start]),
                edge=edge,
                until_s=None,
                notes=notes if i == 0 else run.notes,
                held=_end_of(run, before),
            )
        )
    return [replace(step, baseline=baseline) for step in steps]


GLITCH = 3
"""Samples up to which an input that leaves its level and comes back is passed over, and told."""


def bridge(found: list[Plateau]) -> tuple[list[Plateau], int]:
    """Plateaus without the glitches that part one level in two; and how many samples those were."""
    joined: list[Plateau] = []
    passed = 0
    for plateau in found:
        if len(joined) >= 2:
            before, glitch = joined[-2], joined[-1]
            if glitch.stop - glitch.start <= GLITCH and plateau.start == glitch.stop and glitch.start == before.stop:
                close = 0.05 * max(abs(before.level - glitch.level), abs(plateau.level - glitch.level))
                if abs(before.level - plateau.level) <= close and plateau.stop - plateau.start > GLITCH:
                    joined[-2:] = [Plateau(before.start, plateau.stop, before.level)]
                    passed += glitch.stop - glitch.start
                    continue
        joined.append(plateau)
    return joined, passed


def _end_of(run: Run, hold: Plateau) -> float:
    """Output at the end of a hold: mean of its last twentieth."""
    count = max(1, (hold.stop - hold.start) // 20)
    last = mean(run.output[hold.stop - count : hold.stop])
    release(run.output)
    return last


def _falls(run: Run, start: int, until: int, level: float) -> bool:
    """Whether the output comes back, by a hundredth of its rise or more, behind a window that only the user ended."""
    idle = median(run.output[:start]) if start else 0.0
    rise = _end_of(run, Plateau(start, until, level)) - idle
    left = median(run.output[until:]) - idle
    release(run.output)
    return bool(left * np.sign(rise) < 0.99 * abs(rise))


_NO_STEP = "record the idle time before the step too, or give the step instant with --step-at"


def _cut_at(run: Run, where: str, known: bool) -> list[Run]:
    """The step at the instant that the user or the dataset gives, and the release behind the end of its window."""
    time, step = run.time_s, float(run.step_s or 0.0)
    close = 1e-9 * max(1.0, abs(step))
    if not time[0] - close <= step <= time[-1]:
        raise DataError(
            f"{where}: the step at {step:g} s lies outside the log ({time[0]:.6g} to {time[-1]:.6g} s); mend --step-at"
        )
    start = int(np.searchsorted(time, step - close))
    until = len(time)
    if run.until_s is not None:
        if run.until_s <= step:
            raise DataError(f"{where}: the window ends ({run.until_s:g} s) before it begins ({step:g} s); mend --until")
        until = int(np.searchsorted(time, run.until_s - 1e-9 * max(1.0, abs(run.until_s))))
    level = run.level
    if known and until > start:
        held = run.input[start:until]
        if level is None:
            found = [plateau for plateau in plateaus(held) if plateau.stop - plateau.start >= FEWEST]
            level = found[0].level if found else median(held)
        near = np.abs(held - level) <= max(tolerance(run.input), 0.01 * abs(level))
        if near.any():  # the window ends where the input leaves its level, once it has reached it
            reached = int(near.argmax())
            left = np.flatnonzero(~near[reached:])
            until = start + reached + int(left[0]) if len(left) else until
    if level is None:
        raise DataError(f"{where}: nothing tells its level; give the input column, or --name-pattern with {{level}}")
    steps = [_part(run, 0, until, level=level, step_s=float(time[start]), until_s=None)]
    enough = len(time) - until >= FEWEST
    if known:
        ended = enough and abs(median(run.input[until:])) < abs(level)
    else:
        ended = enough and run.until_s is not None and _falls(run, start, until, level)
    if ended:
        steps.append(
            _part(
                run,
                until,
                len(time),
                name=f"{run.name}-release",
                level=level,
                step_s=float(time[until]),
                until_s=None,
                edge="falling",
                held=_end_of(run, Plateau(start, until, level)),
            )
        )
    return steps


def _cut_by_output(run: Run, where: str, known: bool) -> list[Run]:
    """The step of a log without a moving input: where the output leaves its idle value for good."""
    constant = float(run.input[0]) if known else None
    if constant is not None and run.kind not in ("friction-force", "friction-speed"):
        raise DataError(f"{where}: the input stays at {constant:g} {run.input_unit}: no step; {_NO_STEP}")
    level = constant if run.level is None else run.level
    if level is None:
        raise DataError(f"{where}: nothing tells its level; give the input column, or --name-pattern with {{level}}")
    if rises_at_once(run.output):
        start = 0
        note = "the output rises from the first sample on, which is taken for the step; if it came later, say --step-at"
    else:
        found = onset(run.output)
        if found is None:
            raise DataError(f"{where}: no step stands out of the output's noise; give its instant with --step-at")
        start = found
        note = f"step instant {run.time_s[start]:.6g} s found from the output alone: late by a sample or more"
    return _cut_at(replace(run, level=level, step_s=float(run.time_s[start]), notes=(*run.notes, note)), where, known)


def rises_at_once(output: Array) -> bool:
    """True where the output starts near zero and rises from its first sample on, without an idle stretch before.

    At a quarter of the time to half of its end value a step response has long risen; an idle output has not.
    """
    count = len(output)
    if count < 2 * FEWEST:
        return False
    end = median(sample(output[-(count // 10) :]))
    noise = 1.4826 * median(np.abs(sample_steps(output))) / np.sqrt(2)
    if abs(end) <= 8 * noise or abs(float(output[:3].mean())) > 0.2 * abs(end):
        return False
    high = _first_above(output, end)
    quarter = np.sign(end) * output[high // 4 : high // 4 + high // 8 + 1]
    return bool(quarter.mean() >= 0.05 * abs(end) + 4 * noise / np.sqrt(len(quarter)))


def _first_above(output: Array, end: float) -> int:
    """First sample at half of an end value."""
    for place, (piece,) in pieces(output):
        over = np.flatnonzero(np.sign(end) * piece >= 0.5 * abs(end))
        if len(over):
            return int(place.start) + int(over[0])
    return len(output) - 1


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
        found = int(inside[-1]) + 1
        if found == start:
            break
        start, head = found, max(FEWEST, found * 9 // 10)
    return start


def _with_baselines(steps: list[Run], keep_baseline: bool) -> list[Run]:
    """The idle output of each step: as found or stored, else the mean before the first step; 0 where it is kept."""
    first = steps[0]
    before = first.output[: int(np.searchsorted(first.time_s, first.step_s or 0.0))]
    finished = []
    for step in steps:
        baseline, notes = step.baseline, step.notes
        if keep_baseline:
            baseline = 0.0
        elif baseline is None and len(before) and first.edge == "rising":
            baseline = mean(before)
        elif baseline is None:
            baseline = 0.0
            notes = (*notes, "nothing recorded before the step: no baseline is subtracted")
        finished.append(replace(step, baseline=baseline, notes=notes))
    return finished
