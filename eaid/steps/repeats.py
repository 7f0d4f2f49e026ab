"""What stands there twice: a block of rows in one log, by noise that comes again to the last digit; a run in two logs.

Runs are one run where their values agree to their digits, or closer than noise allows, whatever their clocks, decimals,
rates, offsets and lengths are.

Of all pairs of stretches of w rows, w = 8, 16, 32, …, those that are equal are looked for, stretches that stand still
left out. By chance, by rounding, by hum, they come at many distances; a copied block makes them at one. Where some n²/2
pairs of w rows are alike at one distance only, a pair is alike by chance with a probability of 6/n² at most (95 %), and
one of 2 w rows, twice that in a row, in the whole log with 18/n²: a block of 2 w rows and more is a copy.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from eaid.arrays import Array, median
from eaid.findings import finding
from eaid.logs.run import Run
from eaid.steps.levels import grouped
from eaid.steps.noise import block_noise, stretches
from eaid.steps.step import sample_at, usual_step

SHORTEST_STRETCH = 8  # Rows of the shortest stretches that are compared
MIXES = np.uint64(0x9E3779B97F4A7C15)  # An odd number without pattern (2⁶⁴ over the golden ratio)
ROUGH = 1 / 3  # Share of its rows at which a block turns, at least: noise turns at two of three, a smooth curve at none
NEIGHBOURS_COMPARED = 60  # Runs of a level that each is compared with: those next to it by their means
# Samples before and behind a step that are compared: long logs take no more time and memory than that
BEFORE, BEHIND = 2_000, 20_000
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


class _Output(NamedTuple):
    """A run's output around its step."""

    run: Run
    values: Array
    at: int  # Sample at which its input steps
    usual_s: float  # Median sample time [s]
    slack: float  # What a copy may be off: half the unit of the last digit, or a part of the noise


def _output(run: Run) -> _Output:
    at = 0 if run.step_s is None else sample_at(run, run.step_s)
    if run.step_s is None and len(run.input):
        at = int((np.abs(run.input - run.input[:1]) > 0.1 * np.ptp(run.input)).argmax())
    begin = max(0, at - BEFORE)
    values = run.output[begin : at + BEHIND]
    gaps = np.diff(np.unique(values))
    digit = float(gaps.min()) if len(gaps) else 0.0  # the least by which two of its values differ
    rounding = 0.505 * digit + SINGLE * float(np.abs(values).max(initial=0.0))
    usual_s = usual_step(run.time_s) if len(run.time_s) > 1 else 1.0
    return _Output(run, values, at - begin, usual_s, max(rounding, COPIES_ALIKE * block_noise(values)))


def counted_once(runs: Sequence[Run]) -> list[Run]:
    """Runs without copies of a run of another log, their steps laid on each other; the longer one stays and says so."""
    kept = {id(run): run for run in runs}
    groups: dict[tuple[str, str, str, str], list[Run]] = {}
    for run in runs:
        groups.setdefault((run.edge, run.kind or "", run.input_unit, run.output_unit), []).append(run)
    for _, members in (level for group in groups.values() for level in grouped(group)):
        alone: list[_Output] = []
        for one in sorted(map(_output, members), key=lambda one: float(one.values.mean())):
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
            slack = max(one.slack, other.slack)
            if np.ptp(off) <= 2 * slack and np.ptp(a) > 0 and np.abs(off - median(off)).max() <= slack:
                return True
    return False
