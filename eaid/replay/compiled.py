"""The functions of the loop, as they stand, through numba: one source for plain Python and for machine code.

A pure function is compiled by giving a copy of it the compiled forms of the functions it calls as globals. What is
compiled is kept on
disk by numba, under a name that carries a fingerprint of the sources: a changed law is never served from an old cache.
"""

import hashlib
import math
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any

import numba
import numpy as np

from eaid.arrays import Array
from eaid.control import pi, rc
from eaid.replay import controllers, inverse, lanes, loop, plant
from eaid.replay.controllers import Controller, Step
from eaid.replay.plant import PlantParameters
from eaid.replay.rig import RigNumbers

STRICT: dict[str, Any] = {"error_model": "numpy", "nogil": True}
"""Every operation rounded as plain Python rounds it."""
ALONE: dict[str, Any] = {**STRICT, "fastmath": {"contract", "arcp"}}
"""A multiplication and the addition after it may be rounded once, and a division by what never changes be a
multiplication:
the result differs from plain Python's in the last bits alone."""
VECTOR: dict[str, Any] = {**ALONE, "forceinline": True}
"""Every call inlined, without which no loop becomes vectors."""


@cache
def _fingerprint() -> str:
    digest = hashlib.sha256()
    for module in (plant, rc, pi, inverse, controllers, loop, lanes):
        digest.update(Path(str(module.__file__)).read_bytes())
    digest.update(Path(__file__).read_bytes())
    return digest.hexdigest()[:12]


def _copy(function: Callable[..., Any], name: str, bindings: dict[str, Any]) -> FunctionType:
    """The same code with some of its global names bound to something else."""
    assert isinstance(function, FunctionType)
    copy = FunctionType(
        function.__code__, {**function.__globals__, **bindings}, name, function.__defaults__, function.__closure__
    )
    copy.__qualname__ = name
    copy.__module__ = __name__
    return copy


def _compiled(function: Callable[..., Any], options: dict[str, Any], **bindings: Any) -> Any:
    """A function and all plain functions that it names, compiled; bindings first."""
    for name in function.__code__.co_names:
        callee = function.__globals__.get(name)
        if name not in bindings and isinstance(callee, FunctionType):
            bindings[name] = _compiled(callee, options, **{key: bindings[key] for key in ("math",) if key in bindings})
    return numba.njit(**options)(_copy(function, function.__name__, bindings))


def _entry(function: Callable[..., Any], law: Step, options: dict[str, Any], bindings: dict[str, Any]) -> Any:
    """A compiled function that is kept on disk, one for each law."""
    outer = {**options, "forceinline": False}
    name = f"{function.__name__}_{law.__name__}_{_fingerprint()}"
    compiled = _copy(function, name, bindings)
    try:
        return numba.njit(cache=True, **outer)(compiled)
    except RuntimeError:  # no folder that numba may write to: compiled anew in every process
        return numba.njit(**outer)(compiled)


def _math(**functions: Any) -> ModuleType:
    """`math` with some of its functions replaced."""
    module = ModuleType("math")
    module.__dict__.update({name: getattr(math, name) for name in ("sqrt", "copysign", "exp", "floor", "ceil", "nan")})
    module.__dict__.update(functions)
    return module


def _run(
    gains: Any,
    start: Any,
    parameters: PlantParameters,
    rig: RigNumbers,
    dt: float,
    reference: Array,
    rate: Array,
    disturbance: Array,
    factor: Array,
    torque: Array,
    measured: Array,
    duty: Array,
    applied: Array,
    fast: Array,
    kept: Array,
) -> tuple[float, float]:
    return closed_loop(  # type: ignore[name-defined,no-any-return]  # noqa: F821
        gains, start, parameters, rig, dt, reference, rate, disturbance, factor,
        torque, measured, duty, applied, fast, kept,
    )  # fmt: skip


@cache
def kernel(function: Callable[..., Any]) -> Callable[..., Any]:
    """A plain function of floats, arrays and tuples of them, and all that it calls, in machine code; the same bits."""
    own = hashlib.sha256(Path(function.__code__.co_filename).read_bytes()).hexdigest()[:12]
    copy = _copy(function, f"{function.__name__}_{own}_{_fingerprint()}", _callees(function))
    try:
        return numba.njit(cache=True, **STRICT)(copy)  # type: ignore[no-any-return]
    except RuntimeError:  # no folder that numba may write to: compiled anew in every process
        return numba.njit(**STRICT)(copy)  # type: ignore[no-any-return]


def _callees(function: Callable[..., Any]) -> dict[str, Any]:
    """The plain functions that a function names, compiled."""
    named = {name: function.__globals__.get(name) for name in function.__code__.co_names}
    return {name: _compiled(callee, STRICT) for name, callee in named.items() if isinstance(callee, FunctionType)}


@cache
def one(law: Step) -> Callable[..., tuple[float, float]]:
    """`closed_loop` of one law in machine code: the same arguments without the law, arrays in place of lists;
    the same numbers but for the last bits."""
    around = loop.loop_of(_compiled(law, ALONE))
    return _entry(_run, law, ALONE, {"closed_loop": _compiled(around, ALONE)})  # type: ignore[no-any-return]


def _run_sixteen(
    gains: Any,
    start: Any,
    plants: Array,
    memory: float,
    dt: float,
    reference: Array,
    rate: Array,
    disturbance: Array,
    factor: Array,
    torque: Array,
    duty: Array,
) -> None:
    block(  # type: ignore[name-defined]  # noqa: F821
        gains, start, plants, memory, dt, reference, rate, disturbance, factor, torque, duty
    )


@cache
def sixteen(law: Step, state: Callable[[float], Any]) -> Callable[..., None]:
    """`lanes.block` of one law whose state is a tuple of one float."""
    exponential = numba.njit(**VECTOR)(lanes.expm1_to_minus_one)
    vector_step = _compiled(plant.plant_step, VECTOR, math=_math(expm1=exponential))
    vector_law = _compiled(law, VECTOR, math=_math(tanh=numba.njit(**VECTOR)(lanes.no_tanh)))
    again = _compiled(lanes.again_of(_compiled(law, ALONE), state), ALONE)
    around = lanes.block_of(vector_law, again, state)
    return _entry(_run_sixteen, law, VECTOR, {"block": _compiled(around, VECTOR, plant_step=vector_step)})  # type: ignore[no-any-return]


def fits_lanes(controller: Controller, plants: Sequence[PlantParameters], rig: RigNumbers, dt_s: float) -> bool:
    """Whether blocks of sixteen serve: a state of one float, no delay, latch or resolution, and dt within every τ."""
    shortest = min([plant.TAU_FLOOR_S, *(t for p in plants for t in (p.release1, p.release2) if t > 0.0)])
    plain = rig.duty_levels == 0 and rig.delay == 0 and rig.pwm_period == 0
    return plain and len(controller.start) == 1 and dt_s <= shortest * (1 + 1e-9)


def columns(samples: int, count: int) -> tuple[Array, ...]:
    """Empty arrays for a replay's columns."""
    return tuple(np.empty(samples) for _ in range(count))
