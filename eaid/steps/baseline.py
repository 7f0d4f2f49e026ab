"""The value from which a step starts: the mean of the last rest before that very step.

A hold before a step rests where its last quarter has the mean of the whole, to 1 % of the step's change or four
standard errors. Where the whole does not rest, its last half, quarter, eighth are tried, then the stretches that end
before the step (the output then moves before the input does), then a straight line through the last eighth.
"""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from eaid.arrays import Array, median
from eaid.errors import UsageError
from eaid.steps.noise import block_means, block_noise, sample_noise, spikes
from eaid.steps.plateaus import FEWEST

STEADY = 0.01
"""Share of a step's change by which the last quarter of a rest may differ from the whole of it."""
SURE = 4.0
"""Standard errors beyond which a rest is said to move."""


@dataclass(frozen=True)
class BaselineRule:
    """What the user says about the value before a step."""

    how: Literal["auto", "first", "none", "value", "window"] = "auto"
    value: float = 0.0
    window_s: tuple[float, float] = (0.0, 0.0)
    """From and to, in seconds relative to the step."""


def baseline_rule(text: str) -> BaselineRule:
    """`auto`, `first`, `none`, a number, or `FROM:TO`; raises UsageError for anything else."""
    said = text.strip().lower()
    if said == "auto":
        return BaselineRule()
    if said == "first":
        return BaselineRule("first")
    if said == "none":
        return BaselineRule("none")
    try:
        numbers = [float(part) for part in said.split(":")]
    except ValueError:
        numbers = []
    if not numbers or len(numbers) > 2 or not all(map(math.isfinite, numbers)):
        raise UsageError(
            f"«baseline» {text}: write auto, first, none, a value in the output's unit, or FROM:TO in seconds relative "
            "to the step, as -2:-0.5"
        )
    if len(numbers) == 1:
        return BaselineRule("value", numbers[0])
    if numbers[0] >= numbers[1]:
        raise UsageError(f"«baseline» {text}: FROM must be below TO")
    return BaselineRule("window", window_s=(numbers[0], numbers[1]))


@dataclass(frozen=True)
class Rest:
    """The rest before a step."""

    value: float
    """Mean of the rest, or where nothing rests the output just before the step, by a straight line."""
    start: float
    """Output just before the step."""
    rests: bool = True
    """False where the output moves right up to the step."""
    lead: int = 0
    """Samples by which the output leaves its rest before the step."""
    left_out: int = 0
    """Spikes that were left out of the mean."""


def moves(part: Array, change: float) -> float:
    """How far the last quarter of a stretch lies from its mean; 0 where that is nothing beside noise or the change."""
    if len(part) < FEWEST:
        return 0.0
    off = float(part[-(len(part) // 4) :].mean() - part.mean())
    means = block_means(part, 80)
    error = block_noise(means) * math.sqrt(3 / len(means))
    return off if abs(off) > max(STEADY * abs(change), SURE * error) else 0.0


def last_rest(hold: Array, change: float) -> Rest:
    """The last rest of a hold that a step ends, from its output, shape (n,), n ≥ 1, and the change that follows."""
    hold, left_out = without_spikes(hold, change)
    count = len(hold)
    size = count
    while size >= max(FEWEST, count // 8):
        part = hold[-size:]
        if moves(part, change) == 0.0:
            return _left_early(part, change, left_out)
        size //= 2
    if count < FEWEST:
        return Rest(float(hold.mean()), _end(hold), left_out=left_out)
    lead = 2
    while count - lead >= max(2 * FEWEST, count // 2):
        part = hold[: count - lead]
        if moves(part, change) == 0.0:
            lead = max(2, _lead(hold, part, change))
            return _departed(hold, lead, left_out)
        lead *= 2
    tail = hold[-max(FEWEST, count // 8) :]
    at = np.arange(len(tail)) - (len(tail) - 1) / 2
    start = float(tail.mean() + (at @ tail) / (at @ at) * (len(tail) / 2))
    return Rest(start, start, False, 0, left_out)


def _left_early(part: Array, change: float, left_out: int) -> Rest:
    """A rest that lasts until the step, or until the few samples before it with which the output leaves it."""
    lead = _lead(part, part, change)
    if lead < 2 or len(part) - lead < FEWEST:
        return Rest(float(part.mean()), _end(part), left_out=left_out)
    return _departed(part, lead, left_out)


def _lead(hold: Array, rest: Array, change: float) -> int:
    """Samples of a hold since its output was last at its rest, within its noise or 2 % of the change."""
    middle = median(rest)
    noise = 1.4826 * median(np.abs(rest - middle))
    inside = np.flatnonzero(np.abs(hold - middle) <= max(SURE * noise, 0.02 * abs(change)))
    lead = len(hold) - 1 - int(inside[-1]) if len(inside) else 0
    # in much noise the last few samples tell it together, where no such group of the rest before lies as far off
    few = [k for k in (2, 3, 4, 6, 8) if _stands_out(hold, rest, k, middle, noise, change)]
    return max(lead, *few) if few else lead


def _stands_out(hold: Array, rest: Array, k: int, middle: float, noise: float, change: float) -> bool:
    off = abs(float(hold[-k:].mean()) - middle)
    if off <= max(5 * noise / math.sqrt(k), 0.05 * abs(change)):
        return False
    before = rest[: len(rest) - 2 * k]
    groups = before[len(before) % k :].reshape(-1, k).mean(axis=1)
    return not len(groups) or off > 1.2 * float(np.abs(groups - middle).max())


def _departed(hold: Array, lead: int, left_out: int) -> Rest:
    """A rest that the output leaves some samples before the step."""
    start = float(hold[-max(1, lead // 6) :].mean())
    return Rest(float(hold[: len(hold) - lead].mean()), start, False, lead, left_out)


def _end(part: Array) -> float:
    return float(part[-max(1, len(part) // 20) :].mean())


def without_spikes(hold: Array, change: float) -> tuple[Array, int]:
    """A hold without single samples that stand far out of it, and how many those are."""
    found = spikes(hold, 0.05 * abs(change))
    return (np.delete(hold, found), len(found)) if len(found) else (hold, 0)


def first_samples(active: Array) -> float:
    """Output at the start of a record that begins with its step: its first sample, or where noise counts a few."""
    change = float(np.ptp(block_means(active)))
    noise = sample_noise(active)
    few = min(max(1, len(active) // 100), math.ceil((noise / (0.005 * change)) ** 2)) if change > 0 else 1
    if few < 4:
        return float(active[: max(1, few)].mean())
    at = np.arange(few) - (few - 1) / 2
    return float(active[:few].mean() - (at @ active[:few]) / (at @ at) * (few - 1) / 2)
