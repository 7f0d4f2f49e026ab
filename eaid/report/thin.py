"""Long recordings → few points that draw alike: block means of a run as it is read, extremes of a curve as drawn."""

from dataclasses import replace

import numpy as np

from eaid.arrays import Array, read_only
from eaid.logs.run import Run
from eaid.steps.stepset import StepSet

MOST = 400_000
"""Samples of a run from which on blocks of it are averaged: the page draws a hundredth of them."""
MOST_OF_ALL = 5_000_000
"""The same for all runs of a dataset, several of which a report may hold."""
LEAST = 4_000
"""Samples that each run keeps where there are thousands of runs."""
PIECE = 1 << 20


def shortened(run: Run, runs: int = 1) -> tuple[Run, int]:
    """A run, one of so many, of at most about `MOST` samples, and how many samples each of its values is the mean of.

    Blocks begin at the step, so that none holds samples from before and after it; of the input each block keeps its
    first value.
    """
    every = -(-len(run.time_s) // min(MOST, max(LEAST, MOST_OF_ALL // runs)))
    if every == 1 or run.step_s is None:
        return run, 1
    offset = int(np.searchsorted(run.time_s, run.step_s)) % every
    time, output = (_means(values, offset, every) for values in (run.time_s, run.output))
    first = read_only(np.array(run.input[offset::every][: len(time)]))
    return replace(run, time_s=time, input=first, output=output, reference_nm=None), every


def _means(values: Array, offset: int, every: int) -> Array:
    count = (len(values) - offset) // every
    found = np.empty(count)
    step = max(PIECE // every, 1)
    for at in range(0, count, step):
        some = np.asarray(values[offset + at * every : offset + min(at + step, count) * every])
        found[at : at + step] = some.reshape(-1, every).mean(axis=1)
    return read_only(found)


def as_recorded(data: StepSet, every: dict[str, int]) -> StepSet:
    """The step set with the samples and rates that were recorded."""
    rows = [(run, every.get(run.name, 1)) for run in data.runs]
    return replace(data, runs=tuple(replace(r, samples=r.samples * k, rate_hz=r.rate_hz * k) for r, k in rows))


def thinned(time_s: Array, values: Array, points: int) -> tuple[Array, Array]:
    """At most about `points` samples of a curve, shape (≤ points + 2,): extremes of equal stretches, in order of time.

    A spike of one sample survives, which taking every k-th sample would lose.
    """
    keep = thinned_at(values, points)
    return time_s[keep], values[keep]


def thinned_at(values: Array, points: int) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
    """Which samples `thinned` keeps, rising; the first and the last are always among them."""
    n = len(values)
    if n <= points:
        return np.arange(n)
    stretches = max(points // 2, 1)
    width = -(-n // stretches)
    padded = np.full(-(-n // width) * width, np.nan)
    padded[:n] = np.nan_to_num(values)
    blocks = padded.reshape(-1, width)
    start = np.arange(len(blocks)) * width
    low = start + np.argmin(np.where(np.isnan(blocks), np.inf, blocks), axis=1)
    high = start + np.argmax(np.where(np.isnan(blocks), -np.inf, blocks), axis=1)
    return np.unique(np.concatenate([[0], low, high, [n - 1]]))
