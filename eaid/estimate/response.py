"""A log in numbers for the kernel: time steps, an index into its different inputs, outputs and their weights.

A few thousand rows stand in for a long log while its fit is looked for. Where the input is held they are Gauss nodes
of blocks on which the response is a polynomial, and the sum of squares is the log's own (`compressed`, as with the
step fits); where it moves all the time, samples are averaged over equal blocks.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from eaid.arrays import Array, read_only
from eaid.estimate.forms import Tables
from eaid.estimate.points import nodes_of
from eaid.logs.run import Run
from eaid.steps.noise import sample_noise
from eaid.steps.stepset import StepSet

IDLE_ROWS = 10  # Fewest rows at rest before the first other one that make an idle start
ROUNDED = 1e-8  # Steps of time that differ by less than this part are alike
QUIET = 5e-3  # An input below rest by this part of its largest, or …
NOISY = 6.0  # … so many deviations of its noise …
MOST = 0.05  # … up to this part, is a noisy rest, …
AROUND = 1.5  # … and what is nearer to rest than so many times that is at rest too


@dataclass(frozen=True, eq=False)
class RecordedLog:
    """One log as it was recorded; arrays of shape (n,), time strictly rising."""

    name: str
    time_s: Array
    input: Array  # Duty (force, speed), counted from rest, ≥ 0; each value held until the next row
    output: Array  # Torque, or whatever was recorded, as measured
    reference: Array | None = None  # What a closed loop was to follow, in the output's unit; None: the log has none
    baseline: float | None = None  # Idle output, where it is known; None: an unknown of the fit
    # Whether it begins at rest with nothing left in its states; None: judged by its first rows
    idle_start: bool | None = None
    weight: float = 1.0  # Weight of each squared residual: R for the mean of R repeats
    source: str = ""
    sha256: str = ""

    @cached_property
    def starts_idle(self) -> bool:
        """Both states are 0 at the first row."""
        if self.idle_start is not None:
            return self.idle_start
        acting = np.flatnonzero(self.input != 0)
        return len(acting) > 0 and int(acting[0]) >= min(IDLE_ROWS, len(self.input) - 1)

    @cached_property
    def even_s(self) -> float | None:
        """Time from row to row [s] where only rounding tells the steps apart, else None."""
        steps = np.diff(self.time_s)
        usual = float(self.time_s[-1] - self.time_s[0]) / len(steps)
        return usual if max(float(steps.max()) - usual, usual - float(steps.min())) <= ROUNDED * usual else None

    @cached_property
    def dt_s(self) -> Array:
        """How long each row's input acts [s]; 0 after the last. Steps that only rounding tells apart are one."""
        if self.even_s is not None:
            found = np.full(len(self.time_s), self.even_s)
            found[-1] = 0.0
            return read_only(found)
        steps = np.diff(self.time_s)
        usual = float(np.median(steps))
        return read_only(np.append(np.where(np.abs(steps - usual) <= ROUNDED * usual, usual, steps), 0.0))

    @cached_property
    def changes(self) -> NDArray[np.intp]:
        """Rows from which another input acts, the first row among them."""
        return np.append(0, np.flatnonzero(self.input[1:] != self.input[:-1]) + 1)

    @property
    def stepwise(self) -> bool:
        """Whether its input is held for eight rows and more on the average."""
        return 8 * len(self.changes) <= len(self.input)

    @property
    def saturated(self) -> float:
        """Part of the acting time that the input stands at its largest value."""
        top = float(self.input.max())
        acting = float(self.dt_s[self.input > 0].sum())
        at_top = float(self.dt_s[self.input >= top * (1 - 1e-9)].sum())
        return at_top / acting if acting > 0 and at_top > 2 * float(np.median(self.dt_s)) else 0.0


def recorded_log(run: Run, rest: float = 0.0) -> RecordedLog:
    """A run of the reader as a recorded log: input counted from rest, an input that only falls below it turned up."""
    level = run.input - rest
    if level.min() < 0 and -level.min() > level.max():
        level = -level
    top, below = float(level.max()), -float(level.min())
    if 0 < below <= min(max(QUIET * top, NOISY * sample_noise(level)), MOST * top):
        level = np.where(np.abs(level) <= AROUND * below, 0.0, level)
    return RecordedLog(
        run.name,
        run.time_s,
        read_only(level),
        run.output,
        run.reference_nm,
        run.baseline,
        source=run.source,
        sha256=run.sha256,
    )


def logs_of_steps(steps: StepSet) -> list[RecordedLog]:
    """The mean curves of a step set as logs: from rest, idle output subtracted, each sample of each repeat counted."""
    logs = []
    for level in steps.levels:
        t, y = level.time_s, level.mean
        if t[0] > 0:  # the input acts from 0 on
            t, y = np.append(0.0, t), np.append(np.nan, y)
        name, held = level.names[0] if level.names else f"{level.level:g}", np.full(len(t), level.level)
        weight = float(len(level.runs))
        logs.append(RecordedLog(name, t, held, y, baseline=0.0, idle_start=True, weight=weight))
    return logs


Integers = NDArray[np.int64]

SHARE, REST, FALL, EXCESS, IDLE, START = 0, 1, 3, 5, 6, 7


@numba.njit(cache=True, error_model="numpy")
def acting_tau(tau: float, off: float, rest: float, at_rest: float, factor: float) -> tuple[float, float, float, float]:
    """τ of a state that lies `off` above its target, and its derivatives by the τ of rises, `at_rest` and `factor`."""
    if off > 0.0 and rest >= 1.0:
        return tau * factor, factor, 0.0, tau
    if off > 0.0 and at_rest > 0.0:
        return rest * tau + (1.0 - rest) * at_rest, rest, 1.0 - rest, 0.0
    return tau, 1.0, 0.0, 0.0


MOVING_ROWS = 6_000  # Blocks of an input that moves all the time, at most


class Drive(NamedTuple):
    """What drives the model, and what it is compared with, as the kernels take it; shapes (n,) but for `duty`."""

    dt_s: Array  # How long a row's input acts [s]; 0 after the last
    which: Integers  # Which of `duty` acts
    duty: Array  # The different inputs, shape (m,)
    rising: Integers  # −1 while an input is held to which the log fell from a higher one, else 1
    y: Array
    w: Array  # Weights; 0: a row that is not compared
    idle_known: bool
    starts_idle: bool
    left: float = 0.0  # Squares that no response of these rows can take away

    @property
    def samples(self) -> int:
        """Rows that are compared."""
        return int(np.count_nonzero(self.w))


@dataclass(frozen=True, eq=False)
class Copies:
    """A log in numbers: every sample, and fewer rows that cost what the log costs; each made when it is asked for."""

    log: RecordedLog

    @cached_property
    def every(self) -> Drive:
        """Every row; one whose output is not finite is passed through and not compared."""
        log, at = self.log, self.log.changes
        level, lasts, rising = log.input[at], np.diff(np.append(at, len(log.input))), np.ones(len(at), dtype=np.int64)
        if log.stepwise:
            rising[1:][(level[1:] < level[:-1]) & (level[1:] > 0)] = -1
        duty, index = np.unique(level, return_inverse=True)
        above, known = log.output - (log.baseline or 0.0), np.isfinite(log.output)
        return Drive(
            np.array(log.dt_s), np.repeat(index.astype(np.int64), lasts), duty, np.repeat(rising, lasts),
            np.where(known, above, 0.0), np.where(known, log.weight, 0.0), log.baseline is not None, log.starts_idle,
        )  # fmt: skip

    @cached_property
    def small(self) -> Drive:
        """Some thousand rows that cost what the log costs, exactly where its input is held."""
        return compressed(self.log, self.every) if self.log.stepwise else averaged(self.log, self.every)


def compressed(log: RecordedLog, every: Drive) -> Drive:
    """A log whose input is held, in Gauss nodes of blocks that double in length from each change on.

    What it costs is what the log costs, as far as the response is a polynomial on each block; the first rows of each
    hold stay as they are, and so do blocks with an output that is not known.
    """
    known, t = every.w > 0, log.time_s
    at, y, w = nodes_of(t, every.y, np.append(log.changes, len(t)), log.even_s, known)
    w = log.weight * np.where(np.isin(at, t[~known]), 0.0, w)
    row = np.searchsorted(t, at, side="right") - 1
    left = log.weight * float(every.y @ every.y) - float(w @ (y * y))
    dt_s = np.append(np.diff(at), t[-1] - at[-1])
    return every._replace(dt_s=dt_s, which=every.which[row], rising=every.rising[row], y=y, w=w, left=max(left, 0.0))


def averaged(log: RecordedLog, every: Drive) -> Drive:
    """A log whose input moves all the time, over equal blocks: each the mean output at its middle, the mean input."""
    n, t = len(log.input), log.time_s
    if n <= MOVING_ROWS or not every.w.all():
        return every
    starts = np.arange(0, n, -(-n // MOVING_ROWS))
    size = np.diff(np.append(starts, n))
    span = np.append(np.diff(t[starts]), t[-1] - t[starts[-1]])
    acted = np.add.reduceat(log.input * log.dt_s, starts)
    level = np.where(span > 0, acted / np.where(span > 0, span, 1.0), log.input[starts])
    middle = np.add.reduceat(t, starts) / size
    alone = size == 1
    at = np.stack([t[starts], middle], axis=1).ravel()
    weight = np.stack([np.where(alone, log.weight, 0.0), np.where(alone, 0.0, log.weight * size)], axis=1).ravel()
    kept = np.stack([np.ones_like(alone), ~alone], axis=1).ravel()
    duty, index = np.unique(level, return_inverse=True)
    return every._replace(
        dt_s=np.append(np.diff(at[kept]), 0.0),
        which=np.repeat(index, 2)[kept].astype(np.int64),
        duty=duty,
        rising=np.ones(int(kept.sum()), dtype=np.int64),
        y=np.repeat(np.add.reduceat(every.y, starts) / size, 2)[kept],
        w=weight[kept],
    )


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def derivatives(drive: Drive, tables: Tables, scalars: Array, place: Integers, count: int) -> Array:
    """√w times the derivatives by `count` unknowns, then √w times the residual, of the rows that count, (N, count + 1).

    The coefficients of T_s, τ1 and τ2 come first. `place` has the columns of `scalars`, (9,); what is no unknown has
    the column −1, the last, which nobody reads.
    """
    n_s, weights, share = tables.by_steady.shape[1], drive.w, scalars[SHARE]
    x, before, g, last_step = scalars[START:].copy(), np.zeros(2), np.zeros(2), 0.0
    sens = np.zeros((2, count + 1))
    sens[0, place[START]] = sens[1, place[START + 1]] = 1.0
    out, row = np.empty((np.count_nonzero(weights), count + 1)), 0
    for k in range(len(weights)):
        if weights[k] > 0.0:
            root = np.sqrt(weights[k])
            for j in range(count):
                out[row, j] = root * (sens[0, j] + sens[1, j])
            if place[IDLE] >= 0:
                out[row, place[IDLE]] = root
            out[row, count] = root * (x[0] + x[1] + scalars[IDLE] - drive.y[k])
            row += 1
        i, step, fallen = drive.which[k], drive.dt_s[k], drive.rising[k] < 0
        excess = 1.0 + scalars[EXCESS] if fallen else 1.0
        total, first = tables.steady[i] * excess, n_s
        for s in range(2):
            by_curve = tables.by_tau2 if s else tables.by_tau1
            part, risen = (1.0 - share, tables.tau2[i]) if s else (share, tables.tau1[i])
            off = x[s] - part * total
            tau, by_risen, by_rest, by_fall = acting_tau(
                risen, off, tables.rest[i], scalars[REST + s], scalars[FALL + s]
            )
            if tau != before[s] or step != last_step:
                g[s], before[s] = -np.expm1(-step / tau), tau
            by_tau = off * (1.0 - g[s]) * step / (tau * tau)
            for j in range(count + 1):
                sens[s, j] *= 1.0 - g[s]
            for j in range(n_s):
                sens[s, j] += g[s] * part * excess * tables.by_steady[i, j]
            for j in range(by_curve.shape[1]):
                sens[s, first + j] += by_tau * by_risen * by_curve[i, j]
            sens[s, place[SHARE]] += -g[s] * total if s else g[s] * total
            sens[s, place[REST + s]] += by_tau * by_rest
            sens[s, place[FALL + s]] += by_tau * by_fall
            if fallen:
                sens[s, place[EXCESS]] += g[s] * part * tables.steady[i]
            x[s] -= g[s] * off
            first += by_curve.shape[1]
        last_step = step
    return out
