"""What is doubtful in a recorded step, as findings; each check is a row of a table (specification 2, Fig. 6).

Levels of torque are compared by means of blocks, so that noise and rotor ripple do not count as change.
"""

from collections.abc import Callable
from typing import Literal

import numpy as np

from eaid.arrays import median
from eaid.findings import Finding, finding
from eaid.steps.baseline import FLOOR, last_rest, without_spikes
from eaid.steps.noise import BLOCKS, STANDARD_ERRORS, block_error, block_means, line, sample_noise
from eaid.steps.not_steps import several_edges
from eaid.steps.plateaus import FEWEST, tolerance
from eaid.steps.sensor import coarse, flat_top, isolated_spikes, saturated, stuck
from eaid.steps.slow import slow_constant
from eaid.steps.step import Step, left_pct, lost_pct
from eaid.steps.stepset import Level

FEW = 2 * BLOCKS
SLOW_CLOCK_S = 1.0
"""Sample time from which its unit is asked about."""
MOVED = 0.05
"""Share of the swing by which the output may have moved behind a gap or a ramp that the step falls into."""
FAR = 0.2
"""Share of the swing from which what it moved during a ramp leaves no time constants to be told."""
DISAGREE = 0.10
"""Repeats whose torque at the end differs by more than this share are told."""


def _negative(step: Step) -> Finding | None:
    negative = (step.run.level or 0.0) < 0 and step.run.position is None
    return finding("input-negative", step.run.name) if negative else None


def _contradiction(step: Step) -> Finding | None:
    """A stored or named level that is another than the input column's own."""
    run = step.run
    if run.level is None or not run.has_input or np.isnan(run.input[step.start :]).any():
        return None
    held = median(run.input[step.start :])
    if abs(held - run.level) <= max(0.02 * abs(run.level), 2 * tolerance(run.input), 1e-9):
        return None
    return finding("level-contradicts-input", run.name, said=run.level, held=held, unit=run.input_unit)


def _slow_clock(step: Step) -> Finding | None:
    usual = step.clock.usual_s
    return finding("slow-clock", step.run.name, sample_s=usual) if usual >= SLOW_CLOCK_S else None


def _jitter(step: Step) -> Finding | None:
    clock, name = step.clock, step.run.name
    if clock.longest_s > 5 * clock.usual_s:
        where = float(step.run.time_s[clock.longest_at])
        return finding("gap", name, gap_s=clock.longest_s, at_s=where, sample_s=clock.usual_s)
    if clock.spread_s is not None:
        return finding("jitter", name, low_s=clock.spread_s[0], high_s=clock.spread_s[1])
    return None


def _gap_at_step(step: Step) -> Finding | None:
    """A gap that the step falls into, and behind which the output has moved already: its instant is not known."""
    if not 0 < step.start < len(step.run.time_s) or not step.swing > 0:
        return None
    gap = float(step.run.time_s[step.start] - step.run.time_s[step.start - 1])
    first = abs(float(step.rise[0]) - (step.before if step.run.edge == "falling" and step.before else 0.0))
    if gap <= 5 * step.clock.usual_s or first <= max(MOVED * step.swing, STANDARD_ERRORS * sample_noise(step.rise)):
        return None
    at = float(step.run.time_s[step.start - 1])
    return finding("step-in-gap", step.run.name, gap_s=gap, at_s=at, moved_pct=100 * first / step.swing)


def _ramp(step: Step) -> Finding | None:
    """An input that is on its way to the new level while the output moves already."""
    run, name = step.run, step.run.name
    if not step.start or not run.has_input or not step.swing > 0:
        return None
    level = (run.level or 0.0) if run.edge == "falling" else run.from_level
    at_rest = np.flatnonzero(np.abs(run.input[: step.start] - level) <= tolerance(run.input))
    last = int(at_rest[-1]) if len(at_rest) else -1  # none: the hold before it belongs to the step before
    moved = abs(float(step.rise[0]) - (step.before or 0.0)) / step.swing
    if last == step.start - 1 or moved <= MOVED or moved * step.swing <= STANDARD_ERRORS * sample_noise(step.rise):
        return None
    ramp_s = float(run.time_s[step.start] - run.time_s[max(last, 0)])
    code = "input-ramps-on" if moved > FAR else "input-ramps"
    return finding(code, name, step.levels, ramp_s=ramp_s, moved_pct=100 * moved)


def _drift(step: Step) -> Finding | None:
    if len(step.idle) < FEW:
        return None
    means = block_means(without_spikes(step.idle, step.swing)[0])
    slope, error, _ = line(np.arange(len(means)) / len(means), means)
    if abs(slope) <= max(0.02 * step.swing, STANDARD_ERRORS * error):
        return None
    grown = slope * len(step.rise) / len(step.idle)
    share, by_end = (100 * abs(off) / step.swing if step.swing > 0 else None for off in (slope, grown))
    return finding(
        "idle-drifts", step.run.name, drift=slope, unit=step.unit, share_pct=share, grown=grown, by_end_pct=by_end
    )


def _not_idle(step: Step) -> Finding | None:
    """A start that left its rest before the step: off by more than the noise allows (`baseline.left_early`).

    An instant is known to one sample: what the output moves in one is told, and no stop.
    """
    before = step.before
    if before is None or step.run.from_level != 0 or not step.swing > 0:
        return None
    off = abs(before)
    known = len(step.idle) >= FEWEST and last_rest(step.idle, step.swing).rests
    if off <= FLOOR * step.swing or known:
        return None
    within_one = off <= 0.75 * abs(float(step.rise[:3].mean()) - before)  # a sample and a half: one, and not two
    return finding(
        "nearly-at-rest" if within_one else "not-at-rest", step.run.name, (step.run.level or 0.0,), off=before,
        unit=step.unit, share_pct=100 * off / step.swing,
    )  # fmt: skip


def _falls_while_held(step: Step) -> Finding | None:
    """A fall from the peak, where a straight line through the window behind it falls by five standard errors."""
    if len(step.rise) < FEW:
        return None
    lost = lost_pct(step)
    if lost <= 2.0 or lost / 100 * step.swing <= STANDARD_ERRORS * block_error(step.rise):
        return None
    means = block_means(step.rise, 4 * BLOCKS)
    tail = means[int(means.argmax()) :]
    if len(tail) < 8:
        return None
    slope, error, left = line(np.arange(len(tail)), tail)
    alike = float(left[1:] @ left[:-1] / max(float(left @ left), 1e-300))
    widen = (1 + max(alike, 0.0)) / max(1 - max(alike, 0.0), 0.05)
    if -slope <= STANDARD_ERRORS * error * widen**0.5:
        return None
    return finding("decays-under-hold", step.run.name, step.levels, lost_pct=lost)


def _left_after_release(step: Step) -> Finding | None:
    if step.run.from_level != 0 or len(step.rise) < FEW:
        return None
    left = left_pct(step)
    if left > 5.0 and left / 100 * step.swing > STANDARD_ERRORS * block_error(step.rise):
        after_s = float(step.time_s[-1])
        return finding("left-after-release", step.run.name, step.levels, left_pct=left, after_s=after_s)
    return None


def _several_edges(step: Step) -> Finding | None:
    """More edges than the one that the input, or the file name, tells of."""
    if step.run.position is not None:
        return None
    idle = max(1, len(step.rise) // 50)
    before = np.arange(-idle, 0) * step.clock.usual_s
    time, rise = np.concatenate((before, step.time_s)), np.concatenate((np.zeros(idle), step.rise))
    return several_edges(step.run.name, time, rise, step.run.step_s or 0.0)


def _too_short(step: Step) -> Finding | None:
    if len(step.rise) < 4 * BLOCKS or not step.swing > 0:
        return None
    window = float(step.time_s[-1])
    slow, short = slow_constant(step.rise, window)
    means = block_means(step.rise)
    if not short or means[-3:].mean() - means[-8:-5].mean() < 0.005 * step.swing:
        return None
    tau2_s = slow if slow < 5 * window else None
    return finding("window-too-short", step.run.name, step.levels, window_s=window, tau2_s=tau2_s)


Edge = Literal["rising", "falling"]
BOTH: tuple[Edge, ...] = ("rising", "falling")
CHECKS: tuple[tuple[Callable[[Step], Finding | None], tuple[Edge, ...]], ...] = (
    (_negative, BOTH),
    (_contradiction, ("rising",)),
    (_slow_clock, BOTH),
    (_jitter, BOTH),
    (_gap_at_step, BOTH),
    (_ramp, BOTH),
    (_drift, ("rising",)),
    (_not_idle, ("rising",)),
    (saturated, BOTH),
    (flat_top, ("rising",)),
    (stuck, BOTH),
    (coarse, ("rising",)),
    (isolated_spikes, BOTH),
    (_several_edges, ("rising",)),
    (_falls_while_held, ("rising",)),
    (_too_short, ("rising",)),
    (_left_after_release, ("falling",)),
)
"""Every check of one run, a finding or nothing, and the edges that it is for."""


def doubts(step: Step) -> tuple[Finding, ...]:
    """All that is doubtful in one step, in the order of the table."""
    checks = (check(step) for check, for_edges in CHECKS if step.run.edge in for_edges)
    return tuple(doubt for doubt in checks if doubt is not None)


def disagreements(level: Level, unit: str) -> list[Finding]:
    """One for each repeat of a level where the means over their last quarter spread by more than `DISAGREE`.

    `own_pct` is how far a repeat lies from the mean of the others, as a share of the mean of all.
    """
    ends = level.runs[:, -max(1, level.runs.shape[1] // 4) :].mean(axis=1)
    middle, spread = abs(float(ends.mean())), float(np.ptp(ends))
    if spread <= DISAGREE * middle or middle == 0:
        return []
    own_pct = 100 * (ends - ends.mean()) * len(ends) / (len(ends) - 1) / middle
    return [
        finding("repeats-disagree", name, [level.level], own_pct=pct, spread_pct=100 * spread / middle, unit=unit)
        for name, pct in zip(level.names, own_pct.tolist(), strict=True)
    ]
