"""Repeats of one level on one time axis: sample by sample where they share it, else interpolated to the finest."""

from collections.abc import Sequence

import numpy as np

from eaid.arrays import Array, read_only
from eaid.steps.stepset import Level

SAME = 2e-3
"""Share of the sample time within which sample instants count as equal: the rounding of written times."""


def uniform_step(time_s: Array) -> float | None:
    """Sample time [s] of an axis that starts at 0 and is k·dt to `SAME`; None where it is not."""
    count = len(time_s)
    if count < 2:
        return None
    dt = float(time_s[-1] - time_s[0]) / (count - 1)
    off = np.abs(time_s - time_s[0] - np.arange(count) * dt).max()
    if not off <= SAME * dt:
        return None
    tidy = float(f"{dt:.6g}")
    return tidy if abs(tidy - dt) * count <= SAME * dt else dt


def common(level: float, times: Sequence[Array], outputs: Sequence[Array], names: Sequence[str]) -> Level:
    """A level of repeats given from their step on: times [s], each starting at 0, and outputs, shape (n_r,) each.

    The common window is the shortest. Uniform repeats of one rate are taken as they are; any other set is interpolated
    linearly onto the finest (median) sample time. A single run keeps its own axis.
    """
    steps = [uniform_step(time) for time in times]
    first = steps[0]
    if first is not None and all(step is not None and abs(step - first) <= 1e-6 * first for step in steps):
        count = min(len(time) for time in times)
        stack = np.stack([output[:count] for output in outputs])
        return Level(level, read_only(np.arange(count) * first), read_only(stack), tuple(names), True)
    if len(times) == 1:
        return Level(level, times[0], read_only(outputs[0][np.newaxis]), tuple(names), False)
    same = min(len(time) for time in times)
    if all(np.array_equal(time[:same], times[0][:same]) for time in times):
        stack = np.stack([output[:same] for output in outputs])
        return Level(level, read_only(times[0][:same]), read_only(stack), tuple(names), False)
    dt = min(
        step if step is not None else float(np.median(np.diff(time))) for step, time in zip(steps, times, strict=True)
    )
    end = min(float(time[-1]) for time in times)
    grid = np.arange(int(np.floor(end / dt * (1 + 1e-12))) + 1) * dt
    stack = np.stack([np.interp(grid, time, output) for time, output in zip(times, outputs, strict=True)])
    return Level(level, read_only(grid), read_only(stack), tuple(names), True)
