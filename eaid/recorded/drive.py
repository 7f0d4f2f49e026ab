"""A log in numbers for the kernel: time steps, an index into its different inputs, outputs and their weights.

`coarse` stands a few thousand rows in for a long log while starts are compared: each block of samples becomes one row
at its middle, with the mean output and the block's weight. Blocks grow by a twentieth of the time since the last change
of a stepwise input; an input that moves all the time is averaged over equal blocks.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eaid.arrays import Array
from eaid.recorded.log import RecordedLog

GROWTH = 0.05
"""Part of the time since a change that a block may last."""
MOVING_ROWS = 6_000
"""Blocks of an input that moves all the time, at most."""
SKETCH = (0.2, 2_000)
"""Both, of a copy on which many starts are looked at."""


@dataclass(frozen=True, eq=False)
class Drive:
    """What drives the model, and what it is compared with; shapes (n,) but for `duty`."""

    dt_s: Array
    """How long a row's input acts [s]; 0 after the last."""
    index: NDArray[np.int64]
    """Which of `duty` acts."""
    duty: Array
    """The different inputs, shape (m,)."""
    rising: NDArray[np.int64]
    """−1 while an input is held to which the log fell from a higher one, else 1."""
    y: Array
    w: Array
    """Weights; 0: a row that is not compared."""
    idle_known: bool
    starts_idle: bool

    @property
    def samples(self) -> int:
        """Rows that are compared."""
        return int(np.count_nonzero(self.w))


def drive_of(log: RecordedLog) -> Drive:
    """Every row of a log; one whose output is not finite is passed through and not compared."""
    duty, index = np.unique(log.input, return_inverse=True)
    known = np.isfinite(log.output)
    return Drive(
        np.array(log.dt_s),
        index.astype(np.int64),
        duty,
        directions(log),
        np.where(known, log.output - (log.baseline or 0.0), 0.0),
        np.where(known, log.weight, 0.0),
        log.baseline is not None,
        log.starts_idle,
    )


def directions(log: RecordedLog) -> NDArray[np.int64]:
    """−1 where a stepwise input came from above and is not at rest, else 1, shape (n,)."""
    held = np.ones(len(log.input), dtype=np.int64)
    if not log.stepwise:
        return held
    at = log.changes
    level = log.input[at]
    down = np.append(False, level[1:] < level[:-1]) & (level > 0)
    return np.repeat(np.where(down, -1, 1), np.diff(np.append(at, len(held))))


def coarse(log: RecordedLog, growth: float = GROWTH, moving: int = MOVING_ROWS) -> Drive:
    """A log of some thousand rows that costs nearly what the log costs, but for a constant."""
    n = len(log.input)
    if n <= moving // 4 or not np.isfinite(log.output).all():
        return drive_of(log)
    starts = _growing(log.changes, n, growth) if log.stepwise else np.arange(0, n, -(-n // moving))
    size = np.diff(np.append(starts, n))
    t, y = log.time_s, log.output - (log.baseline or 0.0)
    middle = np.add.reduceat(t, starts) / size
    mean = np.add.reduceat(y, starts) / size
    if log.stepwise:
        level, way = log.input[starts], directions(log)[starts]
    else:
        ends = np.append(t[starts[1:]], t[-1])
        acted = np.add.reduceat(log.input * log.dt_s, starts)
        span = np.where(ends > t[starts], ends - t[starts], 1.0)
        level = np.where(ends > t[starts], acted / span, log.input[starts])
        way = np.ones(len(starts), dtype=np.int64)
    alone = size == 1
    at = np.stack([t[starts], middle], axis=1).ravel()
    weight = np.stack([np.where(alone, log.weight, 0.0), np.where(alone, 0.0, log.weight * size)], axis=1).ravel()
    kept = np.stack([np.ones_like(alone), ~alone], axis=1).ravel()
    at, weight = at[kept], weight[kept]
    duty, index = np.unique(level, return_inverse=True)
    return Drive(
        np.append(np.diff(at), 0.0),
        np.repeat(index, 2)[kept].astype(np.int64),
        duty,
        np.repeat(way, 2)[kept],
        np.repeat(mean, 2)[kept],
        weight,
        log.baseline is not None,
        log.starts_idle,
    )


def _growing(changes: NDArray[np.intp], n: int, growth: float) -> NDArray[np.intp]:
    """First rows of blocks that grow from each change to the next."""
    holds = np.diff(np.append(changes, n))
    cuts, at = [0], 0
    while at < holds.max():
        at += max(1, int(growth * at))
        cuts.append(at)
    grid = np.array(cuts)
    return np.concatenate(
        [first + grid[: np.searchsorted(grid, hold)] for first, hold in zip(changes, holds, strict=True)]
    )
