"""Repeats of one level on one time axis: sample by sample where they share it, else interpolated to the finest."""

from collections.abc import Sequence

import numpy as np

from eaid.arrays import Array, read_only
from eaid.steps.clock import clock_of
from eaid.steps.step import Step
from eaid.steps.stepset import Level


def _stacked(outputs: Sequence[Array], count: int) -> Array:
    """The first samples of some outputs, shape (R, count)."""
    return read_only(np.stack([output[:count] for output in outputs]))


def _grid(count: int, dt: float) -> Array:
    """k·dt for k = 0 … count − 1."""
    return read_only(np.arange(count) * dt)


def common(level: float, members: Sequence[Step]) -> Level:
    """A level of repeats, on their common window, the shortest.

    Uniform repeats of one rate are taken as they are; any other set is interpolated linearly onto the finest (median)
    sample time. A single run keeps its own axis.
    """
    names = tuple(member.run.name for member in members)
    times = [member.time_s for member in members]
    outputs = [member.rise for member in members]
    steps = [member.window.step_s for member in members]
    known = [step for step in steps if step is not None]
    shortest = min(len(time) for time in times)
    # the shortest sample time, not that of the first run: the order of the logs decides nothing
    if len(known) == len(steps) and max(known) - min(known) <= 1e-6 * min(known):
        return Level(level, _grid(shortest, min(known)), _stacked(outputs, shortest), names)
    if len(members) == 1 or all(np.array_equal(time[:shortest], times[0][:shortest]) for time in times):
        return Level(level, read_only(times[0][:shortest]), _stacked(outputs, shortest), names)
    dt = min(
        step if step is not None else clock_of(member.time_s).usual_s
        for step, member in zip(steps, members, strict=True)
    )
    end = min(float(time[-1]) for time in times)
    grid = _grid(int(np.floor(end / dt * (1 + 1e-12))) + 1, dt)
    stack = np.stack([np.interp(grid, time, output) for time, output in zip(times, outputs, strict=True)])
    return Level(level, grid, read_only(stack), names)
