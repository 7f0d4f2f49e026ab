"""What is doubtful about the sensor behind a step: saturated, stuck, too coarse, spikes.

Behind noise, a saturated sensor is a rise that stops at full slope, at one value for the highest levels. One run alone
may as well be a contact that slips: its loading stops as sharply. Where its noise then is less than half of the idle's,
the sensor has stopped, and a rise sharper than an exponential's shows it.
"""

from collections.abc import Sequence

import numpy as np

from eaid.arrays import Array
from eaid.findings import Finding, finding
from eaid.steps.noise import BLOCKS, LONG, block_error, block_means, block_noise, line, sample_noise, spikes, stretches
from eaid.steps.step import Step
from eaid.steps.stepset import Level

BRIEF = 0.02
"""Share of a window up to which a stuck sensor is told, and the numbers stand."""
COARSE = 25
"""Steps of the sensor's resolution in a change below which its shape cannot be told."""
ALIKE = 0.005
"""Share within which two levels end at one value."""
SHARP = 0.35
"""Slope just below the ceiling, relative to ceiling over rise time, from which a rise is cut off and not settling."""
FLAT = 0.4
"""The same of one run alone."""
SETTLES = 0.25
"""The same of an exponential that settles, at most: what has lost its noise and is sharper has stopped."""
QUIET = 0.5
"""Share of the idle's noise below which the noise of a flat top is that of what lies behind the sensor."""
CREEP = 0.002
"""Share of its top by which a flat one may still creep over its last quarter."""
SMOOTH = 400
FEW = 100


def saturated(step: Step) -> Finding | None:
    """A limit at which the output stands, reached at full slope or short of where it was going."""
    output = step.run.output[:LONG]
    for limit in (float(output.max()), float(output.min())):
        at = output == limit
        if at.sum() < max(10, 0.01 * len(output)):
            continue
        starts, stops = stretches(at)
        longest = int((stops - starts).max())
        entry = int(starts[0])
        moves = np.abs(np.diff(output))
        finest = float(moves[moves > 0].min()) if (moves > 0).any() else 0.0
        # a sensor at its limit is met at full slope; a settled or idle output is approached by its finest step
        steep = abs(limit - float(output[max(0, entry - 3)])) > max(20 * finest, 1e-3 * float(np.ptp(output)))
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


def stuck(step: Step) -> Finding | None:
    """One value for longer than chance allows, where the samples around it differ from their neighbours."""
    output = step.run.output[:LONG]
    same = np.diff(output) == 0
    starts, stops = stretches(same)
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


def coarse(step: Step) -> Finding | None:
    """Output that moves in steps too coarse for its change, and is not dithered by noise."""
    rise = step.rise[:LONG]
    moves = np.abs(np.diff(rise))
    moved = moves[moves > 1e-9 * max(step.swing, 1e-300)]
    if len(rise) < 2 * BLOCKS or not len(moved) or not step.swing > 0:
        return None
    finest = float(moved.min())
    whole = np.abs(moved / finest - np.round(moved / finest)).max() < 1e-3
    if not whole or step.swing / finest >= COARSE or len(moved) > 0.2 * len(moves):
        return None
    return finding("coarse-output", step.run.name, resolution=finest, unit=step.unit, steps=step.swing / finest)


def isolated_spikes(step: Step) -> Finding | None:
    """Single samples that stand far out of the rise."""
    outliers = spikes(step.rise, step.swing)
    if not len(outliers):
        return None
    at = int(outliers[np.abs(step.rise[outliers]).argmax()])
    return finding(
        "spikes", step.run.name, samples=len(outliers), value=float(step.rise[at]), unit=step.unit,
        at_s=float(step.run.time_s[step.start + at]),
    )  # fmt: skip


def same_ceiling(levels: Sequence[Level], unit: str) -> list[Finding]:
    """A finding where two or more of the highest levels end at one value, and reach it at full slope."""
    if len(levels) < 3:
        return []
    ends = [float(level.mean[-max(1, len(level.mean) // 2) :].mean()) for level in levels]
    errors = [block_error(level.mean) for level in levels]
    top = ends[-1]
    capped: list[Level] = []
    for level, end, error in zip(levels[::-1], ends[::-1], errors[::-1], strict=True):
        if abs(end - top) > max(ALIKE * abs(top), 3 * max(error, errors[-1])):
            break
        capped.insert(0, level)
    if top <= 0 or sum(sharpness(level.mean, level.time_s, top) > SHARP for level in capped) < 2:
        return []
    return [finding("same-ceiling", "data", [level.level for level in capped], ceiling=top, unit=unit)]


def flat_top(step: Step) -> Finding | None:
    """A finding where one run stops at full slope and stays there, within its noise."""
    rise = step.rise
    if len(rise) < 200 or not step.swing > 0:
        return None
    half, quarter = len(rise) // 2, len(rise) // 4
    top = float(np.median(rise[half:]))
    creep = abs(float(rise[-quarter:].mean() - rise[half:-quarter].mean()))
    slack = max(CREEP * top, 3 * block_error(rise))
    if top <= 0 or creep > slack or block_means(rise).max() > top + 3 * slack:
        return None
    sharp = _rise_of(step, top)
    idle_noise = sample_noise(step.idle) if len(step.idle) >= 20 else 0.0
    quiet = 0 < sample_noise(rise[half:]) < QUIET * idle_noise
    if quiet and sharp is not None and sharp > SETTLES:
        return finding("saturated-behind-noise", step.run.name, step.levels, limit=top, unit=step.unit)
    if (quiet and sharp is None) or (sharp or 0.0) > FLAT:
        return finding("flat-topped", step.run.name, step.levels, limit=top, unit=step.unit)
    return None


def _rise_of(step: Step, top: float) -> float | None:
    """Sharpness of a rise, less its error, averaged to a hundred blocks or more; None of a rise of a few samples."""
    count = len(step.rise)
    while True:
        means = block_means(step.rise[:count], SMOOTH)
        near = np.flatnonzero(means >= 0.95 * top)
        wanted = int(count * 4 * int(near[0] + 1) / len(means)) if len(near) else count
        if wanted >= count or count <= SMOOTH:
            if not len(near) or near[0] < 5:
                return None
            at, few = int(near[0]), max(2, int(near[0]) // 5)
            noise = max(sample_noise(step.rise) / np.sqrt(count / len(means)), block_noise(means[::3]))
            error = noise * at / top / np.sqrt(few * (few + 1) * (few + 2) / 12)
            return sharpness(means, block_means(step.time_s[:count], SMOOTH), top) - float(error)
        count = max(wanted, FEW)


def sharpness(output: Array, time_s: Array, ceiling: float) -> float:
    """Slope of a rise as it comes within 5 % of a ceiling, times the time that took, over the ceiling.

    An exponential has 0.15 to 0.2 there, a straight rise that is cut off 0.95.
    """
    near = np.flatnonzero(output >= 0.95 * ceiling)
    if not len(near) or near[0] < 4:
        return 0.0
    at = int(near[0])
    few = max(2, at // 5)
    near_top = slice(at - few, at + 1)
    return line(time_s[near_top], output[near_top]).slope * float(time_s[at]) / ceiling
