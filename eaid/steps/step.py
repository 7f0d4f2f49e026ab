"""One cut run seen from its step on: clock, rise, idle, swing, torque lost under hold, left after release (Fig. 6)."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from eaid.arrays import Array, median, read_only
from eaid.logs.run import Run
from eaid.steps.noise import LONG, block_means, sampled

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
    gaps = np.diff(sampled(time_s))  # of a long record a few are leaps between stretches: no quantile sees them
    usual = median(gaps)
    every = np.diff(time_s) if len(time_s) >= LONG else gaps
    at = int(every.argmax())
    spread = None
    if gaps.max() - gaps.min() > JITTER * usual:
        low, high = np.quantile(gaps, (0.01, 0.99)).tolist()
        spread = (low, high) if high - low > JITTER * usual else None
    return Clock(usual, float(every[at]), at, spread)


def uniform_step(time_s: Array, within: float = SAME) -> float | None:
    """Sample time [s] of an axis that is t_0 + k·dt to that share of dt; None where it is not."""
    count = len(time_s)
    if count < 2:
        return None
    dt = float(time_s[-1] - time_s[0]) / (count - 1)
    if np.abs(time_s - (time_s[0] + np.arange(count) * dt)).max() > within * dt:
        return None
    tidy = float(f"{dt:.6g}")
    return tidy if abs(tidy - dt) * count <= SAME * dt else dt


def sample_at(run: Run, at_s: float) -> int:
    """First sample at or behind an instant of a log, but for rounding."""
    return int(np.searchsorted(run.time_s, at_s - 1e-9 * max(1.0, abs(at_s))))


@dataclass(frozen=True, eq=False)
class Step:
    """One cut run seen from its step on: what the checks look at."""

    run: Run
    sign: float = 1.0
    """Sign that makes the set's torque positive."""

    @cached_property
    def start(self) -> int:
        """First sample of the active window, which lasts to the end of the run."""
        return sample_at(self.run, self.run.step_s or 0.0)

    @cached_property
    def clock(self) -> Clock:
        """The clock of the whole run."""
        return clock_of(self.run.time_s)

    @cached_property
    def time_s(self) -> Array:
        """Time in the active window [s], from 0 at the step."""
        active = self.run.time_s[self.start :]
        return read_only(active - active[0])

    @cached_property
    def uniform_s(self) -> float | None:
        """Sample time of the active window [s]; None where it is not uniform."""
        return uniform_step(self.time_s)

    @cached_property
    def rise(self) -> Array:
        """Output relative to the idle baseline in the active window, its sign as the step's."""
        return self.sign * (self.run.output[self.start :] - (self.run.baseline or 0.0))

    @cached_property
    def idle(self) -> Array:
        """Output relative to the baseline before the step."""
        return self.sign * (self.run.output[: self.start] - (self.run.baseline or 0.0))

    @property
    def before(self) -> float | None:
        """Output just before the edge, relative to the baseline; None where nothing is recorded before it."""
        return None if self.run.held is None else self.sign * (self.run.held - (self.run.baseline or 0.0))

    @cached_property
    def swing(self) -> float:
        """How far the output goes, at least 0: its largest block mean, or the held one of a release."""
        falls_from = self.before if self.run.edge == "falling" else None
        return max(float(block_means(self.rise).max()) if falls_from is None else falls_from, 0.0)

    @property
    def levels(self) -> tuple[float]:
        """The size of its level, for a finding."""
        return (abs(self.run.level or 0.0),)

    @property
    def unit(self) -> str:
        """Unit of the output."""
        return self.run.output_unit


def lost_pct(step: Step) -> float:
    """Torque lost while the input is held, peak to end [% of the peak], by block means."""
    means = block_means(step.rise)
    peak = float(means.max())
    return max(0.0, 100.0 * (peak - float(means[-1])) / peak) if peak > 0 else 0.0


def left_pct(step: Step) -> float:
    """Torque left at the end of a release [% of the held torque], by block means."""
    return 100.0 * float(block_means(step.rise)[-1]) / step.swing if step.swing > 0 else 0.0
