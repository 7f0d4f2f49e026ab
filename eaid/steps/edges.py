"""Edges of an output by itself: where it goes from one value to another, and how (rise, overshoot, settling of each).

The output is averaged to at most 400 blocks; stretches of a twentieth of the record or more in which it hardly moves
are rests, and an edge goes from one rest to the next of another value, however it swings between them.
"""

import itertools
from dataclasses import dataclass

import numpy as np

from eaid.arrays import Array, median
from eaid.findings import Finding, finding
from eaid.steps.noise import block_means, block_noise, sample_noise, stretches
from eaid.steps.plateaus import BACK, FEWEST, turns

BLOCKS = 400
MOVES = 0.15
"""Share of the range by which rests differ for an edge to lie between them; behind the first edge the output moves by
as much in a fiftieth of the record, for what comes back slower is drift."""
RESTS = 0.03
"""Share of the range that an output at rest moves at most in a fiftieth of the record."""
JUMP = 0.1
"""Share of a reference's range by which it changes from one sample to the next where it jumps."""
CLEAR = 14.0
"""Standard errors of a block mean that the range has to exceed: a turn is then half of them."""


@dataclass(frozen=True)
class Edge:
    """One edge of an output."""

    at_s: float
    """Where it begins, at a tenth of the change [s]."""
    before: float
    after: float
    rise_s: float
    """Time from 10 to 90 % of the change [s]."""
    overshoot_pct: float
    """How far it goes beyond its end value [% of the change]."""
    settling_s: float | None
    """Time until it stays within 5 % of the change about its end value [s]; None where it does not."""
    swings: int = 1
    """Swings by half of the range before it rests: 2 are an overshoot by more than that."""


def reference_edges(time_s: Array, output: Array, reference: Array) -> tuple[Edge, ...]:
    """The edges of an output where its reference jumps, each until the next jump; none where that never jumps."""
    change = np.abs(np.diff(reference))
    least = max(JUMP * float(np.ptp(reference)), 20 * median(change))
    jumps = (np.flatnonzero(change >= least) + 1).tolist() if least > 0 else []
    apart = max(2, len(reference) // 100)
    at = [place for k, place in enumerate(jumps) if k == 0 or place - jumps[k - 1] >= apart]
    measured = []
    for start, stop in itertools.pairwise([*at, len(output)]):
        count = stop - start
        if count < 10:
            continue
        rest = median(output[max(0, start - count // 5) : start])
        goal = median(output[start + count // 2 : stop])
        blocks = min(BLOCKS, count)
        times, means = block_means(time_s[start:stop], blocks), block_means(output[start:stop], blocks)
        if goal != rest:
            measured.append(_measured(times, means, (0, blocks), rest, goal))
    return tuple(measured)


def edges(time_s: Array, output: Array, reference: Array | None = None) -> tuple[Edge, ...]:
    """The edges of an output, shapes (n,): those its reference asks for by a jump, else those beyond its noise."""
    if len(output) < 40:
        return ()
    if reference is not None and (jumps := reference_edges(time_s, output, reference)):
        return jumps
    means = block_means(output, BLOCKS)
    times = block_means(time_s, BLOCKS)
    low, high = np.quantile(means, (0.01, 0.99)).tolist()
    span = float(high - low)
    # neighbours three apart: hum and rotor ripple last for longer than a block
    noise = max(sample_noise(output) / np.sqrt(len(output) / len(means)), block_noise(means), block_noise(means[::3]))
    if span <= CLEAR * noise or span <= 0:
        return ()
    lag, still = max(1, len(means) // 50), max(2, len(means) // 20)
    moves = np.abs(means[lag:] - means[:-lag]) / span
    rests = [(a, b) for a, b in np.column_stack(stretches(moves < RESTS)).tolist() if b + lag - a >= still]
    if not rests or rests[0][0] > 0:
        rests.insert(0, (0, 1))
    if rests[-1][1] + lag < len(means):
        rests.append((len(means) - 1, len(means)))
    levels = [median(means[a : b + 1]) for a, b in rests]
    every: list[Edge] = []
    last = 0  # the rest that the next edge leaves
    for k in range(1, len(rests)):
        start, stop = rests[last][1], len(means) if k == len(rests) - 1 else rests[k][1]
        between = means[start:stop]
        up, down = between - np.minimum.accumulate(between), np.maximum.accumulate(between) - between
        swings = 1
        if min(up.max(initial=0.0), down.max(initial=0.0)) >= BACK * span:
            swings = int((np.abs(np.diff(between[turns(between, BACK * span)])) >= BACK * span).sum())
        if abs(levels[k] - levels[last]) >= MOVES * span or swings > 1:
            if not every or moves[start : rests[k][0] + 1].max(initial=0.0) >= MOVES:
                every.append(_measured(times, means, (start, stop), levels[last], levels[k], max(1, swings)))
            last = k
    return tuple(every)


def _shares(means: Array, within: tuple[int, int], before: float, after: float) -> tuple[Array, int, int]:
    """How much of a change is done at each block, and the first blocks of an edge with 10 and 90 % of it."""
    share = (means - before) / (after - before) if after != before else np.zeros(len(means))
    inside = share[slice(*within)]
    return share, within[0] + int(np.argmax(inside >= 0.1)), within[0] + int(np.argmax(inside >= 0.9))


def _measured(
    times: Array, means: Array, within: tuple[int, int], before: float, after: float, swings: int = 1
) -> Edge:
    """Rise, overshoot and settling of an edge between two values, in blocks start … end − 1."""
    end = within[1]
    share, tenth, most = _shares(means, within, before, after)
    near = np.abs(share[tenth:end] - 1) <= 0.05
    # what follows the last sample within 5 % is the next edge
    rest = int(np.flatnonzero(near)[-1]) if near.any() else 0
    outside = np.flatnonzero(~near[:rest])
    settled = int(outside[-1]) + 1 if len(outside) else 0
    return Edge(
        at_s=float(times[tenth]),
        before=before,
        after=after,
        rise_s=float(times[most] - times[tenth]),
        overshoot_pct=max(0.0, 100 * (float(share[tenth:end].max()) - 1)),
        settling_s=float(times[tenth + settled] - times[tenth]) if rest > settled else None,
        swings=swings,
    )


def several_edges(name: str, time_s: Array, output: Array, first_s: float = 0.0) -> Finding | None:
    """A finding where an output has more than one edge although its input says nothing of it."""
    if len(output) < 4 * FEWEST:
        return None
    # the end of a window given by hand may hold the first samples of the release
    until = len(output) - len(output) // 50
    every = edges(time_s[:until], output[:until])
    if sum(edge.swings for edge in every) < 2:
        return None
    return finding(
        "several-edges", name, edges=len(every), at_s=tuple(edge.at_s + first_s for edge in every),
        rise_s=tuple(edge.rise_s for edge in every), overshoot_pct=tuple(edge.overshoot_pct for edge in every),
        settling_s=tuple(-1.0 if edge.settling_s is None else edge.settling_s for edge in every),
    )  # fmt: skip
