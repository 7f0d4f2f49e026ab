"""Many plants under one controller and one reference, in machine code, one plant a thread.

Every plant meets the same noise, so that plants differ by their parameters alone. What a plant does depends on no other
plant and on no thread: the same seed gives the same numbers on one thread and on many, those of plain Python.

Every plain function that the loop calls is registered with numba, so that compiled code may call it; the loop itself is
a closure around a law.
"""

import os
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from inspect import isfunction
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numba.extending import register_jitable

from eaid.arrays import Array
from eaid.control.kinds import CONTROLLER_ROWS, ControllerStep
from eaid.options import RigExtras
from eaid.plant import dynamics
from eaid.plant.dynamics import Plant, plant_numbers
from eaid.plant.machine_code import compiled, fingerprint
from eaid.replay import controllers, loop
from eaid.replay.controllers import Controller
from eaid.replay.loop import rig_numbers
from eaid.replay.metrics import tracking_errors
from eaid.replay.references import Reference
from eaid.results.gains import Tracking
from eaid.results.replay import Distribution, PlantSpread, Worst

# The loop, and where the plant and the laws stand
LAW_MODULES = sorted({sys.modules[row.step.__module__] for row in CONTROLLER_ROWS}, key=str)
MODULES = (loop, dynamics, controllers, *LAW_MODULES)
for _module in MODULES:
    for _function in vars(_module).values():
        if isfunction(_function) and _function.__module__ == _module.__name__:
            register_jitable(error_model="numpy")(_function)


@cache
def compile_loop(law: ControllerStep) -> Any:
    """`closed_loop` of one law in machine code, kept on disk where there is a folder that numba may write to."""
    files = map(Path, (__file__, *(str(module.__file__) for module in MODULES)))
    return compiled(loop.loop_of(law), fingerprint(files), nogil=True)


QUANTILES = (0.0, 0.025, 0.25, 0.5, 0.75, 0.975, 1.0)
BAND_INSTANTS = 1000


def montecarlo(
    plants: Sequence[Plant],
    controller: Controller,
    reference: Reference,
    rig: RigExtras,
    seed: int = 0,
    tick: Callable[[], None] = lambda: None,
) -> tuple[PlantSpread, dict[str, Array]]:
    """Trace a controller on every plant; `tick` is called once a plant. Of each number how it is distributed and the
    worst plant; as tables each number of each plant, and a band of torque at `QUANTILES` for at most `BAND_INSTANTS`
    instants."""
    wanted, dt_s = reference.torque_nm, reference.dt_s
    shown = slice(None, None, -(-len(wanted) // BAND_INSTANTS))
    kept = np.empty((len(wanted[shown]), len(plants)))
    measured = np.empty((len(Tracking.__struct_fields__), len(plants)))

    inputs, run = loop.inputs_of(controller, wanted, rig, dt_s, seed), compile_loop(controller.step)

    def single(index: int) -> None:
        plant, filled = plant_numbers(plants[index]), tuple(np.zeros((4, len(wanted))))
        run(controller.gains, controller.start(dt_s), plant, rig_numbers(rig, dt_s), dt_s, inputs, filled)
        kept[:, index] = filled[0][shown]
        columns = {"reference_nm": wanted, "torque_nm": filled[0], "duty_pct": filled[2]}
        followed = tracking_errors(columns, controller.limits_pct, slice(reference.begin, None))
        measured[:, index] = msgspec.structs.astuple(followed)
        tick()

    single(0)  # alone, so that what is to be compiled is compiled once
    usable = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    with ThreadPoolExecutor(max_workers=usable) as pool:
        for _ in pool.map(single, range(1, len(plants))):  # where one fails, those that wait are given up
            pass
    values = dict(zip(Tracking.__struct_fields__, measured, strict=True))
    tables: dict[str, Array] = {
        "plants/band_time_s": (np.arange(len(wanted), dtype=np.float64) * dt_s)[shown],
        "plants/band_nm": np.quantile(kept, QUANTILES, axis=1),
        **{f"plants/metrics/{name}": each for name, each in values.items()},
    }
    spread = {
        name: Distribution(
            Worst(float(each.max()), int(each.argmax())), *np.quantile(each, (0.025, 0.5, 0.975)).tolist()
        )
        for name, each in values.items()
    }
    return PlantSpread(len(plants), spread), tables
