"""A block of rows written twice: noise that comes again to the last digit.

Of all pairs of stretches of w rows, w = 8, 16, 32, …, those that are equal are looked for, stretches that stand still
left out. By chance, by rounding, by hum, they come at many distances; a copied block makes them at one. Where some n²/2
pairs of w rows are alike at one distance only, a pair is alike by chance with a probability of 6/n² at most (95 %), and
one of 2 w rows, twice that in a row, in the whole log with 18/n²: a block of 2 w rows and more is a copy.
"""

from typing import NamedTuple

import numpy as np

from eaid.arrays import Array
from eaid.steps.noise import stretches

SHORTEST_STRETCH = 8  # Rows of the shortest stretches that are compared
MIXES = np.uint64(0x9E3779B97F4A7C15)  # An odd number without pattern (2⁶⁴ over the golden ratio)
ROUGH = 1 / 3  # Share of its rows at which a block turns, at least: noise turns at two of three, a smooth curve at none


class Copy(NamedTuple):
    """Rows `first` … `first + rows − 1` come again `later` rows on."""

    first: int
    rows: int
    later: int


def copied_block(values: Array) -> Copy | None:
    """The longest block of rows that stands in a record twice, more than chance makes; None of one without."""
    count, width = len(values), 1
    # numbers of 64 bits that stretches of `width` rows share where they are equal, and by chance hardly ever else
    kinds = (np.asarray(values, dtype=np.float64) + 0.0).view(np.uint64)
    moves = np.concatenate(([0], np.cumsum(np.diff(values) != 0)))
    while len(kinds) > 2 * width:
        kinds = kinds[:-width] * MIXES + (kinds[width:] ^ (kinds[width:] >> np.uint64(29)))
        width *= 2
        if width < SHORTEST_STRETCH:
            continue
        moving = np.flatnonzero(moves[width - 1 :] > moves[: len(kinds)])
        places = moving[np.argsort(kinds[moving], kind="stable")]
        alike = np.diff(kinds[places]) == 0
        if not alike.any():
            return None
        apart = np.diff(places)[alike]
        if apart.min() < apart.max() or (alike[1:] & alike[:-1]).any():
            continue  # so many rows are alike by chance
        first = np.zeros(count, dtype=bool)
        first[places[:-1][alike]] = True
        starts, stops = stretches(first)
        longest = int((stops - starts).argmax())
        at, rows = int(starts[longest]), int(stops[longest] - starts[longest]) + width - 1
        steps = np.diff(values[at : at + rows])
        turns = np.count_nonzero(steps[1:] * steps[:-1] < 0)
        return Copy(at, rows, int(apart[0])) if rows >= 2 * width and turns >= ROUGH * rows else None
    return None
