"""The clock of a run: its usual sample time, gaps, jitter. Repeats that share a time axis are judged once."""

from dataclasses import dataclass, field

import numpy as np

from eaid.arrays import Array, median
from eaid.steps.noise import LONG, sample_steps

SAME = 2e-3
"""Share of the sample time within which sample instants count as equal: the rounding of written times."""
JITTER = 0.2
"""Spread of the sample time, as a share of the usual one, above which it is told."""


@dataclass(frozen=True)
class Clock:
    """What is to be known of a time axis."""

    usual_s: float
    """Median sample time [s]."""
    longest_s: float
    """Longest sample time [s]."""
    longest_at: int
    """The sample that it follows."""
    spread_s: tuple[float, float] | None
    """Sample times that 1 % are below and 1 % above [s]; None where they are closer than `JITTER`."""


def clock_of(time_s: Array) -> Clock:
    """The clock of a strictly rising time axis, shape (n,), n ≥ 2."""
    gaps = sample_steps(time_s)
    usual = median(gaps)
    every = np.diff(time_s) if len(time_s) >= LONG else gaps
    at = int(every.argmax())
    spread = None
    if gaps.max() - gaps.min() > JITTER * usual:
        low, high = np.quantile(gaps, (0.01, 0.99)).tolist()
        spread = (low, high) if high - low > JITTER * usual else None
    return Clock(usual, float(every[at]), at, spread)


def uniform_step(time_s: Array) -> float | None:
    """Sample time [s] of an axis that starts at 0 and is k·dt to `SAME`; None where it is not."""
    count = len(time_s)
    if count < 2:
        return None
    first = float(time_s[0])
    dt = (float(time_s[-1]) - first) / (count - 1)
    off = np.arange(count) * dt
    off += first
    off -= time_s
    if not max(off.max(), -off.min()) <= SAME * dt:
        return None
    tidy = float(f"{dt:.6g}")
    return tidy if abs(tidy - dt) * count <= SAME * dt else dt


@dataclass(frozen=True, eq=False)
class Window:
    """The time axis from a step on."""

    time_s: Array
    """Time since the step [s], from 0."""
    step_s: float | None
    """Its sample time where it is uniform."""


@dataclass(frozen=True, eq=False)
class Clocks:
    """Clocks and windows of time axes, found once for all runs that share one."""

    _clocks: dict[tuple[int, ...], tuple[Array, Clock]] = field(default_factory=dict)
    _windows: dict[tuple[int, ...], tuple[Array, Window]] = field(default_factory=dict)

    def clock(self, time_s: Array) -> Clock:
        """The clock of a whole axis."""
        key = _place(time_s)
        if key not in self._clocks:
            self._clocks[key] = (time_s, clock_of(time_s))  # the array is kept: its place stays its own
        return self._clocks[key][1]

    def window(self, time_s: Array, start: int) -> Window:
        """The axis from sample `start` on; of a long one, or of too many, anew each time: memory has an end."""
        part = time_s[start:]
        key = _place(part)
        if key not in self._windows:
            since = part - float(part[0])
            since.flags.writeable = False
            window = Window(since, uniform_step(since))
            held = sum(len(kept) for kept, _ in self._windows.values())
            if len(time_s) >= LONG or held + len(part) > LONG:
                return window
            self._windows[key] = (part, window)
        return self._windows[key][1]


def _place(array: Array) -> tuple[int, ...]:
    """Where an array lies in memory, its length, and how far apart its values are."""
    return array.__array_interface__["data"][0], len(array), *array.strides
