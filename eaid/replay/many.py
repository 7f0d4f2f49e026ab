"""Many plants under one controller and one reference: blocks of sixteen over threads, in machine code.

Every plant meets the same noise, so that plants differ by their parameters alone. What a plant does depends on no other
plant and on no thread: the same seed gives the same numbers on one thread and on many.
"""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from queue import Empty, SimpleQueue
from typing import Any

import numpy as np

from eaid.arrays import Array
from eaid.replay.compiled import fits_lanes, one, sixteen
from eaid.replay.controllers import Controller
from eaid.replay.lanes import LANES
from eaid.replay.loop import inputs_of
from eaid.replay.plant import PlantParameters
from eaid.replay.rig import Rig, rig_numbers

Visit = Callable[[int, Array, Array], None]
"""visit(first, torque [N·m], duty [%]) for plants first, first + 1, …: arrays of shape (n, plants), to be copied
where kept."""


def available_threads() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def replay_many(
    plants: Sequence[PlantParameters],
    controller: Controller,
    reference_nm: Array,
    rig: Rig,
    dt_s: float,
    visit: Visit,
    seed: int = 0,
    threads: int | None = None,
) -> None:
    """Trace each plant from rest and show what it did to `visit`, block by block, in no fixed order, one call at a
    time a thread."""
    acting = controller if rig.saturation else controller.without_limits()
    gains = _floats(acting.gains)
    numbers = rig_numbers(rig, dt_s, controller.gains.duty_max)
    reference = np.array(reference_nm, dtype=np.float64)
    n = len(reference)
    inputs = inputs_of(acting, reference, rig, dt_s, seed)
    in_lanes = fits_lanes(acting, plants, numbers, dt_s)
    spare: SimpleQueue[tuple[Array, Array]] = SimpleQueue()

    def block(begin: int) -> None:
        """Sixteen plants, the last one repeated where they are fewer."""
        made_by: Any = type(acting.start)
        run = sixteen(acting.step, made_by)
        try:
            torque, duty = spare.get_nowait()
        except Empty:
            torque, duty = np.empty((n, LANES)), np.empty((n, LANES))
        chosen = [plants[min(begin + i, len(plants) - 1)] for i in range(LANES)]
        parameters = np.ascontiguousarray(np.array(chosen, dtype=np.float64).T)
        run(gains, acting.start, parameters, numbers.memory, dt_s, inputs, torque, duty)
        count = min(LANES, len(plants) - begin)
        visit(begin, torque[:, :count], duty[:, :count])
        spare.put((torque, duty))

    def single(begin: int) -> None:
        """The same number of plants, one after another."""
        run = one(acting.step)
        for i in range(begin, min(begin + LANES, len(plants))):
            filled = tuple(np.empty((6, n)))
            run(gains, acting.start, plants[i], numbers, dt_s, inputs, filled)
            visit(i, filled[0][:, None], filled[2][:, None])

    if len(plants) == 0:
        return
    work = block if in_lanes else single
    begins = iter(range(0, len(plants), LANES))

    def all_blocks() -> None:
        """Blocks until none is left: a thread fetches its next one itself, and nobody waits to hand it out."""
        try:
            for begin in begins:
                work(begin)
        finally:
            for _ in begins:  # where a block fails or is interrupted, no thread begins another
                pass

    work(next(begins))  # alone, so that what is to be compiled is compiled once
    others = min(threads or available_threads(), -(-len(plants) // LANES) - 1) - 1
    with ThreadPoolExecutor(max_workers=max(others, 1)) as pool:
        helping = [pool.submit(all_blocks) for _ in range(others)]
        all_blocks()
    for each in helping:
        each.result()


def _floats(gains: Any) -> Any:
    """Gains with every number a float: one machine code serves them all."""
    return gains._make(float(value) if isinstance(value, int) else value for value in gains)
