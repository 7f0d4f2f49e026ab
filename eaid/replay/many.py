"""Many plants under one controller and one reference, in machine code, one plant a thread.

Every plant meets the same noise, so that plants differ by their parameters alone. What a plant does depends on no other
plant and on no thread: the same seed gives the same numbers on one thread and on many, those of plain Python.

Every plain function that the loop calls is registered with numba, so that compiled code may call it; the loop itself is
a closure around a law. numba keeps what it compiles on disk under a key that includes what a closure holds: among it a
fingerprint of all sources, so that a changed law is never served from an old cache.
"""

import hashlib
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from inspect import isfunction
from pathlib import Path
from typing import Any

import msgspec
import numba
import numpy as np
from numba.extending import register_jitable

from eaid.arrays import Array
from eaid.models.parameters import Nonlinear
from eaid.options import Rig
from eaid.replay import controllers, loop
from eaid.replay.controllers import Controller, Step
from eaid.replay.loop import Trace, rig_numbers
from eaid.replay.plant import PlantParameters, plant_parameters
from eaid.replay.references import Reference, measure
from eaid.results.gains import Tracking
from eaid.results.replay import Distribution, Metrics, PlantSpread, Worst

# The loop, and where the laws and the plant stand
MODULES = [loop, *{sys.modules[law.__module__] for name, law in vars(controllers).items() if name.endswith("_step")}]
for _module in MODULES:
    for _function in vars(_module).values():
        if isfunction(_function) and _function.__module__ == _module.__name__:
            register_jitable(error_model="numpy")(_function)


@cache
def compiled(law: Step) -> Any:
    """`closed_loop` of one law in machine code, kept on disk where there is a folder that numba may write to."""
    sources = hashlib.sha256()
    for file in (__file__, *sorted(str(module.__file__) for module in MODULES)):
        sources.update(Path(file).read_bytes())
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
    visit: Callable[[int, Array, Array], None],
    seed: int = 0,
) -> None:
    """Trace each plant from rest and show what it did to `visit(index, torque [N·m], duty [%])`, in no fixed order, one
    call at a time a thread."""
    numbers = rig_numbers(rig, dt_s)
    inputs = loop.inputs_of(controller, reference_nm, rig, dt_s, seed)
    run = compiled(controller.step)

    def single(index: int) -> None:
        filled = tuple(np.empty((4, len(reference_nm))))
        run(controller.gains, controller.start, plants[index], numbers, dt_s, inputs, filled)
        visit(index, filled[0], filled[2])

    single(0)  # alone, so that what is to be compiled is compiled once
    usable = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    with ThreadPoolExecutor(max_workers=usable) as pool:
        for _ in pool.map(single, range(1, len(plants))):  # where one fails, those that wait are given up
            pass


QUANTILES = (0.0, 0.025, 0.25, 0.5, 0.75, 0.975, 1.0)
BAND_INSTANTS = 1000
GIVEN = ("from_nm", "to_nm", "frequency_hz")  # What a measurement repeats from its reference; no metric


def montecarlo(
    plants: Sequence[Nonlinear],
    controller: Controller,
    reference: Reference,
    rig: Rig,
    seed: int = 0,
    tick: Callable[[], None] = lambda: None,
) -> tuple[PlantSpread, dict[str, Array]]:
    """Trace a controller on every plant and measure each; `tick` is called once a plant.

    Of each metric its distribution, and the worst plant with its parameters; and as tables each metric's value for each
    plant, NaN where it is never reached, and a band of at most `BAND_INSTANTS` instants: torque at `QUANTILES`.
    """
    n = len(reference.torque_nm)
    stride = -(-n // BAND_INSTANTS)
    kept = np.empty((len(range(0, n, stride)), len(plants)))
    measured: dict[int, dict[str, float]] = {}
    time_s: Array = np.arange(n, dtype=np.float64) * reference.dt_s

    def visit(index: int, torque: Array, duty: Array) -> None:
        kept[:, index] = torque[::stride]
        done = Trace(controller.name, reference.dt_s, time_s, reference.torque_nm, torque, duty, controller.limits_pct)
        measured[index] = dict(flattened(measure(done, reference)))
        tick()

    flat = [plant_parameters(p) for p in plants]
    replay_many(flat, controller, reference.torque_nm, rig, reference.dt_s, visit, seed)
    values = {name: np.array([measured[i][name] for i in range(len(plants))]) for name in measured[0]}
    tables = {
        "plants/band_time_s": time_s[::stride],
        "plants/band_nm": np.quantile(kept, QUANTILES, axis=1),
        **{f"plants/metrics/{name}": each for name, each in values.items()},
    }
    return PlantSpread(len(plants), {name: _summary(name, each, plants) for name, each in values.items()}), tables


def flattened(measured: Metrics) -> Iterator[tuple[str, float]]:
    """Metrics as name and number: `steps[3].overshoot_pct`, `frequencies[0.2 Hz].gain_db`; NaN for never."""
    named: list[tuple[str, msgspec.Struct, tuple[str, ...]]] = [("", measured, Tracking.__struct_fields__)]
    named += [(f"steps[{k}].", step, step.__struct_fields__) for k, step in enumerate(measured.steps, 1)]
    tones = measured.frequencies
    named += [(f"frequencies[{tone.frequency_hz:g} Hz].", tone, tone.__struct_fields__) for tone in tones]
    for prefix, part, names in named:
        for name in names:
            if name not in GIVEN:
                value = getattr(part, name)
                yield prefix + name, float("nan") if value is None else float(value)


def _summary(name: str, values: Array, plants: Sequence[Nonlinear]) -> Distribution:
    reached = values[np.isfinite(values)]
    signed = name.endswith(("gain_db", "phase_deg"))
    worst = int(np.argmax(np.where(np.isfinite(values), np.abs(values) if signed else values, np.inf)))
    plant = plants[worst]
    low, middle, high = np.quantile(reached, (0.025, 0.5, 0.975)).tolist() if len(reached) else (None,) * 3
    value = float(values[worst]) if np.isfinite(values[worst]) else None
    return Distribution(
        worst=Worst(value=value, plant=worst, tau1=plant.tau1, tau2=plant.tau2, Ts=plant.Ts),
        mean=float(reached.mean()) if len(reached) else None,
        sd=None if not len(reached) else float(reached.std(ddof=1)) if len(reached) > 1 else 0.0,
        low=low,
        median=middle,
        high=high,
        never=len(values) - len(reached),
    )
