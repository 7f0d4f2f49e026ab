"""Many plants under one controller and one reference: blocks of sixteen over threads, in machine code.

Every plant meets the same noise, so that plants differ by their parameters alone. What a plant does depends on no other
plant and on no thread: the same seed gives the same numbers on one thread and on many.
"""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np

from eaid.arrays import Array
from eaid.options import Rig
from eaid.replay.compiled import fits_lanes, loop_alone, loop_of_sixteen
from eaid.replay.controllers import Controller
from eaid.replay.lanes import LANES
from eaid.replay.loop import inputs_of
from eaid.replay.plant import PlantParameters
from eaid.replay.rig import rig_numbers

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
    acting = controller.on(rig)
    # every number a float: one machine code serves all gains
    gains = acting.gains._make(float(value) if isinstance(value, int) else value for value in acting.gains)
    numbers = rig_numbers(rig, dt_s, controller.gains.duty_max)
    reference = np.array(reference_nm, dtype=np.float64)
    n = len(reference)
    inputs = inputs_of(acting, reference, rig, dt_s, seed)

    def block(begin: int) -> None:
        """Sixteen plants, the last one repeated where they are fewer."""
        made_by: Any = type(acting.start)
        torque, duty = np.empty((n, LANES)), np.empty((n, LANES))
        chosen = [plants[min(begin + i, len(plants) - 1)] for i in range(LANES)]
        parameters = np.ascontiguousarray(np.array(chosen, dtype=np.float64).T)
        run = loop_of_sixteen(acting.step, made_by)
        run(gains, acting.start, parameters, numbers.memory, dt_s, inputs, torque, duty)
        count = min(LANES, len(plants) - begin)
        visit(begin, torque[:, :count], duty[:, :count])

    def single(begin: int) -> None:
        """The same number of plants, one after another."""
        run = loop_alone(acting.step)
        for i in range(begin, min(begin + LANES, len(plants))):
            filled = tuple(np.empty((6, n)))
            run(gains, acting.start, plants[i], numbers, dt_s, inputs, filled)
            visit(i, filled[0][:, None], filled[2][:, None])

    work = block if fits_lanes(acting, plants, numbers, dt_s) else single
    begins = range(0, len(plants), LANES)
    for begin in begins[:1]:  # alone, so that what is to be compiled is compiled once
        work(begin)
    with ThreadPoolExecutor(max_workers=threads or available_threads()) as pool:
        for _ in pool.map(work, begins[1:]):  # where a block fails or is interrupted, those that wait are given up
            pass
