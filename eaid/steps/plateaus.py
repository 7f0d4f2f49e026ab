"""What an input does: where it stands still, ramps between left out; or moves; or more than step from rest.

A plateau is a stretch in which the input stays within `tolerance`, 1 % of its range or six times its noise.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from eaid.arrays import Array, median
from eaid.logs.run import Run
from eaid.steps.noise import block_noise, sample_noise, stretches

FEWEST_HELD = 10  # Samples in the active window below which a step is refused
OFFSET = 0.05  # Share of its largest value within which a measured input counts as zero
GLITCH = 2  # Samples up to which an input that leaves its level and comes back has taken no step
BACK = 0.5  # Share of a range by which values have to come back for a turn
AT_REST_BELOW = 0.02  # An input below this part of its largest is at rest
COMMANDED, AS_MEASURED = 0.02, 0.1  # Parts of the largest input by which two inputs differ: a measured one wanders
SIGNED = 0.05  # Part of the largest input by which it has to go to either side of rest to have both signs
STILL, NOISE_MOST = 6.0, 0.3  # Deviations of a held input's noise that are no input, and part of the largest
AWAY = 0.05  # A stretch under load that spends more than this part of its time away from its own middle is no step
RETURNS = 4  # So many falls to rest make a recording of its own, where the rests are shorter than the holds; fewer …
LEFT_OVER = 0.03  # … where the next step begins on more than this part of what the one before has risen


@dataclass(frozen=True)
class Plateau:
    """A stretch of constant input: samples start … stop − 1."""

    start: int
    stop: int
    level: float

    @property
    def count(self) -> int:
        """Samples in it."""
        return self.stop - self.start


def tolerance(values: Array) -> float:
    """How far an input may stray on a plateau: 1 % of its range, or six times its noise, whichever is more; what goes
    on from row to row is no noise."""
    span = float(np.ptp(values)) if len(values) else 0.0
    noise = sample_noise(values)
    return max(0.01 * span, STILL * min(noise, block_noise(values)) if noise else 0.0)


def plateaus(values: Array) -> list[Plateau]:
    """The stretches on which the input stands still, ramps and glitches left out; a short one at the end is kept."""
    allowed = tolerance(values)
    if allowed == 0.0:
        return [Plateau(0, len(values), float(values[0]))]
    jumps = (np.flatnonzero(np.abs(np.diff(values)) > allowed) + 1).tolist()
    if len(jumps) > max(1000, len(values) // (2 * FEWEST_HELD)):
        return []  # it never stands still
    parts: list[Plateau] = []
    for start, stop in itertools.pairwise([0, *jumps, len(values)]):
        parts.extend(_without_slow_ramps(values, start, stop, allowed))
    joined: list[Plateau] = []
    for i in range(len(parts) - 2, 0, -1):
        around = parts[i - 1], parts[min(i + 1, len(parts) - 1)]
        back = abs(around[0].level - around[1].level) <= allowed and min(one.count for one in around) >= FEWEST_HELD
        if parts[i].count <= GLITCH and back:
            parts[i - 1 : i + 2] = [Plateau(around[0].start, around[1].stop, around[0].level)]
    levels = [piece.level for piece in parts]
    for i, piece in enumerate(parts):
        short = piece.count < FEWEST_HELD and 0 < i < len(parts) - 1
        if short and (levels[i + 1] - piece.level) * (piece.level - levels[i - 1]) > 0:
            continue  # on a ramp
        if joined and abs(joined[-1].level - piece.level) <= allowed and joined[-1].stop == piece.start:
            joined[-1] = Plateau(joined[-1].start, piece.stop, joined[-1].level)
        else:
            joined.append(piece)
    return joined


def _without_slow_ramps(values: Array, start: int, stop: int, allowed: float) -> list[Plateau]:
    """A stretch without jumps as plateaus: one where it stands still, the parts between ramps where it does not."""
    part = values[start:stop]
    if np.ptp(part) <= 4 * allowed or len(part) < 4 * FEWEST_HELD:
        return [Plateau(start, stop, median(part))]
    lag = FEWEST_HELD
    moves = np.abs(part[lag:] - part[:-lag]) > allowed
    while not moves.any() and 2 * lag < len(part) // 2:
        lag *= 2
        moves = np.abs(part[lag:] - part[:-lag]) > allowed
    # a sample moves where any pair `lag` apart that spans it differs: pairs that begin in i − lag … i
    sums = np.concatenate(([0], np.cumsum(moves)))
    at = np.arange(len(part))
    moving = sums[np.minimum(at + 1, len(moves))] - sums[np.clip(at - lag, 0, len(moves))] > 0
    still = []
    for a, b in np.column_stack(stretches(~moving)).tolist():
        if b - a < FEWEST_HELD:
            continue
        level = median(part[a:b])
        near = np.abs(part - level) <= allowed
        while a > 0 and near[a - 1]:
            a -= 1
        while b < len(part) and near[b]:
            b += 1
        still.append(Plateau(start + a, start + b, level))
    return still


def stands_still(holds: list[Plateau], values: Array) -> bool:
    """True where an input stands still for at least half of its record: what leans is part of a slow ramp."""
    allowed, still = tolerance(values), 0
    for hold in holds:
        part = values[hold.start : hold.stop]
        quarter = max(1, len(part) // 4)
        if hold.count >= FEWEST_HELD and abs(float(part[-quarter:].mean() - part[:quarter].mean())) <= allowed:
            still += hold.count
    return still >= len(values) / 2


# Levels of a sweep at least, the longest hold over the shortest, and the part of its step by which an output may still
# move from the second to the last quarter of a hold
SWEEP_LEVELS, AS_LONG, MOVES_ON = 3, 1.3, 0.2


def switching(values: Array) -> float | None:
    """Rows of a half-wave of an input that goes to and fro as a drive's square wave; None of any other input."""
    high = values > (float(values.min()) + float(values.max())) / 2
    each = np.diff(np.flatnonzero(high[1:] != high[:-1]))
    usual = median(each) if len(each) > 2 * FEWEST_HELD else 0.0
    regular = np.mean(np.abs(each - usual) <= 1) > 0.9 if 0 < usual < FEWEST_HELD else False
    return float(each[np.abs(each - usual) <= 1].mean()) if regular else None


def is_measured(run: Run) -> bool:
    """Whether an input is read back, not commanded: no duty, or one that its noise takes beyond what duties can be."""
    if run.input_unit != "%":
        return True
    beyond = max(-float(run.input.min()), float(run.input.max()) - 100.0)
    return 0 < beyond <= min(STILL * sample_noise(run.input), NOISE_MOST * float(run.input.max()))


def fitted_as(run: Run, rest: float = 0.0) -> Literal["steps", "sweep", "recorded"]:
    """Whether a log is fitted by its steps from rest, or as it was recorded, for its input does more.

    It does where it moves most of the time, where a stretch under load goes through different inputs, where it goes to
    both sides of rest or never comes to it, or where it falls to rest again and again with short rests, or with such as
    the output does not come to rest in, and is no sweep of levels. Runs whose level or step instant was given, and cut
    steps, are steps.
    """
    if run.cut or {run.level, run.step_s, run.until_s} != {None} or run.kind not in (None, "clutch"):
        return "steps"
    if not run.has_input or len(run.time_s) < FEWEST_HELD:
        return "steps"
    holds = plateaus(run.input)
    still = stands_still(holds, run.input)
    if run.position is None and not still:
        return "recorded"
    signed = run.input - rest
    level = np.abs(signed)
    top = float(level.max())
    noise = min(STILL * sample_noise(signed), NOISE_MOST * top) if still else 0.0  # of a voltage monitor at rest
    loaded = level > max(AT_REST_BELOW * top, noise)
    if len(level) < 10 or top == 0.0 or (loaded.all() and np.ptp(signed) <= AT_REST_BELOW * top):
        return "steps"
    if min(float(signed.max()), -float(signed.min())) > max(SIGNED * top, noise) or (loaded.all() and still):
        return "recorded"  # of both signs, or from level to level without ever coming to rest
    starts, ends = stretches(loaded)
    apart = (AS_MEASURED if is_measured(run) else COMMANDED) * top
    held = [level[a:b] for a, b in zip(starts, ends, strict=True)]
    if sum(int((np.abs(one - median(one)) > apart).sum()) for one in held) > AWAY * int(loaded.sum()):
        return "steps" if len(holds) == 2 and still else "recorded"  # two holds are a step
    lasts, rests = ends - starts, starts[1:] - ends[:-1]
    if len(starts) < 2 or (len(starts) <= RETURNS and not begins_on_tails(run.output, starts, ends)):
        return "steps"
    if median(lasts) < 5 or not (median(rests) < median(lasts) or 3 * rests.min() < lasts.max()):
        return "steps"
    return "sweep" if is_sweep(run.output, [median(one) for one in held], starts, ends) else "recorded"


def is_sweep(output: Array, levels: Sequence[float], starts: NDArray[np.intp], ends: NDArray[np.intp]) -> bool:
    """Whether a log goes from rest to several levels and holds each as long, until its output has all but settled: what
    a step has left when the next begins can be told, and is taken off its steps (`levels/tails.py`)."""
    lasts, moved = ends - starts, []
    if len(set(np.round(np.array(levels) / max(levels), 3).tolist())) < SWEEP_LEVELS:
        return False
    for start, end in zip(starts, ends, strict=True):
        rows = max(1, (end - start) // 4)
        before, early, late = (
            float(output[max(at, 0) :][:rows].mean()) for at in (start - rows, start + rows, end - rows)
        )
        moved.append(abs(late - early) / max(abs(late - before), 1e-300))
    return bool(lasts.max() <= AS_LONG * lasts.min()) and median(np.array(moved)) < MOVES_ON


def begins_on_tails(output: Array, starts: NDArray[np.intp], ends: NDArray[np.intp]) -> bool:
    """Whether most steps after the first begin on what the one before has left, by the output before the first."""
    if starts[0] < FEWEST_HELD:
        return False
    noise, idle, left = sample_noise(output), float(output[: starts[0]].mean()), []
    for start, end, following in zip(starts[:-1], ends[:-1], starts[1:], strict=True):
        rows = max(1, (following - end) // 20)
        tail = float(output[following - rows : following].mean()) - idle
        size = float(output[end - max(1, (end - start) // 20) : end].mean()) - idle
        left.append(tail / size if size and abs(tail) > 4 * noise * np.sqrt(1 / rows + 1 / starts[0]) else 0.0)
    return median(left) > LEFT_OVER


def end_of(output: Array, hold: Plateau) -> float:
    """Output at the end of a hold: mean of its last twentieth."""
    return float(output[hold.stop - max(1, hold.count // 20) : hold.stop].mean())


def zero_of(run: Run) -> float:
    """How far from zero an input is still at rest: a commanded duty is exact, a measured input has an offset."""
    if not run.has_input:
        return 0.0
    offset = OFFSET * float(np.abs(run.input).max()) if is_measured(run) else 0.0
    return max(tolerance(run.input), offset)


def turns(values: Array, back: float) -> list[int]:
    """Places of the extremes between which values go to and fro by at least `back`, the ends among them."""
    places, low, high, direction = [0], 0, 0, 0
    for i, value in enumerate(values.tolist()):
        low = i if value < values[low] else low
        high = i if value > values[high] else high
        if direction >= 0 and values[high] - value >= back:
            places.append(high)
            direction, low, high = -1, i, i
        elif direction <= 0 and value - values[low] >= back:
            places.append(low)
            direction, low, high = 1, i, i
    return [*dict.fromkeys([*places, len(values) - 1])]
