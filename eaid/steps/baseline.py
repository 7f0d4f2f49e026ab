"""The value from which a step starts: the mean of the last rest before that very step.

A hold before a step rests where its last quarter has the mean of the whole, to 1 % of the step's change or four
standard errors. Where the whole does not rest, its last half, quarter, eighth are tried, then the stretches that end
before the step (the output then moves before the input does), then a straight line through the last eighth.
"""

import math
from dataclasses import dataclass

import numpy as np

from eaid.arrays import Array, median
from eaid.errors import UsageError
from eaid.steps.noise import block_means, block_noise, fit_line, sample_noise, spikes
from eaid.steps.plateaus import FEWEST_HELD

STEADY = 0.01  # Share of a step's change by which the last quarter of a rest may differ from the whole of it
REST_ERRORS = 4.0  # Standard errors beyond which a rest counts as moving
# Share of a step's change by which a start may be off its rest: τ1 then shifts by about 2 %, no more than the interval
# that a good record gives it, and a coarse sensor moves in such steps anyway
NOISE_FLOOR = 0.02
RELEASED_CHANCE = 1e-5  # Probability at which a rest that lasts until its step counts as left before it
GROUPS = 6  # Groups of samples, at least, that tell how far means of so many samples lie apart
BENT = 5.0  # Deviations of the noise over √n by which lines through n first samples and half of them part: 2.5 errors
BURST = 1.2  # The last group of samples is off where it lies this many times as far out as the farthest of the others
SIZES = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 256, 512, 1024)


def baseline_rule(text: str) -> tuple[str, float, float]:
    """What the user says about the value before a step: auto, first, value or window, and its two numbers."""
    rule = text.strip().lower()
    if rule in ("auto", "first"):
        return rule, 0.0, 0.0
    try:
        numbers = [0.0] if rule == "none" else [float(part) for part in rule.split(":")]
    except ValueError:
        numbers = []
    if not 1 <= len(numbers) <= 2 or not all(abs(one) <= 1e30 for one in numbers):
        raise UsageError(
            f"«baseline» {text}: write auto, first, none, a value in the output's unit, or FROM:TO in seconds relative "
            "to the step, as -2:-0.5"
        )
    if len(numbers) == 2 and numbers[0] >= numbers[1]:
        raise UsageError(f"«baseline» {text}: FROM must be below TO")
    return "value" if len(numbers) == 1 else "window", numbers[0], numbers[-1]


@dataclass(frozen=True)
class Rest:
    """The rest before a step."""

    value: float  # Mean of the rest, or where nothing rests the output just before the step, by a straight line
    start: float  # Output just before the step
    rests: bool = True  # False where the output moves right up to the step
    lead: int = 0  # Samples by which the output leaves its rest before the step
    left_out: int = 0  # Spikes that were left out of the mean
    count: int = 1  # Samples of the mean
    moved: float = 0.0  # Mean of its second half less that of its first


def _rests(part: Array, change: float) -> bool:
    """Whether the last quarter of a stretch lies no farther from its mean than noise or a hundredth of the change."""
    off = float(part[-(len(part) // 4) :].mean() - part.mean())
    means = block_means(part, 80)
    error = block_noise(means) * math.sqrt(3 / len(means))
    return abs(off) <= max(STEADY * abs(change), REST_ERRORS * error)


def last_rest(hold: Array, change: float) -> Rest:
    """The last rest of a hold that a step ends, from its output, shape (n,), n ≥ 1, and the change that follows."""
    hold, left_out = without_spikes(hold, change)
    count = len(hold)
    if count < FEWEST_HELD:
        return _from(hold, hold, change, left_out)
    size, lead = count, 2
    while size >= max(FEWEST_HELD, count // 8):
        part = hold[-size:]
        if _rests(part, change):
            return _from(part, part, change, left_out)
        size //= 2
    while count - lead >= max(2 * FEWEST_HELD, count // 2):
        part = hold[: count - lead]
        if _rests(part, change):
            return _from(hold, part, change, left_out)
        lead *= 2
    tail = hold[-max(FEWEST_HELD, count // 8) :]
    start = float(tail.mean() + fit_line(np.arange(len(tail)), tail).slope * (len(tail) / 2))
    return Rest(start, start, False, 0, left_out)


def _from(hold: Array, rest: Array, change: float, left_out: int) -> Rest:
    """A rest that lasts until the step, or until the samples before it with which the output leaves it."""
    lead = left_early(hold, rest, change)
    if not lead:
        value, half = float(rest.mean()), len(rest) // 2
        moved = float(rest[half:].mean() - rest[:half].mean()) if half else 0.0
        return Rest(value, value, left_out=left_out, count=len(rest), moved=moved)
    start = float(hold[-max(1, lead // 4) :].mean())
    return Rest(float(hold[: len(hold) - lead].mean()), start, False, lead, left_out, len(hold) - lead)


def left_early(hold: Array, rest: Array, change: float) -> int:
    """Samples at the end of a hold that lie off its rest, by more than as many samples anywhere in it do; 0: none.

    The mean of the last k samples is held against the means of groups of k before them: their spread honours whatever
    autocorrelation the noise has. A t test for each k, at `RELEASED_CHANCE` in all.
    """
    from scipy.special import stdtrit  # only where a step is looked for: reading a dataset needs none of it

    sizes = [k for k in SIZES if len(rest) >= GROUPS * k + 2 * k]
    lead, most = 0, 1.0
    for k in sizes:
        before = rest[: len(hold) - 2 * k]
        before = before[len(before) % k :]
        off = abs(float(hold[-k:].mean() - before.mean()))
        if off <= most * NOISE_FLOOR * abs(change):
            continue
        groups = before.reshape(-1, k).mean(axis=1)
        error = float(groups.std(ddof=1)) * math.sqrt(1 + 1 / len(groups))
        limit = error * float(stdtrit(len(groups) - 1, 1 - RELEASED_CHANCE / 2 / len(sizes)))
        # bursts as far off as this are no chance of a normal distribution
        limit = max(limit, BURST * float(np.abs(groups - groups.mean()).max()), NOISE_FLOOR * abs(change))
        if off > most * limit:
            lead, most = k, off / limit if limit > 0 else math.inf
    if not lead:
        return 0
    # from where the output is last within its noise, where that is longer ago
    middle = median(rest)
    noise = 1.4826 * median(np.abs(rest - middle))
    inside = np.flatnonzero(np.abs(hold - middle) <= max(REST_ERRORS * noise, NOISE_FLOOR * abs(change)))
    return max(lead, len(hold) - 1 - int(inside[-1]) if len(inside) else 0)


def without_spikes(hold: Array, change: float) -> tuple[Array, int]:
    """A hold without single samples that stand far out of it, and how many those are."""
    outliers = spikes(hold, 0.05 * abs(change))
    return (np.delete(hold, outliers), len(outliers)) if len(outliers) else (hold, 0)


def first_samples(active: Array) -> float:
    """Output at the start of a record that begins with its step: its first sample, or where noise counts a line through
    a few, so few that half of them lead to nearly the same: behind a bend a line does not lead back."""
    change = float(np.ptp(block_means(active)))
    noise = sample_noise(active)
    few = min(max(1, len(active) // 100), math.ceil((noise / (0.005 * change)) ** 2)) if change > 0 else 1
    while few >= 8 and abs(_led_back(active[:few]) - _led_back(active[: few // 2])) > BENT * noise / math.sqrt(few):
        few //= 2
    return float(active[0]) if few < 4 else _led_back(active[:few])


def _led_back(values: Array) -> float:
    """Where a line through some values begins."""
    return float(values.mean() - fit_line(np.arange(len(values)), values).slope * (len(values) - 1) / 2)
