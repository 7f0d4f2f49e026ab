"""A log in which a position goes to and fro → its reversals, each a step of friction from the output at its turn.

At a turn the speed is zero and the friction changes its sign: t = 0 is the extreme of the position, and the output
there is the start. A stroke ends where it slows down for the next turn. Strokes downwards count as negative inputs, as
the other sign of a voltage does.
"""

import itertools
from dataclasses import replace

import numpy as np

from eaid.arrays import Array, median
from eaid.errors import DataError
from eaid.findings import finding
from eaid.logs.run import Run
from eaid.steps.baseline import first_samples
from eaid.steps.by_instant import no_level
from eaid.steps.edges import BACK, turns
from eaid.steps.noise import block_means, block_noise
from eaid.steps.plateaus import FEWEST

BLOCKS = 4000
SLOWS = 0.8
"""Share of its usual speed below which a stroke slows down."""


def cut_reversals(run: Run) -> list[Run]:
    """The strokes of a log with a position, shape (n,), each from its turn to the next; its level is the input's.

    Raises DataError where the position never turns, or nothing tells the level.
    """
    assert run.position is not None
    at = turns_of(run.position)
    if not len(at):
        raise DataError(f"{run.where}: its position never turns; leave «columns» position out")
    known = bool(np.isfinite(run.input).all())
    if run.level is None and not known:
        raise no_level(run)
    legs = [(a, _still_fast(run.position[a:b]) + a) for a, b in itertools.pairwise([*at, len(run.time_s)])]
    strokes = [(a, b) for a, b in legs if b - a >= FEWEST]
    steps = []
    for k, (start, stop) in enumerate(strokes):
        way = 1.0 if float(run.position[stop - 1]) > float(run.position[start]) else -1.0
        level = abs(median(run.input[start:stop])) if run.level is None else run.level
        stroke = run.part(
            slice(start, stop), name=f"{run.name}-{k + 1}", step_s=float(run.time_s[start]), until_s=None, cut=True,
            level=way * level, baseline=first_samples(run.output[start:stop]), repeat=None,
        )  # fmt: skip
        steps.append(replace(stroke, input=np.abs(stroke.input) * way if known else stroke.input))
    said = finding("cut-at-reversals", run.name, reversals=len(steps))
    return [replace(steps[0], findings=(*run.findings, said)), *(replace(one, findings=()) for one in steps[1:])]


def _still_fast(stroke: Array) -> int:
    """Samples of a stroke until it slows down for the next turn, for the friction then changes with the speed."""
    lag = max(1, len(stroke) // 40)
    speed = np.abs(stroke[lag:] - stroke[:-lag])
    return int(np.flatnonzero(speed >= SLOWS * median(speed))[-1]) + lag if len(speed) else len(stroke)


def turns_of(position: Array) -> list[int]:
    """Samples at which a position turns: extremes between which it goes by `BACK` of its range; none of mere noise."""
    means = block_means(position, BLOCKS)
    span, width = float(np.ptp(means)), len(position) / len(means)
    if span <= 20 * block_noise(means):
        return []
    places = turns(means, BACK * span)
    samples = []
    for before, k in itertools.pairwise(places[:-1]):
        if abs(means[k] - means[before]) < BACK * span:
            continue  # noise at the very start
        low = int(max(0, (k - 1) * width))
        near = position[low : int((k + 2) * width) + 1]
        samples.append(low + int(near.argmax() if means[k] > means[before] else near.argmin()))
    return samples
