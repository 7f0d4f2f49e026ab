"""A cut run from its step on: clock, rise, idle, swing, torque lost under hold, left after release (Fig. 6), and
where a loaded contact slips: peak, level after it, stiffness of the loading.

At constant speed v the displacement is v·t, so a stiffness per second over v is one per metre; where the position was
recorded, both are given over the displacement.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from eaid.arrays import Array, median, read_only
from eaid.logs.run import Run
from eaid.steps.noise import STANDARD_ERRORS, block_error, block_means, fit_line

SAME_INSTANT = 2e-3  # Share of the sample time within which instants count as equal: the rounding of written times
GAP_ROWS = 5.0  # Usual rows from which a stretch without any is a gap
OVER = 0.05  # Share by which a peak has to exceed the level after it to be a slip
PEAK_PART, SLIP_PART = 50, 200  # A peak, or a slip, is looked for on means over this part of the record


def usual_step(time_s: Array) -> float:
    """Median sample time [s] of an axis of two samples or more."""
    return median(np.diff(time_s))


def uniform_step(time_s: Array) -> float | None:
    """Sample time [s] of an axis that is t_0 + k·dt to a part `SAME_INSTANT` of dt; None where it is not."""
    count = len(time_s)
    if count < 2:
        return None
    dt = float(time_s[-1] - time_s[0]) / (count - 1)
    if np.abs(time_s - (time_s[0] + np.arange(count) * dt)).max() > SAME_INSTANT * dt:
        return None
    tidy = float(f"{dt:.6g}")
    return tidy if abs(tidy - dt) * count <= SAME_INSTANT * dt else dt


def sample_at(run: Run, at_s: float) -> int:
    """First sample at or behind an instant of a log, but for rounding."""
    return int(np.searchsorted(run.time_s, at_s - 1e-9 * max(1.0, abs(at_s))))


@dataclass(frozen=True, eq=False)
class Cut:
    """A cut run from its step on: what the checks look at."""

    run: Run
    sign: float = 1.0  # Sign that makes the set's torque positive

    @cached_property
    def start(self) -> int:
        """First sample of the active window, which lasts to the end of the run."""
        return sample_at(self.run, self.run.step_s or 0.0)

    @cached_property
    def usual_s(self) -> float:
        """Median sample time of the whole run [s]."""
        return usual_step(self.run.time_s)

    @cached_property
    def time_s(self) -> Array:
        """Time in the active window [s], from 0 at the step."""
        active = self.run.time_s[self.start :]
        return read_only(active - active[0])

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


class Hold(NamedTuple):
    """Peak and end of the runs of one level."""

    at: int  # The sample where the mean of the runs has its peak
    peak: Array  # There, means over a fiftieth of the record, shape (R,)
    held: Array  # Means of the last tenth, shape (R,)

    @property
    def lost_pct(self) -> float:
        """Output lost while the input is held, peak to held [% of the peak], mean of the runs."""
        shares = 1 - self.held[self.peak > 0] / self.peak[self.peak > 0]
        return max(0.0, 100.0 * float(shares.mean())) if len(shares) else 0.0


def hold_of(runs: Array) -> Hold:
    """Peak and end of runs on one clock, shape (R, n), that rise."""
    smooth = moving_means(runs, max(1, runs.shape[1] // PEAK_PART))
    at = int(smooth.mean(axis=0).argmax())
    return Hold(at, smooth[:, at], runs[:, -max(1, runs.shape[1] // 10) :].mean(axis=1))


def moving_means(runs: Array, width: int) -> Array:
    """Centred moving means over so many samples, fewer at the ends, shape of `runs`."""
    before, behind, n = (width - 1) // 2, width // 2, runs.shape[1]
    sums = np.zeros((len(runs), before + n + 1 + behind))
    np.cumsum(runs, axis=1, out=sums[:, before + 1 : before + n + 1])
    sums[:, before + n + 1 :] = sums[:, before + n, None]
    counts = np.minimum(np.arange(n) + behind + 1, n) - np.maximum(np.arange(n) - before, 0)
    return np.asarray((sums[:, width:] - sums[:, :n]) / counts)


def whole_means(values: Array, parts: int) -> Array:
    """Moving means over that part of the record, along the last axis; none over fewer samples at its ends."""
    width = max(1, values.shape[-1] // parts)
    sums = np.cumsum(np.concatenate([np.zeros((*values.shape[:-1], 1)), values], axis=-1), axis=-1)
    return np.asarray((sums[..., width:] - sums[..., :-width]) / width)


def left_pct(step: Cut) -> float:
    """Torque left at the end of a release [% of the held torque], by block means."""
    return 100.0 * float(block_means(step.rise)[-1]) / step.swing if step.swing > 0 else 0.0


@dataclass(frozen=True)
class SlipTest:
    """One slip, in the output's unit; displacements are None where the speed is not known."""

    peak: float
    peak_s: float  # Time of the peak since the step [s]
    after: float  # Level after the slip: mean of the last quarter
    stiffness_per_s: float  # Slope of the loading between 20 and 80 % of the peak [output unit per s]
    # Displacement from the step to the peak [unit of the position]; None where no position was recorded
    moved: float | None = None
    stiffness: float | None = None  # Slope of the loading over the displacement [output unit per unit of the position]
    unit: str = ""  # Unit of the position


def slip_of(step: Cut) -> SlipTest | None:
    """The slip of a cut run that rises from rest; None where its peak does not stand out of what follows.

    Where the position is known each stroke slips, whether it peaks or not: its displacement says when.
    """
    if step.run.edge != "rising" or step.run.from_level != 0:
        return None
    time_s, rise = step.time_s, step.rise
    position = None if step.run.position is None else step.run.position[step.start :]
    count = len(rise)
    if count < 80:
        return None
    smooth = whole_means(rise, SLIP_PART)
    at = int(smooth.argmax())
    after = float(rise[-(count // 4) :].mean())
    peak, error = float(smooth[at]), block_error(rise) * np.sqrt(10)
    peaks = 0 < at < 0.9 * count and peak - after >= max(OVER * peak, STANDARD_ERRORS * error)
    if not (peaks or position is not None) or peak <= 0 or after <= 0:
        return None
    middle = at + max(1, count // SLIP_PART) // 2
    low = int(np.argmax(smooth >= 0.2 * peak))
    high = max(int(np.argmax(smooth >= 0.8 * peak)), low + 1)
    stiffness = fit_line(time_s[low : high + 1], smooth[low : high + 1]).slope
    moved = over = None
    if position is not None:
        moved = abs(float(position[middle] - position[0]))
        loaded = abs(float(position[high] - position[low]))
        over = stiffness * float(time_s[high] - time_s[low]) / loaded if loaded > 0 else None
    return SlipTest(peak, float(time_s[middle]), after, stiffness, moved, over, step.run.position_unit)
