"""What stands there twice: a block of rows in one log, by noise that comes again to the last digit; a run in two logs.

Runs are one run where their values agree to their digits, or closer than noise allows, whatever their clocks, decimals,
rates, offsets and lengths are.

Of all pairs of stretches of w rows, w = 1, 2, 3, …, those that are equal are counted, stretches that stand still left
out. By chance, by rounding, by hum, they come at many distances; a copied block makes them at one. Of the others there
are N, and r N where they are one row longer, r by the widths at which N was last known well: rows as many as the block
has are equal by chance N r^(rows − w) times, and it is a copy where that is next to never.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from eaid.arrays import Array, median
from eaid.findings import finding
from eaid.logs.run import Run
from eaid.steps.levels import grouped
from eaid.steps.noise import block_noise, noise_beside_ripple, stretches
from eaid.steps.step import sample_at, usual_step

KNOWN_WELL = 100  # Pairs whose number tells how it falls from row to row
COPY_CHANCE = 1e-4  # A block that chance makes no more often is a copy
FEWEST_BLOCK_ROWS = 5  # Of a block: whether fewer are noise or a curve cannot be told
MIXES = np.uint64(0x9E3779B97F4A7C15)  # An odd number without pattern (2⁶⁴ over the golden ratio)
ROUGH = 0.25  # Share of its rows at which a block turns, at least: noise turns at half of them and more, curves at few
NEIGHBOURS_COMPARED = 60  # Runs of a level that each is compared with: those next to it by their means
# Samples before and behind a step that are compared: long logs take no more time and memory than that
ROWS_BEFORE, ROWS_BEHIND = 2_000, 20_000
LEAST_COMMON = 20  # Samples in common below which nothing is compared
SINGLE = 1e-6  # Rounding of a single-precision float
COPIES_ALIKE = 0.5  # Standard deviations of the noise within which no two recordings agree in all of their samples


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
    moves, places = np.concatenate(([0], np.cumsum(np.diff(values) != 0))), np.arange(count)
    if not _comes_again(kinds, moves):  # as of most records: nothing to count
        return None
    pairs, fall, known = count**2 / 2, 0.0, 0
    while True:
        places, alike = _in_order(kinds, places)
        if not alike.any():
            return None
        (starts, stops), apart = stretches(alike), np.diff(places)[alike]
        distances, often = np.unique(apart, return_counts=True)
        others = float(((stops - starts + 1.0) * (stops - starts) / 2).sum()) - int(often.max())
        if others == 0:
            break
        if others >= KNOWN_WELL:
            most = others + 2 * np.sqrt(others)
            pairs, fall, known = most, (most / pairs) ** (1 / (width - known)), width
        more = max(1, width // 2)
        kinds = _longer(kinds, more)
        width += more
        places = places[np.append(alike, False) | np.append(False, alike)]
        places = places[places < len(kinds)]
        places = places[moves[places + width - 1] > moves[places]]
    later = int(distances[0])
    starts, stops = stretches(values[later:] == values[:-later])
    longest = max(np.searchsorted(stops, places[:-1][alike], "right"), key=lambda k: int(stops[k] - starts[k]))
    at, rows = int(starts[longest]), int(stops[longest] - starts[longest])
    steps = np.diff(values[at : at + rows])
    turns = np.count_nonzero(steps[1:] * steps[:-1] < 0)
    by_chance = pairs * (fall or (3 / pairs) ** (1 / width)) ** (rows - known)
    copied = by_chance <= COPY_CHANCE and rows >= FEWEST_BLOCK_ROWS and turns >= ROUGH * rows
    return Copy(at, rows, later) if copied else None


def _in_order(kinds: NDArray[np.uint64], places: NDArray[np.intp]) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """Places by their numbers, those of one number by themselves; and whether the next has the same number, (n − 1,).

    The number's last bits give way to the place, so that numbers alone are put in order, which is five times as fast.
    """
    bits = np.uint64(len(kinds).bit_length())
    both = np.sort(((kinds[places] * MIXES) >> bits << bits) | places.astype(np.uint64))
    return (both & ((np.uint64(1) << bits) - np.uint64(1))).astype(np.intp), np.diff(both >> bits) == 0


def _longer(kinds: NDArray[np.uint64], rows: int) -> NDArray[np.uint64]:
    """The numbers of stretches that are so many rows longer, each from those of two that cover it."""
    return np.asarray(kinds[:-rows] * MIXES + (kinds[rows:] ^ (kinds[rows:] >> np.uint64(29))))


def _comes_again(kinds: NDArray[np.uint64], moves: NDArray[np.intp]) -> bool:
    """Whether a stretch of `FEWEST_BLOCK_ROWS` that does not stand still comes twice, by the numbers of single rows."""
    for _ in range(FEWEST_BLOCK_ROWS - 1):
        kinds = _longer(kinds, 1)
    moving = np.sort(kinds[moves[FEWEST_BLOCK_ROWS - 1 :] > moves[: 1 - FEWEST_BLOCK_ROWS]])
    return bool((moving[1:] == moving[:-1]).any())


class _Output(NamedTuple):
    """A run's output around its step."""

    run: Run
    values: Array
    at: int  # Sample at which its input steps
    usual_s: float  # Median sample time [s]
    rounding: float  # What a copy may be off by its last digit: half of it and a little
    slack: float  # The same, or a part of the noise

    @property
    def slack_beside_ripple(self) -> float:
        """The same where a ripple of the drive, alike in every run, counts for no noise."""
        noise = min(block_noise(self.values), noise_beside_ripple(self.values))
        return max(self.rounding, COPIES_ALIKE * noise)


def _output_of(run: Run) -> _Output:
    at = 0 if run.step_s is None else sample_at(run, run.step_s)
    if run.step_s is None and len(run.input):
        at = int((np.abs(run.input - run.input[:1]) > 0.1 * np.ptp(run.input)).argmax())
    begin = max(0, at - ROWS_BEFORE)
    values = run.output[begin : at + ROWS_BEHIND]
    gaps = np.diff(np.unique(values))
    digit = float(gaps.min()) if len(gaps) else 0.0  # the least by which two of its values differ
    rounding = 0.6 * digit + SINGLE * float(np.abs(values).max(initial=0.0))
    usual_s = usual_step(run.time_s) if len(run.time_s) > 1 else 1.0
    slack = max(rounding, COPIES_ALIKE * block_noise(values))
    return _Output(run, values, at - begin, usual_s, rounding, slack)


def counted_once(runs: Sequence[Run]) -> list[Run]:
    """Runs without copies of a run of another log, their steps laid on each other; the longer one stays and says so."""
    kept = {id(run): run for run in runs}
    groups: dict[tuple[str, str, str, str], list[Run]] = {}
    for run in runs:
        groups.setdefault((run.edge, run.kind or "", run.input_unit, run.output_unit), []).append(run)
    for _, members in (level for group in groups.values() for level in grouped(group)):
        alone: list[_Output] = []
        for one in sorted(map(_output_of, members), key=lambda one: float(one.values.mean())):
            for k, other in list(enumerate(alone))[-NEIGHBOURS_COMPARED:]:
                same_log = (one.run.dataset, one.run.source) == (other.run.dataset, other.run.source)
                if same_log or not _copied(one, other):
                    continue
                longer, shorter = (one, other) if len(one.run.output) > len(other.run.output) else (other, one)
                told = kept[id(longer.run)]
                note = finding("run-given-twice", told.name, (told.level or 0.0,), other=shorter.run.where)
                kept[id(longer.run)] = replace(told, findings=(*told.findings, note))
                del kept[id(shorter.run)]
                alone[k] = longer
                break
            else:
                alone.append(one)
    return list(kept.values())


def _copied(one: _Output, other: _Output) -> bool:
    """Whether one run's values are those of another, or every so many of them, but for rounding and an offset."""
    fine, coarse = (one, other) if one.usual_s <= other.usual_s else (other, one)
    slower = round(coarse.usual_s / fine.usual_s)
    for stride in {1, slower if slower * LEAST_COMMON < len(fine.values) else 1}:
        for shift in range(-stride, stride + 1):
            at, first = divmod(fine.at + shift, stride)
            of_fine = fine.values[first::stride]
            before, behind = min(at, coarse.at), min(len(of_fine) - at, len(coarse.values) - coarse.at)
            if before < 0 or before + behind < LEAST_COMMON:
                continue
            a = of_fine[at - before : at + behind]
            off = a - coarse.values[coarse.at - before : coarse.at + behind]
            if np.ptp(off) > 2 * max(one.slack, other.slack) or np.ptp(a) == 0:
                continue
            if np.abs(off - median(off)).max() <= max(one.slack_beside_ripple, other.slack_beside_ripple):
                return True
    return False
