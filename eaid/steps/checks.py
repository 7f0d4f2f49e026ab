"""Warnings in a recorded step, as findings; each check is a row of a table (specification 2, Fig. 6).

Levels of torque are compared by means of blocks, so that noise and rotor ripple do not count as change.
"""

import itertools
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from eaid.arrays import Array, median, read_only
from eaid.findings import Finding, Value, finding
from eaid.logs.run import Run
from eaid.steps.baseline import NOISE_FLOOR, last_rest, without_spikes
from eaid.steps.noise import (
    BLOCKS,
    STANDARD_ERRORS,
    block_error,
    block_means,
    block_noise,
    fit_line,
    glitch,
    medians_of_five,
    resolution,
    sample_noise,
    spikes,
    stretches,
)
from eaid.steps.plateaus import BACK, FEWEST_HELD, GLITCH, tolerance, turns
from eaid.steps.repeats import copied_block
from eaid.steps.step import GAP_ROWS, Cut, left_pct, usual_step
from eaid.steps.stepset import ROWS_OF_RISE, Level

SETTLING_ROWS = 20  # Rows before one value, and after it, that tell whether an output came to rest there
BRIEF = 0.02  # Share of a window up to which a stuck sensor is told, and the numbers stand
# Steps of the sensor in a change below which its shape cannot be told, but where noise moves such a part of the rows
# of all but such a part of the runs
COARSE_STEPS, DITHERED, STILL_PART = 25, 0.3, 0.25
FEWEST_CREEPS, CREEP_ERRORS, CREEP_PCT = 4, 6.0, 2.0  # Rises, standard errors of their slope, % of the least in a hold
FLAT = 0.4  # Sharpness from which a rise is cut off and not settling
AT_NOISE = 5.0  # Deviations of an output's noise within which it comes to a limit as it does by chance
FEW_SLOPES = 8  # Slopes of a held output that tell how noise scatters one
OVER_TOP = 0.01  # Part of a flat top beyond which it is none
CREEP = 0.002  # Share of its top by which a flat one may still creep over its last quarter
SMOOTH_BLOCKS, SOON_BLOCKS = 400, 40
FEW_ROWS_CHECKED = 100
MOST_BRIDGED = 0.01  # Share of a run that «repair» bridges
FEW_SAMPLES_CHECKED = 2 * BLOCKS  # Below which neither drift nor what is left is told
MOVED = 0.05  # Share of the swing by which the output may have moved behind a gap or a ramp that the step falls into
MOVED_FAR = 0.2  # Share of the swing from which what it moved during a ramp leaves no time constants to be told
BROKEN_OFF = 0.5  # Share of the usual window of a level's repeats below which one counts as broken off
ODD, DISAGREE = 0.01, 0.05  # Chance, and share, beyond which a repeat's output at the end is off the others'
FEW = SCATTERS = 0.10  # The same of two runs alone; and the standard deviation from which repeats are told to scatter
TURN_BLOCKS = 400  # An output is averaged to so many blocks, and followed from turn to turn
QUICK = 0.2  # Share of the record that an edge behind the first may take: what comes back slower is drift
MOVES = 0.15  # Share of the range that an edge moves within a fiftieth of the record
RESTS = 0.03  # Share of the range within which a stretch of a twentieth of the record rests
CLEAR_TURN = 14.0  # Standard errors of a block mean that the range has to exceed: a turn is then half of them
RENEWED_SHARE = 0.8  # Share of the changes of an output that come equally often, from which a sensor renews it so


def saturated(step: Cut) -> Finding | None:
    """A limit at which the output stands after coming to it at full slope: exactly, or within its noise."""
    output = step.run.output
    moves = np.abs(np.diff(output))
    finest = float(moves[moves > 0].min()) if (moves > 0).any() else 0.0
    end, exactly = float(output.max() if step.sign > 0 else output.min()), 0
    for limit in (float(output.max()), float(output.min())):
        at = output == limit
        starts, stops = stretches(at)
        if at.sum() < max(10, 0.01 * len(output)) or (stops - starts).max() < 5:
            continue
        entry = int(starts[0])
        if len(starts) == 1 and stops[0] <= step.start and entry > 0:
            continue  # a sensor that dropped out in the idle time: stuck
        # a settled or idle output is approached by its finest step, or within its noise
        jump = abs(limit - float(output[max(0, entry - 3)]))
        if jump > max(20 * finest, 1e-3 * float(np.ptp(output)), AT_NOISE * sample_noise(output)):
            return finding("saturated", step.run.name, samples=int(at.sum()), limit=limit, unit=step.unit)
        exactly = int(at.sum()) if limit == end else exactly
    top = _flat_top(step) if step.run.edge == "rising" else None
    if top is None:
        return None
    if exactly:
        return finding("saturated", step.run.name, samples=exactly, limit=top, unit=step.unit)
    return finding("flat-topped", step.run.name, step.levels, limit=top, unit=step.unit)


def idle_at_limit(rises: Sequence[Cut], stopped: Iterable[Finding]) -> list[Finding]:
    """Said where most idle outputs stand, to the last digit, where other runs saturate: where they are behind
    it is not known."""
    limits = [one.values["limit"] for one in stopped if one.code == "saturated"]
    standing = [float(one.run.output[0]) for one in rises if one.start > 1 and np.ptp(one.run.output[: one.start]) == 0]
    if 2 * len(standing) <= len(rises) or len(set(standing)) > 1 or standing[0] not in limits:
        return []
    return [finding("idle-at-limit", "data", limit=standing[0], unit=rises[0].unit)]


def _flat_top(step: Cut) -> float | None:
    """The output at which a rise stops at full slope and stays, within its noise; None of one that settles."""
    rise = step.rise
    if len(rise) < 200 or not step.swing > 0 or step.swing < COARSE_STEPS * resolution(rise):
        return None
    half, quarter = len(rise) // 2, len(rise) // 4
    top = median(rise[half:])
    creep = abs(float(rise[-quarter:].mean() - rise[half:-quarter].mean()))
    slack = max(CREEP * top, 3 * block_error(rise))
    if top <= 0 or creep > slack or block_means(rise).max() > top + 3 * slack or sharpness(step, top) <= FLAT:
        return None
    return None if swings_over(rise, top) else top


def swings_over(rise: Array, top: float) -> bool:
    """Whether a rise goes over where it ends soon after it came there, as what rings or hums does."""
    soon = rise[: 4 * int((rise >= 0.95 * top).argmax() + 1)]
    means = block_means(soon, SOON_BLOCKS)
    return bool(means.max() > (1 + OVER_TOP) * top + 4 * block_noise(means))


def sharpness(step: Cut, ceiling: float) -> float:
    """Slope of a rise within 5 % of a ceiling, times the time it took, over the ceiling, less three of its errors.

    An exponential has 0.15 to 0.2 there, a straight rise that is cut off 0.95; 0 of one of a few samples.
    """
    count = len(step.rise)
    while True:
        means = block_means(step.rise[:count], SMOOTH_BLOCKS)
        near = np.flatnonzero(means >= 0.95 * ceiling)
        wanted = int(count * 4 * int(near[0] + 1) / len(means)) if len(near) else count
        if wanted >= count or count <= SMOOTH_BLOCKS:
            break
        count = max(wanted, FEW_ROWS_CHECKED)
    if not len(near) or near[0] < 5:
        return 0.0
    at, few = int(near[0]), max(2, int(near[0]) // 5)
    noise = max(sample_noise(step.rise) / np.sqrt(count / len(means)), block_noise(means[::3]))
    error = noise * at / ceiling / np.sqrt(few * (few + 1) * (few + 2) / 12)
    times, near_top = block_means(step.time_s[:count], SMOOTH_BLOCKS), slice(at - few, at + 1)
    per_slope = float(times[at]) / ceiling
    error = max(
        float(error), per_slope * slope_noise(step.rise[len(step.rise) // 2 :], count // len(means), times[near_top])
    )
    return fit_line(times[near_top], means[near_top]).slope * per_slope - 3 * error


def slope_noise(held: Array, rows: int, times_s: Array) -> float:
    """Root mean square of the slopes of a held output, of as many means of so many rows as there are times: what noise
    that lasts makes of one. 0 where it is too short to tell."""
    count = len(held) // (rows * len(times_s))
    if count < FEW_SLOPES:
        return 0.0
    means = held[: count * rows * len(times_s)].reshape(count, len(times_s), rows).mean(axis=2)
    x = times_s - times_s.mean()
    return float(np.sqrt(np.mean((means @ x / (x @ x)) ** 2)))


def stuck(step: Cut) -> Finding | None:
    """One value for longer than chance allows, where the samples around it differ from their neighbours; before the
    input first moves a coarse sensor may stand still."""
    output, rest = step.run.output, int((step.run.input != step.run.input[0]).argmax()) if step.run.has_input else 0
    same = np.diff(output) == 0
    starts, stops = stretches(same)
    for i in np.argsort(starts - stops)[:3].tolist():
        first, stop = int(starts[i]), int(stops[i])
        start = first or min(stop, rest)
        count = stop - start
        around = np.concatenate((same[max(0, start - count) : first], same[stop : stop + count]))
        limit = not 0 < start < stop < step.start and output[start] in (output.max(), output.min())
        if count < 20 or len(around) < 20 or limit or came_to_rest(np.abs(np.diff(output)), first, stop):
            continue
        chance = (around.sum() + 1) / (len(around) + 2)
        if chance < 0.7 and -count * np.log(chance) > 20 + np.log(len(output)):
            time = step.run.time_s
            long = count > BRIEF * len(step.rise) and start + count > step.start
            code = "sensor-stuck" if long else "sensor-stuck-briefly"
            lasted, value = float(time[stop] - time[start]), float(output[start])
            return finding(code, step.run.name, for_s=lasted, at_s=float(time[start]), value=value, unit=step.unit)
    return None


def came_to_rest(moves: NDArray[np.float64], first: int, stop: int) -> bool:
    """Whether an output that stands still from row `first` to `stop` had come down to single steps of its sensor, and
    leaves as it goes on: it has settled, and the sensor is coarser than its noise. `moves`: from row to row."""
    before, after = moves[max(0, first - SETTLING_ROWS) : first], moves[stop : stop + SETTLING_ROWS]
    before = before[before > 0]
    if not len(before) or before.max() > 2.01 * before.min():
        return False
    return len(after) < 2 or bool(after[0] <= max(2.01 * before.min(), 3 * after[1:].max()))


def coarse(steps: Sequence[Cut]) -> list[Finding]:
    """Rises whose output moves in steps too coarse for its change, where noise does not dither them: a quarter of them
    hold so still as one does that holds amid a step."""
    known = [(step, resolution(step.rise)) for step in steps if len(step.rise) >= 2 * BLOCKS]
    moved = [float(np.mean(np.diff(step.rise) != 0)) for step, finest in known if finest]
    if not moved or np.quantile(moved, STILL_PART) > DITHERED:
        return []
    return [
        finding("coarse-output", step.run.name, resolution=finest, unit=step.unit, steps=step.swing / finest)
        for step, finest in known
        if 0 < step.swing < COARSE_STEPS * finest
    ]


def far_out(step: Cut) -> NDArray[np.intp]:
    """The single samples, or two, that stand far out of the rise, by their place in it."""
    outliers = spikes(step.rise, step.swing)
    if step.run.edge == "rising":  # the first rows of a quick fall stand out of what is left
        outliers = np.union1d(outliers, glitch(step.rise))
    return outliers


def bridged(step: Cut) -> Run:
    """Its run with a straight line over the samples that stand far out, where they are 1 % of it at the most.

    No row is taken out: the first behind a step would take its instant away.
    """
    run, output, most = step.run, step.run.output, MOST_BRIDGED * len(step.run.output)
    rows = np.empty(0, dtype=np.intp)
    while len(rows) <= most:  # behind the largest there may be smaller ones
        now = type(step)(replace(run, output=output))
        out = now.start + far_out(now if now.rise.mean() >= 0 else replace(now, sign=-1.0))
        if not len(out):
            break
        rows = np.union1d(rows, out)
        keep = np.delete(np.arange(len(output)), rows)
        output = read_only(np.interp(run.time_s, run.time_s[keep], run.output[keep]))
    if not 0 < len(rows) <= most:
        return run
    told = finding("rows-dropped", run.name, dropped=len(rows), count=len(output))
    return replace(run, output=output, findings=(*run.findings, told))


def isolated_spikes(step: Cut) -> Finding | None:
    """Rows that stand far out of a step, and stop its fit."""
    outliers = far_out(step)
    if not len(outliers):
        return None
    at = int(outliers[np.abs(step.rise[outliers]).argmax()])
    return finding(
        "spikes", step.run.name, samples=len(outliers), value=float(step.rise[at]), unit=step.unit,
        at_s=float(step.run.time_s[step.start + at]),
    )  # fmt: skip


def copied(step: Cut) -> Finding | None:
    """A block of rows that stands in the record twice."""
    block, time = copied_block(step.run.output), step.run.time_s
    if block is None:
        return None
    at, again = float(time[block.first]), float(time[block.first + block.later])
    return finding("block-written-twice", step.run.name, rows=block.rows, at_s=at, again_s=again)


def _negative(step: Cut) -> Finding | None:
    negative = (step.run.level or 0.0) < 0 and step.run.position is None
    return finding("input-negative", step.run.name) if negative else None


def _contradiction(step: Cut) -> Finding | None:
    """A stored or named level that is another than the input column's own."""
    run = step.run
    if run.level is None or not run.has_input or np.isnan(run.input[step.start :]).any():
        return None
    held = median(run.input[step.start :])
    if abs(abs(held) - abs(run.level)) <= max(0.02 * abs(run.level), 2 * tolerance(run.input), 1e-9):
        return None
    return finding("level-contradicts-input", run.name, said=run.level, held=held, unit=run.input_unit)


def _command_answered(step: Cut) -> Finding | None:
    """An output that is at its end at once, to the digit, while the input moves on: a command, and what answers it."""
    u = step.run.input[step.start :]
    if not step.run.has_input or len(u) < FEW_SAMPLES_CHECKED or np.ptp(step.rise) > 0:
        return None
    return finding("columns-exchanged", step.run.name) if 2 * len(np.unique(u)) > len(u) else None


def _gap(step: Cut) -> Finding | None:
    every = np.diff(step.run.time_s)
    at = int(every.argmax()) if len(every) else 0
    if not len(every) or every[at] <= GAP_ROWS * step.usual_s:
        return None
    more = int((every > GAP_ROWS * step.usual_s).sum()) - 1
    values: dict[str, Value] = {"gap_s": float(every[at]), "at_s": float(step.run.time_s[at])}
    values |= {"sample_s": step.usual_s} | ({"others": more} if more else {})
    return finding("gap", step.run.name, (), **values)


def _gap_at_step(step: Cut) -> Finding | None:
    """A gap that the step falls into, and behind which the output has moved already: its instant is not known."""
    if not 0 < step.start < len(step.run.time_s) or not step.swing > 0:
        return None
    gap = float(step.run.time_s[step.start] - step.run.time_s[step.start - 1])
    first = abs(float(step.rise[0]) - (step.before if step.run.edge == "falling" and step.before else 0.0))
    if gap <= GAP_ROWS * step.usual_s or first <= max(MOVED * step.swing, STANDARD_ERRORS * sample_noise(step.rise)):
        return None
    at = float(step.run.time_s[step.start - 1])
    return finding("step-in-gap", step.run.name, gap_s=gap, at_s=at, moved_pct=100 * first / step.swing)


def ramp(step: Cut) -> Finding | None:
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
    code = "input-ramps-on" if moved > MOVED_FAR else "input-ramps"
    return finding(code, name, step.levels, ramp_s=ramp_s, moved_pct=100 * moved)


def _glitch(step: Cut) -> Finding | None:
    """Rows, at most two in a row, on which the input leaves its level and comes back: no step."""
    run, level = step.run, step.run.from_level if step.run.edge == "falling" else step.run.level or 0.0
    if not run.has_input:
        return None
    off = np.abs(run.input[step.start :] - level) > max(tolerance(run.input), 0.01 * abs(level))
    starts, stops = stretches(off)
    short = (stops - starts <= GLITCH) & (starts > 0) & (stops < len(off))
    if not short.any():
        return None
    at_s = float(run.time_s[step.start + int(starts[short.argmax()])])
    return finding("input-glitches", run.name, rows=int((stops - starts)[short].sum()), at_s=at_s)


def _drift(step: Cut) -> Finding | None:
    if len(step.idle) < FEW_SAMPLES_CHECKED:
        return None
    means = block_means(without_spikes(step.idle, step.swing)[0])
    slope, error, _ = fit_line(np.arange(len(means)) / len(means), means)
    if abs(slope) <= max(0.02 * step.swing, STANDARD_ERRORS * error):
        return None
    share = 100 * abs(slope) / step.swing if step.swing > 0 else None
    return finding("idle-drifts", step.run.name, drift=slope, unit=step.unit, share_pct=share)


def idle_slope(step: Cut) -> float | None:
    """How fast the output creeps before a step, with the sign of the rise; None where too few samples tell. Of its last
    rows the rise may have begun between two."""
    end = step.start - ROWS_OF_RISE
    if end < FEW_SAMPLES_CHECKED:
        return None
    return step.sign * fit_line(step.run.time_s[:end], step.idle[:end]).slope


def creeping(steps: Sequence[Cut]) -> list[Finding]:
    """Whether the outputs of rises creep alike while they idle, which the noise of each by itself may hide: the mean of
    the slopes by its standard error, from how they scatter, where a hold makes much of it."""
    found = [(step, slope) for step in steps if (slope := idle_slope(step)) is not None and step.swing > 0]
    if len(found) < FEWEST_CREEPS:
        return []
    known, slopes = [step for step, _ in found], np.array([slope for _, slope in found])
    slope, error = float(slopes.mean()), float(slopes.std(ddof=1) / np.sqrt(len(slopes)))
    hold_s, least = median([float(step.time_s[-1]) for step in known]), min(known, key=lambda step: step.swing)
    share = 100 * abs(slope) * hold_s / least.swing
    if abs(slope) <= CREEP_ERRORS * error or share < CREEP_PCT:
        return []
    return [
        finding("output-creeps", "data", (), slope=slope, unit=least.unit, count=len(known), share_pct=share,
                worst=least.levels[0])
    ]  # fmt: skip


def _not_idle(step: Cut) -> Finding | None:
    """A start that left its rest before the step: off by more than the noise allows (`baseline.left_early`)."""
    before = step.before
    if before is None or step.run.from_level != 0 or not step.swing > 0:
        return None
    if (off := abs(before)) <= NOISE_FLOOR * step.swing:
        return None
    rest = last_rest(step.idle, step.swing) if len(step.idle) >= FEWEST_HELD else None
    if rest is not None and rest.rests:
        return None
    # within a sample and a half: the instant is known to one
    if off <= 0.75 * abs(float(step.rise[:3].mean()) - before):
        return None
    share, early_s = 100 * off / step.swing, step.usual_s * (0 if rest is None else rest.lead)
    return finding(
        "not-at-rest", step.run.name, (step.run.level or 0.0,), off=before, unit=step.unit, share_pct=share,
        early_s=early_s,
    )  # fmt: skip


def _left_after_release(step: Cut) -> Finding | None:
    left = left_pct(step)
    if step.run.from_level != 0 or len(step.rise) < FEW_SAMPLES_CHECKED or left <= 5:
        return None
    if left / 100 * step.swing <= STANDARD_ERRORS * block_error(step.rise):
        return None
    return finding("left-after-release", step.run.name, step.levels, left_pct=left, after_s=float(step.time_s[-1]))


def several_edges(
    name: str, time_s: Array, output: Array, first_s: float = 0.0, has_input: bool = False
) -> Finding | None:
    """A finding where an output has more than one edge although its input says nothing of it.

    A turn counts where the way back is `BACK` of the range; between two, a stretch that rests parts edge from edge. A
    glitch of one or two rows is none.
    """
    if len(output) < 4 * FEWEST_HELD:
        return None
    output = medians_of_five(output)
    # the end of a window given by hand may hold the first samples of the release
    until = len(output) - len(output) // 50
    times, means = (block_means(values[:until], TURN_BLOCKS) for values in (time_s, output))
    low, high = np.quantile(means, (0.01, 0.99)).tolist()
    span = high - low
    # neighbours three apart: hum and rotor ripple last for longer than a block
    noise = max(sample_noise(output) / np.sqrt(until / len(means)), block_noise(means), block_noise(means[::3]))
    at_s: list[float] = []
    for start, stop in itertools.pairwise(turns(means, BACK * span) if span > CLEAR_TURN * noise else []):
        for a, b in _pieces_of_leg(means, start, stop + 1, span):
            change = means[b - 1] - means[a]
            if abs(change) < MOVES * span:
                continue
            share = (means[a:b] - means[a]) / change
            begins, ends = float(times[a + (share >= 0.1).argmax()]), float(times[a + (share >= 0.9).argmax()])
            if not at_s or ends - begins < QUICK * float(times[-1] - times[0]):
                at_s.append(begins + first_s)
    if len(at_s) < 2:
        return None
    return finding("several-edges", name, edges=len(at_s), first_s=at_s[0], last_s=at_s[-1], has_input=has_input)


def _pieces_of_leg(means: Array, start: int, stop: int, span: float) -> list[tuple[int, int]]:
    """A leg between two turns as pieces with one edge each: those between moves with a rest in between."""
    lag, still = max(1, len(means) // 50), max(2, len(means) // 20)
    if stop - start < 2 * still + lag:
        return [(start, stop)]
    steps = np.abs(means[start + lag : stop] - means[start : stop - lag]) / span
    cuts, moved, rested = [start], False, 0
    rest_since: int | None = None
    for i, step in enumerate(steps.tolist()):
        rested = rested + 1 if step < RESTS else 0
        if step > MOVES:
            if moved and rest_since is not None:
                cuts.append(start + rest_since)
            moved, rest_since = True, None
        elif moved and rested >= still:
            rest_since = i
    return list(itertools.pairwise([*cuts, stop]))


def _several_edges(step: Cut) -> Finding | None:
    """More edges than the one that the input, or the file name, tells of."""
    if step.run.position is not None:
        return None
    idle = max(1, len(step.rise) // 50)
    before = np.arange(-idle, 0) * step.usual_s
    time, rise = np.concatenate((before, step.time_s)), np.concatenate((np.zeros(idle), step.rise))
    return several_edges(step.run.name, time, rise, step.run.step_s or 0.0, step.run.has_input)


# The checks of one run, by its edge: each gives a finding or nothing
CHECKS: dict[str, tuple[Callable[[Cut], Finding | None], ...]] = {
    "rising": (_negative, _contradiction, _command_answered, _glitch, _gap, _gap_at_step, ramp, _drift, _not_idle,
               saturated, stuck, copied, isolated_spikes, _several_edges),
    "falling": (_negative, _glitch, _gap, _gap_at_step, ramp, saturated, stuck, copied, isolated_spikes,
                _left_after_release),
}  # fmt: skip


class RecordedWindow(Cut):
    """A log that is fitted as it was recorded, taken as one window from its first sample on."""

    @cached_property
    def swing(self) -> float:
        """Range of the output but for its rarest samples."""
        low, high = np.quantile(self.run.output, (0.03, 0.97)).tolist()
        return float(high - low)


def renewed(step: Cut) -> Finding | None:
    """An output that stays to the last digit for the same few rows each time: its sensor is slower than the log."""
    apart = np.diff(np.flatnonzero(np.diff(step.run.output)))
    if len(apart) < FEW_SAMPLES_CHECKED:
        return None
    rows = int(median(apart))
    if rows < 3 or np.mean(apart == rows) < RENEWED_SHARE:
        return None
    return finding("output-renewed", step.run.name, rows=rows, every_s=rows * usual_step(step.run.time_s))


def of_record(run: Run) -> list[Finding]:
    """What is wrong in a log that is fitted as it was recorded."""
    return [*filter(None, (check(RecordedWindow(run)) for check in (_gap, stuck, renewed, copied, isolated_spikes)))]


def broken_off(steps: Sequence[Cut]) -> list[Finding]:
    """One for each repeat of a level that ends long before most of them do: all would be cut to its window."""
    ends = [float(step.time_s[-1]) for step in steps]
    usual = sorted(ends)[len(ends) // 2]
    return [
        finding("broken-off", step.run.name, step.levels, own_s=end, usual_s=usual)
        for step, end in zip(steps, ends, strict=True) if end < BROKEN_OFF * usual
    ]  # fmt: skip


def disagreements(levels: Sequence[Level], unit: str) -> list[Finding]:
    """The repeats whose held output, the mean of the last quarter, is off the others of their level by more than the
    scatter of all but it explains, a t test at `ODD` in all; and that scatter, where it is large by itself."""
    from scipy.special import stdtrit  # only where steps are looked at: reading a dataset needs none of it

    known: list[tuple[Level, Array]] = []  # with how far each repeat is off the mean, over it
    for level in levels:
        ends = level.runs[:, -max(1, level.runs.shape[1] // 4) :].mean(axis=1)
        if len(ends) > 1 and ends.mean() != 0:
            known.append((level, ends / abs(float(ends.mean())) - np.sign(ends.mean())))
    squares = sum(float(off @ off) for _, off in known)
    degrees, count = sum(len(off) - 1 for _, off in known), sum(len(off) for _, off in known)
    found = []
    for level, off in known:
        by_others = len(off) / (len(off) - 1)  # off the mean of the others, over off the mean of all
        for name, one in zip(level.names, off.tolist(), strict=True):
            left = max(squares - one**2 * by_others, 0.0) / max(degrees - 1, 1)
            limit = float(stdtrit(degrees - 1, 1 - ODD / 2 / count)) * np.sqrt(left * by_others) if degrees > 1 else FEW
            if abs(one) * by_others > max(limit, DISAGREE):
                values = {"own_pct": 100 * one * by_others, "spread_pct": 100 * float(np.ptp(off)), "unit": unit}
                found.append(finding("repeats-disagree", name, [level.level], **values))
    sd = float(np.sqrt(squares / max(degrees, 1)))
    if sd > SCATTERS and not found:
        found.append(finding("repeats-scatter", "data", sd_pct=100 * sd, runs=count))
    return found


OF_RESTS = (_drift, _not_idle, _several_edges)  # Which a step that begins on a tail does not pass
