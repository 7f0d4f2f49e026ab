"""Many plants under one controller and one reference, in machine code, one plant a thread.

Every plant meets the same noise, so that plants differ by their parameters alone. What a plant does depends on no other
plant and on no thread: the same seed gives the same numbers on one thread and on many, those of plain Python.

Every plain function that the loop calls is registered with numba, so that compiled code may call it; the loop itself is
a closure around a law. numba keeps what it compiles on disk under a key that includes what a closure holds: among it a
fingerprint of all sources, so that a changed law is never served from an old cache.
"""

import hashlib
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path
from typing import Any

import numba
import numpy as np
from numba.extending import register_jitable

from eaid.arrays import Array
from eaid.control import pi, rc
from eaid.replay import controllers, inverse, loop, plant
from eaid.replay.controllers import Controller, Step
from eaid.replay.plant import PlantParameters
from eaid.replay.rig import Rig, rig_numbers

Visit = Callable[[int, Array, Array], None]
"""visit(index, torque [N·m], duty [%]) of one plant: arrays of shape (n,)."""

for _function in (
    plant.plant_terms, plant.plant_pull, plant.plant_step, plant.rest, plant.rounded, plant.hold_step, rc.rc_terms,
    rc.rc_step, pi.pi_step, controllers.open_loop_step, controllers.feedforward_step, inverse.duty_for,
    inverse.inverse_step,
):  # fmt: skip
    register_jitable(error_model="numpy")(_function)


@cache
def compiled(law: Step) -> Any:
    """`closed_loop` of one law in machine code, kept on disk where there is a folder that numba may write to."""
    sources = hashlib.sha256()
    for file in (__file__, *(module.__file__ for module in (plant, rc, pi, inverse, controllers, loop))):
        sources.update(Path(str(file)).read_bytes())
    function = loop.loop_of(law, sources.hexdigest())
    try:
        return numba.njit(error_model="numpy", nogil=True, cache=True)(function)
    except RuntimeError:
        return numba.njit(error_model="numpy", nogil=True)(function)


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
    """Trace each plant from rest and show what it did to `visit`, in no fixed order, one call at a time a thread."""
    acting = controller.on(rig)
    # every number a float: one machine code serves all gains
    gains = acting.gains._make(float(value) if isinstance(value, int) else value for value in acting.gains)
    numbers = rig_numbers(rig, dt_s, controller.gains.duty_max)
    inputs = loop.inputs_of(acting, np.array(reference_nm, dtype=np.float64), rig, dt_s, seed)
    run = compiled(acting.step)

    def single(index: int) -> None:
        filled = tuple(np.empty((6, len(reference_nm))))
        run(gains, acting.start, plants[index], numbers, dt_s, inputs, filled)
        visit(index, filled[0], filled[2])

    single(0)  # alone, so that what is to be compiled is compiled once
    usable = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    with ThreadPoolExecutor(max_workers=threads or usable) as pool:
        for _ in pool.map(single, range(1, len(plants))):  # where one fails, those that wait are given up
            pass
