"""A log in numbers, as it was recorded: input counted from rest, output as measured, and what is known of its start."""

import itertools
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from eaid.arrays import Array, median, read_only, white_squares
from eaid.logs.run import Beside, Run
from eaid.plant.drive import ROW_NUMBER, Drive, moved_rows
from eaid.steps.noise import sample_noise
from eaid.steps.plateaus import plateaus, stands_still
from eaid.steps.step import GAP_ROWS
from eaid.steps.stepset import StepSet

JUMP = 5.0  # Times the usual change from row to row, beyond which an input that moves jumps
IDLE_ROWS = 10  # Fewest rows at rest before the first other one that make an idle start
SAME_TIME_STEP = 1e-8  # Steps of time that differ by less than this part are alike
MOST_PARTS, PART_ROWS = 8, 50  # Parts that gaps make of a log at most, and rows of each at least
NOISY_REST = 5e-3  # An input below rest by this part of its largest, or …
NOISY = 6.0  # … so many deviations of its noise …
NOISY_REST_MOST = 0.05  # … up to this part, is a noisy rest, …
AROUND = 1.5  # … and what is nearer to rest than so many times that is at rest too
# Of an input that stands still but for its noise: what part of this is white, and for what part of the time; how far it
# may go with the output; and errors of their means by which levels differ that are one
MOSTLY_WHITE, MOST_WHITE, MOST_ANSWERED, ONE_LEVEL = 0.8, 0.8, 0.1, 4.0
# Of an output whose sensor ends: different values, and rows at the largest; how many times more these are than those at
# a value next to it; and the part of its range by which it comes there in one row
FEWEST_VALUES, FEWEST_AT_LIMIT, TIMES_MORE, LEAST_JUMP = 100, 20, 10, 1e-4


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
    others: Callable[[], Beside] = tuple  # Reads the columns beside it that move
    creep: tuple[float, float] = (0.0, 0.0)  # That was taken off the output, straight and bent (`creep_at`)
    drift: float = 0.0  # By which part its gain grew from begin to end, which was taken off its output
    jump: tuple[float, float] = (0.0, 0.0)  # Of its zero, taken off its output: when [s since its first row], how far
    limit: float | None = None  # Where its sensor ends: rows that stand there are not known; None: nowhere
    at_limit_pct: float = 0.0
    late_s: float = 0.0  # By which its input was noted late, a part of a row [s]

    @cached_property
    def of_one_level(self) -> bool:
        """Whether its input goes from rest to one level alone, as that of a step does."""
        held = self.input[self.input != 0]
        return len(held) > 0 and bool((held == held[0]).all())

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
        return usual if max(float(steps.max()) - usual, usual - float(steps.min())) <= SAME_TIME_STEP * usual else None

    @property
    def dt_s(self) -> Array:
        """How long each row's input acts [s]; 0 after the last. Steps that only rounding tells apart are one."""
        if self.even_s is not None:
            found = np.full(len(self.time_s), self.even_s)
            found[-1] = 0.0
            return found
        steps = np.diff(self.time_s)
        usual = median(steps)
        return np.append(np.where(np.abs(steps - usual) <= SAME_TIME_STEP * usual, usual, steps), 0.0)

    @cached_property
    def usual_s(self) -> float:
        """Usual time between two rows [s]."""
        return median(self.dt_s)

    @cached_property
    def changes(self) -> NDArray[np.intp]:
        """Rows from which another input acts, the first row among them."""
        return np.append(0, np.flatnonzero(self.input[1:] != self.input[:-1]) + 1)

    @cached_property
    def drive(self) -> Drive:
        """What drives the plant, row by row; one whose output is not finite is passed through and not compared."""
        at = self.changes
        level, lasts = self.input[at], np.diff(np.append(at, len(self.input)))
        rising = np.ones(len(at), dtype=ROW_NUMBER)
        if self.stepwise:
            rising[1:][(level[1:] < level[:-1]) & (level[1:] > 0)] = -1
        duty, index = np.unique(level, return_inverse=True)
        paces = duty
        if self.stepwise:
            left = np.where(level == 0, np.append(0.0, level[:-1]), level)
            both, index = np.unique([level, left], axis=1, return_inverse=True)
            duty, paces = np.ascontiguousarray(both)
        above, known = self.output - (self.baseline or 0.0), np.isfinite(self.output)
        return Drive(
            self.dt_s, np.repeat(index.ravel().astype(ROW_NUMBER), lasts), duty, paces, np.repeat(rising, lasts),
            np.where(known, above, 0.0), np.where(known, self.weight, 0.0), self.baseline is not None, self.starts_idle,
            late_s=self.late_s,
        )  # fmt: skip

    @property
    def stepwise(self) -> bool:
        """Whether its input is held for eight rows and more on the average."""
        return 8 * len(self.changes) <= len(self.input)

    @property
    def saturated(self) -> float:
        """Part of the acting time that the input stands at its largest value."""
        size = np.abs(self.input)
        acting = float(self.dt_s[size > 0].sum())
        at_top = float(self.dt_s[size >= size.max() * (1 - 1e-9)].sum())
        return at_top / acting if acting > 0 and at_top > 2 * self.usual_s else 0.0


def recorded_log(run: Run, rest: float = 0.0) -> RecordedLog:
    """A run of the reader as a recorded log: input counted from rest; one that only falls below it is turned up, unless
    the output falls with it."""
    level = run.input - rest if run.reference_nm is not None else hold_measured(run.input - rest, run.output)
    if level.min() < 0 and level.max() <= NOISY_REST_MOST * -level.min():
        falls = float(np.nansum((level - level.mean()) * (run.output - np.nanmean(run.output)))) > 0
        level = level if falls else -level
    top, below = float(level.max()), -float(level.min())
    if 0 < below <= min(max(NOISY_REST * top, NOISY * sample_noise(level)), NOISY_REST_MOST * top):
        level = np.where(np.abs(level) <= AROUND * below, 0.0, level)
    log = RecordedLog(
        run.name, run.time_s, read_only(level), run.output, run.reference_nm, run.baseline, source=run.source,
        sha256=run.sha256, others=run.others,
    )  # fmt: skip
    if run.reference_nm is not None or not (there := at_limit(run.output)).any():
        return log
    output, limit = np.where(there, np.nan, run.output), float(np.nanmax(run.output))
    return replace(log, output=read_only(output), limit=limit, at_limit_pct=100 * float(there.mean()))


def hold_measured(level: Array, output: Array) -> Array:
    """An input that stands still but for white noise, as one that was measured does, at what it stands still at: each
    row's noise would be taken for an input; itself where it moves, or answers the noise of the output."""
    noise = sample_noise(level)
    if noise == 0.0 or not stands_still(every := plateaus(level), level):
        return level
    holds = [one for one in every if is_white(level[one.start : one.stop])]
    if sum(one.count for one in holds) < MOST_WHITE * sum(one.count for one in every):
        return level
    means = np.array([float(level[one.start : one.stop].mean()) for one in holds])
    weights, order = np.array([float(one.count) for one in holds]), np.argsort(means)
    fewest = np.minimum(weights[order], np.roll(weights[order], 1))
    apart = np.diff(means[order], prepend=means[order[0]]) > ONE_LEVEL * noise / np.sqrt(fewest)
    group = np.empty(len(means), dtype=np.intp)
    group[order] = np.cumsum(apart)  # those that differ as noise makes them are one
    same = np.bincount(group, weights * means) / np.bincount(group, weights)
    same[np.abs(same) <= noise] = 0.0
    held, still = level.copy(), np.zeros(len(level), dtype=bool)
    for one, value in zip(holds, same[group].tolist(), strict=True):
        held[one.start : one.stop], still[one.start : one.stop] = value, True
    rows = np.flatnonzero(still[1:] & still[:-1] & np.isfinite(output[1:] - output[:-1]))
    new, answered = np.diff(level - held)[rows], np.diff(output)[rows]
    size = float(np.linalg.norm(new) * np.linalg.norm(answered))
    return level if size > 0 and abs(float(new @ answered)) > MOST_ANSWERED * size else held


def is_white(values: Array) -> bool:
    """Whether what values scatter about their mean is white noise, as far as so many tell."""
    off = values - values.mean()
    return bool(white_squares(off) >= (MOSTLY_WHITE - 1 / np.sqrt(len(off))) * float(off @ off))


def at_limit(output: Array) -> NDArray[np.bool_]:
    """Rows at which an output stands at its largest value as only one does whose sensor ends there, (n,): again and
    again where noise, or a response that comes to rest, would hardly twice."""
    nowhere, there = np.zeros(len(output), dtype=bool), output == np.nanmax(output, initial=-np.inf)
    if there.sum() < FEWEST_AT_LIMIT:  # most outputs, which are not put in order
        return nowhere
    values, counts = np.unique(output[np.isfinite(output)], return_counts=True)
    if len(values) < FEWEST_VALUES or counts[-1] < TIMES_MORE * counts[-21:-1].max():
        return nowhere
    enters = np.flatnonzero(there[1:] & ~there[:-1])
    jumps = len(enters) > 0 and median(values[-1] - output[enters]) > LEAST_JUMP * float(values[-1] - values[0])
    return there if jumps else nowhere


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


def changes_in_gaps(log: RecordedLog) -> NDArray[np.intp]:
    """The rows before gaps within which the input changed."""
    return np.flatnonzero((np.diff(log.time_s) > GAP_ROWS * log.usual_s) & (np.diff(log.input) != 0))


def split_at_gaps(log: RecordedLog) -> list[RecordedLog]:
    """A log in parts where its input changed within a gap: when is not known, nor what the states behind it are; a
    loop's, whose law needs it whole, in one."""
    steps, gaps = np.diff(log.time_s), changes_in_gaps(log)
    ends = [0, len(log.time_s)]
    for at in (gaps[np.argsort(-steps[gaps])] + 1).tolist():  # the longest first
        if len(ends) <= MOST_PARTS and min(abs(at - end) for end in ends) >= PART_ROWS:
            ends.append(at)
    if log.reference is not None or len(ends) == 2:
        return [log]
    found = []
    for first, last in itertools.pairwise(sorted(ends)):
        rows = slice(first, last)
        part = replace(log, time_s=log.time_s[rows], input=log.input[rows], output=log.output[rows], others=tuple)
        name = f"{log.name} from {log.time_s[first]:.4g} s"
        found.append(replace(part, name=name, idle_start=False) if first else part)
    return found


def creep_at(share: Array) -> Array:
    """How a creep goes where so much of a log is over: straight to 1 at its end, and bent, by 1 amid it, (n, 2)."""
    return np.stack([share, 4 * share * (1 - share)], axis=1)


def take_off_creep(log: RecordedLog, creep: Array) -> RecordedLog:
    """The log without an output that creeps so far beside its response, straight and bent, (2,)."""
    share = (log.time_s - log.time_s[0]) / (log.time_s[-1] - log.time_s[0])
    straight, bent = (np.array(log.creep) + creep).tolist()
    return replace(log, output=log.output - creep_at(share) @ creep, creep=(straight, bent))


def take_off_jump(log: RecordedLog, at_s: float, size: float) -> RecordedLog:
    """The log without a jump of its zero so long after its first row."""
    behind = log.time_s - log.time_s[0] >= at_s
    return replace(log, output=log.output - size * behind, jump=(at_s, size))


def take_off_drift(log: RecordedLog, drift: float, idle: float) -> RecordedLog:
    """The log as if its gain had not grown."""
    share = (log.time_s - log.time_s[0]) / (log.time_s[-1] - log.time_s[0])
    return replace(log, output=without_drift(log.output, share, idle, drift), drift=drift)


def without_drift(output: Array, share: Array, idle: float, drift: float) -> Array:
    """An output as the gain amid its log makes it, (n,); `share` of the log is over at its rows."""
    return np.asarray(idle + (output - idle) / (1 + drift * (share - 0.5)))


def shift_input(log: RecordedLog, rows: float) -> RecordedLog:
    """The log with the input of so many rows later, parts of one among them, through which an input that moves all the
    time goes straight but where it jumps; behind a dead time it may begin at rest."""
    if rows == 0:
        return log
    moved, part = read_only(moved_rows(log.input, int(rows))), rows - int(rows)
    if part and not log.stepwise:
        change = moved_rows(moved, 1) - moved
        moves = np.abs(change) <= JUMP * np.abs(change).mean()
        moved, part = read_only(moved + np.where(moves, part * change, 0.0)), 0.0
    late_s = part * log.usual_s
    begins = True if rows > 0 and log.starts_idle else log.idle_start  # of too few rows at rest nothing is known yet
    return replace(log, input=moved, late_s=late_s, idle_start=begins)


def add_rest(log: RecordedLog, rows: int = 1) -> RecordedLog:
    """The log with some rows of rest before it, which are not compared."""
    before = float(log.time_s[0]) - (float(log.time_s[1]) - float(log.time_s[0])) * np.arange(rows, 0, -1)
    return replace(
        log, time_s=np.append(before, log.time_s), input=np.append(np.zeros(rows), log.input),
        output=np.append(np.full(rows, np.nan), log.output), idle_start=True,
    )  # fmt: skip
