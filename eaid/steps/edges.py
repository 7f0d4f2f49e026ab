"""Edges of an output by itself: where it goes from one value to another, and how (rise, overshoot, settling of each).

The output is averaged to at most 400 blocks and followed from turn to turn: a turn counts where the way back is
`BACK` of the whole range. Between two turns, stretches that rest part one edge from the next.
"""

import itertools
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from eaid.arrays import Array, median
from eaid.findings import Finding, finding
from eaid.steps.noise import block_means, block_noise, sample_noise
from eaid.steps.plateaus import BACK, FEWEST, turns

BLOCKS = 400
QUICK = 0.2
"""Share of the record that an edge behind the first may take: what comes back slower is drift."""
MOVES = 0.15
"""Share of the range that an edge moves within a fiftieth of the record."""
RESTS = 0.03
"""Share of the range within which a stretch of a twentieth of the record rests."""
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


class _Leg(NamedTuple):
    """An edge in blocks start … end − 1, and whether it ends in a rest."""

    edge: Edge
    start: int
    end: int
    rests: bool


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
    pieces: list[tuple[int, int, int]] = []
    for start, stop in itertools.pairwise(turns(means, BACK * span)):
        if abs(means[stop] - means[start]) >= MOVES * span:
            parts = _parts(means, start, stop + 1, span)
            if pieces and len(parts) > 1 and abs(means[parts[0][1] - 1] - means[start]) < BACK * span:
                parts = parts[1:]  # what comes back from an overshoot belongs to the edge before
            # the hold behind the last edge of a leg goes on behind the turn
            pieces += [(a, b, b if b <= stop else len(means)) for a, b in parts]
    legs = [_edge(times, means, *piece) for piece in pieces]
    legs = [leg for leg in legs if abs(leg.edge.after - leg.edge.before) >= MOVES * span]
    quick = [leg for leg in legs[1:] if leg.edge.rise_s < QUICK * float(times[-1] - times[0])]
    done: list[Edge] = []
    swings: list[_Leg] = []
    for leg in [*legs[:1], *quick]:  # what swings to and fro before it rests is one edge with its overshoot
        swings.append(leg)
        if leg.rests:
            before, after = swings[0].edge.before, leg.edge.after
            single = len(swings) == 1 or abs(after - before) < 0.1 * np.ptp(means)
            within = (swings[0].start, leg.end)
            done.append(leg.edge if single else _measured(times, means, within, before, after, len(swings)))
            swings = []
    return (*done, *(leg.edge for leg in swings))


def _parts(means: Array, start: int, stop: int, span: float) -> list[tuple[int, int]]:
    """A leg between two turns as pieces with one edge each: those between moves with a rest in between."""
    lag, still = max(1, len(means) // 50), max(2, len(means) // 20)
    if stop - start < 2 * still + lag:
        return [(start, stop)] if stop - start >= 2 else []
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


def _edge(times: Array, means: Array, start: int, stop: int, limit: int) -> _Leg:
    """The edge between two extremes, with the stretch behind it that stays nearer to the second."""
    share, tenth, most = _shares(means, (start, stop), float(means[start]), float(means[stop - 1]))
    away = np.flatnonzero(share[most:limit] < 0.5)
    end = most + max(1, int(away[0])) if len(away) else limit
    before = median(means[start : max(tenth, start + 1)])
    after = median(means[(most + end) // 2 : end])
    near = np.abs(means[most:end] - after) <= 0.05 * abs(after - before)
    rests = int(near.sum()) >= max(4, len(means) // 50, 0.4 * (end - most))
    return _Leg(_measured(times, means, (start, end), before, after), start, end, rests)


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
    if sum(one.swings for one in every) < 2:
        return None
    return finding(
        "several-edges", name, edges=len(every), at_s=tuple(edge.at_s + first_s for edge in every),
        rise_s=tuple(edge.rise_s for edge in every), overshoot_pct=tuple(edge.overshoot_pct for edge in every),
        settling_s=tuple(-1.0 if edge.settling_s is None else edge.settling_s for edge in every),
    )  # fmt: skip
