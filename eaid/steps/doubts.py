"""What is doubtful in a recorded step, as findings; each check is a row of a table (specification 2, Fig. 6).

Levels of torque are compared by means of blocks, so that noise and rotor ripple do not count as change.
"""

from collections.abc import Callable

import numpy as np

from eaid.arrays import Array
from eaid.findings import Finding, finding
from eaid.steps.baseline import FLOOR, last_rest, without_spikes
from eaid.steps.ceiling import flat_top
from eaid.steps.instead import several_edges
from eaid.steps.noise import BLOCKS, LONG, block_error, block_means, sample_noise, spikes
from eaid.steps.plateaus import FEWEST
from eaid.steps.slow import slow_constant
from eaid.steps.step import Step, left_pct, lost_pct

FEW = 2 * BLOCKS
SLOW_CLOCK_S = 1.0
"""Sample time from which its unit is asked about."""
MOVED = 0.05
"""Share of the swing by which the output may have moved behind a gap that the step falls into."""
SURE = 5.0
"""Standard errors beyond which a difference is told."""


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
    if gap <= 5 * step.clock.usual_s or first <= max(MOVED * step.swing, SURE * sample_noise(step.rise)):
        return None
    at = float(step.run.time_s[step.start - 1])
    return finding("step-in-gap", step.run.name, gap_s=gap, at_s=at, moved_pct=100 * first / step.swing)


def _drift(step: Step) -> Finding | None:
    if step.run.edge == "falling" or len(step.idle) < FEW:
        return None
    means = block_means(without_spikes(step.idle, step.swing)[0])
    times = (np.arange(len(means)) + 0.5) / len(means)
    rest = means - means.mean()
    slope = float(rest @ (times - 0.5) / ((times - 0.5) ** 2).sum())
    rest -= slope * (times - 0.5)
    error = float(np.sqrt((rest**2).mean() / max(1, len(means) - 2) / times.var()))
    if abs(slope) > 0.02 * step.swing and abs(slope) > SURE * error:
        share = 100 * abs(slope) / step.swing if step.swing > 0 else None
        return finding("idle-drifts", step.run.name, drift=slope, unit=step.unit, share_pct=share)
    return None


def _not_idle(step: Step) -> Finding | None:
    """A start that left its rest before the step: off by more than the noise allows (`baseline.left_early`).

    An instant is known to one sample: what the output moves in one is told, and no stop.
    """
    before = step.before
    if step.run.edge == "falling" or before is None or step.run.from_level != 0 or not step.swing > 0:
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
    if step.run.edge == "falling" or len(step.rise) < FEW:
        return None
    lost = lost_pct(step)
    if lost <= 2.0 or lost / 100 * step.swing <= SURE * block_error(step.rise):
        return None
    means = block_means(step.rise, 4 * BLOCKS)
    tail = means[int(means.argmax()) :]
    if len(tail) < 8:
        return None
    at = np.arange(len(tail)) - (len(tail) - 1) / 2
    slope = float(at @ tail / (at @ at))
    left = tail - tail.mean() - slope * at
    alike = float(left[1:] @ left[:-1] / max(float(left @ left), 1e-300))
    widen = (1 + max(alike, 0.0)) / max(1 - max(alike, 0.0), 0.05)
    error = float(np.sqrt((left @ left) / (len(tail) - 2) / (at @ at) * widen))
    if -slope <= SURE * error:
        return None
    return finding("decays-under-hold", step.run.name, (abs(step.run.level or 0.0),), lost_pct=lost)


def _left_after_release(step: Step) -> Finding | None:
    if step.run.edge == "rising" or step.run.from_level != 0 or len(step.rise) < FEW:
        return None
    left = left_pct(step)
    if left > 5.0 and left / 100 * step.swing > SURE * block_error(step.rise):
        return finding(
            "left-after-release", step.run.name, (abs(step.run.level or 0.0),), left_pct=left,
            after_s=float(step.time_s[-1]),
        )  # fmt: skip
    return None


def _saturated(step: Step) -> Finding | None:
    output = step.run.output[:LONG]
    for limit in (float(output.max()), float(output.min())):
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
        if longest >= 5 and (steep or _cut_short(output, entry, limit)):
            return finding("saturated", step.run.name, samples=int(at.sum()), limit=limit, unit=step.unit)
    return None


def _cut_short(output: Array, entry: int, limit: float) -> bool:
    """True where an output without noise stops at a limit although its last moves, an exponential's, foretell more."""
    if entry < 3:
        return False
    last, before = abs(limit - float(output[entry - 1])), abs(float(output[entry - 1] - output[entry - 2]))
    moves = np.abs(np.diff(output))
    moves = moves[moves > 0]
    finest = float(moves.min())
    even = np.abs(moves / finest - np.round(moves / finest)).max() < 1e-3
    # what is left of an exponential whose last two moves were these, the last one cut
    left = min(last, before) if before > 0 else 0.0
    return left > max(4 * finest if even else 0.0, 2e-3 * float(np.ptp(output)))


def _stuck(step: Step) -> Finding | None:
    """One value for longer than chance allows, where the samples around it differ from their neighbours."""
    output = step.run.output[:LONG]
    same = np.diff(output) == 0
    edges = np.flatnonzero(np.diff(np.concatenate(([0], same.astype(np.int8), [0]))))
    if not len(edges):
        return None
    starts, stops = edges[::2], edges[1::2]
    for i in np.argsort(starts - stops)[:3].tolist():
        start, stop = int(starts[i]), int(stops[i])
        count = stop - start
        around = np.concatenate((same[max(0, start - count) : start], same[stop : stop + count]))
        if count < 20 or len(around) < 20 or output[start] in (output.max(), output.min()):
            continue
        chance = (around.sum() + 1) / (len(around) + 2)
        if chance < 0.7 and -count * np.log(chance) > 20 + np.log(len(output)):
            time = step.run.time_s
            long = count > BRIEF * len(step.rise) and start + count > step.start
            code = "sensor-stuck" if long else "sensor-stuck-briefly"
            lasted, value = float(time[stop] - time[start]), float(output[start])
            return finding(code, step.run.name, for_s=lasted, at_s=float(time[start]), value=value, unit=step.unit)
    return None


BRIEF = 0.02
"""Share of a window up to which a stuck sensor is told, and the numbers stand."""
COARSE = 25
"""Steps of the sensor's resolution in a change below which its shape cannot be told."""


def _coarse(step: Step) -> Finding | None:
    """Output that moves in steps too coarse for its change, and is not dithered by noise."""
    rise = step.rise[:LONG]
    moves = np.abs(np.diff(rise))
    moved = moves[moves > 1e-9 * max(step.swing, 1e-300)]
    if step.run.edge == "falling" or len(rise) < FEW or not len(moved) or not step.swing > 0:
        return None
    finest = float(moved.min())
    whole = np.abs(moved / finest - np.round(moved / finest)).max() < 1e-3
    if not whole or step.swing / finest >= COARSE or len(moved) > 0.2 * len(moves):
        return None
    return finding("coarse-output", step.run.name, resolution=finest, unit=step.unit, steps=step.swing / finest)


def _spikes(step: Step) -> Finding | None:
    found = spikes(step.rise, max(step.swing, 0.0))
    if not len(found):
        return None
    sizes = np.abs(step.rise[found])
    at = int(found[sizes.argmax()])
    return finding(
        "spikes", step.run.name, samples=len(found), value=float(step.rise[at]), unit=step.unit,
        at_s=float(step.run.time_s[step.start + at]),
    )  # fmt: skip


def _several_edges(step: Step) -> Finding | None:
    """More edges than the one that the input, or the file name, tells of."""
    if step.run.edge == "falling" or step.run.position is not None:
        return None
    idle = max(1, len(step.rise) // 50)
    before = np.arange(-idle, 0) * step.clock.usual_s
    time, rise = np.concatenate((before, step.time_s)), np.concatenate((np.zeros(idle), step.rise))
    return several_edges(step.run.name, time, rise, step.run.step_s or 0.0)


def _too_short(step: Step) -> Finding | None:
    if step.run.edge == "falling" or len(step.rise) < 4 * BLOCKS or not step.swing > 0:
        return None
    window = float(step.time_s[-1])
    slow, short = slow_constant(step.rise, window)
    means = block_means(step.rise)
    if not short or means[-3:].mean() - means[-8:-5].mean() < 0.005 * step.swing:
        return None
    told = slow if slow < 5 * window else None
    return finding("window-too-short", step.run.name, (abs(step.run.level or 0.0),), window_s=window, tau2_s=told)


CHECKS: tuple[Callable[[Step], Finding | None], ...] = (
    _slow_clock,
    _jitter,
    _gap_at_step,
    _drift,
    _not_idle,
    _saturated,
    flat_top,
    _stuck,
    _coarse,
    _spikes,
    _several_edges,
    _falls_while_held,
    _too_short,
    _left_after_release,
)
"""Every check of one run: a finding, or nothing."""


def doubts(step: Step) -> tuple[Finding, ...]:
    """All that is doubtful in one step, in the order of the table."""
    return tuple(said for said in (check(step) for check in CHECKS) if said is not None)


def disagreement(runs: Array) -> float:
    """Spread of the repeats' means over the last quarter [share of their mean], from outputs of shape (R, n)."""
    ends = runs[:, -max(1, runs.shape[1] // 4) :].mean(axis=1)
    middle = abs(float(ends.mean()))
    return float(np.ptp(ends)) / middle if middle > 0 else 0.0
