"""What is doubtful in a recorded step, in words; each check is a row of a table (SPEC §2, Fig. 6).

Levels of torque are compared by means of blocks, so that noise and rotor ripple do not count as change.
"""

import itertools
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache, cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from eaid.arrays import Array, median
from eaid.logs.run import Run
from eaid.logs.spool import LONG, less, mean
from eaid.steps.clock import Clock, Clocks, Window

BLOCKS = 20
"""A window is judged by the means of this many equal parts."""


@dataclass(frozen=True, eq=False)
class Step:
    """One cut run seen from its step on: what the checks look at."""

    run: Run
    sign: float = 1.0
    """Sign that makes the set's torque positive."""
    clocks: Clocks = field(default_factory=Clocks)
    """Clocks of the set, where runs share a time axis."""

    @cached_property
    def start(self) -> int:
        """First sample of the active window, which lasts to the end of the run."""
        step = self.run.step_s or 0.0
        return int(np.searchsorted(self.run.time_s, step - 1e-9 * max(1.0, abs(step))))

    @cached_property
    def clock(self) -> Clock:
        """The clock of the whole run."""
        return self.clocks.clock(self.run.time_s)

    @cached_property
    def window(self) -> Window:
        """The time axis of the active window."""
        return self.clocks.window(self.run.time_s, self.start)

    @property
    def time_s(self) -> Array:
        """Time in the active window [s], from 0 at the step."""
        return self.window.time_s

    @cached_property
    def rise(self) -> Array:
        """Output relative to the idle baseline in the active window, its sign as the step's."""
        return less(self.run.output[self.start :], self.run.baseline or 0.0, self.sign)

    @cached_property
    def idle(self) -> Array:
        """Output relative to the baseline before the step."""
        return less(self.run.output[: self.start], self.run.baseline or 0.0, self.sign)

    @property
    def before(self) -> float | None:
        """Output just before the edge, relative to the baseline; None where nothing is recorded before it."""
        return None if self.run.held is None else self.sign * (self.run.held - (self.run.baseline or 0.0))

    @cached_property
    def swing(self) -> float:
        """How far the output goes, at least 0: its largest block mean, or the held one of a release."""
        before = self.before
        found = before if self.run.edge == "falling" and before is not None else float(block_means(self.rise).max())
        return max(found, 0.0)

    @property
    def unit(self) -> str:
        """Unit of the output."""
        return self.run.output_unit


def block_means(values: Array, blocks: int = BLOCKS) -> Array:
    """Means of equal parts, shape (blocks,), fewer where there are fewer samples."""
    blocks = max(1, min(blocks, len(values)))
    edges = np.linspace(0, len(values), blocks + 1).astype(np.intp)
    if len(values) >= LONG:
        return np.array([mean(values[start:stop]) for start, stop in itertools.pairwise(edges.tolist())])
    return np.asarray(np.add.reduceat(values, edges[:-1]) / np.diff(edges))


def lost_pct(step: Step) -> float:
    """Torque lost while the input is held, peak to end [% of the peak], by block means."""
    means = block_means(step.rise)
    peak = float(means.max())
    return max(0.0, 100.0 * (peak - float(means[-1])) / peak) if peak > 0 else 0.0


def left_pct(step: Step) -> float:
    """Torque left at the end of a release [% of the held torque], by block means."""
    return 100.0 * float(block_means(step.rise)[-1]) / step.swing if step.swing > 0 else 0.0


def _scatter(values: Array) -> float:
    """Standard error of a block mean, from how far neighbouring means of a fine division differ."""
    means = block_means(values, 4 * BLOCKS)
    if len(means) < 8:
        return 0.0
    bends = means[2:] - 2 * means[1:-1] + means[:-2]
    return float(1.4826 * median(np.abs(bends)) / np.sqrt(6) / 2)


def _jitter(step: Step) -> str:
    clock = step.clock
    if clock.longest_s > 5 * clock.usual_s:
        where = float(step.run.time_s[clock.longest_at])
        return (
            f"gap of {clock.longest_s:.4g} s in the record at {where:.6g} s (usual sample time {clock.usual_s:.4g} s)"
        )
    if clock.spread_s is not None:
        return f"jitter: the sample time runs from {clock.spread_s[0]:.4g} to {clock.spread_s[1]:.4g} s"
    return ""


def _slow_clock(step: Step) -> str:
    usual = step.clock.usual_s
    return f"sample time is {usual:.4g} s; if the time is not in s, say --units time=ms" if usual >= 1.0 else ""


def _drift(step: Step) -> str:
    if step.run.edge == "falling" or len(step.idle) < 2 * BLOCKS:
        return ""
    means = block_means(step.idle)
    times = (np.arange(len(means)) + 0.5) / len(means)
    rest = means - means.mean()
    slope = float(rest @ (times - 0.5) / ((times - 0.5) ** 2).sum())
    rest -= slope * (times - 0.5)
    error = float(np.sqrt((rest**2).mean() / max(1, len(means) - 2) / times.var()))
    if abs(slope) > 0.02 * step.swing and abs(slope) > 5 * error:
        return f"drift before the step: {slope:+.3g} {step.unit} while idle ({abs(slope) / step.swing:.0%} of the step)"
    return ""


def _not_idle(step: Step) -> str:
    if step.run.edge == "falling" or step.before is None or step.run.from_level != 0 or not step.swing > 0:
        return ""
    if abs(step.before) > 0.05 * step.swing and abs(step.before) > 5 * _scatter(step.rise):
        return f"not at rest when the step begins: {step.before:+.3g} {step.unit} off the idle output"
    return ""


def _falls_while_held(step: Step) -> str:
    if step.run.edge == "falling" or len(step.rise) < 2 * BLOCKS:
        return ""
    lost = lost_pct(step)
    if lost > 2.0 and lost / 100 * step.swing > 5 * _scatter(step.rise):
        return f"torque falls by {lost:.0f} % from its peak while held (space charge?): no monotone model shows that"
    return ""


def _left_after_release(step: Step) -> str:
    if step.run.edge == "rising" or step.run.from_level != 0 or len(step.rise) < FEW:
        return ""
    left = left_pct(step)
    if left > 5.0 and left / 100 * step.swing > 5 * _scatter(step.rise):
        return f"{left:.0f} % of the held torque is left {step.time_s[-1]:.3g} s after the release"
    return ""


FEW = 2 * BLOCKS


def _saturated(step: Step) -> str:
    output = step.run.output[:LONG]
    for limit, word in ((float(output.max()), "largest"), (float(output.min()), "smallest")):
        at = output == limit
        if at.sum() < max(10, 0.01 * len(output)):
            continue
        edges = np.flatnonzero(np.diff(np.concatenate(([0], at.astype(np.int8), [0]))))
        starts, stops = edges[::2], edges[1::2]
        longest = int((stops - starts).max())
        entry = int(starts[0])
        moves = np.abs(np.diff(output))
        finest = float(moves[moves > 0].min()) if (moves > 0).any() else 0.0
        # a sensor at its limit is met at full slope; a settled or idle output is approached by its finest step
        before = output[max(0, entry - 3) : entry]
        steep = (
            len(before) > 0
            and abs(limit - float(before[0])) > 20 * finest
            and abs(limit - float(before[0])) > 1e-3 * np.ptp(output)
        )
        if longest >= 5 and steep:
            return f"sensor saturated? {int(at.sum())} samples stand at its {word} value, {limit:.4g} {step.unit}"
    return ""


SLOW_CONSTANTS = 1.5
"""A window shorter than this many slow time constants cannot tell them."""


class _Pairs(NamedTuple):
    """Pairs of time constants on a grid, in windows, and the linear solves that belong to them."""

    tau: Array
    """The grid."""
    slow: NDArray[np.intp]
    """Place of each pair's τ2 on the grid."""
    both: Array
    """Block means of 1 − e^(−t/τ) on the grid, and below them those of its derivatives over ln τ: −(t/τ) e^(−t/τ)."""
    places: NDArray[np.intp]
    """Rows of `both` that a pair uses: (τ1, derivative at τ1, τ2)."""
    inverse: Array
    """Inverse of the 3 × 3 normal equations of each pair."""


@cache
def _pairs(count: int) -> _Pairs:
    """The grid for a window of `count` blocks: nothing in it depends on the record."""
    edges = np.linspace(0.0, 1.0, count + 1)
    tau = np.geomspace(1 / 300, 20.0, 64)
    decay = np.exp(-edges / tau[:, np.newaxis])
    mean_decay = -np.diff(decay, axis=1) * tau[:, np.newaxis] * count
    both = np.concatenate((1.0 - mean_decay, np.diff(edges * decay, axis=1) * count - mean_decay))
    gram = both @ both.T
    fast, slow = np.triu_indices(len(tau), 5)
    places = np.stack((fast, fast + len(tau), slow), axis=1)
    matrix = gram[places[:, :, np.newaxis], places[:, np.newaxis, :]]
    # a trace of the diagonal keeps nearly equal columns solvable
    ridge = 1e-12 * np.trace(matrix, axis1=1, axis2=2)[:, np.newaxis, np.newaxis] * np.eye(3)
    return _Pairs(tau, slow, both, places, np.linalg.inv(matrix + ridge))


def slow_constant(rise: Array, window_s: float) -> tuple[float, bool]:
    """Slow time constant [s] of a rise by two exponentials, and whether the window is surely too short for it.

    Costs of all pairs of a grid on block means; for each pair the amplitudes A1, A2 and, by the derivative over ln τ1,
    the fast constant between the grid's values, are a 3 × 3 linear solve. The window is too short where no pair with
    τ2 below window / 1.5 fits as well (F test, 5 standard errors).
    """
    means = block_means(rise, 4 * BLOCKS)
    count = len(means)
    grid = _pairs(count)
    right = grid.both @ means
    vector = right[grid.places]
    amplitudes = np.einsum("kij,kj->ki", grid.inverse, vector)
    fine = (amplitudes[:, 0] > 0) & (amplitudes[:, 2] > 0) & (np.abs(amplitudes[:, 1]) < 0.2 * amplitudes[:, 0])
    total = float(means @ means)
    one = grid.both[: len(grid.tau)]
    single = right[: len(grid.tau)] ** 2 / (one * one).sum(axis=1)
    tau = window_s * np.concatenate((grid.tau, grid.tau[grid.slow][fine]))
    cost = total - np.concatenate((single, (amplitudes * vector).sum(axis=1)[fine]))
    short = tau * SLOW_CONSTANTS > window_s
    best_short, best_long = float(cost[short].min()), float(cost[~short].min())
    noise = max(best_short, 1e-10 * total)
    return float(tau[cost.argmin()]), (best_long - best_short) / noise * (count - 4) > 25.0


def _too_short(step: Step) -> str:
    if step.run.edge == "falling" or len(step.rise) < 4 * BLOCKS or not step.swing > 0:
        return ""
    window = float(step.time_s[-1])
    slow, short = slow_constant(step.rise, window)
    means = block_means(step.rise)
    if not short or means[-3:].mean() - means[-8:-5].mean() < 0.005 * step.swing:
        return ""
    about = f"about {slow:.2g} s" if slow < 5 * window else "far longer"
    return f"still rising at the end of its {window:.3g} s: too short for the slow time constant ({about})"


def _not_from_rest(step: Step) -> str:
    run = step.run
    if run.from_level == 0:
        return ""
    how = "starts from" if run.edge == "rising" else "falls only to"
    return f"{how} {run.from_level:g} {run.input_unit}, not {'from' if run.edge == 'rising' else 'to'} rest: not fitted"


CHECKS: tuple[Callable[[Step], str], ...] = (
    _slow_clock,
    _jitter,
    _drift,
    _not_idle,
    _saturated,
    _falls_while_held,
    _too_short,
    _left_after_release,
    _not_from_rest,
)
"""Every check of one run: a sentence, or nothing."""


def doubts(step: Step) -> tuple[str, ...]:
    """All that is doubtful in one step, in the order of the table."""
    return tuple(said for said in (check(step) for check in CHECKS) if said)


def disagreement(runs: Array) -> float:
    """Spread of the repeats' means over the last quarter [share of their mean], from outputs of shape (R, n)."""
    ends = runs[:, -max(1, runs.shape[1] // 4) :].mean(axis=1)
    middle = abs(float(ends.mean()))
    return float(np.ptp(ends)) / middle if middle > 0 else 0.0
