"""What is doubtful about the sensor behind a step: saturated, stuck, too coarse, spikes."""

import numpy as np

from eaid.arrays import Array
from eaid.findings import Finding, finding
from eaid.steps.noise import BLOCKS, LONG, spikes
from eaid.steps.step import Step

BRIEF = 0.02
"""Share of a window up to which a stuck sensor is told, and the numbers stand."""
COARSE = 25
"""Steps of the sensor's resolution in a change below which its shape cannot be told."""


def saturated(step: Step) -> Finding | None:
    """A limit at which the output stands, reached at full slope or short of where it was going."""
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


def stuck(step: Step) -> Finding | None:
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


def coarse(step: Step) -> Finding | None:
    """Output that moves in steps too coarse for its change, and is not dithered by noise."""
    rise = step.rise[:LONG]
    moves = np.abs(np.diff(rise))
    moved = moves[moves > 1e-9 * max(step.swing, 1e-300)]
    if step.run.edge == "falling" or len(rise) < 2 * BLOCKS or not len(moved) or not step.swing > 0:
        return None
    finest = float(moved.min())
    whole = np.abs(moved / finest - np.round(moved / finest)).max() < 1e-3
    if not whole or step.swing / finest >= COARSE or len(moved) > 0.2 * len(moves):
        return None
    return finding("coarse-output", step.run.name, resolution=finest, unit=step.unit, steps=step.swing / finest)


def isolated_spikes(step: Step) -> Finding | None:
    """Single samples that stand far out of the rise."""
    found = spikes(step.rise, max(step.swing, 0.0))
    if not len(found):
        return None
    sizes = np.abs(step.rise[found])
    at = int(found[sizes.argmax()])
    return finding(
        "spikes", step.run.name, samples=len(found), value=float(step.rise[at]), unit=step.unit,
        at_s=float(step.run.time_s[step.start + at]),
    )  # fmt: skip
