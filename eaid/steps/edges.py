"""Edges of an output by itself: where it goes from one value to another, and how (rise, overshoot, settling of each).

The output is averaged to at most 400 blocks and followed from turn to turn: a turn counts where the way back is
`BACK` of the whole range. Between two turns, stretches that rest part one edge from the next.
"""

import itertools
from dataclasses import dataclass

import numpy as np

from eaid.arrays import Array
from eaid.steps.noise import block_means, block_noise, sample_noise

BLOCKS = 400
BACK = 0.5
"""Share of the output's range by which it has to come back for a turn."""
QUICK = 0.2
"""Share of the record that an edge behind the first may take: what comes back slower is drift."""
MOVES = 0.15
"""Share of the range that an edge moves within a fiftieth of the record."""
RESTS = 0.03
"""Share of the range within which a stretch of a twentieth of the record rests."""
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


def turns(values: Array, back: float) -> list[int]:
    """Places of the extremes between which values go to and fro by at least `back`, the ends among them."""
    places, low, high, direction = [0], 0, 0, 0
    for i, value in enumerate(values.tolist()):
        if value > values[high]:
            high = i
        if value < values[low]:
            low = i
        if direction >= 0 and values[high] - value >= back:
            if direction > 0 or high > 0:
                places.append(high)
            direction, low = -1, i
            high = i
        elif direction <= 0 and value - values[low] >= back:
            if direction < 0 or low > 0:
                places.append(low)
            direction, high = 1, i
            low = i
    last = len(values) - 1
    return [*dict.fromkeys(places), *([last] if places[-1] != last else [])]


def edges(time_s: Array, output: Array) -> tuple[Edge, ...]:
    """The edges of an output, shapes (n,); none where nothing stands out of its noise."""
    if len(output) < 40:
        return ()
    means = block_means(output, BLOCKS)
    times = block_means(time_s, BLOCKS)
    low, high = np.quantile(means, (0.01, 0.99)).tolist()
    span = float(high - low)
    # neighbours three apart: hum and rotor ripple last for longer than a block
    noise = max(sample_noise(output) / np.sqrt(len(output) / len(means)), block_noise(means), block_noise(means[::3]))
    if span <= CLEAR * noise or span <= 0:
        return ()
    found: list[Edge] = []
    for start, stop in itertools.pairwise(turns(means, BACK * span)):
        if abs(means[stop] - means[start]) >= MOVES * span:
            parts = _parts(means, start, stop + 1, span)
            if found and len(parts) > 1 and abs(means[parts[0][1] - 1] - means[start]) < BACK * span:
                parts = parts[1:]  # what comes back from an overshoot belongs to the edge before
            # the hold behind the last edge of a leg goes on behind the turn
            found += [_edge(times, means, a, b, b if b <= stop else len(means)) for a, b in parts]
    found = [edge for edge in found if abs(edge.after - edge.before) >= MOVES * span]
    window = float(times[-1] - times[0])
    return (*found[:1], *(edge for edge in found[1:] if edge.rise_s < QUICK * window))


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


def _edge(times: Array, means: Array, start: int, stop: int, limit: int) -> Edge:
    """The edge between two extremes, with the stretch behind it that stays nearer to the second."""
    low, high = float(means[start]), float(means[stop - 1])
    share = (means - low) / (high - low) if high != low else np.zeros(len(means))
    tenth = start + int(np.argmax(share[start:stop] >= 0.1))
    most = start + int(np.argmax(share[start:stop] >= 0.9))
    away = np.flatnonzero(share[most:limit] < 0.5)
    end = most + int(away[0]) if len(away) else limit
    before = float(np.median(means[start : max(tenth, start + 1)]))
    after = float(np.median(means[(most + end) // 2 : end]))
    share = (means - before) / (after - before) if after != before else share
    tenth = start + int(np.argmax(share[start:end] >= 0.1))
    most = start + int(np.argmax(share[start:end] >= 0.9))
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
    )
