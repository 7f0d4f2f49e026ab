"""Edges of an output by itself: several of them, where the input tells of one at most, are no step.

The output is averaged to at most 400 blocks and followed from turn to turn: a turn counts where the way back is
`BACK` of the whole range. Between two turns, stretches that rest part one edge from the next.
"""

import itertools

import numpy as np

from eaid.arrays import Array
from eaid.findings import Finding, finding
from eaid.steps.noise import block_means, block_noise, sample_noise
from eaid.steps.plateaus import BACK, FEWEST, turns

BLOCKS = 400
QUICK = 0.2  # Share of the record that an edge behind the first may take: what comes back slower is drift
MOVES = 0.15  # Share of the range that an edge moves within a fiftieth of the record
RESTS = 0.03  # Share of the range within which a stretch of a twentieth of the record rests
CLEAR = 14.0  # Standard errors of a block mean that the range has to exceed: a turn is then half of them


def several_edges(name: str, time_s: Array, output: Array, first_s: float = 0.0) -> Finding | None:
    """A finding where an output has more than one edge although its input says nothing of it."""
    if len(output) < 4 * FEWEST:
        return None
    # the end of a window given by hand may hold the first samples of the release
    until = len(output) - len(output) // 50
    times, means = (block_means(values[:until], BLOCKS) for values in (time_s, output))
    low, high = np.quantile(means, (0.01, 0.99)).tolist()
    span = high - low
    # neighbours three apart: hum and rotor ripple last for longer than a block
    noise = max(sample_noise(output) / np.sqrt(until / len(means)), block_noise(means), block_noise(means[::3]))
    at_s: list[float] = []
    for start, stop in itertools.pairwise(turns(means, BACK * span) if span > CLEAR * noise else []):
        for a, b in _parts(means, start, stop + 1, span):
            change = means[b - 1] - means[a]
            if abs(change) < MOVES * span:
                continue
            share = (means[a:b] - means[a]) / change
            begins, ends = float(times[a + (share >= 0.1).argmax()]), float(times[a + (share >= 0.9).argmax()])
            if not at_s or ends - begins < QUICK * float(times[-1] - times[0]):
                at_s.append(begins + first_s)
    if len(at_s) < 2:
        return None
    return finding("several-edges", name, edges=len(at_s), first_s=at_s[0], last_s=at_s[-1])


def _parts(means: Array, start: int, stop: int, span: float) -> list[tuple[int, int]]:
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
