"""What a log looks like that holds no single step: an input that reverses, sweeps or switches by chance, an output
with several edges.

The turns of an input that never rests tell which: at constant speed between them it is a position that reverses, with
even turns otherwise a sine, with turns that come ever faster or slower a sweep, with uneven ones noise. Two levels held
for multiples of one short time are a binary sequence (PRBS).
"""

import itertools
from collections.abc import Sequence

import numpy as np

from eaid.arrays import Array
from eaid.errors import DataError
from eaid.findings import Finding, finding, say
from eaid.logs.run import Run
from eaid.steps.edges import edges, turns
from eaid.steps.noise import block_means, line
from eaid.steps.plateaus import FEWEST, Plateau, bridge, plateaus, stands_still

SWITCHES = 10
"""Changes between two levels from which a binary sequence is looked for."""
EVEN = 0.15
"""Spread of the times between turns, relative to their mean, up to which they are even."""


def looks_like(run: Run) -> Finding | None:
    """A finding where a log's input is none of steps; None where it may be one."""
    holds, _ = bridge(plateaus(run.input))
    if not stands_still(holds, run.input):
        return moving(run.name, run.time_s, run.input)
    return _binary(run, holds)


def refuse_to_cut(run: Run, found: Finding | None = None) -> DataError:
    """Why a log is no record of steps, with what it looks like instead."""
    return DataError(f"{run.where}: {say(found or looks_like(run) or moving(run.name, run.time_s, run.input))}")


def moving(name: str, time_s: Array, values: Array) -> Finding:
    """What an input does that never stands still."""
    fine = block_means(values, min(len(values), 4000))
    times = block_means(time_s, min(len(values), 4000))
    low, high = np.quantile(fine, (0.02, 0.98)).tolist()
    at = turns(fine, 0.5 * (high - low))[1:-1]
    if len(at) < 2:
        return finding("input-moves", name)
    gaps = np.diff(times[at])
    if len(gaps) >= 4 and gaps.std() > 1e-9 * gaps.mean():
        order = float(np.corrcoef(np.arange(len(gaps)), np.log(gaps))[0, 1])
        ends = float(np.median(gaps[: max(1, len(gaps) // 4)]) / np.median(gaps[-max(1, len(gaps) // 4) :]))
        if abs(order) > 0.7 and not 1 / 1.8 < ends < 1.8:
            fast = 0.5 / min(gaps[:2].mean(), gaps[-2:].mean())
            slow = 0.5 / max(gaps[:2].mean(), gaps[-2:].mean())
            return finding("input-sweeps", name, from_hz=float(slow), to_hz=float(fast))
    ups = sum(1 for i in at if fine[i] < np.median(fine))
    if _constant_speed(times, fine, at):
        return finding("input-reverses", name, turns=len(at), upwards=ups)
    if all(len(g) == 0 or g.std() <= EVEN * g.mean() for g in (gaps[::2], gaps[1::2])):
        return finding("input-is-periodic", name, turns=len(at), hz=float(0.5 / gaps.mean()))
    return finding("input-moves", name)


def _constant_speed(times: Array, values: Array, at: list[int]) -> bool:
    """True where values go from turn to turn along straight lines."""
    off, span = [], float(np.ptp(values))
    for a, b in itertools.pairwise(at):
        if b - a < 8:
            return False
        inner = slice(a + (b - a) // 10, b - (b - a) // 10)
        off.append(float(np.abs(line(times[inner], values[inner]).left).max()) / span)
    # a sine is off by 0.04 of its range over the middle 80 % of a half period
    return float(np.median(off)) < 0.03


def _binary(run: Run, holds: Sequence[Plateau]) -> Finding | None:
    """Two levels held for many different multiples of one short time."""
    counts = np.array([float(plateau.count) for plateau in holds[1:-1]])
    if len(counts) < SWITCHES:
        return None
    levels = np.array([plateau.level for plateau in holds])
    low, high = levels.min(), levels.max()
    nearer = np.where(levels > (low + high) / 2, high, low)
    if np.abs(levels - nearer).max() > 0.05 * (high - low):
        return None
    clock = float(np.quantile(counts, 0.05))
    multiples = counts / clock
    kinds = len(set(np.round(multiples).astype(int).tolist()))
    if kinds < 3 or float(np.median(np.abs(multiples - np.round(multiples)))) > 0.15:
        return None
    usual = float(np.median(np.diff(run.time_s)))
    return finding("input-is-binary", run.name, switches=len(holds) - 1, clock_s=clock * usual)


def several_edges(name: str, time_s: Array, output: Array, first_s: float = 0.0) -> Finding | None:
    """A finding where an output has more than one edge although its input says nothing of it."""
    if len(output) < 4 * FEWEST:
        return None
    # the end of a window given by hand may hold the first samples of the release
    until = len(output) - len(output) // 50
    every = edges(time_s[:until], output[:until])
    if sum(one.swings for one in every) < 2:
        return None
    return finding(
        "several-edges", name, edges=len(every), at_s=tuple(edge.at_s + first_s for edge in every),
        rise_s=tuple(edge.rise_s for edge in every), overshoot_pct=tuple(edge.overshoot_pct for edge in every),
        settling_s=tuple(-1.0 if edge.settling_s is None else edge.settling_s for edge in every),
    )  # fmt: skip
