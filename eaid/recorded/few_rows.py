"""A log as the kernel takes it: every sample, and a few thousand rows that cost what the log costs.

Where the input is held the few rows are Gauss nodes of blocks on which the response is a polynomial, and the sum of
squares is the log's own (`compress_held`, as of step fits); where it moves all the time, samples are averaged over
equal blocks.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from eaid.estimate.points import LONGEST_BLOCK, nodes_of
from eaid.estimate.recorded_log import RecordedLog
from eaid.plant.drive import ROW_NUMBER, Drive

MOVING_ROWS = 6_000  # Blocks of an input that moves all the time, at most
BINS = 16_384  # In which derivatives and residuals of a log are added up for its intervals, at most
WORTH_BLOCKS = 64  # Rows of a bin from which blocks as long stand for them


@dataclass(frozen=True, eq=False)
class Copies:
    """A log, and fewer rows that cost what it costs, made when they are asked for."""

    log: RecordedLog
    dead_time_s: float = 0.0  # Near which a fit's θ lies [s]: the few rows are exact for it and some samples about it

    @cached_property
    def small(self) -> Drive:
        """Some thousand rows that cost what the log costs, exactly where its input is held."""
        return compress_held(self.log, self.dead_time_s) if self.log.stepwise else average_moving(self.log)

    @cached_property
    def in_bins(self) -> Drive | None:
        """The same of a long log whose input is held, with blocks no longer than one of its `BINS`; None of others."""
        step = -(-len(self.log.input) // BINS)
        worth = self.log.stepwise and step >= WORTH_BLOCKS
        return compress_held(self.log, self.dead_time_s, 2 ** int(np.log2(step))) if worth else None


EARLIER = 4  # Samples before a delayed change from which single ones are kept


def compress_held(log: RecordedLog, dead_time_s: float, longest: int = LONGEST_BLOCK) -> Drive:
    """A log whose input is held, in Gauss nodes of blocks that double in length from where each change acts.

    What it costs is what the log costs, as far as the response is a polynomial on each block; the first rows of each
    hold stay as they are, and so do blocks with an output that is not known.
    """
    every, t, after_s = log.drive, log.time_s, dead_time_s - log.late_s
    known, acts = every.w > 0, log.changes
    if after_s != 0:
        later = np.searchsorted(t, t[acts[1:]] + after_s) - EARLIER
        acts = np.unique(np.clip(np.append(0, later), 0, len(t) - 1))
    at, y, w = nodes_of(t, every.y, np.append(acts, len(t)), log.even_s, known, longest)
    w = log.weight * w
    if after_s != 0:  # where the input changes, a row that is not compared says so
        new = np.setdiff1d(t[log.changes], at)
        place = np.searchsorted(at, new)
        at, y, w = (np.insert(one, place, more) for one, more in ((at, new), (y, 0.0), (w, 0.0)))
    row = np.searchsorted(t, at, side="right") - 1
    left = log.weight * float(every.y @ every.y) - float(w @ (y * y))
    dt_s = np.append(np.diff(at), t[-1] - at[-1])
    return every._replace(dt_s=dt_s, which=every.which[row], rising=every.rising[row], y=y, w=w, left=max(left, 0.0))


def average_moving(log: RecordedLog) -> Drive:
    """A log whose input moves all the time, over equal blocks: each the mean output at its middle, the mean input."""
    n, t, every = len(log.input), log.time_s, log.drive
    if n <= MOVING_ROWS or not every.w.all():
        return every
    starts = np.arange(0, n, -(-n // MOVING_ROWS))
    size = np.diff(np.append(starts, n))
    span = np.append(np.diff(t[starts]), t[-1] - t[starts[-1]])
    acted = np.add.reduceat(log.input * log.dt_s, starts)
    level = np.where(span > 0, acted / np.where(span > 0, span, 1.0), log.input[starts])
    at = np.stack([t[starts], np.add.reduceat(t, starts) / size], axis=1).ravel()
    duty, index = np.unique(level, return_inverse=True)
    return every._replace(
        dt_s=np.append(np.diff(at), 0.0), which=np.repeat(index, 2).astype(ROW_NUMBER), duty=duty, paces=duty,
        rising=np.ones(len(at), dtype=ROW_NUMBER), y=np.repeat(np.add.reduceat(every.y, starts) / size, 2),
        w=np.stack([0.0 * size, log.weight * size], axis=1).ravel(),
    )  # fmt: skip
