"""Edges of an output by itself: where it goes from one value to another, and how (rise, overshoot, settling of each).

The output is averaged to at most 400 blocks and followed from turn to turn: a turn counts where the way back is
`BACK` of the whole range. Between two turns, stretches that rest part one edge from the next.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from eaid.arrays import Array, median
from eaid.errors import DataError
from eaid.findings import Finding, finding, say
from eaid.logs.run import Run
from eaid.steps.noise import block_means, block_noise, line, sample_noise
from eaid.steps.plateaus import FEWEST, Plateau, bridge, plateaus, stands_still

BLOCKS = 400
BACK = 0.5
"""Share of the output's range by which it has to come back for a turn."""
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


def jumps(reference: Array) -> list[int]:
    """First samples behind the jumps of a reference; none where it runs smoothly."""
    change = np.abs(np.diff(reference))
    least = max(JUMP * float(np.ptp(reference)), 20 * median(change))
    at = (np.flatnonzero(change >= least) + 1).tolist() if least > 0 else []
    apart = max(2, len(reference) // 100)
    return [place for k, place in enumerate(at) if k == 0 or place - at[k - 1] >= apart]


def asked_edges(time_s: Array, output: Array, reference: Array) -> tuple[Edge, ...]:
    """The edges of an output where its reference jumps, each until the next jump; none where that never jumps."""
    measured = []
    at = jumps(reference)
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
    if reference is not None and (asked := asked_edges(time_s, output, reference)):
        return asked
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
    window = float(times[-1] - times[0])
    return _merged(times, means, [*legs[:1], *(leg for leg in legs[1:] if leg.edge.rise_s < QUICK * window)])


@dataclass(frozen=True)
class _Leg:
    """An edge in blocks start … end − 1, and whether it ends in a rest."""

    edge: Edge
    start: int
    end: int
    rests: bool


def _merged(times: Array, means: Array, legs: list[_Leg]) -> tuple[Edge, ...]:
    """Edges, where what swings to and fro before it rests is one of them with its overshoot."""
    done: list[Edge] = []
    swings: list[_Leg] = []
    for leg in legs:
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
        ends = float(median(gaps[: max(1, len(gaps) // 4)]) / median(gaps[-max(1, len(gaps) // 4) :]))
        if abs(order) > 0.7 and not 1 / 1.8 < ends < 1.8:
            fast = 0.5 / min(gaps[:2].mean(), gaps[-2:].mean())
            slow = 0.5 / max(gaps[:2].mean(), gaps[-2:].mean())
            return finding("input-sweeps", name, from_hz=float(slow), to_hz=float(fast))
    ups = sum(1 for i in at if fine[i] < median(fine))
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
    return median(off) < 0.03


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
    if kinds < 3 or median(np.abs(multiples - np.round(multiples))) > 0.15:
        return None
    usual = median(np.diff(run.time_s))
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
