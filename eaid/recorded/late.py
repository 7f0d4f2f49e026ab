"""Dead time of a recorded log under the clutch's form (other kinds find theirs in `kinds`).

By how many rows the output answers late, or early, where the input is noted late.

With f_s the response to the input of s rows later (what acted, if the log shows a change s rows late), D = (f₁ − f₋₁)/2
is the derivative by that delay. In residuals r whitened by an autoregression, J and D with them,

    δ = −D̃'r/D̃'D̃,   D̃ = D − J (J'J)⁻¹ J'D,   var δ = Σ_stretches (D̃'r)²/(D̃'D̃)²

is the delay in rows. The input is moved row by row while that brings it nearer; a delay of many rows, which the
derivative does not reach, is first looked for by the cost itself. What noise does not explain is taken over: the fit
is of the input as it acted.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.linalg import solve_toeplitz

from eaid.arrays import Array, median, scaled_inverse, white_squares
from eaid.estimate.recorded_log import IDLE_ROWS, RecordedLog, shift_input
from eaid.estimate.solver import EndPoint, approach
from eaid.estimate.spread import t_quantile
from eaid.findings import Finding, finding
from eaid.plant.drive import Drive, later
from eaid.plant.sums import unforeseen
from eaid.recorded.few_rows import Copies
from eaid.recorded.from_logs import Setup, Solved, fit_near, fit_setup, setup_of, with_dead_time
from eaid.recorded.inputs import Experiment
from eaid.recorded.kinds import noise_saves

# Cost of a start at rest, over that of one with unknown states, up to which the steps' dead time is believed
REST_COST = 2.0
NEAR_ROWS = 3  # Rows that are looked for one by one …
ASKED_ROWS = 0.3  # … from so much of one, and a standard error: what rings bends its ω and ζ for the rest of it
FAR_ROWS = 4  # Rows at which a cost that is lower by `LOWER` of it speaks of a delay of many rows …
LOWER = 0.02
FARTHEST_ROWS = 500  # … and this many are looked for
# Of a log, from its first on, by which its delay is looked for; where each has to be gone through
DELAY_ROWS, DELAY_ROWS_SWINGING = 1_000_000, 200_000
# Rows from which a delay is told, by whether the input is held; of one that moves, a dead time. A held one that changes
# between two rows is noted half a row late, and so is one that moves between them, not from row to row
LATE_ROWS, BETWEEN_ROWS = {True: 0.5, False: 0.02}, 0.25
PART_OF_ROW = 0.1  # From which a dead time behind an input that moves between its rows is looked for
WHOLE_ROWS = 0.15  # So near to a whole row a delay is that
# Changes, and standard deviation of the rows by which they are noted late, from which they lie between two: any such
# part of a row is as likely, which makes 0.29
FEWEST_BETWEEN, LEAST_JITTER = 8, 0.17
ORDER = 8  # Of the autoregression
ALONE = 1e-12  # Part of what a delay does that the unknowns leave, beneath which it is rounding
NOISE_STRETCHES = 40
LATE_CHANCE = 0.01  # Of a delay as large by noise alone, at most
LEAST_CHANGES = 4
CHANGE_JUMP = 5.0
EXPLAINS = 0.8  # Part of the cost below which a delay leaves it where the input seems to answer the output
FOLLOWS = 0.1  # Correlation of the duty's changes with the residual's from which a log counts as a loop


class Delay(NamedTuple):
    """By how many rows the input of a log is noted late, and the 95 % interval of it; below 0 a dead time."""

    rows: float = 0
    low: float = 0.0
    high: float = 0.0

    def later(self, rows: float) -> "Delay":
        """The same by some more rows."""
        return Delay(self.rows + rows, self.low + rows, self.high + rows)

    def told(self, log: RecordedLog) -> list[Finding]:
        """What is said of a log whose input was noted late, by more than one that moves between its rows is."""
        row_ms = 1e3 * log.usual_s
        ms, low, high = (row_ms * rows for rows in ((self.low + self.high) / 2, self.low, self.high))
        late = self.rows > (0.0 if log.stepwise else 0.5)
        return [finding("input-late", log.name, rows=self.rows, ms=ms, low=low, high=high)] if late else []


ON_TIME = Delay()


def fit_behind_dead_time(
    base: Solved, experiment: Experiment, with_falls: Callable[[Solved, Experiment], Solved]
) -> tuple[Solved, tuple[RecordedLog, ...], tuple[Delay, ...]]:
    """The fit of logs behind their dead time, the one given or what they show; the logs with
    their inputs where they acted; and by how much each was noted late.

    What single steps show is taken where the logs are fitted better with it. What the logs show, `with_falls` that may
    have numbers of their own, for these imitate it, is an unknown of the fit, by parts of a sample, and so is the part
    of a row by which an input was noted late.
    """
    model, rests, as_left = base.fitted.model, base.fitted.idle_free, base.fitted.falls_as_left
    logs, given_s = experiment.logs, experiment.options.held_dead_time_s
    dead_s, acting = 0.0, tuple(logs)
    if tried := experiment.dead_time_s if given_s is None else given_s:
        moved = tuple(mark_rest_behind(log, tried) for log in logs)
        behind = fit_setup(setup_of(model, moved, rests, tried, as_left))
        at_rest = behind.setup.size < base.setup.size  # the log begins at rest behind it, and T_s is told apart
        if given_s is not None or behind.cost < (REST_COST if at_rest else 1 - LOWER) * base.cost:
            base, dead_s, acting = behind, tried, moved
    if given_s is not None:
        return base, acting, (ON_TIME,) * len(logs)
    found = delays(with_falls(base, experiment), acting)
    shown = [dead_s - one.rows * log.usual_s for log, one in zip(logs, found, strict=True)]
    begun_s, dead_s = dead_s, max(median([one for one in shown if one > 0] or [0.0]), 0.0)
    # the input of a log that answers early is moved behind the dead time that all of them have
    more = [(dead_s - begun_s) / log.usual_s for log in logs]
    late = tuple(
        one.later(rows) if begins < 0 else ON_TIME for one, rows, begins in zip(found, more, shown, strict=True)
    )
    if not any(one.rows for one in found) and not dead_s:
        return base, acting, late
    acting = tuple(mark_rest_behind(shift_input(log, one.rows), dead_s) for log, one in zip(logs, late, strict=True))
    if any(one.rows for one in found):
        base = fit_setup(setup_of(model, acting, rests, dead_s, as_left))
    if dead_s or base.fitted.between_rows:
        base = fit_near(*with_dead_time(base.fitted, base.x, dead_s))
    elif any(one.rows % 1 for one in late):  # which half a row of an input that moves may hide
        behind = fit_near(*with_dead_time(base.fitted, base.x, PART_OF_ROW * acting[0].usual_s))
        base = behind if behind.cost < base.cost - noise_saves(base, 1) else base
    return base, acting, late


def mark_rest_behind(log: RecordedLog, dead_s: float) -> RecordedLog:
    """The log, known to begin at rest where it rests for long enough with its dead time."""
    acting = np.flatnonzero(log.input != 0)
    if dead_s == 0 or log.idle_start is not None or not len(acting) or not acting[0]:
        return log
    rows = int(acting[0]) + dead_s / log.usual_s
    return replace(log, idle_start=True) if rows >= min(IDLE_ROWS, len(log.input) - 1) else log


def delays(base: Solved, logs: Sequence[RecordedLog]) -> list[Delay]:
    """By how much the input of each log is noted late.

    A loop's input answers the output, and tells no delay; one that seems to is none where a delay explains it.
    """
    found = []
    for k, log in enumerate(logs):
        one = ON_TIME
        if log.reference is None and len(log.changes) >= LEAST_CHANGES:
            one = delay_of(base, k, log)
            if one.rows and follows_output(base, k, log):
                x = base.x[base.setup.places[k].columns]
                plain, moved = (fit_one_log(base.fitted, x, _move_input(log, late)).cost for late in (0, one.rows))
                one = one if moved < EXPLAINS * plain else ON_TIME
        found.append(one)
    return found


def common_delay(base: Solved, logs: Sequence[RecordedLog]) -> Delay:
    """By how much the inputs of steps of one clock are noted late, which none of them tells by itself."""
    _, low, high = np.array([delay_of(base, k, log) for k, log in enumerate(logs)]).T
    weight = 1 / np.maximum(high - low, 1e-9) ** 2
    middle, half = float(np.average((low + high) / 2, weights=weight)), 0.5 / float(np.sqrt(weight.sum()))
    late = abs(middle) >= max(LATE_ROWS[True], half)
    return Delay(round(middle) if late else 0, middle - half, middle + half)


def _move_input(log: RecordedLog, rows: float) -> RecordedLog:
    """The log with its input so many rows later, and the unknowns that it has."""
    return replace(shift_input(log, rows), idle_start=log.starts_idle) if rows else log


def cost_with_moved_inputs(base: Solved, logs: Sequence[RecordedLog], rows: Sequence[float]) -> float:
    """Squares that logs leave, each by itself, with their inputs so many rows later."""
    each = zip(base.setup.places, logs, rows, strict=True)
    return sum(fit_one_log(base.fitted, base.x[at.columns], _move_input(log, more)).cost for at, log, more in each)


def follows_output(base: Solved, index: int, log: RecordedLog) -> float:
    """Correlation of what is new in an input that moves with what is new in the residual; 0 where it is a free input.

    New is what neither shows before: a delay bends the residual slowly, and a loop answers its noise at once. Jumps of
    the reference count as `CHANGE_JUMP` of the usual changes.
    """
    r = base.missed[index]
    if log.stepwise or len(r) != len(log.input):
        return 0.0
    off = (log.input > 0) & (log.input < log.input.max())
    rows = np.flatnonzero(off[1:] & off[:-1])
    if len(rows) < 100:
        return 0.0
    u, y = (unforeseen(one[:, None], autoregression(one))[rows, 0] for one in (np.diff(log.input), -np.diff(r)))
    limit = CHANGE_JUMP * float(np.abs(u).mean())
    u = np.clip(u, -limit, limit)
    size = float(np.linalg.norm(u) * np.linalg.norm(y))
    follows = float(u @ y) / size if size > 0 else 0.0
    return follows if abs(follows) > FOLLOWS else 0.0


def delay_of(base: Solved, index: int, log: RecordedLog) -> Delay:
    """The delay of one log, by whole rows but where an input is held and changes between two; none where noise has
    it."""
    log = first_rows(log, DELAY_ROWS_SWINGING if base.fitted.model.kind == "swing" else DELAY_ROWS)
    rows, x = far_delay(base.fitted, base.x[base.setup.places[index].columns], log)
    first, moved = rows, _move_input(log, rows)
    step, sd = step_to_delay(base.fitted, x, moved)
    while abs(step) >= max(ASKED_ROWS, sd) and abs(rows - first) < NEAR_ROWS:
        further = rows + int(np.sign(step))
        moved = _move_input(log, further)
        x = fit_one_log(base.fitted, x, moved).x
        further_step = step_to_delay(base.fitted, x, moved)
        if further_step[0] * step < 0 and abs(further_step[0]) >= abs(step):
            break
        rows, (step, sd) = further, further_step
    delay, half = rows + step, t_quantile(NOISE_STRETCHES - 1.0) * sd
    least = BETWEEN_ROWS if delay > 0 else LATE_ROWS[log.stepwise]
    if abs(delay) < max(least, t_quantile(NOISE_STRETCHES - 1.0, 1 - LATE_CHANCE) * sd):
        return Delay(0, delay - half, delay + half)
    if delay > 0 and not log.stepwise:
        return Delay(round(2 * delay) / 2, delay - half, delay + half)
    between = 0 < delay < min(1 - WHOLE_ROWS, 1 - half) and changes_between_rows(base, index, log)
    return Delay(delay if between else rows, delay - half, delay + half)


def first_rows(log: RecordedLog, rows: int) -> RecordedLog:
    """The begin of a log, which tells its delay as well as all of it does; itself where it has no more rows."""
    if len(log.input) <= rows:
        return log
    return replace(log, time_s=log.time_s[:rows], input=log.input[:rows], output=log.output[:rows])


def differ_by_a_row(setup: Setup, x: Array, drive: Drive) -> Array:
    """D: what an input one row later makes of the residuals of one log, with its own unknowns, (N,)."""
    after, before = (set_up_one_log(setup, later(drive, rows)).residuals(x, 0) for rows in (1, -1))
    return np.asarray(0.5 * (after - before))


def changes_between_rows(base: Solved, index: int, log: RecordedLog) -> bool:
    """Whether a held input changes between two rows: each change by another part of a row late, beyond what noise
    makes of it."""
    if not log.stepwise or len(log.changes) <= FEWEST_BETWEEN or np.isnan(log.output).any():
        return False
    x = base.x[base.setup.places[index].columns]
    D, starts = differ_by_a_row(base.fitted, x, log.drive), log.changes[1:]
    r = set_up_one_log(base.fitted, log.drive).residuals(x, 0)
    weight = np.add.reduceat(D * D, starts)
    rows = -np.add.reduceat(D * r, starts) / np.maximum(weight, 1e-300)
    off = weight * (rows - np.average(rows, weights=weight)) ** 2
    by_noise = len(starts) * white_squares(r) / len(r)
    return bool(off.sum() - by_noise > LEAST_JITTER**2 * weight.sum())


def far_delay(setup: Setup, x: Array, log: RecordedLog) -> tuple[int, Array]:
    """Rows by which the input is late where many make the cost lower, else 0, and the fit there, (p,)."""
    ends = {rows: fit_one_log(setup, x, _move_input(log, rows)) for rows in (-FAR_ROWS, 0, FAR_ROWS)}
    best = min(ends, key=lambda rows: ends[rows].cost)
    if ends[best].cost > (1 - LOWER) * ends[0].cost:
        return 0, x
    step = best
    while step:
        further = best + step
        if further not in ends and abs(further) <= FARTHEST_ROWS:
            ends[further] = fit_one_log(setup, ends[best].x, _move_input(log, further))
        if further in ends and ends[further].cost < ends[best].cost:
            best, step = further, 2 * step
        else:
            step = -int(step / 2)
    return best, ends[best].x


def fit_one_log(setup: Setup, x: Array, log: RecordedLog) -> EndPoint:
    """The fit of one log by itself, begun at x."""
    # what rings is no polynomial on the blocks of the few rows
    drive = log.drive if setup.model.kind == "swing" else Copies(log, setup.dead_time_s).small
    return approach(set_up_one_log(setup, drive).problem(), x)


def step_to_delay(setup: Setup, x: Array, log: RecordedLog) -> tuple[float, float]:
    """The delay in rows by one step from x, (p,), and its standard deviation."""
    own = set_up_one_log(setup, log.drive)
    D, foreseen, at = differ_by_a_row(setup, x, log.drive), autoregression(own.residuals(x, 0)), 0
    last, found = np.zeros((0, own.size + 2)), []
    for piece in own.derivatives(x, 0, rows=-(-len(log.input) // NOISE_STRETCHES)):
        columns = np.column_stack([piece[:, :-1], D[at : at + len(piece)], piece[:, -1]])
        columns = np.concatenate([last, columns])
        new = unforeseen(columns, foreseen)[ORDER:]
        found.append(new.T @ new)  # products of J, D and r over a stretch
        at, last = at + len(piece), columns[-ORDER:]
    sums, p = np.array(found), own.size
    whole = sums.sum(axis=0)
    free = np.append(-scaled_inverse(whole[:p, :p]) @ whole[:p, p], 1.0)  # D less what the unknowns do, by J and D
    size = float(free @ whole[: p + 1, : p + 1] @ free)
    if size <= ALONE * float(whole[p, p]):  # the unknowns do all that a delay does
        return 0.0, float(len(D))
    rows = -float(free @ whole[: p + 1, -1]) / size
    scores = sums[:, : p + 1, -1] @ free + rows * np.einsum("i,kij,j->k", free, sums[:, : p + 1, : p + 1], free)
    return rows, float(np.sqrt(scores @ scores)) / size


def autoregression(r: Array) -> Array:
    """Coefficients of r on the `ORDER` values before, (ORDER,), after Yule and Walker."""
    rho = np.array([float(r[k:] @ r[: len(r) - k]) for k in range(ORDER + 1)])
    rho[0] *= 1 + 1e-9
    return np.asarray(solve_toeplitz(rho[:-1], rho[1:])) if rho[0] > 0 else np.zeros(ORDER)


def set_up_one_log(setup: Setup, drive: Drive) -> Setup:
    """One log by itself."""
    return replace(setup, drives=(drive,), copies=())
