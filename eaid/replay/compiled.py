"""The functions of the loop in machine code: one source for plain Python and for numba.

Every plain function that a loop calls is registered with numba, so that compiled code may call it; the loops themselves
are closures around a law. What is compiled is kept on disk by numba under a key that includes what a closure holds:
among it a fingerprint of all sources, so that a changed law is never served from an old cache.
"""

import hashlib
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Any, Literal, TypedDict

import numba
from numba.extending import overload, register_jitable

from eaid.control import pi, rc
from eaid.models.parameters import TAU_FLOOR_S
from eaid.replay import adjoint, controllers, inverse, lanes, loop, plant, rate_limited
from eaid.replay.controllers import Controller, Step
from eaid.replay.plant import PlantParameters
from eaid.replay.rig import RigNumbers


class Flags(TypedDict, total=False):
    """Options of `numba.njit`."""

    error_model: Literal["python", "numpy"]
    nogil: bool
    fastmath: set[str]
    forceinline: bool


STRICT: Flags = {"error_model": "numpy", "nogil": True}
"""Every operation rounded as plain Python rounds it."""
ALONE: Flags = {**STRICT, "fastmath": {"contract", "arcp"}}
"""A multiplication and the addition after it may be rounded once, and a division by what never changes be a
multiplication: the result differs from plain Python's in the last bits alone."""

VECTOR: Flags = {**ALONE, "forceinline": True}
"""Every call inlined, without which no loop becomes vectors."""

CALLED = (
    plant.plant_terms, plant.plant_pull, plant.plant_step, rc.rc_terms, rc.rc_step, pi.pi_step,
    controllers.open_loop_step, controllers.feedforward_step,
    plant.rest, plant.rounded, plant.hold_step,
    inverse.duty_for, inverse.inverse_step, lanes.expm1_to_minus_one, lanes.tanh_within, lanes.short_step,
    inverse.follow, adjoint.cost_and_gradient,
    rate_limited.written_anew, rate_limited.taut_path,
)  # fmt: skip
for _function in CALLED:
    register_jitable(**VECTOR)(_function)


@overload(rc.tanh, jit_options=VECTOR)  # type: ignore[arg-type]  # flags by name
def _tanh(x: float) -> Callable[[float], float]:  # noqa: ARG001 - numba wants the name
    def without_a_call(x: float) -> float:
        return lanes.tanh_within(x)

    return without_a_call


@cache
def fingerprint() -> str:
    """Of every source that machine code is made of."""
    digest = hashlib.sha256()
    for module in (plant, rc, pi, inverse, controllers, loop, lanes, adjoint, rate_limited):
        digest.update(Path(str(module.__file__)).read_bytes())
    digest.update(Path(__file__).read_bytes())
    return digest.hexdigest()[:12]


def _kept(function: Callable[..., Any], options: Flags) -> Any:
    """A compiled function that is kept on disk, where there is a folder that numba may write to."""
    try:
        return numba.njit(cache=True, **options)(function)
    except RuntimeError:
        return numba.njit(**options)(function)


@cache
def kernel(function: Callable[..., Any]) -> Callable[..., Any]:
    """A plain function of `CALLED`, in machine code; the same bits."""
    sources = fingerprint()

    def run(*arguments: Any) -> Any:
        sources  # noqa: B018 - what a closure holds is part of numba's key
        return function(*arguments)

    return _kept(run, STRICT)  # type: ignore[no-any-return]


@cache
def loop_alone(law: Step) -> Callable[..., tuple[float, float]]:
    """`closed_loop` of one law in machine code: the same arguments, arrays in place of lists; the same numbers but for
    the last bits."""
    return _kept(loop.loop_of(law, fingerprint()), ALONE)  # type: ignore[no-any-return]


@cache
def loop_of_sixteen(law: Step, state: Callable[[float], Any]) -> Callable[..., None]:
    """`lanes.block_of` one law whose state is a tuple of one float."""
    return _kept(lanes.block_of(law, state, fingerprint()), {**ALONE, "forceinline": False})  # type: ignore[no-any-return]


def fits_lanes(controller: Controller, plants: Sequence[PlantParameters], rig: RigNumbers, dt_s: float) -> bool:
    """Whether blocks of sixteen serve: a state of one float, no delay, latch or resolution, and dt within every τ."""
    shortest = min([TAU_FLOOR_S, *(t for p in plants for t in (p.release1, p.release2) if t > 0.0)])
    plain = rig.duty_step == 0 and rig.delay == 0 and rig.pwm_period == 0
    return plain and len(controller.start) == 1 and dt_s <= shortest * (1 + 1e-9)
